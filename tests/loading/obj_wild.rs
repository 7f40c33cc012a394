//! What other programs write into OBJ and MTL files without anybody having said so.

use super::*;

/// The material `m` of a library that defines it with these statements, beside a picture.
fn material(statements: &str) -> (World, Material, LoadReport) {
    let obj = format!("mtllib a.mtl\n{QUAD}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n");
    let library = format!("newmtl m\n{statements}\n");
    let red = png([200, 100, 50, 255]);
    let files: [(&str, &[u8]); 3] =
        [("a.obj", obj.as_bytes()), ("a.mtl", library.as_bytes()), ("red.png", &red)];
    let (mut world, report) = loaded_all(&files);
    let material = named(&mut world, "m");
    (world, material, report)
}

#[test]
fn models_of_glass_are_glass_only_where_light_can_pass() {
    let is_glass = |statements: &str| material(statements).1.glass.is_some();
    for glass in [
        "Kd 0 0 0\nillum 4",
        "Kd 1 1 1\nNi 1.5\nillum 7",
        "Kd 0.5 0.5 0.5\nTf 0.9 1 0.9\nillum 6",
        "Kd 1 1 1\nNi 1.5\nd 1\nillum 9",
    ] {
        assert!(is_glass(glass), "{glass}");
    }
    // Maya's of everything, and Blender's of what is half-transparent.
    let (_, opaque, report) = material("Kd 1 0 0\nTf 1 1 1\nNi 1.0\nillum 4");
    assert_eq!((opaque.glass, opaque.base_color, opaque.alpha), (None, Vec3::X, Alpha::Opaque));
    assert_says(&report.decisions().join("\n"), "no glass");
    let (_, half, _) = material("Kd 1 0 0\nNi 1.45\nd 0.5\nillum 9");
    assert_eq!((half.glass, half.base_color, half.alpha, half.opacity), (None, Vec3::X, Alpha::Blend, 0.5));
    assert!(!is_glass("Kd 0 0 0\nmap_Kd red.png\nillum 4"));
    // Of a filter that lets nothing pass nobody makes black glass.
    let (_, dark, report) = material("Kd 0.5 0.4 0.3\nTf 0 0 0\nNi 1.5\nillum 4");
    assert_eq!((dark.glass, dark.base_color), (None, Vec3::new(0.5, 0.4, 0.3)));
    assert_says(&report.decisions().join("\n"), "Tf 0, which lets no light through: no glass");
    let (_, clear, _) = material("Kd 0 0 0\nTf 0 0 0\nNi 1.5\nillum 4");
    assert_eq!(clear.glass.unwrap().tint, Vec3::ONE);
}

/// A picture that is named is meant to be seen.
#[test]
fn a_black_factor_does_not_hide_its_picture() {
    for (statements, words) in [
        ("Ke 0 0 0\nmap_Ke red.png", "Ke is black"),
        ("d 0\nmap_d red.png", "d is 0"),
        ("Ks 0 0 0\nNs 50\nmap_Ks red.png", "map_Ks without Ks"),
    ] {
        let (_, m, report) = material(statements);
        assert_says(&report.warnings().join("\n"), words);
        assert_eq!(m.emission != Vec3::ZERO, statements.starts_with("Ke"), "{statements}");
        assert_eq!(m.opacity, 1.0, "{statements}");
    }
    let (_, dark, _) = material("Ke 0 0 0\nmap_Ke not_there.png");
    assert_eq!(dark.emission, Vec3::ZERO, "what stands in for a picture is no lamp");
}

#[test]
fn statements_in_capitals_are_what_they_are() {
    let obj = format!("MTLLIB a.mtl\n{QUAD}O one\nUSEMTL m\nF 1 2 3\nO two\nS 1\nF 1 3 4\n");
    let (mut world, report) = loaded_all(&[("a.obj", obj.as_bytes()), ("a.mtl", b"newmtl m\nKd 1 0 0\n")]);
    assert_eq!(report.warnings(), [""; 0]);
    assert_eq!(world.query::<&Instance>().iter(&world).count(), 2);
    assert_eq!(named::<Material>(&mut world, "m").base_color, Vec3::X);
}

