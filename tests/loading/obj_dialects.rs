//! Spellings of numbers, text and names that single programs have, and libraries that only they would write.

use super::*;

/// The material `m` of a library that begins with `head` and defines it with these statements, beside two pictures.
fn material(head: &str, statements: &str) -> (World, Material, LoadReport) {
    let obj = format!("mtllib a.mtl\n{QUAD}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n");
    let library = format!("{head}newmtl m\n{statements}\n");
    let red = png([200, 100, 50, 255]);
    let files: [(&str, &[u8]); 3] =
        [("a.obj", obj.as_bytes()), ("a.mtl", library.as_bytes()), ("red.png", &red)];
    let (mut world, report) = loaded_all(&files);
    let material = named(&mut world, "m");
    (world, material, report)
}

#[test]
fn numbers_of_fortran_indices_with_points_and_capitals_are_read() {
    for text in [
        "v 0 0 0\nv 1.0D+0 0 0\nv 0 1.0d0 0\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1.0 2.0 3.0\n",
        "V 0 0 0\nV 1 0 0\nV 0 1 0\nF 1 2 3\n",
    ] {
        let (mut world, report) = loaded("a.obj", text);
        assert_eq!(only_mesh(&mut world).positions, [Vec3::ZERO, Vec3::X, Vec3::Y], "{text}");
        assert_eq!(report.warnings(), [""; 0], "{text}");
    }
    let message = refusal("a.obj", "v 0,0 0,0 0,0\nv 1,0 0,0 0,0\nv 0,0 1,0 0,0\nf 1 2 3\n");
    assert_says(&message, "line 1: `0,0` is not a number: a comma instead of a point");
}

#[test]
fn smoothing_may_be_on_without_a_number_and_with_a_comment() {
    let roof = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 1\nv 0 2 0\nv 1 2 0\n";
    let is_smooth = |group: &str| {
        let (mut world, _) = loaded("a.obj", &format!("{roof}s {group}\nf 1 2 3 4\nf 4 3 6 5\n"));
        only_mesh(&mut world).positions.len() == 6 && !only_mesh(&mut world).normals.is_empty()
    };
    assert!(["1", "on", "3 # round", "2\t"].iter().all(|group| is_smooth(group)));
    assert!(!["0", "off", "null", ""].iter().any(|group| is_smooth(group)));
}

#[test]
fn text_in_utf_16_and_with_zeros_at_its_end_is_text() {
    let text = format!("\u{feff}o Caf\u{e9}\n{QUAD}f 1 2 3 4\n");
    let wide = |of: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(of).collect::<Vec<u8>>();
    let (little, big) = (wide(u16::to_le_bytes), wide(u16::to_be_bytes));
    let padded = [QUAD.as_bytes(), b"f 1 2 3 4\n\x1a\0\0\0"].concat();
    for bytes in [&little, &big, &padded] {
        let (mut world, report) = loaded_all(&[("a.obj", bytes)]);
        assert_eq!((report.triangles, report.warnings().len()), (2, 0));
        assert_eq!(only_mesh(&mut world).positions.len(), 4);
    }
    // Half a pair of surrogates, and zeros amid the text.
    let broken = [&little[..], &[0, 0xd8, b'\n', 0]].concat();
    let (_, result) = Folder::new(&[("a.obj", &broken)]).load("a.obj");
    assert_says(&result.unwrap_err().to_string(), "UTF-16");
    assert_says(&refusal("a.obj", "v 0 0\0 0\n"), "binary data");
}

#[test]
fn zbrush_paints_in_comments() {
    let paint = "#MRGB Block\n#MRGB ffff0000ff00ff00\n#MRGB ff0000ffffffffff\n";
    let (mut world, report) = loaded("a.obj", &format!("{QUAD}{paint}f 1 2 3 4\n"));
    let colors: Vec<Vec3> = only_mesh(&mut world).colors.iter().map(|color| color.truncate()).collect();
    assert_eq!(colors, [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE]);
    assert_says(&report.decisions().join("\n"), "#MRGB");
    assert_eq!(report.warnings(), [""; 0]);
    let (mut world, report) = loaded("a.obj", &format!("{QUAD}#MRGB ffff0000\nf 1 2 3 4\n"));
    assert!(only_mesh(&mut world).colors.is_empty());
    assert_says(&report.warnings().join("\n"), "1 of them for 4 vertices");
}

