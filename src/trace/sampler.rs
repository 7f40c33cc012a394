//! Randomness as a function: (pixel, sample index, dimension, seed) → numbers in [0, 1).
//!
//! Each pair of dimensions is a (0, 2)-sequence of its own: the first two dimensions of Sobol',
//! shuffled and scrambled by hashed Owen permutations.
//!
//! References: B. Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020; the permutation
//! with better constants is N. Vegdahl's ("Building a Better LK Hash", psychopath.io, 2021).

use super::{RenderSettings, Sampling};
use glam::{UVec2, Vec2};

/// The numbers of one sample of one pixel.
///
/// Even and odd samples draw from two independent sequences, one for each half of the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampler {
    seed: u32,
    index: u32,
    /// Of pair 0, the place in the pixel.
    pixel_sampling: Sampling,
    /// Of all other pairs.
    sampling: Sampling,
}

impl Sampler {
    /// Sample number `index` of `pixel`; `seed` chooses another picture's worth of noise.
    #[must_use]
    pub fn new(pixel: UVec2, index: u32, seed: u32) -> Self {
        Self {
            seed: pixel_seed(pixel, index & 1, seed),
            index: index >> 1,
            pixel_sampling: Sampling::Sobol,
            sampling: Sampling::Sobol,
        }
    }

    /// Those of the even and of the odd samples of a pixel, to be taken from by [`Sampler::at`].
    #[must_use]
    pub fn halves(pixel: UVec2, settings: &RenderSettings) -> [Self; 2] {
        [0, 1].map(|half| Self::new(pixel, half, settings.seed).spread(settings))
    }

    /// [`Sampler::halves`] of all pixels of a tile, row by row.
    pub fn tile(origin: UVec2, size: UVec2, settings: &RenderSettings, mut report: impl FnMut([Self; 2])) {
        let like = Self::new(origin, 0, settings.seed).spread(settings);
        let halves = [0, 1].map(|half| hash(settings.seed ^ hash(half ^ 0x5bd1_e995)));
        for y in origin.y..origin.y + size.y {
            let [even, odd] = halves.map(|half| hash(y ^ half));
            for x in origin.x..origin.x + size.x {
                report([Self { seed: hash(x ^ even), ..like }, Self { seed: hash(x ^ odd), ..like }]);
            }
        }
    }

    /// Sample number `index` of the same pixel and half.
    #[must_use]
    pub fn at(self, index: u32) -> Self {
        Self { index: index >> 1, ..self }
    }

    /// Number `member` of `members` samplers of this sample, which together over all samples are as even as those of
    /// one pixel. They repeat after 2³² numbers.
    #[must_use]
    pub fn shared(self, member: u32, members: u32) -> Self {
        Self { seed: hash(self.seed ^ 0x2545_f491), ..self.member([member, members]) }
    }

    /// Number `member` of `members` samples of lights that this sample takes: over all samples they are one sequence, if a pair is
    /// always asked for with the same number of members.
    #[must_use]
    pub fn member(self, member: [u32; 2]) -> Self {
        Self { index: member_index(self.index, member), ..self }
    }

    /// The same, its numbers spread as `settings` say.
    #[must_use]
    pub fn spread(self, settings: &RenderSettings) -> Self {
        let sampling = settings.sampling;
        Self { sampling, pixel_sampling: settings.pixel_sampling.unwrap_or(sampling), ..self }
    }

    /// Two numbers in [0, 1), stratified together over the samples of this pixel.
    #[must_use]
    pub fn pair(&self, dimension: u32) -> Vec2 {
        let seed = hash(self.seed ^ dimension.wrapping_mul(0x9e37_79b9));
        let (x_seed, y_seed) = (hash(seed ^ 0x68bc_21eb), hash(seed ^ 0x02e5_be93));
        let (x, y) = match if dimension == 0 { self.pixel_sampling } else { self.sampling } {
            Sampling::Sobol => return sobol(self.seed, self.index, dimension),
            Sampling::Shifted => {
                // Shuffled all the same: otherwise all pairs would be the same points.
                let index = owen_scramble(self.index, seed);
                (index.reverse_bits().wrapping_add(x_seed), sobol_1(index).wrapping_add(y_seed))
            }
            Sampling::Independent => (hash(x_seed ^ hash(self.index)), hash(y_seed ^ hash(self.index))),
            Sampling::Stratified => {
                let cell = shuffle_16(self.index & 15, hash(seed ^ hash(self.index >> 4)));
                let within = |seed| hash(seed ^ hash(self.index)) >> 2;
                (cell << 30 | within(x_seed), cell >> 2 << 30 | within(y_seed))
            }
        };
        Vec2::new(unit_float(x), unit_float(y))
    }

