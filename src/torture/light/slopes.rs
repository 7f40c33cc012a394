//! S11 and S12: how the error falls, and that it goes on falling.

use super::lamps::quads;
use super::meter::{Ask, Reading, SIGMAS, ours};
use super::shadows::penumbra;
use super::spot::{ALBEDO, Expected, Spot};
use crate::torture::stage::{Estimate, Stage, reds, settings};
use crate::torture::{Case, Check, Effort, Place, Trial};
use crate::trace::{Film, Integrator, RenderSettings, Sampling, TraceScene, trace_pass};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Samples of a pixel at which the error is measured.
pub const COUNTS: [u32; 6] = [4, 16, 64, 256, 1024, 4096];

/// Root mean square error over pixels and seeds at each of [`COUNTS`], each with seeds of its own.
#[must_use]
pub fn errors(
    spot: &Spot,
    sampling: Sampling,
    seeds: u64,
    first: u64,
    meter: &(dyn Fn(&Ask) -> Reading + Sync),
) -> Vec<f64> {
    let exact = match &spot.expected {
        Expected::Value { exact, .. } => exact(spot.point),
        _ => f64::NAN,
    };
    let jobs: Vec<(usize, u64)> = (0..COUNTS.len()).flat_map(|i| (0..seeds).map(move |s| (i, s))).collect();
    let squares: Vec<(usize, f64)> = jobs
        .into_par_iter()
        .map(|(i, s)| {
            let seed = (first + i as u64 * seeds + s) as u32;
            let reading = meter(&Ask { sampling, side: 8, ..Ask::new(spot, COUNTS[i], seed) });
            let square = reading.pixels.iter().map(|p| (p - exact).powi(2)).sum::<f64>();
            (i, square / reading.pixels.len() as f64)
        })
        .collect();
    let of = |i: usize| squares.iter().filter(|(k, _)| *k == i).map(|(_, s)| s).sum::<f64>() / seeds as f64;
    (0..COUNTS.len()).map(|i| of(i).sqrt() / exact).collect()
}

/// Least squares through logarithms of errors over [`COUNTS`].
#[must_use]
pub fn slope(errors: &[f64]) -> f64 {
    let points: Vec<(f64, f64)> =
        COUNTS.iter().zip(errors).map(|(n, e)| (f64::from(*n).ln(), e.ln())).collect();
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |sum, p| (sum.0 + p.0 / n, sum.1 + p.1 / n));
    points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>()
        / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>()
}

/// The slope, steep enough or exactly so, and that the error has not stopped to fall at the end.
#[must_use]
pub fn judge_slope(what: &str, samples: u64, errors: &[f64], wanted: Slope) -> Vec<Check> {
    let slope = slope(errors);
    let mut checks = vec![match wanted {
        Slope::Within(at, off) => Check::new(
            format!("{what}: slope {slope:.3}, off {at}"),
            samples,
            "samples",
            (slope - at).abs(),
            off,
        ),
        Slope::Below(most) => Check::new(format!("{what}: slope"), samples, "samples", slope, most),
    }];
    // A bias would show as an error that stays, unless single precision is reached.
    if let [.., before, last] = errors {
        let floor = 2e-6;
        let ratio = if *last < floor { 0.0 } else { last / before };
        checks.push(Check::new(
            format!("{what}: of the error after four times the samples"),
            1,
            "errors",
            ratio,
            0.6,
        ));
    }
    checks
}

/// What a slope must be.
#[derive(Clone, Copy, Debug)]
pub enum Slope {
    /// That, and no more off than so.
    Within(f64, f64),
    /// That or steeper.
    Below(f64),
}

fn slopes(trial: &Trial<'_>) -> Vec<Check> {
    let spots = [
        ("all of the light seen", quads().swap_remove(0)),
        ("in the penumbra", penumbra(1.0, 9).swap_remove(5)),
    ];
    // Independent samples know their slope; Sobol' points must be much better where all is smooth, and better at an
    // edge. The others: strata lose their advantage beyond 16 samples, a random shift keeps it.
    let wanted = |sampling, spot| match (sampling, spot) {
        (Sampling::Independent, _) => Slope::Within(-0.5, 0.02),
        (Sampling::Stratified, _) => Slope::Below(-0.48),
        (Sampling::Shifted | Sampling::Sobol, 0) => Slope::Below(-0.9),
        (Sampling::Shifted | Sampling::Sobol, _) => Slope::Below(-0.7),
    };
    let seeds = trial.pick(16, 16, 1024);
    let mut checks = Vec::new();
    for (i, (name, spot)) in spots.iter().enumerate() {
        for sampling in [Sampling::Independent, Sampling::Stratified, Sampling::Shifted, Sampling::Sobol] {
            let between = matches!(sampling, Sampling::Stratified | Sampling::Shifted);
            if trial.effort == Effort::Quick && between {
                continue;
            }
            let meter = |ask: &Ask| ours(ask, &|| !trial.interrupted());
            let errors = errors(spot, sampling, seeds, trial.seed * 100_000, &meter);
            if trial.interrupted() {
                return checks;
            }
            let samples = seeds * 64 * COUNTS.iter().map(|n| u64::from(*n)).sum::<u64>();
            checks.extend(judge_slope(
                &format!("{sampling:?}, {name}"),
                samples,
                &errors,
                wanted(sampling, i),
            ));
            trial.tell("S12", format!("{sampling:?}"), 0.5);
        }
    }
    checks
}

