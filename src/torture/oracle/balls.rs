//! Brute force in a fraction of the time: triangles far away from a ray's line need not be asked.

use super::brute::brute_force_among;
use crate::bvh::{Aabb, Hit, Ray};
use glam::Vec3;

/// A ball around each triangle.
pub struct Balls {
    centers: [Vec<f32>; 3],
    reach2: Vec<f32>,
}

impl Balls {
    /// Larger by a ten thousandth of `size`: some thousand times as much as anything rounds.
    #[must_use]
    pub fn new(triangles: &[[Vec3; 3]], size: f32) -> Self {
        let centers: Vec<Vec3> = triangles.iter().map(|t| t.iter().sum::<Vec3>() / 3.0).collect();
        let reach = |(t, &center): (&[Vec3; 3], &Vec3)| {
            let radius = t.iter().map(|p| p.distance(center)).fold(0.0, f32::max);
            (radius + 1e-4 * size).powi(2)
        };
        Self {
            reach2: triangles.iter().zip(&centers).map(reach).collect(),
            centers: [0, 1, 2].map(|axis| centers.iter().map(|c| c[axis]).collect()),
        }
    }

    /// As trying all does.
    #[must_use]
    pub fn brute_force(&self, bounds: &Aabb, triangles: &[[Vec3; 3]], ray: &Ray) -> Option<Hit> {
        let near = self.near(ray).into_iter().map(|number| (number, &triangles[number as usize]));
        brute_force_among(bounds, near, ray)
    }

    /// Numbers of those that the ray's line meets; where sums overflow, of all.
    fn near(&self, ray: &Ray) -> Vec<u32> {
        let (o, d) = (ray.origin, ray.direction.normalize());
        let [x, y, z] = &self.centers;
        let centers = x.iter().zip(y).zip(z).zip(&self.reach2);
        let far: Vec<f32> = centers
            .map(|(((x, y), z), reach2)| {
                let (x, y, z) = (x - o.x, y - o.y, z - o.z);
                let (u, v, w) = (y * d.z - z * d.y, z * d.x - x * d.z, x * d.y - y * d.x);
                u * u + v * v + w * w - reach2
            })
            .collect();
        (0..).zip(far).filter(|&(_, far)| far <= 0.0 || far.is_nan()).map(|(number, _)| number).collect()
    }
}
