//! Edits are saved, undone and told.

mod groups;

use super::super::input::Press;
use super::*;
use crate::app::{App, FrameBudget, FrameSystems};
use crate::farm::Identity;
use crate::load::{LoadOptions, SceneSource, bounds_now};
use crate::open::{Wishes, open};
use crate::scene::{GlobalTransform, Light, Transform};
use crate::sync::RenderOrigin;
use crate::trace::{Film, RenderSettings, Viewpoint};
use glam::UVec2;
use std::path::PathBuf;

fn opened(scene: &str, settings: Option<PathBuf>) -> App {
    let options = LoadOptions { scene_settings: settings, ..LoadOptions::default() };
    let wishes = Wishes { size: Some(UVec2::new(64, 36)), samples: Some(2), ..Wishes::default() };
    open(&SceneSource::parse(scene).unwrap(), &options, &wishes).unwrap().app
}

fn editable(scene: &str) -> App {
    let mut app = opened(scene, None);
    app.world.init_resource::<Editor>();
    app.world.init_resource::<Notices>();
    app.world.insert_resource(Input::new(Instant::now()));
    app.add_systems(edit_scene.in_set(FrameSystems::Input));
    app.add_systems(start_sync.in_set(FrameSystems::Sync).before(crate::sync::build_blas));
    app.add_systems(finish_sync.in_set(FrameSystems::Sync).after(crate::sync::reset_film));
    app
}

fn press(app: &mut App, tap: Tap, cursor: [f64; 2]) {
    app.world.resource_mut::<Input>().taps.push(Press { cursor: cursor.into(), ..Press::from(tap) });
    app.frame();
    app.world.resource_mut::<Input>().end_frame();
}

fn status(app: &App) -> Arc<EditStatus> {
    app.world.resource::<Editor>().status().unwrap()
}

/// Selects, even what is selected already.
fn choose(app: &mut App, place: [f64; 2]) {
    press(app, Tap::Escape, place);
    press(app, Tap::Select, place);
}

/// Selects what is at `place` and steps each of its numbers up once.
fn change_all(app: &mut App, place: [f64; 2]) {
    choose(app, place);
    for _ in 0..status(app).rows.len() {
        press(app, Tap::More, place);
        press(app, Tap::NextRow, place);
    }
}

fn picture(app: &mut App) -> Film {
    app.world.resource_mut::<FrameBudget>().sample_target = 2;
    app.frame();
    app.frame();
    app.world.resource::<Film>().clone()
}

const PLACES: [[f64; 2]; 4] = [[0.5, 0.8], [0.5, 0.14], [0.4, 0.6], [0.05, 0.62]];

#[test]
fn a_saved_scene_is_the_edited_one_to_the_bit() {
    for scene in ["cornell", "gallery", "bust"] {
        let mut app = editable(scene);
        let before = Identity::of(&app.world, scene.to_owned());
        for place in PLACES {
            if pick(&app.world, place.into(), false).is_some() {
                change_all(&mut app, place);
            }
        }
        press(&mut app, Tap::Duplicate, [0.5; 2]);
        press(&mut app, Tap::More, [0.5; 2]);
        choose(&mut app, PLACES[1]);
        press(&mut app, Tap::Hide, PLACES[1]);
        let editor = app.world.resource::<Editor>().clone();
        let (text, _) = save::text(&app.world, &editor).unwrap();
        let file = std::env::temp_dir().join(format!("penumbra-{scene}-{}.toml", std::process::id()));
        std::fs::write(&file, &text).unwrap();
        let mut again = opened(scene, Some(file.clone()));
        std::fs::remove_file(&file).unwrap();
        let (edited, loaded) =
            (Identity::of(&app.world, scene.into()), Identity::of(&again.world, scene.into()));
        assert_ne!(edited.scene_hash, before.scene_hash);
        assert_eq!(edited.differences(&loaded), Vec::<String>::new(), "{scene}\n{text}");
        assert_eq!(picture(&mut app), picture(&mut again), "{scene}");
    }
}

