//! Textures and physically based values of MTL libraries.

use super::*;

fn material(statements: &str) -> (World, LoadReport) {
    material_of("", statements)
}

fn material_of(header: &str, statements: &str) -> (World, LoadReport) {
    let obj = format!("mtllib a.mtl\n{QUAD}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n");
    let library = format!("{header}newmtl m\n{statements}\n");
    let (red, blue) = (png([200, 100, 50, 255]), png([128, 128, 255, 255]));
    let files: [(&str, &[u8]); 4] =
        [("a.obj", obj.as_bytes()), ("a.mtl", library.as_bytes()), ("red.png", &red), ("blue.png", &blue)];
    loaded_all(&files)
}

fn texel(world: &World, texture: Option<penumbra::scene::TextureUse>) -> ([u8; 4], Encoding) {
    let texture = world.get::<Texture>(texture.expect("no texture").texture).unwrap();
    (texture.texels.texels[0], texture.encoding)
}

#[test]
fn gloss_has_its_colour_and_its_exponent_from_pictures() {
    let (mut world, report) = material("Ks 0.2 0.2 0.2\nNs 50\nmap_Ks blue.png\nmap_Ns red.png");
    assert_eq!(report.warnings(), [""; 0]);
    let Glossy::BlinnPhong { exponent: 50.0, texture, .. } = named::<Material>(&mut world, "m").glossy else {
        panic!("not glossy")
    };
    assert_eq!(texel(&world, texture), ([128, 128, 255, 200], Encoding::Srgb));
}

/// As Blender 5.0 writes a surface whose specular level and metalness are pictures; 128 is as strong as its index says.
#[test]
fn blender_writes_maps_of_gloss_and_metal_without_their_numbers() {
    let header = "# Blender 5.0.1 MTL File: 'None'\n";
    let statements = "Ns 250\nKd 1 1 1\nNi 1.5\nd 1\nillum 2\nmap_Ks blue.png\nmap_refl red.png";
    let (mut world, report) = material_of(header, statements);
    assert_eq!(report.warnings(), [""; 0]);
    let seen = named::<Material>(&mut world, "m");
    let Glossy::Ggx { metallic: 1.0, roughness: 0.5, texture } = seen.glossy else {
        panic!("{:?}", seen.glossy)
    };
    assert_eq!(texel(&world, texture), ([255, 255, 200, 255], Encoding::Linear));
    let layers = seen.layers.unwrap();
    assert_eq!(layers.specular_color, Vec3::splat(2.0));
    assert_eq!(texel(&world, layers.specular_color_texture), ([128, 128, 255, 255], Encoding::Linear));
    // Of others nobody knows what they mean.
    let warnings = material(statements).1.warnings().concat();
    assert_says(&warnings, "map_Ks without Ks");
    assert_says(&warnings, "`map_refl` is not supported");
}

#[test]
fn a_picture_is_seen_where_its_colour_is_black() {
    let (mut world, report) = material("Kd 0 0 0\nmap_Kd red.png");
    assert_says(&report.warnings().concat(), "Kd is black");
    let seen = named::<Material>(&mut world, "m");
    assert_eq!(seen.base_color, Vec3::ONE);
    assert_eq!(texel(&world, seen.base_color_texture), ([200, 100, 50, 255], Encoding::Srgb));
    // Without a picture black is black.
    assert_eq!(named::<Material>(&mut material("Kd 0 0 0").0, "m").base_color, Vec3::ZERO);
}

#[test]
fn metal_roughness_varnish_cloth_and_brush_make_a_layered_surface() {
    let (mut world, report) =
        material("Pr 0.5\nPm 0.25\nPc 1\nPcr 0.1\nPs 0.5\naniso 0.7\nanisor 0.25\nNi 1.8\nmap_Pr red.png");
    assert_eq!(report.warnings(), [""; 0]);
    let material = named::<Material>(&mut world, "m");
    let Glossy::Ggx { metallic: 0.25, roughness: 0.5, texture } = material.glossy else {
        panic!("{:?}", material.glossy)
    };
    assert_eq!(texel(&world, texture), ([255, 200, 255, 255], Encoding::Linear));
    let layers = material.layers.unwrap();
    assert_eq!(layers.ior, 1.8);
    let coat = layers.clearcoat.unwrap();
    assert_eq!((coat.factor, coat.roughness), (1.0, 0.1));
    assert_eq!(layers.sheen.unwrap().color, Vec3::splat(0.5));
    let brushed = layers.anisotropy.unwrap();
    assert_eq!((brushed.strength, brushed.rotation), (0.7, std::f32::consts::FRAC_PI_2));
    // The mesh has the directions that the brush needs.
    assert_eq!(only_mesh(&mut world).tangents.len(), 4);
}

#[test]
fn a_bump_map_is_turned_into_normals_unless_it_has_them_already() {
    let normal = |statement: &str| {
        let (mut world, report) = material(statement);
        assert_eq!(report.warnings(), [""; 0]);
        let map = named::<Material>(&mut world, "m").normal_map.expect("no normal map");
        assert!(!only_mesh(&mut world).tangents.is_empty());
        (texel(&world, Some(map.texture)), map.scale)
    };
    // One texel has no slope.
    assert_eq!(normal("map_Bump -bm 0.5 red.png"), (([128, 128, 255, 255], Encoding::Linear), 1.0));
    assert_eq!(normal("bump -bm 0.5 blue.png"), (([128, 128, 255, 255], Encoding::Linear), 0.5));
    assert_eq!(normal("norm red.png"), (([200, 100, 50, 255], Encoding::Linear), 1.0));
}
