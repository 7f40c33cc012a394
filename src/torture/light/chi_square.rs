//! A sampler against the density that it claims.

use crate::torture::Check;
use crate::torture::oracle::Rng;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// A direction for each place of the unit square and the solid angle per area there; and back.
pub struct Map<D, P> {
    /// Direction and solid angle.
    pub direction: D,
    /// Its inverse.
    pub place: P,
}

/// How a sampler is tried.
#[derive(Clone, Copy, Debug)]
pub struct Draws {
    /// How many.
    pub count: u64,
    /// Of what random numbers.
    pub seed: u64,
    /// Cells on a side of the square.
    pub cells: usize,
    /// Places on a side of the square at which the density is asked, a multiple of `cells`.
    pub fine: usize,
    /// The level of significance of all tests together, and how many there are (Z. Šidák, 1967).
    pub level: f64,
    /// See `level`.
    pub tests: u32,
}

/// Sampler against density: χ² of counts in cells of a square that is mapped onto directions, and the density's integral.
pub fn compare(
    what: &str,
    draws: Draws,
    mut sample: impl FnMut(&mut Rng) -> Option<Vec3>,
    density: impl Fn(Vec3) -> f64,
    map: &Map<impl Fn(f64, f64) -> (DVec3, f64), impl Fn(DVec3) -> (f64, f64)>,
) -> Vec<Check> {
    let (side, n) = (draws.cells, draws.cells * draws.cells);
    // The last cell counts what was not proposed at all.
    let mut seen = vec![0.0; n + 1];
    let mut rng = Rng(draws.seed);
    for _ in 0..draws.count {
        let cell = sample(&mut rng).map_or(n, |wi| {
            let (a, b) = (map.place)(wi.as_dvec3());
            let index = |x: f64| ((x * side as f64) as usize).min(side - 1);
            index(a) * side + index(b)
        });
        seen[cell] += 1.0;
    }
    let fine = draws.fine / side;
    let mut expected: Vec<f64> = (0..n)
        .map(|cell| {
            let at = |i: usize, k: usize| (i as f64 + (k as f64 + 0.5) / fine as f64) / side as f64;
            let mut sum = 0.0;
            for (k, l) in (0..fine).flat_map(|k| (0..fine).map(move |l| (k, l))) {
                let (wi, area) = (map.direction)(at(cell / side, k), at(cell % side, l));
                sum += if area > 0.0 { density(wi.as_vec3()) * area } else { 0.0 };
            }
            sum / (fine * side).pow(2) as f64 * draws.count as f64
        })
        .collect();
    let total: f64 = expected.iter().sum::<f64>() / draws.count as f64;
    expected.push((1.0 - total).max(0.0) * draws.count as f64);
    let level = 1.0 - (1.0 - draws.level).powf(1.0 / f64::from(draws.tests));
    vec![
        Check::new(
            format!("{what}: χ², −log₁₀ p"),
            draws.count,
            "samples",
            -tail(chi_square(&seen, &expected)).log10(),
            -level.log10(),
        ),
        // Some samplers propose nothing now and then; none may claim more than all.
        Check::new(format!("{what}: integral beyond 1"), 1, "densities", total - 1.0, 2e-3),
    ]
}

/// χ² as a normal deviate; infinite if something was seen where nothing is expected.
///
/// Reference: E. B. Wilson, M. M. Hilferty, "The Distribution of Chi-Square", PNAS 17, 1931.
#[must_use]
pub fn chi_square(seen: &[f64], expected: &[f64]) -> f64 {
    let (mut sum, mut cells, mut rare_seen, mut rare_expected) = (0.0, 0.0f64, 0.0, 0.0);
    for (s, e) in seen.iter().zip(expected) {
        if *e >= 8.0 {
            sum += (s - e).powi(2) / e;
            cells += 1.0;
        } else {
            rare_seen += s;
            rare_expected += e;
        }
    }
    if rare_expected >= 8.0 {
        sum += (rare_seen - rare_expected).powi(2) / rare_expected;
        cells += 1.0;
    } else if rare_seen > rare_expected + 30.0 {
        return f64::INFINITY;
    }
    if cells < 2.0 {
        // Nothing to compare.
        return f64::INFINITY;
    }
    let k = 2.0 / (9.0 * (cells - 1.0));
    ((sum / (cells - 1.0)).cbrt() - (1.0 - k)) / k.sqrt()
}

/// P(Z > z) of the normal distribution.
#[must_use]
pub fn tail(z: f64) -> f64 {
    if z.is_nan() {
        return f64::NAN;
    }
    if z > 37.0 {
        return 0.0;
    }
    if z < 0.0 {
        return 1.0 - tail(-z);
    }
    // By Simpson's rule, relative to the density at z: small tails keep their digits.
    let n = 2000;
    let h = 12.0 / f64::from(n);
    let f = |i: i32| (-f64::from(i) * h * (z + 0.5 * f64::from(i) * h)).exp();
    let sum: f64 = (0..n / 2).map(|i| f(2 * i) + 4.0 * f(2 * i + 1) + f(2 * i + 2)).sum();
    sum * h / 3.0 / (2.0 * PI).sqrt() * (-0.5 * z * z).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_are_those_of_the_tables() {
        for (z, p) in
            [(0.0, 0.5), (1.96, 0.024_997_9), (-1.0, 0.841_344_7), (4.5, 3.397_673e-6), (10.0, 7.619_853e-24)]
        {
            assert!((tail(z) / p - 1.0).abs() < 1e-6, "{z}: {}", tail(z));
        }
    }

    #[test]
    fn even_counts_pass_and_uneven_ones_do_not() {
        let expected = [1000.0; 16];
        let even: Vec<f64> = (0..16).map(|i| 1000.0 + 30.0 * f64::from(i % 3 - 1)).collect();
        assert!(tail(chi_square(&even, &expected)) > 0.05);
        let uneven: Vec<f64> = (0..16).map(|i| 1000.0 + 100.0 * f64::from(i % 3 - 1)).collect();
        assert!(tail(chi_square(&uneven, &expected)) < 1e-6);
        assert_eq!(tail(chi_square(&[1000.0, 100.0, 1000.0], &[1000.0, 0.0, 1000.0])), 0.0);
    }
}