#[test]
fn vtk_says_opacity_by_tr_and_nothing_by_illum_3() {
    let head = "# wavefront mtl file written by the visualization toolkit\n\n";
    let statements = |tr: &str| format!("Ka 1 1 1\nKd 0.8 0.2 0.1\nKs 1 1 1\nNs 100\nTr {tr}\nillum 3");
    let (_, solid, report) = material(head, &statements("1"));
    assert_eq!((solid.base_color, solid.mirror), (Vec3::new(0.8, 0.2, 0.1), Vec3::ZERO));
    assert_eq!((solid.glossy, solid.opacity, solid.alpha), (Glossy::None, 1.0, Alpha::Opaque));
    assert_eq!(report.warnings(), [""; 0]);
    let said = report.decisions().into_iter().filter(|line| line.contains("VTK")).count();
    assert_eq!(said, 1);
    let (_, thin, _) = material(head, &statements("0.25"));
    assert_eq!((thin.opacity, thin.alpha), (0.25, Alpha::Blend));
    // New versions write strengths: without one, and with.
    let newer = |ks: &str| format!("Ka 0 0 0\nKd 0.8 0.2 0.1\nKs {ks}\nNs 30\nTr 1\nillum 3");
    assert_eq!(material(head, &newer("0 0 0")).1.glossy, Glossy::None);
    assert_ne!(material(head, &newer("0.5 0.5 0.5")).1.glossy, Glossy::None);
    // Others mean a mirror, and what Tr says.
    let (_, mirror, _) = material("", &statements("0.25"));
    assert!(mirror.mirror != Vec3::ZERO && mirror.opacity == 0.75);
}

#[test]
fn glass_whose_index_bends_nothing_is_usual_glass_and_says_so() {
    for (index, said) in [("0.8", true), ("1", true), ("1.3", false)] {
        let (_, glass, report) = material("", &format!("Kd 0 0 0\nTf 0.9 0.5 0.5\nNi {index}\nillum 7"));
        let expected = if said { 1.5 } else { 1.3 };
        assert_eq!(glass.glass.unwrap().ior, expected, "{index}");
        assert_eq!(report.decisions().join("\n").contains("bends no light into it: 1.5 instead"), said);
    }
}

#[test]
fn what_a_model_of_glass_calls_wholly_transparent_is_glass() {
    let (_, glass, _) = material("", "Kd 0.5 0.5 0.9\nd 0.0\nTr 1.0\nillum 4\nNi 1.5");
    assert_eq!((glass.glass.unwrap().ior, glass.opacity, glass.alpha), (1.5, 1.0, Alpha::Opaque));
    let (_, gone, _) = material("", "Kd 0.5 0.5 0.9\nd 0.0\nillum 2\nNi 1.5");
    assert_eq!((gone.glass, gone.opacity), (None, 0.0));
}