/// Of a scene without light the program gives it one, and a camera: by what its file says, not by what was edited.
#[test]
fn what_was_decided_stays_when_things_are_edited() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/sphere.obj");
    let mut app = editable(scene);
    // Its key light, and then the ball: far away, and shining.
    press(&mut app, Tap::NextThing, [0.5; 2]);
    assert!(status(&app).name.contains("light"), "{:?}", status(&app));
    press(&mut app, Tap::More, [0.5; 2]);
    press(&mut app, Tap::NextThing, [0.5; 2]);
    for row in 0..status(&app).rows.len() {
        for _ in 0..if row == 0 { 20 } else { 1 } {
            press(&mut app, Tap::More, [0.5; 2]);
        }
        press(&mut app, Tap::NextRow, [0.5; 2]);
    }
    let editor = app.world.resource::<Editor>().clone();
    let (text, _) = save::text(&app.world, &editor).unwrap();
    let file = std::env::temp_dir().join(format!("penumbra-sphere-{}.toml", std::process::id()));
    std::fs::write(&file, &text).unwrap();
    let mut again = opened(scene, Some(file.clone()));
    std::fs::remove_file(&file).unwrap();
    let ours = Identity::of(&app.world, scene.into());
    assert_eq!(ours.differences(&Identity::of(&again.world, scene.into())), Vec::<String>::new(), "{text}");
    assert_eq!(picture(&mut app), picture(&mut again));
}

#[test]
fn only_what_was_changed_is_written() {
    let mut app = editable("cornell");
    choose(&mut app, PLACES[0]);
    press(&mut app, Tap::More, PLACES[0]);
    let tables = |app: &App| save::tables(&app.world, app.world.resource::<Editor>());
    let moved = tables(&app).pop().unwrap();
    assert!(moved.matrix.is_some(), "{moved:?}");
    assert_eq!((moved.material, moved.light, moved.hidden, moved.slot), (None, None, None, None));
    press(&mut app, Tap::Less, PLACES[0]);
    press(&mut app, Tap::Hide, PLACES[0]);
    let hidden = tables(&app).pop().unwrap();
    assert_eq!((hidden.matrix, hidden.hidden), (None, Some(true)));
}

#[test]
fn undo_brings_everything_back_to_the_bit() {
    let mut app = editable("cornell");
    let before = Identity::of(&app.world, String::new());
    for place in PLACES {
        if pick(&app.world, place.into(), false).is_some() {
            change_all(&mut app, place);
        }
    }
    press(&mut app, Tap::Duplicate, PLACES[0]);
    press(&mut app, Tap::Hide, PLACES[0]);
    press(&mut app, Tap::Hide, PLACES[0]);
    assert_ne!(Identity::of(&app.world, String::new()).scene_hash, before.scene_hash);
    for _ in 0..app.world.resource::<Editor>().undo.len() {
        press(&mut app, Tap::Undo, PLACES[0]);
    }
    assert_eq!(Identity::of(&app.world, String::new()).differences(&before), Vec::<String>::new());
    press(&mut app, Tap::Undo, PLACES[0]);
    let said = app.world.resource::<Notices>().0.last().cloned();
    assert_eq!(said, Some(Notice::Text("nothing to undo".to_owned())));
}

#[test]
fn copies_of_copies_are_counted_and_no_two_have_one_name() {
    let taken = ["ball", "ball copy 1", "ball copy 3", "copy x"].map(str::to_owned);
    for (original, copy) in [
        ("ball", "ball copy 2"),
        ("ball copy 1", "ball copy 2"),
        ("copy x", "copy x copy 1"),
        ("the copy x", "the copy x copy 1"),
        ("", " copy 1"),
    ] {
        assert_eq!(name_of_copy(original, &taken), copy);
    }
    // Also of those that another file has made.
    let mut app = editable("cornell");
    choose(&mut app, PLACES[0]);
    let mut names = Vec::new();
    for _ in 0..3 {
        press(&mut app, Tap::Duplicate, PLACES[0]);
        names.push(status(&app).name.clone());
        app.world.resource_mut::<Editor>().copies.clear();
    }
    let [first, others @ ..] = &names[..] else { panic!() };
    let base = first.rsplit_once('1').unwrap().0;
    assert_eq!(others, [format!("{base}2"), format!("{base}3")]);
}

