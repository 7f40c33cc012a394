//! The oracle that tries every triangle, with the engine's own triangle routine.

use super::Tracer;
use crate::bvh::{Aabb, Hit, Probe, Ray};
use glam::Vec3;

/// Every triangle tried with the same routine, by the same rule about equals.
#[must_use]
pub fn brute_force(triangles: &[[Vec3; 3]], ray: &Ray) -> Option<Hit> {
    brute_force_in(&bounds(triangles), triangles, ray)
}

/// The same with known bounds.
#[must_use]
pub fn brute_force_in(bounds: &Aabb, triangles: &[[Vec3; 3]], ray: &Ray) -> Option<Hit> {
    brute_force_among(bounds, (0..).zip(triangles), ray)
}

/// The same among some of the triangles, given with their numbers.
pub(super) fn brute_force_among<'a>(
    bounds: &Aabb,
    triangles: impl Iterator<Item = (u32, &'a [Vec3; 3])>,
    ray: &Ray,
) -> Option<Hit> {
    let probe = Probe::new(ray, bounds);
    let mut best: Option<Hit> = None;
    for (triangle, corners) in triangles {
        if let Some(h) = probe.triangle(corners, best.map_or(ray.t_max, |b| b.t)) {
            let hit = Hit { t: h.t, u: h.u, v: h.v, triangle, instance: 0 };
            if best.is_none_or(|b| hit.beats(&b)) {
                best = Some(hit);
            }
        }
    }
    best
}

fn bounds(triangles: &[[Vec3; 3]]) -> Aabb {
    triangles.iter().fold(Aabb::EMPTY, |all, t| all.union(Aabb::around(t)))
}

/// Where a ray meets a triangle: t, u and v, if at 0 < t ≤ the last argument.
type Routine = fn(&Ray, &[Vec3; 3], f32) -> Option<(f32, f32, f32)>;

/// A [`Tracer`] that tries every triangle with a routine of its own: what a textbook says, or a saboteur.
pub struct Brute {
    triangles: Vec<[Vec3; 3]>,
    routine: Routine,
}

impl Brute {
    /// Over `triangles`.
    #[must_use]
    pub fn new(triangles: &[[Vec3; 3]], routine: Routine) -> Self {
        Self { triangles: triangles.to_vec(), routine }
    }
}

impl Tracer for Brute {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        for (triangle, corners) in (0..).zip(&self.triangles) {
            if let Some((t, u, v)) = (self.routine)(ray, corners, best.map_or(ray.t_max, |b| b.t)) {
                let hit = Hit { t, u, v, triangle, instance: 0 };
                if best.is_none_or(|b| hit.beats(&b)) {
                    best = Some(hit);
                }
            }
        }
        best
    }

    fn any_hit(&self, ray: &Ray) -> bool {
        self.triangles.iter().any(|corners| (self.routine)(ray, corners, ray.t_max).is_some())
    }
}
