//! Each keyword of OBJ and MTL as it is found in the wild.

use super::*;

/// A quad with `more` after it.
fn quad(more: &str) -> (World, LoadReport) {
    loaded("a.obj", &format!("{QUAD}{more}"))
}

/// The material `m` of a library that defines it with these statements.
fn material(statements: &str) -> (Material, LoadReport) {
    let obj = format!("mtllib a.mtl\n{QUAD}usemtl m\nf 1 2 3 4\n");
    let (mut world, report) =
        loaded_all(&[("a.obj", obj.as_bytes()), ("a.mtl", format!("newmtl m\n{statements}\n").as_bytes())]);
    (named::<Material>(&mut world, "m"), report)
}

#[test]
fn all_four_forms_of_corners_name_the_same_triangle() {
    let lists = "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n";
    for face in [
        "f 1 2 3",
        "f 1/1 2/2 3/3",
        "f 1//1 2//1 3//1",
        "f 1/1/1 2/2/1 3/3/1",
        "f -4/-3/-1 -3/-2/-1 -2/-1/-1",
    ] {
        let (mut world, report) = quad(&format!("{lists}{face}\n"));
        let mesh = only_mesh(&mut world);
        assert_eq!((report.triangles, mesh.positions[1]), (1, Vec3::X), "{face}");
        if face.contains("//") || face.matches('/').count() > 3 {
            assert_eq!(mesh.normals, [Vec3::Z; 3], "{face}");
        }
        assert!(report.warnings().is_empty(), "{face}: {:?}", report.warnings());
    }
}

#[test]
fn lines_points_and_free_forms_are_left_out_with_their_count() {
    let (_, report) = quad("f 1 2 3\np 1\nl 1 2\nl 2 3 4\ncurv 0 1 1 2\nend\nwhatever 3\nf 1 2\n");
    let said = report.warnings().join("\n");
    for line in [
        "faces with fewer than three corners (line 12)",
        "points (`p`) have no surface (line 6)",
        "lines (`l`) have no surface: 2 (line 7)",
        "statements of free-form curves and surfaces are not supported: 2 (line 9)",
        "unknown statement `whatever` (line 11)",
    ] {
        let (what, place) = line.split_once(" (line").unwrap();
        assert!(
            said.contains(what) && said.contains(&format!("line{}", place.trim_end_matches(')'))),
            "{line} in {said}"
        );
    }
}

#[test]
fn groups_objects_and_display_attributes_change_nothing() {
    let (_, report) = quad("o a\ng b c\ns off\nf 1 2 3\ns 1\ng\nf 1 3 4\n");
    assert_eq!((report.triangles, report.warnings().len()), (2, 0));
    assert_says(&quad("f 1 2 3\nlod 3\n").1.warnings().join("\n"), "display attributes");
}

#[test]
fn weights_and_third_coordinates_are_no_colours_and_no_harm() {
    let (mut world, report) =
        loaded("a.obj", "v 0 0 0 1.0\nv 1 0 0 1.0\nv 0 1 0 1.0\nvt 0.5 0.25 0\nf 1/1 2/1 3/1\n");
    let mesh = only_mesh(&mut world);
    assert_eq!((mesh.colors.len(), mesh.uvs[0], report.warnings().len()), (0, Vec2::new(0.5, 0.75), 0));
}

#[test]
fn vertex_colours_above_one_are_bytes() {
    let (mut world, report) = loaded("a.obj", "v 0 0 0 255 0 0\nv 1 0 0 0 128 0\nv 0 1 0 0 0 64\nf 1 2 3\n");
    let mesh = only_mesh(&mut world);
    assert_eq!(mesh.colors[0].truncate(), Vec3::X);
    // sRGB, as all colours of other programs.
    assert!((mesh.colors[1].y - 0.215_86).abs() < 1e-4);
    assert_says(&report.decisions().join("\n"), "vertex colours go beyond 1: read as 0 to 255");
}

