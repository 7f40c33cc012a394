//! S5, S8, S10: what adds samples up, for as long as anybody likes.

use super::meter::{larger, no_light};
use crate::app::FrameBudget;
use crate::load::{LoadOptions, SceneSource, built_in_scenes};
use crate::open::{Wishes, open};
use crate::scene::Light;
use crate::torture::oracle::Rng;
use crate::torture::stage::{Stage, quad, reds, settings};
use crate::torture::{Case, Check, Trial};
use crate::trace::film::Pixel;
use crate::trace::{Film, Integrator};
use glam::{DAffine3, DVec3, UVec2, Vec3};

/// A place where samples add up: a pixel of ours, or in a test something worse.
pub trait Accumulator: Default + Clone {
    /// Adds sample number `index`; false if it is no number and was left out.
    fn add(&mut self, index: u32, sample: f32) -> bool;
    /// Mean of all.
    fn mean(&self) -> f64;
    /// Mean of even and of odd samples.
    fn halves(&self) -> [f64; 2];
    /// Adds all samples of another.
    fn merge(&mut self, other: &Self);
    /// How many there are.
    fn count(&self) -> u64;
}

impl Accumulator for Pixel {
    fn add(&mut self, index: u32, sample: f32) -> bool {
        Self::add(self, index, Vec3::splat(sample))
    }
    fn mean(&self) -> f64 {
        Self::mean(self).x
    }
    fn halves(&self) -> [f64; 2] {
        [0, 1].map(|half| self.half_mean(half).map_or(f64::NAN, |mean| mean.x))
    }
    fn merge(&mut self, other: &Self) {
        Self::merge(self, other);
    }
    fn count(&self) -> u64 {
        Self::count(self)
    }
}

fn relative(what: &str, tried: u64, found: f64, exact: f64) -> Check {
    Check::new(format!("{what}: relative error"), tried, "samples", (found / exact - 1.0).abs(), 1e-12)
}

/// Many small samples and a large one; and the spread of samples far from zero.
#[must_use]
pub fn adding<A: Accumulator>(trial: &Trial<'_>, count: u32) -> Vec<Check> {
    let tried = u64::from(count);
    let Some(mut sum) = added::<A>(trial, count, |_| 0.1) else { return Vec::new() };
    sum.add(count, 1e6);
    let n = f64::from(count);
    let mut checks =
        vec![relative("0.1 and once 1e6", tried + 1, sum.mean(), (f64::from(0.1f32) * n + 1e6) / (n + 1.0))];
    // Ones: f32 stops at 2²⁴.
    let Some(ones) = added::<A>(trial, count, |_| 1.0) else { return checks };
    checks.push(relative("ones", tried, ones.mean(), 1.0));
    // Numbers in [0, 1), multiples of 2⁻²⁴, whose sum integers know.
    let (mut rng, mut whole) = (Rng(trial.seed), 0u64);
    let uniform = added::<A>(trial, count, |_| {
        let bits = rng.bits() >> 8;
        whole += u64::from(bits);
        bits as f32 / (1 << 24) as f32
    });
    let Some(uniform) = uniform else { return checks };
    let exact = whole as f64 / f64::from(1 << 24) / n;
    checks.push(relative("numbers in [0, 1)", tried, uniform.mean(), exact));
    checks.extend(spread::<A>(trial, 1 << 20));
    checks
}

/// So many samples in one pixel; `None` if it was interrupted.
fn added<A: Accumulator>(trial: &Trial<'_>, count: u32, mut sample: impl FnMut(u32) -> f32) -> Option<A> {
    let mut sum = A::default();
    for i in 0..count {
        if i.is_multiple_of(1 << 20) && trial.interrupted() {
            return None;
        }
        sum.add(i, sample(i));
    }
    Some(sum)
}

