//! What was edited, as a settings file that `render` reads.

use super::super::controls::Notice;
use super::super::flags::{camera_flags, part_flags};
use super::Editor;
use crate::image::Display;
use crate::load::SceneSource;
use crate::load::settings::edit::{EditTable, LightEdit, MaterialEdit, rows_of};
use crate::open::SceneOrigin;
use crate::scene::path::path_of;
use crate::scene::{ActiveCamera, Camera, GlobalTransform, Hidden, Lens, Light, Material, Transform};
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
    let (edited, copies) = editor.edited();
    let origin = world.resource::<RenderOrigin>().0.map(|origin| origin.to_array());
    let mut tables = vec![EditTable { origin, ..EditTable::default() }];
    tables.extend(copies.iter().map(|&(copy, original)| EditTable {
        entity: path_of(world, copy),
        copy_of: Some(path_of(world, original)),
        ..EditTable::default()
    }));
    for &(entity, slot) in edited {
        let material = super::property::material_of(world, entity, slot);
        let material = material.and_then(|m| world.get::<Material>(m)).map(MaterialEdit::of);
        tables.push(EditTable {
            entity: path_of(world, entity),
            origin: None,
            copy_of: None,
            matrix: world.get::<Transform>(entity).map(rows_of),
            hidden: Some(world.get::<Hidden>(entity).is_some()),
            light: world.get::<Light>(entity).map(LightEdit::of),
            slot: material.is_some().then_some(slot),
            material,
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
    Ok((text + &edits(world, editor)?, folder))
}

/// The edits alone.
///
/// # Errors
/// What cannot be written down.
pub fn edits(world: &World, editor: &Editor) -> Result<String, String> {
    toml::to_string(&Tables { edit: tables(world, editor) }).map_err(|error| error.to_string())
}

/// Writes the first of `{scene}.edits_1.toml`, `_2` … that is not there, and says how to render it.
#[must_use]
pub fn save(world: &World, editor: &Editor) -> Notice {
    match write(world, editor) {
        Ok(said) => Notice::Print(said),
        Err(why) => Notice::Text(format!("not saved: {why}")),
    }
}

fn write(world: &World, editor: &Editor) -> Result<String, String> {
    if editor.edited().0.is_empty() {
        return Err("nothing was edited".to_owned());
    }
    let (text, folder) = text(world, editor)?;
    let origin = world.get_resource::<SceneOrigin>().ok_or("the scene is of no file")?;
    let stem = origin.source.name();
    for n in 1..u32::MAX {
        let path = folder.join(format!("{stem}.edits_{n}.toml"));
        match File::create_new(&path) {
            Ok(mut file) => {
                file.write_all(text.as_bytes()).map_err(|error| format!("{}: {error}", path.display()))?;
                let scene = match &origin.source {
                    SceneSource::File(scene) => scene.display().to_string(),
                    SceneSource::BuiltIn(name) => (*name).to_owned(),
                    SceneSource::Made(made) => made.name.to_owned(),
                };
                let path = path.strip_prefix(".").unwrap_or(&path);
                return Ok(format!("{scene} --scene-settings {} {}", path.display(), look(world)));
            }
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(format!("{}: {error}", path.display())),
        }
    }
    Err("no number is left".to_owned())
}

/// The flags of what the edits may not speak of: part of the file, time, camera and exposure.
fn look(world: &World) -> String {
    let display = world.resource::<Display>();
    let mut flags = format!("--exposure {}", display.exposure);
    for (flag, value) in part_flags(world) {
        // As a shell takes it, whatever the file calls its things.
        let is_plain = value.chars().all(|c| c.is_ascii_alphanumeric() || "._-".contains(c));
        let quoted = if is_plain { value } else { format!("'{}'", value.replace('\'', r"'\''")) };
        flags += &format!(" {flag} {quoted}");
    }
    let active = world.resource::<ActiveCamera>().0;
    if let (Some(camera), Some(pose)) = (world.get::<Camera>(active), world.get::<GlobalTransform>(active)) {
        flags += &format!(" {}", camera_flags(*camera, *pose, world.get::<Lens>(active).copied()));
    }
    flags
}
