//! What moves together, by hand or by animations.

use super::*;

/// The Cornell box, and what is the first of it and a lamp.
fn a_thing_and_a_lamp() -> (App, Entity, Entity) {
    let mut app = editable("cornell");
    let thing = app.world.query_filtered::<Entity, With<Instance>>().iter(&app.world).next().unwrap();
    let lamp = app.world.query_filtered::<Entity, With<Light>>().iter(&app.world).next().unwrap();
    (app, thing, lamp)
}

/// The same, with the lamp on the thing.
fn lamp_on_a_thing() -> (App, Entity, Entity) {
    let (mut app, thing, lamp) = a_thing_and_a_lamp();
    app.world.entity_mut(lamp).insert(ChildOf(thing));
    app.frame();
    (app, thing, lamp)
}

fn select(app: &mut App, entity: Entity) {
    app.world.resource_mut::<Editor>().selected = Some(Selection { entity, slot: 0 });
}

/// What moves with a thing is hidden with it, and back with one step.
#[test]
fn a_thing_is_hidden_with_all_below_it() {
    let (mut app, top, lamp) = lamp_on_a_thing();
    let before = Identity::of(&app.world, "cornell".to_owned());
    select(&mut app, top);
    press(&mut app, Tap::Hide, [0.5; 2]);
    let hidden = |app: &App| [top, lamp].map(|entity| app.world.get::<Hidden>(entity).is_some());
    assert_eq!(hidden(&app), [true; 2]);
    press(&mut app, Tap::Undo, [0.5; 2]);
    assert_eq!(hidden(&app), [false; 2]);
    assert_eq!(Identity::of(&app.world, "cornell".to_owned()), before);
    press(&mut app, Tap::Redo, [0.5; 2]);
    assert_eq!(hidden(&app), [true; 2]);
    press(&mut app, Tap::Hide, [0.5; 2]);
    assert_eq!(hidden(&app), [false; 2]);
}

/// What was moved by hand stands where it was put while an animation plays; undone, it goes where that has it.
#[test]
fn animations_leave_alone_what_was_moved_by_hand() {
    use crate::scene::animation::{Animation, Channel, Curve, Property as Moved};
    let (mut app, thing, _) = a_thing_and_a_lamp();
    let parts = app.world.get::<Transform>(thing).unwrap().0.to_scale_rotation_translation();
    let pose = Pose { scale: parts.0, rotation: parts.1, translation: parts.2 };
    app.world.entity_mut(thing).insert(pose);
    let curve =
        Curve { times: vec![0.0, 1.0], values: vec![0., 0., 0., 8., 0., 0.], width: 3, ..Curve::default() };
    let channels = vec![Channel { target: thing, property: Moved::Translation, curve }];
    let animation = app.world.spawn(Animation { channels, duration: 1.0 }).id();
    let play = |app: &mut App, time: f64| {
        app.world.insert_resource(Playing { animations: vec![animation], time: Some(time) });
        app.frame();
        app.world.get::<GlobalTransform>(thing).unwrap().0.translation
    };
    let x = |app: &App| status(app).rows[0].value;
    assert_eq!(play(&mut app, 0.25).x, 2.0);
    select(&mut app, thing);
    press(&mut app, Tap::More, [0.5; 2]);
    let put = app.world.get::<GlobalTransform>(thing).unwrap().0.translation;
    assert_eq!(play(&mut app, 0.5), put);
    assert_eq!(x(&app), put.x);
    // A copy is saved with its place, for at another time the file has another.
    press(&mut app, Tap::Undo, [0.5; 2]);
    app.frame();
    assert_eq!(app.world.get::<GlobalTransform>(thing).unwrap().0.translation.x, 4.0);
    let group = app.world.spawn((Name::new("group"), Transform::default())).id();
    app.world.entity_mut(thing).insert(ChildOf(group));
    select(&mut app, group);
    press(&mut app, Tap::Duplicate, [0.5; 2]);
    let tables = save::tables(&app.world, app.world.resource::<Editor>());
    assert_eq!(tables.iter().filter(|table| table.matrix.is_some()).count(), 2, "{tables:?}");
}