#[test]
fn several_libraries_and_names_with_spaces_are_found() {
    let obj = format!(
        "mtllib a.mtl b.mtl\nmtllib my lib.mtl\n{QUAD}usemtl one\nf 1 2 3\nusemtl two\nf 1 3 4\nusemtl three\nf 2 3 4\n"
    );
    let (mut world, report) = loaded_all(&[
        ("a.obj", obj.as_bytes()),
        ("a.mtl", b"newmtl one\nKd 1 0 0\n"),
        ("b.mtl", b"newmtl two\nKd 0 1 0\n"),
        ("my lib.mtl", b"newmtl three\nKd 0 0 1\n"),
    ]);
    assert!(report.warnings().is_empty(), "{:?}", report.warnings());
    let colors = ["one", "two", "three"].map(|name| named::<Material>(&mut world, name).base_color);
    assert_eq!(colors, [Vec3::X, Vec3::Y, Vec3::Z]);
}

#[test]
fn several_names_with_spaces_in_one_statement_are_told_apart() {
    let obj = format!("mtllib my  a.mtl d.txt my b.mtl no such.mtl my\\ c.mtl\n{QUAD}f 1 2 3\n");
    let (mut world, report) = loaded_all(&[
        ("a.obj", obj.as_bytes()),
        ("my a.mtl", b"newmtl one\nKd 1 0 0\n"),
        ("my b.mtl", b"newmtl two\nKd 0 1 0\n"),
        ("my c.mtl", b"newmtl three\nKd 0 0 1\n"),
        ("d.txt", b"newmtl four\nKd 1 1 0\n"),
    ]);
    let warnings = report.warnings();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert_says(&warnings[0], "`no such.mtl`");
    let names = ["one", "two", "three", "four"];
    let colors = names.map(|name| named::<Material>(&mut world, name).base_color);
    assert_eq!(colors, [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(1.0, 1.0, 0.0)]);
}

#[test]
fn a_statement_of_a_million_names_is_no_work() {
    let obj = format!("mtllib {}\n{QUAD}f 1 2 3\n", "a b.mtl c ".repeat(300_000));
    let started = std::time::Instant::now();
    let (_, report) = loaded_all(&[("a.obj", obj.as_bytes())]);
    assert!(started.elapsed().as_secs() < 10);
    let warnings = report.warnings().join("\n");
    assert_says(&warnings, "`a b.mtl`");
    assert_says(&warnings, "material libraries after the first 1024");
    // The same again and again is one.
    let obj = format!("mtllib a.mtl\n{QUAD}f 1 2 3\n").repeat(1000);
    let (_, report) = loaded_all(&[("a.obj", obj.as_bytes()), ("a.mtl", b"newmtl m\n")]);
    assert_eq!(report.warnings(), [""; 0]);
    // Each another name.
    let names: String = (0..300_000).map(|i| format!("{i}.mtl ")).collect();
    let (_, report) = loaded_all(&[("a.obj", format!("mtllib {names}\n{QUAD}f 1 2 3\n").as_bytes())]);
    assert!(started.elapsed().as_secs() < 20);
    assert!(report.warnings().len() <= 1025, "{}", report.warnings().len());
}

