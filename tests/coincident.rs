//! Faces that a file repeats: the lowest index wins. (Of others: case G9 of `torture`.)

#[path = "support/geometry.rs"]
mod geometry;

use geometry::{Rng, aimed_ray, ask, brute_force, scenes, shared};
use glam::Vec3;
use penumbra::bvh::{Blas, Isa, Ray};

/// The same quad three times, once reversed and so cut along its other diagonal, where t may differ in the last
/// place: but no triangle is hit that an earlier one is equal to.
#[test]
fn of_the_faces_that_a_file_repeats_the_first_are_hit() {
    let Some(shared) = shared("of_the_faces_that_a_file_repeats_the_first_are_hit") else {
        return;
    };
    let triangles = scenes::triangles(&shared.join("bad-input/own/obj_duplicate_faces.obj"));
    assert_eq!(triangles.len(), 6);
    let blas = Blas::build(&triangles);
    let mut rng = Rng(12);
    let rays: Vec<Ray> = (0..2000).map(|_| aimed_ray(&mut rng, &triangles, 2.0, Vec3::ZERO)).collect();
    for isa in Isa::available() {
        let hits = ask(isa.name(), &blas.clone().with_isa(isa), &rays);
        assert!(hits.iter().flatten().count() > 500);
        for (hit, ray) in hits.iter().zip(&rays) {
            assert_eq!(*hit, brute_force(&triangles, ray), "{}: {ray:?}", isa.name());
            let Some(hit) = hit else { continue };
            let (before, rest) = triangles.split_at(hit.triangle as usize);
            assert!(!before.contains(&rest[0]), "{}: {ray:?}, {hit:?}", isa.name());
        }
    }
}
