//! Closed meshes, and rays that must not leave them.

use super::Rng;
use glam::Vec3;
use penumbra::bvh::{Blas, Ray};

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

pub fn leaks(blas: &Blas, rays: &[Ray]) -> usize {
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    blas.closest_hits(rays, &mut hits);
    blas.any_hits(rays, &mut blocked);
    hits.iter().zip(blocked).map(|(hit, blocked)| usize::from(hit.is_none()) + usize::from(!blocked)).sum()
}
