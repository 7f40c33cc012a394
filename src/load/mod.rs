//! Files → entities, and a report of what was found, mended, ignored and decided.

use bevy_ecs::prelude::*;
use std::path::PathBuf;

/// Where a scene comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SceneSource {
    /// `.gltf`, `.glb`, `.obj` or `.toml` on disk.
    File(PathBuf),
    /// Name of a scene that is compiled into the program.
    BuiltIn(&'static str),
}

/// What the caller wants from [`load`].
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Sidecar to use instead of the one beside the scene.
    pub scene_settings: Option<PathBuf>,
}

/// What [`load`] found and did.
#[derive(Clone, Debug, Default)]
pub struct LoadReport {
    /// Things in the file that were mended, ignored or approximated, one line each, with their place.
    pub warnings: Vec<String>,
    /// What the program decided because the file is silent (camera, light), one line each.
    pub decisions: Vec<String>,
    /// Cameras by name, in file order.
    pub cameras: Vec<(String, Entity)>,
    /// Triangles of all instances, before degenerate ones are dropped.
    pub triangles: usize,
}

/// x
#[derive(Debug, thiserror::Error)]
#[error("x")]
pub struct LoadError;
/// x
pub fn load(_: &mut World, _: &SceneSource, _: &LoadOptions) -> Result<LoadReport, LoadError> { Err(LoadError) }
