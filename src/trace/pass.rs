//! Tiles over threads.

use super::film::Tile;
use super::integrator::{Batch, Work};
use super::{Film, TraceScene, allot, reuse};
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
        let mut shares = allot::shares(film);
        if scene.settings.shares_paths() {
            reuse::even_out(&mut shares, film.size().x as usize);
        }
        film.allot(&shares);
    }
    rays
}

/// Gives the pixels of one colour of the chess board their first sample, if none has any, as long as `keep_going`: where
/// time is short half of the picture everywhere is more than the upper half of it.
pub fn trace_half(scene: &TraceScene, film: &mut Film, keep_going: impl Fn() -> bool + Sync) -> RayCounts {
    let (size, first) = (film.size(), film.first_sample());
    let fresh = film.tiles_mut().par_iter_mut().filter(|tile| !tile.rests() && tile.next_sample == first);
    let look = |batch: &mut Batch, tile: &mut Tile| {
        let mut rays = RayCounts::default();
        // One pixel has no halves.
        let is_one = tile.size.element_product() == 1;
        let work = if is_one { Work::Even { until: first.saturating_add(1) } } else { Work::Half };
        if keep_going() && batch.begin(scene, tile, work) {
            batch.render(scene, tile, size, &mut rays);
        }
        rays
    };
    fresh.map_init(Batch::default, look).reduce(RayCounts::default, |a, b| a + b)
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
    let (allotted, first) = (film.is_allotted(), film.first_sample());
    let beyond = samples.saturating_sub(film.even_samples());
    film.tiles_mut()
        .par_iter_mut()
        .filter(|tile| !tile.rests())
        .map_init(Batch::default, |batch, tile| {
            let mut rays = RayCounts::default();
            loop {
                let work = if allotted {
                    Work::Shares { beyond }
                } else {
                    Work::Even { until: first.saturating_add(samples) }
                };
                if !batch.begin(scene, tile, work) {
                    tile.complete = samples;
                    break;
                }
                if !keep_going() {
                    break;
                }
                batch.render(scene, tile, size, &mut rays);
            }
            rays
        })
        .reduce(RayCounts::default, |a, b| a + b)
}
