//! The accumulated picture: exact sums in two independent halves.
//!
//! Sums are integers, so that addition is associative: the film is the same bit for bit for any
//! thread count, tile order and splitting of the sample range, and never stops growing
//! (an f32 sum of ones stops at 2²⁴). Even samples go to one half, odd samples to the other;
//! the halves are scrambled independently, so their difference measures the error of their mean.

use super::sightlines::Sightlines;
use bevy_ecs::prelude::*;
use glam::{DVec3, UVec2, Vec3};

/// Side of a tile in pixels.
pub const TILE: u32 = 8;

/// A sum of f32 samples as a multiple of 2⁻⁶⁰.
///
/// Exact for samples that are multiples of it (any f32 above 2⁻³⁶ in magnitude), else rounded to
/// the nearest. Samples must lie below 2³⁵ in magnitude; then 2³² of them fit with room to spare.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sum(i128);

impl Sum {
    const FRACTION_BITS: i32 = 60;
    const LIMIT: f32 = (1u64 << 35) as f32;

    #[inline]
    fn add(&mut self, sample: f32) {
        if sample.abs() < 4.0 {
            // A product with a power of two is exact, and what has digits to round is far below 2⁵³.
            let scaled = f64::from(sample) * (1u64 << Self::FRACTION_BITS) as f64;
            let magnitude = (scaled.abs() + 0.5) as i64;
            self.0 += i128::from(if scaled < 0.0 { -magnitude } else { magnitude });
        } else {
            self.add_any(sample);
        }
    }

    /// For all magnitudes.
    #[cold]
    fn add_any(&mut self, sample: f32) {
        let bits = sample.to_bits();
        let exponent = (bits >> 23 & 0xff) as i32;
        let mantissa = i128::from(bits & 0x7f_ffff) | i128::from(exponent != 0) << 23;
        // The sample is mantissa · 2^(max(exponent, 1) − 150).
        let shift = exponent.max(1) - 150 + Self::FRACTION_BITS;
        let magnitude = match shift {
            0.. => mantissa << shift,
            -25..0 => (mantissa + (1 << (-shift - 1))) >> -shift,
            _ => 0,
        };
        self.0 += if sample.is_sign_negative() { -magnitude } else { magnitude };
    }

    fn value(self) -> f64 {
        // Two conversions and a sum: the whole 128 bits at once are a library call.
        let (high, low) = ((self.0 >> 64) as i64 as f64, self.0 as u64 as f64);
        (high * (u64::MAX as f64) + low) / (1u64 << Self::FRACTION_BITS) as f64
    }
}

/// Sums of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pixel {
    sums: [[Sum; 3]; 2],
    counts: [u32; 2],
}

impl Pixel {
    /// Adds the linear RGB `radiance` of sample number `index`. False if it was dropped since it is
    /// not finite, or below −2³⁵ or above 2³⁵, where no sum of light should be.
    #[inline]
    pub fn add(&mut self, index: u32, radiance: Vec3) -> bool {
        // Not `any(> limit)`: a NaN must fail too.
        if !radiance.to_array().iter().all(|c| c.abs() < Sum::LIMIT) {
            return false;
        }
        let half = index as usize & 1;
        for (sum, sample) in self.sums[half].iter_mut().zip(radiance.to_array()) {
            sum.add(sample);
        }
        self.counts[half] += 1;
        true
    }

    /// [`Pixel::add`] of many; returns how many were dropped.
    pub fn add_all(&mut self, samples: impl Iterator<Item = (u32, Vec3)>) -> u64 {
        let (mut all, mut dropped) = (*self, 0);
        for (index, radiance) in samples {
            dropped += u64::from(!all.add(index, radiance));
        }
        *self = all;
        dropped
    }

    /// Mean radiance of all samples; black without any.
    #[must_use]
    pub fn mean(&self) -> DVec3 {
        let [a, b] = &self.sums;
        let count = f64::from(self.counts[0]) + f64::from(self.counts[1]);
        DVec3::from_array([0, 1, 2].map(|c| Sum(a[c].0 + b[c].0).value())) / count.max(1.0)
    }

