//! What shines, as far as the choice among many needs to know it: how strongly, from where, and to which sides.
//!
//! Reference: A. Conty Estevez, C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", Proc. ACM
//! Computer Graphics and Interactive Techniques 1(2), 2018.

use crate::bvh::Aabb;
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI};

/// Where light is to arrive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// In render space.
    pub point: Vec3,
    /// Unit normal of the shaded side.
    pub normal: Vec3,
}

/// Something that shines, as far as the choice needs to know it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Emitter {
    /// Around it.
    pub bounds: Aabb,
    /// Middle of its normals; zero: they have no direction in common.
    pub axis: Vec3,
    /// Largest angle between a normal and `axis`; it shines up to a right angle beyond.
    pub spread: f32,
    /// Shines to the back as to the front: the sign of its normals does not matter.
    pub two_sided: bool,
    /// Luminance of the intensity along a normal, W/sr.
    pub intensity: f32,
    /// How much of that goes where.
    pub sides: Sides,
}

/// Which sides emitters shine to, on average: moments of their normals n, each weighted by its intensity I.
///
/// One that is flat sends I max(0, n·d) in the unit direction d, which is ½ I |n·d| + ½ I n·d. Second parts can be added up; of the
/// first, with weights w, √(Σ w · Σ w (n·d)²) is the sum if all of them are alike, and an upper bound by Cauchy and Schwarz.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sides {
    /// Σ w: half of what shines to one side, all of what shines to two, or to all.
    pub weight: f32,
    /// Σ w n nᵀ: xx, yy, zz, yz, zx and xy; w times the unit matrix for what shines to all sides.
    pub squares: [f32; 6],
    /// Σ ½ I n of what shines to one side.
    pub front: Vec3,
}

impl Sides {
    /// How little their normals have one direction, front or back: 0 if all are parallel, 1 if no direction is more frequent.
    #[must_use]
    pub fn scattered(&self) -> f32 {
        let trace = self.squares[0] + self.squares[1] + self.squares[2];
        let [xx, yy, zz, yz, zx, xy] = self.squares.map(|square| square / trace);
        let norm2 = xx * xx + yy * yy + zz * zz + 2.0 * (yz * yz + zx * zx + xy * xy);
        // The square of the Frobenius norm of a unit trace is from a third to 1. Of nothing that shines nothing is known.
        let scattered = 1.5 * (1.0 - norm2);
        if scattered >= 0.0 { scattered.min(1.0) } else { 0.0 }
    }

    fn map(&self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let [(ax, ay, az), (bx, by, bz)] = [self.front.into(), other.front.into()];
        Self {
            weight: f(self.weight, other.weight),
            squares: std::array::from_fn(|i| f(self.squares[i], other.squares[i])),
            front: Vec3::new(f(ax, bx), f(ay, by), f(az, bz)),
        }
    }
}

impl Emitter {
    /// Shines to all sides.
    #[must_use]
    pub fn all_round(bounds: Aabb, intensity: f32) -> Self {
        let squares = [intensity, intensity, intensity, 0.0, 0.0, 0.0];
        let sides = Sides { weight: intensity, squares, front: Vec3::ZERO };
        Self { bounds, axis: Vec3::ZERO, spread: PI, two_sided: false, intensity, sides }
    }

    /// Flat; its back is dark if it is not `two_sided`.
    #[must_use]
    pub fn flat(bounds: Aabb, normal: Vec3, two_sided: bool, intensity: f32) -> Self {
        let weight = if two_sided { intensity } else { 0.5 * intensity };
        let Vec3 { x, y, z } = normal;
        let squares = [x * x, y * y, z * z, y * z, z * x, x * y].map(|square| weight * square);
        let front = if two_sided { Vec3::ZERO } else { normal * weight };
        let sides = Sides { weight, squares, front };
        Self { bounds, axis: normal, spread: 0.0, two_sided, intensity, sides }
    }

    /// So many times as bright.
    #[must_use]
    pub fn times(&self, factor: f32) -> Self {
        let sides = self.sides.map(&self.sides, |a, _| a * factor);
        Self { intensity: self.intensity * factor, sides, ..*self }
    }

    /// Both together.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let two_sided = self.two_sided || other.two_sided;
        let its_axis = if two_sided && self.axis.dot(other.axis) < 0.0 { -other.axis } else { other.axis };
        let (axis, spread) = around_both((self.axis, self.spread), (its_axis, other.spread));
        let intensity = self.intensity + other.intensity;
        let sides = self.sides.map(&other.sides, |a, b| a + b);
        Self { bounds: self.bounds.union(other.bounds), axis, spread, two_sided, intensity, sides }
    }

    /// What a split is judged by: the chance that it is of use to some point.
    pub(super) fn cost(&self) -> f32 {
        let size = (self.bounds.max - self.bounds.min).max(Vec3::ZERO);
        // Directions that it shines to, weighted by cosine: the integral of the reference's equation 1 for emission up to
        // a right angle.
        let (spread, reach) = (self.spread, (self.spread + FRAC_PI_2).min(PI));
        let (sin, cos) = spread.sin_cos();
        let directions = 2.0 * PI * (1.0 - cos)
            + FRAC_PI_2 * (2.0 * reach * sin - (spread - 2.0 * reach).cos() - 2.0 * spread * sin + cos);
        let directions = if self.two_sided { (2.0 * directions).min(4.0 * PI) } else { directions };
        // Also what has no area takes room.
        let room = Aabb { min: Vec3::ZERO, max: size }.half_area() + size.length_squared();
        self.intensity * room * directions
    }
}

