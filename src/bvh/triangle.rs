//! Ray and triangle: one formula for single floats and for vectors of any width.
//!
//! Reference: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013.

use super::Probe;
use super::probe::AXES;
use super::simd::{Lanes, Mask, One, Plain, three};
use glam::{DVec3, Vec3};

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

/// A hit nearer than this part of the farthest corner's distance is measured again in double precision.
const CANCELLATION: f32 = 0.25;
/// A hit farther behind the origin than this part of it is surely behind.
const BEHIND: f32 = -1.0 / 1024.0;

/// A ray, or several, along whose largest direction component space is sheared; coordinates in the order
/// of [`Probe`]'s `axes`.
#[derive(Clone, Copy)]
pub(super) struct Shear<V> {
    pub origin: [V; 3],
    pub shear: [V; 3],
}

/// Where rays pass the edges of triangles.
#[derive(Clone, Copy)]
pub(super) struct Edges<V> {
    /// Twice the areas of the triangles between the ray and the edge opposite to each corner.
    pub weights: [V; 3],
    /// The corners' distances along the last axis.
    pub depths: [V; 3],
}

/// Where rays meet triangles whose edges they pass inside.
#[derive(Clone, Copy)]
pub(super) struct Distance<V: Lanes> {
    pub t: V,
    pub inverse_determinant: V,
    /// Of the farthest corner, in multiples of the direction.
    pub reach: V,
    /// In front, and far enough for `t` to be trusted.
    pub ahead: V::Mask,
    /// So near that `t` has to be measured again.
    pub near: V::Mask,
    /// Exactly through an edge, as far as single precision can tell: nothing is known.
    pub on_edge: V::Mask,
}

/// No fused multiply-add: an edge must give the negated value in the neighbouring triangle.
#[inline(always)]
fn edge<V: Lanes>(p: [V; 3], q: [V; 3]) -> V {
    p[0] * q[1] - p[1] * q[0]
}

impl<V: Lanes> Shear<V> {
    #[inline(always)]
    pub fn edges(&self, corners: [[V; 3]; 3]) -> Edges<V> {
        let [a, b, c] = [self.moved(corners[0]), self.moved(corners[1]), self.moved(corners[2])];
        Edges { weights: [edge(c, b), edge(a, c), edge(b, a)], depths: [a[2], b[2], c[2]] }
    }

    #[inline(always)]
    fn moved(&self, p: [V; 3]) -> [V; 3] {
        let [x, y, z] = [p[0] - self.origin[0], p[1] - self.origin[1], p[2] - self.origin[2]];
        [x - self.shear[0] * z, y - self.shear[1] * z, z]
    }

    /// Meant for lanes that are inside.
    #[inline(always)]
    pub fn distance(&self, proof: V::Proof, edges: &Edges<V>) -> Distance<V> {
        let [u, v, w] = edges.weights;
        let [a, b, c] = three(|i| self.shear[2] * edges.depths[i]);
        let zero = V::splat(proof, 0.0);
        let determinant = u + v + w;
        let t = (u * a + v * b + w * c) / determinant;
        let on_edge = u.eq(zero).or(v.eq(zero)).or(w.eq(zero));
        let reach = a.abs().max(b.abs()).max(c.abs());
        let cancels = reach * V::splat(proof, CANCELLATION);
        let surely_behind = reach * V::splat(proof, BEHIND);
        let inverse_determinant = V::splat(proof, 1.0) / determinant;
        let near = t.le(cancels).and(surely_behind.le(t));
        Distance { t, inverse_determinant, reach, ahead: cancels.lt(t), near, on_edge }
    }
}

impl<V: Lanes> Edges<V> {
    /// Whether the ray passes all three edges on the same side, or exactly through one.
    #[inline(always)]
    pub fn inside(&self, proof: V::Proof) -> V::Mask {
        let [u, v, w] = self.weights;
        let zero = V::splat(proof, 0.0);
        zero.le(u.min(v).min(w)).or(u.max(v).max(w).le(zero))
    }
}

