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
    /// How the random numbers of a pixel are spread.
    pub sampling: Sampling,
    /// The same for the places in the pixel alone; `None`: as all others.
    pub pixel_sampling: Option<Sampling>,
    /// Whether light is computed instead of sampled where nothing can be in its way.
    pub shafts: bool,
    /// Samples of each light that one sample of a pixel takes where the eye looks, at least 1: finding the place costs more
    /// than another look at a light from there. Of lights that are chosen among many, that number squared.
    pub light_samples: u32,
    /// Whether neighbours share what their paths find.
    pub reuse: bool,
    /// Whether light is computed also where something is in its way, by cutting the lamp; only with `shafts`.
    pub cuts: bool,
    /// Whether shares of samples are found anew when more is known.
    pub shares_again: bool,
}

/// As measured: with 1 the squared error in direct light after equal time is 1.5 times as large; with 4 it is larger in the
/// first seconds, and smaller after ten.
pub const LIGHT_SAMPLES: u32 = 2;

impl RenderSettings {
    /// For pixels that get one sample: to find out what is in the way of all of a light would take longer.
    #[must_use]
    pub fn for_single_samples(&self) -> Self {
        Self { shafts: false, light_samples: 1, ..*self }
    }

    /// Whether neighbours share their paths.
    #[must_use]
    pub fn shares_paths(&self) -> bool {
        self.reuse && self.integrator == Integrator::Path && self.max_depth > 1
    }
}

/// How the random numbers of a pixel are spread over its samples. All give the same picture in the end;
/// they differ in how soon.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampling {
    /// Each number by itself: what `rand()` would do. The error falls with the root of the samples.
    Independent,
    /// Sixteen samples of each half at a time in a jittered grid of 4 × 4 cells, one in each.
    Stratified,
    /// [`Sampling::Sobol`] with a random shift in place of the scrambling: as even, but not as random.
    Shifted,
    /// A (0, 2)-sequence, scrambled by Owen's permutations.
    #[default]
    Sobol,
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

impl Integrator {
    /// What the command line calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Path => "path",
        }
    }
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            size: UVec2::new(960, 540),
            integrator: Integrator::Direct,
            max_depth: 8,
            seed: 0,
            filter: None,
            sampling: Sampling::Sobol,
            pixel_sampling: None,
            shafts: true,
            light_samples: LIGHT_SAMPLES,
            reuse: true,
            cuts: true,
            shares_again: true,
        }
    }
}
