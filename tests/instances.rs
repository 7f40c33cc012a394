//! Placed meshes.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::closed::bumpy_sphere;
use geometry::{Rng, place, soup};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use penumbra::bvh::{Blas, Hit, Placement, Ray, Tlas};
use std::sync::Arc;

#[test]
fn instances_agree_with_each_alone() {
    let mut rng = Rng(17);
    let meshes: Vec<_> = (0..4).map(|i| soup(200, 0.4, 100 + i)).collect();
    let placements: Vec<_> = (0..40)
        .map(|i| {
            let rotation =
                DQuat::from_axis_angle(rng.direction().as_dvec3().normalize(), f64::from(rng.unit()) * 6.0);
            let scale = DVec3::new(1.0, 0.3, if i % 3 == 0 { -2.0 } else { 1.5 });
            let at = rng.vec().as_dvec3() * 8.0;
            place(&meshes[i % 4], DAffine3::from_scale_rotation_translation(scale, rotation, at))
        })
        .collect();
    let tlas = Tlas::build(placements.clone());
    for i in 0..2_100 {
        let ray = Ray::new(rng.vec() * 12.0, rng.direction());
        let expected = placements
            .iter()
            .zip(0..)
            .filter_map(|(p, instance)| {
                let hit = Tlas::build(vec![p.clone()]).closest_hit(&ray)?;
                Some(Hit { instance, ..hit })
            })
            .reduce(|a, b| if b.beats(&a) { b } else { a });
        assert_eq!(tlas.closest_hit(&ray), expected, "ray {i}");
        assert_eq!(tlas.any_hit(&ray), expected.is_some(), "any-hit, ray {i}");
    }
}

#[test]
fn no_ray_leaks_out_of_a_closed_instance() {
    let triangles = bumpy_sphere(Vec3::ZERO);
    let mut rng = Rng(23);
    let mut leaks = 0;
    for _ in 0..200 {
        let rotation =
            DQuat::from_axis_angle(rng.direction().as_dvec3().normalize(), f64::from(rng.unit()) * 6.0);
        let scale = DVec3::from_array([(); 3].map(|()| 10f64.powf(f64::from(rng.unit()) * 4.0 - 2.0)));
        let at = rng.vec().as_dvec3() * 10f64.powf(f64::from(rng.unit()) * 8.0 - 4.0);
        let placed = DAffine3::from_scale_rotation_translation(scale, rotation, at);
        let tlas = Tlas::build(vec![place(&triangles, placed)]);
        for _ in 0..500 {
            let origin = placed.transform_point3(rng.vec().as_dvec3() * 0.5).as_vec3();
            let corner = triangles[rng.below(triangles.len())][0];
            let target = placed.transform_point3(corner.as_dvec3()).as_vec3();
            let ray = Ray::new(origin, target - origin);
            leaks += u32::from(tlas.closest_hit(&ray).is_none()) + u32::from(!tlas.any_hit(&ray));
        }
    }
    assert_eq!(leaks, 0);
}

#[test]
fn a_singular_placement_is_refused() {
    let blas = Arc::new(Blas::build(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]));
    assert!(Placement::new(Arc::clone(&blas), DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0))).is_none());
    assert!(Placement::new(blas, DAffine3::from_translation(DVec3::splat(f64::NAN))).is_none());
}

#[test]
fn nothing_is_hit_where_there_is_nothing() {
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(Blas::build(&[]).closest_hit(&ray), None);
    assert_eq!(Tlas::build(Vec::new()).closest_hit(&ray), None);
    assert!(!Tlas::build(vec![place(&[], DAffine3::IDENTITY)]).any_hit(&ray));
}
