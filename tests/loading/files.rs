//! Which files a scene is made of.

use super::*;
use penumbra::load::stamp;

#[test]
fn all_that_was_read_or_missed_is_known_wherever_it_is() {
    let folder = Folder::new(&[
        ("here/scene.toml", b"[[model]]\nfile = '../models/a.obj'\n[[model]]\nfile = '../models/b.gltf'\n"),
        ("models/a.obj", format!("mtllib a.mtl gone.mtl\nusemtl m\n{QUAD}f 1 2 3\n").as_bytes()),
        ("models/a.mtl", b"newmtl m\nmap_Kd deep/down/wood.ktx2\nmap_Ks gone/gloss.tif\n"),
        ("models/deep/down/wood.ktx2", b"no picture"),
        (
            "models/b.gltf",
            br#"{"asset":{"version":"2.0"},"images":[{"uri":"Gone.png"}],"textures":[{"source":0}],
                "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}]}"#,
        ),
        ("far/settings.toml", b"[render]\nspp = 2\n"),
        ("models/unused.png", b"not ours"),
    ]);
    let options =
        LoadOptions { scene_settings: Some(folder.0.join("far/settings.toml")), ..LoadOptions::default() };
    folder.load_with("here/scene.toml", &options).1.unwrap();
    let files = options.files.list();
    let models = folder.0.join("here/../models");
    for there in ["here/scene.toml", "far/settings.toml", "here/../models/a.obj", "here/../models/b.gltf"] {
        let path = folder.0.join(there);
        assert!(stamp(&path).is_some() && files.get(&path) == Some(&stamp(&path)), "{there} of {files:?}");
    }
    for there in ["a.mtl", "deep/down/wood.ktx2"] {
        assert!(files.get(&models.join(there)).is_some_and(Option::is_some), "{there} of {files:?}");
    }
    for missing in ["gone.mtl", "gone/gloss.tif", "Gone.png"] {
        assert_eq!(files.get(&models.join(missing)), Some(&None), "{missing}");
    }
    assert!(files.keys().all(|path| !path.ends_with("unused.png")), "{files:?}");
}

#[test]
fn a_scene_that_cannot_be_loaded_says_what_it_asked_for_and_settings_may_come_later() {
    let folder = Folder::new(&[("broken.toml", b"[[model]]\nfile = 'gone.obj'\n"), ("a.obj", b"v 0 0 0\n")]);
    let options = LoadOptions::default();
    assert!(folder.load_with("broken.toml", &options).1.is_err());
    assert_eq!(options.files.list().get(&folder.0.join("gone.obj")), Some(&None));
    let options = LoadOptions::default();
    folder.load_with("a.obj", &options).1.unwrap();
    assert_eq!(options.files.list().get(&folder.0.join("a.toml")), Some(&None));
}