/// What a file calls its things is shown, not done.
#[test]
fn names_do_nothing_to_the_terminal() {
    let (_, report) = loaded("a.obj", &format!("{QUAD}usemtl \u{1b}[2Jgone\u{7}\nf 1 2 3\n"));
    let said = report.warnings().join("\n");
    assert_says(&said, "gone");
    assert!(!said.replace('\n', "").contains(char::is_control), "{said:?}");
}

#[test]
fn comments_quotes_and_other_letter_case_change_nothing() {
    let (world, m, report) =
        material("kD 1 0.5 0.25 # orange\nNs 20 # dull\nKs 0 0 0\nMAP_KD \"red.png\" # the skin");
    assert_eq!(report.warnings(), [""; 0]);
    assert_eq!(m.base_color, Vec3::new(1.0, 0.5, 0.25));
    let texture = world.get::<Texture>(m.base_color_texture.unwrap().texture).unwrap();
    assert_eq!(texture.texels.texels, [[200, 100, 50, 255]]);
    // A name may have one in it.
    let obj = format!(
        "mtllib \"a b.mtl\" # theirs\n{QUAD}usemtl paint #2\nf 1 2 3\nusemtl \"m\" # mine\nf 1 3 4\n"
    );
    let library = b"newmtl paint #2\nKd 0 1 0\nnewmtl m # blue\nKd 0 0 1\n";
    let (mut world, report) = loaded_all(&[("a.obj", obj.as_bytes()), ("a b.mtl", library)]);
    assert_eq!(report.warnings(), [""; 0]);
    assert_eq!(named::<Material>(&mut world, "paint #2").base_color, Vec3::Y);
    let instance = world.query::<&Instance>().single(&world).unwrap().clone();
    assert_eq!(world.get::<Material>(instance.materials[1]).unwrap().base_color, Vec3::Z);
}

#[test]
fn one_channel_of_a_picture_may_be_meant_and_its_values_moved() {
    let texel = |statements: &str| {
        let (world, m, _) = material(statements);
        world.get::<Texture>(m.base_color_texture.unwrap().texture).unwrap().texels.texels[0]
    };
    assert_eq!(texel("map_Kd red.png\nmap_d -imfchan g red.png"), [200, 100, 50, 100]);
    assert_eq!(texel("map_Kd -mm 0 0.5 red.png"), [100, 50, 25, 255]);
}

#[test]
fn a_lamp_of_a_library_shines_from_both_sides() {
    assert!(material("Ke 1 1 1").1.double_sided);
}

#[test]
fn factors_of_zero_do_not_hide_pictures_and_a_coat_is_enough() {
    let (_, m, _) = material("Pr 0\nPm 0\nmap_Pr red.png\nmap_Pm red.png");
    assert!(matches!(m.glossy, Glossy::Ggx { metallic: 1.0, roughness: 1.0, .. }), "{:?}", m.glossy);
    assert!(material("Pc 1").1.layers.unwrap().clearcoat.is_some());
    let (_, m, _) = material("Ks 1 1 1\nKd 0 0 0\nNs 100\nillum 3\nPc 0\naniso 0");
    assert_eq!((m.mirror, m.glossy), (Vec3::ONE, Glossy::None));
}

#[test]
fn a_bump_map_that_is_not_there_leaves_the_surface_flat() {
    let (_, m, report) = material("map_Bump none.png");
    assert!(m.normal_map.is_none());
    assert_says(&report.warnings().join("\n"), "none.png");
    assert_says(&report.warnings().join("\n"), "the surface stays flat");
    let obj = format!("mtllib a.mtl\n{QUAD}usemtl m\nf 1 2 3\n");
    let files: [(&str, &[u8]); 3] =
        [("a.obj", obj.as_bytes()), ("a.mtl", b"newmtl m\nmap_Bump a.png\n"), ("a.png", b"no picture")];
    let (mut world, report) = loaded_all(&files);
    assert_says(&report.warnings().join("\n"), "the surface stays flat");
    assert_eq!(world.query::<&Texture>().iter(&world).count(), 0, "of a picture that is broken");
    let (_, _, report) = material("map_Bump none.png\nmap_Kd none.png");
    assert_says(&report.warnings().join("\n"), "a magenta checker stands in");
}

