//! Directions with zero components, origins on faces of boxes, flat boxes: all that makes 0 · ∞.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::brute_force;
use glam::Vec3;
use penumbra::bvh::{Blas, Ray};

#[test]
fn zero_direction_components_miss_nothing() {
    let mut triangles = Vec::new();
    for (x, y, z) in (0..8).flat_map(|x| (0..8).flat_map(move |y| (0..8).map(move |z| (x, y, z)))) {
        if (x + y + z) % 3 != 0 {
            continue;
        }
        let p = |dx: i32, dy: i32, dz: i32| Vec3::new((x + dx) as f32, (y + dy) as f32, (z + dz) as f32);
        let [a, b, c, d] = [p(0, 0, 0), p(1, 0, 0), p(1, 1, 0), p(0, 1, 0)];
        let [e, f, g, h] = [p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)];
        for [p, q, r, s] in
            [[a, b, c, d], [e, f, g, h], [a, b, f, e], [d, c, g, h], [a, d, h, e], [b, c, g, f]]
        {
            triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    let blas = Blas::build(&triangles);
    let mut tried = 0;
    for d in 0..27 {
        let direction = Vec3::new((d % 3) as f32 - 1.0, (d / 3 % 3) as f32 - 1.0, (d / 9) as f32 - 1.0);
        if direction == Vec3::ZERO {
            continue;
        }
        for negative_zero in [false, true] {
            let direction =
                if negative_zero { direction.map(|c| if c == 0.0 { -0.0 } else { c }) } else { direction };
            // Every 35th of the 21³ origins, others for each direction: brute force over all triangles is slow.
            for o in (d % 7..9261).step_by(7 * 5) {
                let origin = Vec3::new((o % 21) as f32, (o / 21 % 21) as f32, (o / 441) as f32) * 0.5 - 1.0;
                let ray = Ray::new(origin, direction);
                assert_eq!(blas.closest_hit(&ray), brute_force(&triangles, &ray), "{ray:?}");
                tried += 1;
            }
        }
    }
    assert!(tried > 10_000);
    let quad = [[Vec3::ZERO, Vec3::X, Vec3::ONE.with_z(0.0)], [Vec3::ZERO, Vec3::ONE.with_z(0.0), Vec3::Y]];
    let blas = Blas::build(&quad);
    for direction in [Vec3::Z * 1e-30, Vec3::new(1e-45, 0.0, 1.0), Vec3::new(-0.0, -0.0, 1.0)] {
        let hit = blas.closest_hit(&Ray::new(Vec3::new(0.5, 0.25, -1.0), direction));
        assert!(hit.is_some_and(|h| h.t.is_finite()), "{direction:?}");
    }
}
