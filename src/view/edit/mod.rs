//! Changing the scene while it is seen: pick a thing, change its numbers, take it back, keep it in a file.

pub mod carry;
mod choice;
pub mod marks;
pub mod property;
pub mod save;
mod undo;

use super::controls::{Notice, Notices};
use super::input::Input;
use super::keymap::Tap;
use crate::app::FrameStats;
use crate::load::settings::edit::{EditTable, duplicate};
use crate::scene::path::{children, path_of, siblings};
use crate::scene::{Hidden, Instance, Light, Playing, Pose, SceneBounds};
use crate::sync::Redone;
use crate::trace::Lights;
use bevy_ecs::prelude::*;
use choice::{kind_of, pick, stepped, things};
use glam::DVec2;
use property::{Property, Row, rows, set};
use std::sync::Arc;
use std::time::{Duration, Instant};
use undo::{Undo, redo, remember, remember_too, set_hidden, undo};

/// What is selected, and what was done.
#[derive(Resource, Clone, Debug, Default)]
pub struct Editor {
    selected: Option<Selection>,
    /// Which of its rows the keys change.
    row: usize,
    undo: Vec<Undo>,
    /// What was undone, the last at the end.
    redo: Vec<Undo>,
    /// What a file has of [`Editor::written`].
    saved: Arc<str>,
    /// What was changed: entity and material slot. In this order.
    edited: Vec<(Entity, usize)>,
    /// Copies, and what they are of.
    copies: Vec<(Entity, Entity)>,
    /// Edits of what the scene had before it was loaded again, should it come back.
    waiting: Vec<EditTable>,
    /// All of them as text, for who asks in each frame.
    written: Arc<str>,
    shown: Option<Arc<EditStatus>>,
    before: Redone,
    /// Seconds of bringing the arrays up to date, in the frame of the last edit.
    sync: Duration,
    sync_began: Option<Instant>,
    /// Samples per pixel that the last edit made worthless.
    lost: f64,
    dirty: bool,
    redone: String,
    /// No light is left.
    dark: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Selection {
    entity: Entity,
    slot: usize,
}

/// What the card shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EditStatus {
    /// Its name.
    pub name: String,
    /// What kind of light it is; which of its materials is meant, if it has several; or how large a group.
    pub kind: Option<String>,
    /// The how manieth of how many things it is, in the order of the keys; a group is the zeroth.
    pub place: [usize; 2],
    /// Its numbers.
    pub rows: Vec<Row>,
    /// Which one the keys change.
    pub row: usize,
    /// Whether it is left out.
    pub hidden: bool,
    /// What the last edit made necessary, and how long it took.
    pub redone: String,
}

impl Editor {
    /// For the card.
    #[must_use]
    pub fn status(&self) -> Option<Arc<EditStatus>> {
        self.shown.clone()
    }

    /// Whether there is something that the keys change.
    #[must_use]
    pub fn has_selection(&self) -> bool {
        self.selected.is_some()
    }

    /// Whether anything was edited.
    #[must_use]
    pub fn has_edits(&self) -> bool {
        !(self.edited.is_empty() && self.waiting.is_empty())
    }

    /// The `[[edit]]` tables of all that was edited until the last frame; empty if nothing was.
    #[must_use]
    pub fn written(&self) -> &str {
        &self.written
    }

    /// Whether no file has what was edited.
    #[must_use]
    pub fn is_unsaved(&self) -> bool {
        self.has_edits() && self.written != self.saved
    }

    fn note(&mut self, selection: Selection) {
        let Selection { entity, slot } = selection;
        if !self.edited.contains(&(entity, slot)) {
            self.edited.push((entity, slot));
        }
    }

    /// That these copies were made, and how to have them no more.
    fn made(&mut self, world: &World, copies: &[(Entity, Entity)], slot: usize) -> Selection {
        let [original, copied] = [copies[0].0, copies[0].1].map(|entity| Selection { entity, slot });
        self.copies.push((copied.entity, original.entity));
        let copies = copies.iter().map(|&(_, copy)| copy).collect();
        self.undo.push(Undo { copies, ..Undo::of_copy(world, copied, original) });
        copied
    }

    /// That they are not what the files have: the first has another place, others are copies of what was changed or moved before.
    fn note_copies(&mut self, world: &World, copies: &[(Entity, Entity)]) {
        let edited: Vec<Entity> = self.edited.iter().map(|&(entity, _)| entity).collect();
        for (n, &(of, copy)) in copies.iter().enumerate() {
            if n == 0 || edited.contains(&of) || world.get::<Pose>(of).is_some() {
                self.note(Selection { entity: copy, slot: 0 });
            }
        }
    }
}

