//! Wavefront OBJ and MTL.

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
    let text = format!(
        "mtllib a.mtl\n{QUAD}usemtl red paint\nf 1 2 3\nusemtl blue\nf 1 3 4\nusemtl red paint\nf 2 3 4\n"
    );
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
    assert_says(&report.warnings().join("\n"), "would create light");
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
    assert_eq!(
        named::<Material>(&mut world, "p").glossy,
        Glossy::Ggx { metallic: 1.0, roughness: 0.3, texture: None }
    );
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
    let warnings = report.warnings().join("\n");
    assert_says(&warnings, "gone.mtl");
    assert_says(&warnings, "`x` is not defined");
}

#[test]
fn libraries_outside_the_folder_are_not_opened() {
    let (_, report) = loaded("a.obj", &format!("mtllib ../../etc/hostname\n{QUAD}f 1 2 3\n"));
    assert_says(&report.warnings().join("\n"), "outside");
}

#[test]
fn a_missing_texture_shows_a_checker_and_a_warning() {
    let text = format!("mtllib A.MTL\nusemtl m\n{QUAD}f 1 2 3\n");
    let mtl = b"newmtl m\nmap_Kd -s 2 4 1 -clamp on C:\\textures\\no such.png\n";
    let (mut world, report) = loaded_all(&[("a.obj", text.as_bytes()), ("a.mtl", mtl)]);
    assert_says(&report.warnings().join("\n"), "no such.png");
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
    assert_says(&report.warnings().join("\n"), "not finite");
}

#[test]
fn a_hub_of_many_flat_faces_is_not_quadratic() {
    use std::fmt::Write;
    let mut text = String::from("v 0 0 1\nvn 0 0 1\nf 1//1 1//1 1//1\n");
    let n = 100_000;
    for i in 0..n {
        let angle = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
        writeln!(text, "v {} {} 0", angle.cos(), angle.sin()).unwrap();
    }
    for i in 0..n - 1 {
        writeln!(text, "f 1 {} {}", i + 2, i + 3).unwrap();
    }
    let start = std::time::Instant::now();
    assert_eq!(loaded("a.obj", &text).1.triangles, n as usize);
    assert!(start.elapsed().as_secs() < 5, "{:?}", start.elapsed());
}
