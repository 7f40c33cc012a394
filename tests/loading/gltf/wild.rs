//! glTF as it is met: what is left out or mended, and what asks for too much.

use super::super::builder::{Builder, TRIANGLE};
use super::*;

/// Loads with so many MiB of memory.
fn within(mebibytes: u64, text: &str) -> (World, Result<LoadReport, LoadError>) {
    let options = LoadOptions { max_memory: Some(mebibytes << 20), ..LoadOptions::default() };
    Folder::new(&[("a.gltf", text.as_bytes())]).load_with("a.gltf", &options)
}

fn too_much(mebibytes: u64, text: &str) -> String {
    let message = within(mebibytes, text).1.expect_err("accepted").to_string();
    assert_says(&message, "allow more with --max-memory");
    message
}

#[test]
fn a_primitive_without_positions_costs_only_itself() {
    let text = gltf_triangle("", "", "")
        .replace(r#""primitives":["#, r#""primitives":[{"attributes":{"NORMAL":2}},{"attributes":{}},"#);
    let (_, report) = loaded("a.gltf", &text);
    assert_eq!(report.triangles, 1);
    assert_says(&report.warnings().join("\n"), "no POSITION: nothing says where its vertices are: 2");
}

fn textured(uri: &str) -> String {
    let more = format!(
        r#","materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],"textures":[{{"source":0}}],"images":[{{"uri":"{uri}"}}]"#
    );
    gltf_triangle("", r#","material":0"#, &more)
}

#[test]
fn a_picture_that_is_not_where_the_file_says_is_looked_for_beside_the_scene() {
    for uri in [
        "C:\\\\Users\\\\me\\\\a%20b.png",
        "../a b.png",
        "a%20b.png?v=1",
        "https://example.com/a%20b.png",
        "gone/a b.png",
    ] {
        let (mut world, report) =
            loaded_all(&[("a.gltf", textured(uri).as_bytes()), ("a b.png", &png([1, 2, 3, 4]))]);
        assert_eq!(world.query::<&Texture>().single(&world).unwrap().texels.texels, [[1, 2, 3, 4]], "{uri}");
        assert_says(&report.warnings().join("\n"), "beside the scene instead");
    }
    let why = |uri: &str| loaded("a.gltf", &textured(uri)).1.warnings().join("\n");
    assert_says(
        &why("../gone.png"),
        "lies outside the scene's folder and is not opened; put the file beside the scene;",
    );
    assert_says(&why(""), "empty URI");
}

#[test]
fn what_is_something_else_is_named_with_the_way_out() {
    assert_says(
        &refusal("a.glb", "version https://git-lfs.github.com/spec/v1\noid sha256:00\n"),
        "git lfs pull",
    );
    assert_says(&refusal("a.glb", "<!DOCTYPE html>\n<html></html>"), "content: is a web page");
    assert_says(&refusal("a.gltf", "PK\u{3}\u{4}"), "content: is a ZIP archive: unpack it");
}

#[test]
fn a_name_in_latin_1_costs_nothing() {
    let text = gltf_triangle(r#","name":"caf@""#, "", "").into_bytes();
    let text: Vec<u8> = text.into_iter().map(|byte| if byte == b'@' { 0xe9 } else { byte }).collect();
    let (mut world, report) = loaded_all(&[("a.gltf", &text)]);
    named::<GlobalTransform>(&mut world, "café");
    assert_says(&report.warnings().join("\n"), "not UTF-8");
}

#[test]
fn a_few_bytes_cannot_ask_for_more_memory_than_allowed() {
    // Accessors without data are zeros: nothing of them is in the file.
    let zeros =
        |count: u32, kind: &str| format!(r#"{{"componentType":5126,"count":{count},"type":"{kind}"}}"#);
    let accessors = |text: String, more: &str| {
        text.replace(r#""type":"VEC3"}],"#, &format!(r#""type":"VEC3"}},{more}],"#))
    };
    let instances = r#","extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":3}}}"#;
    let instances = accessors(gltf_triangle(instances, "", ""), &zeros(4_000_000, "VEC3"));
    assert_says(&too_much(1024, &instances), "node 0, instances");

    let targets = vec![r#"{"POSITION":3}"#; 3000].join(",");
    let morphs = format!(r#"],"targets":[{targets}]"#).replacen(']', "", 1);
    let morphs = accessors(gltf_triangle(r#","weights":[1]"#, &morphs, ""), &zeros(20_000, "VEC3"))
        .replace(r#""POSITION":0,"TEXCOORD_0":1"#, r#""POSITION":3"#);
    assert_says(&too_much(256, &morphs), "mesh 0, primitive 0, morph target");

    let nodes = vec![r#"{"mesh":0,"skin":0}"#; 500].join(",");
    let list = |count: usize, joint: &str| vec![joint; count].join(",");
    let all: Vec<String> = (0..500).map(|i| i.to_string()).collect();
    let skins = gltf_triangle("", "", &format!(r#","skins":[{{"joints":[{}]}}]"#, list(20_000, "0")))
        .replace(r#""nodes":[{"mesh":0}],"#, &format!(r#""nodes":[{nodes}],"#))
        .replace(r#"{"nodes":[0]}"#, &format!(r#"{{"nodes":[{}]}}"#, all.join(",")));
    assert_says(&too_much(256, &skins), "skin 0");

    for (kind, count) in [("nodes", 300_000), ("materials", 100_000), ("cameras", 300_000)] {
        let many = gltf_triangle("", "", &format!(r#","extras":0,"{kind}":[{}]"#, list(count, "{}")));
        let many = if kind == "nodes" { many.replace(r#""nodes":[{"mesh":0}],"#, "") } else { many };
        assert_says(&too_much(64, &many), "JSON");
    }
}

/// Each of them is a lamp to choose: what that takes is asked for as well.
#[test]
fn many_instances_that_shine_take_more_memory() {
    let instances = r#","extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":3}}}"#;
    let zeros = r#""type":"VEC3"},{"componentType":5126,"count":30000,"type":"VEC3"}],"#;
    let with_emission = |emission: &str| {
        let materials = format!(r#","materials":[{{"emissiveFactor":[0,{emission},0]}}]"#);
        gltf_triangle(instances, r#","material":0"#, &materials).replace(r#""type":"VEC3"}],"#, zeros)
    };
    assert!(within(24, &with_emission("0")).1.is_ok_and(|report| report.triangles == 30_000));
    assert_says(&too_much(24, &with_emission("1")), "its 30000 triangles that shine");
}

#[test]
fn a_file_of_version_1_is_called_so_although_its_lists_are_none() {
    let text = r#"{"asset":{"version":"1.0"},"nodes":{"a":{}},"meshes":{},"materials":{"b":{"c":[1,2]}}}"#;
    assert_says(&refusal("a.gltf", text), "glTF version 1.0; Penumbra reads 2.0");
}

#[test]
fn curves_that_do_not_fit_are_left_out_and_no_two_move_the_same() {
    let zeros = |kind: &str| format!(r#"{{"componentType":5126,"count":400000,"type":"{kind}"}}"#);
    let channel = |node: u32| format!(r#"{{"sampler":0,"target":{{"node":{node},"path":"translation"}}}}"#);
    let channels: Vec<String> = [0].into_iter().chain(0..60).map(channel).collect();
    let animations = format!(
        r#","animations":[{{"samplers":[{{"input":4,"output":3}}],"channels":[{}]}}]"#,
        channels.join(",")
    );
    let nodes = vec!["{}"; 60].join(",");
    let all: Vec<String> = (0..60).map(|i| i.to_string()).collect();
    let text = gltf_triangle("", "", &animations)
        .replace(r#""nodes":[{"mesh":0}],"#, &format!(r#""nodes":[{nodes}],"#))
        .replace(r#"{"nodes":[0]}"#, &format!(r#"{{"nodes":[{}]}}"#, all.join(",")))
        .replace(
            r#""type":"VEC3"}],"#,
            &format!(r#""type":"VEC3"}},{},{}],"#, zeros("VEC3"), zeros("SCALAR")),
        );
    let warnings = within(64, &text).1.unwrap().warnings().join("\n");
    assert_says(&warnings, "moves what another one of its animation moves");
    assert_says(&warnings, "too large for the memory allowed");
}

#[test]
fn materials_share_the_roughness_made_of_one_glossiness() {
    let material = |gloss: &str| {
        format!(
            r#"{{"extensions":{{"KHR_materials_pbrSpecularGlossiness":{{"glossinessFactor":{gloss},"specularGlossinessTexture":{{"index":0}}}}}}}}"#
        )
    };
    let materials = ["1", "1", "0.5", "1"].map(material).join(",");
    let more =
        format!(r#","materials":[{materials}],"textures":[{{"source":0}}],"images":[{{"uri":"a.png"}}]"#);
    let text = gltf_triangle("", r#","material":0"#, &more);
    let (mut world, report) = loaded_all(&[("a.gltf", text.as_bytes()), ("a.png", &png_of(64))]);
    assert_eq!(report.warnings(), Vec::<String>::new());
    let mut query = world.query::<(&Name, &Texture)>();
    let made = query.iter(&world).filter(|(name, _)| name.contains("roughness"));
    assert_eq!(made.count(), 2);
}

#[test]
fn what_is_left_out_is_said() {
    let warnings = |text: &str| loaded("a.gltf", text).1.warnings().join("\n");
    let flat = gltf_triangle(r#","scale":[0,0,0]"#, "", "");
    assert_says(&warnings(&flat), "node 0: scaled to nothing");
    let below = gltf_triangle("", "", "")
        .replace(r#""nodes":[{"mesh":0}],"#, r#""nodes":[{"children":[1],"scale":[1,0,1]},{"mesh":0}],"#);
    assert_says(&warnings(&below), "node 1: scaled to nothing");
    // Flat, but as much to be seen as ever.
    assert_eq!(warnings(&gltf_triangle(r#","scale":[2,1,0]"#, "", "")), "");
    let bare = textured(&format!("data:image/png;base64,{}", base64(&png([9; 4]))))
        .replace(r#","TEXCOORD_0":1"#, "");
    assert_says(&warnings(&bare), "no TEXCOORD_0");
    let undeclared = r#","materials":[{"extensions":{"KHR_materials_dispersion":{"dispersion":1}}}]"#;
    assert_says(
        &warnings(&gltf_triangle("", r#","material":0"#, undeclared)),
        "extension KHR_materials_dispersion is not supported",
    );
    let new = ["KHR_materials_diffuse_transmission", "KHR_materials_volume_scatter", "KHR_animation_pointer"];
    let used = warnings(&gltf_triangle("", "", &format!(r#","extensionsUsed":{new:?}"#)));
    for name in new {
        assert_says(&used, &format!("extension {name} is not supported"));
    }
}

/// A triangle with joints, weights and morph targets as given.
fn carried(joint: u8, attributes: &str, targets: &str) -> String {
    let mut file = Builder::default();
    let positions = file.floats("VEC3", &TRIANGLE);
    let (joints, weights) =
        (file.bytes4(&[[joint, 0, 0, 0]; 3], false), file.bytes4(&[[255, 0, 0, 0]; 3], true));
    assert_eq!((positions, joints, weights), (0, 1, 2));
    file.finish(&format!(
        r#""meshes":[{{"weights":[1],"primitives":[{{"attributes":{{"POSITION":0{attributes}}}{targets}}}]}}],
        "nodes":[{{"mesh":0,"skin":0}}],"scenes":[{{"nodes":[0]}}],"skins":[{{"joints":[0]}}]"#
    ))
}

#[test]
fn skins_and_morph_targets_that_cannot_do_what_they_should_are_told() {
    let warnings = |text: &str| loaded("a.gltf", text).1.warnings().join("\n");
    let bound = r#","JOINTS_0":1,"WEIGHTS_0":2"#;
    assert_eq!(warnings(&carried(0, bound, "")), "");
    assert_says(&warnings(&carried(9, bound, "")), "joints that their skin does not have: 3");
    assert_says(&warnings(&carried(0, "", "")), "no JOINTS_0 and WEIGHTS_0");
    assert_says(&warnings(&carried(0, bound, r#","targets":[{"COLOR_0":1}]"#)), "COLOR_0");
    assert_says(&warnings(&carried(0, bound, r#","targets":[{"TEXCOORD_0":1}]"#)), "TEXCOORD");
}
