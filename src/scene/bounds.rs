//! How large the scene is.

use bevy_ecs::prelude::*;
use glam::DVec3;

/// A ball around what is worth looking at: far outliers are left out.
#[derive(Resource, Clone, Copy, Debug, PartialEq)]
pub struct SceneBounds {
    /// Its centre, in world space.
    pub center: DVec3,
    /// Its radius in scene units, above 0.
    pub radius: f64,
}
