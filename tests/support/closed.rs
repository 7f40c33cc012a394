//! Closed meshes, and rays that must not leave them.

use super::Rng;
use glam::Vec3;
use penumbra::bvh::{Aabb, Blas, Hit, Ray};
use rayon::prelude::*;
use std::f64::consts::PI;

/// A closed bumpy sphere: every edge has two faces.
pub fn bumpy_sphere(shift: Vec3) -> Vec<[Vec3; 3]> {
    const RINGS: usize = 16;
    let mut rng = Rng(1);
    let bumps: Vec<f32> = (0..(RINGS + 1) * RINGS).map(|_| 1.0 + 0.2 * rng.unit()).collect();
    let vertex = |i: usize, j: usize| {
        if i == 0 || i == RINGS {
            return shift + Vec3::Y * if i == 0 { 2.0 } else { -2.0 };
        }
        let theta = std::f32::consts::PI * i as f32 / RINGS as f32;
        let phi = std::f32::consts::TAU * (j % RINGS) as f32 / RINGS as f32;
        let p = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        shift + p * 2.0 * bumps[i * RINGS + j % RINGS]
    };
    let mut triangles = Vec::new();
    for i in 0..RINGS {
        for j in 0..RINGS {
            let (a, b, c, d) = (vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j));
            if i > 0 {
                triangles.push([a, b, c]);
            }
            if i < RINGS - 1 {
                triangles.push([a, c, d]);
            }
        }
    }
    triangles
}

/// Rays out of a closed mesh: a third at points of edges, a third at corners; each also normalised.
pub fn outward(rng: &mut Rng, triangles: &[[Vec3; 3]], center: Vec3, count: usize) -> Vec<Ray> {
    (0..count)
        .flat_map(|_| {
            let origin = center + rng.vec() * 0.5;
            let [a, b, c] = triangles[rng.below(triangles.len())];
            let target = match rng.below(3) {
                0 => origin + rng.direction(),
                1 => a.lerp(b, rng.unit()),
                _ => c,
            };
            [target - origin, (target - origin).normalize()].map(|direction| Ray::new(origin, direction))
        })
        .collect()
}

/// How many of the rays, asked for their closest hit and for any, say that there is none.
pub fn leaks(blas: &Blas, rays: &[Ray]) -> usize {
    let of_some = |rays: &[Ray]| {
        let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
        blas.closest_hits(rays, &mut hits);
        blas.any_hits(rays, &mut blocked);
        let leaks = |(hit, blocked): (&Option<Hit>, bool)| usize::from(hit.is_none()) + usize::from(!blocked);
        hits.iter().zip(blocked).map(leaks).sum::<usize>()
    };
    rays.par_chunks(4096).map(of_some).sum()
}

/// How often `triangles` go around a point: 0 outside. No number on the surface.
///
/// Reference: A. van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", IEEE Transactions on
/// Biomedical Engineering 30(2), 1983.
pub fn winding_number(triangles: &[[Vec3; 3]], point: Vec3) -> f64 {
    let solid_angle = |corners: &[Vec3; 3]| {
        let [a, b, c] = corners.map(|p| p.as_dvec3() - point.as_dvec3());
        let (x, y, z) = (a.length(), b.length(), c.length());
        let across = a.dot(b.cross(c));
        let angle = 2.0 * across.atan2(x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y);
        if angle.abs() < 2.0 * PI - 1e-9 { angle } else { f64::NAN }
    };
    triangles.iter().map(solid_angle).sum::<f64>() / (4.0 * PI)
}

/// Random points strictly inside a closed mesh.
pub fn inside(rng: &mut Rng, triangles: &[[Vec3; 3]], count: usize) -> Vec<Vec3> {
    let bounds = triangles.iter().fold(Aabb::EMPTY, |all, t| all.union(Aabb::around(t)));
    let half = bounds.max * 0.5 - bounds.min * 0.5;
    let mut points = Vec::new();
    while points.len() < count {
        let point = bounds.center() + rng.vec() * half;
        let times = winding_number(triangles, point);
        if times.abs() > 0.5 && (times - times.round()).abs() < 1e-6 {
            points.push(point);
        }
    }
    points
}

/// A ray from `origin`: every third in a random direction, at a random point of a random edge, or exactly at a
/// corner.
pub fn aimed_out(rng: &mut Rng, triangles: &[[Vec3; 3]], origin: Vec3, turn: usize) -> Ray {
    let [a, b, c] = triangles[rng.below(triangles.len())];
    Ray::new(
        origin,
        match turn % 3 {
            0 => rng.direction(),
            1 => a.lerp(b, rng.unit()) - origin,
            _ => c - origin,
        },
    )
}