    /// Mean of one half, 0 (even samples) or 1 (odd samples); `None` without samples.
    #[must_use]
    pub fn half_mean(&self, half: usize) -> Option<DVec3> {
        let count = self.counts[half];
        (count > 0).then(|| DVec3::from_array(self.sums[half].map(Sum::value)) / f64::from(count))
    }

    /// How many samples were added.
    #[must_use]
    pub fn count(&self) -> u64 {
        u64::from(self.counts[0]) + u64::from(self.counts[1])
    }

    /// Sums of both halves and three channels as multiples of 2⁻⁶⁰: all there is to know, for a file.
    #[must_use]
    pub fn sums(&self) -> [[i128; 3]; 2] {
        self.sums.map(|half| half.map(|sum| sum.0))
    }

    /// How many samples each half has.
    #[must_use]
    pub fn counts(&self) -> [u32; 2] {
        self.counts
    }

    /// What [`Pixel::sums`] and [`Pixel::counts`] were taken from; `None` if a sum is larger than so many
    /// samples can make it.
    #[must_use]
    pub fn from_sums(sums: [[i128; 3]; 2], counts: [u32; 2]) -> Option<Self> {
        let possible = |half: usize| {
            let most = u128::from(counts[half]) << (35 + Sum::FRACTION_BITS);
            sums[half].iter().all(|sum| sum.unsigned_abs() <= most)
        };
        (possible(0) && possible(1)).then(|| Self { sums: sums.map(|half| half.map(Sum)), counts })
    }

    /// Adds all samples of `other`, which must be of other indices. Exact, so no order matters.
    pub fn merge(&mut self, other: &Self) {
        for half in 0..2 {
            for (sum, more) in self.sums[half].iter_mut().zip(other.sums[half]) {
                sum.0 += more.0;
            }
            self.counts[half] += other.counts[half];
        }
    }
}

/// A square of the film that one thread works on at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Its top left pixel.
    pub origin: UVec2,
    /// Its size: [`TILE`] except at the right and lower border.
    pub size: UVec2,
    /// Index of the sample that comes next in each of its pixels, but for `more`.
    pub next_sample: u32,
    /// Samples beyond `next_sample` that each pixel has, in rows from the top. Empty before [`Film::allot`].
    pub(super) more: Vec<u32>,
    /// How many each gets for each one that the picture gets on average; as many.
    shares: Vec<f32>,
    /// Samples per pixel of the picture that all have their share of, if they have shares.
    pub(super) complete: u32,
    /// Samples dropped because they were not finite (a defect elsewhere, shown to the user).
    pub dropped: u64,
    /// It gets no samples for now.
    rests: bool,
    /// What the pixels hold is from before the last reset.
    stale: bool,
    /// What is known of its part of the scene until the next reset.
    pub(super) sightlines: Sightlines,
    pixels: Vec<Pixel>,
}

impl Tile {
    /// Whether it gets no samples for now: see [`Film::confine`].
    #[must_use]
    pub fn rests(&self) -> bool {
        self.rests
    }

    /// What [`Tile::more`] is to be of a pixel when it has its share of `beyond` samples.
    #[must_use]
    pub(super) fn goal(&self, pixel: usize, beyond: u32) -> u32 {
        // Saturates; and sample indices end with u32.
        ((f64::from(beyond) * f64::from(self.shares[pixel])).ceil() as u32).min(u32::MAX - self.next_sample)
    }

    /// Index of the sample that comes next in a pixel: what is missing below it was dropped.
    #[must_use]
    pub fn next_of(&self, pixel: usize) -> u32 {
        self.next_sample + self.more.get(pixel).copied().unwrap_or(0)
    }

    /// Rows from the top, to look at.
    pub fn pixels(&self) -> impl Iterator<Item = &Pixel> {
        self.pixels.iter().map(|pixel| if self.stale { &EMPTY } else { pixel })
    }

    /// Rows from the top.
    pub fn pixels_mut(&mut self) -> &mut [Pixel] {
        if std::mem::take(&mut self.stale) {
            self.pixels.fill(Pixel::default());
        }
        &mut self.pixels
    }
}

static EMPTY: Pixel = Pixel { sums: [[Sum(0); 3]; 2], counts: [0; 2] };

