//! G8: slivers, triangles without area, mixed scales, denormal numbers.

use super::alone::Alone;
use super::leave::mesh;
use super::meshes::{Triangles, soup};
use super::stage::{Stage, WIDE, bad_pixels, ball, cube, means};
use crate::bvh::{Isa, Ray};
use crate::scene::{Light, Material, Projection, Transform, TriangleMesh};
use crate::torture::light::meter::larger;
use crate::torture::oracle::Rng;
use crate::torture::{Case, Check, Place, Trial};
use crate::trace::Film;
use crate::trace::surface::Interaction;
use glam::{DAffine3, DVec3, UVec2, Vec3};
use rayon::prelude::*;

pub(super) const CASE: Case = Case {
    id: "G8",
    title: "slivers, triangles without area, 40 orders of magnitude, denormal numbers",
    limit: "the normal of a sliver is within 1e-6; no pixel is no number or below 0; what is there is seen",
    run: |trial| {
        let mut checks = normals(|at, _| [at.geometric_normal, at.normal]);
        checks.extend(pictures(trial, &scenes(), picture));
        checks
    },
};

/// A million long, a millionth wide, at the three scales: for whatever makes both normals of a place and the corners.
#[must_use]
pub fn normals(normals: impl Fn(&Interaction, [Vec3; 3]) -> [Vec3; 2]) -> Vec<Check> {
    let mut checks = Vec::new();
    for place in Place::ALL.into_iter().filter(|place| place.shift == 0.0) {
        let corners = [Vec3::ZERO, Vec3::new(1e6, 0.0, 0.0), Vec3::new(5e5, 1e-6, 0.0)];
        let corners = corners.map(|p| place.point(p));
        let Some(alone) = Alone::new(mesh(&[corners]), DAffine3::IDENTITY) else { return Vec::new() };
        for (name, tracer) in alone.tracers() {
            let off = [1.0f32, -1.0].map(|side| {
                let from = place.point(Vec3::new(5e5, 2.5e-7, side));
                let ray = Ray::new(from, Vec3::new(0.0, 0.0, -side));
                let Some(hit) = tracer.closest_hit(&ray) else { return f64::NAN };
                let at = alone.at(&hit, &ray);
                let off = normals(&at, corners).map(|n| f64::from((n - Vec3::Z * side).length()));
                larger(off[0], off[1])
            });
            let worst = larger(off[0], off[1]);
            let what = format!("off in the normal of a sliver, {}, {name}", place.name());
            checks.push(Check::new(what, 2, "rays", worst, 1e-6));
        }
    }
    checks
}

/// Something bad, as it is placed.
pub struct Degenerate {
    /// What a table calls it.
    pub name: &'static str,
    /// Its triangles.
    pub mesh: TriangleMesh,
    /// What it wears.
    pub material: Material,
    /// Where it is.
    pub place: DAffine3,
}

/// What files have been seen to hold.
#[must_use]
pub fn scenes() -> Vec<Degenerate> {
    let here = |name, triangles: Triangles| Degenerate {
        name,
        mesh: mesh(&triangles),
        material: Material::default(),
        place: DAffine3::IDENTITY,
    };
    let scaled = |name, x, y, z| Degenerate {
        name,
        mesh: cube(),
        material: Material::default(),
        place: DAffine3::from_scale(DVec3::new(x, y, z)),
    };
    let mut repeated = cube();
    repeated.triangles.extend([[0, 0, 1], [3, 3, 3], [5, 6, 5]]);
    let mut rng = Rng(8);
    let slivers = (0..1000).map(|_| {
        let (a, along) = (rng.vec(), rng.direction());
        [a, a + along, a + along * rng.unit() + rng.vec() * 1e-7]
    });
    let slivers: Triangles = slivers.collect();
    let points = soup(300, 0.5, 9).into_iter().map(|[a, b, _]| [a, b, a.lerp(b, 0.5)]).collect();
    let times = |factor: f32| soup(300, 0.5, 9).into_iter().map(|t| t.map(|p| p * factor)).collect();
    let mut mixed: Triangles = times(1.0);
    mixed.extend(soup(100, 0.5, 3).into_iter().map(|t| t.map(|p| p * 1e-12)));
    mixed.extend(soup(100, 0.5, 4).into_iter().map(|t| t.map(|p| p * 1e12)));
    vec![
        Degenerate { mesh: repeated, ..scaled("an index twice", 1.0, 1.0, 1.0) },
        here("slivers", slivers),
        here("no area", points),
        here("denormal positions", times(1e-40)),
        here("positions of 1e30", times(1e30)),
        here("24 orders of magnitude", mixed),
        scaled("flattened", 1.0, 0.0, 1.0),
        scaled("scaled by 1e-20", 1e-20, 1e-20, 1e-20),
        scaled("scaled by 1e-6, 1 and 1e6", 1e-6, 1.0, 1e6),
    ]
}

/// Pixels of a picture, in two directions.
const SIZE: UVec2 = UVec2::new(32, 24);
const EYE: DVec3 = DVec3::new(1.0, 2.0, 5.0);
const TARGET: DVec3 = DVec3::new(1.0, 0.0, 0.0);
const BESIDE: DVec3 = DVec3::new(2.0, 0.0, 0.0);

