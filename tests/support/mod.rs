//! What several test files share.
#![allow(dead_code, reason = "each test file uses its part")]

use std::path::PathBuf;

/// The folder of scenes and references that does not belong to the project, or `None`, said by name.
pub fn shared(test: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PENUMBRA_SHARED")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    if path.is_dir() {
        return Some(path);
    }
    eprintln!("skipped: {test} needs ../shared (or PENUMBRA_SHARED), which is not here");
    None
}

/// A fresh folder for the files of one test.
pub fn folder(test: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(test);
    std::fs::create_dir_all(&path).unwrap();
    path
}
