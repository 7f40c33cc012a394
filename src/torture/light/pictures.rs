//! S6, S7, S9: pictures that do not depend on what they should not.

use super::chi_square::tail;
use super::lamps::LIMIT;
use super::meter::{Plan, SIGMAS, larger, measure, ours};
use super::oracle;
use super::spot::{ALBEDO, Spot, Thing};
use crate::scene::{Alpha, Glass, Glossy, Light, Material};
use crate::torture::stage::{Estimate, Stage, ball, quad, reds, settings};
use crate::torture::{Case, Check, Effort, Trial};
use crate::trace::allot::{EVEN, RIPE};
use crate::trace::{Film, Integrator, RenderSettings, TraceScene, hurry, trace_adaptive, trace_pass};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;

const HERE: DAffine3 = DAffine3::IDENTITY;

/// Side of the picture of a penumbra, in pixels, and in scene units.
const SIDE: u32 = 48;
const STRIP: f64 = 0.5;

/// A strip across the penumbra under an edge at height 1, of a unit square at height 4: dark, grey, light. Sampled.
#[must_use]
pub fn strip() -> Stage {
    let sampled = RenderSettings { shafts: false, ..settings(SIDE, SIDE, Integrator::Direct, 1) };
    let mut stage = Stage::new(sampled);
    let floor = quad(Vec3::new(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0);
    stage.add_mesh(floor, Material::lambert(Vec3::splat(ALBEDO)), HERE);
    let edge = quad(Vec3::new(-100.0, -100.0, 1.0), Vec3::X * 100.0, Vec3::Y * 200.0);
    stage.add_mesh(edge, Material::default(), HERE);
    let radiance = [Vec3::ONE; 4];
    let lamp = Light::Parallelogram { edge_u: Vec3::X, edge_v: Vec3::Y, radiance, two_sided: true };
    stage.add(lamp, DAffine3::from_translation(DVec3::Z * 4.0));
    stage.look(DVec3::Z * 0.5, DVec3::ZERO, DVec3::Y, STRIP);
    stage.app.build();
    stage
}

/// What the columns of a picture of the strip show on average, by the midpoint rule: the kinks of the closed form are between
/// columns, the eighth of six of them from either side.
#[must_use]
pub fn columns_in_closed_form() -> Vec<f64> {
    const EACH: u32 = 50;
    let (nx, ny) = (SIDE * EACH, 24);
    let radiance = |(i, j): (u32, u32)| {
        let at = |k: u32, n: u32| STRIP * ((f64::from(k) + 0.5) / f64::from(n) - 0.5);
        let p = DVec3::new(at(i, nx), at(j, ny), 0.0);
        let from = (-3.0 * p.x).max(-0.5);
        if from >= 0.5 {
            return 0.0;
        }
        let corner = |x: f64, y: f64| DVec3::new(x, y, 4.0);
        let seen = [corner(from, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(from, 0.5)];
        oracle::polygon(&seen, p, DVec3::Z) * f64::from(ALBEDO) / PI
    };
    let column = |column: u32| {
        let places = (0..EACH).flat_map(|i| (0..ny).map(move |j| (column * EACH + i, j)));
        places.map(radiance).sum::<f64>() / f64::from(EACH * ny)
    };
    (0..SIDE).map(column).collect()
}

/// The means of the columns of a picture of the strip.
#[must_use]
pub fn columns(film: &Film) -> Vec<f64> {
    let pixels = reds(film);
    let side = SIDE as usize;
    (0..side).map(|x| pixels.iter().skip(x).step_by(side).sum::<f64>() / side as f64).collect()
}

/// A film of the strip with more samples where there is more noise, from the second one on if that is in a hurry.
#[must_use]
pub fn adaptively(stage: &Stage, seed: u32, samples: u32, in_a_hurry: bool) -> Film {
    let settings = RenderSettings { seed, ..*stage.scene().settings };
    let scene = TraceScene { settings: &settings, ..stage.scene() };
    let mut film = Film::new(settings.size, 0);
    if in_a_hurry {
        trace_pass(&scene, &mut film, 1, 1, || true);
        hurry(&scene, &mut film);
    }
    while film.complete_samples() < samples {
        trace_adaptive(&scene, &mut film, samples, samples, || true);
    }
    film
}

/// The bias of pictures of many seeds, each by its mean, in standard errors.
#[must_use]
pub fn bias(what: &str, samples: u64, means: &[f64], exact: f64) -> Vec<Check> {
    let estimate = Estimate::of(means);
    let sigmas = estimate.off(exact, 3e-6 * exact);
    let bound = SIGMAS * estimate.sigma / exact;
    vec![
        Check::new(format!("{what}: standard errors off"), samples, "samples", sigmas, SIGMAS),
        Check::new(format!("{what}: {SIGMAS} standard errors, relative"), 1, "means", bound, 1e-3),
    ]
}

/// The bias of each column of pictures of many seeds: what is too dark in dark places is little of the mean. All columns
/// together at a level of 1 in 10,000 (Z. Šidák, 1967).
#[must_use]
pub fn bias_of_columns(what: &str, samples: u64, pictures: &[Vec<f64>], exact: &[f64]) -> Check {
    let off = |(x, exact): (usize, &f64)| {
        let column: Vec<f64> = pictures.iter().map(|picture| picture[x]).collect();
        -(2.0 * tail(Estimate::of(&column).off(*exact, 3e-6 * exact))).log10()
    };
    let worst = exact.iter().enumerate().map(off).fold(0.0, larger);
    let level = 1.0 - (1.0 - 1e-4f64).powf(1.0 / exact.len() as f64);
    Check::new(
        format!("{what}: of {} columns, −log₁₀ p", exact.len()),
        samples,
        "samples",
        worst,
        -level.log10(),
    )
}

fn adaptive(trial: &Trial<'_>) -> Vec<Check> {
    let (stage, by_column) = (strip(), columns_in_closed_form());
    let mean = |columns: &[f64]| columns.iter().sum::<f64>() / columns.len() as f64;
    let exact = mean(&by_column);
    let seeds = trial.pick(320, 400, 100_000);
    let mut checks = Vec::new();
    for (samples, in_a_hurry) in
        [(2, true), (EVEN, true), (8, true), (8, false), (RIPE + 4, false), (64, false)]
    {
        if trial.effort != Effort::Long && samples > RIPE + 4 {
            continue;
        }
        // Pictures of few samples are noisier, and sooner done.
        let seeds = seeds * u64::from(8 / samples.min(8));
        let pictures: Vec<Vec<f64>> = (0..seeds)
            .into_par_iter()
            .filter(|_| !trial.interrupted())
            .map(|i| {
                let seed = (trial.seed * seeds + i) as u32;
                columns(&adaptively(&stage, seed, samples, in_a_hurry))
            })
            .collect();
        if trial.interrupted() {
            return checks;
        }
        let tried = seeds * u64::from(samples * SIDE * SIDE);
        let means: Vec<f64> = pictures.iter().map(|columns| mean(columns)).collect();
        let what = format!("{samples} samples{}", if in_a_hurry { " in a hurry" } else { "" });
        checks.extend(bias(&what, tried, &means, exact));
        checks.push(bias_of_columns(&what, tried, &pictures, &by_column));
        trial.tell("S6", format!("{samples} samples"), 0.5);
    }
    checks
}

/// A bit of everything: glossy, glass, half-transparent, many lights; a size that is no multiple of a tile.
#[must_use]
pub fn bit_of_everything(seed: u32) -> Stage {
    let mut stage = Stage::new(RenderSettings { seed, ..settings(53, 37, Integrator::Path, 5) });
    let place = |x: f64, y: f64, z: f64| DAffine3::from_translation(DVec3::new(x, y, z));
    let glossy = Glossy::Ggx { metallic: 0.3, roughness: 0.4, texture: None };
    let floor = quad(Vec3::new(-3.0, -1.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0);
    stage.add_mesh(floor, Material { glossy, ..Material::default() }, HERE);
    let glass = Some(Glass { ior: 1.5, tint: Vec3::ONE });
    stage.add_mesh(ball(8), Material { glass, ..Material::lambert(Vec3::ZERO) }, place(1.2, 0.0, 0.0));
    let veil = Material { alpha: Alpha::Blend, opacity: 0.5, ..Material::default() };
    stage.add_mesh(ball(8), veil, place(-1.2, 0.0, 0.0));
    for i in 0..12 {
        let light = Light::Sphere { radius: 0.1, radiance: Vec3::splat(5.0) };
        stage.add(light, place(f64::from(i) * 0.4 - 2.0, 2.0, 1.0));
    }
    stage.look_wide(DVec3::new(0.0, 1.5, 4.0), DVec3::ZERO);
    stage.app.build();
    stage
}

/// A film in passes that end at these counts, each of tiles in the order of so many threads.
#[must_use]
pub fn in_passes(stage: &Stage, threads: usize, ends: &[u32]) -> Film {
    let scene = stage.scene();
    let mut film = Film::new(scene.settings.size, 0);
    let mut all = || {
        for &end in ends {
            while film.complete_samples() < end {
                trace_pass(&scene, &mut film, end, end, || true);
            }
        }
    };
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(&mut all),
        Err(_) => all(),
    }
    film
}

/// Pixels of `film` whose sums are others than those of `reference`.
#[must_use]
pub fn differing(what: &str, film: &Film, reference: &Film) -> Check {
    let size = reference.size();
    let places = (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y)));
    let same_size = film.size() == size;
    let other = places.filter(|&(x, y)| !same_size || film.pixel(x, y) != reference.pixel(x, y)).count();
    Check::none(what, u64::from(size.element_product()), "pixels", other as u64)
}

