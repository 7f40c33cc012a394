//! Triangles, rays, and the oracle that tries every triangle.
#![allow(dead_code, unused_imports, reason = "each test file uses its part")]

pub mod balls;
pub mod closed;
pub mod containment;
mod rng;
pub mod scenes;

pub use containment::check;
pub use rng::Rng;

#[path = "mod.rs"]
mod support;

pub use support::shared;

use glam::{DAffine3, Vec3};
use penumbra::bvh::{Aabb, Blas, Hit, Isa, Placement, Probe, Ray};
use rayon::prelude::*;
use std::sync::Arc;

/// Every triangle tried with the same routine, by the same rule about equals.
pub fn brute_force(triangles: &[[Vec3; 3]], ray: &Ray) -> Option<Hit> {
    let bounds = triangles.iter().fold(Aabb::EMPTY, |a, t| a.union(Aabb::around(t)));
    brute_force_in(&bounds, triangles, ray)
}

/// The same with known bounds.
pub fn brute_force_in(bounds: &Aabb, triangles: &[[Vec3; 3]], ray: &Ray) -> Option<Hit> {
    brute_force_among(bounds, (0..).zip(triangles), ray)
}

/// The same among some of the triangles, given with their numbers.
pub fn brute_force_among<'a>(
    bounds: &Aabb,
    triangles: impl Iterator<Item = (u32, &'a [Vec3; 3])>,
    ray: &Ray,
) -> Option<Hit> {
    let probe = Probe::new(ray, bounds);
    let mut best: Option<Hit> = None;
    for (triangle, corners) in triangles {
        if let Some(h) = probe.triangle(corners, best.map_or(ray.t_max, |b| b.t)) {
            let hit = Hit { t: h.t, u: h.u, v: h.v, triangle, instance: 0 };
            if best.is_none_or(|b| hit.beats(&b)) {
                best = Some(hit);
            }
        }
    }
    best
}

pub fn boxes(triangles: &[[Vec3; 3]]) -> Vec<Aabb> {
    triangles.iter().map(|t| Aabb::around(t)).collect()
}

/// Half of the rays are aimed exactly at corners and edges.
pub fn aimed_ray(rng: &mut Rng, triangles: &[[Vec3; 3]], scale: f32, center: Vec3) -> Ray {
    let origin = center + rng.vec() * scale;
    let [a, b, c] = triangles[rng.below(triangles.len())];
    let target = match rng.below(4) {
        0 => a,
        1 => b.lerp(c, rng.unit()),
        2 => a * 0.25 + b * 0.25 + c * 0.5,
        _ => center + rng.vec() * scale,
    };
    Ray::new(origin, target - origin)
}

/// What one kernel says of rays: one by one and together, which must be the same.
pub fn ask(name: &str, blas: &Blas, rays: &[Ray]) -> Vec<Option<Hit>> {
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    blas.closest_hits(rays, &mut hits);
    blas.any_hits(rays, &mut blocked);
    for (i, ray) in rays.iter().enumerate() {
        assert_eq!(blas.closest_hit(ray), hits[i], "{name}: ray {i} alone, {ray:?}");
        assert_eq!(blas.any_hit(ray), hits[i].is_some(), "{name}: any-hit, ray {i} alone, {ray:?}");
        assert_eq!(blocked[i], hits[i].is_some(), "{name}: any-hit, ray {i}, {ray:?}");
    }
    hits
}

pub fn same_as_brute_force(name: &str, triangles: &[[Vec3; 3]], rays: usize) {
    let blas = Blas::build(triangles);
    check(&blas, triangles).unwrap_or_else(|defect| panic!("{name}: {defect}"));
    let bounds = blas.bounds();
    let scale = (bounds.max * 0.5 - bounds.min * 0.5).max_element().max(1e-20) * 1.5;
    let mut rng = Rng(7);
    let mut all: Vec<Ray> = (0..rays)
        .flat_map(|_| {
            let ray = aimed_ray(&mut rng, triangles, scale, bounds.center());
            // Each with close neighbours, so that there are packets of all sizes.
            let near = rng.below(3);
            (0..=near).map(move |k| Ray { origin: ray.origin + ray.direction * (k as f32 * 1e-3), ..ray })
        })
        .filter(|ray| ray.direction != Vec3::ZERO && ray.direction.is_finite() && ray.origin.is_finite())
        .collect();
    let expected: Vec<Option<Hit>> = all.par_iter().map(|ray| brute_force(triangles, ray)).collect();
    let ends: Vec<(Ray, Ray)> = all
        .iter()
        .zip(&expected)
        .filter_map(|(&ray, hit)| {
            let t = (*hit)?.t;
            Some((Ray { t_max: t, ..ray }, Ray { t_max: t.next_down(), ..ray }))
        })
        .collect();
    all.extend(ends.iter().flat_map(|&(at, before)| [at, before]));
    let expected: Vec<Option<Hit>> = expected
        .into_par_iter()
        .chain(ends.par_iter().flat_map_iter(|(at, before)| {
            let hit = brute_force(triangles, at);
            assert!(hit.is_some(), "{name}: t_max itself counts");
            [hit, brute_force(triangles, before)]
        }))
        .collect();
    Isa::available().into_par_iter().for_each(|isa| {
        let name = format!("{name}, {}", isa.name());
        let hits = ask(&name, &blas.clone().with_isa(isa), &all);
        for (i, (hit, expected)) in hits.iter().zip(&expected).enumerate() {
            assert_eq!(hit, expected, "{name}: ray {i} {:?}", all[i]);
        }
    });
}

pub fn soup(count: usize, size: f32, seed: u64) -> Vec<[Vec3; 3]> {
    let mut rng = Rng(seed);
    (0..count)
        .map(|_| {
            let p = rng.vec();
            [p, p + rng.vec() * size, p + rng.vec() * size]
        })
        .collect()
}

pub fn place(triangles: &[[Vec3; 3]], world_from_local: DAffine3) -> Placement {
    Placement::new(Arc::new(Blas::build(triangles)), world_from_local).unwrap()
}

/// Whether to take the time for the full counts.
pub fn long() -> bool {
    std::env::var_os("PENUMBRA_LONG").is_some()
}
