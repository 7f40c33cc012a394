//! Edits outlive their world: the scene loaded again is edited as it was, and undoing leads to what its files say now.

use super::save::tables;
use super::undo::remember;
use super::{Editor, Selection};
use crate::load::settings::edit::{Changed, EditTable, change};
use crate::scene::path::{find, path_of};
use bevy_ecs::prelude::*;
use std::sync::Arc;

/// Does to `to`, the scene of `from` loaded again, what was done to `from`. Things are known by their paths, for they
/// are other entities now; edits of what is not there wait until it is.
pub fn carry(from: &World, to: &mut World) {
    let Some(before) = from.get_resource::<Editor>() else { return };
    let saved = Arc::clone(&before.saved);
    let mut editor = Editor { row: before.row, dirty: true, saved, ..Editor::default() };
    for table in tables(from, before) {
        edit_again(to, &mut editor, table);
    }
    editor.selected = before.selected.and_then(|Selection { entity, slot }| {
        Some(Selection { entity: find(to, &path_of(from, entity))?, slot })
    });
    crate::app::propagate(to);
    to.insert_resource(editor);
}

fn edit_again(world: &mut World, editor: &mut Editor, table: EditTable) {
    if table.entity.is_empty() {
        return;
    }
    let slot = table.slot.unwrap_or(0);
    let original = find(world, table.copy_of.as_ref().unwrap_or(&table.entity));
    let Some(original) = original else { return editor.waiting.push(table) };
    let selection = Selection { entity: original, slot };
    if table.copy_of.is_none() {
        // To undo a copy is to have it no more, wherever it was put: one step. A material is not its own.
        let is_of_copy = editor.undo.iter().any(|undo| undo.copies.contains(&original));
        if !is_of_copy || table.material.is_some() {
            remember(world, editor, selection, None);
        }
        editor.note(selection);
    }
    // What does not fit any more, such as the sizes of another kind of light, is as the files say.
    if let Ok(Changed::New(copies)) = change(world, &table) {
        editor.made(world, &copies, slot);
    }
}
