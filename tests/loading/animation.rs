//! What moves: animations, skins and morph targets at a chosen time; scenes and variants by choice.

use super::builder::{Builder, TRIANGLE};
use super::*;
use glam::DQuat;
use penumbra::app::App;
use penumbra::scene::Playing;
use penumbra::trace::RenderSettings;

fn with(text: &str, options: &LoadOptions) -> (World, LoadReport) {
    let (world, report) = Folder::new(&[("a.gltf", text.as_bytes())]).load_with("a.gltf", options);
    (world, report.unwrap_or_else(|error| panic!("{error}")))
}

fn at(time: f64) -> LoadOptions {
    LoadOptions { time: Some(time), ..LoadOptions::default() }
}

/// Two triangles; one moves, and both of two more animations turn or move them.
fn moving() -> String {
    let mut file = Builder::default();
    let positions = file.floats("VEC3", &TRIANGLE);
    let times = file.floats("SCALAR", &[0.0, 2.0]);
    let moves = file.floats("VEC3", &[0., 0., 0., 4., 0., 0.]);
    let back = file.floats("VEC3", &[0., 0., 0., -4., 0., 0.]);
    let turns = file.floats("VEC4", &[0., 0., 0., 1., 0., 1., 0., 0.]);
    let sampler = |output| format!(r#""samplers":[{{"input":{times},"output":{output}}}]"#);
    let channel =
        |node, path| format!(r#""channels":[{{"sampler":0,"target":{{"node":{node},"path":"{path}"}}}}]"#);
    file.finish(&format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}}}}]}}],
        "nodes":[{{"name":"one","mesh":0,"translation":[0,7,0],"scale":[2,2,2]}},{{"name":"two","mesh":0}}],"scenes":[{{"nodes":[0,1]}}],
        "animations":[{{"name":"go",{},{}}},{{"name":"back",{},{}}},{{"name":"turn",{},{}}}]"#,
        sampler(moves),
        channel(0, "translation"),
        sampler(back),
        channel(0, "translation"),
        sampler(turns),
        channel(1, "rotation"),
    ))
}

fn place(world: &mut World, name: &str) -> DAffine3 {
    named::<GlobalTransform>(world, name).0
}

#[test]
fn without_a_time_everything_rests_and_the_report_says_so() {
    let (mut world, report) = with(&moving(), &LoadOptions::default());
    assert_eq!(place(&mut world, "one").translation, DVec3::Y * 7.0);
    assert_says(&report.decisions().join("\n"), "rest pose (--time");
    let names: Vec<&str> = report.animations.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["go", "back", "turn"]);
}

#[test]
fn at_a_time_the_first_animation_and_those_of_other_things_play() {
    let (mut world, report) = with(&moving(), &at(0.5));
    let a = place(&mut world, "one");
    assert_eq!(a.translation, DVec3::X);
    assert!((a.matrix3.x_axis - DVec3::X * 2.0).length() < 1e-12, "its scale stays");
    // An eighth of a half turn about y... a quarter of π.
    let b = place(&mut world, "two").transform_vector3(DVec3::X);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!((b - DVec3::new(half, 0.0, -half)).length() < 1e-6, "{b}");
    assert_says(&report.decisions().join("\n"), "0.5 s of go, turn");
    // Over and over: 2.5 s is 0.5 s of the second round.
    assert_eq!(place(&mut with(&moving(), &at(2.5)).0, "one"), a);
}

#[test]
fn an_animation_is_chosen_by_name_or_number() {
    for wanted in ["back", "1"] {
        let options = LoadOptions { animation: Some(wanted.to_owned()), ..at(1.0) };
        let (mut world, _) = with(&moving(), &options);
        assert_eq!(place(&mut world, "one").translation, DVec3::X * -2.0);
        assert_eq!(place(&mut world, "two"), DAffine3::IDENTITY);
    }
    let options = LoadOptions { animation: Some("jump".to_owned()), ..at(1.0) };
    let (_, refused) = Folder::new(&[("a.gltf", moving().as_bytes())]).load_with("a.gltf", &options);
    assert_says(
        &refused.unwrap_err().to_string(),
        "a.gltf: no animation \"jump\"; it has 0 \"go\", 1 \"back\"",
    );
}

