//! No ray leaves a closed mesh. No tolerance.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::Rng;
use geometry::closed::{bumpy_sphere, leaks, outward};
use glam::Vec3;
use penumbra::bvh::{Blas, Isa, Ray};

#[test]
fn no_ray_leaks_out_of_a_closed_mesh() {
    for shift in [Vec3::ZERO, Vec3::splat(1e3), Vec3::new(148_376.0, 1234.0, -223_423.0)] {
        let triangles = bumpy_sphere(shift);
        let blas = Blas::build(&triangles);
        let mut rng = Rng(5);
        for round in 0..10 {
            let rays = outward(&mut rng, &triangles, shift, 50_000);
            for isa in Isa::available() {
                let leaks = leaks(&blas.clone().with_isa(isa), &rays);
                assert_eq!(leaks, 0, "round {round}, at {shift}, {}", isa.name());
            }
            let alone = |ray: &&Ray| blas.closest_hit(ray).is_none() || !blas.any_hit(ray);
            assert_eq!(rays.iter().step_by(10).find(alone), None, "round {round}, at {shift}");
        }
    }
}

/// Slivers are split, and stay as tight as whole triangles: a tube of needles along a diagonal.
#[test]
fn no_ray_leaks_out_of_split_needles() {
    const SIDES: usize = 24;
    let along = Vec3::new(40.0, 37.0, 31.0);
    let across = along.any_orthonormal_vector();
    let other = along.normalize().cross(across);
    let point = |i: usize| {
        let angle = std::f32::consts::TAU * (i % SIDES) as f32 / SIDES as f32;
        (across * angle.cos() + other * angle.sin()) * 0.6
    };
    let mut triangles = Vec::new();
    for i in 0..SIDES {
        let (a, b) = (point(i), point(i + 1));
        triangles.extend([[-along + a, -along + b, along + b], [-along + a, along + b, along + a]]);
        triangles.extend([[-along * 1.02, -along + b, -along + a], [along * 1.02, along + a, along + b]]);
    }
    let blas = Blas::build(&triangles);
    assert!(blas.hierarchy().prims.len() > 4 * triangles.len(), "they were not split");
    let rays = outward(&mut Rng(6), &triangles, Vec3::ZERO, 200_000);
    for isa in Isa::available() {
        assert_eq!(leaks(&blas.clone().with_isa(isa), &rays), 0, "{}", isa.name());
    }
    triangles.remove(7);
    assert!(leaks(&Blas::build(&triangles), &rays) > 0, "one is missing");
}

#[test]
fn opening_an_edge_lets_rays_out() {
    let mut triangles = bumpy_sphere(Vec3::ZERO);
    let hole = triangles.swap_remove(40);
    let blas = Blas::build(&triangles);
    assert!(blas.closest_hit(&Ray::new(Vec3::ZERO, hole.iter().sum::<Vec3>() / 3.0)).is_none());
}
