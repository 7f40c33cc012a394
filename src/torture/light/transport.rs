//! H7 to H9: light on its way from surface to surface.

use super::kinds::ggx;
use super::meter::{SIGMAS, larger, places, until_sure};
use super::pictures::differing;
use crate::scene::{Alpha, Glass, Glossy, Light, Material};
use crate::torture::stage::{Estimate, Stage, ball, cube, quad, reds, settings};
use crate::torture::{Case, Check, Effort, Place, Trial};
use crate::trace::{Film, Integrator, RenderSettings};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

const HERE: DAffine3 = DAffine3::IDENTITY;

fn placed(settings: RenderSettings, place: Place) -> Stage {
    Stage::placed(settings, place.scale, DVec3::splat(place.shift))
}

/// The box from −1 to 1 seen from inside.
fn room(material: Material, max_depth: u32, size: u32, place: Place, seed: u64) -> Stage {
    let settings = RenderSettings { seed: seed as u32, ..settings(size, size, Integrator::Path, max_depth) };
    let mut stage = placed(settings, place);
    stage.add_mesh(cube(), Material { double_sided: true, ..material }, HERE);
    stage.look_wide(DVec3::new(0.2, 0.3, -0.4), DVec3::new(0.9, -0.5, 0.6));
    stage
}

/// Pictures of one estimate each: pixels may share what their paths find, pictures do not.
const PICTURES: u32 = 32;

/// The means of so many pictures, of `samples` a pixel together.
fn means(trial: &Trial<'_>, stage: &mut Stage, samples: u32) -> Vec<f64> {
    stage.app.build();
    let stage = &*stage;
    let settings = *stage.scene().settings;
    let mean = |i: u32| {
        let settings =
            RenderSettings { seed: settings.seed.wrapping_mul(PICTURES).wrapping_add(i), ..settings };
        let (film, _) = stage.expose_with(&settings, (samples / PICTURES).max(1), || !trial.interrupted());
        let pixels = reds(&film);
        pixels.iter().sum::<f64>() / pixels.len() as f64
    };
    (0..PICTURES).into_par_iter().map(mean).collect()
}

/// Pixels that are all the same number, but for single precision.
#[must_use]
pub fn all_the_same(what: &str, pixels: &[f64], exact: f64, off: f64) -> Check {
    let worst = pixels.iter().map(|p| (p / exact - 1.0).abs()).fold(0.0, larger);
    Check::new(format!("{what}: relative error"), pixels.len() as u64, "pixels", worst, off)
}

/// Independent estimates that are that on average: offset in standard errors, and those.
#[must_use]
pub fn on_average(what: &str, samples: u64, pixels: &[f64], exact: f64, model: f64) -> Vec<Check> {
    let estimate = Estimate::of(pixels);
    let off = estimate.off(exact, (3e-6 + model) * exact);
    vec![
        Check::new(format!("{what}: standard errors off"), samples, "samples", off, SIGMAS),
        Check::new(
            format!("{what}: {SIGMAS} standard errors, relative"),
            1,
            "means",
            SIGMAS * estimate.sigma / exact,
            1e-3,
        ),
    ]
}

/// Independent estimates of 1 that may on average be no more than that, and lose no more than `loss`; 4.5 standard errors
/// at most `bound`.
#[must_use]
pub fn no_more_than_one(what: &str, samples: u64, pixels: &[f64], [loss, bound]: [f64; 2]) -> Vec<Check> {
    let estimate = Estimate::of(pixels);
    let off = if estimate.mean < 1.0 { 0.0 } else { estimate.off(1.0, 1e-5) };
    let wide = SIGMAS * estimate.sigma;
    vec![
        Check::new(format!("{what}: standard errors above"), samples, "samples", off, SIGMAS),
        Check::new(format!("{what}: {SIGMAS} standard errors, relative"), 1, "means", wide, bound),
        Check::new(format!("{what}: loss"), 1, "losses", 1.0 - estimate.mean, loss),
    ]
}

/// What GGX may lose of a white ball's light: what `tests/materials/energy.rs` asks at 89°.
const LOSS: f64 = 0.025;

