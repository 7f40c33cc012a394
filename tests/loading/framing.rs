//! Camera and light where the file has none.

use super::*;

/// Whether the active camera sees a point, in a square picture.
fn sees(world: &World, point: DVec3) -> bool {
    sees_within(world, point, 1.0)
}

/// Whether the active camera sees a point, in a picture that is `aspect` times as wide as high.
fn sees_within(world: &World, point: DVec3, aspect: f64) -> bool {
    let camera = world.resource::<ActiveCamera>().0;
    let local = world.get::<GlobalTransform>(camera).unwrap().0.inverse().transform_point3(point);
    let Projection::Perspective { vertical_fov } = world.get::<Camera>(camera).unwrap().projection else {
        return false;
    };
    let reach = f64::from(vertical_fov / 2.0).tan() * -local.z;
    local.z < 0.0 && local.x.abs() <= reach * aspect && local.y.abs() <= reach
}

#[test]
fn a_file_without_camera_and_light_gets_both_and_says_so() {
    let (mut world, report) = loaded("a.obj", &format!("{QUAD}f 1 2 3 4\n"));
    let decisions = report.decisions().join("\n");
    assert_says(&decisions, "no camera in it");
    assert_says(&decisions, "no light in it");
    for corner in [[0., 0.], [1., 0.], [1., 1.], [0., 1.]] {
        assert!(sees(&world, DVec3::new(corner[0], corner[1], 0.0)));
    }
    // It faces +Z, so that is where the camera stands.
    let eye = world.get::<GlobalTransform>(world.resource::<ActiveCamera>().0).unwrap().0.translation;
    assert!(eye.z > 0.5);
    let bounds = *world.resource::<SceneBounds>();
    assert!(
        (bounds.center - DVec3::new(0.5, 0.5, 0.0)).length() < 1e-9
            && (bounds.radius - 0.5_f64.sqrt()).abs() < 1e-9
    );
    let key = named::<Light>(&mut world, "key light");
    let at = named::<GlobalTransform>(&mut world, "key light").0;
    let Light::Parallelogram { edge_u, edge_v, radiance, .. } = key else { panic!("{key:?}") };
    let normal = at.transform_vector3(edge_u.cross(edge_v).as_dvec3());
    let to_center = bounds.center - at.translation;
    assert!(normal.normalize().dot(to_center.normalize()) > 0.999, "shines elsewhere");
    let white =
        f64::from(radiance[0].x) * normal.length() / (std::f64::consts::PI * to_center.length_squared());
    assert!((white - 0.8).abs() < 1e-4, "{white}");
}

#[test]
fn far_outliers_do_not_shrink_the_scene() {
    use std::fmt::Write;
    let mut text = String::new();
    for i in 0..200 {
        let x = f64::from(i) * 0.01;
        writeln!(text, "v {x} 0 0\nv {x} 1 0\nv {} 0 1\nf -3 -2 -1", x + 0.01).unwrap();
    }
    text += "v 100000 0 0\nv 100000 0.01 0\nv 100000 0 0.01\nf -3 -2 -1\n";
    let (world, report) = loaded("a.obj", &text);
    assert!(world.resource::<SceneBounds>().radius < 3.0);
    assert_says(&report.decisions().join("\n"), "a few triangles far outside");
}

#[test]
fn an_emissive_material_is_light_enough() {
    let text = format!("mtllib a.mtl\nusemtl e\n{QUAD}f 1 2 3\n");
    let (mut world, _) = loaded_all(&[("a.obj", text.as_bytes()), ("a.mtl", b"newmtl e\nKe 1 1 1\n")]);
    assert!(lights(&mut world).is_empty());
}

#[test]
fn an_empty_scene_still_has_a_camera() {
    let (world, report) = loaded("a.obj", "# nothing\n");
    assert_eq!(report.triangles, 0);
    assert_says(&report.warnings().join("\n"), "nothing to see");
    assert!(world.get::<Camera>(world.resource::<ActiveCamera>().0).is_some());
}

#[test]
fn a_large_floor_does_not_shrink_what_stands_on_it() {
    use std::fmt::Write;
    let mut text = String::from("v -50 0 -50\nv 50 0 -50\nv 50 0 50\nv -50 0 50\nf 1 4 3 2\n");
    for i in 0..300 {
        let (x, y) = (f64::from(i % 20) * 0.05, f64::from(i / 20) * 0.05);
        writeln!(text, "v {x} {y} 0\nv {x} {} 0\nv {} {y} 0.1\nf -3 -2 -1", y + 0.05, x + 0.05).unwrap();
    }
    let (world, report) = loaded("a.obj", &text);
    let bounds = *world.resource::<SceneBounds>();
    assert!(bounds.radius < 1.5 && bounds.center.length() < 2.0, "{bounds:?}");
    assert_says(&report.decisions().join("\n"), "a few triangles far outside");
}

#[test]
fn all_is_seen_in_a_narrow_picture_too() {
    let folder = Folder::new(&[
        ("a.obj", format!("{QUAD}f 1 2 3 4\n").as_bytes()),
        ("narrow.toml", b"[render]\nresolution = [100, 400]\n"),
    ]);
    let asked = LoadOptions { resolution: Some([100, 400]), ..LoadOptions::default() };
    let settings =
        LoadOptions { scene_settings: Some(folder.0.join("narrow.toml")), ..LoadOptions::default() };
    for options in [asked, settings] {
        let (world, report) = folder.load_with("a.obj", &options);
        report.unwrap();
        for corner in [[0., 0.], [1., 0.], [1., 1.], [0., 1.]] {
            assert!(sees_within(&world, DVec3::new(corner[0], corner[1], 0.0), 0.25), "{options:?}");
        }
    }
}

#[test]
fn a_lamp_that_is_out_is_no_light() {
    let lamp = |intensity: &str| {
        let more = format!(
            r#","extensionsUsed":["KHR_lights_punctual"],"extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point","intensity":{intensity}}}]}}}}"#
        );
        let node = r#","extensions":{"KHR_lights_punctual":{"light":0}}"#;
        loaded("a.gltf", &gltf_triangle(node, "", &more)).1.decisions().join("\n")
    };
    assert_says(&lamp("0"), "no light in it");
    assert!(!lamp("1").contains("no light in it"));
}