fn determinism(trial: &Trial<'_>) -> Vec<Check> {
    let stage = bit_of_everything(trial.seed as u32);
    let samples = trial.pick(64, 256, 65_536) as u32;
    let reference = in_passes(&stage, 1, &[samples]);
    let mut checks = Vec::new();
    for threads in [2, 3, 8] {
        let film = in_passes(&stage, threads, &[samples]);
        checks.push(differing(&format!("{threads} threads"), &film, &reference));
    }
    let quarter = in_passes(&stage, 2, &[samples / 4, samples]);
    checks.push(differing("a quarter of the samples, then the rest", &quarter, &reference));
    let odd = in_passes(&stage, 2, &[1, 2, 3, 7, 33, samples]);
    checks.push(differing("after 1, 2, 3, 7 and 33 samples", &odd, &reference));
    let again = in_passes(&bit_of_everything(trial.seed as u32), 2, &[samples]);
    checks.push(differing("another world of the same things", &again, &reference));
    // Parts of the samples, each by itself.
    let mut parts: Vec<Film> = [0, samples / 4, samples / 2]
        .into_iter()
        .zip([samples / 4, samples / 2, samples])
        .map(|(from, to)| {
            let scene = stage.scene();
            let mut film = Film::new(scene.settings.size, from);
            while film.complete_samples() < to - from {
                trace_pass(&scene, &mut film, to - from, to, || true);
            }
            film
        })
        .collect();
    if let Some(mut merged) = parts.pop() {
        parts.iter().for_each(|part| merged.merge(part));
        checks.push(differing("three parts, merged backward", &merged, &reference));
    }
    checks
}

