//! Places of hits at the end of single precision. (Directions with zero components: case G3 of `torture`.)

use glam::Vec3;
use penumbra::bvh::{Blas, Isa, Ray};

/// A square that a ray meets edge on: the determinant is so small that its reciprocal overflows.
#[test]
fn a_hit_always_has_a_place() {
    let [a, b, c] = [Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::ONE];
    let ray = Ray::new(Vec3::new(1.0, 0.0, -0.5), Vec3::new(1e-45, 0.0, 1.0));
    for isa in Isa::available() {
        if let Some(hit) = Blas::build(&[[a, b, c]]).with_isa(isa).closest_hit(&ray) {
            assert!(hit.u.is_finite() && hit.v.is_finite(), "{}: {hit:?}", isa.name());
        }
    }
}

/// The same from a triangle that is small enough, seen from far enough away that nobody calls it extreme.
#[test]
fn a_tiny_triangle_is_hit_where_it_is() {
    for size in [1e-18, 1e-20, 1e-23] {
        let triangle = [Vec3::ZERO, Vec3::X * size, Vec3::Y * size];
        let ray = Ray::new(Vec3::new(0.25 * size, 0.25 * size, 1.0), Vec3::NEG_Z);
        for isa in Isa::available() {
            let hit = Blas::build(&[triangle]).with_isa(isa).closest_hit(&ray);
            let right =
                hit.is_some_and(|h| h.t == 1.0 && (h.u - 0.25).abs() < 1e-3 && (h.v - 0.25).abs() < 1e-3);
            assert!(right, "{size:e}, {}: {hit:?}", isa.name());
        }
    }
}
