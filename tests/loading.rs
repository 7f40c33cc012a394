//! Files written by the test itself → entities. (`shared_scenes.rs` has the large collections.)

use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, Vec2, Vec3};
use penumbra::load::{LoadError, LoadOptions, LoadReport, SceneSource, SidecarFilter, SidecarIntegrator, built_in_scenes, load};
use penumbra::scene::{
    ActiveCamera, Alpha, Camera, Encoding, Filter, Glossy, GlobalTransform, Instance, Light, Material, Mesh, Projection, SceneBounds, Texture,
    TriangleMesh, Visible, Wrap,
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
            std::fs::write(folder.0.join(name), content).unwrap();
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
    let digit = |bits: u32| char::from(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"[(bits & 63) as usize]);
    let word = |chunk: &[u8]| {
        let [a, b, c] = [0, 1, 2].map(|i| u32::from(chunk.get(i).copied().unwrap_or(0)));
        let bits = a << 16 | b << 8 | c;
        let digits: String = [18, 12, 6, 0].iter().take(chunk.len() + 1).map(|shift| digit(bits >> shift)).collect();
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
    let mut bytes = Vec::new();
    image::write_buffer_with_format(&mut std::io::Cursor::new(&mut bytes), &color, 1, 1, image::ColorType::Rgba8, image::ImageFormat::Png).unwrap();
    bytes
}

const QUAD: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

mod obj {
    use super::*;

    #[test]
    fn a_quad_is_two_triangles_in_one_mesh_and_one_instance() {
        let (mut world, report) = loaded("a.obj", &format!("{QUAD}f 1 2 3 4\n"));
        assert_eq!(report.triangles, 2);
        let mesh = only_mesh(&mut world);
        assert_eq!((mesh.positions.len(), mesh.normals.len(), mesh.triangles.len()), (4, 0, 2));
        assert_eq!(world.query::<&Instance>().iter(&world).count(), 1);
    }

    #[test]
    fn materials_may_change_with_every_face() {
        let text = format!("mtllib a.mtl\n{QUAD}usemtl red paint\nf 1 2 3\nusemtl blue\nf 1 3 4\nusemtl red paint\nf 2 3 4\n");
        let mtl = b"newmtl red paint\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\nKs 0.5 0.5 0.5\nNs 50\n";
        let (mut world, report) = loaded_all(&[("a.obj", text.as_bytes()), ("a.mtl", mtl)]);
        assert_eq!(only_mesh(&mut world).slots, [0, 1, 0]);
        let instance = world.query::<&Instance>().single(&world).unwrap().clone();
        let red = world.get::<Material>(instance.materials[0]).unwrap();
        assert_eq!((red.base_color, &red.glossy), (Vec3::X, &Glossy::None));
        // Kd + Ks is 1.5 in blue: both are scaled.
        let blue = named::<Material>(&mut world, "blue");
        assert!((blue.base_color.z - 2.0 / 3.0).abs() < 1e-6);
        assert!(matches!(blue.glossy, Glossy::BlinnPhong { exponent, .. } if exponent == 50.0));
        assert_says(&report.warnings.join("\n"), "would create light");
    }

    #[test]
    fn illumination_models_become_mirror_glass_and_emission() {
        let mtl = b"newmtl m\nKd 0 0 0\nKs .9 .9 .9\nillum 3\nnewmtl g\nNi 1.33\nTf 1 .5 1\nillum 7\nnewmtl e\nKe 3 2 1\nnewmtl t\nTr 0.25\nnewmtl p\nPr .3\nPm 1\n";
        let text = format!("mtllib a.mtl\n{QUAD}usemtl m\nf 1 2 3\n");
        let (mut world, _) = loaded_all(&[("a.obj", text.as_bytes()), ("a.mtl", mtl)]);
        assert_eq!(named::<Material>(&mut world, "m").mirror, Vec3::splat(0.9));
        let glass = named::<Material>(&mut world, "g").glass.unwrap();
        assert_eq!((glass.ior, glass.tint), (1.33, Vec3::new(1.0, 0.5, 1.0)));
        assert_eq!(named::<Material>(&mut world, "e").emission, Vec3::new(3.0, 2.0, 1.0));
        let thin = named::<Material>(&mut world, "t");
        assert_eq!((thin.opacity, thin.alpha), (0.75, Alpha::Blend));
        assert_eq!(named::<Material>(&mut world, "p").glossy, Glossy::Ggx { metallic: 1.0, roughness: 0.3, texture: None });
    }

    #[test]
    fn texture_coordinates_are_turned_upside_down() {
        let (mut world, _) = loaded("a.obj", &format!("{QUAD}vt 0.25 0.125\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n"));
        assert_eq!(only_mesh(&mut world).uvs[0], Vec2::new(0.25, 0.875));
    }

    #[test]
    fn smoothing_groups_share_normals_and_no_group_is_flat() {
        let roof = "v 0 0 0\nv 1 1 0\nv 2 0 0\nv 0 0 -1\nv 1 1 -1\nv 2 0 -1\n";
        let faces = "f 1 2 5 4\nf 2 3 6 5\n";
        let (mut world, _) = loaded("a.obj", &format!("{roof}{faces}"));
        assert!(only_mesh(&mut world).normals.is_empty());
        let (mut world, _) = loaded("a.obj", &format!("{roof}s 1\n{faces}"));
        let mesh = only_mesh(&mut world);
        assert_eq!(mesh.positions.len(), 6);
        let ridge = mesh.positions.iter().position(|p| *p == Vec3::new(1., 1., 0.)).unwrap();
        assert!((mesh.normals[ridge] - Vec3::Y).length() < 1e-6);
        let (mut world, _) = loaded("a.obj", &format!("{roof}s 1\nf 1 2 5 4\ns off\nf 2 3 6 5\n"));
        assert_eq!(only_mesh(&mut world).positions.len(), 8);
    }

    #[test]
    fn negative_indices_tabs_continuations_and_carriage_returns_work() {
        let text = "\u{feff}v\t0 0 0\r\nv 1 0 0\r\nv 1 1 \\\r\n 0\r\nf -3 \\\r\n-2 -1\r\n";
        assert_eq!(loaded("a.obj", text).1.triangles, 1);
    }

    #[test]
    fn vertex_colours_are_kept() {
        let (mut world, _) = loaded("a.obj", "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n");
        assert_eq!(only_mesh(&mut world).colors[1].to_array(), [0.0, 1.0, 0.0, 1.0]);
    }

    #[test]
    fn a_missing_library_is_a_warning_that_names_it() {
        let (_, report) = loaded("a.obj", &format!("mtllib gone.mtl\nusemtl x\n{QUAD}f 1 2 3\n"));
        let warnings = report.warnings.join("\n");
        assert_says(&warnings, "gone.mtl");
        assert_says(&warnings, "`x` is not defined");
    }

    #[test]
    fn libraries_outside_the_folder_are_not_opened() {
        let (_, report) = loaded("a.obj", &format!("mtllib ../../etc/hostname\n{QUAD}f 1 2 3\n"));
        assert_says(&report.warnings.join("\n"), "outside");
    }

    #[test]
    fn a_missing_texture_shows_a_checker_and_a_warning() {
        let text = format!("mtllib A.MTL\nusemtl m\n{QUAD}f 1 2 3\n");
        let mtl = b"newmtl m\nmap_Kd -s 2 4 1 -clamp on C:\\textures\\no such.png\n";
        let (mut world, report) = loaded_all(&[("a.obj", text.as_bytes()), ("a.mtl", mtl)]);
        assert_says(&report.warnings.join("\n"), "no such.png");
        let texture = world.query::<&Texture>().single(&world).unwrap();
        assert_eq!((texture.texels.texels[0], texture.wrap), ([255, 0, 255, 255], [Wrap::Clamp; 2]));
    }

    #[test]
    fn coverage_comes_from_its_own_picture() {
        let text = format!("mtllib a.mtl\nusemtl m\n{QUAD}f 1 2 3\n");
        let (color, cover) = (png([10, 20, 30, 255]), png([64, 0, 0, 255]));
        let (mut world, _) = loaded_all(&[
            ("a.obj", text.as_bytes()),
            ("a.mtl", b"newmtl m\nmap_Kd c.png\nmap_d d.png\n"),
            ("c.png", &color),
            ("d.png", &cover),
        ]);
        assert_eq!(named::<Material>(&mut world, "m").alpha, Alpha::Blend);
        assert_eq!(world.query::<&Texture>().single(&world).unwrap().texels.texels, [[10, 20, 30, 64]]);
    }

    #[test]
    fn broken_lines_are_named() {
        assert_says(&refusal("a.obj", "v 0 0\n"), "line 1: vertex of 2");
        assert_says(&refusal("a.obj", &format!("{QUAD}f 1 2 9\n")), "line 5: index out of range");
        assert_says(&refusal("a.obj", &format!("{QUAD}f 0 1 2\n")), "line 5: index 0");
        assert_says(&refusal("a.obj", "v 0,0 1 2\n"), "line 1: `0,0` is not a number");
        assert_says(&refusal("a.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "line 4: uses vertex 1");
        assert_says(&refusal("a.obj", "v 0 0 0\0"), "binary");
    }

    #[test]
    fn numbers_too_large_drop_their_triangles_with_a_warning() {
        let (_, report) = loaded("a.obj", "v 1e400 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 2 3 4\n");
        assert_eq!(report.triangles, 1);
        assert_says(&report.warnings.join("\n"), "not finite");
    }

    #[test]
    fn a_hub_of_many_flat_faces_is_not_quadratic() {
        use std::fmt::Write;
        let mut text = String::from("v 0 0 1\nvn 0 0 1\nf 1//1 1//1 1//1\n");
        let n = 100_000;
        for i in 0..n {
            let angle = f64::from(i) / f64::from(n) * 6.28;
            writeln!(text, "v {} {} 0", angle.cos(), angle.sin()).unwrap();
        }
        for i in 0..n - 1 {
            writeln!(text, "f 1 {} {}", i + 2, i + 3).unwrap();
        }
        let start = std::time::Instant::now();
        assert_eq!(loaded("a.obj", &text).1.triangles, n as usize);
        assert!(start.elapsed().as_secs() < 5, "{:?}", start.elapsed());
    }
}

mod gltf {
    use super::*;

    #[test]
    fn a_primitive_without_normals_or_indices_is_flat_and_light_grey() {
        let (mut world, report) = loaded("a.gltf", &gltf_triangle("", "", ""));
        assert_eq!(report.triangles, 1);
        let mesh = only_mesh(&mut world);
        assert!(mesh.normals.is_empty());
        assert_eq!(mesh.uvs[2], Vec2::new(0.0, 1.0));
        assert_eq!(named::<Material>(&mut world, "default"), Material::default());
        assert_says(&report.decisions.join("\n"), "light grey");
    }

    #[test]
    fn strips_turn_every_other_triangle_and_fans_share_the_first_vertex() {
        // Four vertices from the first four VEC3 that fit: stride 12 over positions and what follows.
        let text = |mode: u32| gltf_triangle("", &format!(r#","mode":{mode},"indices":3"#), "").replace(
            r#""bufferViews":[{"#,
            r#""_":0,"bufferViews":[{"#,
        );
        let with_indices = |mode: u32| {
            text(mode).replace(r#""type":"VEC3"}],"#, r#""type":"VEC3"},{"bufferView":1,"componentType":5121,"count":4,"type":"SCALAR"}],"#)
                .replace(r#""byteLength":96}],"#, r#""byteLength":96},{"buffer":1,"byteLength":4}],"#)
                .replace(r#""buffers":["#, r#""buffers":[{"byteLength":4,"uri":"data:;base64,AAECAA=="},"#)
                .replace(r#"{"buffer":0,"byteLength":96}"#, r#"{"buffer":1,"byteLength":96}"#)
                .replace(r#"{"buffer":1,"byteLength":4}"#, r#"{"buffer":0,"byteLength":4}"#)
        };
        for (mode, second) in [(5, [1, 0, 2]), (6, [2, 0, 0])] {
            let (_, report) = loaded("a.gltf", &with_indices(mode));
            assert_eq!(report.triangles, 2, "mode {mode}: {second:?}");
        }
        assert_says(&refusal("a.gltf", &with_indices(9)), "mode");
    }

    #[test]
    fn the_hierarchy_is_kept_and_composed_in_double_precision() {
        let nodes = r#""nodes":[{"name":"far","translation":[10000000,0,0],"children":[1]},
            {"name":"near","translation":[-9999999.75,2,0],"scale":[2,1,1],"mesh":0}],"#;
        let text = gltf_triangle("", "", "").replace(r#""nodes":[{"mesh":0}],"#, nodes);
        let (mut world, _) = loaded("a.gltf", &text);
        let near = named::<GlobalTransform>(&mut world, "near").0;
        assert_eq!(near, DAffine3::from_scale_rotation_translation(DVec3::new(2., 1., 1.), glam::DQuat::IDENTITY, DVec3::new(0.25, 2., 0.)));
        let mut query = world.query::<(&Name, &ChildOf)>();
        let parents: Vec<String> = query.iter(&world).map(|(name, parent)| format!("{name} in {}", world.get::<Name>(parent.0).unwrap())).collect();
        assert!(parents.contains(&"near in far".to_owned()) && parents.contains(&"far in a".to_owned()), "{parents:?}");
    }

    #[test]
    fn a_mesh_used_by_two_nodes_is_one_entity() {
        let text = gltf_triangle("", "", "").replace(r#""nodes":[{"mesh":0}],"#, r#""nodes":[{"mesh":0},{"mesh":0}],"#).replace(r#"{"nodes":[0]}"#, r#"{"nodes":[0,1]}"#);
        let (mut world, report) = loaded("a.gltf", &text);
        assert_eq!((report.triangles, world.query::<&Mesh>().iter(&world).count(), world.query::<&Instance>().iter(&world).count()), (2, 1, 2));
    }

    #[test]
    fn cycles_second_parents_and_lost_children_are_refused() {
        let with = |nodes: &str| gltf_triangle("", "", "").replace(r#""nodes":[{"mesh":0}],"#, &format!(r#""nodes":[{nodes}],"#));
        assert_says(&refusal("a.gltf", &with(r#"{"children":[1]},{"children":[0]}"#)), "cycle");
        assert_says(&refusal("a.gltf", &with(r#"{"children":[1,2]},{"children":[2]},{}"#)), "two parents");
        assert_says(&refusal("a.gltf", &with(r#"{"children":[7]}"#)), "child node 7 of 1");
    }

    #[test]
    fn a_chain_of_a_hundred_thousand_nodes_needs_no_deep_stack() {
        let n = 100_000;
        let chain: Vec<String> = (1..n).map(|i| format!(r#"{{"children":[{i}],"translation":[1,0,0]}}"#)).collect();
        let nodes = format!(r#""nodes":[{},{{"name":"last","mesh":0}}],"#, chain.join(","));
        let (mut world, report) = loaded("a.gltf", &gltf_triangle("", "", "").replace(r#""nodes":[{"mesh":0}],"#, &nodes));
        assert_eq!(report.triangles, 1);
        assert_eq!(named::<GlobalTransform>(&mut world, "last").0.translation.x, f64::from(n - 1));
        // A refused file of that depth is taken back without recursion too.
        let broken = nodes.replace(r#""mesh":0"#, r#""mesh":5"#);
        assert_says(&refusal("b.gltf", &gltf_triangle("", "", "").replace(r#""nodes":[{"mesh":0}],"#, &broken)), "mesh 5 of 1");
    }

    #[test]
    fn materials_keep_their_factors_textures_and_samplers() {
        let more = r#","materials":[{"name":"m","doubleSided":true,"alphaMode":"MASK","alphaCutoff":0.3,
            "pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,0.5],"metallicFactor":0.75,"roughnessFactor":0.5,
              "baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"offset":[0.5,0],"rotation":1.5707964,"scale":[2,2]}}},
              "metallicRoughnessTexture":{"index":0}},
            "emissiveFactor":[1,0.5,0],"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":10}}}],
            "textures":[{"source":0,"sampler":0}],"samplers":[{"magFilter":9728,"wrapS":33071,"wrapT":33648}],"images":[{"uri":"a%20b.png"}]"#;
        let text = gltf_triangle("", r#","material":0"#, more);
        let (mut world, report) = loaded_all(&[("a.gltf", text.as_bytes()), ("a b.png", &png([1, 2, 3, 4]))]);
        assert!(report.warnings.is_empty(), "{:?}", report.warnings);
        let material = named::<Material>(&mut world, "m");
        assert_eq!((material.base_color, material.opacity, material.alpha), (Vec3::new(0.5, 0.25, 1.0), 0.5, Alpha::Mask(0.3)));
        assert_eq!((material.emission, material.double_sided), (Vec3::new(10.0, 5.0, 0.0), true));
        let base = material.base_color_texture.unwrap();
        // A quarter turn counter-clockwise with v down: u runs up.
        let moved = base.uv_transform.transform_point2(Vec2::new(0.25, 0.0));
        assert!((moved - Vec2::new(0.5, -0.5)).length() < 1e-6, "{moved}");
        let texture = world.get::<Texture>(base.texture).unwrap();
        assert_eq!((texture.encoding, texture.filter, texture.wrap), (Encoding::Srgb, Filter::Nearest, [Wrap::Clamp, Wrap::Mirror]));
        assert_eq!(texture.texels.texels, [[1, 2, 3, 4]]);
        let Glossy::Ggx { metallic, roughness, texture: Some(rough) } = material.glossy else { panic!("{:?}", material.glossy) };
        assert_eq!((metallic, roughness, world.get::<Texture>(rough.texture).unwrap().encoding), (0.75, 0.5, Encoding::Linear));
    }

    #[test]
    fn clear_transmission_becomes_glass_and_unlit_is_unlit() {
        let more = r#","materials":[{"name":"g","pbrMetallicRoughness":{"metallicFactor":0,"roughnessFactor":0},
            "extensions":{"KHR_materials_transmission":{"transmissionFactor":1},"KHR_materials_ior":{"ior":1.33}}},
            {"name":"u","extensions":{"KHR_materials_unlit":{}}}]"#;
        let (mut world, _) = loaded("a.gltf", &gltf_triangle("", r#","material":0"#, more));
        assert_eq!(named::<Material>(&mut world, "g").glass.unwrap().ior, 1.33);
        assert!(named::<Material>(&mut world, "u").unlit);
    }

    #[test]
    fn punctual_lights_are_photometric_and_keep_their_angles() {
        let more = r#","extensionsUsed":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":{"lights":[
            {"type":"spot","intensity":683,"color":[1,0.5,0],"spot":{"innerConeAngle":0.25,"outerConeAngle":0.5}}]}}"#;
        let node = r#","extensions":{"KHR_lights_punctual":{"light":0}}"#;
        let (mut world, report) = loaded("a.gltf", &gltf_triangle(node, "", more));
        assert_eq!(lights(&mut world), [Light::Spot { intensity: Vec3::new(1.0, 0.5, 0.0), inner_angle: 0.25, outer_angle: 0.5 }]);
        assert_says(&report.decisions.join("\n"), "candela");
    }

    #[test]
    fn cameras_are_listed_and_the_first_is_active() {
        let more = r#","cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}},{"type":"orthographic","orthographic":{"xmag":1,"ymag":1.5,"znear":0,"zfar":1}}]"#;
        let nodes = r#""nodes":[{"mesh":0,"name":"eye","camera":0},{"camera":1}],"#;
        let text = gltf_triangle("", "", more).replace(r#""nodes":[{"mesh":0}],"#, nodes).replace(r#"{"nodes":[0]}"#, r#"{"nodes":[0,1]}"#);
        let (world, report) = loaded("a.gltf", &text);
        let names: Vec<&str> = report.cameras.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["eye", "camera 1"]);
        assert_eq!(world.resource::<ActiveCamera>().0, report.cameras[0].1);
        assert_eq!(world.get::<Camera>(report.cameras[0].1).unwrap().projection, Projection::Perspective { vertical_fov: 0.5 });
        assert_eq!(world.get::<Camera>(report.cameras[1].1).unwrap().projection, Projection::Orthographic { height: 3.0 });
    }

    #[test]
    fn extensions_are_named_when_required_and_warned_of_when_used() {
        let with = |key: &str| gltf_triangle("", "", &format!(r#","{key}":["KHR_draco_mesh_compression"]"#));
        let message = refusal("scene.gltf", &with("extensionsRequired"));
        assert_says(&message, "scene.gltf: needs KHR_draco_mesh_compression, which Penumbra cannot read; export it again without Draco compression");
        let (_, report) = loaded("a.gltf", &with("extensionsUsed"));
        assert_says(&report.warnings.join("\n"), "KHR_draco_mesh_compression");
    }

    #[test]
    fn instances_of_an_extension_are_placed() {
        // Three translations: the positions of the triangle.
        let node = r#","extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":0}}}"#;
        let (mut world, report) = loaded("a.gltf", &gltf_triangle(node, "", ""));
        assert_eq!((report.triangles, world.query::<&Instance>().iter(&world).count()), (3, 3));
        assert_eq!(named::<GlobalTransform>(&mut world, "instance 1").0.translation, DVec3::X);
    }

    #[test]
    fn damaged_accessors_and_containers_are_refused_with_their_place() {
        let good = gltf_triangle("", "", "");
        assert_says(&refusal("a.gltf", &good.replace(r#""count":3,"type":"VEC2""#, r#""count":4000000000,"type":"VEC2""#)), "accessor 1");
        assert_says(&refusal("a.gltf", &good.replace(r#""byteLength":96}],"#, r#""byteLength":9600}],"#)), "buffer view 0");
        assert_says(&refusal("a.gltf", &good.replace(r#""POSITION":0"#, r#""POSITION":9"#)), "accessor 9 of 3");
        assert_says(&refusal("a.gltf", &good.replace(r#""version":"2.0""#, r#""version":"1.0""#)), "version 1.0");
        assert_says(&refusal("a.gltf", &good[..good.len() / 2]), "JSON");
        assert_says(&refusal("a.glb", "glTF\u{2}\0\0\0\u{7f}\0\0\0"), "truncated");
        assert_says(&refusal("a.glb", ""), "empty");
    }

    #[test]
    fn a_skinned_mesh_stands_where_its_joints_are() {
        let more = r#","skins":[{"joints":[1]}]"#;
        let nodes = r#""nodes":[{"mesh":0,"skin":0,"translation":[100,0,0]},{"translation":[0,5,0]}],"#;
        let (joints, weights) = ([0_u8; 12], [[255_u8, 0, 0, 0]; 3].concat());
        let data = [joints.as_slice(), &weights].concat();
        let text = gltf_triangle("", "", more)
            .replace(r#""nodes":[{"mesh":0}],"#, nodes)
            .replace(r#"{"nodes":[0]}"#, r#"{"nodes":[0,1]}"#)
            .replace(r#""TEXCOORD_0":1"#, r#""TEXCOORD_0":1,"JOINTS_0":3,"WEIGHTS_0":4"#)
            .replace(
                r#""type":"VEC3"}],"#,
                r#""type":"VEC3"},{"bufferView":1,"componentType":5121,"count":3,"type":"VEC4"},
                   {"bufferView":1,"byteOffset":12,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"}],"#,
            )
            .replace(r#""byteLength":96}],"#, r#""byteLength":96},{"buffer":1,"byteLength":24}],"#)
            .replace(r#""buffers":["#, &format!(r#""buffers":[{{"byteLength":24,"uri":"data:;base64,{}"}},"#, base64(&data)))
            .replace(r#"{"buffer":0,"byteLength":96}"#, r#"{"buffer":9,"byteLength":96}"#)
            .replace(r#"{"buffer":1,"byteLength":24}"#, r#"{"buffer":0,"byteLength":24}"#)
            .replace(r#"{"buffer":9,"#, r#"{"buffer":1,"#);
        let (mut world, _) = loaded("a.gltf", &text);
        assert_eq!(only_mesh(&mut world).positions[0], Vec3::Y * 5.0);
        let transform = world.query_filtered::<&GlobalTransform, With<Instance>>().single(&world).unwrap();
        assert_eq!(transform.0, DAffine3::IDENTITY);
    }
}

mod settings {
    use super::*;

    const FLOOR: &str = "usemtl wall\nv 0 0 0\nv 1 0 0\nv 1 0 -1\nv 0 0 -1\nf 1 2 3 4\n";

    fn with_sidecar(toml: &str) -> (World, Result<LoadReport, LoadError>) {
        Folder::new(&[("a.obj", FLOOR.as_bytes()), ("a.toml", toml.as_bytes())]).load("a.obj")
    }

    fn sidecar_refusal(toml: &str) -> String {
        let message = with_sidecar(toml).1.expect_err("accepted").to_string();
        assert!(message.contains("a.toml") && !message.contains('\n'), "{message}");
        message
    }

    #[test]
    fn the_sidecar_adds_lights_camera_materials_and_render_options() {
        let toml = r#"
            [material.wall]
            base_color = [0.1, 0.2, 0.3]
            specular = [0.2, 0.2, 0.2]
            exponent = 30
            [[light]]
            kind = "parallelogram"
            corner = [0, 2, 0]
            edge_u = [1, 0, 0]
            edge_v = [0, 0, 1]
            radiance = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
            visible = false
            [[light]]
            kind = "segment"
            from = [0, 1, 0]
            to = [0, 3, 0]
            strength = [4, 4, 4]
            [camera]
            position = [0, 1, 5]
            target = [0, 1, 0]
            vertical_fov = 90
            [render]
            integrator = "direct"
            spp = 16
            resolution = [320, 200]
            filter = "nearest"
        "#;
        let (mut world, report) = with_sidecar(toml);
        let report = report.unwrap();
        assert_eq!(named::<Material>(&mut world, "wall").base_color, Vec3::new(0.1, 0.2, 0.3));
        assert_eq!(named::<GlobalTransform>(&mut world, "light 0 (parallelogram)").0.translation, DVec3::new(0.5, 2.0, 0.5));
        assert_eq!(named::<Visible>(&mut world, "light 0 (parallelogram)"), Visible(false));
        let segment = named::<GlobalTransform>(&mut world, "light 1 (segment)").0;
        assert!((segment.transform_point3(DVec3::NEG_X) - DVec3::Y).length() < 1e-12, "−X is not at `from`");
        let camera = world.resource::<ActiveCamera>().0;
        assert_eq!((report.cameras.len(), report.cameras[0].1), (1, camera));
        assert!((world.get::<GlobalTransform>(camera).unwrap().0.matrix3.z_axis - DVec3::Z).length() < 1e-12);
        let render = report.render;
        assert_eq!((render.integrator, render.spp, render.resolution), (Some(SidecarIntegrator::Direct), Some(16), Some([320, 200])));
        assert_eq!((render.filter, render.seed), (Some(SidecarFilter::Nearest), None));
        assert!(!report.decisions.join("\n").contains("no light"), "{:?}", report.decisions);
    }

    #[test]
    fn every_kind_of_light_is_read() {
        let toml = r#"
            [[light]]
            kind = "disk"
            center = [0, 1, 0]
            normal = [0, -1, 0]
            radius = 0.5
            radiance = [1, 1, 1]
            [[light]]
            kind = "sphere"
            center = [0, 1, 0]
            radius = 0.5
            radiance = [1, 1, 1]
            [[light]]
            kind = "point"
            position = [0, 1, 0]
            intensity = [1, 1, 1]
            [[light]]
            kind = "spot"
            position = [0, 1, 0]
            target = [0, 0, 0]
            intensity = [1, 1, 1]
            outer_angle = 30
            [[light]]
            kind = "directional"
            direction = [0, -1, 0]
            irradiance = [1, 1, 1]
            angle = 0.53
            [[light]]
            kind = "environment"
            radiance = [1, 1, 1]
        "#;
        let (mut world, report) = with_sidecar(toml);
        report.unwrap();
        assert_eq!(lights(&mut world).len(), 6);
        for name in ["light 0 (disk)", "light 3 (spot)", "light 4 (directional)"] {
            let forward = -named::<GlobalTransform>(&mut world, name).0.matrix3.z_axis;
            assert!((forward - DVec3::NEG_Y).length() < 1e-12, "{name} looks along {forward}");
        }
    }

    #[test]
    fn wrong_keys_and_values_are_named_with_their_line() {
        assert_says(&sidecar_refusal("[render]\nspp = 4\nssp = 5\n"), "line 3");
        assert_says(&sidecar_refusal("[render]\nssp = 5\n"), "unknown field `ssp`");
        assert_says(&sidecar_refusal("[render]\nspp = 0\n"), "spp must be at least 1");
        assert_says(&sidecar_refusal("\n[[light]]\nkind = \"sphere\"\ncenter = [0,0,0]\nradius = -1\nradiance = [1,1,1]\n"), "line 2, light 0 (sphere): radius must be above 0");
        assert_says(&sidecar_refusal("[[light]]\nkind = \"sphere\"\ncenter = [0,0,0]\nradius = 1\nradiance = [1,nan,1]\n"), "radiance must be finite");
        assert_says(&sidecar_refusal("[[light]]\nkind = \"sphere\"\ncentre = [0,0,0]\nradius = 1\nradiance = [1,1,1]\n"), "unknown field `centre`");
        assert_says(&sidecar_refusal("[[light]]\nkind = \"lamp\"\n"), "unknown variant `lamp`");
        assert_says(&sidecar_refusal("[[light]]\nkind = \"parallelogram\"\ncorner=[0,0,0]\nedge_u=[1,0,0]\nedge_v=[2,0,0]\nradiance=[1,1,1]\n"), "no area");
        assert_says(&sidecar_refusal("[[light]]\nkind = \"parallelogram\"\ncorner=[0,0,0]\nedge_u=[1,0,0]\nedge_v=[0,1,0]\nradiance=[1,1]\n"), "radiance must be [r, g, b] or four of them");
        assert_says(&sidecar_refusal("[camera]\nposition=[0,0,1]\ntarget=[0,0,0]\nvertical_fov=180\n"), "between 0 and 180");
        assert_says(&sidecar_refusal("[material.wall]\nbase_color=[0.9,0,0]\nmirror=[0.9,0,0]\n"), "create light");
        assert_says(&sidecar_refusal("[material.wall]\nroughness = 2\n"), "roughness must be within 0 to 1");
        assert_says(&sidecar_refusal("[[light\n"), "line 1");
    }

    #[test]
    fn a_settings_file_of_its_own_places_models() {
        let toml = r#"
            [[model]]
            file = "a.obj"
            material = "white"
            translation = [1, 0, 0]
            rotation = [0, 90, 0]
            scale = 2
            [[model]]
            file = "a.obj"
            matrix = [[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,0,1]]
            [material.white]
            base_color = [0.7, 0.7, 0.7]
        "#;
        let (mut world, report) = loaded_all(&[("s.toml", toml.as_bytes()), ("a.obj", FLOOR.as_bytes())]);
        assert_eq!(report.triangles, 4);
        let mut query = world.query::<(&Instance, &GlobalTransform)>();
        let placed: Vec<DVec3> = query.iter(&world).map(|(_, transform)| transform.0.transform_point3(DVec3::X)).collect();
        assert!((placed[0] - DVec3::new(1.0, 0.0, -2.0)).length() < 1e-12, "{}", placed[0]);
        assert_eq!(placed[1], DVec3::new(6.0, 6.0, 7.0));
        let first = query.iter(&world).next().unwrap().0.materials[0];
        assert_eq!(world.get::<Name>(first).unwrap().as_str(), "white");
        // Beside a.obj such a file is not taken for its settings.
        let folder = Folder::new(&[("a.obj", FLOOR.as_bytes()), ("a.toml", toml.as_bytes())]);
        let (_, report) = folder.load("a.obj");
        assert_says(&report.unwrap().decisions.join("\n"), "a scene of its own");
    }

    #[test]
    fn models_that_are_missing_or_misplaced_are_named() {
        let refuse = |toml: &str| refusal("s.toml", toml);
        assert_says(&refuse("[[model]]\nfile = \"gone.obj\"\n"), "line 1, [[model]]: `gone.obj`: no such file");
        assert_says(&refuse("[[model]]\nfile = \"s.toml\"\n"), "cannot be a model");
        assert_says(&refuse("[[model]]\nfile = \"x.obj\"\nscale = \"big\"\n"), "scale must be a number or three of them");
    }

    #[test]
    fn settings_may_be_named_by_the_caller() {
        let folder = Folder::new(&[("a.obj", FLOOR.as_bytes()), ("other.toml", b"[render]\nseed = 7\n")]);
        let options = LoadOptions { scene_settings: Some(folder.0.join("other.toml")) };
        assert_eq!(folder.load_with("a.obj", &options).1.unwrap().render.seed, Some(7));
        let options = LoadOptions { scene_settings: Some(folder.0.join("gone.toml")) };
        assert_says(&folder.load_with("a.obj", &options).1.unwrap_err().to_string(), "gone.toml: no such file");
    }
}

mod framing {
    use super::*;

    /// Whether the active camera sees a point, in a square picture.
    fn sees(world: &World, point: DVec3) -> bool {
        let camera = world.resource::<ActiveCamera>().0;
        let local = world.get::<GlobalTransform>(camera).unwrap().0.inverse().transform_point3(point);
        let Projection::Perspective { vertical_fov } = world.get::<Camera>(camera).unwrap().projection else { return false };
        let reach = f64::from(vertical_fov / 2.0).tan() * -local.z;
        local.z < 0.0 && local.x.abs() <= reach && local.y.abs() <= reach
    }

    #[test]
    fn a_file_without_camera_and_light_gets_both_and_says_so() {
        let (mut world, report) = loaded("a.obj", &format!("{QUAD}f 1 2 3 4\n"));
        let decisions = report.decisions.join("\n");
        assert_says(&decisions, "no camera in it");
        assert_says(&decisions, "no light in it");
        for corner in [[0., 0.], [1., 0.], [1., 1.], [0., 1.]] {
            assert!(sees(&world, DVec3::new(corner[0], corner[1], 0.0)));
        }
        // It faces +Z, so that is where the camera stands.
        let eye = world.get::<GlobalTransform>(world.resource::<ActiveCamera>().0).unwrap().0.translation;
        assert!(eye.z > 0.5);
        let bounds = *world.resource::<SceneBounds>();
        assert!((bounds.center - DVec3::new(0.5, 0.5, 0.0)).length() < 1e-9 && (bounds.radius - 0.5_f64.sqrt()).abs() < 1e-9);
        let key = named::<Light>(&mut world, "key light");
        let at = named::<GlobalTransform>(&mut world, "key light").0;
        let Light::Parallelogram { edge_u, edge_v, radiance, .. } = key else { panic!("{key:?}") };
        let normal = at.transform_vector3(edge_u.cross(edge_v).as_dvec3());
        let to_center = bounds.center - at.translation;
        assert!(normal.normalize().dot(to_center.normalize()) > 0.999, "shines elsewhere");
        let white = f64::from(radiance[0].x) * normal.length() / (std::f64::consts::PI * to_center.length_squared());
        assert!((white - 0.8).abs() < 1e-4, "{white}");
    }

    #[test]
    fn far_outliers_do_not_shrink_the_scene() {
        use std::fmt::Write;
        let mut text = String::new();
        for i in 0..200 {
            let x = f64::from(i) * 0.01;
            writeln!(text, "v {x} 0 0\nv {x} 1 0\nv {} 0 1\nf -3 -2 -1", x + 0.01).unwrap();
        }
        text += "v 100000 0 0\nv 100000 0.01 0\nv 100000 0 0.01\nf -3 -2 -1\n";
        let (world, report) = loaded("a.obj", &text);
        assert!(world.resource::<SceneBounds>().radius < 3.0);
        assert_says(&report.decisions.join("\n"), "outliers");
    }

    #[test]
    fn an_emissive_material_is_light_enough() {
        let text = format!("mtllib a.mtl\nusemtl e\n{QUAD}f 1 2 3\n");
        let (mut world, _) = loaded_all(&[("a.obj", text.as_bytes()), ("a.mtl", b"newmtl e\nKe 1 1 1\n")]);
        assert!(lights(&mut world).is_empty());
    }

    #[test]
    fn an_empty_scene_still_has_a_camera() {
        let (world, report) = loaded("a.obj", "# nothing\n");
        assert_eq!(report.triangles, 0);
        assert_says(&report.warnings.join("\n"), "nothing to see");
        assert!(world.get::<Camera>(world.resource::<ActiveCamera>().0).is_some());
    }
}

#[test]
fn every_built_in_scene_loads_without_a_warning() {
    for scene in built_in_scenes() {
        let source = SceneSource::parse(scene.name).unwrap();
        assert_eq!(source, SceneSource::BuiltIn(scene.name));
        let mut world = World::new();
        let report = load(&mut world, &source, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        assert!(report.warnings.is_empty(), "{}: {:?}", scene.name, report.warnings);
        assert!(report.triangles > 0 && !report.cameras.is_empty(), "{}", scene.name);
        let shines = world.query::<&Light>().iter(&world).count() + world.query::<&Material>().iter(&world).filter(|m| m.emission != Vec3::ZERO).count();
        assert!(shines > 0, "{}: dark", scene.name);
        assert!(!report.decisions.iter().any(|line| line.contains("no light") || line.contains("no camera")), "{:?}", report.decisions);
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
    let error = load(&mut World::new(), &SceneSource::File(PathBuf::from("no/such.glb")), &LoadOptions::default()).unwrap_err();
    assert_says(&error.to_string(), "no/such.glb: no such file");
    let error = load(&mut World::new(), &SceneSource::File(Path::new("/").to_path_buf()), &LoadOptions::default()).unwrap_err();
    assert_says(&error.to_string(), "not a regular file");
}

#[test]
fn a_file_of_unknown_format_is_refused_with_what_is_read() {
    assert_says(&refusal("a.fbx", "Kaydara"), "Penumbra reads .gltf, .glb, .obj and .toml");
}
