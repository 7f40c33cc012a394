//! What textbooks print, to compare with: fast, short, and not watertight.

use crate::bvh::Ray;
use glam::Vec3;

/// T. Möller, B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", Journal of Graphics Tools 2(1),
/// 1997, in single precision and with the paper's epsilon: t, u and v.
#[must_use]
pub fn moller_trumbore(ray: &Ray, [a, b, c]: &[Vec3; 3], t_max: f32) -> Option<(f32, f32, f32)> {
    const EPSILON: f32 = 1e-6;
    let (e, f) = (*b - *a, *c - *a);
    let p = ray.direction.cross(f);
    let determinant = e.dot(p);
    if determinant.abs() < EPSILON {
        return None;
    }
    let inverse = 1.0 / determinant;
    let s = ray.origin - *a;
    let u = s.dot(p) * inverse;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = s.cross(e);
    let v = ray.direction.dot(q) * inverse;
    if v < 0.0 || u + v > 1.0 {
        return None;
    }
    let t = f.dot(q) * inverse;
    (t > 0.0 && t <= t_max).then_some((t, u, v))
}
