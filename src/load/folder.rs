//! A folder in place of a scene: which scenes are in it.

use super::error::LoadError;
use super::source::read_file;
use super::{SceneFiles, SceneSource, built_in_scenes};
use std::path::{Path, PathBuf};

/// Folders within folders that are looked into.
const DEEPEST: usize = 8;
/// More files and folders are not looked at: somebody's whole disk is not a folder of scenes.
const MOST_ENTRIES: usize = 100_000;
/// Settings with models are shorter than this, bytes.
const MOST_SETTINGS: u64 = 1 << 20;
/// How many a message names.
const MOST_NAMED: usize = 8;

/// The scene that a file of edits is of, which was saved beside it or, of one that needs no file, where the program was
/// started; and that file.
#[must_use]
pub fn edited_scene(source: &SceneSource) -> Option<(SceneSource, PathBuf)> {
    let SceneSource::File(edits) = source else { return None };
    let (stem, number) = edits.file_name()?.to_str()?.strip_suffix(".toml")?.rsplit_once(".edits_")?;
    number.parse::<u32>().ok()?;
    let endings = ["gltf", "glb", "obj", "toml"];
    let mut scenes = endings.map(|ending| edits.with_file_name(format!("{stem}.{ending}"))).into_iter();
    let built_in = || built_in_scenes().iter().find(|scene| scene.name == stem);
    let scene = match scenes.find(|scene| scene.is_file()) {
        Some(scene) => SceneSource::File(scene),
        None => SceneSource::BuiltIn(built_in()?.name),
    };
    Some((scene, edits.clone()))
}

/// The scenes in a folder and in those below it, by path: `.gltf`, `.glb` and `.obj`, and `.toml` with models. Links to folders
/// are not followed.
#[must_use]
pub fn scenes_in(folder: &Path) -> Vec<PathBuf> {
    scenes_down_to(folder, DEEPEST)
}

fn scenes_down_to(folder: &Path, depth: usize) -> Vec<PathBuf> {
    let (mut found, mut left) = (Vec::new(), MOST_ENTRIES);
    look_into(folder, depth, &mut left, &mut found);
    found.sort();
    found
}

fn look_into(folder: &Path, depth: usize, left: &mut usize, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        if *left == 0 {
            return;
        }
        *left -= 1;
        let (path, is_folder) = (entry.path(), entry.file_type().is_ok_and(|kind| kind.is_dir()));
        if is_folder && depth > 0 {
            look_into(&path, depth - 1, left, found);
        } else if is_scene(&path) {
            found.push(path);
        }
    }
}

fn is_scene(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let is_named_so = matches!(ending.as_deref(), Some("gltf" | "glb" | "obj" | "toml"));
    // macOS leaves such beside the files of archives.
    let is_shadow = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("._"));
    if !is_named_so || is_shadow || !path.is_file() {
        return false;
    }
    let has_models = || {
        let text = read_file(path, MOST_SETTINGS, &SceneFiles::default()).unwrap_or_default();
        text.windows(b"[[model]]".len()).any(|word| word == b"[[model]]")
    };
    ending.as_deref() != Some("toml") || has_models()
}

/// The one scene in a folder: of those in the folder itself or, if there are none, of those further down.
pub(super) fn only_scene(folder: &Path) -> Result<SceneSource, LoadError> {
    let here = scenes_down_to(folder, 0);
    let scenes = if here.is_empty() { scenes_in(folder) } else { here };
    if let [only] = scenes.as_slice() {
        return Ok(SceneSource::File(only.clone()));
    }
    let names: Vec<_> = scenes.iter().take(MOST_NAMED).map(|path| path.to_string_lossy()).collect();
    let names = match scenes.len() {
        0 => "no .gltf, .glb or .obj file is in it".to_owned(),
        count if count > MOST_NAMED => format!("name one of its {count} scenes: {}, ...", names.join(", ")),
        _ => format!("name one of its scenes: {}", names.join(", ")),
    };
    Err(LoadError::Folder { folder: folder.to_string_lossy().into_owned(), names })
}
