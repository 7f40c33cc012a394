//! TOML sidecars and scenes.

use super::*;

const FLOOR: &str = "usemtl wall\nv 0 0 0\nv 1 0 0\nv 1 0 -1\nv 0 0 -1\nf 1 2 3 4\n";

fn with_sidecar(toml: &str) -> (World, Result<LoadReport, LoadError>) {
    Folder::new(&[("a.obj", FLOOR.as_bytes()), ("a.toml", toml.as_bytes())]).load("a.obj")
}

fn sidecar_refusal(toml: &str) -> String {
    let message = with_sidecar(toml).1.expect_err("accepted").to_string();
    assert!(message.contains("a.toml") && !message.contains('\n'), "{message}");
    message
}

#[test]
fn the_sidecar_adds_lights_camera_materials_and_render_options() {
    let toml = r#"
        [material.wall]
        base_color = [0.1, 0.2, 0.3]
        specular = [0.2, 0.2, 0.2]
        exponent = 30
        [[light]]
        kind = "parallelogram"
        corner = [0, 2, 0]
        edge_u = [1, 0, 0]
        edge_v = [0, 0, 1]
        radiance = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]
        visible = false
        [[light]]
        kind = "segment"
        from = [0, 1, 0]
        to = [0, 3, 0]
        strength = [4, 4, 4]
        [camera]
        position = [0, 1, 5]
        target = [0, 1, 0]
        vertical_fov = 90
        [render]
        integrator = "direct"
        spp = 16
        resolution = [320, 200]
        filter = "nearest"
    "#;
    let (mut world, report) = with_sidecar(toml);
    let report = report.unwrap();
    assert_eq!(named::<Material>(&mut world, "wall").base_color, Vec3::new(0.1, 0.2, 0.3));
    assert_eq!(
        named::<GlobalTransform>(&mut world, "light 0 (parallelogram)").0.translation,
        DVec3::new(0.5, 2.0, 0.5)
    );
    assert_eq!(named::<Visible>(&mut world, "light 0 (parallelogram)"), Visible(false));
    let segment = named::<GlobalTransform>(&mut world, "light 1 (segment)").0;
    assert!((segment.transform_point3(DVec3::NEG_X) - DVec3::Y).length() < 1e-12, "−X is not at `from`");
    let camera = world.resource::<ActiveCamera>().0;
    assert_eq!((report.cameras.len(), report.cameras[0].1), (1, camera));
    assert!((world.get::<GlobalTransform>(camera).unwrap().0.matrix3.z_axis - DVec3::Z).length() < 1e-12);
    let render = &report.render;
    assert_eq!(
        (render.integrator, render.spp, render.resolution),
        (Some(SidecarIntegrator::Direct), Some(16), Some([320, 200]))
    );
    assert_eq!((render.filter, render.seed), (Some(SidecarFilter::Nearest), None));
    assert!(!report.decisions().join("\n").contains("no light"), "{:?}", report.decisions());
}

#[test]
fn every_kind_of_light_is_read() {
    let toml = r#"
        [[light]]
        kind = "disk"
        center = [0, 1, 0]
        normal = [0, -1, 0]
        radius = 0.5
        radiance = [1, 1, 1]
        [[light]]
        kind = "sphere"
        center = [0, 1, 0]
        radius = 0.5
        radiance = [1, 1, 1]
        [[light]]
        kind = "point"
        position = [0, 1, 0]
        intensity = [1, 1, 1]
        [[light]]
        kind = "spot"
        position = [0, 1, 0]
        target = [0, 0, 0]
        intensity = [1, 1, 1]
        outer_angle = 30
        [[light]]
        kind = "directional"
        direction = [0, -1, 0]
        irradiance = [1, 1, 1]
        angle = 0.53
        [[light]]
        kind = "environment"
        radiance = [1, 1, 1]
    "#;
    let (mut world, report) = with_sidecar(toml);
    report.unwrap();
    assert_eq!(lights(&mut world).len(), 6);
    for name in ["light 0 (disk)", "light 3 (spot)", "light 4 (directional)"] {
        let forward = -named::<GlobalTransform>(&mut world, name).0.matrix3.z_axis;
        assert!((forward - DVec3::NEG_Y).length() < 1e-12, "{name} looks along {forward}");
    }
}

