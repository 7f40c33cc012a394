//! Random numbers that are the same every time.

use glam::{DQuat, Vec2, Vec3};
use std::f64::consts::PI;

/// A small deterministic source of numbers (O'Neill's PCG).
#[derive(Clone, Debug)]
pub struct Rng(pub u64);

impl Rng {
    /// Number `index` of many sources for one `seed`.
    #[must_use]
    pub fn numbered(seed: u64, index: u64) -> Self {
        let mut mixed =
            Self(seed.wrapping_mul(0xd6e8_feb8_6659_fd93) ^ index.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        mixed.bits();
        mixed
    }

    /// Any 32 bits.
    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        x.rotate_right((self.0 >> 59) as u32)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / (1 << 24) as f32
    }

    /// In [0, 1)².
    pub fn pair(&mut self) -> Vec2 {
        Vec2::new(self.unit(), self.unit())
    }

    /// In the cube from −1 to 1.
    pub fn vec(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    /// Any unit vector.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vec();
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    /// One of 0 to `n` - 1.
    pub fn below(&mut self, n: usize) -> usize {
        self.bits() as usize % n
    }

    /// 10 to a power between `low` and `high`, of either sign.
    pub fn decades(&mut self, low: f64, high: f64) -> f32 {
        let sign = if self.bits() & 1 == 0 { 1.0 } else { -1.0 };
        (sign * 10f64.powf(low + (high - low) * f64::from(self.unit()))) as f32
    }

    /// Any turn about any axis.
    pub fn rotation(&mut self) -> DQuat {
        DQuat::from_axis_angle(self.direction().as_dvec3().normalize(), f64::from(self.unit()) * 2.0 * PI)
    }

    /// The numbers below `count` in any order.
    pub fn order(&mut self, count: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..count).collect();
        for i in (1..count).rev() {
            order.swap(i, self.below(i + 1));
        }
        order
    }

    /// A point of a triangle, evenly.
    pub fn point(&mut self, [a, b, c]: [Vec3; 3]) -> Vec3 {
        let s = self.unit().sqrt();
        let v = s * self.unit();
        a * (1.0 - s) + b * (s - v) + c * v
    }
}
