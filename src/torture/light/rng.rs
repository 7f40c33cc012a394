//! Random numbers that are the same every time.

use glam::{DVec3, Vec2, Vec3};

/// A small deterministic source of numbers.
///
/// Reference: M. O'Neill, "PCG: A Family of Simple Fast Space-Efficient Statistically Good Algorithms for Random Number
/// Generation", 2014.
#[derive(Clone, Debug)]
pub struct Rng(pub u64);

impl Rng {
    /// 32 of them.
    pub fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        x.rotate_right((self.0 >> 59) as u32)
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / (1 << 24) as f32
    }

    /// Two of them.
    pub fn pair(&mut self) -> Vec2 {
        Vec2::new(self.unit(), self.unit())
    }

    /// Evenly over the sphere.
    pub fn direction(&mut self) -> Vec3 {
        let (z, phi) = (2.0 * f64::from(self.unit()) - 1.0, std::f64::consts::TAU * f64::from(self.unit()));
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * phi.cos(), r * phi.sin(), z).as_vec3()
    }

    /// 10 to a power between `low` and `high`, of either sign.
    pub fn decades(&mut self, low: f64, high: f64) -> f32 {
        let sign = if self.bits() & 1 == 0 { 1.0 } else { -1.0 };
        (sign * 10f64.powf(low + (high - low) * f64::from(self.unit()))) as f32
    }
}
