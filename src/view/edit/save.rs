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
use std::collections::HashSet;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

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
    let copied: HashSet<Entity> = editor.undo.iter().flat_map(|undo| undo.copies.iter().copied()).collect();
    for &(entity, slot) in &editor.edited {
        // What is as it was stays whatever the scene's files will say of it. But copies are made of things not edited yet.
        let is_copy = copied.contains(&entity);
        let mut past = editor.undo.iter().filter(|undo| undo.original.is_none() && !is_copy);
        let before = past.clone().find(|undo| undo.selection.entity == entity);
        let of_slot = past.find(|undo| undo.selection == Selection { entity, slot });
        let material = super::property::material_of(world, entity, slot);
        // A copy wears what the original wears: only who changed that means it.
        let as_it_was = material.and_then(|m| {
            let mut known = editor.undo.iter().filter_map(|undo| undo.material.as_ref());
            known.find(|(of, _)| *of == m).map(|(_, before)| before)
        });
        let material = material.and_then(|m| world.get::<Material>(m)).filter(|&material| match is_copy {
            true => as_it_was.is_some_and(|before| before != material),
            false => {
                of_slot.and_then(|undo| undo.material.as_ref()).is_none_or(|(_, before)| before != material)
            }
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

/// The whole settings file: what the scene's own says, and the edits; and the folder that it belongs to, where people look for
/// it, which may be another than this only if no file is named from there.
///
/// # Errors
/// What cannot be read or written down.
pub fn text(world: &World, editor: &Editor) -> Result<(String, Place), String> {
    let origin = world.get_resource::<SceneOrigin>().ok_or("the scene is of no file")?;
    let mut own = origin.options.scene_settings.clone();
    let mut place = Place { folder: PathBuf::from("."), is_free: true };
    if let SceneSource::File(scene) = &origin.source {
        place.folder = folder_of(scene);
        let beside = scene.with_extension("toml");
        own = own.or_else(|| (beside.is_file() && beside != *scene).then_some(beside));
    }
    let mut text = String::new();
    if let Some(own) = own {
        text = std::fs::read_to_string(&own).map_err(|error| format!("{}: {error}", own.display()))?;
        text += "\n";
        // Its textures are named from where it is.
        place = Place { folder: folder_of(&own), is_free: false };
    }
    // Those that the program was started with have not been saved either.
    let before = origin.options.edits.as_deref().unwrap_or_default();
    text = format!("{text}{before}\n{}", edits(world, editor)?);
    Ok((text, place))
}

/// Where a file of edits goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Beside the scene, or beside its own settings file.
    pub folder: PathBuf,
    /// Whether another would do as well: nothing in it is named from there.
    pub is_free: bool,
}

fn folder_of(file: &Path) -> PathBuf {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_path_buf()
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

/// Writes the first of `{scene}.edits_1.toml`, `_2` … that is not there beside the scene, or where the program was started if
/// nobody may write there; and gives the command that renders it as it is seen.
#[must_use]
pub fn save(world: &World, editor: &Editor) -> Notice {
    match write(world, editor) {
        Ok((said, command)) => Notice::Saved(format!("saved {said}"), command),
        Err(why) => Notice::Text(format!("not saved: {why}")),
    }
}

/// What was written where, and the command.
fn write(world: &World, editor: &Editor) -> Result<(String, String), String> {
    let origin = world.get_resource::<SceneOrigin>().ok_or("the scene is of no file")?;
    if !editor.has_edits() && origin.options.edits.is_none() {
        return Err("nothing was edited".to_owned());
    }
    let (text, place) = text(world, editor)?;
    let stem = origin.source.name();
    let here = Path::new(".");
    let (path, why) = there_or_here(&place, here, &stem, &text)?;
    let path = path.strip_prefix(".").unwrap_or(&path);
    // A path may be longer than the window is wide.
    let is_beside =
        |scene: &PathBuf| place.folder != here && path.parent() == Some(folder_of(scene).as_path());
    let said = match &origin.source {
        SceneSource::File(scene) if is_beside(scene) => {
            format!("{} beside the scene", path.file_name().unwrap_or_default().display())
        }
        _ => format!("{}{why}", path.display()),
    };
    let mut command = ["penumbra", "render"].map(str::to_owned).to_vec();
    let scene = match &origin.source {
        SceneSource::File(scene) => absolute(scene),
        other => other.to_string(),
    };
    command.extend([scene, "--scene-settings".to_owned(), absolute(path)]);
    command.extend(look_flags(world));
    Ok((said, shell_line(&command)))
}

/// Writes `text` to a file in its place, or if it cannot be and does not have to be there, `here`; and why so.
fn there_or_here(place: &Place, here: &Path, stem: &str, text: &str) -> Result<(PathBuf, String), String> {
    match numbered(&place.folder, stem, text) {
        Ok(path) => Ok((path, String::new())),
        Err(why) if place.is_free && place.folder != here => {
            let elsewhere = numbered(here, stem, text).map_err(|_| why.clone())?;
            Ok((elsewhere, format!(" where the program was started ({why})")))
        }
        Err(why) => Err(why),
    }
}

/// Writes `text` to the first file of that name whose number is free.
fn numbered(folder: &Path, stem: &str, text: &str) -> Result<PathBuf, String> {
    for n in 1..u32::MAX {
        let path = folder.join(format!("{stem}.edits_{n}.toml"));
        let told = |error: std::io::Error| format!("{}: {error}", path.display());
        match File::create_new(&path) {
            Ok(mut file) => return file.write_all(text.as_bytes()).map(|()| path.clone()).map_err(told),
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(told(error)),
        }
    }
    Err("no number is left".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder that is gone stands for one that nobody may write to: root may write anywhere.
    #[test]
    fn edits_go_elsewhere_if_they_cannot_be_beside_the_scene() {
        let here = std::env::temp_dir().join(format!("penumbra-save-{}", std::process::id()));
        std::fs::create_dir_all(&here).unwrap();
        let place = |folder: PathBuf, is_free| Place { folder, is_free };
        let write = |place: &Place| there_or_here(place, &here, "a", "edits");
        let (first, why) = write(&place(here.clone(), true)).unwrap();
        assert_eq!((first, why.as_str()), (here.join("a.edits_1.toml"), ""));
        let (second, why) = write(&place(here.join("gone"), true)).unwrap();
        assert_eq!(second, here.join("a.edits_2.toml"));
        assert!(why.contains("gone") && why.contains("where the program was started"), "{why}");
        let files = |folder: &Path| std::fs::read_dir(folder).unwrap().count();
        let refused = write(&place(here.join("gone"), false)).unwrap_err();
        assert!(refused.contains("gone") && files(&here) == 2, "{refused}");
        std::fs::remove_dir_all(&here).unwrap();
    }
}
