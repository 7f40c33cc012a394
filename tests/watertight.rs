//! No ray leaves the closed meshes of files. No tolerance. (Of meshes that need no file: case G1 of `torture`.)

#[path = "support/geometry.rs"]
mod geometry;

use geometry::{Rng, check, inside, is_closed, long, scenes, shared};
use glam::Vec3;
use penumbra::bvh::{Blas, Isa, Ray};
use penumbra::torture::geometry::leaks::aimed_out;
use penumbra::torture::geometry::meshes::moved;
use rayon::prelude::*;
use std::time::Instant;

/// How many of the rays, asked together for their closest hit and for any, say that there is none.
fn leaks(blas: &Blas, rays: &[Ray]) -> usize {
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    blas.closest_hits(rays, &mut hits);
    blas.any_hits(rays, &mut blocked);
    let leaks =
        hits.iter().zip(blocked).map(|(hit, blocked)| usize::from(hit.is_none()) + usize::from(!blocked));
    leaks.sum()
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
        match moved(&places[0].1, |p| p + far) {
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
