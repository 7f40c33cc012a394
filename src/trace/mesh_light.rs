//! Emissive meshes: their triangles as one light.

use super::light::{LightSample, sample_at, sample_flat};
use super::spherical::{SphericalTriangle, meet, weights};
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
        let rest = ((u.x - below) / share).clamp(0.0, 1.0);
        let corners = &self.corners[i];
        let [a, b, c] = *corners;
        let at = |[b1, b2]: [f32; 2]| a * (1.0 - b1 - b2) + b * b1 + c * b2;
        let cross = (b - a).cross(c - a);
        let normal = cross.try_normalize()? * if self.mirrored { -1.0 } else { 1.0 };
        let (sample, [b1, b2]) = if is_near(corners, point) {
            let seen = seen_from(corners, point)?;
            let corners = corners.map(Vec3::as_dvec3);
            let position = meet(&corners, point, seen.sample(f64::from(rest), f64::from(u.y)))?;
            let weights = weights(corners[0], corners[1] - corners[0], corners[2] - corners[0], position);
            let pdf = (f64::from(share) / seen.solid_angle) as f32;
            (sample_at(point, position.as_vec3(), normal, pdf, self.two_sided, Vec3::ONE)?, weights)
        } else {
            let s = rest.sqrt();
            let weights = [s * (1.0 - u.y), s * u.y];
            let area = 0.5 * cross.length() / share;
            (sample_flat(point, at(weights), normal, area, self.two_sided, Vec3::ONE)?, weights)
        };
        Some(LightSample {
            triangle: Some((self.instance, self.triangles[i])),
            uv: Vec2::new(b1, b2),
            ..sample
        })
    }

    /// Density in solid angle of sampling `triangle` from `point` at this distance and cosine at the light.
    #[must_use]
    pub fn pdf(&self, triangle: u32, point: Vec3, distance2: f32, cos: f32) -> f32 {
        let Ok(i) = self.triangles.binary_search(&triangle) else { return 0.0 };
        let share = self.cumulative[i] - if i == 0 { 0.0 } else { self.cumulative[i - 1] };
        if is_near(&self.corners[i], point) {
            return seen_from(&self.corners[i], point)
                .map_or(0.0, |seen| (f64::from(share) / seen.solid_angle) as f32);
        }
        share * distance2 / (triangle_area(&self.corners[i]) * cos.max(1e-9))
    }
}

/// Whether a triangle is so near that it is sampled by solid angle, not by area: its middle is nearer than half of its
/// longest edge.
fn is_near([a, b, c]: &[Vec3; 3], point: Vec3) -> bool {
    let longest = (*b - *a).length_squared().max((*c - *b).length_squared()).max((*a - *c).length_squared());
    4.0 * ((*a + *b + *c) / 3.0 - point).length_squared() < longest
}

fn seen_from(corners: &[Vec3; 3], point: Vec3) -> Option<SphericalTriangle> {
    SphericalTriangle::new(corners.map(|p| p.as_dvec3() - point.as_dvec3()))
}

/// Area of a triangle.
#[must_use]
pub fn triangle_area([a, b, c]: &[Vec3; 3]) -> f32 {
    0.5 * (*b - *a).cross(*c - *a).length()
}
