//! Files written by the test itself → entities. (`shared_scenes.rs` has the large collections.)

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod animation;
mod builder;
mod compressed;
mod files;
mod framing;
mod gltf;
mod layers;
mod mtl_maps;
mod names;
mod normal_maps;
mod obj;
mod obj_dialects;
mod obj_parts;
mod obj_wild;
mod obj_words;
mod settings;

use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, Vec2, Vec3};
use penumbra::load::{
    LoadError, LoadOptions, LoadReport, SceneSource, SidecarFilter, SidecarIntegrator, built_in_scenes, load,
};
use penumbra::scene::{
    ActiveCamera, Alpha, Camera, Encoding, Filter, GlobalTransform, Glossy, Instance, Light, Material, Mesh,
    Projection, SceneBounds, Texture, TriangleMesh, Visible, Wrap,
};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A folder that is gone when the test is over.
struct Folder(PathBuf);

impl Folder {
    fn new(files: &[(&str, &[u8])]) -> Self {
        static NUMBER: AtomicUsize = AtomicUsize::new(0);
        let name = format!("penumbra-{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
        let folder = Self(std::env::temp_dir().join(name));
        std::fs::create_dir_all(&folder.0).unwrap();
        for (name, content) in files {
            let path = folder.0.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, content).unwrap();
        }
        folder
    }

    fn load(&self, name: &str) -> (World, Result<LoadReport, LoadError>) {
        self.load_with(name, &LoadOptions::default())
    }

