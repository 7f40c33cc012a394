//! Emissive meshes: their triangles as one light.

use super::light::{LightSample, sample_flat};
use glam::{Vec2, Vec3};

/// Triangles of an emissive instance, chosen in proportion to their emitted power.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshLight {
    /// Index of the instance.
    pub instance: u32,
    /// Triangle numbers in the mesh.
    pub triangles: Vec<u32>,
    /// Corners in render space, beside `triangles`.
    pub corners: Vec<[Vec3; 3]>,
    /// Cumulative probability, beside `triangles`; the last is 1.
    pub cumulative: Vec<f32>,
    /// Emits on the back too.
    pub two_sided: bool,
    /// The placement mirrors: the front is where `corners` run clockwise.
    pub mirrored: bool,
    /// Luminance of the radiant exitance summed over the area, W.
    pub power: f32,
}

impl MeshLight {
    /// A direction toward it from `point`; see [`super::light::FlatLight::sample`].
    pub(super) fn sample(&self, point: Vec3, u: Vec2) -> Option<LightSample> {
        let i = self.cumulative.partition_point(|&c| c <= u.x).min(self.cumulative.len() - 1);
        let below = if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        let share = self.cumulative[i] - below;
        // What is left of u.x within this triangle's share is a fresh number.
        let s = ((u.x - below) / share).clamp(0.0, 1.0).sqrt();
        let (b1, b2) = (s * (1.0 - u.y), s * u.y);
        let [a, b, c] = self.corners[i];
        let position = a * (1.0 - b1 - b2) + b * b1 + c * b2;
        let cross = (b - a).cross(c - a);
        let normal = cross.try_normalize()? * if self.mirrored { -1.0 } else { 1.0 };
        let area = 0.5 * cross.length() / share;
        let sample = sample_flat(point, position, normal, area, self.two_sided, Vec3::ONE)?;
        Some(LightSample {
            triangle: Some((self.instance, self.triangles[i])),
            uv: Vec2::new(b1, b2),
            ..sample
        })
    }

    /// Density in solid angle of sampling `triangle` at this distance and cosine at the light.
    #[must_use]
    pub fn pdf(&self, triangle: u32, distance2: f32, cos: f32) -> f32 {
        let Ok(i) = self.triangles.binary_search(&triangle) else { return 0.0 };
        let share = self.cumulative[i] - if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        share * distance2 / (triangle_area(&self.corners[i]) * cos.max(1e-9))
    }
}

/// Area of a triangle.
#[must_use]
pub fn triangle_area([a, b, c]: &[Vec3; 3]) -> f32 {
    0.5 * (*b - *a).cross(*c - *a).length()
}