/// A picture of one of these beside a ball, under an environment of radiance 1.
#[must_use]
pub fn picture(scene: &Degenerate, place: Place, isa: Isa, samples: u32) -> Film {
    let mut stage = Stage::new(SIZE.x, SIZE.y, place.transform()).with_isa(isa);
    stage.add_mesh(scene.mesh.clone(), scene.material.clone(), scene.place);
    stage.add_mesh(ball(8), Material::default(), DAffine3::from_translation(BESIDE));
    stage.add(Light::Environment { radiance: Vec3::ONE }, DAffine3::IDENTITY);
    stage.look(EYE, TARGET, DVec3::Y, WIDE);
    stage.picture(samples)
}

/// What a pixel shows, all of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shown {
    Environment,
    Ball,
    Thing,
    /// Several of them.
    Border,
}

/// What each pixel shows: rays through 5 × 5 places of it and of its border, against every triangle, in double precision
/// and where nothing was moved yet.
fn shown(scene: &Degenerate) -> Vec<Shown> {
    let placed = |mesh: &TriangleMesh, place: &DAffine3| -> Vec<[DVec3; 3]> {
        let corners = |i| mesh.corners(i).map(|p| place.transform_point3(p.as_dvec3()));
        (0..mesh.triangles.len()).map(corners).collect()
    };
    let things = placed(&scene.mesh, &scene.place);
    let balls = placed(&ball(8), &DAffine3::from_translation(BESIDE));
    let nearest = |triangles: &[[DVec3; 3]], ray: DVec3| {
        triangles.iter().filter_map(|corners| distance(ray, corners)).fold(f64::INFINITY, f64::min)
    };
    let turn = Transform::looking_at(EYE, TARGET, DVec3::Y).0.matrix3;
    let Projection::Perspective { vertical_fov } = WIDE else { return Vec::new() };
    let half = (0.5 * f64::from(vertical_fov)).tan();
    let size = SIZE.as_dvec2();
    let seen = |x: f64, y: f64| {
        let (x, y) = ((2.0 * x - size.x) / size.y * half, (1.0 - 2.0 * y / size.y) * half);
        let ray = turn * DVec3::new(x, y, -1.0);
        let (ball, thing) = (nearest(&balls, ray), nearest(&things, ray));
        if ball.min(thing) == f64::INFINITY {
            Shown::Environment
        } else if ball < thing {
            Shown::Ball
        } else {
            Shown::Thing
        }
    };
    let pixel = |i: u32| {
        let at = |k: u32, i: u32| f64::from(i) - 0.05 + 0.275 * f64::from(k);
        let places = (0..25).map(|k| seen(at(k % 5, i % SIZE.x), at(k / 5, i / SIZE.x)));
        places.reduce(|a, b| if a == b { a } else { Shown::Border }).unwrap_or(Shown::Border)
    };
    (0..SIZE.element_product()).into_par_iter().map(pixel).collect()
}

/// How far along a ray from the eye it meets a triangle, if it does and that has an area.
fn distance(ray: DVec3, [a, b, c]: &[DVec3; 3]) -> Option<f64> {
    let (ab, ac, from) = (*b - *a, *c - *a, EYE - *a);
    let normal = ab.cross(ac);
    let along = normal.dot(ray);
    let t = -normal.dot(from) / along;
    let across = ray.cross(from);
    let (u, v) = (ac.dot(across) / along, -ab.dot(across) / along);
    (along != 0.0 && t > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some(t)
}

/// The case for whatever makes pictures as [`picture`] does: no pixel is no number, and where there is something, it is seen.
#[must_use]
pub fn pictures(
    trial: &Trial<'_>,
    scenes: &[Degenerate],
    picture: impl Fn(&Degenerate, Place, Isa, u32) -> Film,
) -> Vec<Check> {
    let samples = trial.pick(1, 4, 256) as u32;
    let mut checks = Vec::new();
    for (number, scene) in scenes.iter().enumerate() {
        let shown = shown(scene);
        for place in Place::ALL {
            trial.tell(CASE.id, scene.name, number as f64 / scenes.len() as f64);
            for isa in Isa::available() {
                if trial.interrupted() {
                    return checks;
                }
                let film = picture(scene, place, isa, samples);
                let what = format!("{}, {}, {}", scene.name, place.name(), isa.name());
                let means = means(&film);
                checks.push(Check::none(what.clone(), means.len() as u64, "pixels", bad_pixels(&film)));
                for kind in [Shown::Ball, Shown::Thing, Shown::Environment] {
                    let there = means.iter().zip(&shown).filter(|(_, shown)| **shown == kind);
                    let tried = there.clone().count() as u64;
                    // Nothing reflects all of the light.
                    let is_right = |mean: &DVec3| (*mean == DVec3::ONE) == (kind == Shown::Environment);
                    let wrong = there.filter(|(mean, _)| !is_right(mean)).count() as u64;
                    if tried > 0 || kind == Shown::Ball && !hidden(&shown) {
                        checks.push(Check::none(format!("{kind:?} seen: {what}"), tried, "pixels", wrong));
                    }
                }
            }
        }
    }
    checks
}

/// Whether something is before all else.
fn hidden(shown: &[Shown]) -> bool {
    shown.iter().all(|shown| matches!(shown, Shown::Thing | Shown::Border))
}
