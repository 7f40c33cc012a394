//! Questions and answers of this room.

use glam::Vec3;

/// The points `origin + t · direction` with 0 < t ≤ `t_max`.
///
/// `direction` need not have unit length: t counts multiples of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where t is 0.
    pub origin: Vec3,
    /// Finite and not zero.
    pub direction: Vec3,
    /// Largest t that counts; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// A ray without an end.
    #[must_use]
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_max: f32::INFINITY }
    }

    /// The point at parameter `t`.
    #[must_use]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }
}

/// Where a ray met a triangle: indices only. Normals, materials and the like are looked up by
/// whoever wants them, and the exact point is better had from the barycentrics than from `t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter, in multiples of the ray's direction.
    pub t: f32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
    /// Index of the triangle in its mesh.
    pub triangle: u32,
    /// Index of the instance in the [`super::Tlas`]; 0 from a lone [`super::Blas`].
    pub instance: u32,
}

impl Hit {
    /// Whether this hit is the one to report of the two: the nearer, and of equally near ones the
    /// one of lower indices, so that coincident faces don't depend on the order of traversal.
    #[must_use]
    pub fn beats(&self, other: &Self) -> bool {
        (self.t, self.instance, self.triangle) < (other.t, other.instance, other.triangle)
    }
}
