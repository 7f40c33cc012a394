//! C: nothing, one, and more than floats can count; scenes without an extent.

use super::leave::mesh;
use super::stage::{Stage, WIDE, bad_pixels, means, quad};
use crate::bvh::{Hit, Isa, Ray};
use crate::scene::{Light, Material, TriangleMesh};
use crate::torture::oracle::{Maker, ask, kernels};
use crate::torture::{Case, Check, Effort, Place, Trial};
use crate::trace::Film;
use glam::{DAffine3, DVec3, Vec3};

pub(super) const COUNTS: Case = Case {
    id: "C3",
    title: "0 and 1 triangles, 2^24 + 3 of them, a million lights of which one is on",
    limit: "the right index is hit; the background is exact; lights that are off change no bit",
    run: |trial| {
        let mut checks = few(trial, picture);
        checks.extend(many(trial, &kernels()));
        if !trial.interrupted() {
            checks.extend(lights(trial, |intensity| intensity));
        }
        checks
    },
};

pub(super) const EXTENT: Case = Case {
    id: "C4",
    title: "boxes of zero size: all in one point, on a line, in a plane",
    limit: "what has no area is not hit, a flat square is, and no pixel is no number or below 0",
    run: |trial| extents(trial, &kernels()),
};

/// A picture of `mesh` under an environment of radiance 1.
#[must_use]
pub fn picture(mesh: TriangleMesh, place: Place, isa: Isa, samples: u32) -> Film {
    let mut stage = Stage::new(16, 12, place.transform()).with_isa(isa);
    stage.add_mesh(mesh, Material::default(), DAffine3::IDENTITY);
    stage.add(Light::Environment { radiance: Vec3::ONE }, DAffine3::IDENTITY);
    stage.look(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y, WIDE);
    stage.picture(samples)
}

/// Pixels that are not the background.
fn not_one(film: &Film) -> u64 {
    means(film).iter().filter(|mean| **mean != DVec3::ONE).count() as u64
}

/// None and one, for whatever makes a picture as [`picture`] does.
#[must_use]
pub fn few(trial: &Trial<'_>, picture: impl Fn(TriangleMesh, Place, Isa, u32) -> Film) -> Vec<Check> {
    let samples = trial.pick(1, 4, 64) as u32;
    let mut checks = Vec::new();
    for (place, isa) in
        Place::ALL.iter().flat_map(|&place| Isa::available().into_iter().map(move |isa| (place, isa)))
    {
        if trial.interrupted() {
            break;
        }
        let what = format!("{}, {}", place.name(), isa.name());
        let film = picture(TriangleMesh::default(), place, isa, samples);
        checks.push(Check::none(format!("no triangle: {what}"), 192, "pixels", not_one(&film)));
        // A black one in front of all: everything else is background, and something is black.
        let big = [Vec3::new(-9.0, -9.0, 0.0), Vec3::new(9.0, -9.0, 0.0), Vec3::new(0.0, 9.0, 0.0)];
        let one = picture(mesh(&[big.map(|p| p * 0.05)]), place, isa, samples);
        let seen = not_one(&one);
        let wrong = bad_pixels(&one) + u64::from(seen == 0) + u64::from(seen > 60);
        checks.push(Check::none(format!("one triangle: {what}"), 192, "pixels", wrong));
    }
    checks
}

/// The last three of 2²⁴ + 3 triangles, of whose indices no float tells the one in the middle from the others. All others are there too when there
/// are hours; else they have no area, and only count.
#[must_use]
pub fn many(trial: &Trial<'_>, makers: &[Maker<'_>]) -> Vec<Check> {
    trial.tell(COUNTS.id, "2^24 + 3 triangles", 0.3);
    const COUNT: usize = (1 << 24) + 3;
    let far = if trial.effort == Effort::Long { 1.0 } else { 0.0 };
    let at = |i: usize| Vec3::new((i % 4096) as f32, (i / 4096) as f32, -5.0);
    let mut triangles: Vec<[Vec3; 3]> =
        (0..COUNT - 3).map(|i| [at(i), at(i) + Vec3::X * far, at(i) + Vec3::Y * far]).collect();
    let last = |k: usize| [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::X * (2.0 * k as f32));
    triangles.extend((0..3).map(last));
    let rays: Vec<Ray> =
        (0..3).map(|k| Ray::new(Vec3::new(2.0 * k as f32 + 0.25, 0.25, 1.0), Vec3::NEG_Z)).collect();
    let right =
        |i: usize, hit: Option<&Hit>| hit.is_some_and(|h| h.triangle as usize == COUNT - 3 + i && h.t == 1.0);
    let check = |maker: &Maker<'_>| {
        let answers = ask((maker.make)(&triangles).as_ref(), &rays);
        let wrong = answers.wrong_by(right, |_| true);
        Check::none(format!("2^24 + 3 triangles, {}", maker.name), 3, "rays", wrong)
    };
    makers.iter().take_while(|_| !trial.interrupted()).map(check).collect()
}

