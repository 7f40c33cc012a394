//! Measures irradiance, and judges it.

use super::spot::{ALBEDO, Expected, Spot};
use crate::torture::stage::{Estimate, Stage, reds, settings};
use crate::torture::{Check, Effort, Place, Trial};
use crate::trace::{Integrator, RenderSettings, Sampling};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is to be measured, and how.
#[derive(Clone, Copy)]
pub struct Ask<'a> {
    /// Where.
    pub spot: &'a Spot,
    /// And where that is.
    pub place: Place,
    /// Whether light may be computed instead of sampled.
    pub computed: bool,
    /// Pixels on a side of the picture, all of which show the spot.
    pub side: u32,
    /// Samples of each.
    pub samples: u32,
    /// Of their noise.
    pub seed: u32,
    /// How random numbers are spread.
    pub sampling: Sampling,
}

impl<'a> Ask<'a> {
    /// At the world's origin, of 16 × 16 pixels.
    #[must_use]
    pub fn new(spot: &'a Spot, samples: u32, seed: u32) -> Self {
        let (place, sampling) = (Place::ORIGIN, Sampling::default());
        Self { spot, place, computed: false, side: 16, samples, seed, sampling }
    }
}

/// What was measured.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Irradiance by pixel: independent estimates of the same.
    pub pixels: Vec<f64>,
    /// Samples taken in all.
    pub samples: u64,
    /// Those of them that were no number.
    pub dropped: u64,
    /// Rays toward lights: none if all was computed.
    pub shadow_rays: u64,
}

/// Something that measures: the renderer, or in a test one that makes a mistake.
pub type Meter<'m> = dyn Fn(&Ask) -> Reading + Sync + 'm;

/// The renderer: entities, flat arrays, rays, film. What was measured till `keep_going` ends it is not complete.
pub fn ours(ask: &Ask, keep_going: &(dyn Fn() -> bool + Sync)) -> Reading {
    let small = settings(ask.side, ask.side, Integrator::Direct, 1);
    let chosen = RenderSettings { seed: ask.seed, shafts: ask.computed, sampling: ask.sampling, ..small };
    let mut stage = Stage::placed(chosen, ask.place.scale, DVec3::splat(ask.place.shift));
    ask.spot.set(&mut stage, ask.place);
    let (film, rays) = stage.expose(ask.samples, keep_going);
    let irradiance = PI / f64::from(ALBEDO);
    Reading {
        pixels: reds(&film).iter().map(|radiance| radiance * irradiance).collect(),
        samples: rays.camera,
        dropped: film.dropped(),
        shadow_rays: rays.shadow,
    }
}

/// Standard errors that a mean may be off: two-sided p = 7e-6.
pub const SIGMAS: f64 = 4.5;

/// What is right of a reading. Of several, each by itself.
#[must_use]
pub fn judge(what: &str, ask: &Ask, reading: &Reading, same: Option<&Reading>) -> Vec<Check> {
    let count = reading.pixels.len() as u64;
    let wrong =
        |is_wrong: &dyn Fn(f64) -> bool| reading.pixels.iter().filter(|p| is_wrong(**p)).count() as u64;
    let mut checks = Vec::new();
    if reading.dropped > 0 {
        checks.push(Check::none(format!("{what}: no number"), reading.samples, "samples", reading.dropped));
    }
    match &ask.spot.expected {
        Expected::Dark => {
            // Not −0 either.
            let lit = wrong(&|p| p.to_bits() != 0);
            checks.push(Check::none(format!("{what}: exactly dark"), count, "pixels", lit));
        }
        Expected::Finite => {
            let odd = wrong(&|p| !(0.0..=4.0 * PI).contains(&p));
            checks.push(Check::none(format!("{what}: finite"), count, "pixels", odd));
        }
        Expected::Same(_) => {
            let pairs = reading.pixels.iter().zip(same.map_or(&[][..], |same| &same.pixels));
            let other = count - pairs.filter(|(a, b)| a.to_bits() == b.to_bits()).count() as u64;
            checks.push(Check::none(format!("{what}: exactly the same"), count, "pixels", other));
        }
        Expected::Value { exact, .. } => {
            let exact = exact(ask.spot.point);
            let rounding = ask.spot.rounding(ask.place).unwrap_or(0.0);
            let unit = if exact == 0.0 { 1.0 } else { exact.abs() };
            let is_computed = ask.computed && reading.shadow_rays == 0;
            if ask.computed && ask.spot.computed {
                let sampled = reading.shadow_rays;
                let what = format!("{what}: rays spent though it is computed");
                checks.push(Check::none(what, count, "pixels", sampled));
            }
            if is_computed {
                let off = reading.pixels.iter().map(|p| (p - exact).abs()).fold(0.0, larger);
                let what = format!("{what}: relative error, computed");
                checks.push(Check::new(what, count, "pixels", off / unit, rounding / unit));
            } else {
                let estimate = Estimate::of(&reading.pixels);
                let sigmas = estimate.off(exact, rounding);
                let off = format!("{what}: standard errors off");
                checks.push(Check::new(off, reading.samples, "samples", sigmas, SIGMAS));
                let bound = format!("{what}: {SIGMAS} standard errors, relative");
                checks.push(Check::new(bound, 1, "means", SIGMAS * estimate.sigma / unit, ask.spot.bound));
            }
        }
    }
    checks
}

