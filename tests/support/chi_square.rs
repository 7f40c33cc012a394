//! A sampler against the density that it claims.
#![allow(dead_code, reason = "each test file uses its part")]
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

use super::stage::Rng;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

pub const CELLS: usize = 16;
pub const SAMPLES: usize = 100_000;
/// At least as many as ask for a χ² in one file; the level of each is such that all together have 1 % (Šidák).
const TESTS: f64 = 200.0;

/// P(Z > z) of the normal distribution, by Simpson's rule.
fn normal_tail(z: f64) -> f64 {
    let n = 2000;
    let h = 12.0 / f64::from(n);
    let f = |i: i32| (-0.5 * (z + f64::from(i) * h).powi(2)).exp();
    let sum: f64 = (0..n / 2).map(|i| f(2 * i) + 4.0 * f(2 * i + 1) + f(2 * i + 2)).sum();
    sum * h / 3.0 / (2.0 * PI).sqrt()
}

/// Panics if `seen` counts are too unlikely under the `expected` ones (Wilson and Hilferty, 1931).
fn chi_square(name: &str, seen: &[f64], expected: &[f64]) {
    let (mut chi2, mut cells, mut rare_seen, mut rare_expected) = (0.0, 0.0f64, 0.0, 0.0);
    for (s, e) in seen.iter().zip(expected) {
        if *e >= 8.0 {
            chi2 += (s - e).powi(2) / e;
            cells += 1.0;
        } else {
            rare_seen += s;
            rare_expected += e;
        }
    }
    if rare_expected >= 8.0 {
        chi2 += (rare_seen - rare_expected).powi(2) / rare_expected;
        cells += 1.0;
    } else {
        assert!(rare_seen <= rare_expected + 30.0, "{name}: {rare_seen} where {rare_expected} are expected");
    }
    assert!(cells > 1.0, "{name}: nothing to compare");
    let k = 2.0 / (9.0 * (cells - 1.0));
    let z = ((chi2 / (cells - 1.0)).cbrt() - (1.0 - k)) / k.sqrt();
    let p = normal_tail(z);
    let level = 1.0 - 0.99f64.powf(1.0 / TESTS);
    println!("{name}: χ² {chi2:.0} of {cells} cells, p = {p:.2e}");
    assert!(p > level, "{name}: χ² {chi2} of {cells} cells, p = {p:e} < {level:e}");
}

/// A sampler against its density, on cells of a unit square that is mapped onto directions.
///
/// `direction` gives the direction at a place of the square and the solid angle per area there;
/// `place` is its inverse.
pub fn sampler_against_density(
    name: &str,
    samples: usize,
    mut sample: impl FnMut(&mut Rng) -> Option<Vec3>,
    density: impl Fn(Vec3) -> f64,
    direction: impl Fn(f64, f64) -> (DVec3, f64),
    place: impl Fn(DVec3) -> (f64, f64),
) {
    let n = CELLS * CELLS;
    // The last cell counts what was not proposed at all.
    let mut seen = vec![0.0; n + 1];
    let mut rng = Rng(12);
    for _ in 0..samples {
        let cell = sample(&mut rng).map_or(n, |wi| {
            let (a, b) = place(wi.as_dvec3());
            let index = |x: f64| ((x * CELLS as f64) as usize).min(CELLS - 1);
            index(a) * CELLS + index(b)
        });
        seen[cell] += 1.0;
    }
    const FINE: usize = 64;
    let mut expected: Vec<f64> = (0..n)
        .map(|cell| {
            let (i, j) = (cell / CELLS, cell % CELLS);
            let mut sum = 0.0;
            for (k, l) in (0..FINE).flat_map(|k| (0..FINE).map(move |l| (k, l))) {
                let at = |i: usize, k: usize| (i as f64 + (k as f64 + 0.5) / FINE as f64) / CELLS as f64;
                let (wi, area) = direction(at(i, k), at(j, l));
                sum += if area > 0.0 { density(wi.as_vec3()) * area } else { 0.0 };
            }
            sum / ((FINE * FINE * CELLS * CELLS) as f64) * samples as f64
        })
        .collect();
    let total: f64 = expected.iter().sum::<f64>() / samples as f64;
    assert!(total < 1.002, "{name}: the density integrates to {total}");
    expected.push((1.0 - total).max(0.0) * samples as f64);
    chi_square(&format!("{name} (∫ = {total:.5})"), &seen, &expected);
}