/// Light of which single samples bring hundreds of times the mean: who clamps them loses it.
#[must_use]
pub fn fireflies() -> Vec<Spot> {
    let disk = |h: f64| {
        let light = Light::Disk { radius: 1.0, radiance: Vec3::ONE, two_sided: true };
        Spot::new(format!("{h} under a disk"), DVec3::ZERO, DVec3::Z, move |p| {
            oracle::disk(1.0, h - p.z, p.x.hypot(p.y))
        })
        .with(Thing::Light(light, DAffine3::from_translation(DVec3::Z * h)))
        .half(0.01)
    };
    let line = |h: f64| {
        let (a, b) = (DVec3::new(-1.0, 0.0, h), DVec3::new(1.0, 0.0, h));
        let name = format!("{h} under a line");
        Spot::new(name, DVec3::ZERO, DVec3::Z, move |p| oracle::line(a, b, p, DVec3::Z, oracle::Line::Sine))
            .with(super::lamps::line(a, b, crate::scene::Emission::Sine))
            .half(0.001)
    };
    vec![disk(0.1), disk(0.05), line(0.05), line(0.02)]
}

/// No early end.
pub const S6: Case = Case {
    id: "S6",
    title: "more samples where there is more noise: no bias on a penumbra, over 400 to 1,600 seeds",
    limit: "4.5 standard errors, themselves at most 1e-3; each of 48 columns, p > 1e-4 for all together",
    run: adaptive,
};

/// The same.
pub const S7: Case = Case {
    id: "S7",
    title: "threads, passes, parts and their order change no bit of a film",
    limit: "0 pixels",
    run: determinism,
};

/// No clamp.
pub const S9: Case = Case {
    id: "S9",
    title: "bright samples are not clamped: no energy is lost",
    limit: LIMIT,
    run: |trial| {
        let mut spots = fireflies();
        if trial.effort == Effort::Quick {
            spots.retain(|spot| spot.name.starts_with("0.1") || spot.name.starts_with("0.05 under a line"));
        }
        measure(trial, Plan::of("S9"), &spots, &|ask| ours(ask, &|| !trial.interrupted()))
    },
};