#[test]
fn all_files_of_a_scene_play() {
    let scene = "[[model]]\nfile = 'a.gltf'\n[[model]]\nfile = 'b.gltf'\n";
    let other = moving().replace("\"one\"", "\"three\"");
    let folder = Folder::new(&[
        ("s.toml", scene.as_bytes()),
        ("a.gltf", moving().as_bytes()),
        ("b.gltf", other.as_bytes()),
    ]);
    let (mut world, report) = folder.load_with("s.toml", &at(1.0));
    report.unwrap();
    for name in ["one", "three"] {
        assert_eq!(place(&mut world, name).translation, DVec3::X * 2.0, "{name}");
    }
    assert_eq!(world.resource::<Playing>().animations.len(), 4);
}

#[test]
fn one_file_of_several_may_have_the_animation_and_edits_are_made_in_its_pose() {
    let scene = "[[model]]\nfile = 'a.gltf'\n[[model]]\nfile = 'b.obj'\n";
    let gltf = moving();
    let files: [(&str, &[u8]); 3] = [
        ("s.toml", scene.as_bytes()),
        ("a.gltf", gltf.as_bytes()),
        ("b.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    ];
    let folder = Folder::new(&files);
    let back = |animation: &str| LoadOptions { animation: Some(animation.to_owned()), ..at(1.0) };
    let (mut world, report) = folder.load_with("s.toml", &back("back"));
    report.unwrap();
    assert_eq!(place(&mut world, "one").translation, DVec3::X * -2.0);
    let (_, refused) = folder.load_with("s.toml", &back("jump"));
    assert_says(&refused.unwrap_err().to_string(), "no animation \"jump\"; it has 0 \"go\"");
    // What is moved by hand stays there, at whatever time.
    let (mut world, _) = with(&moving(), &at(1.0));
    let mut query = world.query::<(Entity, &Name)>();
    let one = query.iter(&world).find(|(_, name)| name.as_str() == "one").unwrap().0;
    let path = penumbra::scene::path::path_of(&world, one);
    let edit = format!(
        "[[edit]]\nentity = {path:?}\nmatrix = [[1, 0, 0, 0], [0, 1, 0, 9], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
    );
    let options = LoadOptions { edits: Some(edit), ..at(1.0) };
    let (mut world, report) = with(&moving(), &options);
    assert_eq!(report.warnings(), Vec::<String>::new());
    assert_eq!(place(&mut world, "one").translation, DVec3::Y * 9.0);
}

/// A channel moves its own part of a placement and leaves the others as the node has them, mirrored or of no size.
#[test]
fn what_is_not_animated_stays_as_the_node_has_it() {
    let signs = [-1.0, 1.0];
    let mirrored =
        signs.into_iter().flat_map(|x| signs.into_iter().flat_map(move |y| signs.map(|z| [x, y, z])));
    for [x, y, z] in mirrored.chain([[0.0; 3], [1.0, 0.0, 1.0]]) {
        for (path, values) in [
            ("scale", format!("[{x},{y},{z}]")),
            ("rotation", "[0,0.6,0,0.8]".to_owned()),
            ("translation", "[1,2,3]".to_owned()),
        ] {
            // Its keys say what the node says: at any time it stands as at rest. What has no size becomes a whole.
            let mut file = Builder::default();
            let positions = file.floats("VEC3", &TRIANGLE);
            let times = file.floats("SCALAR", &[0.0, 2.0]);
            let grown = if x * y * z == 0.0 && path == "scale" { "[1,1,1]".to_owned() } else { values };
            let numbers: Vec<f32> =
                grown.trim_matches(['[', ']']).split(',').map(|n| n.parse().unwrap()).collect();
            let kind = if numbers.len() == 4 { "VEC4" } else { "VEC3" };
            let keys = file.floats(kind, &[numbers.as_slice(), &numbers].concat());
            let text = file.finish(&format!(
                r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}}}}]}}],
                "nodes":[{{"name":"thing","mesh":0,"translation":[1,2,3],"rotation":[0,0.6,0,0.8],"scale":[{x},{y},{z}]}}],
                "scenes":[{{"nodes":[0]}}],"animations":[{{"samplers":[{{"input":{times},"output":{keys}}}],
                "channels":[{{"sampler":0,"target":{{"node":0,"path":"{path}"}}}}]}}]"#
            ));
            let (mut world, report) = with(&text, &at(1.0));
            let scale = if x * y * z == 0.0 && path == "scale" { DVec3::ONE } else { DVec3::new(x, y, z) };
            let turn = DQuat::from_xyzw(0.0, 0.6, 0.0, 0.8);
            let wanted = DAffine3::from_scale_rotation_translation(scale, turn, DVec3::new(1.0, 2.0, 3.0));
            let placed = place(&mut world, "thing");
            assert!(placed.abs_diff_eq(wanted, 1e-6), "{path} of {x}, {y}, {z}: {placed:?}");
            assert_eq!(report.warnings(), [""; 0]);
        }
    }
}

