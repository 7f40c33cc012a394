//! A square of the film.

use super::pixel::{EMPTY, Pixel};
use crate::trace::sightlines::Sightlines;
use glam::{UVec2, Vec3};

/// A square of the film that one thread works on at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Its top left pixel.
    pub origin: UVec2,
    /// Its size: [`TILE`] except at the right and lower border.
    pub size: UVec2,
    /// Index of the sample that comes next in each of its pixels, but for `more`.
    pub next_sample: u32,
    /// Its pixels of the first colour of the chess board have one sample more than that says: see [`trace_half`].
    ///
    /// [`trace_half`]: crate::trace::pass::trace_half
    pub(in crate::trace) half: bool,
    /// Samples beyond `next_sample` that each pixel has, in rows from the top. Empty before shares are given out.
    pub(in crate::trace) more: Vec<u32>,
    /// How many each gets for each one that the picture gets on average; as many.
    pub(super) shares: Vec<f32>,
    /// Samples per pixel of the picture that all have their share of, if they have shares.
    pub(in crate::trace) complete: u32,
    /// The first few samples of each pixel apart from the others, while shares are given out by the very first.
    pub(super) early: Vec<Early>,
    /// Samples dropped because they were not finite (a defect elsewhere, shown to the user).
    pub dropped: u64,
    /// It gets no samples for now.
    pub(super) rests: bool,
    /// What the pixels hold is from before the last reset; or there are none yet.
    pub(super) stale: bool,
    /// What is known of its part of the scene until the next reset.
    pub(in crate::trace) sightlines: Sightlines,
    pub(super) pixels: Vec<Pixel>,
}

/// Sums and numbers of the first few samples of a pixel, by halves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Early {
    sums: [Vec3; 2],
    counts: [u8; 2],
    /// Samples that are still to come, dropped ones too.
    missing: u8,
}

impl Early {
    /// Of a pixel with its very first samples, as far as they were not dropped, and `missing` more to come.
    pub(super) fn new(pixel: &Pixel, missing: u8) -> Self {
        let counts = pixel.counts();
        let sum = |half: usize| pixel.half_mean(half).unwrap_or_default() * f64::from(counts[half]);
        Self {
            sums: [0, 1].map(|half| sum(half).as_vec3()),
            counts: counts.map(|count| count as u8),
            missing,
        }
    }

    /// Means of both halves; `None` if one has no sample.
    pub(super) fn halves(&self) -> Option<[Vec3; 2]> {
        let mean = |half: usize| self.sums[half] / f32::from(self.counts[half]);
        (self.counts[0] > 0 && self.counts[1] > 0).then(|| [mean(0), mean(1)])
    }

    /// Mean of all.
    pub(super) fn mean(&self) -> Vec3 {
        (self.sums[0] + self.sums[1]) / f32::from(self.counts[0] + self.counts[1]).max(1.0)
    }

    fn add_to(&mut self, pixel: &mut Pixel, index: u32, radiance: Vec3) -> bool {
        let is_taken = pixel.add(index, radiance);
        if let Some(missing) = self.missing.checked_sub(1) {
            self.missing = missing;
            if is_taken {
                self.sums[index as usize & 1] += Pixel::cut_off(radiance);
                self.counts[index as usize & 1] += 1;
            }
        }
        is_taken
    }
}

impl Tile {
    /// Whether only pixels of one colour have been looked at.
    #[must_use]
    pub fn is_half(&self) -> bool {
        self.half
    }

    /// Whether it gets no samples for now: see [`Film::confine`].
    #[must_use]
    pub fn rests(&self) -> bool {
        self.rests
    }

    /// What [`Tile::more`] is to be of a pixel when it has its share of `beyond` samples.
    #[must_use]
    pub(in crate::trace) fn goal(&self, pixel: usize, beyond: u32) -> u32 {
        // Rounded up (by hand: `ceil` is a call on old machines); saturates; and sample indices end with u32.
        let share = f64::from(beyond) * f64::from(self.shares[pixel]);
        let below = share as u32;
        let goal = below.saturating_add(u32::from(f64::from(below) < share));
        goal.min(u32::MAX - self.next_sample)
    }

    /// Index of the sample that comes next in a pixel: what is missing below it was dropped.
    #[must_use]
    pub fn next_of(&self, pixel: usize) -> u32 {
        self.next_sample + self.more.get(pixel).copied().unwrap_or(0)
    }

    /// Adds samples to pixel number `index` of its rows; returns how many were dropped.
    pub(in crate::trace) fn add(&mut self, index: usize, samples: impl Iterator<Item = (u32, Vec3)>) -> u64 {
        // Forgets what is from before the last reset.
        self.pixels_mut();
        let pixel = &mut self.pixels[index];
        match self.early.get_mut(index) {
            None => pixel.add_all(samples),
            Some(early) => samples.map(|(at, radiance)| u64::from(!early.add_to(pixel, at, radiance))).sum(),
        }
    }

    /// Rows from the top, to look at.
    pub fn pixels(&self) -> impl Iterator<Item = &Pixel> {
        self.held().iter()
    }

    /// The same: where nobody has worked yet there is no memory that they would be in.
    pub(super) fn held(&self) -> &[Pixel] {
        if self.stale { &EMPTY[..self.size.element_product() as usize] } else { &self.pixels }
    }

    /// Rows from the top.
    pub fn pixels_mut(&mut self) -> &mut [Pixel] {
        if std::mem::take(&mut self.stale) {
            self.pixels.clear();
            self.pixels.resize(self.size.element_product() as usize, Pixel::default());
        }
        &mut self.pixels
    }
}
