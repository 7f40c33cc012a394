//! Pairs of numbers in [0, 1) → directions, and offsets from surfaces.

use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Cosine-distributed around +Z.
#[must_use]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    spherical((1.0 - u.x).sqrt(), u.y)
}

/// The unit vector at this cosine to +Z and this fraction of a turn.
#[must_use]
pub fn spherical(cos: f32, turn: f32) -> Vec3 {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (y, x) = (turn * 2.0 * PI).sin_cos();
    Vec3::new(sin * x, sin * y, cos)
}

/// Uniform in the cone around unit `axis` with this squared sine of its half angle.
#[must_use]
pub fn cone(axis: Vec3, sin2_max: f32, u: Vec2) -> Vec3 {
    // 1 − cos θ without cancellation, also for a cone of microradians.
    let one_minus_cos = one_minus_cos(sin2_max) * u.x;
    let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    let (y, x) = (2.0 * PI * u.y).sin_cos();
    let (tangent, bitangent) = axis.any_orthonormal_pair();
    ((tangent * x + bitangent * y) * sin + axis * (1.0 - one_minus_cos)).normalize()
}

/// Density in solid angle of [`cone`].
#[must_use]
pub fn cone_pdf(sin2_max: f32) -> f32 {
    1.0 / (2.0 * PI * one_minus_cos(sin2_max))
}

fn one_minus_cos(sin2: f32) -> f32 {
    sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())
}

/// Uniform in the unit disk.
#[must_use]
pub fn disk(u: Vec2) -> Vec2 {
    let (y, x) = (2.0 * PI * u.y).sin_cos();
    Vec2::new(x, y) * u.x.sqrt()
}

/// Uniform over all directions.
#[must_use]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let (y, x) = (2.0 * PI * u.y).sin_cos();
    Vec3::new(r * x, r * y, z)
}

/// `point` moved along `normal` until it is clear of the error box around itself.
#[must_use]
pub fn offset(point: Vec3, error: Vec3, normal: Vec3) -> Vec3 {
    let moved = point + normal * error.dot(normal.abs());
    let outward = |p: f32, n: f32| {
        if n > 0.0 {
            p.next_up()
        } else if n < 0.0 {
            p.next_down()
        } else {
            p
        }
    };
    Vec3::new(outward(moved.x, normal.x), outward(moved.y, normal.y), outward(moved.z, normal.z))
}
