//! S1 to S4: random numbers.

use super::chi_square::{chi_square, tail};
use super::lamps::quads;
use super::meter::{Ask, SIGMAS, larger, ours};
use super::shadows::penumbra;
use super::spot::{Expected, Spot};
use crate::torture::stage::Estimate;
use crate::torture::{Case, Check, Effort, Trial};
use crate::trace::Sampling;
use crate::trace::sampler::{Sampler, hash, unit_float};
use glam::{UVec2, Vec2};
use rayon::prelude::*;

/// Bits to numbers in [0, 1): those near the ends, and all of the 24 bits that f32 holds.
#[must_use]
pub fn below_one(what: &str, number: impl Fn(u32) -> f32 + Sync) -> Check {
    let bits = (0..1u32 << 24).into_par_iter().map(|i| i << 8 | i >> 16);
    let ends = [0, 1, 0x7fff_ffff, 0x8000_0000, 0xffff_ff7f, 0xffff_ff80, 0xffff_fffe, u32::MAX];
    let wrong = |x: &u32| !(0.0..1.0).contains(&number(*x));
    let count = bits.filter(wrong).count() + ends.iter().filter(|x| wrong(x)).count();
    Check::none(what, (1 << 24) + ends.len() as u64, "numbers", count as u64)
}

/// Whether 2ᵐ points fill each elementary interval of area 2⁻ᵐ once: a (0, m, 2)-net, counted in integers.
#[must_use]
pub fn net(what: &str, m: u32, point: impl Fn(u32) -> Vec2) -> Check {
    // 24 bits of each.
    let whole = |p: f32| (p * (1 << 24) as f32) as u32;
    let points: Vec<[u32; 2]> = (0..1 << m).map(point).map(|p| [whole(p.x), whole(p.y)]).collect();
    let mut empty = 0;
    for split in 0..=m {
        let mut filled = vec![false; 1 << m];
        for [x, y] in &points {
            // A shift by 24 leaves nothing.
            let at = (y >> (24 - (m - split)) << split) | x >> (24 - split);
            if let Some(cell) = filled.get_mut(at as usize) {
                *cell = true;
            }
        }
        empty += filled.iter().filter(|filled| !**filled).count() as u64;
    }
    Check::none(what, u64::from(m + 1) << m, "intervals", empty)
}

fn nets(trial: &Trial<'_>) -> Vec<Check> {
    // The pairs of four bounces, and what comes late: the last block of 2³¹ samples of a half.
    let pairs = trial.pick(16, 1 + 4 * 32, 1 + 8 * 32) as u32;
    let m = trial.pick(12, 16, 16) as u32;
    let jobs: Vec<(u32, u32, u32)> = (0..pairs)
        .flat_map(|pair| [0, 1].map(|half| (pair, half)))
        .flat_map(|(pair, half)| [0, 1 << 24, (1u32 << 31) - (1 << m)].map(|first| (pair, half, first)))
        .collect();
    let of = |&(pair, half, first): &(u32, u32, u32)| {
        let seed = trial.seed as u32 ^ hash(pair);
        let point = |i: u32| Sampler::new(UVec2::new(5, 9), (first + i) << 1 | half, seed).pair(pair);
        net(&format!("from sample {first} of a half"), m, point)
    };
    let checks: Vec<Check> = jobs.par_iter().filter(|_| !trial.interrupted()).map(of).collect();
    super::meter::worst_of_each(checks.into_iter())
}

/// Of χ² tests, all together at a level of 1 in 10,000, the one that is furthest from passing.
fn worst_tail(what: &str, each: u64, deviates: &[f64]) -> Check {
    let level = 1.0 - (1.0 - 1e-4f64).powf(1.0 / deviates.len() as f64);
    let worst = deviates.iter().map(|z| -tail(*z).log10()).fold(0.0, larger);
    Check::new(
        format!("{what}: χ², −log₁₀ p"),
        each * deviates.len() as u64,
        "numbers",
        worst,
        -level.log10(),
    )
}

