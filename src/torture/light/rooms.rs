//! L12 and L13: whole squares, and awkward places.

use super::lamps::{LIMIT, quads};
use super::meter::{Plan, SIGMAS, measure, ours, places, until_sure, worst_of_each};
use super::oracle;
use super::spot::{ALBEDO, Expected, Spot, Thing, UNIT, opaque, panel, parallelogram, shining};
use crate::scene::{Light, Material, TriangleMesh};
use crate::torture::stage::{Estimate, Stage, cube, grid, quad, reds, settings};
use crate::torture::{Case, Check, Place, Trial};
use crate::trace::{Integrator, RenderSettings};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

const UP: DVec3 = DVec3::Z;

/// The unit square from the origin along x and y, and a light.
#[derive(Clone, Copy, Debug)]
pub struct Square {
    /// Corner and edges of the light.
    pub light: [DVec3; 3],
    /// Where all of it is.
    pub place: Place,
    /// Whether light may be computed instead of sampled.
    pub computed: bool,
    /// Of the noise.
    pub seed: u32,
    /// In each cell.
    pub samples: u32,
}

/// Both pairs of squares that have closed form factors.
#[must_use]
pub fn squares() -> [(&'static str, [DVec3; 3], f64); 2] {
    [
        ("parallel", [DVec3::Z, DVec3::Y, DVec3::X], oracle::parallel_squares()),
        (
            "perpendicular, with a common edge",
            [DVec3::ZERO, DVec3::X, DVec3::Z],
            oracle::perpendicular_squares(),
        ),
    ]
}

/// The renderer's form factor of a square: the mean over 64 × 64 cells, some samples in each.
#[must_use]
pub fn form_factor(square: &Square) -> f64 {
    let settings = RenderSettings {
        seed: square.seed,
        shafts: square.computed,
        ..settings(64, 64, Integrator::Direct, 1)
    };
    let mut stage = Stage::placed(settings, square.place.scale, DVec3::splat(square.place.shift));
    let [corner, u, v] = square.light;
    let floor = quad(Vec3::ZERO, Vec3::X, Vec3::Y);
    stage.add_mesh(floor, Material::lambert(Vec3::splat(ALBEDO)), DAffine3::IDENTITY);
    stage.add(parallelogram(u, v, true), DAffine3::from_translation(corner + (u + v) * 0.5));
    stage.look(DVec3::new(0.5, 0.5, 0.5), DVec3::new(0.5, 0.5, 0.0), DVec3::Y, 1.0);
    let (film, _) = stage.expose(square.samples, || true);
    let pixels = reds(&film);
    pixels.iter().sum::<f64>() / pixels.len() as f64 / f64::from(ALBEDO)
}

/// What is right of many pictures' form factors.
#[must_use]
pub fn judge_form_factor(what: &str, samples: u64, factors: &[f64], exact: f64) -> Vec<Check> {
    let estimate = Estimate::of(factors);
    // Where its edges are, of cells and of floats.
    let off = estimate.off(exact, 64.0 * UNIT * exact);
    let samples = samples * 4096 * factors.len() as u64;
    vec![
        Check::new(format!("{what}: standard errors off"), samples, "samples", off, SIGMAS),
        Check::new(format!("{what}: {SIGMAS} standard errors"), 1, "means", SIGMAS * estimate.sigma, 5e-4),
    ]
}

fn form_factors(trial: &Trial<'_>) -> Vec<Check> {
    let (pictures, samples) = (trial.pick(16, 16, 384), trial.pick(8, 8, 64) as u32);
    let mut checks = Vec::new();
    for (name, light, exact) in squares() {
        for place in places(trial.effort) {
            for computed in [true, false] {
                let how = if computed { "computed" } else { "sampled" };
                let what = format!("{name}, {}, {how}", place.name());
                // Light that is computed has no noise but that of the places.
                let samples = if computed { 4 } else { samples };
                checks.extend(until_sure(trial, [samples, 64 * samples], |samples| {
                    let picture = |i: u64| {
                        let seed = (trial.seed * pictures + i) as u32;
                        form_factor(&Square { light, place, computed, seed, samples })
                    };
                    let seeds = (0..pictures).into_par_iter().filter(|_| !trial.interrupted());
                    let factors: Vec<f64> = seeds.map(picture).collect();
                    judge_form_factor(&what, u64::from(samples), &factors, exact)
                }));
                if trial.interrupted() {
                    return checks;
                }
                trial.tell("L12", what, 0.5);
            }
        }
    }
    checks.extend(measure(trial, Plan::of("L12"), &in_a_shining_cube(), &|ask| {
        ours(ask, &|| !trial.interrupted())
    }));
    checks
}

/// All six faces shine: π everywhere inside, and something on its edges.
#[must_use]
pub fn in_a_shining_cube() -> Vec<Spot> {
    let faces = [
        [v(-1.0, -1.0, -1.0), DVec3::X, DVec3::Y],
        [v(-1.0, -1.0, 1.0), DVec3::X, DVec3::Y],
        [v(-1.0, -1.0, -1.0), DVec3::Y, DVec3::Z],
        [v(1.0, -1.0, -1.0), DVec3::Y, DVec3::Z],
        [v(-1.0, -1.0, -1.0), DVec3::Z, DVec3::X],
        [v(-1.0, 1.0, -1.0), DVec3::Z, DVec3::X],
    ];
    let inside =
        |spot: Spot| faces.iter().fold(spot, |spot, [c, u, v]| spot.with(panel(*c, *u * 2.0, *v * 2.0)));
    let mut spots = Vec::new();
    for (point, normal, half) in [
        (DVec3::ZERO, UP, 1e-2),
        (v(0.9, 0.8, -0.7), v(1.0, 2.0, 3.0), 1e-2),
        (v(0.999, 0.999, 0.999), v(-1.0, 0.3, 0.2), 1e-4),
        (v(0.0, 0.0, -1.0 + 2f64.powi(-14)), UP, 1e-5),
    ] {
        let spot = Spot::new(format!("in a shining cube at {point}"), point, normal, |_| PI).half(half);
        spots.push(inside(spot));
    }
    for point in [v(1.0, 1.0, 0.2), v(1.0, -1.0, 1.0)] {
        let spot = Spot::that_is(format!("on the cube's edge at {point}"), point, -point, Expected::Finite);
        spots.push(inside(spot.half(1e-3)));
    }
    spots
}

/// Where implementations stumble over light.
#[must_use]
pub fn awkward_places() -> Vec<Spot> {
    let mut spots = dark_places();
    let overhead = || quads().swap_remove(0);
    let exact = |spot: &Spot| spot.expected.clone();
    // The floor is there and hides the lower half; the upper half must not notice.
    let cut = [v(2.0, -1.0, -1.0), DVec3::Y * 2.0, DVec3::Z * 2.0];
    spots.push(Spot::under("cut by the floor", DVec3::ZERO, UP, cut).half(4.0));
    let box_around = Thing::Mesh(cube(), Box::default(), DAffine3::from_scale(DVec3::splat(2.0)));
    spots.push(Spot { name: "in a closed box with it".to_owned(), ..overhead() }.with(box_around));
    let above = DAffine3::from_translation(DVec3::Z);
    let front = parallelogram(DVec3::Y, DVec3::X, false);
    let lit = |name: &str, thing: Thing| Spot::that_is(name, DVec3::ZERO, UP, exact(&overhead())).with(thing);
    spots.push(Spot { computed: true, ..lit("the front of a one-sided light", Thing::Light(front, above)) });
    let under = [v(-0.5, -0.5, -1.0), DVec3::X, DVec3::Y];
    spots.push(Spot::under("the other side of a two-sided light", DVec3::ZERO, -UP, under));
    // Counter-clockwise seen from below: its front is there.
    for (n, name) in [(1, "2 triangles"), (223, "99,458 triangles")] {
        let mesh = grid(Vec3::new(-0.5, -0.5, 1.0), Vec3::Y, Vec3::X, n);
        spots.push(lit(name, Thing::Mesh(mesh, Box::new(Material::emissive(Vec3::ONE)), DAffine3::IDENTITY)));
    }
    // Places that have no answer, or several.
    let unseen = |corner: DVec3, u: DVec3, v: DVec3| {
        Thing::Unseen(parallelogram(u, v, true), DAffine3::from_translation(corner + (u + v) * 0.5))
    };
    for (name, thing) in [
        ("on the light, which lies in the floor", unseen(v(-0.5, -0.5, 0.0), DVec3::X, DVec3::Y)),
        (
            "on the light, which goes through the floor",
            unseen(v(-0.5, -0.5, -0.5), DVec3::Y, v(1.0, 0.0, 1.0)),
        ),
        ("on the edge of a light that stands on the floor", unseen(v(0.0, -0.5, 0.0), DVec3::Y, DVec3::Z)),
        ("on a corner of the light", unseen(DVec3::ZERO, DVec3::Y, DVec3::Z)),
        ("on the line of its edge", unseen(v(0.0, 0.5, 0.0), DVec3::Y, DVec3::Z)),
    ] {
        spots.push(Spot::that_is(name, DVec3::ZERO, UP, Expected::Finite).with(thing));
    }
    spots.push(
        Spot::that_is("on an emissive triangle", DVec3::ZERO, UP, Expected::Finite).with(shining(quad(
            Vec3::new(0.0, -0.5, 0.0),
            Vec3::Y,
            Vec3::new(0.5, 0.0, 1.0),
        ))),
    );
    spots
}

fn dark_places() -> Vec<Spot> {
    let above = DAffine3::from_translation(DVec3::Z);
    let turned = DAffine3::from_rotation_translation(DQuat::from_rotation_x(PI), DVec3::Z);
    let far = DAffine3::from_translation(DVec3::Z * 3.0);
    let dark = |name: &str| Spot::that_is(name, DVec3::ZERO, UP, Expected::Dark);
    let mesh =
        |mesh: TriangleMesh| Thing::Mesh(mesh, Box::new(Material::emissive(Vec3::ONE)), DAffine3::IDENTITY);
    let ball = |radius: f32| Light::Sphere { radius, radiance: Vec3::ONE };
    let disk = |radius: f32| Light::Disk { radius, radiance: Vec3::ONE, two_sided: false };
    vec![
        dark("in the plane of the floor").with(panel(v(0.5, 0.5, 0.0), DVec3::X, DVec3::Y)),
        dark("behind the receiver").with(panel(v(-0.5, -0.5, -1.0), DVec3::X, DVec3::Y)),
        dark("the back of a parallelogram")
            .with(Thing::Light(parallelogram(DVec3::X, DVec3::Y, false), above)),
        dark("the back of a disk").with(Thing::Light(disk(1.0), turned)),
        dark("the back of a mesh").with(mesh(quad(Vec3::new(-0.5, -0.5, 1.0), Vec3::X, Vec3::Y))),
        dark("outside of a closed box with it").with(Thing::Light(ball(0.5), far)).with(Thing::Mesh(
            cube(),
            Box::default(),
            far,
        )),
        dark("behind a wall that touches it")
            .with(panel(v(-0.5, -0.5, 1.0), DVec3::X, DVec3::Y))
            .with(opaque(v(-1.0, -1.0, 0.999), DVec3::X * 2.0, DVec3::Y * 2.0)),
        dark("no width").with(Thing::Light(parallelogram(DVec3::ZERO, DVec3::Y, true), above)),
        dark("parallel edges").with(Thing::Light(parallelogram(DVec3::X, DVec3::X, true), above)),
        dark("no radius").with(Thing::Light(ball(0.0), far)).with(Thing::Light(disk(0.0), far)),
        dark("a mesh without area").with(mesh(quad(Vec3::new(-0.5, -0.5, 1.0), Vec3::X, Vec3::X))),
    ]
}

/// Squares.
pub const L12: Case = Case {
    id: "L12",
    title: "form factors of squares, and the inside of a shining cube",
    limit: "4.5 standard errors, themselves at most 5e-4 (1e-3 of π in the cube)",
    run: |trial| worst_of_each(form_factors(trial).into_iter()),
};

/// Places.
pub const L13: Case = Case {
    id: "L13",
    title: "awkward places: in, on, behind, under the light; boxes; no area; 99,458 triangles",
    limit: LIMIT,
    run: |trial| {
        measure(trial, Plan::of("L13"), &awkward_places(), &|ask| ours(ask, &|| !trial.interrupted()))
    },
};
