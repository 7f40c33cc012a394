//! A ray made ready for boxes and triangles.

use super::{Aabb, Ray};
use glam::{DVec3, Vec3};

/// A [`Ray`] prepared for everything inside one bounding box.
///
/// The triangle test decides with a slightly moved ray: shearing and the edge functions round, by
/// at most 5 units of 2⁻²⁴ of the largest distances involved. The box test must not be stricter, or
/// rays slip through between boxes; so it starts from an origin moved outward by that bound, taken
/// over the whole bounding box once per ray (it costs nothing per node).
///
/// Reference: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013,
/// sections 3.1 to 3.3.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    origin: Vec3,
    direction: Vec3,
    /// Axis of the largest direction component last, the others in the order that keeps winding.
    axes: [usize; 3],
    shear: Vec3,
    /// Reciprocal direction; ±`f32::MAX` where a component is 0, so that 0 · ∞ cannot happen.
    inverse: Vec3,
    near_origin: Vec3,
    far_origin: Vec3,
}

/// Intersection of a [`Probe`] with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Ray parameter.
    pub t: f32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

/// 5 units from the triangle test, 3 from the box test's own operations, rounded up.
const SLACK: f32 = 12.0 / (1 << 24) as f32;
/// A hit nearer than this part of the farthest corner's distance is measured again in double precision.
const CANCELLATION: f32 = 0.25;

impl Probe {
    /// Prepares `ray` for boxes and triangles inside `bounds`.
    #[must_use]
    pub fn new(ray: &Ray, bounds: &Aabb) -> Self {
        Self::with_slack(ray, bounds, 1.0)
    }

    /// As [`Probe::new`], with boxes `factor` times as far beyond their true borders (a [`super::Tlas`]
    /// needs this: a ray that is rounded when transformed may hit what the original misses).
    pub(super) fn with_slack(ray: &Ray, bounds: &Aabb, factor: f32) -> Self {
        let direction = ray.direction;
        let z = direction.abs().max_position();
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if direction[z] < 0.0 {
            (x, y) = (y, x);
        }
        let shear = Vec3::new(direction[x] / direction[z], direction[y] / direction[z], 1.0 / direction[z]);

        let reach = (bounds.min - ray.origin).abs().max((bounds.max - ray.origin).abs());
        // Two steps of the origin's own floats more: far from the world's origin a small sum rounds to nothing.
        let step = ray.origin.abs() * (2.0 * f32::EPSILON) + f32::MIN_POSITIVE;
        let slack = (reach + reach[z]) * (SLACK * factor) + step;
        let outward = Vec3::ONE.copysign(direction);
        let inverse = direction.map(|d| (1.0 / d).clamp(-f32::MAX, f32::MAX));
        Self {
            origin: ray.origin,
            direction,
            axes: [x, y, z],
            shear,
            inverse,
            near_origin: ray.origin + outward * slack,
            far_origin: ray.origin - outward * slack,
        }
    }

    /// Where the ray enters the box, if it does so at 0 ≤ t ≤ `t_max`.
    ///
    /// Every operation is monotonic in the corners: an outer box is never entered after an inner one.
    #[inline]
    #[must_use]
    pub fn enter(&self, min: Vec3, max: Vec3, t_max: f32) -> Option<f32> {
        let (near, far) = self.span(min, max);
        (near <= far.min(t_max)).then_some(near)
    }

    #[inline]
    fn span(&self, min: Vec3, max: Vec3) -> (f32, f32) {
        let backward = self.inverse.cmplt(Vec3::ZERO);
        let near = (Vec3::select(backward, max, min) - self.near_origin) * self.inverse;
        let far = (Vec3::select(backward, min, max) - self.far_origin) * self.inverse;
        (near.max_element().max(0.0), far.min_element())
    }

    /// Where the ray meets the triangle, if at 0 < t ≤ `t_max`.
    ///
    /// Two triangles with a common edge decide about it with the very same operations, so no ray
    /// passes between them. `t` is never below where [`Probe::enter`] enters the triangle's box,
    /// hence a search that skips boxes beyond the best hit finds what trying all triangles finds.
    #[inline]
    #[must_use]
    pub fn triangle(&self, corners: &[Vec3; 3], t_max: f32) -> Option<TriangleHit> {
        let [x, y, z] = self.axes;
        let [a, b, c] = corners.map(|p| p - self.origin);
        let (ax, ay) = (a[x] - self.shear.x * a[z], a[y] - self.shear.y * a[z]);
        let (bx, by) = (b[x] - self.shear.x * b[z], b[y] - self.shear.y * b[z]);
        let (cx, cy) = (c[x] - self.shear.x * c[z], c[y] - self.shear.y * c[z]);
        // No fused multiply-add: an edge must give the negated value in the neighbouring triangle.
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            let edge = |px: f32, py: f32, qx: f32, qy: f32| {
                (f64::from(px) * f64::from(qy) - f64::from(py) * f64::from(qx)) as f32
            };
            (u, v, w) = (edge(cx, cy, bx, by), edge(ax, ay, cx, cy), edge(bx, by, ax, ay));
        }
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        if !determinant.is_finite() {
            return self.huge_triangle(corners, t_max);
        }
        let (az, bz, cz) = (self.shear.z * a[z], self.shear.z * b[z], self.shear.z * c[z]);
        let mut t = (u * az + v * bz + w * cz) / determinant;
        if t <= az.abs().max(bz.abs()).max(cz.abs()) * CANCELLATION {
            t = self.plane_distance(corners).unwrap_or(t);
        }
        let inverse = 1.0 / determinant;
        self.clamped(corners, t, v * inverse, w * inverse, t_max)
    }

    /// t of the triangle's plane in double precision; `None` for a ray in the plane.
    ///
    /// The weighted mean of the corners' distances is no more exact than the largest of them. Near to
    /// the origin of the ray that is not enough: a ray that starts on a large triangle would hit it.
    fn plane_distance(&self, corners: &[Vec3; 3]) -> Option<f32> {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a);
        let t = normal.dot(a - self.origin.as_dvec3()) / normal.dot(self.direction.as_dvec3());
        t.is_finite().then_some(t as f32)
    }

    /// The same in double precision, for coordinates whose products overflow.
    #[cold]
    fn huge_triangle(&self, corners: &[Vec3; 3], t_max: f32) -> Option<TriangleHit> {
        let [x, y, z] = self.axes;
        let shear = self.shear.as_dvec3();
        let [a, b, c] = corners.map(|p| {
            let p = p.as_dvec3() - self.origin.as_dvec3();
            DVec3::new(p[x] - shear.x * p[z], p[y] - shear.y * p[z], shear.z * p[z])
        });
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let determinant = u + v + w;
        if determinant == 0.0 {
            return None;
        }
        let t = (u * a.z + v * b.z + w * c.z) / determinant;
        self.clamped(corners, t as f32, (v / determinant) as f32, (w / determinant) as f32, t_max)
    }

    fn clamped(&self, corners: &[Vec3; 3], t: f32, u: f32, v: f32, t_max: f32) -> Option<TriangleHit> {
        // Also false for NaN.
        if !(t > 0.0 && t <= t_max) {
            return None;
        }
        let [a, b, c] = *corners;
        let (near, _) = self.span(a.min(b).min(c), a.max(b).max(c));
        let t = t.max(near);
        (t <= t_max).then_some(TriangleHit { t, u, v })
    }
}
