//! Tiles over threads.

use super::integrator::Batch;
use super::{Film, TraceScene};
use rayon::prelude::*;

/// Rays by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct RayCounts {
    /// From the eye.
    pub camera: u64,
    /// Toward lights: only whether something is in the way.
    pub shadow: u64,
    /// From surface to surface.
    pub bounce: u64,
}

impl RayCounts {
    /// All of them.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.camera + self.shadow + self.bounce
    }
}

impl std::ops::Add for RayCounts {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            camera: self.camera + other.camera,
            shadow: self.shadow + other.shadow,
            bounce: self.bounce + other.bounce,
        }
    }
}

/// Samples per pixel that are followed together: more would only need more memory (at 32 and 16 × 16
/// pixels a thread's buffers take about 2 MB).
const BATCH_SAMPLES: u32 = 32;

/// Brings all tiles to sample index `until`, `step` samples at a time, as long as `keep_going`.
///
/// It is asked before each tile. Tiles behind the others come first, so that a pass that was broken
/// off is finished before the next begins. The picture does not depend on the number of threads.
pub fn trace_pass(
    scene: &TraceScene,
    film: &mut Film,
    until: u32,
    step: u32,
    keep_going: impl Fn() -> bool + Sync,
) -> RayCounts {
    let size = film.size();
    let behind = film.tiles().iter().map(|t| t.next_sample).min().unwrap_or(until);
    let goal = behind.saturating_add(step.max(1)).min(until);
    film.tiles_mut()
        .par_iter_mut()
        .filter(|tile| tile.next_sample < goal)
        .map_init(Batch::default, |batch, tile| {
            let mut rays = RayCounts::default();
            if keep_going() {
                while tile.next_sample < goal {
                    let count = (goal - tile.next_sample).min(BATCH_SAMPLES);
                    batch.render(scene, tile, size, count, &mut rays);
                }
            }
            rays
        })
        .reduce(RayCounts::default, |a, b| a + b)
}
