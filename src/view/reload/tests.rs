//! What stays when the scene is loaded again.

use super::super::controls::{Notice, Notices};
use super::super::input::Press;
use super::super::keymap::{Side, Tap};
use super::super::prepare::prepare;
use super::super::recipe::recipe;
use super::*;
use crate::bvh::Isa;
use crate::cli::{Cli, Command};
use crate::farm::Identity;
use crate::image::ToneMap;
use crate::load::bounds_now;
use crate::open::{LoadCard, Pose};
use crate::scene::{Filter, SceneBounds};
use crate::trace::Integrator;
use bevy_ecs::name::Name;
use clap::Parser;
use glam::{DVec3, UVec2};
use std::sync::Arc;

/// A grey floor and a lamp, in a folder that is gone when the test is over.
struct Stage(PathBuf);

impl Stage {
    fn new(test: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("penumbra-reload-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let stage = Self(folder);
        stage.write("floor.obj", "v -3 0 -3\nv 3 0 -3\nv 3 0 3\nv -3 0 3\nf 1 4 3 2\n");
        stage.write("scene.toml", &Self::scene("floor.obj", 9));
        stage
    }

    fn scene(model: &str, intensity: u32) -> String {
        format!(
            "[[model]]\nfile = '{model}'\n[[light]]\nkind = 'point'\nposition = [0, 3, 1]\n\
             intensity = [{intensity}, 9, 9]\n[camera]\nposition = [0, 2, 6]\ntarget = [0, 0, 0]\n"
        )
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.0.join(name), text).unwrap();
    }

    fn open(&self, name: &str, wishes: Wishes, options: &LoadOptions) -> App {
        let wishes = Wishes { size: Some(UVec2::new(32, 24)), ..wishes };
        ready(open(&SceneSource::File(self.0.join(name)), options, &wishes).unwrap().app)
    }

    fn scene_shown(&self) -> App {
        self.open("scene.toml", Wishes::default(), &LoadOptions::default())
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn ready(mut app: App) -> App {
    prepare(&mut app, &Arc::default());
    app.world.init_resource::<Instrument>();
    app.frame();
    app
}

fn again(app: &mut App) -> App {
    ready(load_again(app, Watcher::default()).unwrap())
}

fn press(app: &mut App, taps: &[Tap]) {
    for &tap in taps {
        app.world.resource_mut::<Input>().taps.push(Press::from(tap));
        app.frame();
        app.world.resource_mut::<Input>().end_frame();
    }
}

fn identity(app: &App) -> Identity {
    Identity::of(&app.world, String::new())
}

fn edits(app: &App) -> Option<String> {
    let arguments = recipe(&app.world).arguments;
    let at = arguments.iter().position(|argument| argument == "--edits")?;
    arguments.get(at + 1).cloned()
}

fn last_notice(app: &App) -> Notice {
    app.world.resource::<Notices>().0.last().cloned().unwrap()
}

/// The floor is selected, moved and copied.
const EDIT: [Tap; 4] = [Tap::Select, Tap::More, Tap::Duplicate, Tap::More];

/// Removes the file of edits that a printed command names.
fn discard_saved(line: &str) {
    let mut words = line.split_whitespace().skip_while(|word| *word != "--scene-settings");
    std::fs::remove_file(words.nth(1).unwrap()).unwrap();
}

#[test]
fn edits_are_known_after_any_number_of_reloads_and_undone_to_what_the_files_say() {
    let stage = Stage::new("edits");
    let mut app = stage.scene_shown();
    press(&mut app, &EDIT);
    let edited = identity(&app);
    let text = edits(&app).unwrap();
    let mut app = again(&mut again(&mut app));
    assert_eq!(identity(&app), edited);
    assert_eq!(edits(&app), Some(text.clone()));
    // The copy is still selected.
    press(&mut app, &[Tap::More]);
    assert_ne!(identity(&app), edited);
    stage.write("scene.toml", &Stage::scene("floor.obj", 5));
    let fresh = identity(&stage.scene_shown());
    let mut app = again(&mut app);
    press(&mut app, &[Tap::SaveEdits]);
    let Notice::Saved(_, line) = last_notice(&app) else { panic!("{:?}", last_notice(&app)) };
    discard_saved(&line);
    press(&mut app, &[Tap::Undo; 4]);
    assert_eq!(last_notice(&app), Notice::Text("nothing to undo".to_owned()));
    assert_eq!(identity(&app).differences(&fresh), Vec::<String>::new());
}

#[test]
fn a_copy_that_was_carried_over_is_undone_in_one_step() {
    let stage = Stage::new("carried");
    let mut app = stage.scene_shown();
    let fresh = identity(&app);
    press(&mut app, &EDIT[..1]);
    press(&mut app, &EDIT[2..]);
    let mut app = again(&mut app);
    assert_ne!(identity(&app).differences(&fresh), Vec::<String>::new());
    // It does not lie on its original first.
    press(&mut app, &[Tap::Undo]);
    assert_eq!(identity(&app).differences(&fresh), Vec::<String>::new());
    press(&mut app, &[Tap::Undo]);
    assert_eq!(last_notice(&app), Notice::Text("nothing to undo".to_owned()));
}

#[test]
fn edits_of_what_is_gone_wait_until_it_is_back() {
    let stage = Stage::new("waiting");
    let mut app = stage.scene_shown();
    press(&mut app, &EDIT);
    let (edited, text) = (identity(&app), edits(&app));
    stage.write("other.obj", "v -3 0 -3\nv 3 0 -3\nv 3 0 3\nf 1 3 2\n");
    stage.write("scene.toml", &Stage::scene("other.obj", 9));
    let mut app = again(&mut app);
    assert_ne!(identity(&app), edited);
    assert!(edits(&app).unwrap().contains("copy_of = [\"floor\""));
    let mut app = again(&mut app);
    stage.write("scene.toml", &Stage::scene("floor.obj", 9));
    let app = again(&mut app);
    assert_eq!((identity(&app), edits(&app)), (edited, text));
}

/// A triangle, and two cameras.
const CAMERAS: &str = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1,2]}],
    "nodes":[{"mesh":0},{"name":"near","camera":0,"translation":[0,0,4]},
    {"name":"far","camera":0,"translation":[0,0,9]}],"cameras":[{"type":"perspective",
    "perspective":{"yfov":0.7,"znear":0.1}}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
    "buffers":[{"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA",
    "byteLength":36}],"bufferViews":[{"buffer":0,"byteLength":36}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}]}"#;

