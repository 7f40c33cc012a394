//! Tiles over threads.

use super::film::{TILE, Tile};
use super::integrator::{Batch, Work};
use super::{FeatureCounts, Film, TraceScene, allot, reuse};
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
    /// What else had to be done for them.
    pub features: FeatureCounts,
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
            features: self.features + other.features,
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
    if film.has_first_shares() {
        return trace_first_shares(scene, film, until, keep_going);
    }
    if film.is_allotted() {
        // Where only a part is refined, the whole picture would have to wait for it.
        let again = scene.settings.shares_again && film.can_allot_again() && film.region().is_none();
        if again && film.complete_samples() >= allot::RIPE {
            return share_out_again(scene, film, keep_going);
        }
        let until = if again { until.min(allot::RIPE) } else { until };
        return trace_pass(scene, film, until, step, keep_going);
    }
    let rays = trace_pass(scene, film, until.min(allot::EVEN), step, keep_going);
    share_out(scene, film);
    rays
}

/// Where there will be time for few samples only, lets the second of a film that has one of each pixel go where that one
/// shows edges, or noise. (Some get many, most none; the third goes to those who then have fewer than [`allot::EVEN`].)
pub fn hurry(scene: &TraceScene, film: &mut Film) {
    // Those who share paths have as many samples, and their noise is everywhere.
    if film.has_one_each() && !scene.settings.shares_paths() {
        film.keep_early();
        film.allot_first(&allot::first_shares(film));
    }
}

/// Two samples per pixel as the very first ask for them, then [`allot::EVEN`] at least for each.
fn trace_first_shares(
    scene: &TraceScene,
    film: &mut Film,
    until: u32,
    keep_going: impl Fn() -> bool + Sync,
) -> RayCounts {
    // Of all tiles, also those that rest: it does not take long.
    let complete = |film: &Film| film.tiles().iter().map(|tile| tile.complete).min();
    let mut rays = RayCounts::default();
    if complete(film) == Some(1) {
        rays = rays + trace_tiles(scene, film, Work::Shares { beyond: 1 }, 2, &keep_going);
    }
    if complete(film) == Some(2) && until > 2 {
        let work = Work::Even { until: film.first_sample().saturating_add(allot::EVEN) };
        rays = rays + trace_tiles(scene, film, work, allot::EVEN, &keep_going);
    }
    if film.end_first_shares() {
        share_out(scene, film);
    }
    rays
}

/// Gives out shares, if it is time.
fn share_out(scene: &TraceScene, film: &mut Film) {
    if !film.is_allotted() && film.complete_samples() == allot::EVEN {
        let shares = evened(scene, film, allot::shares(film));
        film.allot(&shares);
    }
}

/// Gives each pixel the samples by which shares are found anew, and then those.
fn share_out_again(scene: &TraceScene, film: &mut Film, keep_going: impl Fn() -> bool + Sync) -> RayCounts {
    let work = Work::Even { until: film.first_sample().saturating_add(allot::AGAIN) };
    let rays = trace_tiles(scene, film, work, film.complete_samples(), keep_going);
    if film.is_ripe() {
        let shares = evened(scene, film, allot::shares_again(film));
        film.allot_again(&shares);
    }
    rays
}

/// Those who share paths have as many samples.
fn evened(scene: &TraceScene, film: &Film, mut shares: Vec<f32>) -> Vec<f32> {
    if scene.settings.shares_paths() {
        reuse::even_out(&mut shares, film.size().x as usize);
    }
    shares
}

/// Gives the pixels of one colour of the chess board their first sample, if none has any, as long as `keep_going`: where
/// time is short half of the picture everywhere is more than the upper half of it.
pub fn trace_half(scene: &TraceScene, film: &mut Film, keep_going: impl Fn() -> bool + Sync) -> RayCounts {
    let (size, first) = (film.size(), film.first_sample());
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
    // There may not be time for all of them: holes are of one tile.
    let tiles = far_apart(film, 0).into_par_iter().filter(|tile| tile.next_sample == first);
    tiles.map_init(Batch::default, look).reduce(RayCounts::default, |a, b| a + b)
}

/// Tiles side by side that are worked on one after the other, as a power of two: what is near is at hand.
const AT_HAND: u32 = 2;

/// The tiles that are worked on. Before all have a sample, groups of so many that come one after the other are far apart (by the
/// bits of their place, reversed): what there is time for is of the whole picture, and after half the rest is a chess board.
fn far_apart(film: &mut Film, together: u32) -> Vec<&mut Tile> {
    let (is_first, is_for_all) = (film.complete_samples() == 0, film.has_first_shares());
    let mut tiles: Vec<&mut Tile> =
        film.tiles_mut().iter_mut().filter(|tile| is_for_all || !tile.rests()).collect();
    if is_first {
        let spread =
            |number: u32| (0..u32::BITS).map(|bit| u64::from(number >> bit & 1) << (2 * bit)).sum::<u64>();
        tiles.sort_by_cached_key(|tile| {
            let [x, y] = ((tile.origin / TILE) >> together).to_array();
            (spread(x ^ y) | spread(y) << 1).reverse_bits()
        });
    }
    // Each thread has a piece of the list: dealt out, so that all go through the whole picture together.
    let hands = if is_first { rayon::current_num_threads().next_power_of_two() } else { 1 };
    let mut dealt: Vec<Vec<&mut Tile>> =
        (0..hands).map(|_| Vec::with_capacity(tiles.len() / hands + 16)).collect();
    tiles.into_iter().enumerate().for_each(|(i, tile)| dealt[(i >> (2 * together)) % hands].push(tile));
    dealt.into_iter().flatten().collect()
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
    let samples = film.complete_samples().saturating_add(step.max(1)).min(until);
    let work = if film.is_allotted() {
        Work::Shares { beyond: samples.saturating_sub(film.even_samples()) }
    } else {
        Work::Even { until: film.first_sample().saturating_add(samples) }
    };
    trace_tiles(scene, film, work, samples, keep_going)
}

/// Does the work on all tiles, after which they have `samples`.
fn trace_tiles(
    scene: &TraceScene,
    film: &mut Film,
    work: Work,
    samples: u32,
    keep_going: impl Fn() -> bool + Sync,
) -> RayCounts {
    let size = film.size();
    let trace = |batch: &mut Batch, tile: &mut Tile| {
        let mut rays = RayCounts::default();
        while batch.begin(scene, tile, work) {
            if !keep_going() {
                return rays;
            }
            batch.render(scene, tile, size, &mut rays);
        }
        tile.complete = samples;
        rays
    };
    far_apart(film, AT_HAND)
        .into_par_iter()
        .map_init(Batch::default, trace)
        .reduce(RayCounts::default, |a, b| a + b)
}
