//! Says when a file of the scene has changed.

use crate::load::{Stamp, stamp};
use notify::{RecommendedWatcher, RecursiveMode, Watcher};
use std::collections::{BTreeMap, HashSet};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Programs write files in pieces: they are read when none has changed for so long.
pub const PAUSE: Duration = Duration::from_millis(300);

/// Watches the files that a scene is made of, also those that were missing. It watches their folders: programs save by
/// putting another file in the place of the old one.
pub struct SceneWatch {
    files: BTreeMap<PathBuf, Stamp>,
    folders: HashSet<PathBuf>,
    watcher: Option<RecommendedWatcher>,
}

impl SceneWatch {
    /// Calls `changed` from another thread when one of `files` may no longer be as it is known. Where the system cannot
    /// tell, it never does.
    pub fn new(files: BTreeMap<PathBuf, Stamp>, changed: impl Fn() + Send + 'static) -> Self {
        // Also of the folders on the way, for some may be missing.
        let names: HashSet<OsString> =
            files.keys().flat_map(|path| path.iter()).map(OsStr::to_owned).collect();
        let is_ours = move |path: &PathBuf| path.file_name().is_none_or(|name| names.contains(name));
        let watcher = notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
            let Ok(event) = event else { return };
            if !event.kind.is_access() && (event.paths.is_empty() || event.paths.iter().any(&is_ours)) {
                changed();
            }
        });
        let mut watch = Self { files, folders: HashSet::new(), watcher: watcher.ok() };
        watch.cover();
        watch
    }

    /// Whether a file is another than it was when last asked.
    pub fn has_changed(&mut self) -> bool {
        self.cover();
        let mut changed = false;
        for (path, known) in &mut self.files {
            let now = stamp(path);
            // A file that is gone for the moment is about to be replaced.
            if now.is_some() && now != *known {
                *known = now;
                changed = true;
            }
        }
        changed
    }

    /// Watches the folder of each file, or as long as that is missing the nearest one on the way.
    fn cover(&mut self) {
        let Some(watcher) = &mut self.watcher else { return };
        self.folders.retain(|folder| folder.is_dir());
        for path in self.files.keys() {
            let here = Path::new(".");
            let mut folders =
                path.ancestors().skip(1).map(|folder| if folder == Path::new("") { here } else { folder });
            if let Some(folder) = folders.find(|folder| folder.is_dir())
                && self.folders.insert(folder.to_path_buf())
            {
                // One that cannot be watched is not worth a word: F5 still works.
                let _ = watcher.watch(folder, RecursiveMode::NonRecursive);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Receiver, channel};

    /// A watch over these files of a folder of its own, and what it tells.
    fn watched(test: &str, files: &[&str]) -> (PathBuf, SceneWatch, Receiver<()>) {
        let folder = std::env::temp_dir().join(format!("penumbra-watch-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("scene.obj"), "v 0 0 0").unwrap();
        let files = files.iter().map(|name| folder.join(name)).map(|path| (path.clone(), stamp(&path)));
        let (sender, told) = channel();
        let watch = SceneWatch::new(files.collect(), move || {
            let _ = sender.send(());
        });
        (folder, watch, told)
    }

    const PATIENCE: Duration = Duration::from_secs(5);

    #[test]
    fn the_files_of_the_scene_are_watched_and_others_are_not() {
        let (folder, mut watch, told) = watched("others", &["scene.obj"]);
        assert!(!watch.has_changed());
        std::fs::write(folder.join("scene_1.png"), "a screenshot").unwrap();
        assert!(told.recv_timeout(Duration::from_millis(200)).is_err(), "a new picture is none of the scene");
        std::fs::remove_file(folder.join("scene.obj")).unwrap();
        assert!(!watch.has_changed(), "about to be written anew");
        std::fs::write(folder.join("new"), "v 0 0 0 1").unwrap();
        while told.recv_timeout(Duration::from_millis(200)).is_ok() {}
        std::fs::rename(folder.join("new"), folder.join("scene.obj")).unwrap();
        assert!(
            told.recv_timeout(PATIENCE).is_ok(),
            "the system tells of a file put in the place of another"
        );
        assert!(watch.has_changed());
        assert!(!watch.has_changed());
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn what_was_missing_is_noticed_when_it_comes_also_with_its_folders() {
        let (folder, mut watch, told) = watched("missing", &["scene.obj", "a/b/wood.ktx2"]);
        std::fs::create_dir_all(folder.join("a")).unwrap();
        assert!(told.recv_timeout(PATIENCE).is_ok(), "a folder on the way");
        assert!(!watch.has_changed());
        while told.recv_timeout(Duration::from_millis(200)).is_ok() {}
        std::fs::create_dir_all(folder.join("a/b")).unwrap();
        assert!(told.recv_timeout(PATIENCE).is_ok(), "and the next one");
        assert!(!watch.has_changed());
        while told.recv_timeout(Duration::from_millis(200)).is_ok() {}
        std::fs::write(folder.join("a/b/wood.ktx2"), "1").unwrap();
        assert!(told.recv_timeout(PATIENCE).is_ok(), "and the file");
        assert!(watch.has_changed());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