#[test]
fn the_camera_in_use_stays_and_enter_finds_the_first_one() {
    let stage = Stage::new("cameras");
    stage.write("a.gltf", CAMERAS);
    let asked = || Wishes { camera: Some("far".to_owned()), isa: Some(Isa::SCALAR), ..Wishes::default() };
    let mut app = stage.open("a.gltf", asked(), &LoadOptions::default());
    let first = identity(&app).camera;
    let mut app = again(&mut app);
    assert_eq!(identity(&app).camera, first, "the one that was asked for");
    assert_eq!(app.world.resource::<Instructions>().0, Isa::SCALAR);
    press(&mut app, &[Tap::NextCamera]);
    let near = identity(&app).camera;
    assert_ne!(near, first);
    let mut app = again(&mut app);
    assert_eq!(identity(&app).camera, near, "the one that was chosen");
    press(&mut app, &[Tap::FrameAll]);
    let flown = identity(&app).camera;
    let mut app = again(&mut again(&mut app));
    assert_eq!(identity(&app).camera, flown);
    press(&mut app, &[Tap::ResetCamera]);
    assert_eq!(identity(&app).camera, first, "the window opened with it");
    press(&mut app, &[Tap::NextCamera]);
    assert_eq!(identity(&app).camera, near);
    // It is gone for a while: the file's first one instead.
    stage.write("a.gltf", &CAMERAS.replace("\"far\"", "\"other\""));
    let mut app = again(&mut app);
    assert_eq!(identity(&app).camera, near);
    press(&mut app, &[Tap::ResetCamera]);
    assert_eq!(identity(&app).camera, near);
}

#[test]
fn a_place_given_by_flags_stays() {
    let stage = Stage::new("pose");
    let pose = Pose { position: Some(DVec3::new(1.0, 3.0, 5.0)), ..Pose::default() };
    let wishes = Wishes { pose, ..Wishes::default() };
    let mut app = stage.open("scene.toml", wishes, &LoadOptions::default());
    let camera = identity(&app).camera;
    let mut app = again(&mut again(&mut app));
    assert_eq!(identity(&app).camera, camera);
    press(&mut app, &[Tap::NextCamera]);
    let app = again(&mut app);
    let active = app.world.resource::<ActiveCamera>().0;
    assert_eq!(app.world.get::<Name>(active).map(Name::as_str), Some("camera"));
}