/// Lamps that are off beside one that is on; `seen` makes of their intensity what is seen of it.
#[must_use]
pub fn lights(trial: &Trial<'_>, seen: impl Fn(f32) -> f32) -> Vec<Check> {
    let off = trial.pick(1000, 1_000_000 - 1, 1_000_000 - 1);
    trial.tell(COUNTS.id, "a million lights", 0.6);
    let samples = trial.pick(4, 16, 256) as u32;
    let picture = |off: u64| {
        let mut stage = Stage::new(32, 24, DAffine3::IDENTITY);
        stage.add_mesh(
            quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0),
            Material::default(),
            DAffine3::IDENTITY,
        );
        let lamp = |intensity: f32| Light::Point { intensity: Vec3::splat(seen(intensity)) };
        let at = |i: u64| {
            let angle = i as f64 * 0.001;
            DAffine3::from_translation(DVec3::new(angle.cos(), angle.sin(), 1.0 + 1e-6 * i as f64))
        };
        for i in 0..off {
            if i == off / 2 {
                stage.add(lamp(1.0), at(0));
            }
            stage.add(lamp(0.0), at(i));
        }
        if off == 0 {
            stage.add(lamp(1.0), at(0));
        }
        stage.look(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y, WIDE);
        stage.picture(samples)
    };
    let wrong = means(&picture(0)).iter().zip(means(&picture(off))).filter(|(a, b)| *a != b).count() as u64;
    vec![Check::none(format!("{off} lights that are off"), 32 * 24, "pixels", wrong)]
}

/// The case for whatever answers rays.
#[must_use]
pub fn extents(trial: &Trial<'_>, makers: &[Maker<'_>]) -> Vec<Check> {
    let samples = trial.pick(1, 4, 64) as u32;
    let point = vec![[Vec3::splat(0.25); 3]; 100];
    let line: Vec<_> = (0..100).map(|i| [0, 1, 2].map(|k| Vec3::X * ((i + k) as f32 * 0.01))).collect();
    let [a, b, c, d] =
        [[-1.0f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let scenes =
        [("a point", point, false), ("a line", line, false), ("a plane", vec![[a, b, c], [a, c, d]], true)];
    let mut checks = Vec::new();
    for (number, place) in Place::ALL.into_iter().enumerate() {
        for (name, triangles, is_hit) in &scenes {
            let what = format!("{name}, {}", place.name());
            trial.tell(EXTENT.id, what.clone(), number as f64 / Place::ALL.len() as f64);
            let there: Vec<_> = triangles.iter().map(|t| t.map(|p| place.point(p))).collect();
            let eye = place.point(Vec3::new(0.1, 0.2, 3.0));
            // Well inside: a border has no neighbour that would catch what rounds past it.
            let middle = |[a, b, c]: &[Vec3; 3]| *a * 0.5 + *b * 0.25 + *c * 0.25;
            let rays: Vec<Ray> = there.iter().map(|t| Ray::new(eye, middle(t) - eye)).collect();
            for maker in makers {
                if trial.interrupted() {
                    return checks;
                }
                let answers = ask((maker.make)(&there).as_ref(), &rays);
                let wrong = answers.wrong_by(|_, hit| hit.is_some() == *is_hit, |_| *is_hit);
                checks.push(Check::none(format!("{what}, {}", maker.name), rays.len() as u64, "rays", wrong));
            }
            for isa in Isa::available() {
                let what = format!("{what}, {}", isa.name());
                let film = picture(mesh(triangles), place, isa, samples);
                let bad = bad_pixels(&film) + if *is_hit { 0 } else { not_one(&film) };
                checks.push(Check::none(what, 192, "pixels", bad));
            }
        }
    }
    checks
}