/// One point over many seeds must be anywhere.
#[must_use]
pub fn over_seeds(
    what: &str,
    count: u64,
    first: u64,
    points: &[(u32, u32)],
    at: impl Fn(u32, u32, u32) -> Vec2 + Sync,
) -> Check {
    let deviates: Vec<f64> = points
        .par_iter()
        .flat_map_iter(|&(index, pair)| {
            const CELLS: usize = 10;
            let (mut flat, mut rows) = (vec![0.0; CELLS * CELLS], vec![0.0; 256]);
            for seed in first..first + count {
                let p = at(index, pair, seed as u32);
                let cell = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
                flat[cell(p.x) * CELLS + cell(p.y)] += 1.0;
                rows[((p.x * 256.0) as usize).min(255)] += 1.0;
            }
            [flat, rows].map(|seen| {
                let expected = vec![count as f64 / seen.len() as f64; seen.len()];
                chi_square(&seen, &expected)
            })
        })
        .collect();
    worst_tail(what, count, &deviates)
}

fn scrambling(trial: &Trial<'_>) -> Vec<Check> {
    let points: Vec<(u32, u32)> = [0, 1, 2, 3, 6, 100, 65_535, 1 << 24, u32::MAX]
        .iter()
        .flat_map(|i| [0, 1, 2, 4, 40].map(|p| (*i, p)))
        .collect();
    let count = trial.pick(10_000, 50_000, 10_000_000);
    let at = |index, pair, seed| Sampler::new(UVec2::new(3, 4), index, seed).pair(pair);
    let mut checks = vec![over_seeds("a point over seeds", count, trial.seed * count, &points, at)];
    // And over pixels, of which neighbours have hardly another seed.
    let seed = trial.seed as u32;
    let over_pixels = |index, pair, i: u32| Sampler::new(UVec2::new(i & 255, i >> 8), index, seed).pair(pair);
    checks.push(over_seeds("a point over pixels", count.min(1 << 16), 0, &points, over_pixels));
    // What few samples say is right on average.
    let spot = quads().swap_remove(0);
    for samples in [1, 2, 3, 5, 16] {
        for sampling in [Sampling::Independent, Sampling::Stratified, Sampling::Shifted, Sampling::Sobol] {
            let seeds = trial.pick(1, 8, 1000) / u64::from(samples).div_ceil(4) + 1;
            checks.extend(few_samples(trial, &spot, samples, sampling, seeds));
        }
    }
    checks
}

fn few_samples(trial: &Trial<'_>, spot: &Spot, samples: u32, sampling: Sampling, seeds: u64) -> Vec<Check> {
    let pixels: Vec<f64> = (0..seeds)
        .into_par_iter()
        .flat_map_iter(|i| {
            let seed = (trial.seed * 1000 + i) as u32;
            ours(&Ask { side: 64, sampling, ..Ask::new(spot, samples, seed) }, &|| true).pixels
        })
        .collect();
    // A fifth of the light's spread by one sample, over the root of all.
    let bound = match trial.effort {
        Effort::Quick => 1e-2,
        Effort::Normal => 5e-3,
        Effort::Long => 1e-3,
    };
    let exact = match &spot.expected {
        Expected::Value { exact, .. } => exact(spot.point),
        _ => 0.0,
    };
    unbiased(&format!("{samples} samples, {sampling:?}"), u64::from(samples), &pixels, exact, bound)
}

/// Whether independent estimates are right on average, but for single precision; and known well enough to tell.
#[must_use]
pub fn unbiased(what: &str, samples: u64, estimates: &[f64], exact: f64, bound: f64) -> Vec<Check> {
    let estimate = Estimate::of(estimates);
    let count = samples * estimates.len() as u64;
    let (off, wide) = (estimate.off(exact, 3e-6 * exact), SIGMAS * estimate.sigma / exact);
    vec![
        Check::new(format!("{what}: standard errors off"), count, "samples", off, SIGMAS),
        Check::new(format!("{what}: {SIGMAS} standard errors, relative"), 1, "means", wide, bound),
    ]
}