#[test]
fn what_was_looked_for_in_vain_is_known_after_a_failure() {
    let stage = Stage::new("failure");
    let mut app = stage.scene_shown();
    stage.write("scene.toml", &Stage::scene("missing.obj", 9));
    assert!(load_again(&mut app, Watcher::default()).is_err());
    let files = app.world.resource::<SceneOrigin>().options.files.list();
    assert_eq!(files.get(&stage.0.join("missing.obj")), Some(&None));
    assert_eq!(
        files.get(&stage.0.join("scene.toml")),
        Some(&crate::load::stamp(&stage.0.join("scene.toml")))
    );
    assert!(files.contains_key(&stage.0.join("floor.obj")));
}

#[test]
fn home_shows_the_scene_as_it_has_been_edited() {
    let stage = Stage::new("home");
    let mut app = stage.scene_shown();
    let loaded = app.world.resource::<SceneBounds>().center;
    let mut home = |taps: &[Tap]| {
        press(&mut app, taps);
        press(&mut app, &[Tap::FrameAll]);
        (app.world.resource::<Navigation>().pivot, bounds_now(&mut app.world).unwrap().center)
    };
    let (edited, center) = home(&EDIT);
    assert_eq!(edited, center);
    assert_ne!(edited, loaded);
    assert_eq!(home(&[Tap::Undo; 4]), (loaded, loaded));
}

#[test]
fn the_report_says_that_a_file_cannot_be_loaded_until_it_can() {
    let stage = Stage::new("outdated");
    let mut app = stage.scene_shown();
    let card = |app: &App| app.world.resource::<LoadCard>().now().to_string();
    let before = card(&app);
    let (title, rest) = before.split_once('\n').unwrap();
    let scene = title.strip_suffix(": valid").unwrap();
    // Twice, for the second must not tell of the first.
    for missing in ["missing.obj", "gone.obj"] {
        stage.write("scene.toml", &Stage::scene(missing, 9));
        let why = load_again(&mut app, Watcher::default()).err().unwrap();
        assert_eq!(card(&app), format!("{scene}: still the old scene\n  error         {why}\n{rest}"));
    }
    stage.write("scene.toml", &Stage::scene("floor.obj", 9));
    let again = load_again(&mut app, Watcher::default()).unwrap();
    assert_eq!(card(&again).split_once('\n').unwrap().0, title);
}

#[test]
fn the_printed_command_makes_what_is_seen_with_a_dropped_sky_and_all_settings() {
    let stage = Stage::new("command");
    let sky = stage.0.join("sky.exr");
    let bytes: Vec<u8> = (0..8 * 4).flat_map(|_| [1.0_f32, 0.5, 0.2]).flat_map(f32::to_ne_bytes).collect();
    image::save_buffer(&sky, &bytes, 8, 4, image::ColorType::Rgb32F).unwrap();
    // What was edited before, and never saved.
    let mut before = stage.scene_shown();
    press(&mut before, &EDIT);
    let options = LoadOptions { edits: edits(&before), ..LoadOptions::default() };
    let mut app = stage.open("scene.toml", Wishes { seed: Some(7), ..Wishes::default() }, &options);
    let mut app = ready(set_sky(&mut app, sky, Watcher::default()).unwrap());
    press(&mut app, &[Tap::Select, Tap::NextRow, Tap::More, Tap::FrameAll, Tap::Brighter]);
    let mut settings = app.world.resource_mut::<RenderSettings>();
    settings.max_depth = 3;
    settings.integrator = Integrator::Path;
    settings.filter = Some(Filter::Nearest);
    app.world.resource_mut::<Display>().tone_map = ToneMap::AgX;
    press(&mut app, &[Tap::SaveEdits]);
    let Notice::Saved(_, line) = last_notice(&app) else { panic!("{:?}", last_notice(&app)) };
    let cli = Cli::try_parse_from(line.split_whitespace()).unwrap();
    let Some(Command::Render(render)) = cli.command else { panic!("{line}") };
    let output = render.output.clone();
    let scene = render.scene().unwrap();
    let source = scene.source().unwrap();
    let rendered = open(&source, &scene.load_options(), &scene.wishes(&output)).unwrap().app;
    discard_saved(&line);
    assert_eq!(identity(&rendered).differences(&identity(&app)), Vec::<String>::new(), "{line}");
    let shown = |app: &App| *app.world.resource::<Display>();
    assert_eq!(shown(&rendered), shown(&app));
}