/// What belongs together is moved as one, and saved so.
#[test]
fn a_group_is_selected_by_what_is_in_it() {
    let (mut app, thing, lamp) = a_thing_and_a_lamp();
    let group = app.world.spawn((Name::new("group"), Transform::default())).id();
    for entity in [thing, lamp] {
        app.world.entity_mut(entity).insert(ChildOf(group));
    }
    app.frame();
    let place = |app: &App, entity| app.world.get::<GlobalTransform>(entity).unwrap().0.translation;
    let before = [thing, lamp].map(|entity| place(&app, entity));
    select(&mut app, lamp);
    press(&mut app, Tap::SelectParent, [0.5; 2]);
    let shown = status(&app);
    assert_eq!((shown.name.as_str(), shown.place[0]), ("group", 0));
    assert_eq!(shown.kind.as_deref(), Some("group of 2 things"));
    press(&mut app, Tap::More, [0.5; 2]);
    let moved = place(&app, group);
    assert!(moved.length() > 0.0);
    assert_eq!([thing, lamp].map(|entity| place(&app, entity) - moved), before);
    let tables = save::tables(&app.world, app.world.resource::<Editor>());
    assert!(tables.iter().any(|table| table.entity == ["group"] && table.matrix.is_some()));
    press(&mut app, Tap::Undo, [0.5; 2]);
    assert_eq!([thing, lamp].map(|entity| place(&app, entity)), before);
    press(&mut app, Tap::SelectParent, [0.5; 2]);
    assert_eq!(status(&app).name, "group", "nothing is above it");
    let said = app.world.resource::<Notices>().0.last().cloned();
    assert_eq!(said, Some(Notice::Text("that is all of it: it moves with nothing else".to_owned())));
}

/// What moves with a thing is copied with it, changed and hidden as it is; undone, done again, saved.
#[test]
fn a_thing_is_copied_with_all_below_it() {
    let (mut app, top, lamp) = lamp_on_a_thing();
    let lights = |app: &App| app.world.resource::<Lights>().len();
    let before = lights(&app);
    // A changed lamp ...
    select(&mut app, lamp);
    press(&mut app, Tap::More, [0.5; 2]);
    select(&mut app, top);
    press(&mut app, Tap::Duplicate, [0.5; 2]);
    assert_eq!(lights(&app), 2 * before);
    let copy = app.world.resource::<Editor>().selected.unwrap().entity;
    let copied_lamp = children(&app.world, copy)[0];
    let place = |app: &App, entity| *app.world.get::<Transform>(entity).unwrap();
    assert_eq!(place(&app, copied_lamp), place(&app, lamp));
    // ... is the same in the file, which knows it by its name.
    let path = path_of(&app.world, copied_lamp);
    let tables = save::tables(&app.world, app.world.resource::<Editor>());
    let table = tables.iter().find(|table| table.entity == path).unwrap();
    assert!(table.matrix.is_some() && table.light.is_some(), "{table:?}");
    // The copied lamp is changed, and all of it undone and done again.
    select(&mut app, copied_lamp);
    press(&mut app, Tap::Hide, [0.5; 2]);
    assert_eq!(lights(&app), before);
    let written = app.world.resource::<Editor>().written().to_owned();
    press(&mut app, Tap::Undo, [0.5; 2]);
    press(&mut app, Tap::Undo, [0.5; 2]);
    assert_eq!(lights(&app), before);
    assert!(app.world.get_entity(copied_lamp).is_err());
    press(&mut app, Tap::Redo, [0.5; 2]);
    assert_eq!(lights(&app), 2 * before);
    press(&mut app, Tap::Redo, [0.5; 2]);
    assert_eq!(lights(&app), before);
    assert_eq!(app.world.resource::<Editor>().written(), written);
    // A copy of what has something hidden has that hidden.
    press(&mut app, Tap::PreviousThing, [0.5; 2]);
    let copy = app.world.resource::<Editor>().copies[0].0;
    select(&mut app, copy);
    press(&mut app, Tap::Duplicate, [0.5; 2]);
    assert_eq!(lights(&app), before);
}
