//! Says when a file of the scene has changed.

use notify::{RecommendedWatcher, RecursiveMode, Watcher};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Endings of files that scenes are made of.
const ENDINGS: [&str; 16] = [
    "gltf", "glb", "bin", "obj", "mtl", "toml", "png", "jpg", "jpeg", "tga", "bmp", "gif", "webp", "tiff",
    "hdr", "exr",
];
/// Folders beside the scene that are looked into, such as `textures`.
const MOST_FOLDERS: usize = 32;
/// Programs write files in pieces: they are read when none has changed for so long.
pub const PAUSE: Duration = Duration::from_millis(300);

/// Watches the files beside a scene, and in the folders beside it, that were there when it was loaded.
/// What is new there is none of its files.
pub struct SceneWatch {
    files: HashMap<PathBuf, Option<(SystemTime, u64)>>,
    // Watches as long as it lives.
    _watcher: Option<RecommendedWatcher>,
}

impl SceneWatch {
    /// Calls `changed` from another thread when something may have changed around `scene`. Where the system
    /// cannot tell, it never does.
    pub fn new(scene: &Path, changed: impl Fn() + Send + 'static) -> Self {
        let here = match scene.parent() {
            Some(folder) if folder != Path::new("") => folder.to_path_buf(),
            _ => PathBuf::from("."),
        };
        let inner = entries(&here).into_iter().filter(|path| path.is_dir()).take(MOST_FOLDERS);
        let folders: Vec<PathBuf> = std::iter::once(here.clone()).chain(inner).collect();
        let is_part = |path: &PathBuf| {
            let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
            ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str())) && path.is_file()
        };
        let files = folders.iter().flat_map(|folder| entries(folder)).filter(is_part);
        let files = files.map(|path| (path.clone(), state(&path))).collect();
        let watcher = notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
            if event.is_ok_and(|event| !event.kind.is_access()) {
                changed();
            }
        });
        let watcher = watcher.ok().map(|mut watcher| {
            for folder in &folders {
                // One that cannot be watched is not worth a word: F5 still works.
                let _ = watcher.watch(folder, RecursiveMode::NonRecursive);
            }
            watcher
        });
        Self { files, _watcher: watcher }
    }

    /// Whether a file is another than it was when last asked.
    pub fn has_changed(&mut self) -> bool {
        let mut changed = false;
        for (path, known) in &mut self.files {
            let now = state(path);
            // A file that is gone for the moment is about to be replaced.
            if now.is_some() && now != *known {
                *known = now;
                changed = true;
            }
        }
        changed
    }
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut entries: Vec<PathBuf> = entries.take(4096).collect();
    entries.sort();
    entries
}

fn state(path: &Path) -> Option<(SystemTime, u64)> {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.modified().ok()?, metadata.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::channel;

    #[test]
    fn files_that_were_there_are_watched_and_new_ones_are_not() {
        let folder = std::env::temp_dir().join(format!("penumbra-watch-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("textures")).unwrap();
        let [scene, texture] = ["scene.obj", "textures/a.png"].map(|name| folder.join(name));
        std::fs::write(&scene, "v 0 0 0").unwrap();
        std::fs::write(&texture, "1").unwrap();
        let (sender, told) = channel();
        let mut watch = SceneWatch::new(&scene, move || {
            let _ = sender.send(());
        });
        assert!(!watch.has_changed());
        std::fs::write(folder.join("scene_1.png"), "a screenshot").unwrap();
        assert!(!watch.has_changed(), "a new picture is none of the scene");
        while told.recv_timeout(Duration::from_millis(200)).is_ok() {}
        std::fs::write(&texture, "22").unwrap();
        assert!(told.recv_timeout(Duration::from_secs(5)).is_ok(), "the system tells");
        assert!(watch.has_changed());
        assert!(!watch.has_changed());
        std::fs::remove_file(&scene).unwrap();
        assert!(!watch.has_changed(), "about to be written anew");
        std::fs::write(&scene, "v 0 0 0 1").unwrap();
        assert!(watch.has_changed());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