/// Pixels that are no light: no number, below 0, or black where all is lit.
#[must_use]
pub fn no_light(what: impl Into<String>, pixels: &[f64], all_lit: bool) -> Check {
    let is_light = |p: &&f64| p.is_finite() && **p >= 0.0 && !(all_lit && **p == 0.0);
    let count = pixels.len() as u64;
    Check::none(what, count, "pixels", count - pixels.iter().filter(is_light).count() as u64)
}

/// The larger; what is no number is larger than any (`f64::max` would lose it).
#[must_use]
pub fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// Where cases are tried: everywhere; in a hurry at the origin, far away, and small.
#[must_use]
pub fn places(effort: Effort) -> Vec<Place> {
    let in_a_hurry = |place: &Place| place.shift == 0.0 && place.scale <= 1.0 || place.shift > 1e4;
    Place::ALL.into_iter().filter(|place| effort != Effort::Quick || in_a_hurry(place)).collect()
}

/// How a list of spots is tried.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Which case.
    pub id: &'static str,
    /// Where.
    pub places: &'static [Place],
    /// Samples at first, of each spot, by effort: see [`until_sure`].
    pub samples: [u64; 3],
    /// One line for all spots of a list, by place and by how they are measured, instead of one for each.
    pub together: bool,
}

impl Plan {
    /// All places; as many samples as the bound needs, up to 16 million; or 10⁸.
    #[must_use]
    pub const fn of(id: &'static str) -> Self {
        Self { id, places: &Place::ALL, samples: [1 << 14, 1 << 16, 100_000_000], together: false }
    }

    fn at_first(&self, effort: Effort) -> u64 {
        self.samples[effort as usize]
    }
}

/// Measures all spots at all places, sampled and, where that is possible, computed.
pub fn measure(trial: &Trial<'_>, plan: Plan, spots: &[Spot], meter: &Meter) -> Vec<Check> {
    let modes = |spot: &Spot| if spot.computed { &[true, false][..] } else { &[false] };
    let mut here = places(trial.effort);
    here.retain(|place| plan.places.contains(place));
    let jobs: Vec<(&Spot, Place, bool)> = spots
        .iter()
        .flat_map(|spot| here.iter().map(move |place| (spot, *place)))
        .flat_map(|(spot, place)| modes(spot).iter().map(move |computed| (spot, place, *computed)))
        .collect();
    let (done, all) = (AtomicUsize::new(0), jobs.len());
    let checks: Vec<Vec<Check>> = jobs
        .into_par_iter()
        .map(|(spot, place, computed)| {
            if trial.interrupted() {
                return Vec::new();
            }
            let name = if plan.together { place.name() } else { format!("{}, {}", spot.name, place.name()) };
            let checks = one(trial, plan, &name, spot, place, computed, meter);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            trial.tell(plan.id, name, done as f64 / all as f64);
            checks
        })
        .collect();
    worst_of_each(checks.into_iter().flatten())
}