#[test]
fn what_a_library_says_and_no_picture_shows_is_told() {
    let said = |statements: &str| {
        let (_, _, report) = material("", statements);
        report.warnings().into_iter().chain(report.decisions()).collect::<Vec<_>>().join("\n")
    };
    assert_says(&said("Kd 1 1 1\nTf 0.5 1 1\nillum 2"), "Tf is not seen");
    assert_says(&said("Kd 1 1 1\nTr 1"), "taken for opaque");
    assert_says(&said("Kd 1 1 1\nmap_Ka red.png"), "map_Ka without map_Kd");
    assert!(!said("map_Kd red.png\nmap_Ka red.png").contains("map_Ka"));
    assert_says(&said("map_Kd -t 0.1 0.1 red.png"), "line 2: option `-t` of `map_Kd`");
    assert_says(
        &said("map_Kd red.png\nmap_d -s 2 2 red.png"),
        "material `m`: options of map_Kd count for map_d too",
    );
    let plain = said("Kd 1 1 1\nTf 1 1 1\nillum 2\nmap_Kd -s 2 2 red.png\nmap_d -s 2 2 red.png");
    assert!(!plain.contains("Tf") && !plain.contains("options"), "{plain}");
    let (world, cut, _) = material("", "map_opacity red.png");
    let texture = world.get::<Texture>(cut.base_color_texture.unwrap().texture).unwrap();
    assert_eq!(texture.texels.texels, [[255, 255, 255, 200]]);
}

#[test]
fn materials_without_a_name_have_a_number_and_usemtl_without_one_means_them() {
    let obj = format!("mtllib a.mtl\n{QUAD}usemtl\nf 1 2 3\nusemtl b\nf 1 3 4\n");
    let library = "newmtl b\nKd 0 1 0\nnewmtl\nKd 1 0 0\nKs 2 0 0\n";
    let (mut world, report) = loaded_all(&[("a.obj", obj.as_bytes()), ("a.mtl", library.as_bytes())]);
    let instance = world.query::<&Instance>().single(&world).unwrap().clone();
    let colors = instance.materials.map_to_colors(&world);
    assert_eq!(colors, [Vec3::X, Vec3::Y]);
    let said = report.warnings().join("\n");
    assert_says(&said, "line 3: `newmtl` without a name: called `(material 2)`");
    assert_says(&said, "material `(material 2)`: a value is out of range");
    // As ZBrush writes it.
    let (_, report) = loaded("a.obj", &format!("{QUAD}usemtl \nf 1 2 3 4\n"));
    assert_eq!(report.warnings(), [""; 0]);
}

trait Colors {
    fn map_to_colors(&self, world: &World) -> Vec<Vec3>;
}

impl Colors for Vec<Entity> {
    fn map_to_colors(&self, world: &World) -> Vec<Vec3> {
        self.iter().map(|&entity| world.get::<Material>(entity).unwrap().base_color).collect()
    }
}

/// A gentle slope: 8 bits have one step in 16 texels, and flat stairs between.
#[test]
fn heights_of_sixteen_bits_have_no_stairs() {
    let side = 32_u32;
    let deep: Vec<u16> = (0..side * side).map(|i| 30_000 + (i % side) as u16 * 16).collect();
    let bytes: Vec<u8> = deep.iter().flat_map(|value| value.to_ne_bytes()).collect();
    let mut file = Vec::new();
    let (mut writer, png) = (std::io::Cursor::new(&mut file), image::ImageFormat::Png);
    image::write_buffer_with_format(&mut writer, &bytes, side, side, image::ColorType::L16, png).unwrap();
    let load = |statement: &str| {
        let obj =
            format!("mtllib a.mtl\n{QUAD}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n");
        let library = format!("newmtl m\n{statement}\n");
        let files: [(&str, &[u8]); 3] =
            [("a.obj", obj.as_bytes()), ("a.mtl", library.as_bytes()), ("deep.png", &file)];
        loaded_all(&files)
    };
    let (mut world, report) = load("map_Bump -bm 400 -clamp on deep.png");
    assert_eq!(report.warnings(), [""; 0]);
    let map = named::<Material>(&mut world, "m").normal_map.unwrap();
    let normals = world.get::<Texture>(map.texture.texture).unwrap().texels.clone();
    let inner: Vec<u8> = (1..side - 1).map(|x| normals.texels[(5 * side + x) as usize][0]).collect();
    assert!(inner.iter().all(|&red| red == inner[0] && red < 125), "{inner:?}");
    // Elsewhere they are cut, which is told.
    let (_, report) = load("map_Kd deep.png");
    assert_says(&report.warnings().join("\n"), "16 bits a channel: kept in 8");
}
