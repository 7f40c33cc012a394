//! G1: no ray leaves a closed mesh.

use super::batches::{BATCH, Counting};
use super::meshes::{self, moved};
use crate::bvh::Ray;
use crate::torture::oracle::{Maker, Rng, ask, inside, kernels};
use crate::torture::{Case, Check, Place, Trial};
use glam::Vec3;

pub(super) const CASE: Case = Case {
    id: "G1",
    title: "rays from inside of closed meshes, aimed at edges and corners",
    limit: "no ray leaves, asked for the nearest hit or for any, alone or in packets",
    run: |trial| run(trial, &kernels()),
};

/// A ray out of a mesh, from `origin`: every third in a random direction, at a random point of a random edge, or
/// exactly at a corner.
#[must_use]
pub fn aimed_out(rng: &mut Rng, triangles: &[[Vec3; 3]], origin: Vec3, turn: usize) -> Ray {
    let [a, b, c] = triangles[rng.below(triangles.len())];
    let direction = match turn % 3 {
        0 => rng.direction(),
        1 => a.lerp(b, rng.unit()) - origin,
        _ => c - origin,
    };
    Ray::new(origin, direction)
}

/// A batch of them from one of the `origins`, every other one with a direction of unit length.
#[must_use]
pub fn outward(rng: &mut Rng, triangles: &[[Vec3; 3]], origins: &[Vec3], count: usize) -> Vec<Ray> {
    let origin = origins[rng.below(origins.len())];
    let both = |turn: usize, rng: &mut Rng| {
        let ray = aimed_out(rng, triangles, origin, turn);
        [ray, Ray { direction: ray.direction.normalize(), ..ray }]
    };
    (0..count / 2).flat_map(|turn| both(turn, rng)).collect()
}

/// Where Embree's own test has its sphere.
const FAR: Vec3 = Vec3::new(148_376.0, 1234.0, -223_423.0);

/// The case for whatever answers rays.
#[must_use]
pub fn run(trial: &Trial<'_>, makers: &[Maker<'_>]) -> Vec<Check> {
    let mut scenes = Vec::new();
    for (name, triangles) in meshes::closed() {
        for place in Place::ALL {
            let there = moved(&triangles, |p| place.point(p));
            scenes.extend(there.map(|t| (format!("{name}, {}", place.name()), t)));
        }
        let far = moved(&triangles, |p| p + FAR);
        scenes.extend(far.map(|t| (format!("{name}, at {FAR}"), t)));
    }
    // In all 10⁹ answers and more when there are hours.
    let each = trial.pick(4 * BATCH, 16 * BATCH, 10_000_000);
    let mut checks = Vec::new();
    for (number, (what, triangles)) in scenes.iter().enumerate() {
        let tracers: Vec<_> = makers.iter().map(|maker| (maker.make)(triangles)).collect();
        let origins = inside(&mut Rng::numbered(trial.seed, 0), triangles, 61);
        if origins.is_empty() {
            checks.push(Check::none(format!("{what}: nothing is inside"), 0, "rays", 0));
            continue;
        }
        let part = [number, number + 1].map(|n| n as f64 / scenes.len() as f64);
        let counting = Counting { trial, id: CASE.id, what, part, batch: BATCH };
        let (rays, leaks) = counting.sum(each, makers.len(), |batch| {
            let mut rng = Rng::numbered(trial.seed, batch + 1);
            let rays = outward(&mut rng, triangles, &origins, BATCH as usize);
            tracers.iter().map(|tracer| ask(tracer.as_ref(), &rays).leaks()).collect()
        });
        for (maker, leaks) in makers.iter().zip(leaks) {
            checks.push(Check::none(format!("{what}, {}", maker.name), rays, "rays", leaks));
        }
        if trial.interrupted() {
            break;
        }
    }
    checks
}