/// Acts on keys and on the card.
pub fn edit_scene(world: &mut World) {
    let input = world.resource::<Input>();
    let presses: Vec<_> = input.taps.iter().filter(|press| press.tap.edits()).copied().collect();
    let mut values = input.edits.clone();
    if presses.iter().any(|press| matches!(press.tap, Tap::Undo | Tap::Redo)) {
        // They are of a card whose thing may be gone.
        values.clear();
    }
    if presses.is_empty() && values.is_empty() {
        return;
    }
    // Whoever else is at work in this frame shall not see the editor gone.
    let Some(mut editor) = world.remove_resource::<Editor>() else { return };
    for press in presses {
        let steps = if press.shift { 10.0 } else { 1.0 };
        match press.tap {
            Tap::Select => select(world, &mut editor, press.cursor),
            Tap::SelectParent => select_parent(world, &mut editor),
            Tap::PreviousThing => go(world, &mut editor, -steps as i64),
            Tap::NextThing => go(world, &mut editor, steps as i64),
            Tap::Escape => editor.selected = None,
            Tap::PreviousRow => editor.row = editor.row.saturating_sub(1),
            Tap::NextRow => editor.row += 1,
            Tap::Less => step(world, &mut editor, -steps),
            Tap::More => step(world, &mut editor, steps),
            Tap::Hide => hide(world, &mut editor),
            Tap::Duplicate => copy(world, &mut editor),
            Tap::Undo => undo(world, &mut editor),
            Tap::Redo => redo(world, &mut editor),
            Tap::SaveEdits => {
                let said = save::save(world, &editor);
                if let Notice::Saved(..) = said {
                    editor.saved = save::edits(world, &editor).unwrap_or_default().into();
                }
                world.resource_mut::<Notices>().0.push(said);
            }
            _ => {}
        }
    }
    for (property, value) in values {
        change(world, &mut editor, property, value);
        // What the mouse has changed the keys change next.
        if let Some(Selection { entity, slot }) = editor.selected {
            let rows = rows(world, entity, slot, radius(world));
            editor.row = rows.iter().position(|row| row.property == property).unwrap_or(editor.row);
        }
    }
    editor.dirty = true;
    world.insert_resource(editor);
}

fn radius(world: &World) -> f64 {
    world.get_resource::<SceneBounds>().map_or(1.0, |bounds| bounds.radius)
}

fn say(world: &mut World, text: &str) {
    world.resource_mut::<Notices>().0.push(Notice::Text(text.to_owned()));
}

/// That something is to be selected first, if it still says so.
fn wanted_no_more(world: &mut World) {
    say(world, "");
}

fn select(world: &mut World, editor: &mut Editor, cursor: DVec2) {
    let found = pick(world, cursor, editor.selected.is_some());
    editor.row = 0;
    // That was told of another.
    editor.redone.clear();
    editor.selected = if editor.selected == found { None } else { found };
    if found.is_some() {
        wanted_no_more(world);
    } else {
        say(world, "nothing there to edit: {next_thing} goes through all there is");
    }
}

/// Selects what the selected thing moves with: a group of the file, in the end all of it.
fn select_parent(world: &mut World, editor: &mut Editor) {
    let Some(selection) = selected(world, editor) else { return };
    let Some(parent) = world.get::<ChildOf>(selection.entity).map(ChildOf::parent) else {
        return say(world, "that is all of it: it moves with nothing else");
    };
    editor.row = 0;
    editor.redone.clear();
    editor.selected = Some(Selection { entity: parent, slot: 0 });
}

fn go(world: &mut World, editor: &mut Editor, by: i64) {
    editor.row = 0;
    editor.redone.clear();
    editor.selected = stepped(&things(world), editor.selected, by);
    if editor.selected.is_some() {
        wanted_no_more(world);
    } else {
        say(world, "there is nothing to edit");
    }
}

fn change(world: &mut World, editor: &mut Editor, property: Property, value: f64) {
    let Some(selection) = editor.selected else { return };
    remember(world, editor, selection, Some(property));
    set(world, selection.entity, selection.slot, property, value);
    editor.note(selection);
}

fn step(world: &mut World, editor: &mut Editor, steps: f64) {
    let Some(Selection { entity, slot }) = selected(world, editor) else { return };
    let rows = rows(world, entity, slot, radius(world));
    if let Some(row) = rows.get(editor.row.min(rows.len().saturating_sub(1))) {
        change(world, editor, row.property, row.stepped(steps));
    }
}

/// What is selected; if nothing is, that is said.
fn selected(world: &mut World, editor: &Editor) -> Option<Selection> {
    if editor.selected.is_none() {
        say(world, "select something first: {select}, or {next_thing}");
    }
    editor.selected
}

fn hide(world: &mut World, editor: &mut Editor) {
    let Some(selection) = selected(world, editor) else { return };
    remember(world, editor, selection, None);
    let hidden = world.get::<Hidden>(selection.entity).is_none();
    set_hidden(world, selection.entity, hidden);
    editor.note(selection);
    // What moves with it goes with it.
    for entity in below(world, selection.entity) {
        if world.get::<Hidden>(entity).is_some() != hidden {
            remember_too(world, editor, entity);
            set_hidden(world, entity, hidden);
            editor.note(Selection { entity, slot: 0 });
        }
    }
}