fn one(
    trial: &Trial<'_>,
    plan: Plan,
    name: &str,
    spot: &Spot,
    place: Place,
    computed: bool,
    meter: &Meter,
) -> Vec<Check> {
    let mut ask = Ask { place, computed, ..Ask::new(spot, 2, trial.seed as u32) };
    let pixels = u64::from(ask.side * ask.side);
    if !computed {
        ask.samples = plan.at_first(trial.effort).div_ceil(pixels) as u32;
    }
    // No more than 16 million samples, or sixteen times as many as were meant to be.
    let most = (1 << 16).max(16 * plan.at_first(trial.effort) / pixels) as u32;
    until_sure(trial, [ask.samples, most], |samples| {
        let ask = Ask { samples, ..ask };
        let reading = meter(&ask);
        let same = match &spot.expected {
            Expected::Same(other) => Some(meter(&Ask { spot: other, ..ask })),
            _ => None,
        };
        judge(name, &ask, &reading, same.as_ref())
    })
}

/// Checks by so many samples, from the first number to the second: twice as many, and again, while the standard errors are
/// too wide; and up to four times more if the mean is too many of them off. Where few samples differ from the others,
/// standard errors are known badly: chance goes away, a bias that does not shrink faster than they do gets worse.
///
/// None if it was interrupted: what is not complete is not judged.
pub fn until_sure(
    trial: &Trial<'_>,
    [mut samples, most]: [u32; 2],
    mut measure: impl FnMut(u32) -> Vec<Check>,
) -> Vec<Check> {
    let mut again = 4;
    loop {
        let checks = measure(samples);
        if trial.interrupted() {
            return Vec::new();
        }
        // What may not happen at all is never chance.
        let broken = |unit: &str| checks.iter().any(|c| c.unit == unit && !c.holds() && c.limit > 0.0);
        let too_wide = broken("means");
        let may_be_chance = again > 0 && broken("samples");
        if !(too_wide || may_be_chance) || samples >= most {
            return checks;
        }
        again -= i32::from(!too_wide);
        samples = samples.saturating_mul(2).min(most);
    }
}

/// Of the checks of one name the worst, with all that were tried.
pub fn worst_of_each(checks: impl Iterator<Item = Check>) -> Vec<Check> {
    let mut all: Vec<Check> = Vec::new();
    for check in checks {
        let badness = |c: &Check| if c.limit > 0.0 { c.ours / c.limit } else { c.ours };
        match all.iter_mut().find(|other| other.what == check.what && other.unit == check.unit) {
            Some(other) => {
                let tried = other.tried + check.tried;
                if badness(&check).total_cmp(&badness(other)).is_gt() {
                    *other = check;
                }
                other.tried = tried;
            }
            None => all.push(check),
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torture::Effort;
    use std::sync::atomic::AtomicBool;

    /// Samples of each try for standard errors that fall by their root from 1 at one sample, and a mean off by that.
    fn tries(off: impl Fn(u32) -> f64, bound: f64) -> (Vec<u32>, bool) {
        let interrupt = AtomicBool::new(false);
        let trial = Trial { effort: Effort::Quick, seed: 1, progress: &|_| {}, interrupt: &interrupt };
        let mut all = Vec::new();
        let checks = until_sure(&trial, [16, 4096], |samples| {
            all.push(samples);
            let sigma = f64::from(samples).sqrt().recip();
            vec![
                Check::new("off", u64::from(samples), "samples", off(samples) / sigma, SIGMAS),
                Check::new("wide", 1, "means", SIGMAS * sigma, bound),
            ]
        });
        (all, checks.iter().all(Check::holds))
    }

    #[test]
    fn a_bound_that_is_too_wide_takes_more_samples_and_chance_goes_away() {
        assert_eq!(tries(|_| 0.0, 2.0), (vec![16], true));
        assert_eq!(tries(|_| 0.0, 0.5), (vec![16, 32, 64, 128], true));
        assert_eq!(tries(|samples| if samples < 60 { 2.0 } else { 0.0 }, 2.0), (vec![16, 32, 64], true));
    }

    #[test]
    fn what_is_wrong_stays_wrong_and_ends() {
        assert_eq!(tries(|_| 1.2, 2.0), (vec![16, 32, 64, 128, 256], false));
        assert_eq!(tries(|_| 0.0, 1e-9).0.last(), Some(&4096));
        assert!(!tries(|_| f64::NAN, 2.0).1);
    }
}
