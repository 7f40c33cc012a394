//! What shines, as far as the choice among many needs to know it: how strongly, from where, and to which sides.
//!
//! Reference: A. Conty Estevez, C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", Proc. ACM
//! Computer Graphics and Interactive Techniques 1(2), 2018.

use crate::bvh::Aabb;
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI};

/// Where light is to arrive.
#[derive(Clone, Copy, Debug)]
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
    /// Luminance of the intensity along a normal, W/sr.
    pub intensity: f32,
}

impl Emitter {
    /// Shines to all sides.
    #[must_use]
    pub fn all_round(bounds: Aabb, intensity: f32) -> Self {
        Self { bounds, axis: Vec3::ZERO, spread: PI, intensity }
    }

    /// Flat; its back is dark if it is not `two_sided`.
    #[must_use]
    pub fn flat(bounds: Aabb, normal: Vec3, two_sided: bool, intensity: f32) -> Self {
        if two_sided {
            Self::all_round(bounds, intensity)
        } else {
            Self { bounds, axis: normal, spread: 0.0, intensity }
        }
    }

    /// Both together.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        let (axis, spread) = around_both((self.axis, self.spread), (other.axis, other.spread));
        let intensity = self.intensity + other.intensity;
        Self { bounds: self.bounds.union(other.bounds), axis, spread, intensity }
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
}
