//! Material extensions of glTF files.

use super::*;
use penumbra::scene::Layers;

fn material(pbr: &str, extensions: &str) -> (World, LoadReport) {
    let picture = base64(&png([255, 128, 0, 51]));
    let more = format!(
        r#","materials":[{{"name":"m","pbrMetallicRoughness":{{{pbr}}},"extensions":{{{extensions}}}}}],
        "textures":[{{"source":0}}],"images":[{{"uri":"data:image/png;base64,{picture}"}}]"#
    );
    loaded("a.gltf", &gltf_triangle("", r#","material":0"#, &more))
}

fn layers(extensions: &str) -> Layers {
    let (mut world, report) = material("", extensions);
    assert_eq!(report.warnings(), [""; 0]);
    *named::<Material>(&mut world, "m").layers.expect("no layers")
}

#[test]
fn what_changes_nothing_makes_no_layer() {
    let (mut world, _) = material("", r#""KHR_materials_ior":{"ior":1.5},"KHR_materials_clearcoat":{}"#);
    assert_eq!(named::<Material>(&mut world, "m").layers, None);
    let (mut world, _) = material("", r#""KHR_materials_unlit":{},"KHR_materials_ior":{"ior":2}"#);
    let material = named::<Material>(&mut world, "m");
    assert!(material.unlit && material.layers.is_none());
}

#[test]
fn an_index_that_no_body_has_is_the_usual_one_and_told() {
    let (_, report) = material("", r#""KHR_materials_ior":{"ior":0.8}"#);
    assert_says(&report.warnings().join("\n"), "material `m`: index of refraction 0.8: 1.5 instead");
    // All light is thrown back: the extension says so.
    let (_, report) = material("", r#""KHR_materials_ior":{"ior":0}"#);
    assert_eq!(report.warnings(), [""; 0]);
}

#[test]
fn transmission_is_a_pane_and_with_thickness_a_body() {
    let through =
        r#""KHR_materials_transmission":{"transmissionFactor":0.7},"KHR_materials_ior":{"ior":1.33}"#;
    let pane = layers(through);
    assert_eq!(pane.ior, 1.33);
    let transmission = pane.transmission.unwrap();
    assert_eq!((transmission.factor, transmission.body), (0.7, None));
    let volume = r#""KHR_materials_volume":{"thicknessFactor":1,"attenuationDistance":2,"attenuationColor":[1,0.5,0]}"#;
    let body = layers(&format!("{through},{volume}")).transmission.unwrap().body.unwrap();
    // Half of green is left after a way of 2.
    assert!((body.absorption.y - 0.5f32.ln() / -2.0).abs() < 1e-6 && body.absorption.x == 0.0);
    assert!(body.absorption.is_finite() && body.absorption.z > 4.0);
}

#[test]
fn varnish_cloth_and_brush_are_read_with_their_textures() {
    let layers = layers(
        r#""KHR_materials_clearcoat":{"clearcoatFactor":1,"clearcoatRoughnessFactor":0.25,
             "clearcoatRoughnessTexture":{"index":0},"clearcoatNormalTexture":{"index":0,"scale":2}},
           "KHR_materials_sheen":{"sheenColorFactor":[1,0.5,0],"sheenColorTexture":{"index":0},"sheenRoughnessFactor":0.5},
           "KHR_materials_anisotropy":{"anisotropyStrength":0.5,"anisotropyRotation":1.5},
           "KHR_materials_specular":{"specularFactor":0.5,"specularColorFactor":[2,1,1]}"#,
    );
    let coat = layers.clearcoat.unwrap();
    assert_eq!((coat.factor, coat.roughness, coat.normal_map.unwrap().scale), (1.0, 0.25, 2.0));
    assert!(coat.texture.is_none() && coat.roughness_texture.is_some());
    let sheen = layers.sheen.unwrap();
    assert_eq!((sheen.color, sheen.roughness), (Vec3::new(1.0, 0.5, 0.0), 0.5));
    let brushed = layers.anisotropy.unwrap();
    assert_eq!((brushed.strength, brushed.rotation), (0.5, 1.5));
    assert_eq!((layers.specular, layers.specular_color), (0.5, Vec3::new(2.0, 1.0, 1.0)));
}

#[test]
fn specular_and_glossiness_are_a_dielectric_of_that_reflectance() {
    let (mut world, report) = material(
        "",
        r#""KHR_materials_pbrSpecularGlossiness":{"diffuseFactor":[0.1,0.2,0.3,1],"specularFactor":[0.5,0.4,0.3],
            "glossinessFactor":0.5,"specularGlossinessTexture":{"index":0}}"#,
    );
    assert_eq!(report.warnings(), [""; 0]);
    let material = named::<Material>(&mut world, "m");
    let layers = material.layers.unwrap();
    assert_eq!(material.base_color, Vec3::new(0.1, 0.2, 0.3));
    assert!(layers.ior.is_infinite() && layers.specular_color == Vec3::new(0.5, 0.4, 0.3));
    let Glossy::Ggx { metallic: 0.0, roughness: 1.0, texture: Some(rough) } = material.glossy else {
        panic!("{:?}", material.glossy)
    };
    let rough = world.get::<Texture>(rough.texture).unwrap();
    // A fifth of half: 0.9 is lacking.
    assert_eq!((rough.encoding, rough.texels.texels[0][1]), (Encoding::Linear, 230));
}

#[test]
fn an_extension_that_is_written_oddly_is_ignored_and_named() {
    let (mut world, report) = material("", r#""KHR_materials_sheen":{"sheenColorFactor":"red"}"#);
    assert_says(&report.warnings().join("\n"), "KHR_materials_sheen");
    assert_eq!(named::<Material>(&mut world, "m").layers, None);
}
