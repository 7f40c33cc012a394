//! What the numbers of lamps in a glTF file mean.

use super::*;

/// What the numbers of lamps mean: by who wrote the file, by what shines beside them, or as the user says.
#[test]
fn units_of_lights_are_seen_from_the_file_or_said() {
    let made_of = |material: &str, generator: &str, intensity: f32, emissive: bool| {
        let more = format!(
            r#","extensionsUsed":["KHR_lights_punctual"],"extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":{intensity}}}]}}}},"materials":[{{"emissiveFactor":[{},0,0]}}]"#,
            u8::from(emissive)
        );
        gltf_triangle(r#","extensions":{"KHR_lights_punctual":{"light":0}}"#, material, &more)
            .replace(r#""version":"2.0""#, &format!(r#""version":"2.0","generator":"{generator}""#))
    };
    let file = |generator: &str, intensity: f32, emissive: bool| {
        made_of(r#","material":0"#, generator, intensity, emissive)
    };
    let shown = |text: &str, options: &LoadOptions| {
        let (mut world, result) = Folder::new(&[("a.gltf", text.as_bytes())]).load_with("a.gltf", options);
        let said = result.unwrap().decisions().join("\n");
        let Some(Light::Point { intensity }) = lights(&mut world).first().cloned() else { panic!("no lamp") };
        (intensity.x, said)
    };
    let blender = "Khronos glTF Blender I/O v4.2.57";
    let watts = 1000.0 / (4.0 * std::f32::consts::PI);
    let usual = LoadOptions::default();
    for (generator, intensity, emissive, expected, words) in [
        (blender, 683.0 * watts, true, watts, "candela and lux as the format says"),
        (blender, watts, true, watts, "\"Unitless\""),
        (blender, 1000.0, false, watts, "\"Raw\""),
        ("THREE.GLTFExporter", 683.0, false, 1.0, "candela and lux as the format says"),
        ("THREE.GLTFExporter", 3.0, true, 3.0, "cd/m²"),
    ] {
        let (found, said) = shown(&file(generator, intensity, emissive), &usual);
        assert!((found / expected - 1.0).abs() < 1e-5, "{generator} {intensity}: {found}");
        assert!(said.contains(words) && said.contains("--light-units"), "{generator} {intensity}: {said}");
    }
    // A material that nothing is made of says nothing.
    let (found, _) = shown(&made_of("", "THREE.GLTFExporter", 683.0, true), &usual);
    assert!((found - 1.0).abs() < 1e-5, "{found}");
    let told = |units| LoadOptions { light_units: Some(units), ..LoadOptions::default() };
    let text = file(blender, 683.0 * watts, false);
    assert!((shown(&text, &told(LightUnits::Watts)).0 / (683.0 * watts) - 1.0).abs() < 1e-5);
    assert!((shown(&text, &told(LightUnits::Candela)).0 / watts - 1.0).abs() < 1e-5);
}

/// What shines beside lamps says what their numbers mean; what is dark in the picture does not.
#[test]
fn what_does_not_shine_says_nothing_of_lamps() {
    let light = r#","extensions":{"KHR_lights_punctual":{"light":0}}"#;
    let shown = |material: &str, scenes: &str| {
        let more = format!(
            r#","extensionsUsed":["KHR_lights_punctual"],"extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":683}}]}}}},
            "textures":[{{"source":0}}],"images":[{{"uri":"black.png"}}],"materials":[{{"emissiveFactor":[1,0,0]{material}}}]"#
        );
        let text = gltf_triangle("", r#","material":0"#, &more)
            .replace(
                r#""nodes":[{"mesh":0}],"#,
                &format!(r#""nodes":[{{"mesh":0}},{{"name":"lamp"{light}}}],"#),
            )
            .replace(r#"{"nodes":[0]}"#, scenes);
        let (mut world, _) = loaded_all(&[("a.gltf", text.as_bytes()), ("black.png", &png([0, 0, 0, 255]))]);
        let Some(Light::Point { intensity }) = lights(&mut world).first().cloned() else { panic!("no lamp") };
        intensity.x
    };
    let both = r#"{"nodes":[0,1]}"#;
    assert_eq!(shown("", both), 683.0);
    for dark in [
        r#","extensions":{"KHR_materials_unlit":{}}"#,
        r#","extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":0}}"#,
        r#","emissiveTexture":{"index":0}"#,
    ] {
        assert_eq!(shown(dark, both), 1.0, "{dark}");
    }
    assert_eq!(shown("", r#"{"nodes":[1]},{"nodes":[0]}"#), 1.0, "in another scene");
}
