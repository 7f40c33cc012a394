//! Which files a scene is made of: what was read, and what was looked for in vain.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

/// More are not remembered.
const MOST_FILES: usize = 4096;

/// When a file was written last, and how long it is; `None` if there is no file.
pub type Stamp = Option<(SystemTime, u64)>;

/// The files that loading has asked for, each as it was just before. Clones are the same list.
#[derive(Clone, Debug, Default)]
pub struct SceneFiles(Arc<Mutex<BTreeMap<PathBuf, Stamp>>>);

impl SceneFiles {
    /// All of them so far.
    #[must_use]
    pub fn list(&self) -> BTreeMap<PathBuf, Stamp> {
        self.lock().clone()
    }

    /// Adds those of another list, as they were there.
    pub fn extend(&self, others: &Self) {
        let others = others.list();
        self.lock().extend(others);
    }

    /// Looks at all of them anew.
    pub fn refresh(&self) {
        self.lock().iter_mut().for_each(|(path, known)| *known = stamp(path));
    }

    /// Remembers a file that is about to be read, or that would be if it were there.
    pub(super) fn note(&self, path: &Path) {
        let mut files = self.lock();
        if files.len() < MOST_FILES && !files.contains_key(path) {
            files.insert(path.to_path_buf(), stamp(path));
        }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<PathBuf, Stamp>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// How the file is now.
#[must_use]
pub fn stamp(path: &Path) -> Stamp {
    let metadata = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?;
    Some((metadata.modified().ok()?, metadata.len()))
}