/// A thousand veils that hide nothing, two of them twice in one place, before a wall and before a light.
fn veils(material: Material, place: Place) -> [Film; 2] {
    [0, 1000].map(|count| {
        let mut stage = placed(settings(32, 32, Integrator::Direct, 2), place);
        stage.add_mesh(
            quad(Vec3::new(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0),
            Material::default(),
            HERE,
        );
        // No larger than the wall, for the sake of one render space.
        let corner = |z: f32| Vec3::new(-1.9, -1.9, z);
        for i in 0..count {
            // Between the wall and the eye; some in one place.
            let z = 0.5 + 0.001 * (i / 2 * 2).max(10) as f32;
            stage.add_mesh(quad(corner(z), Vec3::X * 3.8, Vec3::Y * 3.8), material.clone(), HERE);
        }
        let light = Light::Sphere { radius: 0.3, radiance: Vec3::splat(5.0) };
        stage.add(light, DAffine3::from_translation(DVec3::new(1.0, 0.0, 1.3)));
        stage.look(DVec3::Z * 2.0, DVec3::ZERO, DVec3::Y, 1.0);
        stage.expose(4, || true).0
    })
}

fn transparent(trial: &Trial<'_>) -> Vec<Check> {
    let veil = |alpha, opacity| Material { alpha, opacity, double_sided: true, ..Material::default() };
    let kinds = [("masked", veil(Alpha::Mask(0.5), 0.25)), ("blended", veil(Alpha::Blend, 0.0))];
    let here = places(trial.effort);
    let jobs: Vec<_> = kinds.iter().flat_map(|kind| here.iter().map(move |place| (kind, *place))).collect();
    jobs.into_par_iter()
        .map(|((name, material), place)| {
            let [bare, veiled] = veils(material.clone(), place);
            differing(&format!("behind 1,000 {name} quads, {}", place.name()), &veiled, &bare)
        })
        .collect()
}

fn mirrors(trial: &Trial<'_>) -> Vec<Check> {
    let mirror = || Material { emission: Vec3::ONE, ..Material::perfect_mirror(Vec3::splat(0.9)) };
    let r = f64::from(0.9f32);
    let mut checks = Vec::new();
    for place in places(trial.effort) {
        for k in [0, 1, 4] {
            let exact = (1.0 - r.powi(k + 1)) / (1.0 - r);
            let (film, _) = room(mirror(), k as u32, 16, place, trial.seed).expose(4, || true);
            checks.push(all_the_same(&format!("{k} bounces, {}", place.name()), &reds(&film), exact, 1e-6));
        }
        // From the fifth bounce on paths end by chance.
        for (k, size, samples) in [(9, 32, [768, 768, 100_000]), (1000, 64, [0, 2048, 25_000])] {
            let exact = (1.0 - r.powi(k + 1)) / (1.0 - r);
            let samples = trial.pick(samples[0], samples[1], samples[2]) as u32;
            // Long paths take long: once, and not in a hurry.
            if samples == 0 || k > 9 && place != Place::ORIGIN {
                continue;
            }
            let mut stage = room(mirror(), k as u32, size, place, trial.seed);
            let what = format!("{k} bounces, {}", place.name());
            checks.extend(until_sure(trial, [samples, 16 * samples], |samples| {
                let pictures = means(trial, &mut stage, samples);
                on_average(&what, u64::from(samples * size * size), &pictures, exact, 0.0)
            }));
            if trial.interrupted() {
                return checks;
            }
            trial.tell("H8", place.name(), 0.5);
        }
    }
    checks
}

/// A white environment, a ball in it, and a picture that shows all of the ball and some environment.
fn furnace(material: Material, max_depth: u32, place: Place) -> Stage {
    let mut stage = placed(settings(32, 32, Integrator::Path, max_depth), place);
    stage.add(Light::Environment { radiance: Vec3::ONE }, HERE);
    stage.add_mesh(ball(16), material, HERE);
    stage.look(DVec3::new(3.0, 4.0, 5.0), DVec3::ZERO, DVec3::Y, 2.2);
    stage
}

fn furnaces(trial: &Trial<'_>) -> Vec<Check> {
    let jobs = places(trial.effort);
    let mut checks: Vec<Check> = jobs
        .into_par_iter()
        .flat_map_iter(|place| if trial.interrupted() { Vec::new() } else { furnaces_at(trial, place) })
        .collect();
    checks.extend(balls_from_inside(trial));
    checks
}

/// What a white furnace makes and loses.
fn white(trial: &Trial<'_>, what: &str, mut stage: Stage, samples: u32, loss: f64) -> Vec<Check> {
    // Eight kinds at five places: a thousandth takes two minutes.
    let bound = if trial.effort == Effort::Long { 1e-3 } else { 4e-3 };
    until_sure(trial, [samples, 16 * samples], |samples| {
        let pictures = means(trial, &mut stage, samples);
        no_more_than_one(what, u64::from(samples) * 1024, &pictures, [loss, bound])
    })
}

fn furnaces_at(trial: &Trial<'_>, place: Place) -> Vec<Check> {
    let mut checks = Vec::new();
    let plain = Material::lambert(Vec3::ONE);
    let clear =
        Material { glass: Some(Glass { ior: 1.5, tint: Vec3::ONE }), ..Material::lambert(Vec3::ZERO) };
    for (name, material, depth) in [
        ("diffuse", plain.clone(), 8),
        ("glass", clear, 1000),
        ("mirror", Material::perfect_mirror(Vec3::ONE), 8),
    ] {
        let pixels = reds(&furnace(material, depth, place).expose(64, || true).0);
        checks.push(all_the_same(&format!("white {name} ball, {}", place.name()), &pixels, 1.0, 1e-5));
    }
    let samples = trial.pick(32, 64, 65_536) as u32;
    for roughness in [0.1, 0.3, 0.5, 1.0] {
        let glossy = ggx(1.0, roughness);
        let stage = furnace(Material { glossy, ..plain.clone() }, 8, place);
        let what = format!("metal of roughness {roughness}, {}", place.name());
        checks.extend(white(trial, &what, stage, samples, LOSS));
    }
    for exponent in [0.0, 1.0, 10.0, 1000.0] {
        let glossy = Glossy::BlinnPhong { specular: Vec3::ONE, exponent, texture: None };
        let stage = furnace(Material { glossy, ..Material::lambert(Vec3::ZERO) }, 8, place);
        let what = format!("Blinn-Phong of exponent {exponent}, {}", place.name());
        // What is reflected into the surface is lost, and nothing gives it back: written, not judged.
        checks.extend(white(trial, &what, stage, samples, 1.0));
    }
    // A closed room that shines: 1 / (1 − albedo). Paths are long where it is bright.
    for (albedo, few) in [(0.5f32, 640), (0.8, 4400)] {
        if trial.effort != Effort::Long && place != Place::ORIGIN {
            continue;
        }
        let walls = Material { emission: Vec3::ONE, ..Material::lambert(Vec3::splat(albedo)) };
        let exact = 1.0 / (1.0 - f64::from(albedo));
        let samples = trial.pick(few, few, 312 * few) as u32;
        let mut room = room(walls, 1000, 32, place, trial.seed);
        let what = format!("a shining room of albedo {albedo}, {}", place.name());
        checks.extend(until_sure(trial, [samples, 16 * samples], |samples| {
            let pictures = means(trial, &mut room, samples);
            on_average(&what, u64::from(samples) * 1024, &pictures, exact, 0.0)
        }));
        if trial.interrupted() {
            return Vec::new();
        }
    }
    trial.tell("H9", place.name(), 0.5);
    checks
}

/// From inside of a ball of albedo ½: lit by π from its middle, or shining by itself with ½, it has radiance 1.
///
/// Reference: pbrt-v4, `cpu/integrators_test.cpp`.
fn balls_from_inside(trial: &Trial<'_>) -> Vec<Check> {
    let half = Material { double_sided: true, ..Material::lambert(Vec3::splat(0.5)) };
    let shining = Material { emission: Vec3::splat(0.5), ..half.clone() };
    let mut checks = Vec::new();
    for (name, material, lit) in [("lit from its middle", half, true), ("that shines", shining, false)] {
        let few = if lit { 256 } else { 768 };
        let samples = trial.pick(few, few, 100_000) as u32;
        let mut stage = Stage::new(settings(32, 32, Integrator::Path, 1000));
        stage.add_mesh(ball(128), material, HERE);
        if lit {
            stage.add(Light::Point { intensity: Vec3::splat(std::f32::consts::PI) }, HERE);
        }
        stage.look_wide(DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.5, 0.3, -0.6));
        // Facets are nearer than the ball by a ten thousandth or two.
        let model = if lit { 5e-4 } else { 0.0 };
        let what = format!("inside of a ball {name}");
        checks.extend(until_sure(trial, [samples, 16 * samples], |samples| {
            let pictures = means(trial, &mut stage, samples);
            on_average(&what, u64::from(samples) * 1024, &pictures, 1.0, model)
        }));
    }
    checks
}

/// Veils.
pub const H7: Case = Case {
    id: "H7",
    title: "a wall and a light behind 1,000 transparent quads, some in one place",
    limit: "to the bit as without them",
    run: transparent,
};

/// Mirrors.
pub const H8: Case = Case {
    id: "H8",
    title: "mirror in mirror stops at the last bounce",
    limit: "up to 4 bounces within 1e-6; 9 and 1,000 within 4.5 standard errors, themselves at most 1e-3",
    run: mirrors,
};

/// Furnaces.
pub const H9: Case = Case {
    id: "H9",
    title: "white and shining furnaces: energy is kept, and none is made",
    limit: "1e-5 by pixel, or 4.5 standard errors, themselves at most 1e-3 (shining rooms at all places with --long only); of glossy balls at most 4e-3, 1e-3 with --long; metals lose at most 0.025",
    run: furnaces,
};