#[test]
fn targa_pictures_are_read() {
    // 1×1, 24 bits, blue first.
    let targa = [0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0, 50, 100, 200];
    let obj = format!("mtllib a.mtl\n{QUAD}usemtl m\nf 1 2 3\n");
    let files: [(&str, &[u8]); 3] =
        [("a.obj", obj.as_bytes()), ("a.mtl", b"newmtl m\nmap_Kd a.tga\n"), ("a.tga", &targa)];
    let (mut world, report) = loaded_all(&files);
    assert_eq!(report.warnings(), [""; 0]);
    assert_eq!(world.query::<&Texture>().single(&world).unwrap().texels.texels, [[200, 100, 50, 255]]);
    // What only looks a little like one is named.
    let (_, report) = loaded_all(&[files[0], files[1], ("a.tga", &targa[..12])]);
    assert_says(&report.warnings().join("\n"), "not recognised");
}

#[test]
fn a_folder_of_textures_beside_the_model_is_looked_into() {
    let obj = format!("mtllib a.mtl\n{QUAD}usemtl m\nf 1 2 3\n");
    let mtl = b"newmtl m\nmap_Kd D:\\work\\skin.png\n";
    for place in ["textures/skin.png", "model/textures/skin.png", "model/skin.png"] {
        let red = png([200, 100, 50, 255]);
        let files: [(&str, &[u8]); 3] =
            [("model/a.obj", obj.as_bytes()), ("model/a.mtl", mtl), (place, &red)];
        let (_, report) = loaded_all(&files);
        assert_eq!(report.warnings(), [""; 0], "{place}");
    }
}

#[test]
fn places_far_from_zero_keep_their_shape() {
    let obj = "v 500000.25 100.5 5432109.125\nv 500000.5 100.5 5432109.125\nv 500000.25 100.75 5432109.25\nf 1 2 3\n";
    let (mut world, _) = loaded("a.obj", obj);
    let mesh = only_mesh(&mut world);
    assert_eq!(mesh.positions[1] - mesh.positions[0], Vec3::new(0.25, 0.0, 0.0));
    assert_eq!(mesh.positions[2] - mesh.positions[0], Vec3::new(0.0, 0.25, 0.125));
    let (_, placed) = world.query::<(&Instance, &GlobalTransform)>().single(&world).unwrap();
    let corner = placed.0.transform_point3(mesh.positions[0].as_dvec3());
    assert_eq!(corner, DVec3::new(500_000.25, 100.5, 5_432_109.125));
}

#[test]
fn places_near_zero_stay_where_they_are_whatever_else_is_in_the_file() {
    let near = "v 0.1 0.2 0.3\nv 1.1 0.2 0.3\nv 0.1 1.2 0.3\n";
    for (far, face) in [
        ("v 1e10 0 0\n", "f 2 3 4\n"),
        ("v nan 5000 0\n", "f 2 3 4\n"),
        ("v 10000 0 0\nv -10000 0 0\nv 0 10000 0\n", "f 1 2 3\nf 4 5 6\n"),
    ] {
        let (mut world, _) = loaded("a.obj", &format!("{far}{near}{face}"));
        let mesh = only_mesh(&mut world);
        assert!(mesh.positions.contains(&Vec3::new(0.1, 0.2, 0.3)), "{far}: {:?}", mesh.positions);
        let (_, placed) = world.query::<(&Instance, &GlobalTransform)>().single(&world).unwrap();
        assert_eq!(placed.0, DAffine3::IDENTITY, "{far}");
    }
}

#[test]
fn triangles_that_go_round_against_their_normals_are_turned() {
    let text = format!("{QUAD}vn 0 0 -1\nf 1//1 2//1 3//1\n");
    let (mut world, report) = loaded("a.obj", &text);
    assert_eq!(only_mesh(&mut world).triangles, [[0, 2, 1]]);
    assert_says(&report.warnings().join("\n"), "turned over");
}