/// 10,000 ± 0.01, whose variance single precision has below 0. A pixel keeps sums of its even and of its odd samples,
/// and the spread of many pixels' halves is the variance over the samples of a half. So each of 4,096 pixels gets `count` / 4,096
/// samples, and one of them all; every half is compared with sums of whole numbers, of which samples are multiples
/// (2⁻¹⁰: one step of floats there), and the variance with the one that these have.
fn spread<A: Accumulator>(trial: &Trial<'_>, count: u32) -> Vec<Check> {
    const PIXELS: u32 = 4096;
    const STEP: f64 = 1.0 / 1024.0;
    let mut rng = Rng(trial.seed);
    let mut samples = |pixel: &mut A, count: u32| {
        let mut whole = [0i64; 2];
        for i in 0..count {
            // Sums of twelve uniform numbers are normal enough.
            let normal = (0..12).map(|_| f64::from(rng.unit())).sum::<f64>() - 6.0;
            let sample = (1e4 + 0.01 * normal) as f32;
            whole[i as usize & 1] += (f64::from(sample) / STEP) as i64;
            pixel.add(i, sample);
        }
        whole.map(|sum| sum as f64 * STEP / f64::from(count / 2))
    };
    let mut one = A::default();
    let exact = samples(&mut one, count);
    let found = one.halves();
    let off = [0, 1].map(|half| (found[half] / exact[half] - 1.0).abs());
    let mut checks = vec![Check::new(
        "halves of 1e4 ± 0.01: relative error",
        u64::from(count),
        "samples",
        larger(off[0], off[1]),
        1e-12,
    )];
    let (mut found, mut exact) = (0.0, 0.0);
    let each = count / PIXELS;
    for _ in 0..PIXELS {
        if trial.interrupted() {
            return checks;
        }
        let mut pixel = A::default();
        let [a, b] = samples(&mut pixel, each);
        exact += (a - b).powi(2);
        let [a, b] = pixel.halves();
        found += (a - b).powi(2);
    }
    // Of one sample: halves of n / 2 have 4 / n of it between them.
    let variance = |squares: f64| squares * f64::from(each) / 4.0 / f64::from(PIXELS);
    // Differences of a hundred thousandth of 1e4 lose 8 of 16 digits.
    let off = (variance(found) / variance(exact) - 1.0).abs();
    checks.push(Check::new("variance of 1e4 ± 0.01: relative error", u64::from(count), "samples", off, 1e-6));
    // 1e-4 and what the step of floats adds, a twelfth of its square; 4,096 differences know it to a tenth at 4.5 standard errors.
    let sure = 4.5 * (2.0 / f64::from(PIXELS)).sqrt();
    let expected = 1e-4 + STEP * STEP / 12.0;
    let off = (variance(found) / expected - 1.0).abs();
    checks.push(Check::new("variance beside 1e-4", u64::from(count), "samples", off, sure));
    checks
}

/// 24 hours at 1,000 samples a second: 8.64e7 of a pixel; then as many as indices go, 2³². What comes then still counts.
#[must_use]
pub fn a_day<A: Accumulator>(count: u64, seed: u64) -> Vec<Check> {
    const DAY: u64 = 86_400_000;
    let (mut rng, mut day, mut whole) = (Rng(seed), A::default(), 0u128);
    // Samples of a path tracer: most are small, a few are not. All are multiples of 2⁻²² below 2⁸.
    let mut sample = || {
        let bits = u128::from(rng.bits() >> 10 << 2) << if rng.bits() & 255 == 0 { 8 } else { 0 };
        (bits, bits as f32 / (1 << 24) as f32)
    };
    let first = count.min(DAY);
    for i in 0..first {
        let (bits, value) = sample();
        whole += bits;
        day.add(i as u32, value);
    }
    let exact = |whole: u128, n: u64| whole as f64 / f64::from(1 << 24) / n as f64;
    let mut checks = vec![relative(&format!("{first} samples"), first, day.mean(), exact(whole, first))];
    // What that becomes by merging with itself, up to the day and up to the last index.
    let (mut all, mut n) = (day.clone(), first);
    while n < 1 << 31 {
        let other = all.clone();
        all.merge(&other);
        (whole, n) = (2 * whole, 2 * n);
        if (DAY..2 * DAY).contains(&n) {
            checks.push(relative(&format!("{n} samples, a day and more"), n, all.mean(), exact(whole, n)));
        }
    }
    checks.push(relative(&format!("{n} samples, the most there are"), n, all.mean(), exact(whole, n)));
    // A thousand more, each of which has to be seen.
    let mut unseen = 0;
    for i in 0..1000 {
        let before = all.mean();
        let (bits, value) = sample();
        // Away from the mean, which is about 1.
        whole += bits + (2 << 24);
        all.add(i, value + 2.0);
        unseen += u64::from(all.mean() == before);
    }
    checks.push(Check::none("later samples that change nothing", 1000, "samples", unseen));
    checks.push(Check::none("samples that were not counted", n, "samples", all.count().abs_diff(n + 1000)));
    checks.push(relative("and a thousand more", n + 1000, all.mean(), exact(whole, n + 1000)));
    checks
}

