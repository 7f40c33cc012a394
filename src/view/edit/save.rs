//! What was edited, as a settings file that `render` reads.

use super::super::controls::Notice;
use super::super::flags::{absolute, look_flags, shell_line};
use super::{Editor, Selection};
use crate::load::SceneSource;
use crate::load::settings::edit::{EditTable, LightEdit, MaterialEdit, rows_of};
use crate::open::SceneOrigin;
use crate::scene::path::Paths;
use crate::scene::{Hidden, Light, Material, Transform};
use crate::sync::RenderOrigin;
use bevy_ecs::prelude::*;
use serde::Serialize;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;

#[derive(Serialize)]
struct Tables {
    edit: Vec<EditTable>,
}

/// The `[[edit]]` tables of all that was edited; copies first, for others may be copies of them.
#[must_use]
pub fn tables(world: &World, editor: &Editor) -> Vec<EditTable> {
    let mut paths = Paths::new(world);
    let origin = world.resource::<RenderOrigin>().0.map(|origin| origin.to_array());
    let mut tables = vec![EditTable { origin, ..EditTable::default() }];
    tables.extend(editor.copies.iter().map(|&(copy, original)| EditTable {
        entity: paths.of(copy),
        copy_of: Some(paths.of(original)),
        ..EditTable::default()
    }));
    tables.extend(editor.waiting.iter().cloned());
    for &(entity, slot) in &editor.edited {
        // What is as it was stays whatever the scene's files will say of it. But copies are made of things not edited yet.
        let is_copy = editor.copies.iter().any(|&(copy, _)| copy == entity);
        let mut past = editor.undo.iter().filter(|undo| undo.original.is_none() && !is_copy);
        let before = past.clone().find(|undo| undo.selection.entity == entity);
        let of_slot = past.find(|undo| undo.selection == Selection { entity, slot });
        let material = super::property::material_of(world, entity, slot);
        let material = material.and_then(|m| world.get::<Material>(m)).filter(|&material| {
            of_slot.and_then(|undo| undo.material.as_ref()).is_none_or(|(_, before)| before != material)
        });
        let transform = world.get::<Transform>(entity);
        let transform = transform.filter(|&now| before.and_then(|undo| undo.transform) != Some(*now));
        let light = world.get::<Light>(entity);
        let light = light.filter(|&now| before.and_then(|undo| undo.light.as_ref()) != Some(now));
        let hidden = world.get::<Hidden>(entity).is_some();
        tables.push(EditTable {
            entity: paths.of(entity),
            origin: None,
            copy_of: None,
            matrix: transform.map(rows_of),
            hidden: before.is_none_or(|undo| undo.hidden != hidden).then_some(hidden),
            light: light.map(LightEdit::of),
            slot: material.is_some().then_some(slot),
            material: material.map(MaterialEdit::of),
        });
    }
    tables
}

/// The whole settings file: what the scene's own says, and the edits.
///
/// # Errors
/// What cannot be read or written down.
pub fn text(world: &World, editor: &Editor) -> Result<(String, PathBuf), String> {
    let origin = world.get_resource::<SceneOrigin>().ok_or("the scene is of no file")?;
    let mut own = origin.options.scene_settings.clone();
    let mut folder = PathBuf::from(".");
    if let (None, SceneSource::File(scene)) = (&own, &origin.source) {
        let beside = scene.with_extension("toml");
        own = (beside.is_file() && beside != *scene).then_some(beside);
    }
    let mut text = String::new();
    if let Some(own) = own {
        text = std::fs::read_to_string(&own).map_err(|error| format!("{}: {error}", own.display()))?;
        text += "\n";
        // Its textures are named from where it is.
        folder = own.parent().map_or(folder, PathBuf::from);
    }
    // Those that the program was started with have not been saved either.
    let before = origin.options.edits.as_deref().unwrap_or_default();
    text = format!("{text}{before}\n{}", edits(world, editor)?);
    Ok((text, folder))
}

/// The edits alone; empty if there are none.
///
/// # Errors
/// What cannot be written down.
pub fn edits(world: &World, editor: &Editor) -> Result<String, String> {
    if !editor.has_edits() {
        return Ok(String::new());
    }
    toml::to_string(&Tables { edit: tables(world, editor) }).map_err(|error| error.to_string())
}

/// Writes the first of `{scene}.edits_1.toml`, `_2` … that is not there, and gives the command that renders it as it is seen.
#[must_use]
pub fn save(world: &World, editor: &Editor) -> Notice {
    match write(world, editor) {
        Ok((path, command)) => Notice::Saved(format!("saved {path}"), command),
        Err(why) => Notice::Text(format!("not saved: {why}")),
    }
}

/// Where it was written, and the command.
fn write(world: &World, editor: &Editor) -> Result<(String, String), String> {
    let origin = world.get_resource::<SceneOrigin>().ok_or("the scene is of no file")?;
    if !editor.has_edits() && origin.options.edits.is_none() {
        return Err("nothing was edited".to_owned());
    }
    let (text, folder) = text(world, editor)?;
    let stem = origin.source.name();
    for n in 1..u32::MAX {
        let path = folder.join(format!("{stem}.edits_{n}.toml"));
        match File::create_new(&path) {
            Ok(mut file) => {
                file.write_all(text.as_bytes()).map_err(|error| format!("{}: {error}", path.display()))?;
                let path = path.strip_prefix(".").unwrap_or(&path).display().to_string();
                let mut command = ["penumbra", "render"].map(str::to_owned).to_vec();
                let scene = match &origin.source {
                    SceneSource::File(scene) => absolute(scene),
                    other => other.to_string(),
                };
                let settings = absolute(path.as_ref());
                command.extend([scene, "--scene-settings".to_owned(), settings]);
                command.extend(look_flags(world));
                return Ok((path, shell_line(&command)));
            }
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(format!("{}: {error}", path.display())),
        }
    }
    Err("no number is left".to_owned())
}
