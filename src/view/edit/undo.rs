//! How things were before, and back to that.

use super::property::{Property, material_of};
use super::{Editor, Selection, say};
use crate::scene::{Hidden, Light, Material, Pose, Transform};
use bevy_ecs::prelude::*;
use std::time::{Duration, Instant};

/// Changes of a number within this time of each other are one step.
const ONE_STEP: Duration = Duration::from_secs(1);

/// How things were.
#[derive(Clone, Debug)]
pub(super) struct Undo {
    pub(super) selection: Selection,
    /// If it is a copy, what that is of.
    pub(super) original: Option<Selection>,
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
}

impl Undo {
    /// To undo a copy is to have it no more.
    pub(super) fn of_copy(selection: Selection, original: Selection) -> Self {
        Self {
            selection,
            original: Some(original),
            property: None,
            at: Instant::now(),
            transform: None,
            pose: None,
            light: None,
            material: None,
            hidden: false,
        }
    }
}

/// Remembers how it is now.
pub(super) fn remember(world: &World, editor: &mut Editor, selection: Selection, property: Option<Property>) {
    let now = Instant::now();
    if let Some(last) = editor.undo.last_mut().filter(|_| property.is_some())
        && (last.selection, last.property) == (selection, property)
        && now - last.at < ONE_STEP
    {
        last.at = now;
        return;
    }
    let Selection { entity, slot } = selection;
    let material = material_of(world, entity, slot);
    editor.undo.push(Undo {
        selection,
        original: None,
        property,
        at: now,
        transform: world.get::<Transform>(entity).copied(),
        pose: world.get::<Pose>(entity).copied(),
        light: world.get::<Light>(entity).cloned(),
        material: material.and_then(|m| Some((m, world.get::<Material>(m)?.clone()))),
        hidden: world.get::<Hidden>(entity).is_some(),
    });
}

pub(super) fn undo(world: &mut World, editor: &mut Editor) {
    let Some(last) = editor.undo.pop() else { return say(world, "nothing to undo") };
    let entity = last.selection.entity;
    if let Some(original) = last.original {
        editor.copies.retain(|(copy, _)| *copy != entity);
        editor.edited.retain(|(edited, _)| *edited != entity);
        world.despawn(entity);
        crate::app::propagate(world);
        editor.selected = Some(original);
        return forget(editor);
    }
    // What an animation has moved since stays where that put it.
    if let Some(transform) = last.transform
        && world.get::<Pose>(entity).copied() == last.pose
        && let Some(mut now) = world.get_mut::<Transform>(entity)
    {
        now.set_if_neq(transform);
    }
    if let Some(light) = last.light
        && let Some(mut now) = world.get_mut::<Light>(entity)
    {
        now.set_if_neq(light);
    }
    if let Some((material, value)) = last.material
        && let Some(mut now) = world.get_mut::<Material>(material)
    {
        now.set_if_neq(value);
    }
    if let Ok(mut entity) = world.get_entity_mut(entity) {
        match (last.hidden, entity.contains::<Hidden>()) {
            (true, false) => drop(entity.insert(Hidden)),
            (false, true) => drop(entity.remove::<Hidden>()),
            _ => {}
        }
    }
    crate::app::propagate(world);
    editor.selected = Some(last.selection);
    forget(editor);
}

/// With all of it undone, nothing was edited.
fn forget(editor: &mut Editor) {
    if editor.undo.is_empty() {
        editor.edited.clear();
    }
}