    fn load_with(&self, name: &str, options: &LoadOptions) -> (World, Result<LoadReport, LoadError>) {
        let mut world = World::new();
        let result = load(&mut world, &SceneSource::File(self.0.join(name)), options);
        (world, result)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Loads one file that must be accepted.
fn loaded(name: &str, content: &str) -> (World, LoadReport) {
    loaded_all(&[(name, content.as_bytes())])
}

/// Loads the first of these files, which must be accepted.
fn loaded_all(files: &[(&str, &[u8])]) -> (World, LoadReport) {
    let (world, result) = Folder::new(files).load(files[0].0);
    (world, result.unwrap_or_else(|error| panic!("{error}")))
}

/// The message with which one file is refused; nothing may be left in the world.
fn refusal(name: &str, content: &str) -> String {
    let (mut world, result) = Folder::new(&[(name, content.as_bytes())]).load(name);
    let message = result.expect_err("accepted").to_string();
    assert!(message.contains(name), "does not name the file: {message}");
    assert!(!message.contains('\n'), "more than one line: {message}");
    assert_eq!(world.query::<&Name>().iter(&world).count(), 0, "left entities behind");
    message
}

fn assert_says(text: &str, words: &str) {
    assert!(text.contains(words), "`{words}` is not in: {text}");
}

fn only_mesh(world: &mut World) -> TriangleMesh {
    let mut query = world.query::<&Mesh>();
    query.single(world).unwrap().0.as_ref().clone()
}

fn named<T: Component + Clone>(world: &mut World, name: &str) -> T {
    let mut query = world.query::<(&Name, &T)>();
    let found = query.iter(world).find(|(n, _)| n.as_str() == name).map(|(_, component)| component.clone());
    found.unwrap_or_else(|| panic!("nothing called {name}"))
}

fn lights(world: &mut World) -> Vec<Light> {
    world.query::<&Light>().iter(world).cloned().collect()
}

fn base64(bytes: &[u8]) -> String {
    let digit = |bits: u32| {
        char::from(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"[(bits & 63) as usize])
    };
    let word = |chunk: &[u8]| {
        let [a, b, c] = [0, 1, 2].map(|i| u32::from(chunk.get(i).copied().unwrap_or(0)));
        let bits = a << 16 | b << 8 | c;
        let digits: String =
            [18, 12, 6, 0].iter().take(chunk.len() + 1).map(|shift| digit(bits >> shift)).collect();
        format!("{digits:=<4}")
    };
    bytes.chunks(3).map(word).collect()
}

/// A triangle with positions, texture coordinates and normals in one buffer; `more` is put into the JSON.
fn gltf_triangle(node: &str, primitive: &str, more: &str) -> String {
    let floats: [f32; 24] = [
        0., 0., 0., 1., 0., 0., 0., 1., 0., // positions
        0., 0., 1., 0., 0., 1., // texture coordinates
        0., 0., 1., 0., 0., 1., 0., 0., 1., // normals
    ];
    let bytes: Vec<u8> = floats.iter().flat_map(|f| f.to_le_bytes()).collect();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0{node}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1}}{primitive}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
                     {{"bufferView":0,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC2"}},
                     {{"bufferView":0,"byteOffset":60,"componentType":5126,"count":3,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":96}}],
        "buffers":[{{"byteLength":96,"uri":"data:application/octet-stream;base64,{}"}}]{more}}}"#,
        base64(&bytes)
    )
}

/// A PNG of one texel of this colour.
fn png(color: [u8; 4]) -> Vec<u8> {
    picture(&color, 1, image::ImageFormat::Png)
}

/// A white PNG of this side.
fn png_of(side: u32) -> Vec<u8> {
    picture(&vec![255; (4 * side * side) as usize], side, image::ImageFormat::Png)
}

/// A square picture of these RGBA bytes.
fn picture(rgba: &[u8], side: u32, format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = std::io::Cursor::new(&mut bytes);
    image::write_buffer_with_format(&mut writer, rgba, side, side, image::ColorType::Rgba8, format).unwrap();
    bytes
}

const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn every_built_in_scene_loads_without_a_warning() {
    for scene in built_in_scenes() {
        let source = SceneSource::parse(scene.name).unwrap();
        assert_eq!(source, SceneSource::BuiltIn(scene.name));
        let mut world = World::new();
        let report =
            load(&mut world, &source, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        assert!(report.warnings().is_empty(), "{}: {:?}", scene.name, report.warnings());
        assert!(report.triangles > 0 && !report.cameras.is_empty(), "{}", scene.name);
        let shines = world.query::<&Light>().iter(&world).count()
            + world.query::<&Material>().iter(&world).filter(|m| m.emission != Vec3::ZERO).count();
        assert!(shines > 0, "{}: dark", scene.name);
        assert!(
            !report.decisions().iter().any(|line| line.contains("no light") || line.contains("no camera")),
            "{:?}",
            report.decisions()
        );
    }
}

#[test]
fn the_bust_has_as_many_triangles_as_its_name_says() {
    let mut world = World::new();
    let report = load(&mut world, &SceneSource::BuiltIn("bust"), &LoadOptions::default()).unwrap();
    assert_eq!(report.triangles, 968 + 2);
}

#[test]
fn both_cornell_boxes_have_the_same_walls() {
    let area = |name: &'static str| {
        let mut world = World::new();
        load(&mut world, &SceneSource::BuiltIn(name), &LoadOptions::default()).unwrap();
        let mut query = world.query::<(&Instance, &GlobalTransform)>();
        let mut sum = 0.0;
        for (instance, transform) in query.iter(&world) {
            let mesh = &world.get::<Mesh>(instance.mesh).unwrap().0;
            for i in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(i).map(|p| transform.0.transform_point3(p.as_dvec3()));
                sum += 0.5 * (b - a).cross(c - a).length();
            }
        }
        sum
    };
    let light = 0.13 * 0.105;
    assert!((area("cornell") * 1e-6 + light - area("cornell-gltf")).abs() < 1e-5);
}

#[test]
fn arguments_are_files_or_names_with_a_hint() {
    assert_eq!(SceneSource::parse("no/such.glb").unwrap(), SceneSource::File(PathBuf::from("no/such.glb")));
    assert_eq!(SceneSource::parse("no/such.glb").unwrap().name(), "such");
    assert_eq!(SceneSource::parse("cornell").unwrap().name(), "cornell");
    let message = SceneSource::parse("cornel").unwrap_err().to_string();
    assert_says(&message, "did you mean `cornell`?");
    assert_says(&message, "gallery");
    let error =
        load(&mut World::new(), &SceneSource::File(PathBuf::from("no/such.glb")), &LoadOptions::default())
            .unwrap_err();
    assert_says(&error.to_string(), "no/such.glb: no such file");
    let error =
        load(&mut World::new(), &SceneSource::File(Path::new("/").to_path_buf()), &LoadOptions::default())
            .unwrap_err();
    assert_says(&error.to_string(), "not a regular file");
}

#[test]
fn a_file_of_unknown_format_is_refused_with_what_is_read() {
    assert_says(&refusal("a.fbx", "Kaydara"), "Penumbra reads .gltf, .glb, .obj and .toml");
}
