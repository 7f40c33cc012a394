//! glTF.

mod lamps;
mod wild;

use super::*;
use penumbra::load::LightUnits;

#[test]
fn a_primitive_without_normals_or_indices_is_flat_and_light_grey() {
    let (mut world, report) = loaded("a.gltf", &gltf_triangle("", "", ""));
    assert_eq!(report.triangles, 1);
    let mesh = only_mesh(&mut world);
    assert!(mesh.normals.is_empty());
    assert_eq!(mesh.uvs[2], Vec2::new(0.0, 1.0));
    assert_eq!(named::<Material>(&mut world, "default"), Material { culled: true, ..Material::default() });
    assert_says(&report.decisions().join("\n"), "light grey");
}

#[test]
fn strips_turn_every_other_triangle_and_fans_share_the_first_vertex() {
    // Indices 0 1 2 0 in a buffer of their own.
    let with_indices = |mode: u32| {
        gltf_triangle("", &format!(r#","mode":{mode},"indices":3"#), "")
            .replace(
                r#""type":"VEC3"}],"#,
                r#""type":"VEC3"},{"bufferView":1,"componentType":5121,"count":4,"type":"SCALAR"}],"#,
            )
            .replace(
                r#"{"buffer":0,"byteLength":96}"#,
                r#"{"buffer":1,"byteLength":96},{"buffer":0,"byteLength":4}"#,
            )
            .replace(r#""buffers":["#, r#""buffers":[{"byteLength":4,"uri":"data:;base64,AAECAA=="},"#)
    };
    let (mut world, report) = loaded("a.gltf", &with_indices(5));
    assert_eq!((report.triangles, only_mesh(&mut world).triangles), (2, vec![[0, 1, 2], [1, 0, 2]]));
    let (mut world, report) = loaded("a.gltf", &with_indices(6));
    assert_eq!(
        (report.triangles, only_mesh(&mut world).triangles),
        (2, vec![[1, 2, 0]]),
        "the second has no area"
    );
    assert_says(&refusal("a.gltf", &with_indices(9)), "mode");
}

#[test]
fn the_hierarchy_is_kept_and_composed_in_double_precision() {
    let nodes = r#""nodes":[{"name":"far","translation":[10000000,0,0],"children":[1]},
        {"name":"near","translation":[-9999999.75,2,0],"scale":[2,1,1],"mesh":0}],"#;
    let text = gltf_triangle("", "", "").replace(r#""nodes":[{"mesh":0}],"#, nodes);
    let (mut world, _) = loaded("a.gltf", &text);
    let near = named::<GlobalTransform>(&mut world, "near").0;
    assert_eq!(
        near,
        DAffine3::from_scale_rotation_translation(
            DVec3::new(2., 1., 1.),
            glam::DQuat::IDENTITY,
            DVec3::new(0.25, 2., 0.)
        )
    );
    let mut query = world.query::<(&Name, &ChildOf)>();
    let parents: Vec<String> = query
        .iter(&world)
        .map(|(name, parent)| format!("{name} in {}", world.get::<Name>(parent.0).unwrap()))
        .collect();
    assert!(
        parents.contains(&"near in far".to_owned()) && parents.contains(&"far in a".to_owned()),
        "{parents:?}"
    );
}

#[test]
fn a_mesh_used_by_two_nodes_is_one_entity() {
    let text = gltf_triangle("", "", "")
        .replace(r#""nodes":[{"mesh":0}],"#, r#""nodes":[{"mesh":0},{"mesh":0}],"#)
        .replace(r#"{"nodes":[0]}"#, r#"{"nodes":[0,1]}"#);
    let (mut world, report) = loaded("a.gltf", &text);
    assert_eq!(
        (
            report.triangles,
            world.query::<&Mesh>().iter(&world).count(),
            world.query::<&Instance>().iter(&world).count()
        ),
        (2, 1, 2)
    );
}

#[test]
fn cycles_second_parents_and_lost_children_are_refused() {
    let with = |nodes: &str| {
        gltf_triangle("", "", "").replace(r#""nodes":[{"mesh":0}],"#, &format!(r#""nodes":[{nodes}],"#))
    };
    assert_says(&refusal("a.gltf", &with(r#"{"children":[1]},{"children":[0]}"#)), "cycle");
    assert_says(&refusal("a.gltf", &with(r#"{"children":[1,2]},{"children":[2]},{}"#)), "two parents");
    assert_says(&refusal("a.gltf", &with(r#"{"children":[7]}"#)), "child node 7 of 1");
}

#[test]
fn a_chain_of_a_hundred_thousand_nodes_needs_no_deep_stack() {
    let n = 100_000;
    let chain: Vec<String> =
        (1..n).map(|i| format!(r#"{{"children":[{i}],"translation":[1,0,0]}}"#)).collect();
    let nodes = format!(r#""nodes":[{},{{"name":"last","mesh":0}}],"#, chain.join(","));
    let (mut world, report) =
        loaded("a.gltf", &gltf_triangle("", "", "").replace(r#""nodes":[{"mesh":0}],"#, &nodes));
    assert_eq!(report.triangles, 1);
    assert_eq!(named::<GlobalTransform>(&mut world, "last").0.translation.x, f64::from(n - 1));
    // A refused file of that depth is taken back without recursion too.
    let broken = nodes.replace(r#""mesh":0"#, r#""mesh":5"#);
    assert_says(
        &refusal("b.gltf", &gltf_triangle("", "", "").replace(r#""nodes":[{"mesh":0}],"#, &broken)),
        "mesh 5 of 1",
    );
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
    assert!(report.warnings().is_empty(), "{:?}", report.warnings());
    let material = named::<Material>(&mut world, "m");
    assert_eq!(
        (material.base_color, material.opacity, material.alpha),
        (Vec3::new(0.5, 0.25, 1.0), 0.5, Alpha::Mask(0.3))
    );
    assert_eq!((material.emission, material.double_sided), (Vec3::new(10.0, 5.0, 0.0), true));
    let base = material.base_color_texture.unwrap();
    // A quarter turn counter-clockwise with v down: u runs up.
    let moved = base.uv_transform.transform_point2(Vec2::new(0.25, 0.0));
    assert!((moved - Vec2::new(0.5, -0.5)).length() < 1e-6, "{moved}");
    let texture = world.get::<Texture>(base.texture).unwrap();
    assert_eq!(
        (texture.encoding, texture.filter, texture.wrap),
        (Encoding::Srgb, Filter::Nearest, [Wrap::Clamp, Wrap::Mirror])
    );
    assert_eq!(texture.texels.texels, [[1, 2, 3, 4]]);
    let Glossy::Ggx { metallic, roughness, texture: Some(rough) } = material.glossy else {
        panic!("{:?}", material.glossy)
    };
    assert_eq!(
        (metallic, roughness, world.get::<Texture>(rough.texture).unwrap().encoding),
        (0.75, 0.5, Encoding::Linear)
    );
}

#[test]
fn punctual_lights_are_photometric_and_keep_their_angles() {
    let more = r#","extensionsUsed":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":{"lights":[
        {"type":"spot","intensity":683,"color":[1,0.5,0],"spot":{"innerConeAngle":0.25,"outerConeAngle":0.5}}]}}"#;
    let node = r#","extensions":{"KHR_lights_punctual":{"light":0}}"#;
    let (mut world, report) = loaded("a.gltf", &gltf_triangle(node, "", more));
    assert_eq!(
        lights(&mut world),
        [Light::Spot { intensity: Vec3::new(1.0, 0.5, 0.0), inner_angle: 0.25, outer_angle: 0.5 }]
    );
    assert_says(&report.decisions().join("\n"), "candela");
}

/// The format's own material is white, and colours of vertices are factors of that; we show grey only where there is no colour.
#[test]
fn colours_of_vertices_without_a_material_are_as_they_are() {
    let colored = gltf_triangle("", "", "").replace(r#""TEXCOORD_0":1"#, r#""TEXCOORD_0":1,"COLOR_0":2"#);
    let object = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n";
    for (name, text, color) in [
        ("a.gltf", colored.as_str(), 1.0),
        ("a.gltf", &gltf_triangle("", "", ""), 0.8),
        ("a.obj", object, 1.0),
        ("a.obj", &object.replace("f ", "usemtl gone\nf "), 1.0),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0.8),
    ] {
        let (mut world, _) = loaded(name, text);
        let material = world.query::<&Material>().single(&world).unwrap();
        assert_eq!(material.base_color, Vec3::splat(color), "{name} {text}");
    }
}

#[test]
fn what_is_made_from_the_shape_itself_is_told() {
    let volume = r#""KHR_materials_volume":{"thicknessFactor":1,"thicknessTexture":{"index":0}}"#;
    let more = format!(
        r#","materials":[{{"occlusionTexture":{{"index":0}},"extensions":{{{volume}}}}}],"textures":[{{"source":0}}],"images":[{{"uri":"gone.png"}}]"#
    );
    let (_, report) = loaded("a.gltf", &gltf_triangle("", r#","material":0"#, &more));
    let said = report.decisions().join("\n");
    assert_says(&said, "occlusion textures are not needed");
    assert_says(&said, "thickness textures are not needed");
    let targets = r#","targets":[{"POSITION":0,"TANGENT":0}]"#;
    let (_, report) = loaded("a.gltf", &gltf_triangle("", targets, ""));
    assert_says(&report.decisions().join("\n"), "morph targets that move TANGENT");
}

#[test]
fn cameras_are_listed_and_the_first_is_active() {
    let more = r#","cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}},{"type":"orthographic","orthographic":{"xmag":1,"ymag":1.5,"znear":0,"zfar":1}}]"#;
    let nodes = r#""nodes":[{"mesh":0,"name":"eye","camera":0},{"camera":1}],"#;
    let text = gltf_triangle("", "", more)
        .replace(r#""nodes":[{"mesh":0}],"#, nodes)
        .replace(r#"{"nodes":[0]}"#, r#"{"nodes":[0,1]}"#);
    let (world, report) = loaded("a.gltf", &text);
    let names: Vec<&str> = report.cameras.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["eye", "camera 1"]);
    assert_eq!(world.resource::<ActiveCamera>().0, report.cameras[0].1);
    assert_eq!(
        world.get::<Camera>(report.cameras[0].1).unwrap().projection,
        Projection::Perspective { vertical_fov: 0.5 }
    );
    assert_eq!(
        world.get::<Camera>(report.cameras[1].1).unwrap().projection,
        Projection::Orthographic { height: 3.0 }
    );
}

#[test]
fn extensions_are_named_when_required_and_warned_of_when_used() {
    let with = |key: &str| gltf_triangle("", "", &format!(r#","{key}":["MSFT_texture_dds"]"#));
    let message = refusal("scene.gltf", &with("extensionsRequired"));
    assert_says(
        &message,
        "scene.gltf: needs MSFT_texture_dds, which Penumbra cannot read; export it again with PNG, JPEG or WebP textures",
    );
    let (_, report) = loaded("a.gltf", &with("extensionsUsed"));
    assert_says(&report.warnings().join("\n"), "MSFT_texture_dds");
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
    assert_says(
        &refusal(
            "a.gltf",
            &good.replace(r#""count":3,"type":"VEC2""#, r#""count":4000000000,"type":"VEC2""#),
        ),
        "accessor 1",
    );
    assert_says(
        &refusal("a.gltf", &good.replace(r#""byteLength":96}],"#, r#""byteLength":9600}],"#)),
        "buffer view 0",
    );
    assert_says(&refusal("a.gltf", &good.replace(r#""POSITION":0"#, r#""POSITION":9"#)), "accessor 9 of 3");
    assert_says(&refusal("a.gltf", &good.replace(r#""version":"2.0""#, r#""version":"1.0""#)), "version 1.0");
    assert_says(&refusal("a.gltf", &good.replace(r#""version":"2.0""#, r#""version":1"#)), "version 1;");
    assert_says(&refusal("a.gltf", &good[..good.len() / 2]), "JSON");
    assert_says(&refusal("a.glb", "glTF\u{2}\0\0\0\u{7f}\0\0\0"), "truncated");
    assert_says(&refusal("a.glb", ""), "empty");
}

#[test]
fn binary_data_right_behind_text_of_an_odd_length_is_found() {
    let positions: Vec<u8> =
        [0_f32, 0., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|number| number.to_le_bytes()).collect();
    // Zeros at the end, instead of blanks, are not as specified, and are met.
    for (spaces, zeros) in [(0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (0, 3)] {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":36}}],"bufferViews":[{{"buffer":0,"byteLength":36}}],"accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],"nodes":[{{"mesh":0}}]{}}}"#,
            " ".repeat(spaces)
        ) + &"\0".repeat(zeros);
        let chunk = |kind: &[u8; 4], data: &[u8]| {
            [&(data.len() as u32).to_le_bytes(), kind.as_slice(), data].concat()
        };
        let body = [chunk(b"JSON", json.as_bytes()), chunk(b"BIN\0", &positions)].concat();
        let head =
            [b"glTF".as_slice(), &2_u32.to_le_bytes(), &(12 + body.len() as u32).to_le_bytes()].concat();
        let (_, report) = loaded_all(&[("a.glb", &[head, body].concat())]);
        assert_eq!(report.triangles, 1, "{spaces}, {zeros}");
    }
}

#[test]
fn coverage_sides_and_unlit_emission_are_as_specified() {
    let material = |text: &str| {
        let with = format!(r#","materials":[{text}]"#);
        let (mut world, report) = loaded("a.gltf", &gltf_triangle("", r#","material":0"#, &with));
        (world.query::<&Material>().single(&world).unwrap().clone(), report)
    };
    assert_eq!(material(r#"{"alphaMode":"MASK","alphaCutoff":1.5}"#).0.alpha, Alpha::Mask(1.5));
    assert!(material("{}").0.culled);
    assert!(!material(r#"{"doubleSided":true}"#).0.culled);
    let glass = r#"{"extensions":{"KHR_materials_transmission":{"transmissionFactor":1}}}"#;
    assert!(!material(glass).0.culled);
    let unlit = r#"{"emissiveFactor":[1,1,1],"extensions":{"KHR_materials_unlit":{}}}"#;
    assert_eq!(material(unlit).0.emission, Vec3::ZERO);
    assert_says(&material(r#"{"alphaMode":"blend"}"#).1.warnings().concat(), "unknown alphaMode");
}

#[test]
fn a_scene_may_be_empty() {
    let (_, report) =
        loaded_all(&[("a.gltf", br#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"name":"bare"}]}"#)]);
    assert_eq!(report.triangles, 0);
    assert_says(&report.warnings().concat(), "no triangle to see");
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
        .replace(r#"{"buffer":0,"byteLength":96}"#, r#"{"buffer":1,"byteLength":96},{"buffer":0,"byteLength":24}"#)
        .replace(r#""buffers":["#, &format!(r#""buffers":[{{"byteLength":24,"uri":"data:;base64,{}"}},"#, base64(&data)));
    let (mut world, _) = loaded("a.gltf", &text);
    assert_eq!(only_mesh(&mut world).positions[0], Vec3::Y * 5.0);
    let transform = world.query_filtered::<&GlobalTransform, With<Instance>>().single(&world).unwrap();
    assert_eq!(transform.0, DAffine3::IDENTITY);
}

#[test]
fn memory_is_asked_for_before_it_is_taken() {
    // A hundred primitives of two million vertices that no byte of the file stands for.
    let zeros = r#"{"componentType":5126,"count":2000000,"type":"VEC3"}"#;
    let primitives = vec![r#"{"attributes":{"POSITION":0}}"#; 100].join(",");
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"accessors":[{zeros}],"meshes":[{{"primitives":[{primitives}]}}]}}"#
    );
    let options = LoadOptions { max_memory: Some(1 << 30), ..LoadOptions::default() };
    let (_, refused) = Folder::new(&[("a.gltf", text.as_bytes())]).load_with("a.gltf", &options);
    let message = refused.unwrap_err().to_string();
    assert_says(&message, "a.gltf: mesh 0, primitive 3: takes loading to");
    assert_says(&message, "allow more with --max-memory");
    // A picture that does not fit is a stand-in.
    let more = r#","materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],"textures":[{"source":0}],"images":[{"uri":"a.png"}]"#;
    let text = gltf_triangle("", r#","material":0"#, more);
    let folder = Folder::new(&[("a.gltf", text.as_bytes()), ("a.png", &png_of(512))]);
    let options = LoadOptions { max_memory: Some(1 << 20), ..LoadOptions::default() };
    let (_, report) = folder.load_with("a.gltf", &options);
    assert_says(&report.unwrap().warnings().join("\n"), "too large for the memory allowed");
}

#[test]
fn nodes_that_are_not_visible_are_left_out_with_all_below() {
    let nodes = r#""nodes":[{"children":[1],"extensions":{"KHR_node_visibility":{"visible":false}}},{"mesh":0},{"mesh":0}],"#;
    let text = gltf_triangle("", "", "")
        .replace(r#""nodes":[{"mesh":0}],"#, nodes)
        .replace(r#"{"nodes":[0]}"#, r#"{"nodes":[0,2]}"#);
    let (_, report) = loaded("a.gltf", &text);
    assert_eq!(report.triangles, 1);
    assert_says(&report.decisions().join("\n"), "nodes that are not visible");
}

#[test]
fn a_texture_that_an_extension_gives_comes_before_the_core_one() {
    let more = r#","materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
        "textures":[{"source":0,"extensions":{"EXT_texture_webp":{"source":1}}}],"images":[{"uri":"a.png"},{"uri":"b.webp"}]"#;
    let text = gltf_triangle("", r#","material":0"#, more);
    let webp = picture(&[9, 8, 7, 255], 1, image::ImageFormat::WebP);
    let (mut world, report) =
        loaded_all(&[("a.gltf", text.as_bytes()), ("a.png", &png([1, 2, 3, 4])), ("b.webp", &webp)]);
    assert!(report.warnings().is_empty(), "{:?}", report.warnings());
    assert_eq!(world.query::<&Texture>().single(&world).unwrap().texels.texels, [[9, 8, 7, 255]]);
}

#[test]
fn whole_numbers_may_be_written_with_a_point() {
    let text = gltf_triangle("", "", "");
    let members =
        ["scene\":0", "nodes\":[0", "mesh\":0", "POSITION\":0", "bufferView\":0", "componentType\":5126"];
    let members = members.iter().chain(&["count\":3", "byteOffset\":36", "buffer\":0", "byteLength\":96"]);
    let pointed = members.fold(text.clone(), |text, member| {
        assert_says(&text, member);
        text.replace(member, &format!("{member}.0"))
    });
    let (mut world, report) = loaded("a.gltf", &pointed);
    assert_eq!((report.triangles, report.warnings()), (1, Vec::new()));
    let (mut plain, _) = loaded("a.gltf", &text);
    assert_eq!(only_mesh(&mut world), only_mesh(&mut plain));
    assert_says(&refusal("a.gltf", &text.replace("count\":3", "count\":3.5")), "line 3");
}