impl Probe {
    /// Where the ray meets the triangle, if at 0 < t ≤ `t_max`.
    ///
    /// Two triangles with a common edge decide about it with the very same operations, so no ray
    /// passes between them. `t` is never below where [`Probe::enter`] enters the triangle's box,
    /// hence a search that skips boxes beyond the best hit finds what trying all triangles finds.
    #[must_use]
    pub fn triangle(&self, corners: &[Vec3; 3], t_max: f32) -> Option<TriangleHit> {
        if self.extreme {
            return self.extreme_triangle(corners, t_max);
        }
        let one = |x: f32| One::splat(Plain, x);
        let [x, y, z] = AXES[self.axis];
        let permuted = |p: Vec3| [one(p[x]), one(p[y]), one(p[z])];
        let shear =
            Shear { origin: self.sheared_origin.to_array().map(one), shear: self.shear.to_array().map(one) };
        let mut edges = shear.edges(corners.map(permuted));
        if !edges.inside(Plain) {
            return None;
        }
        if edges.weights.iter().any(|&w| w.get() == 0.0) {
            edges.weights = self.exact_weights(corners)?.map(one);
        }
        let distance = shear.distance(Plain, &edges);
        let mut t = distance.t.get();
        let reach = distance.reach.get();
        if t <= reach * CANCELLATION {
            if t < reach * BEHIND {
                return None;
            }
            t = self.plane_distance(corners).unwrap_or(t);
        }
        let [_, v, w] = edges.weights;
        let inverse = distance.inverse_determinant;
        self.clamped(corners, t, (v * inverse).get(), (w * inverse).get(), t_max)
    }

    /// The end of [`Probe::triangle`] for a near hit whose barycentrics are known.
    #[inline(always)]
    pub(super) fn near_triangle(
        &self,
        corners: &[Vec3; 3],
        rough: TriangleHit,
        t_max: f32,
    ) -> Option<TriangleHit> {
        let t = self.plane_distance(corners).unwrap_or(rough.t);
        self.clamped(corners, t, rough.u, rough.v, t_max)
    }

    /// The edge functions of the sheared corners in double precision, where their products are exact;
    /// `None` if the ray passes outside, or in the plane.
    #[cold]
    fn exact_weights(&self, corners: &[Vec3; 3]) -> Option<[f32; 3]> {
        let [x, y, z] = AXES[self.axis];
        let [a, b, c] = corners.map(|p| {
            let p = p - self.origin;
            (f64::from(p[x] - self.shear.x * p[z]), f64::from(p[y] - self.shear.y * p[z]))
        });
        let edge = |p: (f64, f64), q: (f64, f64)| (p.0 * q.1 - p.1 * q.0) as f32;
        let weights = [edge(c, b), edge(a, c), edge(b, a)];
        let outside = weights.iter().any(|&w| w < 0.0) && weights.iter().any(|&w| w > 0.0);
        (!outside && weights.iter().sum::<f32>() != 0.0).then_some(weights)
    }

    /// t of the triangle's plane in double precision; `None` for a ray in the plane.
    ///
    /// The weighted mean of the corners' distances is no more exact than the largest of them. Near to
    /// the origin of the ray that is not enough: a ray that starts on a large triangle would hit it.
    #[inline(always)]
    fn plane_distance(&self, corners: &[Vec3; 3]) -> Option<f32> {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a);
        let t = normal.dot(a - self.origin.as_dvec3()) / normal.dot(self.direction.as_dvec3());
        t.is_finite().then_some(t as f32)
    }

    /// The same in double precision, for coordinates whose products overflow or vanish.
    #[cold]
    fn extreme_triangle(&self, corners: &[Vec3; 3], t_max: f32) -> Option<TriangleHit> {
        let [x, y, z] = AXES[self.axis];
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

    #[inline(always)]
    pub(super) fn clamped(
        &self,
        corners: &[Vec3; 3],
        t: f32,
        u: f32,
        v: f32,
        t_max: f32,
    ) -> Option<TriangleHit> {
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
