//! What is decided by a small picture of the scene: light and exposure.

use bevy_ecs::prelude::Entity;
use glam::{UVec2, Vec3};
use penumbra::image::Display;
use penumbra::load::{LoadOptions, LoadReport, SceneSource};
use penumbra::open::{Opened, Pose, SceneOrigin, Wishes, open};
use penumbra::scene::path::path_of;
use penumbra::scene::{Instance, Light, Material};
use penumbra::trace::RenderSettings;
use std::path::Path;

fn opened(name: &str, obj: &str, mtl: &str) -> Opened {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("first_look");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join(format!("{name}.mtl")), mtl).unwrap();
    let path = folder.join(format!("{name}.obj"));
    std::fs::write(&path, format!("mtllib {name}.mtl\n{obj}")).unwrap();
    open(&SceneSource::File(path), &LoadOptions::default(), &Wishes::default()).unwrap()
}

fn lights(opened: &mut Opened) -> usize {
    opened.app.world.query::<&Light>().iter(&opened.app.world).count()
}

fn says(report: &LoadReport, words: &str) -> bool {
    report.decisions().iter().any(|line| line.contains(words))
}

/// A floor, seen from above, and a square of material `lamp` of half its size at the height `y`, facing down.
fn floor_and_lamp(y: f32) -> String {
    format!(
        "v -1 0 1\nv 1 0 1\nv 1 0 -1\nv -1 0 -1\nusemtl floor\nf 1 2 3 4\n\
         v -.5 {y} 1\nv .5 {y} 1\nv .5 {y} 0\nv -.5 {y} 0\nusemtl lamp\nf 8 7 6 5\n"
    )
}

const MTL: &str = "newmtl floor\nKd .5 .5 .5\nnewmtl lamp\nKd 0 0 0\nKe 5 5 5\n";

#[test]
fn a_lamp_that_lights_the_floor_is_the_light() {
    let mut scene = opened("lamp", &floor_and_lamp(1.0), MTL);
    assert_eq!(lights(&mut scene), 0);
    assert!(!says(&scene.report, "light hardly anything"), "{:?}", scene.report.decisions());
}

#[test]
fn a_glow_that_reaches_nothing_gets_light_beside_it() {
    // Below the floor.
    let mut scene = opened("glow", &floor_and_lamp(-0.2), MTL);
    assert_eq!(lights(&mut scene), 2);
    assert!(says(&scene.report, "light hardly anything"), "{:?}", scene.report.decisions());
}

#[test]
fn a_picture_far_off_is_exposed_and_a_good_one_is_not() {
    let bright = MTL.replace("Ke 5 5 5", "Ke 5000 5000 5000");
    let scene = opened("bright", &floor_and_lamp(1.0), &bright);
    let stops = scene.app.world.resource::<Display>().exposure;
    assert!((-14.0..-6.0).contains(&stops), "{stops}");
    assert!(says(&scene.report, "exposed by -"));
    let good = MTL.replace("Ke 5 5 5", "Ke 1 1 1");
    let scene = opened("good", &floor_and_lamp(1.0), &good);
    assert_eq!(scene.app.world.resource::<Display>().exposure, 0.0, "{:?}", scene.report.decisions());
}

#[test]
fn a_glowing_thing_alone_stays_alone() {
    let mut scene = opened("alone", "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl lamp\nf 1 2 3\n", MTL);
    assert_eq!(lights(&mut scene), 0, "{:?}", scene.report.decisions());
}

#[test]
fn a_faint_glow_of_everything_is_no_lamp() {
    let box_of = |glow: &str| {
        let mtl = MTL.replace("Kd .5 .5 .5", &format!("Kd .6 .6 .6\nKe {glow}"));
        lights(&mut opened("faint", "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl floor\nf 1 2 3\n", &mtl))
    };
    assert_eq!((box_of("0 0 .1"), box_of("0 0 5")), (2, 0));
}

#[test]
fn a_dark_island_in_a_glowing_sea_gets_light() {
    let sea = "v -4 0 4\nv 4 0 4\nv 4 0 -4\nv -4 0 -4\nusemtl lamp\nf 1 2 3 4\n";
    let island = "v -1 .1 1\nv 1 .1 1\nv 1 .1 -1\nv -1 .1 -1\nusemtl floor\nf 5 6 7 8\n";
    let mut scene = opened("island", &format!("{sea}{island}"), MTL);
    assert_eq!(lights(&mut scene), 2, "{:?}", scene.report.decisions());
    assert!(says(&scene.report, "light hardly anything"));
}