/// The accumulated picture.
#[derive(Resource, Clone, Debug, PartialEq)]
pub struct Film {
    size: UVec2,
    first_sample: u32,
    /// Samples of each pixel from which on [`Film::allot`] gives out shares; 0 if it does not.
    even_samples: u32,
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
                let pixels = vec![Pixel::default(); size.element_product() as usize];
                Tile {
                    origin,
                    size,
                    next_sample: first_sample,
                    more: Vec::new(),
                    shares: Vec::new(),
                    complete: 0,
                    dropped: 0,
                    rests: false,
                    stale: false,
                    sightlines: Sightlines::default(),
                    pixels,
                }
            })
            .collect();
        Self { size, first_sample, even_samples: 0, region: None, tiles }
    }

    /// Forgets all samples, in no time: a tile is cleared when it is next worked on.
    pub fn reset(&mut self) {
        let first_sample = self.first_sample;
        self.even_samples = 0;
        for tile in &mut self.tiles {
            tile.next_sample = first_sample;
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
        if tile.stale { &EMPTY } else { &tile.pixels[(y % TILE * tile.size.x + x % TILE) as usize] }
    }

    /// The pixels of row `y`, from the left.
    pub fn row(&self, y: u32) -> impl Iterator<Item = &Pixel> {
        let across = self.size.x.div_ceil(TILE) as usize;
        let tiles = &self.tiles[(y / TILE) as usize * across..][..across];
        tiles.iter().flat_map(move |tile| {
            let first = (y % TILE * tile.size.x) as usize;
            let row = &tile.pixels[first..first + tile.size.x as usize];
            row.iter().map(|pixel| if tile.stale { &EMPTY } else { pixel })
        })
    }

    /// From now on gives each pixel its own share of all samples, of mean 1; `shares` are in rows of the whole picture.
    /// Every pixel must have the same number of samples, one at least.
    ///
    /// A picture stays unbiased only if how many samples a pixel gets does not depend on what they say: so
    /// the share of one pixel is to be found from others.
    pub fn allot(&mut self, shares: &[f32]) {
        self.even_samples = self.complete_samples();
        let across = self.size.x as usize;
        for tile in &mut self.tiles {
            let [x, y, width, height] =
                [tile.origin.x, tile.origin.y, tile.size.x, tile.size.y].map(|n| n as usize);
            tile.shares.clear();
            tile.shares.extend((y..y + height).flat_map(|y| &shares[y * across + x..][..width]));
            tile.more.clear();
            tile.more.resize(width * height, 0);
            tile.complete = self.even_samples;
        }
    }

    /// Whether [`Film::allot`] has given out shares.
    #[must_use]
    pub fn is_allotted(&self) -> bool {
        self.even_samples > 0
    }

    /// Samples that each pixel had before [`Film::allot`]; 0 without it.
    #[must_use]
    pub fn even_samples(&self) -> u32 {
        self.even_samples
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
            let even = u64::from(t.next_sample - self.first_sample) * u64::from(t.size.element_product());
            even + t.more.iter().map(|&n| u64::from(n)).sum::<u64>()
        };
        let pixels: u64 = self.working().map(|t| u64::from(t.size.element_product())).sum();
        self.working().map(of).sum::<u64>() as f64 / pixels as f64
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
    fn no_share_goes_beyond_the_last_index() {
        let mut film = Film::new(UVec2::ONE, u32::MAX - 10);
        film.tiles_mut()[0].next_sample += 4;
        film.allot(&[100.0]);
        let tile = &film.tiles()[0];
        assert_eq!(tile.goal(0, 3), 6);
        assert_eq!(tile.goal(0, u32::MAX), 6);
    }

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

    #[test]
    fn small_samples_are_added_as_all_are() {
        let (mut quick, mut slow) = (Sum::default(), Sum::default());
        let mut bits = 1_u32;
        for _ in 0..1_000_000 {
            bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let sample = f32::from_bits(bits);
            if sample.abs() < 4.0 {
                quick.add(sample);
                slow.add_any(sample);
                assert_eq!(quick, slow, "{sample:e}");
            }
        }
        for sample in [1.5 * 2f32.powi(-60), 0.5 * 2f32.powi(-60), -0.5 * 2f32.powi(-60), 4f32.next_down()] {
            quick.add(sample);
            slow.add_any(sample);
            assert_eq!(quick, slow, "{sample:e}");
        }
    }
}
