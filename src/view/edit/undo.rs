//! How things were before, and back to that.

use super::property::{Property, material_of};
use super::{Editor, Selection, say};
use crate::load::settings::edit::duplicate;
use crate::scene::path::path_of;
use crate::scene::{ByHand, Hidden, Light, Material, Playing, Pose, Transform};
use bevy_ecs::prelude::*;
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// Changes of a number within this time of each other are one step.
const ONE_STEP: Duration = Duration::from_secs(1);

/// How things were.
#[derive(Clone, Debug)]
pub(super) struct Undo {
    pub(super) selection: Selection,
    /// If it is a copy, what that is of.
    pub(super) original: Option<Selection>,
    /// And all that was copied with it, itself first, parents before their children.
    pub(super) copies: Vec<Entity>,
    /// Changes of one number in a row are one step ...
    pub(super) property: Option<Property>,
    /// ... if they follow each other soon.
    pub(super) at: Instant,
    pub(super) transform: Option<Transform>,
    /// Where the animation, if there is one, had put it.
    pub(super) pose: Option<Pose>,
    pub(super) light: Option<Light>,
    pub(super) material: Option<(Entity, Material)>,
    pub(super) hidden: bool,
    /// Whether it stood where somebody had put it.
    pub(super) by_hand: bool,
    /// It was done together with the one before.
    pub(super) joined: bool,
    /// What a copy is called.
    pub(super) name: String,
}

impl Undo {
    /// How it is now.
    fn now(world: &World, selection: Selection) -> Self {
        let Selection { entity, slot } = selection;
        let material = material_of(world, entity, slot);
        Self {
            selection,
            original: None,
            copies: Vec::new(),
            property: None,
            at: Instant::now(),
            transform: world.get::<Transform>(entity).copied(),
            pose: world.get::<Pose>(entity).copied(),
            light: world.get::<Light>(entity).cloned(),
            material: material.and_then(|m| Some((m, world.get::<Material>(m)?.clone()))),
            hidden: world.get::<Hidden>(entity).is_some(),
            by_hand: world.get::<ByHand>(entity).is_some(),
            joined: false,
            name: path_of(world, entity).pop().unwrap_or_default(),
        }
    }

    /// To undo a copy is to have it no more.
    pub(super) fn of_copy(world: &World, copy: Selection, original: Selection) -> Self {
        let nothing =
            Self { transform: None, pose: None, light: None, material: None, ..Self::now(world, copy) };
        Self { original: Some(original), ..nothing }
    }

    /// Makes it so again.
    fn apply(self, world: &mut World) {
        let entity = self.selection.entity;
        // What an animation has moved since stays where that put it.
        if let Some(transform) = self.transform
            && world.get::<Pose>(entity).copied() == self.pose
            && let Some(mut now) = world.get_mut::<Transform>(entity)
        {
            now.set_if_neq(transform);
        }
        if let Some(light) = self.light
            && let Some(mut now) = world.get_mut::<Light>(entity)
        {
            now.set_if_neq(light);
        }
        if let Some((material, value)) = self.material
            && let Some(mut now) = world.get_mut::<Material>(material)
        {
            now.set_if_neq(value);
        }
        set_hidden(world, entity, self.hidden);
        let Ok(mut place) = world.get_entity_mut(entity) else { return };
        if self.by_hand {
            place.insert(ByHand);
        } else if place.take::<ByHand>().is_some()
            && let Some(mut playing) = world.get_resource_mut::<Playing>()
        {
            // It goes where its animation, if it has one, is by now.
            playing.set_changed();
        }
    }
}

/// Leaves a thing out of the picture, or not.
pub(super) fn set_hidden(world: &mut World, entity: Entity, hidden: bool) {
    if let Ok(mut entity) = world.get_entity_mut(entity) {
        match (hidden, entity.contains::<Hidden>()) {
            (true, false) => drop(entity.insert(Hidden)),
            (false, true) => drop(entity.remove::<Hidden>()),
            _ => {}
        }
    }
}

/// Remembers how it is now. What was undone cannot be done again after that.
pub(super) fn remember(world: &World, editor: &mut Editor, selection: Selection, property: Option<Property>) {
    editor.redo.clear();
    let now = Instant::now();
    if let Some(last) = editor.undo.last_mut().filter(|_| property.is_some())
        && (last.selection, last.property) == (selection, property)
        && now - last.at < ONE_STEP
    {
        last.at = now;
        return;
    }
    editor.undo.push(Undo { property, ..Undo::now(world, selection) });
}

/// The same for something that is changed together with what was remembered last.
pub(super) fn remember_too(world: &World, editor: &mut Editor, entity: Entity) {
    editor.undo.push(Undo { joined: true, ..Undo::now(world, Selection { entity, slot: 0 }) });
}

pub(super) fn undo(world: &mut World, editor: &mut Editor) {
    let Some(mut last) = editor.undo.pop() else { return say(world, "nothing to undo") };
    loop {
        let (selection, joined) = (last.selection, last.joined);
        let copies = last.copies.clone();
        let now = Undo { original: last.original, copies, joined, ..Undo::now(world, selection) };
        if let Some(original) = last.original {
            editor.copies.retain(|(copy, _)| *copy != selection.entity);
            editor.edited.retain(|(edited, _)| !last.copies.contains(edited));
            // From below: a deep chain needs no deep stack.
            for &copy in last.copies.iter().rev() {
                world.despawn(copy);
            }
            editor.selected = Some(original);
        } else {
            last.apply(world);
            editor.selected = Some(selection);
        }
        editor.redo.push(now);
        match editor.undo.pop_if(|_| joined) {
            Some(before) => last = before,
            None => break,
        }
    }
    crate::app::propagate(world);
    // What was undone altogether is not edited.
    let Editor { undo, edited, .. } = editor;
    edited.retain(|&(entity, slot)| {
        let selection = Selection { entity, slot };
        undo.iter().any(|undo| undo.selection == selection || undo.copies.contains(&entity))
    });
}

/// Does again what was undone last.
pub(super) fn redo(world: &mut World, editor: &mut Editor) {
    let Some(mut next) = editor.redo.pop() else { return say(world, "nothing to do again") };
    loop {
        if let Some(original) = next.original {
            next.selection = copy_again(world, editor, &next, original);
        } else {
            editor.undo.push(Undo { joined: next.joined, ..Undo::now(world, next.selection) });
        }
        if !next.joined {
            editor.selected = Some(next.selection);
        }
        editor.note(next.selection);
        next.apply(world);
        match editor.redo.pop_if(|next| next.joined) {
            Some(after) => next = after,
            None => break,
        }
    }
    crate::app::propagate(world);
}

/// Copies that were there before; what is said of those is meant of them.
fn copy_again(world: &mut World, editor: &mut Editor, before: &Undo, original: Selection) -> Selection {
    let copies = duplicate(world, original.entity, &before.name);
    let copied = editor.made(world, &copies, before.selection.slot);
    editor.note_copies(world, &copies);
    let now_called: HashMap<Entity, Entity> =
        before.copies.iter().copied().zip(copies.into_iter().map(|(_, copy)| copy)).collect();
    for later in &mut editor.redo {
        let selections = [Some(&mut later.selection), later.original.as_mut()];
        let entities = selections.into_iter().flatten().map(|selection| &mut selection.entity);
        for entity in entities {
            *entity = now_called.get(entity).copied().unwrap_or(*entity);
        }
    }
    copied
}