#[test]
fn gloss_without_an_exponent_is_no_second_white_paint() {
    // As MeshLab, SketchUp and trimesh write everything.
    for statements in
        ["Ks 1 1 1\nNs 0\nKd 1 0 0", "Ks 0.33 0.33 0.33\nKd 1 0 0", "Ks 0.4 0.4 0.4\nNs 1\nKd 1 0 0"]
    {
        let (_, m, report) = material(statements);
        assert_eq!((m.base_color, m.glossy), (Vec3::X, Glossy::None), "{statements}");
        assert_says(&report.decisions().join("\n"), "no highlight");
    }
    for statements in ["Ks 0.4 0.4 0.4\nNs 2\nKd 0.5 0 0", "Ks 0.4 0.4 0.4\nmap_Ns red.png\nKd 0.5 0 0"] {
        assert!(matches!(material(statements).1.glossy, Glossy::BlinnPhong { .. }), "{statements}");
    }
    assert_ne!(material("Ks 1 1 1\nKd 0 0 0\nillum 3").1.mirror, Vec3::ZERO);
}

#[test]
fn what_has_a_picture_is_no_clear_glass() {
    let (_, m, report) = material("Kd 1 1 1\nmap_Kd red.png\nNi 1.5\nillum 7");
    assert!(m.glass.is_none() && m.base_color_texture.is_some());
    assert_says(&report.decisions().join("\n"), "its picture");
    let (_, m, report) = material("Kd 1 0 0\nTf 0.5 0.5 0.5\nillum 7\nNi 1.5");
    assert!(m.glass.is_some());
    assert_says(&report.decisions().join("\n"), "Kd is not seen");
}

#[test]
fn the_colour_of_seven_numbers_is_the_first_three_of_four() {
    let colors = |tail: &str| {
        let text = format!("v 0 0 0 {tail}\nv 1 0 0 {tail}\nv 0 1 0 {tail}\nf 1 2 3\n");
        only_mesh(&mut loaded("a.obj", &text).0).colors[0].truncate()
    };
    assert_eq!(colors("1 0 0 1"), Vec3::X);
    assert_eq!(colors("1 0 0 0"), Vec3::ZERO, "a weight, and black");
    assert_eq!(colors("0 0 1 0.5"), Vec3::Z);
}

#[test]
fn options_may_stand_behind_the_name_and_alpha_in_the_picture() {
    let (world, m, report) = material("Kd 1 1 1\nmap_Kd red.png -s 2 2 1");
    assert_eq!(report.warnings(), [""; 0]);
    let of = m.base_color_texture.unwrap();
    assert_eq!(of.uv_transform.transform_vector2(Vec2::X), Vec2::X * 2.0);
    assert!(world.get::<Texture>(of.texture).is_some() && m.alpha == Alpha::Opaque);
    // A leaf: there is something, and beside it there is nothing.
    let leaf = picture(&[[0, 200, 0, 255], [0; 4], [0; 4], [0; 4]].concat(), 2, image::ImageFormat::Png);
    let with = |statements: &str| {
        let obj =
            format!("mtllib a.mtl\n{QUAD}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n");
        let library = format!("newmtl m\nmap_Kd leaf.png\n{statements}\n");
        let files: [(&str, &[u8]); 3] =
            [("a.obj", obj.as_bytes()), ("a.mtl", library.as_bytes()), ("leaf.png", &leaf)];
        named::<Material>(&mut loaded_all(&files).0, "m").alpha
    };
    assert_eq!((with(""), with("d 1")), (Alpha::Blend, Alpha::Blend));
    assert_eq!(with("map_d leaf.png"), Alpha::Blend);
}

#[test]
fn a_library_that_was_renamed_with_its_scene_is_found() {
    let obj = format!("mtllib old.mtl\n{QUAD}usemtl m\nf 1 2 3 4\n");
    let files: [(&str, &[u8]); 2] = [("a.obj", obj.as_bytes()), ("a.mtl", b"newmtl m\nKd 1 0 0\n")];
    let (mut world, report) = loaded_all(&files);
    assert_eq!(named::<Material>(&mut world, "m").base_color, Vec3::X);
    assert_says(&report.warnings().join("\n"), "`a.mtl` beside it is taken");
}

#[test]
fn what_is_no_scene_is_called_so() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n";
    assert_says(&refusal("a.obj", pointer), "git lfs pull");
}
