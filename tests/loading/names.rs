//! Files whose names are spelled another way than a scene spells them, folders in place of scenes, and names of materials.

use super::*;
use penumbra::load::scenes_in;

/// `é` as one letter and as two.
const SPELLINGS: [&str; 2] = ["Caf\u{e9} rot.png", "Cafe\u{301} rot.png"];

fn is_red(world: &mut World) -> bool {
    let texture = world.query::<&Texture>().single(world).unwrap();
    texture.texels.texels == [[200, 100, 50, 255]]
}

#[test]
fn a_picture_is_found_however_its_name_and_folder_are_spelled() {
    let red = png([200, 100, 50, 255]);
    for there in SPELLINGS {
        let there = format!("Textures/{there}");
        for reference in [
            "textures/cafe\u{301} rot.png",
            "Textures/CAF\u{c9} ROT.PNG",
            "Textures\\Caf\u{e9} rot.png",
            "./x/../textures/Caf\u{e9}%20rot.png",
            "C:\\Users\\me\\scene\\textures\\Caf\u{e9} rot.png",
            "file:///home/me/textures/Cafe\u{301} rot.png",
            "Caf%C3%A9%20rot.png",
        ] {
            let obj = format!("mtllib Sub\\A.MTL\n{QUAD}usemtl m\nf 1 2 3 4\n");
            let library = format!("newmtl m\nmap_Kd {reference}\n");
            let files: [(&str, &[u8]); 3] =
                [("a.obj", obj.as_bytes()), ("sub/a.mtl", library.as_bytes()), (&there, &red)];
            let (mut world, report) = loaded_all(&files);
            assert!(is_red(&mut world), "{reference} for {there}: {:?}", report.warnings());
            let uri = reference.replace('\\', "\\\\");
            let gltf = gltf_triangle(
                "",
                r#","material":0"#,
                &format!(
                    r#","materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],"textures":[{{"source":0}}],"images":[{{"uri":"{uri}"}}]"#
                ),
            );
            let (mut world, report) = loaded_all(&[("a.gltf", gltf.as_bytes()), (&there, &red)]);
            assert!(is_red(&mut world), "{reference} for {there}: {:?}", report.warnings());
        }
    }
}

#[test]
fn a_folder_of_a_foreign_path_is_found_by_its_own_name() {
    let red = png([200, 100, 50, 255]);
    let obj = format!("mtllib a.mtl\n{QUAD}usemtl m\nf 1 2 3 4\n");
    let library = b"newmtl m\nmap_Kd D:\\work\\house\\maps\\wood.png\n";
    let files: [(&str, &[u8]); 3] = [("a.obj", obj.as_bytes()), ("a.mtl", library), ("Maps/Wood.png", &red)];
    assert!(is_red(&mut loaded_all(&files).0));
}

#[test]
#[cfg(target_os = "linux")]
fn a_scene_whose_name_is_no_text_loads_with_all_that_is_named_after_it() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::new(&[("a.mtl", b"newmtl m\nKd 1 0 0\n"), ("a.toml", b"[render]\nspp = 7\n")]);
    let named = |ending: &str| folder.0.join(OsStr::from_bytes(&[b"caf\xe9", ending.as_bytes()].concat()));
    std::fs::write(named(".obj"), format!("mtllib gone.mtl\n{QUAD}usemtl m\nf 1 2 3 4\n")).unwrap();
    std::fs::rename(folder.0.join("a.mtl"), named(".mtl")).unwrap();
    std::fs::rename(folder.0.join("a.toml"), named(".toml")).unwrap();
    let source = SceneSource::parse(named(".obj")).unwrap();
    assert_eq!(source.stem(), OsStr::from_bytes(b"caf\xe9"));
    let mut world = World::new();
    let report = load(&mut world, &source, &LoadOptions::default()).unwrap();
    assert_eq!((report.triangles, report.render.spp), (2, Some(7)));
    assert_eq!(super::named::<Material>(&mut world, "m").base_color, Vec3::X);
}

#[test]
fn a_folder_is_its_only_scene_or_names_them_all() {
    let scene: &[u8] = b"v 0 0 0\n";
    let folder = Folder::new(&[
        ("one/Model.OBJ", scene),
        ("one/notes.toml", b"[render]\nspp = 2\n"),
        ("one/._model.obj", scene),
        ("one/textures/a.png", b""),
        ("deep/source/model.glb", scene),
        ("two/b.gltf", scene),
        ("two/a.obj", scene),
        ("two/all.toml", b"[[model]]\nfile = 'a.obj'\n"),
        ("none/readme.txt", b""),
    ]);
    let parse = |name: &str| SceneSource::parse(folder.0.join(name));
    assert_eq!(parse("one").unwrap(), SceneSource::File(folder.0.join("one/Model.OBJ")));
    assert_eq!(parse("one/").unwrap().name(), "Model");
    assert_eq!(parse("deep").unwrap(), SceneSource::File(folder.0.join("deep/source/model.glb")));
    let two = parse("two").unwrap_err().to_string();
    for words in ["is a folder; name one of its scenes", "a.obj", "all.toml", "b.gltf"] {
        assert_says(&two, words);
    }
    assert_says(&parse("none").unwrap_err().to_string(), "is a folder; no .gltf, .glb or .obj file is in it");
    let all = ["deep/source/model.glb", "one/Model.OBJ", "two/a.obj", "two/all.toml", "two/b.gltf"];
    assert_eq!(scenes_in(&folder.0), all.map(|name| folder.0.join(name)));
}

#[test]
fn gltf_materials_of_one_name_or_none_are_told_apart_by_number() {
    let material = |name: &str| format!(r#"{{{name}"alphaMode":"ODD"}}"#);
    let materials = [r#""name":"m","#, r#""name":"m","#, r#""name":"","#, ""].map(material).join(",");
    let text = gltf_triangle("", r#","material":0"#, &format!(r#","materials":[{materials}]"#));
    let (_, report) = loaded("a.gltf", &text);
    let said = report.warnings().join("\n");
    assert_says(&said, "material `m` (0), material `m` (1), material `material 2`, material `material 3`");
}
