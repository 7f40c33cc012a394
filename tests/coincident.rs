//! Faces in the same place: the lowest index wins, whatever the order of work.
#![allow(clippy::duplicate_mod, reason = "two of the modules below use the same random numbers")]

#[path = "support/geometry.rs"]
mod geometry;
#[path = "support/stage.rs"]
mod stage;

use geometry::{Rng, aimed_ray, ask, brute_force, scenes, shared, soup};
use glam::{DAffine3, DVec3, Vec3};
use penumbra::bvh::{Blas, Hit, Isa, Ray};
use penumbra::scene::{Instance, Light, Material, Mesh};
use penumbra::trace::{Film, Integrator};
use rayon::prelude::*;
use stage::{Frames as _, Stage, cube, quad, settings};
use std::sync::Arc;

#[test]
fn of_coincident_faces_the_lowest_index_wins() {
    let mut triangles = soup(300, 0.5, 4);
    let doubled = triangles.clone();
    triangles.extend(doubled);
    let blas = Blas::build(&triangles);
    let mut rng = Rng(3);
    let mut hits = 0;
    for _ in 0..5000 {
        if let Some(hit) = blas.closest_hit(&aimed_ray(&mut rng, &triangles, 2.0, Vec3::ZERO)) {
            assert!(hit.triangle < 300, "{hit:?}");
            hits += 1;
        }
    }
    assert!(hits > 1000);
}

fn shuffle(rng: &mut Rng, count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    for i in (1..count).rev() {
        order.swap(i, rng.below(i + 1));
    }
    order
}

/// Three of each triangle. The index of a triangle is its place in the list, so a shuffled list has other
/// indices: what cannot change is t, and that the lowest index of the list wins.
#[test]
fn the_order_of_the_faces_does_not_matter() {
    let mut rng = Rng(9);
    let single = soup(300, 0.5, 4);
    let triangles: Vec<_> = single.iter().chain(&single).chain(&single).copied().collect();
    let rays: Vec<Ray> = (0..3000).map(|_| aimed_ray(&mut rng, &triangles, 2.0, Vec3::ZERO)).collect();
    let expected: Vec<_> = rays.iter().map(|ray| brute_force(&triangles, ray)).collect();
    for round in 0..4 {
        let order = shuffle(&mut rng, triangles.len());
        let shuffled: Vec<_> = order.iter().map(|&i| triangles[i]).collect();
        let blas = Blas::build(&shuffled);
        for isa in Isa::available() {
            let name = format!("round {round}, {}", isa.name());
            let hits = ask(&name, &blas.clone().with_isa(isa), &rays);
            for ((hit, expected), ray) in hits.iter().zip(&expected).zip(&rays) {
                assert_eq!(*hit, brute_force(&shuffled, ray), "{name}: {ray:?}");
                assert_eq!(hit.map(|h| h.t), expected.map(|h| h.t), "{name}: {ray:?}");
            }
        }
    }
}

#[test]
fn a_thousand_quads_in_one_place_are_the_first() {
    let [a, b, c, d] = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
    let triangles: Vec<_> = (0..1000).flat_map(|_| [[a, b, c], [a, c, d]]).collect();
    let mut rng = Rng(2);
    let rays: Vec<Ray> = (0..512)
        .map(|_| {
            let target = Vec3::new(rng.unit(), rng.unit(), 0.0);
            let origin = target + rng.vec() + Vec3::Z * 2.0;
            Ray::new(origin, target - origin)
        })
        .collect();
    let trace = |threads: usize, isa: Isa| -> Vec<Option<Hit>> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let blas = Blas::build(&triangles).with_isa(isa);
            rays.par_chunks(64).flat_map_iter(|rays| ask(isa.name(), &blas, rays)).collect()
        })
    };
    let first = trace(1, Isa::SCALAR);
    assert!(first.iter().all(|hit| hit.is_some_and(|hit| hit.triangle < 2)), "{first:?}");
    for isa in Isa::available() {
        for threads in [1, 2, 8] {
            assert_eq!(trace(threads, isa), first, "{threads} threads, {}", isa.name());
        }
    }
}

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

/// A room whose floor is there once, or a second time in another colour: as another face of the same mesh, or as
/// an instance of its own. For any number of threads.
#[test]
fn a_doubled_floor_looks_like_the_first_one() {
    let (red, green) = (Vec3::new(0.8, 0.1, 0.1), Vec3::new(0.1, 0.8, 0.1));
    // Each list of colours is a mesh of coincident floors.
    let picture = |meshes: &[&[Vec3]], threads: usize| -> Film {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut stage = Stage::new(settings(40, 30, Integrator::Path, 3));
            let white = Material { double_sided: true, ..Material::lambert(Vec3::splat(0.7)) };
            stage.add_mesh(cube(), white, DAffine3::from_translation(DVec3::Y));
            stage.add(Light::Point { intensity: Vec3::ONE }, DAffine3::from_translation(DVec3::Y * 1.5));
            for colors in meshes {
                let mut floor = quad(Vec3::new(-1.0, 0.125, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
                floor.triangles = floor.triangles.repeat(colors.len());
                floor.slots = (0..colors.len() as u16).flat_map(|slot| [slot; 2]).collect();
                let mesh = stage.app.world.spawn(Mesh(Arc::new(floor))).id();
                let material = |&color: &Vec3| stage.app.world.spawn(Material::lambert(color)).id();
                let materials = colors.iter().map(material).collect();
                stage.add(Instance { mesh, materials }, DAffine3::IDENTITY);
            }
            stage.look_wide(DVec3::new(0.2, 1.4, 0.9), DVec3::new(0.0, 0.2, 0.0));
            stage.trace(16).clone()
        })
    };
    let (is_red, is_green) = (picture(&[&[red]], 1), picture(&[&[green]], 1));
    assert!(is_red != is_green, "the floor is seen");
    let both = picture(&[&[red], &[green]], 1);
    assert!(both == is_red || both == is_green, "one instance, all of it");
    for threads in [1, 2, 8] {
        assert!(picture(&[&[red, green]], threads) == is_red, "{threads} threads");
        assert!(picture(&[&[green, red, red]], threads) == is_green, "three of them, {threads} threads");
        assert!(picture(&[&[red], &[green]], threads) == both, "instances, {threads} threads");
    }
}