#[test]
fn each_scene_has_its_bookmarks_whatever_is_opened_between() {
    let stage = Stage::new("bookmarks");
    stage.write("other.toml", &Stage::scene("floor.obj", 4));
    let mut app = stage.scene_shown();
    press(&mut app, &[Tap::FrameAll, Tap::Remember(1)]);
    let place = identity(&app).camera;
    let shown =
        |app: &App, name: &str| ready(open_other(app, &stage.0.join(name), Watcher::default()).unwrap());
    let mut other = shown(&app, "other.toml");
    press(&mut other, &[Tap::Recall(1)]);
    assert!(matches!(last_notice(&other), Notice::Text(text) if text.contains("is empty")));
    press(&mut other, &[Tap::View(Side::Top), Tap::Remember(1)]);
    let above = identity(&other).camera;
    let mut app = shown(&other, "scene.toml");
    assert_ne!(identity(&app).camera, place);
    press(&mut app, &[Tap::Recall(1)]);
    assert_eq!(identity(&app).camera, place);
    let mut other = shown(&app, "other.toml");
    press(&mut other, &[Tap::Recall(1)]);
    assert_eq!(identity(&other).camera, above);
}

#[test]
fn edits_are_saved_beside_the_scene_and_told_of_when_it_is_opened_again() {
    let stage = Stage::new("beside");
    stage.write("lone.obj", "v -3 0 -3\nv 3 0 -3\nv 3 0 3\nv -3 0 3\nf 1 4 3 2\n");
    let mut app = stage.open("lone.obj", Wishes::default(), &LoadOptions::default());
    let card = |app: &App| app.world.resource::<LoadCard>().text.to_string();
    assert!(!card(&app).contains("edits_"));
    press(&mut app, &EDIT);
    press(&mut app, &[Tap::SaveEdits, Tap::More, Tap::SaveEdits]);
    let saved = [1, 2].map(|n| stage.0.join(format!("lone.edits_{n}.toml")));
    assert!(saved.iter().all(|path| path.is_file()));
    let Notice::Saved(said, line) = last_notice(&app) else { panic!("{:?}", last_notice(&app)) };
    assert_eq!(said, "saved lone.edits_2.toml beside the scene");
    assert!(line.contains(&saved[1].display().to_string()), "{line}");
    // Nothing is applied that nobody asked for, but it is said how.
    let again = stage.open("lone.obj", Wishes::default(), &LoadOptions::default());
    assert_ne!(identity(&again), identity(&app));
    assert!(
        card(&again).contains("not applied") && card(&again).contains("lone.edits_2.toml"),
        "{}",
        card(&again)
    );
    let settings = LoadOptions { scene_settings: Some(saved[1].clone()), ..LoadOptions::default() };
    let with = stage.open("lone.obj", Wishes::default(), &settings);
    assert_eq!(identity(&with).scene_hash, identity(&app).scene_hash);
    assert!(!card(&with).contains("not applied"));
    // The file itself means the same, but not where its scene is gone.
    let opened = stage.open("lone.edits_2.toml", Wishes::default(), &LoadOptions::default());
    assert_eq!(identity(&opened), identity(&with));
    let checked = crate::load::Card::check(&saved[1], &LoadOptions::default());
    assert_ne!(checked.verdict, crate::load::Verdict::Refused, "{}", checked.text());
    // So does one of a scene that needs no file.
    let edits = "[[edit]]\nentity = [\"cornell\"]\nhidden = false\n";
    stage.write("cornell.edits_1.toml", edits);
    stage.open("cornell.edits_1.toml", Wishes::default(), &LoadOptions::default());
    std::fs::remove_file(stage.0.join("lone.obj")).unwrap();
    let source = SceneSource::File(saved[1].clone());
    let alone = open(&source, &LoadOptions::default(), &Wishes::default()).err().unwrap().to_string();
    assert!(alone.contains("no scene but what was edited in one"), "{alone}");
}