/// Correlation of what is wrong in pixels of a flat picture, `side` × `side`, with that in others near and far.
#[must_use]
pub fn neighbours(what: &str, side: usize, pixels: &[f64]) -> Check {
    let n = (side * side) as f64;
    let mean = pixels.iter().sum::<f64>() / n;
    let variance = pixels.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / n;
    let mut worst = 0.0f64;
    for (dx, dy) in [(1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (8, 0), (0, 8), (16, 0), (0, 16)] {
        let places = (0..side - dx).flat_map(|x| (0..side - dy).map(move |y| (x, y)));
        let at = |x: usize, y: usize| pixels[y * side + x] - mean;
        let sum: f64 = places.map(|(x, y)| at(x, y) * at(x + dx, y + dy)).sum();
        worst = worst.max((sum / variance / n).abs());
    }
    // A picture without noise has none to correlate: not a number, which keeps no limit.
    let worst = if variance > 0.0 { worst } else { f64::NAN };
    Check::new(format!("{what}: correlation"), n as u64, "pixels", worst, 5.0 / n.sqrt())
}

/// Correlation of what is wrong in pixels of a flat picture with that in the same pixels by the next seed.
#[must_use]
pub fn next_seed(what: &str, this: &[f64], next: &[f64]) -> Check {
    let n = this.len() as f64;
    let off = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / n;
        values.iter().map(|x| x - mean).collect::<Vec<f64>>()
    };
    let (a, b) = (off(this), off(next));
    let sum = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let correlation = sum(&a, &b) / (sum(&a, &a) * sum(&b, &b)).sqrt();
    let what = format!("{what}, with the next seed: correlation");
    Check::new(what, n as u64, "pixels", correlation.abs(), 5.0 / n.sqrt())
}

fn correlation(trial: &Trial<'_>) -> Vec<Check> {
    // The middle of a penumbra: all pixels show the same.
    let spots = penumbra(1.0, 5);
    let spot = &spots[2];
    let side = trial.pick(320, 320, 2000) as u32;
    let mut checks = Vec::new();
    for samples in [1, 2, 16] {
        let seed = trial.seed as u32;
        let picture =
            |seed| ours(&Ask { side, ..Ask::new(spot, samples, seed) }, &|| !trial.interrupted()).pixels;
        let (this, next) = (picture(seed), picture(seed.wrapping_add(1)));
        if trial.interrupted() {
            return checks;
        }
        checks.push(neighbours(&format!("{samples} samples"), side as usize, &this));
        checks.push(next_seed(&format!("{samples} samples"), &this, &next));
        trial.tell("S4", format!("{samples} samples"), 0.5);
    }
    checks
}

/// In [0, 1).
pub const S1: Case = Case {
    id: "S1",
    title: "random bits never become 1.0",
    limit: "0 outside of [0, 1)",
    run: |_| vec![below_one("bits to numbers", unit_float)],
};

/// Nets.
pub const S2: Case = Case {
    id: "S2",
    title: "each pair of dimensions is a (0, 16, 2)-net, early and after 2²⁴ and 2³¹ samples",
    limit: "0 empty elementary intervals",
    run: nets,
};

/// Scrambling.
pub const S3: Case = Case {
    id: "S3",
    title: "scrambling: any point may be anywhere; few samples are right on average",
    limit: "χ²: p > 1e-4 for all together; 4.5 standard errors at 1, 2, 3, 5, 16 samples",
    run: scrambling,
};

/// Correlation.
pub const S4: Case = Case {
    id: "S4",
    title: "the noise of neighbouring pixels and seeds is not correlated",
    limit: "5 / √pixels",
    run: correlation,
};