#[test]
fn the_whole_scene_is_what_it_is_after_edits() {
    let mut app = editable("cornell");
    let loaded = *app.world.resource::<SceneBounds>();
    assert_eq!(bounds_now(&mut app.world), Some(loaded));
    choose(&mut app, [0.5, 0.8]);
    let Selection { entity, slot } = app.world.resource::<Editor>().selected.unwrap();
    set(&mut app.world, entity, slot, Property::Position(0), 3.0 * loaded.radius);
    app.frame();
    let wider = bounds_now(&mut app.world).unwrap();
    assert!(wider.radius > 1.2 * loaded.radius && wider.center.x > loaded.center.x, "{wider:?}");
    // Who does not see it does not look for it.
    press(&mut app, Tap::Hide, [0.5, 0.8]);
    let smaller = bounds_now(&mut app.world).unwrap();
    assert!(smaller.radius <= loaded.radius, "{smaller:?} {loaded:?}");
}

#[test]
fn an_undone_copy_is_gone_and_with_all_undone_nothing_was_edited() {
    let mut app = editable("cornell");
    choose(&mut app, PLACES[0]);
    let before = status(&app);
    press(&mut app, Tap::Duplicate, PLACES[0]);
    assert!(status(&app).place[1] > before.place[1]);
    press(&mut app, Tap::More, PLACES[0]);
    press(&mut app, Tap::Undo, PLACES[0]);
    press(&mut app, Tap::Undo, PLACES[0]);
    assert_eq!((&status(&app).name, status(&app).place), (&before.name, before.place));
    let editor = app.world.resource::<Editor>();
    assert!(!editor.has_edits() && editor.written().is_empty(), "{}", editor.written());
    press(&mut app, Tap::SaveEdits, PLACES[0]);
    let said = app.world.resource::<Notices>().0.last().cloned();
    assert_eq!(said, Some(Notice::Text("not saved: nothing was edited".to_owned())));
}

#[test]
fn what_was_undone_is_done_again_until_something_else_is_done() {
    for scene in ["cornell", "gallery"] {
        let mut app = editable(scene);
        change_all(&mut app, PLACES[1]);
        press(&mut app, Tap::Duplicate, [0.5; 2]);
        press(&mut app, Tap::More, [0.5; 2]);
        press(&mut app, Tap::Hide, [0.5; 2]);
        choose(&mut app, PLACES[0]);
        press(&mut app, Tap::More, [0.5; 2]);
        let identity = |app: &App| Identity::of(&app.world, scene.to_owned());
        let (edited, written) = (identity(&app), app.world.resource::<Editor>().written().to_owned());
        let steps = app.world.resource::<Editor>().undo.len();
        for _ in 0..2 {
            (0..steps).for_each(|_| press(&mut app, Tap::Undo, [0.5; 2]));
            assert_ne!(identity(&app).scene_hash, edited.scene_hash);
            assert!(!app.world.resource::<Editor>().has_edits());
            (0..steps).for_each(|_| press(&mut app, Tap::Redo, [0.5; 2]));
            assert_eq!(identity(&app).differences(&edited), Vec::<String>::new(), "{scene}");
            assert_eq!(app.world.resource::<Editor>().written(), written);
        }
        press(&mut app, Tap::Undo, [0.5; 2]);
        press(&mut app, Tap::Less, [0.5; 2]);
        let other = identity(&app);
        press(&mut app, Tap::Redo, [0.5; 2]);
        assert_eq!(identity(&app), other, "what was undone before is no more");
    }
}

