//! The hierarchy against trying every triangle: the same hits, bit for bit, from every kernel.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::{Rng, aimed_ray, ask, brute_force, check, same_as_brute_force, soup};
use glam::{DVec3, Vec3};
use penumbra::bvh::{Blas, Isa, Ray};
use proptest::prelude::*;

#[test]
fn closest_hit_agrees_with_brute_force() {
    for (count, size) in [(1, 1.0), (2, 1.0), (5, 0.5), (100, 0.3), (3000, 0.1), (300, 3.0)] {
        same_as_brute_force(&format!("{count} triangles of {size}"), &soup(count, size, 3), 2000);
    }
}

#[test]
fn far_and_small_scenes_agree_with_brute_force() {
    for scale in [1e-3, 1.0, 1e3] {
        for shift in
            [Vec3::ZERO, Vec3::splat(1e3), Vec3::splat(1e5), Vec3::new(148_376.0, 1234.0, -223_423.0)]
        {
            let mut triangles: Vec<_> =
                soup(400, 0.3, 21).into_iter().map(|t| t.map(|p| p * scale + shift)).collect();
            // Rounded to f32 some collapse to a line, which has no surface.
            triangles.retain(|t| {
                let [a, b, c] = t.map(Vec3::as_dvec3);
                (b - a).cross(c - a) != DVec3::ZERO
            });
            if triangles.len() < 10 {
                continue;
            }
            same_as_brute_force(&format!("scale {scale}, shift {shift}"), &triangles, 1000);
        }
    }
}

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
