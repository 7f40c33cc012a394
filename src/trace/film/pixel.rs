//! Exact sums of the samples of one pixel.

use super::TILE;
use glam::{DVec3, Vec3};

/// A sum of f32 samples as a multiple of 2⁻⁶⁰.
///
/// Exact for samples that are multiples of it (any f32 above 2⁻³⁶ in magnitude), else rounded to
/// the nearest. Samples must lie below 2³⁵ in magnitude; then 2³² of them fit with room to spare.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sum(i128);

impl Sum {
    const FRACTION_BITS: i32 = 60;
    /// The greatest float below 2³⁵.
    const MOST: f32 = ((1u64 << 35) - (1u64 << 11)) as f32;

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
    /// Adds the linear RGB `radiance` of sample number `index`. False if it was dropped since it is not finite. What is
    /// below −2³⁵ or above 2³⁵, where no sum of light should be, is cut off there: black instead of blinding would be
    /// a worse error.
    #[inline]
    pub fn add(&mut self, index: u32, radiance: Vec3) -> bool {
        if !radiance.to_array().iter().all(|c| c.abs() <= Sum::MOST) {
            return self.add_beyond(index, radiance);
        }
        let half = index as usize & 1;
        for (sum, sample) in self.sums[half].iter_mut().zip(radiance.to_array()) {
            sum.add(sample);
        }
        self.counts[half] += 1;
        true
    }

    /// [`Pixel::add`] of what hardly ever comes.
    #[cold]
    fn add_beyond(&mut self, index: u32, radiance: Vec3) -> bool {
        radiance.is_finite() && self.add(index, Self::cut_off(radiance))
    }

    /// What is added of a finite sample.
    pub(super) fn cut_off(radiance: Vec3) -> Vec3 {
        radiance.clamp(-Vec3::splat(Sum::MOST), Vec3::splat(Sum::MOST))
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

/// One without samples.
pub(super) static EMPTY: [Pixel; (TILE * TILE) as usize] =
    [Pixel { sums: [[Sum(0); 3]; 2], counts: [0; 2] }; (TILE * TILE) as usize];

#[cfg(test)]
mod tests {
    use super::*;

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