/// All things and lights below an entity.
fn below(world: &World, top: Entity) -> Vec<Entity> {
    let (mut found, mut next) = (Vec::new(), children(world, top));
    while let Some(entity) = next.pop() {
        if world.get::<Instance>(entity).is_some() || world.get::<Light>(entity).is_some() {
            found.push(entity);
        }
        next.extend(children(world, entity));
    }
    found
}

fn copy(world: &mut World, editor: &mut Editor) {
    let Some(selection) = selected(world, editor) else { return };
    let path = path_of(world, selection.entity);
    let name = name_of_copy(path.last().map_or("", String::as_str), &siblings(world, selection.entity));
    let copies = duplicate(world, selection.entity, &name);
    crate::app::propagate(world);
    editor.redo.clear();
    let copied = editor.made(world, &copies, selection.slot);
    editor.note_copies(world, &copies);
    editor.selected = Some(copied);
    // Beside the original, not in it.
    let rows = rows(world, copied.entity, 0, radius(world));
    let aside = rows.iter().find(|row| row.property == Property::Position(0));
    if let Some(x) = aside.map(|row| row.stepped(5.0)) {
        set(world, copied.entity, copied.slot, Property::Position(0), x);
    }
}

/// The first of "… copy 1", "… copy 2" that nobody beside it has. A copy of a copy is one more of the same.
fn name_of_copy(original: &str, taken: &[String]) -> String {
    let is_number = |n: &str| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit());
    let base =
        original.rsplit_once(" copy ").filter(|(_, n)| is_number(n)).map_or(original, |(base, _)| base);
    let names = (1..).map(|n: u32| format!("{base} copy {n}"));
    names.into_iter().find(|name| !taken.contains(name)).unwrap_or_default()
}

/// Before the arrays are brought up to date.
pub fn start_sync(mut editor: ResMut<Editor>, redone: Res<Redone>, stats: Res<FrameStats>) {
    let editor = editor.bypass_change_detection();
    if editor.dirty {
        (editor.before, editor.lost) = (*redone, stats.samples_per_pixel);
        editor.sync_began = Some(Instant::now());
    }
}

/// After it: what was it that had to be done?
pub fn finish_sync(world: &mut World) {
    let editor = world.resource::<Editor>();
    // What was edited may be animated too.
    let moved = editor.has_edits() && world.is_resource_changed::<Playing>();
    let dirty = editor.dirty;
    if !(dirty || moved) {
        return;
    }
    let Some(mut editor) = world.remove_resource::<Editor>() else { return };
    editor.written = save::edits(world, &editor).unwrap_or_default().into();
    if dirty || editor.selected.is_some() {
        show(world, &mut editor);
    }
    if dirty {
        let dark = world.resource::<Lights>().is_empty();
        if !std::mem::replace(&mut editor.dark, dark) && dark {
            say(world, "that was the last light: {undo} brings it back");
        }
    }
    world.insert_resource(editor);
}

/// What the card shows now.
fn show(world: &World, editor: &mut Editor) {
    editor.dirty = false;
    editor.sync = editor.sync_began.take().map_or(Duration::ZERO, |began| began.elapsed());
    let now = *world.resource::<Redone>();
    if now != editor.before {
        editor.redone = told(editor.before, now, editor.sync, editor.lost);
    }
    editor.shown = editor.selected.map(|selection| {
        let Selection { entity, slot } = selection;
        let rows = rows(world, entity, slot, radius(world));
        editor.row = editor.row.min(rows.len().saturating_sub(1));
        let things = things(world);
        let here = things.iter().position(|&thing| thing == selection);
        Arc::new(EditStatus {
            name: path_of(world, entity).join(" / "),
            kind: kind_of(world, selection),
            place: [here.map_or(0, |here| here + 1), things.len()],
            rows,
            row: editor.row,
            hidden: world.get::<Hidden>(entity).is_some(),
            redone: editor.redone.clone(),
        })
    });
}

fn told(before: Redone, now: Redone, time: Duration, lost: f64) -> String {
    let mut parts = Vec::new();
    for (name, before, now) in [
        ("meshes", before.blas, now.blas),
        ("top level", before.tlas, now.tlas),
        ("materials", before.surfaces, now.surfaces),
        ("lights", before.lights, now.lights),
    ] {
        if now > before {
            parts.push(name);
        }
    }
    let what = if parts.is_empty() { "nothing".to_owned() } else { parts.join(", ") };
    format!("redone: {what}, in {:.1} ms; {lost:.0} samples per pixel lost", time.as_secs_f64() * 1e3)
}

#[cfg(test)]
mod tests;
