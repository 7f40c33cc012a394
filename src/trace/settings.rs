//! What the picture depends on besides the scene.

use crate::scene::Filter;
use bevy_ecs::prelude::*;
use glam::UVec2;

/// Every field changes the picture, so a change restarts the accumulation.
#[derive(Resource, Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Width and height in pixels, each at least 1.
    pub size: UVec2,
    /// How light is gathered.
    pub integrator: Integrator,
    /// Most bounces on a path from the eye to a light: 0 shows what shines, 1 direct light, and so on.
    /// (Mitsuba counts one more: its edges; Blender one less: its bounces before the last connection.)
    pub max_depth: u32,
    /// Another seed, other noise.
    pub seed: u32,
    /// Overrides the texture filter that the file asks for.
    pub filter: Option<Filter>,
}

/// How light is gathered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Direct light, seen also in mirrors and through glass.
    #[default]
    Direct,
    /// Full global illumination: path tracing with next-event estimation and multiple importance sampling.
    Path,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            size: UVec2::new(960, 540),
            integrator: Integrator::Direct,
            max_depth: 8,
            seed: 0,
            filter: None,
        }
    }
}
