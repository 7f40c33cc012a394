//! The accumulated picture: exact sums in two independent halves.
//!
//! Sums are integers, so that addition is associative: the film is the same bit for bit for any
//! thread count, tile order and splitting of the sample range, and never stops growing
//! (an f32 sum of ones stops at 2²⁴). Even samples go to one half, odd samples to the other;
//! the halves are scrambled independently, so their difference measures the error of their mean.

mod pixel;
mod shares;
mod tile;

pub use pixel::Pixel;
pub use tile::Tile;

use super::sightlines::Sightlines;
use bevy_ecs::prelude::*;
use glam::UVec2;
use shares::Stage;

/// Side of a tile in pixels.
pub const TILE: u32 = 8;

/// The accumulated picture.
#[derive(Resource, Clone, Debug, PartialEq)]
pub struct Film {
    size: UVec2,
    first_sample: u32,
    stage: Stage,
    /// See [`Film::confine`].
    region: Option<[UVec2; 2]>,
    tiles: Vec<Tile>,
}

impl Film {
    /// An empty film of `size` pixels whose first sample has index `first_sample`.
    #[must_use]
    pub fn new(size: UVec2, first_sample: u32) -> Self {
        let size = size.max(UVec2::ONE);
        let across = UVec2::new(size.x.div_ceil(TILE), size.y.div_ceil(TILE));
        let tiles = (0..across.y)
            .flat_map(|y| (0..across.x).map(move |x| UVec2::new(x, y) * TILE))
            .map(|origin| {
                let size = (size - origin).min(UVec2::splat(TILE));
                Tile {
                    origin,
                    size,
                    next_sample: first_sample,
                    half: false,
                    more: Vec::new(),
                    shares: Vec::new(),
                    complete: 0,
                    early: Vec::new(),
                    dropped: 0,
                    rests: false,
                    // Memory for all of a large picture takes a second from the system: each tile asks for its own when it is
                    // first worked on, in all threads and with pauses between.
                    stale: true,
                    sightlines: Sightlines::default(),
                    pixels: Vec::new(),
                }
            })
            .collect();
        Self { size, first_sample, stage: Stage::Even, region: None, tiles }
    }

    /// Forgets all samples, in no time: a tile is cleared when it is next worked on.
    pub fn reset(&mut self) {
        let first_sample = self.first_sample;
        self.stage = Stage::Even;
        for tile in &mut self.tiles {
            tile.early.clear();
            tile.next_sample = first_sample;
            tile.half = false;
            tile.more.clear();
            tile.shares.clear();
            tile.dropped = 0;
            tile.stale = true;
            tile.sightlines = Sightlines::default();
        }
    }

    /// Adds all samples of `other`, which must be of other indices and of the same size. If indices are
    /// missing between them, `next_sample` of a tile still says how many there are, but not which is next.
    pub fn merge(&mut self, other: &Self) {
        let first = self.first_sample.min(other.first_sample);
        for (tile, more) in self.tiles.iter_mut().zip(&other.tiles) {
            for (pixel, more) in tile.pixels_mut().iter_mut().zip(more.pixels()) {
                pixel.merge(more);
            }
            let count = (tile.next_sample - self.first_sample) + (more.next_sample - other.first_sample);
            tile.next_sample = first + count;
            tile.dropped += more.dropped;
        }
        self.first_sample = first;
    }

    /// Says that the samples there are, however many in each tile, are those from `first_sample` on.
    pub fn begin_at(&mut self, first_sample: u32) {
        for tile in &mut self.tiles {
            tile.next_sample = (tile.next_sample - self.first_sample) + first_sample;
        }
        self.first_sample = first_sample;
    }

    /// From now on only tiles that touch the rectangle from `min` to `max` (pixels; its end is outside) get samples
    /// and are counted, until this is called again; `None`: all.
    pub fn confine(&mut self, region: Option<[UVec2; 2]>) {
        self.region = region;
        for tile in &mut self.tiles {
            tile.rests = region.is_some_and(|[min, max]| {
                let end = tile.origin + tile.size;
                !(tile.origin.cmplt(max).all() && end.cmpgt(min).all())
            });
        }
        // A film of which nothing is worked on would be complete.
        if self.tiles.iter().all(|tile| tile.rests) {
            self.tiles.iter_mut().for_each(|tile| tile.rests = false);
        }
    }

