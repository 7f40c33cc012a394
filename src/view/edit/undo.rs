//! How things were before, and back to that.

use super::property::{Property, material_of};
use super::{Editor, Selection, say};
use crate::scene::{Hidden, Light, Material, Pose, Transform};
use bevy_ecs::prelude::*;

/// How things were.
#[derive(Clone, Debug)]
pub(super) struct Undo {
    pub(super) selection: Selection,
    /// Changes of one number in a row are one step.
    pub(super) property: Option<Property>,
    pub(super) transform: Option<Transform>,
    /// Where the animation, if there is one, had put it.
    pub(super) pose: Option<Pose>,
    pub(super) light: Option<Light>,
    pub(super) material: Option<(Entity, Material)>,
    pub(super) hidden: bool,
}

impl Undo {
    /// To undo a copy is to hide it: what it was then is not there.
    pub(super) fn of_copy(selection: Selection) -> Self {
        Self {
            selection,
            property: None,
            transform: None,
            pose: None,
            light: None,
            material: None,
            hidden: true,
        }
    }
}

/// Remembers how it is now.
pub(super) fn remember(world: &World, editor: &mut Editor, selection: Selection, property: Option<Property>) {
    let last = editor.undo.last();
    if property.is_some() && last.is_some_and(|u| (u.selection, u.property) == (selection, property)) {
        return;
    }
    let Selection { entity, slot } = selection;
    let material = material_of(world, entity, slot);
    editor.undo.push(Undo {
        selection,
        property,
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
}