    /// A number in [0, 1) that depends on `key` and `salt` without any stratification. Keys that differ by as much
    /// as salts do (neighbouring triangles, two bounces) still have numbers of their own.
    #[must_use]
    pub fn hashed(&self, key: u32, salt: u32) -> f32 {
        unit_float(hash(hash(hash(self.seed ^ key).wrapping_add(salt)) ^ self.index))
    }
}

/// [`Sampler::pair`] of a seed and an index, for [`Sampling::Sobol`].
#[inline(always)]
fn sobol(seed: u32, index: u32, dimension: u32) -> Vec2 {
    let seed = hash(seed ^ dimension.wrapping_mul(0x9e37_79b9));
    let (x_seed, y_seed) = (hash(seed ^ 0x68bc_21eb), hash(seed ^ 0x02e5_be93));
    let index = owen_scramble(index, seed);
    let x = owen_scramble(index.reverse_bits(), x_seed);
    let y = owen_scramble(sobol_1(index), y_seed);
    Vec2::new(unit_float(x), unit_float(y))
}

/// Samplers side by side.
#[derive(Clone, Debug)]
pub struct SamplerRow<const N: usize> {
    seeds: [u32; N],
    indices: [u32; N],
    /// Of any of them: all are of one picture.
    like: Sampler,
}

impl<const N: usize> SamplerRow<N> {
    /// All of them that one.
    #[must_use]
    pub fn new(like: Sampler) -> Self {
        Self { seeds: [like.seed; N], indices: [like.index; N], like }
    }

    /// Puts one in its place; it must be spread as the others are.
    #[inline(always)]
    pub fn set(&mut self, i: usize, sampler: &Sampler) {
        (self.seeds[i], self.indices[i]) = (sampler.seed, sampler.index);
    }

    /// The one at its place.
    #[must_use]
    pub fn get(&self, i: usize) -> Sampler {
        Sampler { seed: self.seeds[i], index: self.indices[i], ..self.like }
    }

    /// [`Sampler::member`] of each.
    #[must_use]
    pub fn members(&self, member: [u32; 2]) -> Self {
        Self { indices: self.indices.map(|index| member_index(index, member)), ..*self }
    }

    /// [`Sampler::pair`] of each.
    #[inline(always)]
    pub fn pairs(&self, dimension: u32, x: &mut [f32; N], y: &mut [f32; N]) {
        let sampling = if dimension == 0 { self.like.pixel_sampling } else { self.like.sampling };
        if sampling == Sampling::Sobol {
            for i in 0..N {
                let pair = sobol(self.seeds[i], self.indices[i], dimension);
                (x[i], y[i]) = (pair.x, pair.y);
            }
        } else {
            for i in 0..N {
                let pair = self.get(i).pair(dimension);
                (x[i], y[i]) = (pair.x, pair.y);
            }
        }
    }
}

fn member_index(index: u32, [member, members]: [u32; 2]) -> u32 {
    index.wrapping_mul(members).wrapping_add(member)
}

fn pixel_seed(pixel: UVec2, half: u32, seed: u32) -> u32 {
    hash(pixel.x ^ hash(pixel.y ^ hash(seed ^ hash(half ^ 0x5bd1_e995))))
}

/// The top 24 bits as a number in [0, 1); never 1, whatever `x` is.
#[must_use]
#[inline(always)]
pub fn unit_float(x: u32) -> f32 {
    (x >> 8) as f32 / (1 << 24) as f32
}

/// An integer hash with good avalanche: C. Wellons' "lowbias32" (nullprogram.com, 2018).
#[must_use]
#[inline(always)]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// A permutation of 0 to 15, chosen by `seed`.
fn shuffle_16(x: u32, seed: u32) -> u32 {
    // Each step can be undone: adding, multiplying by an odd number, folding the high half into the low.
    (0..4).fold(x, |x, round| {
        let key = seed >> (8 * round);
        let x = (x.wrapping_add(key).wrapping_mul(key >> 3 | 1)) & 15;
        x ^ x >> 2
    })
}