    /// What it was confined to.
    #[must_use]
    pub fn region(&self) -> Option<[UVec2; 2]> {
        self.region
    }

    fn working(&self) -> impl Iterator<Item = &Tile> {
        self.tiles.iter().filter(|tile| !tile.rests)
    }

    /// Index of the first sample that each pixel gets.
    #[must_use]
    pub fn first_sample(&self) -> u32 {
        self.first_sample
    }

    /// Width and height in pixels.
    #[must_use]
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// All tiles, in rows from the top.
    #[must_use]
    pub fn tiles(&self) -> &[Tile] {
        &self.tiles
    }

    /// All tiles, to work on.
    pub fn tiles_mut(&mut self) -> &mut [Tile] {
        &mut self.tiles
    }

    /// The pixel at `x`, `y` from the top left.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> &Pixel {
        let across = self.size.x.div_ceil(TILE);
        let tile = &self.tiles[(y / TILE * across + x / TILE) as usize];
        &tile.held()[(y % TILE * tile.size.x + x % TILE) as usize]
    }

    /// The pixels of row `y`, from the left.
    pub fn row(&self, y: u32) -> impl Iterator<Item = &Pixel> {
        let across = self.size.x.div_ceil(TILE) as usize;
        let tiles = &self.tiles[(y / TILE) as usize * across..][..across];
        tiles.iter().flat_map(move |tile| {
            let first = (y % TILE * tile.size.x) as usize;
            &tile.held()[first..first + tile.size.x as usize]
        })
    }

    /// Samples that every pixel has its share of.
    #[must_use]
    pub fn complete_samples(&self) -> u32 {
        if self.is_allotted() {
            return self.working().map(|t| t.complete).min().unwrap_or(0);
        }
        self.working().map(|t| t.next_sample).min().unwrap_or(0) - self.first_sample
    }

    /// Samples a pixel has on average.
    #[must_use]
    pub fn mean_samples(&self) -> f64 {
        let of = |t: &Tile| {
            let pixels = u64::from(t.size.element_product());
            let even = u64::from(t.next_sample - self.first_sample) * pixels;
            even + u64::from(t.half) * pixels.div_ceil(2) + t.more.iter().map(|&n| u64::from(n)).sum::<u64>()
        };
        let pixels: u64 = self.working().map(|t| u64::from(t.size.element_product())).sum();
        self.working().map(of).sum::<u64>() as f64 / pixels as f64
    }

    /// The part of the pixels worked on that has samples.
    #[must_use]
    pub fn looked_at(&self) -> f64 {
        // Also those of which every sample was dropped.
        let seen = |tile: &Tile| match tile.next_sample > self.first_sample {
            true => tile.held().len(),
            false => tile.pixels().filter(|pixel| pixel.count() > 0).count(),
        };
        let pixels: usize = self.working().map(|tile| tile.held().len()).sum();
        self.working().map(seen).sum::<usize>() as f64 / pixels as f64
    }

    /// Whether it has pixels that nobody has looked at yet, and all of the picture is wanted.
    #[must_use]
    pub fn has_gaps(&self) -> bool {
        self.complete_samples() == 0 && self.region().is_none()
    }

    /// Samples dropped because they were not finite.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.tiles.iter().map(|t| t.dropped).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_beside_the_region_rest_and_do_not_count() {
        let mut film = Film::new(UVec2::new(32, 24), 0);
        film.confine(Some([UVec2::new(8, 8), UVec2::new(17, 9)]));
        let working: Vec<UVec2> = film.working().map(|tile| tile.origin).collect();
        assert_eq!(working, [UVec2::new(8, 8), UVec2::new(16, 8)]);
        for tile in film.tiles_mut().iter_mut().filter(|tile| !tile.rests()) {
            tile.next_sample += 5;
        }
        assert_eq!((film.complete_samples(), film.mean_samples()), (5, 5.0));
        film.confine(None);
        assert_eq!(film.complete_samples(), 0);
        film.confine(Some([UVec2::splat(100), UVec2::splat(200)]));
        assert_eq!(film.working().count(), 12, "nothing of the film is all of it");
    }
}