#[test]
fn a_screen_with_a_black_patch_is_no_dark_scene() {
    let picture = |x: u32, y: u32| if x < 3 && y < 3 { [0, 0, 0] } else { [255; 3] };
    let texture = image::RgbImage::from_fn(10, 10, |x, y| image::Rgb(picture(x, y)));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("first_look");
    std::fs::create_dir_all(&folder).unwrap();
    texture.save(folder.join("patch.png")).unwrap();
    let screen = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl screen\nf 1/1 2/2 3/3 4/4\n";
    let mtl = "newmtl screen\nKd 0 0 0\nKe 1 1 1\nmap_Ke patch.png\n";
    let mut scene = opened("screen", screen, mtl);
    assert_eq!(lights(&mut scene), 0, "{:?}", scene.report.decisions());
}

/// Composed by its author for a picture of that shape.
#[test]
fn the_picture_has_the_shape_that_the_files_camera_asks_for() {
    let folder = std::env::temp_dir().join(format!("penumbra-shape-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("a.gltf");
    let size = |camera: &str, wishes: &Wishes| {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,1]}}],
            "nodes":[{{"camera":0,"translation":[0,0,3]}},{{"mesh":0}}],"cameras":[{{{camera}}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],
            "buffers":[{{"byteLength":36,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}]}}"#
        );
        std::fs::write(&file, text).unwrap();
        let opened = open(&SceneSource::File(file.clone()), &LoadOptions::default(), wishes).unwrap();
        opened.app.world.resource::<RenderSettings>().size
    };
    let perspective =
        |aspect: &str| format!(r#""type":"perspective","perspective":{{"yfov":0.7,"znear":0.1{aspect}}}"#);
    let none = Wishes::default();
    assert_eq!(size(&perspective(""), &none), UVec2::new(960, 540));
    assert_eq!(size(&perspective(r#","aspectRatio":1.7777777"#), &none), UVec2::new(960, 540));
    assert_eq!(size(&perspective(r#","aspectRatio":1"#), &none), UVec2::splat(720));
    assert_eq!(size(&perspective(r#","aspectRatio":0.5"#), &none), UVec2::new(360, 720));
    assert_eq!(size(&perspective(r#","aspectRatio":-1"#), &none), UVec2::new(960, 540));
    let flat = r#""type":"orthographic","orthographic":{"xmag":4,"ymag":2,"znear":0,"zfar":9}"#;
    assert_eq!(size(flat, &none), UVec2::new(1018, 509));
    // Seen otherwise, it is still that camera; and who asks for a size has it.
    let pose = Pose { lens_radius: Some(0.01), ..Pose::default() };
    let wishes = Wishes { pose, ..Wishes::default() };
    assert_eq!(size(&perspective(r#","aspectRatio":1"#), &wishes), UVec2::splat(720));
    let wishes = Wishes { size: Some(UVec2::new(64, 48)), ..Wishes::default() };
    assert_eq!(size(&perspective(r#","aspectRatio":1"#), &wishes), UVec2::new(64, 48));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn what_is_edited_changes_nothing_that_was_decided_before() {
    let mut scene = opened("edited", &floor_and_lamp(1.0), &MTL.replace("Ke 5 5 5", "Ke 5000 5000 5000"));
    let exposure = scene.app.world.resource::<Display>().exposure;
    assert!(exposure < -6.0, "{exposure}");
    let world = &mut scene.app.world;
    let (entity, instance) = world.query::<(Entity, &Instance)>().iter(world).next().unwrap();
    let shines =
        |&material: &Entity| world.get::<Material>(material).is_some_and(|m| m.emission != Vec3::ZERO);
    let slot = instance.materials.iter().position(shines).unwrap();
    let path = path_of(world, entity);
    // Dimmed, and put out: nobody is given another light or exposure for it.
    for emission in ["[1, 1, 1]", "[0, 0, 0]"] {
        let edits =
            format!("[[edit]]\nentity = {path:?}\nslot = {slot}\nmaterial = {{ emission = {emission} }}\n");
        let options = LoadOptions { edits: Some(edits), ..LoadOptions::default() };
        let source = scene.app.world.resource::<SceneOrigin>().source.clone();
        let mut edited = open(&source, &options, &Wishes::default()).unwrap();
        assert!(edited.report.warnings().is_empty(), "{:?}", edited.report.warnings());
        let mut materials = edited.app.world.query::<&Material>();
        assert!(materials.iter(&edited.app.world).all(|material| material.emission.x < 2.0), "it is edited");
        assert_eq!(lights(&mut edited), 0, "{emission}");
        assert_eq!(edited.app.world.resource::<Display>().exposure, exposure, "{emission}");
    }
}