/// What is no number does not get in, and is counted.
#[must_use]
pub fn poison<A: Accumulator>() -> Check {
    let (mut pixel, mut wrong) = (A::default(), 0);
    pixel.add(0, 1.0);
    let bad = [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    for (i, bad) in (1..).zip(bad) {
        wrong += u64::from(pixel.add(i, bad));
    }
    wrong += u64::from(pixel.mean() != 1.0) + u64::from(pixel.count() != 1);
    Check::none("let in", bad.len() as u64 + 2, "samples", wrong)
}

/// A light of no number: each of its samples is dropped and counted, and no pixel is spoilt. `exposed` makes pixels of
/// the stage, and counts samples taken and dropped.
#[must_use]
pub fn poisoned_film(exposed: impl Fn(&mut Stage) -> (Vec<f64>, [u64; 2])) -> Vec<Check> {
    let mut stage = Stage::new(settings(8, 8, Integrator::Direct, 1));
    let here = DAffine3::IDENTITY;
    stage.add_mesh(quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0), Default::default(), here);
    let beside = |x: f64| DAffine3::from_translation(DVec3::new(x, 0.0, 0.5));
    stage.add(Light::Point { intensity: Vec3::splat(f32::NAN) }, beside(1.0));
    stage.add(Light::Point { intensity: Vec3::ONE }, beside(-1.0));
    stage.look(DVec3::Z * 0.4, DVec3::ZERO, DVec3::Y, 0.5);
    let (pixels, [taken, dropped]) = exposed(&mut stage);
    vec![
        no_light("pixels spoilt by a light of no number", &pixels, false),
        Check::none("such samples not counted", taken, "samples", taken.abs_diff(dropped)),
    ]
}

/// The film's.
#[must_use]
pub fn exposed(stage: &mut Stage) -> (Vec<f64>, [u64; 2]) {
    let (film, rays) = stage.expose(4, || true);
    (reds(&film), [rays.camera, film.dropped()])
}

/// Scenes, small: none of their samples is no number, none of their pixels no light.
#[must_use]
pub fn scenes(trial: &Trial<'_>, sources: impl Iterator<Item = SceneSource>) -> Vec<Check> {
    let mut checks = Vec::new();
    for source in sources {
        if trial.interrupted() {
            break;
        }
        let wishes = Wishes {
            size: Some(UVec2::new(48, 32)),
            integrator: Some(Integrator::Path),
            ..Wishes::default()
        };
        let samples = trial.pick(4, 64, 4096) as u32;
        let Ok(mut opened) = open(&source, &LoadOptions::default(), &wishes) else {
            checks.push(Check::none(format!("{} cannot be opened", source.name()), 1, "scenes", 1));
            continue;
        };
        {
            let mut budget = opened.app.world.resource_mut::<FrameBudget>();
            (budget.sample_target, budget.pass_samples) = (samples, samples);
        }
        opened.app.frame();
        let film = opened.app.world.resource::<Film>();
        let tried = u64::from(samples) * 48 * 32;
        checks.push(Check::none("samples dropped of built-in scenes", tried, "samples", film.dropped()));
        checks.push(no_light("pixels of built-in scenes that are no light", &reds(film), false));
        trial.tell("S8", source.name(), 0.5);
    }
    super::meter::worst_of_each(checks.into_iter())
}

/// Adding.
pub const S5: Case = Case {
    id: "S5",
    title: "10⁸ samples of a pixel add up, whatever their sizes",
    limit: "1e-12",
    run: |trial| adding::<Pixel>(trial, trial.pick(1 << 26, 100_000_000, 1_000_000_000) as u32),
};

/// No numbers.
pub const S8: Case = Case {
    id: "S8",
    title: "a sample that is no number is left out and counted; no scene makes one",
    limit: "0",
    run: |trial| {
        let mut checks = vec![poison::<Pixel>()];
        checks.extend(poisoned_film(exposed));
        checks.extend(scenes(trial, built_in_scenes().iter().map(|scene| SceneSource::BuiltIn(scene.name))));
        checks
    },
};

/// A day.
pub const S10: Case = Case {
    id: "S10",
    title: "a film of 24 hours at 1,000 samples a second loses nothing, up to 2³² samples",
    limit: "1e-12; every sample changes the mean",
    run: |trial| a_day::<Pixel>(trial.pick(10_800_000, 86_400_000, 86_400_000), trial.seed),
};
