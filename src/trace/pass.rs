//! Tiles over threads.

use super::integrator::Batch;
use super::{Film, TraceScene, allot};
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

/// As [`trace_pass`], but after some even samples more go where there is more noise.
pub fn trace_adaptive(
    scene: &TraceScene,
    film: &mut Film,
    until: u32,
    step: u32,
    keep_going: impl Fn() -> bool + Sync,
) -> RayCounts {
    if film.is_allotted() {
        return trace_pass(scene, film, until, step, keep_going);
    }
    let rays = trace_pass(scene, film, until.min(allot::EVEN), step, keep_going);
    if film.complete_samples() == allot::EVEN {
        let shares = allot::shares(film);
        film.allot(&shares);
    }
    rays
}

/// Brings all tiles to their share of `until` samples per pixel, `step` samples at a time, as long as `keep_going`.
///
/// It is asked before each batch. Tiles behind the others come first, so that a pass that was broken
/// off is finished before the next begins. The picture does not depend on the number of threads.
pub fn trace_pass(
    scene: &TraceScene,
    film: &mut Film,
    until: u32,
    step: u32,
    keep_going: impl Fn() -> bool + Sync,
) -> RayCounts {
    let size = film.size();
    let samples = film.complete_samples().saturating_add(step.max(1)).min(until);
    let even = (!film.is_allotted()).then(|| film.first_sample().saturating_add(samples));
    let goals: Vec<[u32; 2]> = film.tiles().iter().map(|tile| film.goal(tile, samples)).collect();
    film.tiles_mut()
        .par_iter_mut()
        .zip(goals)
        .map_init(Batch::default, |batch, (tile, goals)| {
            let mut rays = RayCounts::default();
            if let Some(goal) = even {
                while tile.next_sample < goal && keep_going() {
                    let count = (goal - tile.next_sample).min(BATCH_SAMPLES);
                    batch.render(scene, tile, size, None, count, &mut rays);
                }
                return rays;
            }
            for (color, goal) in goals.into_iter().enumerate() {
                while tile.more[color] < goal && keep_going() {
                    let count = (goal - tile.more[color]).min(BATCH_SAMPLES);
                    batch.render(scene, tile, size, Some(color), count, &mut rays);
                }
            }
            rays
        })
        .reduce(RayCounts::default, |a, b| a + b)
}