/// A copy wears what its original wears; what nobody changed stays as the files say, also what was changed and undone.
#[test]
fn only_materials_that_were_changed_are_written() {
    let mut app = editable("cornell");
    let material = |app: &App| {
        let tables = save::tables(&app.world, app.world.resource::<Editor>());
        tables.iter().filter(|table| table.material.is_some()).count()
    };
    choose(&mut app, PLACES[0]);
    let red = status(&app).rows.iter().position(|row| row.property == Property::BaseColor(0)).unwrap();
    press(&mut app, Tap::Duplicate, [0.5; 2]);
    press(&mut app, Tap::More, [0.5; 2]);
    assert_eq!(material(&app), 0, "{}", app.world.resource::<Editor>().written());
    (0..red).for_each(|_| press(&mut app, Tap::NextRow, [0.5; 2]));
    press(&mut app, Tap::Less, [0.5; 2]);
    assert_eq!(material(&app), 1);
    press(&mut app, Tap::Undo, [0.5; 2]);
    assert_eq!(material(&app), 0);
    press(&mut app, Tap::Undo, [0.5; 2]);
    press(&mut app, Tap::Undo, [0.5; 2]);
    // A thing moved, another one coloured, and that undone.
    let mut app = editable("cornell");
    choose(&mut app, PLACES[1]);
    press(&mut app, Tap::More, [0.5; 2]);
    choose(&mut app, PLACES[0]);
    (0..red).for_each(|_| press(&mut app, Tap::NextRow, [0.5; 2]));
    press(&mut app, Tap::Less, [0.5; 2]);
    assert_eq!(material(&app), 1);
    press(&mut app, Tap::Undo, [0.5; 2]);
    assert_eq!((material(&app), app.world.resource::<Editor>().edited.len()), (0, 1));
}

#[test]
fn edits_are_unsaved_until_a_file_has_them() {
    let mut app = editable("cornell");
    let unsaved = |app: &App| app.world.resource::<Editor>().is_unsaved();
    assert!(!unsaved(&app));
    choose(&mut app, PLACES[0]);
    press(&mut app, Tap::More, [0.5; 2]);
    assert!(unsaved(&app));
    // As saving does it.
    let mut editor = app.world.resource_mut::<Editor>();
    editor.saved = editor.written.clone();
    assert!(!unsaved(&app));
    press(&mut app, Tap::Undo, [0.5; 2]);
    assert!(!unsaved(&app), "nothing to lose");
    press(&mut app, Tap::Redo, [0.5; 2]);
    press(&mut app, Tap::Hide, [0.5; 2]);
    assert!(unsaved(&app));
}

#[test]
fn who_selects_nothing_is_told() {
    for tap in [Tap::Hide, Tap::Duplicate, Tap::More] {
        let mut app = editable("cornell");
        press(&mut app, tap, PLACES[0]);
        let said = app.world.resource::<Notices>().0.last().cloned();
        assert!(matches!(said, Some(Notice::Text(text)) if text.starts_with("select something")), "{tap:?}");
    }
}

#[test]
fn only_what_must_be_is_redone_and_it_is_told() {
    let mut app = editable("cornell");
    choose(&mut app, PLACES[1]);
    let rows = status(&app).rows.clone();
    let mut edit = |property: Property| {
        let before = *app.world.resource::<Redone>();
        let row = rows.iter().find(|row| row.property == property).unwrap();
        app.world.resource_mut::<Input>().edits.push((property, row.stepped(1.0)));
        app.frame();
        app.world.resource_mut::<Input>().end_frame();
        let now = *app.world.resource::<Redone>();
        (
            now.blas - before.blas,
            now.tlas - before.tlas,
            now.lights - before.lights,
            status(&app).redone.clone(),
        )
    };
    let (blas, tlas, lights, told) = edit(Property::Power);
    assert_eq!((blas, tlas, lights), (0, 0, 1));
    assert!(told.starts_with("redone: lights, in "), "{told}");
    choose(&mut app, PLACES[0]);
    let position = status(&app).rows[0].clone();
    let before = *app.world.resource::<Redone>();
    app.world.resource_mut::<Input>().edits.push((position.property, position.stepped(1.0)));
    app.frame();
    let now = *app.world.resource::<Redone>();
    assert_eq!((now.blas, now.tlas), (before.blas, before.tlas + 1));
    assert!(status(&app).redone.starts_with("redone: top level, lights, in "), "{}", status(&app).redone);
}