/// What a small picture is off by while its samples become more and more.
#[must_use]
pub fn judge_long_run(what: &str, steps: &[(u64, Vec<f64>)], exact: f64) -> Vec<Check> {
    let mut checks = Vec::new();
    let rms = |pixels: &[f64]| {
        (pixels.iter().map(|p| (p / exact - 1.0).powi(2)).sum::<f64>() / pixels.len() as f64).sqrt()
    };
    for (samples, pixels) in steps {
        let off = Estimate::of(pixels).off(exact, 1e-6 * exact);
        checks.push(Check::new(
            format!("{what}: drift, in standard errors"),
            *samples,
            "samples",
            off,
            SIGMAS,
        ));
    }
    // From a quarter of the way on the error falls at least as that of independent samples, with room for chance: of 64
    // pixels' root mean square a standard error is a tenth.
    if let (Some(first), Some(last)) = (steps.get(steps.len() / 2), steps.last()) {
        let fallen = rms(&last.1) / rms(&first.1) * (last.0 as f64 / first.0 as f64).sqrt();
        let fallen = if rms(&last.1) < 1e-6 { 0.0 } else { fallen };
        let what = format!("{what}: error beside that of independent samples");
        checks.push(Check::new(what, 1, "pictures", fallen, 1.6));
    }
    checks
}

fn long_run(trial: &Trial<'_>) -> Vec<Check> {
    let spots = penumbra(1.0, 9);
    let spot = &spots[5];
    let Expected::Value { exact, .. } = &spot.expected else { return Vec::new() };
    let exact = exact(spot.point);
    // A pixel: 2¹⁴, or 10⁷.
    let most = trial.pick(1 << 14, 1 << 14, 10_000_000) as u32;
    let mut checks = Vec::new();
    for sampling in [Sampling::Independent, Sampling::Sobol] {
        let chosen = RenderSettings {
            shafts: false,
            sampling,
            seed: trial.seed as u32,
            ..settings(8, 8, Integrator::Direct, 1)
        };
        let mut stage = Stage::new(chosen);
        spot.set(&mut stage, Place::ORIGIN);
        stage.app.build();
        let scene: TraceScene = stage.scene();
        // Four films, so that both cores have work; each of other pixels' noise.
        let film = |i: u32| {
            let settings = RenderSettings { seed: chosen.seed.wrapping_add(i << 16), ..chosen };
            let scene = TraceScene { settings: &settings, ..scene };
            let mut film = Film::new(settings.size, 0);
            let mut steps = Vec::new();
            let mut until = 1024.min(most);
            loop {
                while film.complete_samples() < until && !trial.interrupted() {
                    trace_pass(&scene, &mut film, until, 1 << 16, || !trial.interrupted());
                    let part = f64::from(film.complete_samples()) / f64::from(most);
                    trial.tell("S11", format!("{} samples a pixel", film.complete_samples()), part);
                }
                let pixels: Vec<f64> = reds(&film).iter().map(|r| r * PI / f64::from(ALBEDO)).collect();
                steps.push((u64::from(until) * 64, pixels));
                if until >= most || trial.interrupted() {
                    return steps;
                }
                until = until.saturating_mul(2).min(most);
            }
        };
        let films: Vec<_> = (0..4u32).into_par_iter().map(film).collect();
        if trial.interrupted() {
            return checks;
        }
        // All films' pixels together.
        let steps = films.into_iter().reduce(|mut all, film| {
            for ((samples, pixels), (more, others)) in all.iter_mut().zip(film) {
                *samples += more;
                pixels.extend(others);
            }
            all
        });
        let what = format!("{sampling:?}, up to {most} a pixel");
        checks.extend(judge_long_run(&what, &steps.unwrap_or_default(), exact));
    }
    super::meter::worst_of_each(checks.into_iter())
}

/// For long.
pub const S11: Case = Case {
    id: "S11",
    title: "a small picture of up to 10⁷ samples a pixel (with --long) neither stalls nor drifts",
    limit: "4.5 standard errors at every doubling; the error falls as 1 / √samples or faster",
    run: long_run,
};

/// Slopes.
pub const S12: Case = Case {
    id: "S12",
    title: "slope of the error over 4 to 4096 samples, by sampler",
    limit: "independent −0.50 ± 0.02; Sobol' below −0.9 where all is seen, below −0.7 in a penumbra",
    run: slopes,
};
