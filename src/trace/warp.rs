//! Pairs of numbers in [0, 1) → directions, and offsets from surfaces.

use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Cosine-distributed around +Z.
#[inline(always)]
#[must_use]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    spherical((1.0 - u.x).sqrt(), u.y)
}

/// The unit vector at this cosine to +Z and this fraction of a turn.
#[inline(always)]
#[must_use]
pub fn spherical(cos: f32, turn: f32) -> Vec3 {
    let sin2 = 1.0 - cos * cos;
    let sin = if sin2 > 0.0 { sin2.sqrt() } else { 0.0 };
    let (x, y) = on_circle(turn);
    Vec3::new(sin * x, sin * y, cos)
}

/// Cosine and sine of a part of a turn in 0..=1, within 2⁻²³: the Taylor series around the nearest quarter.
#[inline(always)]
#[must_use]
pub fn on_circle(turn: f32) -> (f32, f32) {
    let quarter = |from: f32| f32::from(u8::from(turn >= from));
    let quarters = quarter(0.125) + quarter(0.375) + quarter(0.625) + quarter(0.875);
    let a = (turn - 0.25 * quarters) * (2.0 * PI);
    let a2 = a * a;
    let sin =
        a * (1.0 + a2 * (-1.0 / 6.0 + a2 * (1.0 / 120.0 + a2 * (-1.0 / 5040.0 + a2 * (1.0 / 362_880.0)))));
    let cos = 1.0 + a2 * (-0.5 + a2 * (1.0 / 24.0 + a2 * (-1.0 / 720.0 + a2 * (1.0 / 40_320.0))));
    let odd = (quarters == 1.0) | (quarters == 3.0);
    let (x, y) = if odd { (sin, cos) } else { (cos, sin) };
    let x = if (quarters == 1.0) | (quarters == 2.0) { -x } else { x };
    let y = if (quarters == 2.0) | (quarters == 3.0) { -y } else { y };
    (x, y)
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
#[inline(always)]
#[must_use]
pub fn offset(point: Vec3, error: Vec3, normal: Vec3) -> Vec3 {
    let moved = point + normal * error.dot(normal.abs());
    Vec3::new(outward(moved.x, normal.x), outward(moved.y, normal.y), outward(moved.z, normal.z))
}

/// The next number on the side of `n`; the same if that is 0.
#[inline(always)]
fn outward(p: f32, n: f32) -> f32 {
    // Numbers of one sign are in the order of their bits.
    let bits = p.to_bits();
    let away = (p > 0.0) == (n > 0.0);
    let stepped = if away { bits.wrapping_add(1) } else { bits.wrapping_sub(1) };
    // From either zero to the least number of that sign.
    let stepped = if p == 0.0 { n.to_bits() & (1 << 31) | 1 } else { stepped };
    if (n == 0.0) | !p.is_finite() { p } else { f32::from_bits(stepped) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn on_circle_is_cosine_and_sine() {
        for i in 0..=100_000 {
            let turn = i as f32 / 100_000.0;
            let (sin, cos) = (f64::from(turn) * std::f64::consts::TAU).sin_cos();
            let (x, y) = on_circle(turn);
            let error = (f64::from(x) - cos).abs().max((f64::from(y) - sin).abs());
            assert!(error < 1.2e-7 * 2.0, "{turn}: {error:e}");
        }
    }

    #[test]
    fn outward_is_the_neighbour_on_that_side() {
        for p in [0.0, -0.0, 1.0, -1.0, 3.5e-45, -1e-45, f32::MAX, f32::INFINITY, 1e-38, -2.5] {
            for n in [1.0, -1.0, 0.0, -0.0, 1e-30, -3.0_f32] {
                let expected = if n > 0.0 {
                    p.next_up()
                } else if n < 0.0 {
                    p.next_down()
                } else {
                    p
                };
                // A ray never starts at infinity: either answer does.
                if p.is_finite() {
                    assert_eq!(outward(p, n).to_bits(), expected.to_bits(), "{p:e} toward {n}");
                }
            }
        }
    }
}