/// The smallest cone around two; see the reference, algorithm 1.
fn around_both(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let (wide, narrow) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    if wide.1 >= PI {
        return (Vec3::ZERO, PI);
    }
    let between = wide.0.dot(narrow.0).clamp(-1.0, 1.0).acos();
    if (between + narrow.1).min(PI) <= wide.1 {
        return wide;
    }
    // Rounded up: no normal may be left out.
    let spread = 0.5 * (wide.1 + between + narrow.1) + 1e-5;
    let turn = spread - wide.1;
    match (narrow.0 - wide.0 * wide.0.dot(narrow.0)).try_normalize() {
        Some(aside) if spread < PI => ((wide.0 * turn.cos() + aside * turn.sin()).normalize(), spread),
        _ => (Vec3::ZERO, PI),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::sampler::{hash, unit_float};

    #[test]
    fn cones_hold_both() {
        let mut random = (0..).map(|i| unit_float(hash(hash(i) ^ 5)));
        let mut next = || random.next().unwrap_or_default();
        for _ in 0..1000 {
            let mut cone = || ((Vec3::new(next(), next(), next()) - 0.5).normalize(), next() * next() * 2.0);
            let (a, b) = (cone(), cone());
            let (axis, spread) = around_both(a, b);
            for (inner, its) in [a, b] {
                let between = axis.dot(inner).clamp(-1.0, 1.0).acos();
                assert!(spread >= PI || between + its <= spread + 1e-3, "{a:?} {b:?} {axis} {spread}");
            }
        }
    }

    /// Of those that are alike the sum; of others never less, and never more than all intensity.
    #[test]
    fn what_is_sent_together_is_at_least_the_sum() {
        let mut random = (0..).map(|i| unit_float(hash(hash(i) ^ 9)));
        let mut next = || random.next().unwrap_or_default();
        let sent = |Sides { weight, squares: [xx, yy, zz, yz, zx, xy], front }: Sides,
                    Vec3 { x, y, z }: Vec3| {
            let squares = xx * x * x + yy * y * y + zz * z * z + 2.0 * (yz * y * z + zx * z * x + xy * x * y);
            (weight * squares).sqrt() + front.dot(Vec3::new(x, y, z))
        };
        for _ in 0..1000 {
            let mut direction = || (Vec3::new(next(), next(), next()) - 0.5).normalize();
            let (normal, other, to) = (direction(), direction(), direction());
            let two_sided = next() < 0.5;
            let of = |normal: Vec3, intensity| Emitter::flat(Aabb::EMPTY, normal, two_sided, intensity);
            let alone = |normal: Vec3| {
                let cosine = normal.dot(to);
                if two_sided { cosine.abs() } else { cosine.max(0.0) }
            };
            let alike = of(normal, 1.0).union(&of(normal, 2.0));
            assert!((sent(alike.sides, to) - 3.0 * alone(normal)).abs() < 1e-5);
            let both = sent(of(normal, 1.0).union(&of(other, 2.0)).sides, to);
            assert!(both > alone(normal) + 2.0 * alone(other) - 1e-5 && both < 3.0 + 1e-5, "{both}");
            assert!((sent(Emitter::all_round(Aabb::EMPTY, 2.0).sides, to) - 2.0).abs() < 1e-5);
        }
    }

    #[test]
    fn normals_are_scattered_or_not() {
        let flat = |normal: Vec3| Emitter::flat(Aabb::EMPTY, normal, false, 2.0);
        let all = [Vec3::X, Vec3::NEG_Y, Vec3::Z].map(flat);
        let scattered = |emitter: Emitter| emitter.sides.scattered();
        let near = |value: f32, exact: f32| (value - exact).abs() < 1e-6;
        assert!(
            near(scattered(all[0]), 0.0) && near(scattered(flat(Vec3::X).union(&flat(Vec3::NEG_X))), 0.0)
        );
        assert!(near(scattered(all[0].union(&all[1])), 0.75));
        assert!(near(scattered(all[0].union(&all[1]).union(&all[2])), 1.0));
        assert!(near(scattered(Emitter::all_round(Aabb::EMPTY, 3.0)), 1.0));
        for nothing in [0.0, f32::INFINITY, f32::NAN] {
            assert_eq!(scattered(all[0].times(nothing)), 0.0);
        }
    }

    /// Which side of a two-sided one is its front does not matter.
    #[test]
    fn two_sided_ones_have_no_front() {
        let of = |normal: Vec3| Emitter::flat(Aabb::EMPTY, normal, true, 1.0);
        let aside = Vec3::new(0.1, 1.0, 0.0).normalize();
        let (same, turned) = (of(Vec3::Y).union(&of(aside)), of(Vec3::Y).union(&of(-aside)));
        assert_eq!((same.spread, same.sides), (turned.spread, turned.sides));
        assert!(same.spread < 0.06, "{}", same.spread);
    }
}