#[test]
fn pictures_of_a_library_in_a_folder_of_its_own_are_found_there() {
    let obj = format!("mtllib looks\\\\a.mtl\n{QUAD}usemtl m\nf 1 2 3\n");
    let mtl = b"newmtl m\nmap_Kd -s 2 2 1 .\\images\\red.png\nmap_Ke -clamp on ../Glow.png\n\
        map_Ks C:\\old\\blue.png\nmap_d whole.png\nKs 1 1 1\nNs 5\n";
    let (mut world, report) = loaded_all(&[
        ("a.obj", obj.as_bytes()),
        ("looks/a.mtl", mtl),
        ("looks/images/red.png", &png([200, 0, 0, 255])),
        ("looks/blue.png", &png([0, 0, 200, 255])),
        ("images/red.png", &png([1, 1, 1, 255])),
        ("glow.png", &png([9, 9, 9, 255])),
        ("whole.png", &png([255; 4])),
    ]);
    let warnings = report.warnings().join("\n");
    assert!(!warnings.contains("no such file"), "{warnings}");
    let material = named::<Material>(&mut world, "m");
    let texel = |texture: penumbra::scene::TextureUse| {
        world.get::<Texture>(texture.texture).unwrap().texels.texels[0]
    };
    assert_eq!(texel(material.base_color_texture.unwrap())[..3], [200, 0, 0]);
    assert_eq!(material.emission, Vec3::ONE, "a map alone is the value itself");
    assert_eq!(texel(material.emission_texture.unwrap())[..3], [9, 9, 9]);
    let Glossy::BlinnPhong { texture, .. } = material.glossy else { panic!("not glossy") };
    assert_eq!(texel(texture.unwrap())[..3], [0, 0, 200]);
}

#[test]
fn names_in_an_old_encoding_still_meet() {
    // Latin-1: the file is called Bäume.mtl on disk in UTF-8.
    let obj = [b"mtllib B\xe4ume.mtl\nusemtl gr\xfcn\n".as_slice(), QUAD.as_bytes(), b"f 1 2 3\n"].concat();
    let (mut world, report) = loaded_all(&[("a.obj", &obj), ("Bäume.mtl", b"newmtl gr\xfcn\nKd 0 1 0\n")]);
    assert!(report.warnings().is_empty(), "{:?}", report.warnings());
    assert_eq!(named::<Material>(&mut world, "grün").base_color, Vec3::Y);
}

#[test]
fn paths_of_another_machine_and_another_case_are_found() {
    let obj = format!("mtllib C:\\Users\\me\\Scene.MTL\nusemtl m\n{QUAD}f 1 2 3\n");
    let (mut world, report) = loaded_all(&[
        ("a.obj", obj.as_bytes()),
        ("scene.mtl", b"newmtl m\nmap_Kd ..\\Textures\\Wood.PNG\n"),
        ("wood.png", &png([1, 2, 3, 255])),
    ]);
    assert!(report.warnings().is_empty(), "{:?}", report.warnings());
    assert_eq!(world.query::<&Texture>().single(&world).unwrap().texels.texels, [[1, 2, 3, 255]]);
}

#[test]
fn dissolve_and_transparency_are_each_others_opposite() {
    assert_eq!(material("d 0.25").0.opacity, 0.25);
    assert_eq!(material("Tr 0.25").0.opacity, 0.75);
    assert_eq!(material("d 0.25\nTr 0.9").0.opacity, 0.25, "d comes first");
    assert_eq!(material("d 1\nTr 1").0.opacity, 1.0);
}

#[test]
fn colours_may_be_grey_and_numbers_of_any_spelling() {
    assert_eq!(material("Kd 0.5").0.base_color, Vec3::splat(0.5));
    assert_eq!(material("Kd +.5 5e-1 0.5e0").0.base_color, Vec3::splat(0.5));
    assert_eq!(material("\tKd   1   0\t0  ").0.base_color, Vec3::X);
    let (_, report) = material("Kd spectral file.rfl\nKs xyz 1 1 1");
    assert_says(&report.warnings().join("\n"), "`Kd`");
}

#[test]
fn what_a_library_says_in_vain_is_told_with_its_line() {
    let (_, report) = material("sharpness 60\nmap_aat on\nKd 0 0 0\nxyzzy 1");
    let said = report.warnings().join("\n");
    for word in ["`sharpness`", "`map_aat`", "`xyzzy`", "line 2"] {
        assert!(said.contains(word), "{word} in {said}");
    }
}

#[test]
fn of_the_same_name_twice_the_last_counts_and_it_is_told() {
    let (m, report) = material("Kd 1 0 0\nnewmtl m\nKd 0 1 0");
    assert_eq!(m.base_color, Vec3::Y);
    assert_says(&report.warnings().join("\n"), "defined twice");
}
