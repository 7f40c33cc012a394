//! The hierarchy against trying every triangle: the same hits, bit for bit, from every kernel.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::{Balls, Rng, aimed_ray, ask, brute_force, brute_force_in, check, long, scenes, shared, soup};
use glam::Vec3;
use penumbra::bvh::{Blas, Isa, Ray};
use proptest::prelude::*;
use rayon::prelude::*;

/// From so far away that triangles are tested in double precision, together with nearer ones that are not.
#[test]
fn a_ray_does_not_depend_on_how_far_away_its_neighbours_start() {
    let triangles: Vec<_> = soup(300, 0.3, 4).into_iter().map(|t| t.map(|p| p * 1e11)).collect();
    let mut rng = Rng(3);
    let rays: Vec<Ray> = (0..2048)
        .map(|i| {
            let target = triangles[rng.below(triangles.len())].iter().sum::<Vec3>() / 3.0;
            let from = Vec3::new(3.0, 2.0, 5.0).normalize() * if i % 2 == 0 { 2e11 } else { 4e12 };
            Ray::new(target + from, -from)
        })
        .collect();
    let blas = Blas::build(&triangles);
    let expected: Vec<_> = rays.iter().map(|ray| brute_force(&triangles, ray)).collect();
    assert!(expected.iter().flatten().count() > 1000);
    for isa in Isa::available() {
        let name = format!("near and far, {}", isa.name());
        assert_eq!(ask(&name, &blas.clone().with_isa(isa), &rays), expected, "{name}");
    }
}

/// Long thin triangles in parts are in many leaves, which then share one list of triangles.
#[test]
fn every_kernel_finds_needles_whose_leaves_share_them() {
    let mut rng = Rng(11);
    let needle = |_| {
        let (p, along) = (rng.vec() * 10.0, rng.vec() * 8.0);
        [p, p + along, p + along + rng.vec() * 0.05]
    };
    let triangles: Vec<[Vec3; 3]> = (0..3000).map(needle).collect();
    let blas = Blas::build(&triangles);
    assert!(blas.hierarchy().prims.len() > 2 * triangles.len(), "not in parts");
    assert_eq!(check(&blas, &triangles), Ok(()));
    // Half of the rays start side by side, so that packets are made of them.
    let scale = 20.0;
    let rays: Vec<Ray> = (0..4000)
        .map(|i| {
            let ray = aimed_ray(&mut rng, &triangles, scale, Vec3::ZERO);
            let eye = Vec3::new(0.0, 0.0, -30.0);
            let target = Vec3::new((i % 64) as f32 * 0.1 - 3.0, (i / 64) as f32 * 0.1 - 3.0, 0.0);
            if i % 128 < 64 { ray } else { Ray::new(eye, target - eye) }
        })
        .collect();
    let expected: Vec<_> =
        rays.par_iter().map(|ray| brute_force_in(&blas.bounds(), &triangles, ray)).collect();
    let hits = expected.iter().flatten().count();
    assert!((1500..3900).contains(&hits), "{hits} hits");
    for isa in Isa::available() {
        let name = format!("needles, {}", isa.name());
        assert_eq!(ask(&name, &blas.clone().with_isa(isa), &rays), expected, "{name}");
    }
    assert!(blas.is_over(&triangles), "what it was built from");
    let mut moved = triangles.clone();
    moved[2999][2].x = moved[2999][2].x.next_up();
    assert!(!blas.is_over(&moved), "one corner is elsewhere");
    assert!(blas.refit(&triangles).is_none(), "parts have no place to move to");
}

/// 10⁶ rays to a mesh of 3732 triangles, half of them aimed at corners and edges: every kernel finds the same as
/// trying all, bit for bit, in packets; one ray of 16 alone too. There is one builder and one width of nodes.
///
/// Triangles far away from a ray's line are known to be missed without asking, else this would take a minute; with
/// `PENUMBRA_LONG` all are asked.
#[test]
fn a_million_rays_agree_with_brute_force() {
    const RAYS: usize = 1_000_000;
    let Some(shared) = shared("a_million_rays_agree_with_brute_force") else {
        return;
    };
    let triangles = scenes::triangles(&shared.join("scenes/obj/wuson/wuson.obj"));
    let blas = Blas::build(&triangles);
    assert_eq!(check(&blas, &triangles), Ok(()));
    let bounds = blas.bounds();
    let scale = (bounds.max - bounds.min).max_element();
    let balls = Balls::new(&triangles, scale);
    let hits: usize = (0..RAYS / 4000)
        .into_par_iter()
        .map(|batch| {
            let mut rng = Rng(batch as u64 * 77 + 5);
            let rays: Vec<Ray> =
                (0..4000).map(|_| aimed_ray(&mut rng, &triangles, scale, bounds.center())).collect();
            let all = |ray: &Ray| brute_force_in(&bounds, &triangles, ray);
            let near = |ray: &Ray| balls.brute_force(&bounds, &triangles, ray);
            let expected: Vec<_> = rays.iter().map(|ray| if long() { all(ray) } else { near(ray) }).collect();
            for isa in Isa::available() {
                let blas = blas.clone().with_isa(isa);
                let mut hits = vec![None; rays.len()];
                let mut blocked = vec![false; rays.len()];
                blas.closest_hits(&rays, &mut hits);
                blas.any_hits(&rays, &mut blocked);
                for (i, ray) in rays.iter().enumerate() {
                    assert_eq!(hits[i], expected[i], "{}: {ray:?}", isa.name());
                    assert_eq!(blocked[i], expected[i].is_some(), "{}, any: {ray:?}", isa.name());
                    if i % 16 == batch % 16 {
                        assert_eq!(blas.closest_hit(ray), expected[i], "{}, alone: {ray:?}", isa.name());
                    }
                }
            }
            expected.iter().flatten().count()
        })
        .sum();
    println!("{} triangles, {hits} of {RAYS} rays hit", triangles.len());
    assert!(hits > RAYS / 4);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn any_soup_agrees_with_brute_force(
        corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-10.0f32..10.0)), 1..60),
        rays in prop::collection::vec((prop::array::uniform3(-12.0f32..12.0), prop::array::uniform3(-1.0f32..1.0)), 1..20),
    ) {
        let triangles: Vec<[Vec3; 3]> = corners.iter().map(|t| t.map(Vec3::from_array)).collect();
        let blas = Blas::build(&triangles);
        prop_assert_eq!(check(&blas, &triangles), Ok(()));
        for (origin, direction) in rays {
            let ray = Ray::new(Vec3::from_array(origin), Vec3::from_array(direction));
            prop_assert_eq!(blas.closest_hit(&ray), brute_force(&triangles, &ray));
        }
    }
}
