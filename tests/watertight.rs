//! No ray leaves a closed mesh. No tolerance.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::closed::{aimed_out, bumpy_sphere, inside, leaks, outward};
use geometry::scenes::{self, is_closed};
use geometry::{Rng, check, long, shared};
use glam::{DVec3, Vec3};
use penumbra::bvh::{Blas, Isa, Ray};
use rayon::prelude::*;
use std::time::Instant;

#[test]
fn no_ray_leaks_out_of_a_closed_mesh() {
    for shift in [Vec3::ZERO, Vec3::splat(1e3), Vec3::new(148_376.0, 1234.0, -223_423.0)] {
        let triangles = bumpy_sphere(shift);
        assert!(is_closed(&triangles));
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

/// What the other tests ask can be answered with no: one triangle is a hundred thousandth smaller.
#[test]
fn opening_an_edge_lets_rays_out() {
    let mut triangles = bumpy_sphere(Vec3::ZERO);
    let rays = outward(&mut Rng(8), &triangles, Vec3::ZERO, 100_000);
    let center = triangles[40].iter().sum::<Vec3>() / 3.0;
    triangles[40] = triangles[40].map(|p| p.lerp(center, 1e-5));
    assert!(!is_closed(&triangles));
    for isa in Isa::available() {
        let leaks = leaks(&Blas::build(&triangles).with_isa(isa), &rays);
        assert!(leaks > 10, "{leaks}, {}", isa.name());
    }
    triangles.swap_remove(40);
    assert!(Blas::build(&triangles).closest_hit(&Ray::new(Vec3::ZERO, center)).is_none());
}

/// Of a mesh that is closed also when moved far away: triangles that have collapsed there are dropped.
fn moved(triangles: &[[Vec3; 3]], shift: Vec3) -> Option<Vec<[Vec3; 3]>> {
    let mut triangles: Vec<_> = triangles.iter().map(|t| t.map(|p| p + shift)).collect();
    triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
    let flat = |t: &[Vec3; 3]| {
        let [a, b, c] = t.map(Vec3::as_dvec3);
        (b - a).cross(c - a) == DVec3::ZERO
    };
    (is_closed(&triangles) && !triangles.iter().any(flat) && !triangles.is_empty()).then_some(triangles)
}

/// 10⁷ rays for each mesh and place, in batches that go to the kernels in turn (with `PENUMBRA_LONG` all go to
/// each kernel), each once for the closest and once for any hit. Every other ray is normalised.
#[test]
fn no_ray_leaks_out_of_closed_meshes_of_files() {
    const RAYS: usize = 10_000_000;
    const BATCH: usize = 4096;
    let Some(shared) = shared("no_ray_leaks_out_of_closed_meshes_of_files") else {
        return;
    };
    let kernels = Isa::available();
    for file in [
        "obj/spot/spot.obj",
        "obj/cow.obj",
        "obj/fandisk.obj",
        "obj/rocker-arm.obj",
        "obj/horse_quad.obj",
        "gltf/Torus.gltf",
    ] {
        let start = Instant::now();
        let original = scenes::triangles(&shared.join("scenes").join(file));
        assert!(is_closed(&original), "{file}");
        let mut places = vec![(Vec3::ZERO, original)];
        let far = Vec3::new(148_376.0, 1234.0, -223_423.0);
        match moved(&places[0].1, far) {
            Some(triangles) => places.push((far, triangles)),
            None => println!("{file}: not closed any more at {far}"),
        }
        for (shift, triangles) in places {
            let blas = Blas::build(&triangles);
            assert_eq!(check(&blas, &triangles), Ok(()), "{file} at {shift}");
            let blas: Vec<Blas> = kernels.iter().map(|&isa| blas.clone().with_isa(isa)).collect();
            let origins = inside(&mut Rng(1), &triangles, 61);
            let batch = |number: usize| {
                let mut rng = Rng(number as u64);
                let origin = origins[number % origins.len()];
                let rays: Vec<Ray> = (0..BATCH / 2)
                    .flat_map(|turn| {
                        let ray = aimed_out(&mut rng, &triangles, origin, turn);
                        [ray, Ray { direction: ray.direction.normalize(), ..ray }]
                    })
                    .collect();
                if long() {
                    return blas.iter().map(|blas| leaks(blas, &rays)).sum::<usize>();
                }
                leaks(&blas[number % blas.len()], &rays)
            };
            let leaks: usize = (0..RAYS.div_ceil(BATCH)).into_par_iter().map(batch).sum();
            println!(
                "{file} at {shift}: {} triangles, {:.1} s",
                triangles.len(),
                start.elapsed().as_secs_f64()
            );
            assert_eq!(leaks, 0, "{file} at {shift}");
        }
    }
}