#[test]
fn a_frame_follows_the_clock() {
    let mut app = App::new(RenderSettings::default());
    let folder = Folder::new(&[("a.gltf", moving().as_bytes())]);
    let source = SceneSource::File(folder.0.join("a.gltf"));
    load(&mut app.world, &source, &at(0.0)).unwrap();
    app.build();
    app.world.resource_mut::<Playing>().time = Some(1.0);
    app.build();
    assert_eq!(place(&mut app.world, "one").translation, DVec3::X * 2.0);
}

/// A triangle whose second corner hangs on a joint that rises, and whose third is moved by a morph target.
fn bending(joints: &str, node: &str, second_set: bool) -> String {
    let mut file = Builder::default();
    let positions = file.floats("VEC3", &TRIANGLE);
    let target = file.floats("VEC3", &[0., 0., 0., 0., 0., 0., 0., 0., 3.]);
    let carried = [[0, 9, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]];
    let all = [[255, 0, 0, 0]; 3];
    let (indices, weights) = (file.bytes4(&carried, false), file.bytes4(&all, true));
    let more = if second_set { r#","JOINTS_1":2,"WEIGHTS_1":3"# } else { "" };
    let times = file.floats("SCALAR", &[0.0, 1.0]);
    let rise = file.floats("VEC3", &[0., 0., 0., 0., 8., 0.]);
    let grow = file.floats("SCALAR", &[0.0, 1.0]);
    file.finish(&format!(
        r#""meshes":[{{"weights":[0.25],"primitives":[{{"attributes":{{"POSITION":{positions},"JOINTS_0":{indices},"WEIGHTS_0":{weights}{more}}},"targets":[{{"POSITION":{target}}}]}}]}}],
        "nodes":[{{"mesh":0{node}}},{{"name":"j0"}},{{"name":"j1","translation":[0,2,0]}}],"scenes":[{{"nodes":[0,1,2]}}]{joints},
        "animations":[{{"samplers":[{{"input":{times},"output":{rise}}},{{"input":{times},"output":{grow}}}],
          "channels":[{{"sampler":0,"target":{{"node":2,"path":"translation"}}}},{{"sampler":1,"target":{{"node":0,"path":"weights"}}}}]}}]"#
    ))
}

const SKIN: &str = r#","skins":[{"joints":[1,2]}]"#;

#[test]
fn joints_and_morph_targets_shape_a_mesh_at_rest_and_at_a_time() {
    let text = bending(SKIN, r#","skin":0,"translation":[100,0,0]"#, false);
    let (mut world, _) = with(&text, &LoadOptions::default());
    let expected = [Vec3::ZERO, Vec3::new(1., 2., 0.), Vec3::new(0., 1., 0.75)];
    assert_eq!(only_mesh(&mut world).positions, expected);
    let (mut world, _) = with(&text, &at(0.5));
    let expected = [Vec3::ZERO, Vec3::new(1., 4., 0.), Vec3::new(0., 1., 1.5)];
    assert_eq!(only_mesh(&mut world).positions, expected);
    // A second set of the same four changes nothing.
    let (mut world, _) = with(&bending(SKIN, r#","skin":0"#, true), &at(0.5));
    assert_eq!(only_mesh(&mut world).positions, expected);
}

/// Its own node places no skinned mesh, but says which side of its triangles is their front (glTF 2.0, 3.7.4).
#[test]
fn a_mirrored_node_turns_the_front_of_its_skinned_mesh() {
    for (scale, mirrors) in [("[1,1,1]", false), ("[-1,1,1]", true), ("[2,-1,-1]", false)] {
        let text = bending(SKIN, &format!(r#","skin":0,"scale":{scale}"#), false);
        let (mut world, _) = with(&text, &LoadOptions::default());
        let placed = world.query_filtered::<&GlobalTransform, With<Instance>>().single(&world).unwrap().0;
        assert_eq!(placed.matrix3.determinant() < 0.0, mirrors, "{scale}");
        // Where it stands is all the same.
        let at = |corner: Vec3| placed.transform_point3(corner.as_dvec3()).as_vec3();
        let corners: Vec<Vec3> = only_mesh(&mut world).positions.into_iter().map(at).collect();
        assert_eq!(corners, [Vec3::ZERO, Vec3::new(1., 2., 0.), Vec3::new(0., 1., 0.75)]);
    }
}

/// Single precision would have squashed it.
#[test]
fn a_skinned_mesh_far_from_zero_keeps_its_shape() {
    let near = bending(SKIN, r#","skin":0"#, false);
    let far = near
        .replace(r#"{"name":"j0"}"#, r#"{"name":"j0","translation":[6400000.125,0,0]}"#)
        .replace(r#""translation":[0,2,0]"#, r#""translation":[6400000.125,2,0]"#);
    let (mut world, _) = with(&far, &LoadOptions::default());
    let placed = world.query_filtered::<&GlobalTransform, With<Instance>>().single(&world).unwrap().0;
    let corners = only_mesh(&mut world).positions;
    let expected = [Vec3::ZERO, Vec3::new(1., 2., 0.), Vec3::new(0., 1., 0.75)];
    for (corner, expected) in corners.into_iter().zip(expected) {
        let place = placed.transform_point3(corner.as_dvec3()) - DVec3::X * 6_400_000.125;
        assert!((place - expected.as_dvec3()).length() < 1e-6, "{place} for {expected}");
    }
}

#[test]
fn a_nodes_own_morph_weights_come_before_the_meshs() {
    let (mut world, _) = with(&bending("", r#","weights":[0.5]"#, false), &LoadOptions::default());
    assert_eq!(only_mesh(&mut world).positions[2], Vec3::new(0., 1., 1.5));
}

#[test]
fn two_nodes_may_wear_one_mesh_in_two_shapes() {
    let text = bending("", r#","weights":[0.5]"#, false)
        .replace(r#"{"name":"j0"}"#, r#"{"name":"j0","mesh":0,"weights":[0]}"#);
    let (mut world, report) = with(&text, &LoadOptions::default());
    let mut heights: Vec<f32> = world.query::<&Mesh>().iter(&world).map(|m| m.0.positions[2].z).collect();
    heights.sort_by(f32::total_cmp);
    assert_eq!((heights, report.triangles), (vec![0.0, 1.5], 2));
}

#[test]
fn a_damaged_animation_costs_only_itself() {
    let text = moving().replace(r#""path":"translation""#, r#""path":"pointer""#);
    let (mut world, report) = with(&text, &at(1.0));
    assert_eq!(place(&mut world, "one").translation, DVec3::Y * 7.0);
    assert_says(&report.warnings().join("\n"), "`pointer` are not supported: 2");
    let text = moving().replacen(r#""target":{"node":0,"#, r#""target":{"#, 1);
    assert_eq!(with(&text, &at(1.0)).1.animations.len(), 3);
    let text = moving().replacen(r#""input":1"#, r#""input":77"#, 1);
    assert_says(&with(&text, &at(1.0)).1.warnings().join("\n"), "damaged channel");
    // What is of another type altogether: an interpolation, a node, a path, an animation, all of them.
    let sampler = moving().replacen(r#""output":2}"#, r#""output":2,"interpolation":0}"#, 1);
    let lost = moving().replacen(r#""target":{"node":0,"#, r#""target":{"node":-1,"#, 1);
    let aimless = moving().replacen(r#""path":"translation""#, r#""path":{}"#, 1);
    let odd = moving().replacen(r#""animations":["#, r#""animations":["go","#, 1);
    for text in [sampler, lost, aimless, odd] {
        let (mut world, report) = with(&text, &at(1.0));
        assert_says(&report.warnings().join("\n"), "not as the format says");
        assert_eq!(report.warnings().len(), 1, "{:?}", report.warnings());
        // The third turns all the same.
        assert!(place(&mut world, "two") != DAffine3::IDENTITY, "{text}");
    }
    let none = moving().replace(r#""animations":["#, r#""animations":7,"extras":["#);
    assert_says(
        &with(&none, &LoadOptions::default()).1.warnings().join("\n"),
        "animations: not as the format says",
    );
}

#[test]
fn numbers_of_samplers_and_nodes_may_be_written_with_a_point() {
    let text = moving().replace(r#""sampler":0"#, r#""sampler":0.0"#).replace(r#""node":0"#, r#""node":0.0"#);
    let (mut world, report) = with(&text, &at(1.0));
    assert_eq!(report.warnings(), Vec::<String>::new());
    assert_eq!(place(&mut world, "one").translation, DVec3::X * 2.0);
}

#[test]
fn a_scene_is_chosen_by_name_or_number_and_the_choice_is_told() {
    let text = gltf_triangle("", "", "")
        .replace(r#""nodes":[{"mesh":0}],"#, r#""nodes":[{"mesh":0},{"mesh":0},{"mesh":0}],"#)
        .replace(r#"[{"nodes":[0]}]"#, r#"[{"nodes":[0]},{"name":"two","nodes":[1,2]}]"#);
    let (_, report) = with(&text, &LoadOptions::default());
    assert_eq!(report.triangles, 1);
    assert_says(&report.decisions().join("\n"), "scene 0 of 2 (--gltf-scene: scene 0, two)");
    for wanted in ["two", "1"] {
        let options = LoadOptions { scene: Some(wanted.to_owned()), ..LoadOptions::default() };
        assert_eq!(with(&text, &options).1.triangles, 2);
    }
}

#[test]
fn a_variant_changes_materials() {
    let primitive = r#","material":0,"extensions":{"KHR_materials_variants":{"mappings":[{"material":1,"variants":[1,2]}]}}"#;
    let more = r#","materials":[{"name":"plain"},{"name":"gold"}],"extensions":{"KHR_materials_variants":{"variants":[{"name":"day"},{"name":"noon"},{"name":"night"}]}}"#;
    let text = gltf_triangle("", primitive, more);
    let worn = |variant: Option<&str>| {
        let options = LoadOptions { variant: variant.map(str::to_owned), ..LoadOptions::default() };
        let (mut world, report) = with(&text, &options);
        let instance = world.query::<&Instance>().single(&world).unwrap().clone();
        (world.get::<Name>(instance.materials[0]).unwrap().to_string(), report.decisions().join("\n"))
    };
    assert_eq!(worn(None).0, "plain");
    assert_says(&worn(None).1, "its default materials (--variant: day, noon, night)");
    assert_eq!([worn(Some("day")).0, worn(Some("night")).0, worn(Some("1")).0], ["plain", "gold", "gold"]);
}
