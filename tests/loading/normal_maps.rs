//! Normal maps and second texture coordinates of glTF files.

use super::*;
use glam::Vec4;

/// The triangle of `gltf_triangle` with a second set of coordinates (those of its positions) and a picture.
fn with_maps(attributes: &str, material: &str) -> String {
    let picture = base64(&png([255, 128, 128, 255]));
    let more = format!(
        r#","materials":[{{"name":"m",{material}}}],"textures":[{{"source":0}}],
        "images":[{{"uri":"data:image/png;base64,{picture}"}}]"#
    );
    gltf_triangle("", r#","material":0"#, &more)
        .replace(r#""TEXCOORD_0":1"#, &format!(r#""TEXCOORD_0":1{attributes}"#))
}

#[test]
fn a_normal_map_brings_tangents_of_its_own_texture_coordinates() {
    let text = with_maps(r#","NORMAL":2"#, r#""normalTexture":{"index":0,"scale":0.5}"#);
    let (mut world, report) = loaded("a.gltf", &text);
    assert_eq!(report.warnings(), [""; 0]);
    let map = named::<Material>(&mut world, "m").normal_map.unwrap();
    assert_eq!((map.scale, map.texture.second_uvs), (0.5, false));
    assert_eq!(world.get::<Texture>(map.texture.texture).unwrap().encoding, Encoding::Linear);
    // v is down, so the bitangent, which is up, runs against +Y.
    assert_eq!(only_mesh(&mut world).tangents, [Vec4::new(1.0, 0.0, 0.0, -1.0); 3]);
    // Without a normal map nobody needs them.
    let (mut world, _) = loaded("a.gltf", &with_maps(r#","NORMAL":2"#, r#""doubleSided":false"#));
    assert!(only_mesh(&mut world).tangents.is_empty());
}

#[test]
fn tangents_follow_the_picture_however_it_is_turned() {
    let transform = r#""normalTexture":{"index":0,"extensions":{"KHR_texture_transform":{"scale":[-1,1]}}}"#;
    let (mut world, report) = loaded("a.gltf", &with_maps(r#","NORMAL":2"#, transform));
    assert_eq!(report.warnings(), [""; 0]);
    // The mirror image of what it is without: u grows the other way, v as before.
    assert_eq!(only_mesh(&mut world).tangents, [Vec4::new(-1.0, 0.0, 0.0, 1.0); 3]);
}

#[test]
fn texture_coordinates_without_area_leave_the_normal_map_out_and_say_so() {
    let text = with_maps(r#","NORMAL":2"#, r#""normalTexture":{"index":0}"#)
        .replace(r#""byteOffset":36,"componentType":5126"#, r#""byteOffset":24,"componentType":5126"#);
    // Now (0, 0), (0, 0), (0, 1): a line.
    let (mut world, report) = loaded("a.gltf", &text);
    assert_says(&report.warnings().join("\n"), "corners have a normal map");
    assert!(only_mesh(&mut world).tangents.iter().all(|t| t.truncate() == Vec3::ZERO));
}

#[test]
fn each_texture_has_the_coordinates_it_asks_for() {
    let maps = r#""pbrMetallicRoughness":{"baseColorTexture":{"index":0,"texCoord":1}},
        "normalTexture":{"index":0,"texCoord":2},
        "emissiveTexture":{"index":0,"extensions":{"KHR_texture_transform":{"texCoord":1}}},"emissiveFactor":[1,1,1]"#;
    let text = with_maps(r#","NORMAL":2,"TEXCOORD_1":3,"TEXCOORD_2":1"#, maps).replace(
        r#""count":3,"type":"VEC3"}],"#,
        r#""count":3,"type":"VEC3"},{"bufferView":0,"byteOffset":44,"componentType":5126,"count":3,"type":"VEC2"}],"#,
    );
    let (mut world, report) = loaded("a.gltf", &text);
    assert_eq!(report.warnings(), [""; 0]);
    let material = named::<Material>(&mut world, "m");
    assert!(
        !material.base_color_texture.unwrap().second_uvs && !material.emission_texture.unwrap().second_uvs
    );
    assert!(material.normal_map.unwrap().texture.second_uvs);
    let mesh = only_mesh(&mut world);
    assert_eq!(mesh.uvs[1], Vec2::new(0.0, 1.0));
    assert_eq!(mesh.second_uvs[1], Vec2::new(1.0, 0.0));
}