#[test]
fn wrong_keys_and_values_are_named_with_their_line() {
    assert_says(&sidecar_refusal("[render]\nspp = 4\nssp = 5\n"), "line 3");
    assert_says(&sidecar_refusal("[render]\nssp = 5\n"), "unknown field `ssp`");
    assert_says(&sidecar_refusal("[render]\nspp = 0\n"), "spp must be at least 1");
    assert_says(
        &sidecar_refusal(
            "\n[[light]]\nkind = \"sphere\"\ncenter = [0,0,0]\nradius = -1\nradiance = [1,1,1]\n",
        ),
        "line 2, light 0 (sphere): radius must be above 0",
    );
    assert_says(
        &sidecar_refusal(
            "[[light]]\nkind = \"sphere\"\ncenter = [0,0,0]\nradius = 1\nradiance = [1,nan,1]\n",
        ),
        "radiance must be finite",
    );
    assert_says(
        &sidecar_refusal("[[light]]\nkind = \"sphere\"\ncentre = [0,0,0]\nradius = 1\nradiance = [1,1,1]\n"),
        "unknown field `centre`",
    );
    assert_says(&sidecar_refusal("[[light]]\nkind = \"lamp\"\n"), "unknown variant `lamp`");
    assert_says(
        &sidecar_refusal(
            "[[light]]\nkind = \"parallelogram\"\ncorner=[0,0,0]\nedge_u=[1,0,0]\nedge_v=[2,0,0]\nradiance=[1,1,1]\n",
        ),
        "no area",
    );
    assert_says(
        &sidecar_refusal(
            "[[light]]\nkind = \"parallelogram\"\ncorner=[0,0,0]\nedge_u=[1,0,0]\nedge_v=[0,1,0]\nradiance=[1,1]\n",
        ),
        "radiance must be [r, g, b] or four of them",
    );
    assert_says(
        &sidecar_refusal("[camera]\nposition=[0,0,1]\ntarget=[0,0,0]\nvertical_fov=180\n"),
        "between 0 and 180",
    );
    assert_says(
        &sidecar_refusal("[material.wall]\nbase_color=[0.9,0,0]\nmirror=[0.9,0,0]\n"),
        "create light",
    );
    assert_says(&sidecar_refusal("[material.wall]\nroughness = 2\n"), "roughness must be within 0 to 1");
    assert_says(&sidecar_refusal("[[light\n"), "line 1");
}

#[test]
fn a_settings_file_of_its_own_places_models() {
    let toml = r#"
        [[model]]
        file = "a.obj"
        material = "white"
        translation = [1, 0, 0]
        rotation = [0, 90, 0]
        scale = 2
        [[model]]
        file = "a.obj"
        matrix = [[1,0,0,5],[0,1,0,6],[0,0,1,7],[0,0,0,1]]
        [material.white]
        base_color = [0.7, 0.7, 0.7]
    "#;
    let (mut world, report) = loaded_all(&[("s.toml", toml.as_bytes()), ("a.obj", FLOOR.as_bytes())]);
    assert_eq!(report.triangles, 4);
    let mut query = world.query::<(&Instance, &GlobalTransform)>();
    let placed: Vec<DVec3> =
        query.iter(&world).map(|(_, transform)| transform.0.transform_point3(DVec3::X)).collect();
    assert!((placed[0] - DVec3::new(1.0, 0.0, -2.0)).length() < 1e-12, "{}", placed[0]);
    assert_eq!(placed[1], DVec3::new(6.0, 6.0, 7.0));
    let first = query.iter(&world).next().unwrap().0.materials[0];
    assert_eq!(world.get::<Name>(first).unwrap().as_str(), "white");
    // Beside a.obj such a file is not taken for its settings.
    let folder = Folder::new(&[("a.obj", FLOOR.as_bytes()), ("a.toml", toml.as_bytes())]);
    let (_, report) = folder.load("a.obj");
    assert_says(&report.unwrap().decisions().join("\n"), "a scene of its own");
}

#[test]
fn models_that_are_missing_or_misplaced_are_named() {
    let refuse = |toml: &str| refusal("s.toml", toml);
    assert_says(&refuse("[[model]]\nfile = \"gone.obj\"\n"), "line 1, [[model]]: `gone.obj`: no such file");
    assert_says(&refuse("[[model]]\nfile = \"s.toml\"\n"), "cannot be a model");
    // What Ctrl+E writes is no scene.
    assert_says(&refuse("[[edit]]\nentity = [\"room\"]\nhidden = true\n"), "--scene-settings");
    assert_says(
        &refuse("[[model]]\nfile = \"x.obj\"\nscale = \"big\"\n"),
        "scale must be a number or three of them",
    );
}

#[test]
fn settings_may_be_named_by_the_caller() {
    let folder = Folder::new(&[("a.obj", FLOOR.as_bytes()), ("other.toml", b"[render]\nseed = 7\n")]);
    let options = LoadOptions { scene_settings: Some(folder.0.join("other.toml")), ..LoadOptions::default() };
    assert_eq!(folder.load_with("a.obj", &options).1.unwrap().render.seed, Some(7));
    let options = LoadOptions { scene_settings: Some(folder.0.join("gone.toml")), ..LoadOptions::default() };
    assert_says(&folder.load_with("a.obj", &options).1.unwrap_err().to_string(), "gone.toml: no such file");
}
