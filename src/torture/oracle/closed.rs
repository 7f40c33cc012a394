//! Closed meshes, and what is inside of them.

use super::Rng;
use crate::bvh::Aabb;
use glam::Vec3;
use std::collections::HashMap;
use std::f64::consts::PI;

/// Whether every edge has two faces, which go along it in opposite directions. Corners at the same place are
/// the same.
#[must_use]
pub fn is_closed(triangles: &[[Vec3; 3]]) -> bool {
    // With 0 added -0 is 0.
    let place = |p: Vec3| (p + 0.0).to_array().map(f32::to_bits);
    let mut faces: HashMap<_, i32> = HashMap::new();
    for corners in triangles {
        for i in 0..3 {
            *faces.entry((place(corners[i]), place(corners[(i + 1) % 3]))).or_default() += 1;
        }
    }
    faces.iter().all(|(&(a, b), &count)| count == 1 && faces.get(&(b, a)) == Some(&1))
}

/// How often `triangles` go around a point: 0 outside. No number on the surface.
///
/// Reference: A. van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", IEEE Transactions on
/// Biomedical Engineering 30(2), 1983.
#[must_use]
pub fn winding_number(triangles: &[[Vec3; 3]], point: Vec3) -> f64 {
    let solid_angle = |corners: &[Vec3; 3]| {
        let [a, b, c] = corners.map(|p| p.as_dvec3() - point.as_dvec3());
        let (x, y, z) = (a.length(), b.length(), c.length());
        let across = a.dot(b.cross(c));
        let angle = 2.0 * across.atan2(x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y);
        if angle.abs() < 2.0 * PI - 1e-9 { angle } else { f64::NAN }
    };
    triangles.iter().map(solid_angle).sum::<f64>() / (4.0 * PI)
}

/// Random points strictly inside a closed mesh. Fewer, or none, if hardly any place is.
#[must_use]
pub fn inside(rng: &mut Rng, triangles: &[[Vec3; 3]], count: usize) -> Vec<Vec3> {
    let bounds = triangles.iter().fold(Aabb::EMPTY, |all, t| all.union(Aabb::around(t)));
    let half = bounds.max * 0.5 - bounds.min * 0.5;
    let mut points = Vec::new();
    for _ in 0..1000 * count {
        let point = bounds.center() + rng.vec() * half;
        let times = winding_number(triangles, point);
        if times.abs() > 0.5 && (times - times.round()).abs() < 1e-6 {
            points.push(point);
            if points.len() == count {
                break;
            }
        }
    }
    points
}