/// Where the picture shows this place of the world.
fn seen_at(app: &App, place: glam::DVec3) -> [f64; 2] {
    let size = app.world.resource::<RenderSettings>().size;
    let place = place - app.world.resource::<RenderOrigin>().0.unwrap_or_default();
    let seen = app.world.resource::<Viewpoint>().project(place.as_vec3(), size).truncate().as_dvec2();
    (seen / size.as_dvec2()).to_array()
}

#[test]
fn a_lamp_that_no_ray_meets_is_picked_beside_its_place() {
    let mut app = editable("cornell-point");
    app.frame();
    let mut lamps = app.world.query_filtered::<(Entity, &GlobalTransform), With<Light>>();
    let (lamp, place) =
        lamps.iter(&app.world).map(|(lamp, place)| (lamp, place.0.translation)).next().unwrap();
    let [x, y] = seen_at(&app, place);
    press(&mut app, Tap::Select, [x + 0.03, y]);
    assert_eq!(app.world.resource::<Editor>().selected.map(|s| s.entity), Some(lamp));
    let power = status(&app).rows.iter().find(|row| row.property == Property::Power).cloned();
    assert!(power.is_some(), "{:?}", status(&app).rows);
    choose(&mut app, [x + 0.3, y]);
    assert_ne!(app.world.resource::<Editor>().selected.map(|s| s.entity), Some(lamp), "far beside it");
}

#[test]
fn the_keys_go_through_all_things_also_those_that_are_hidden() {
    let mut app = editable("cornell-point");
    app.frame();
    let count = things(&app.world).len();
    let mut seen = Vec::new();
    for i in 0..count {
        press(&mut app, Tap::NextThing, [0.5; 2]);
        assert_eq!(status(&app).place, [i + 1, count]);
        let selected = app.world.resource::<Editor>().selected.unwrap();
        assert!(!seen.contains(&selected));
        press(&mut app, Tap::Hide, [0.5; 2]);
        seen.push(selected);
    }
    assert!(app.world.get::<Light>(seen[0].entity).is_some(), "lights come first");
    press(&mut app, Tap::NextThing, [0.5; 2]);
    assert_eq!(app.world.resource::<Editor>().selected, Some(seen[0]), "round and round");
    press(&mut app, Tap::PreviousThing, [0.5; 2]);
    assert_eq!(app.world.resource::<Editor>().selected, seen.last().copied());
    let last = seen[count - 1].entity;
    assert!(status(&app).hidden && app.world.get::<Hidden>(last).is_some());
    press(&mut app, Tap::Hide, [0.5; 2]);
    assert!(!status(&app).hidden && app.world.get::<Hidden>(last).is_none());
}

#[test]
fn while_something_is_selected_it_is_marked_and_so_are_lamps_that_are_not_seen() {
    let mut app = editable("cornell-point");
    app.world.init_resource::<marks::Marks>();
    app.add_systems(marks::mark.in_set(FrameSystems::Sync).after(finish_sync));
    app.frame();
    let lines = |app: &App| {
        let size = app.world.resource::<RenderSettings>().size;
        app.world.resource::<marks::Marks>().lines(app.world.resource::<Viewpoint>(), size).len()
    };
    assert_eq!(lines(&app), 0);
    press(&mut app, Tap::NextThing, [0.5; 2]);
    let lamp = lines(&app);
    assert!(lamp > 0);
    press(&mut app, Tap::PreviousThing, [0.5; 2]);
    assert_eq!(lines(&app), lamp + 12, "a box around the instance as well");
    press(&mut app, Tap::Escape, [0.5; 2]);
    assert_eq!(lines(&app), 0);
}