/// Owen's nested uniform scrambling of the binary digits of `x`, most significant first.
#[inline(always)]
fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// The second dimension of the Sobol' sequence (the first is the reversed bits of the index).
#[inline(always)]
fn sobol_1(index: u32) -> u32 {
    // The generator matrix is Pascal's triangle modulo 2: bit j of the result, from the top, is the parity
    // of all bits of the index whose number has those of j. Five sweeps, one for each bit of that number.
    let mut x = index;
    x ^= x >> 16 & 0x0000_ffff;
    x ^= x >> 8 & 0x00ff_00ff;
    x ^= x >> 4 & 0x0f0f_0f0f;
    x ^= x >> 2 & 0x3333_3333;
    x ^= x >> 1 & 0x5555_5555;
    x.reverse_bits()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whoever came through one triangle of a sheet must not for that come through the other on the next bounce.
    #[test]
    fn numbers_of_neighbouring_keys_and_salts_are_independent() {
        let sampler = Sampler::new(UVec2::new(3, 5), 0, 7);
        for [near, far] in [[(1, 0), (0, 1)], [(0, 0), (1, 1)], [(2, 1), (3, 0)], [(1, 0), (1, 1)]] {
            let both = |i| {
                let here = sampler.at(2 * i);
                (here.hashed(near.0, near.1) - 0.5) * (here.hashed(far.0, far.1) - 0.5)
            };
            let n = 10_000_u32;
            let covariance = (0..n).map(|i| f64::from(both(i))).sum::<f64>() / f64::from(n);
            // Of independent numbers: 1/12 over the root of their count; five times that.
            assert!(covariance.abs() < 5.0 / 12.0 / f64::from(n).sqrt(), "{near:?} {far:?}: {covariance}");
        }
    }

    #[test]
    fn second_sobol_dimension_is_that_of_the_direction_numbers() {
        for index in 0..4096_u32 {
            let (mut n, mut v, mut expected) = (index, 1u32 << 31, 0);
            while n != 0 {
                if n & 1 == 1 {
                    expected ^= v;
                }
                n >>= 1;
                v ^= v >> 1;
            }
            assert_eq!(sobol_1(index), expected, "at {index}");
        }
    }

    #[test]
    fn a_tile_has_the_samplers_of_its_pixels() {
        let settings =
            RenderSettings { seed: 7, sampling: Sampling::Stratified, ..RenderSettings::default() };
        let (origin, size) = (UVec2::new(16, 8), UVec2::new(5, 3));
        let mut all = Vec::new();
        Sampler::tile(origin, size, &settings, |halves| all.push(halves));
        for (i, halves) in (0..).zip(&all) {
            let pixel = origin + UVec2::new(i % size.x, i / size.x);
            assert_eq!(*halves, Sampler::halves(pixel, &settings));
        }
        assert_eq!(all.len(), 15);
    }

    #[test]
    fn sixteen_stratified_samples_fill_sixteen_cells() {
        let settings = RenderSettings { sampling: Sampling::Stratified, ..RenderSettings::default() };
        for (block, dimension, half) in [(0, 0, 0), (3, 4, 1), (1000, 70, 0)] {
            let mut cells: Vec<u32> = (0..16)
                .map(|i| Sampler::new(UVec2::new(5, 9), 2 * (16 * block + i) + half, 1).spread(&settings))
                .map(|sampler| sampler.pair(dimension) * 4.0)
                .map(|p| p.x as u32 + 4 * p.y as u32)
                .collect();
            cells.sort_unstable();
            assert!(cells.iter().copied().eq(0..16), "{cells:?}");
        }
    }

    #[test]
    fn all_ways_of_sampling_have_the_same_mean_and_differ_in_spread() {
        // ∫ x y over the square is 1/4; its variance with one sample 7/144.
        let spread = |sampling| {
            let settings = RenderSettings { sampling, ..RenderSettings::default() };
            let errors = (0..1000).map(|seed| {
                let of = |i| Sampler::new(UVec2::new(1, 2), i, seed).spread(&settings).pair(4);
                (0..64).map(|i| f64::from(of(i).x * of(i).y)).sum::<f64>() / 64.0 - 0.25
            });
            let (sum, square) = errors.fold((0.0, 0.0), |(s, q), e| (s + e, q + e * e));
            let deviation = (square / 1000.0_f64).sqrt();
            assert!((sum / 1000.0_f64).abs() < 4.5 * deviation / 1000f64.sqrt(), "{sampling:?}: bias");
            deviation
        };
        let independent = spread(Sampling::Independent);
        assert!((independent / (7.0_f64 / 144.0 / 64.0).sqrt() - 1.0).abs() < 0.1, "{independent}");
        let stratified = spread(Sampling::Stratified);
        assert!(stratified < 0.5 * independent && spread(Sampling::Sobol) < 0.5 * stratified);
        assert!(spread(Sampling::Shifted) < 0.5 * independent);
    }
}
