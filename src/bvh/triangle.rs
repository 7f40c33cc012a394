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

/// Of triangles whose shadow along the ray is thinner than this, compared with the box around it and the ray,
/// the distance is measured again in double precision. [`super::probe::SLACK`] follows from it.
pub(super) const THIN: f32 = 1.0 / 8.0;

/// And of triangles whose shadow has so little area (twice it is less) that products are cut off at the end of
/// single precision's range, or a reciprocal is beyond it.
const TINY: f32 = 1e-30;

/// Where rays pass the edges of triangles.
#[derive(Clone, Copy)]
pub(super) struct Edges<V> {
    /// The corners' distances from the ray, along two axes.
    pub offsets: [[V; 2]; 3],
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
    /// In front, and `t` can be trusted.
    pub ahead: V::Mask,
    /// So near or so thin that it has to be measured again.
    pub doubtful: V::Mask,
    /// Doubtful, but `t` is off by less than `margin`.
    pub rough: V::Mask,
    pub margin: V,
    /// Rough, and so near that nothing which leaves the triangle's plane can hit it.
    pub close: V::Mask,
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
        Edges {
            offsets: [[a[0], a[1]], [b[0], b[1]], [c[0], c[1]]],
            weights: [edge(c, b), edge(a, c), edge(b, a)],
            depths: [a[2], b[2], c[2]],
        }
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
        let [a, b, c] = three!(|i| self.shear[2] * edges.depths[i]);
        let zero = V::splat(proof, 0.0);
        let determinant = u + v + w;
        let t = (u * a + v * b + w * c) / determinant;
        let on_edge = u.eq(zero).or(v.eq(zero)).or(w.eq(zero));
        let reach = a.abs().max(b.abs()).max(c.abs());
        let cancels = reach * V::splat(proof, CANCELLATION);
        let surely_behind = reach * V::splat(proof, BEHIND);
        let inverse_determinant = V::splat(proof, 1.0) / determinant;
        let near = t.le(cancels).and(surely_behind.le(t));
        let [a, b, c] = edges.offsets;
        let [x, y, _] = three!(|i| a[i % 2].abs().max(b[i % 2].abs()).max(c[i % 2].abs()));
        let least = (x * y * V::splat(proof, THIN)).max(V::splat(proof, TINY));
        let area = determinant.abs();
        let wide = least.le(area);
        let ahead = cancels.lt(t).and(wide);
        let rough = near.and(wide);
        let margin = reach * V::splat(proof, -BEHIND);
        let close = rough.and(t.le(reach * V::splat(proof, 0.5 * CANCELLATION)));
        let doubtful = near.or(area.lt(least));
        Distance { t, inverse_determinant, ahead, doubtful, rough, margin, close, on_edge }
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
    /// passes between them. The point at `t` is so near to one of the triangle's that [`Probe::enter`] enters
    /// every box around that one at or before `t`: hence a search that skips boxes beyond the best hit, be
    /// they of whole triangles or of their parts, finds what trying all triangles finds.
    #[must_use]
    pub fn triangle(&self, corners: &[Vec3; 3], t_max: f32) -> Option<TriangleHit> {
        if self.extreme {
            return within(self.extreme_triangle(corners)?, t_max);
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
            let weights = self.exact_weights(corners)?;
            if weights.iter().sum::<f64>().abs() < f64::from(TINY) {
                return self.doubtful_triangle(corners, t_max, false);
            }
            edges.weights = weights.map(|w| one(w as f32));
        }
        let distance = shear.distance(Plain, &edges);
        if distance.doubtful.bits() != 0 {
            return self.doubtful_triangle(corners, t_max, distance.close.bits() != 0);
        }
        let [_, v, w] = edges.weights;
        let inverse = distance.inverse_determinant;
        within(TriangleHit { t: distance.t.get(), u: (v * inverse).get(), v: (w * inverse).get() }, t_max)
    }

    /// The end of [`Probe::triangle`] where single precision has decided that the triangle is hit, but cannot
    /// say how far away: at that of its points which is nearest to the ray.
    ///
    /// The weighted mean of the corners' distances is no more exact than the largest of them. Near to the
    /// origin of the ray that is not enough: a ray that starts on a large triangle would hit it. And the
    /// weights themselves are mostly rounding where the triangle is thin. If it is `close` ([`Distance`]), most often
    /// because the ray starts on it, the plane alone may tell: whatever the border, it says the same.
    pub(super) fn doubtful_triangle(
        &self,
        corners: &[Vec3; 3],
        t_max: f32,
        close: bool,
    ) -> Option<TriangleHit> {
        // A ray away from the plane is away from the triangle, whatever its border is nearest to.
        let plane = self.plane(corners);
        if close && plane <= 0.0 {
            return None;
        }
        let [x, y, z] = AXES[self.axis];
        let direction = self.direction.as_dvec3();
        let (shear_x, shear_y) = (direction[x] / direction[z], direction[y] / direction[z]);
        let p = corners.map(|p| {
            let p = p.as_dvec3() - self.origin.as_dvec3();
            DVec3::new(p[x] - shear_x * p[z], p[y] - shear_y * p[z], p[z])
        });
        let edge = |p: DVec3, q: DVec3| p.x * q.y - p.y * q.x;
        let weights = DVec3::new(edge(p[2], p[1]), edge(p[0], p[2]), edge(p[1], p[0]));
        let determinant = weights.element_sum();
        let outside = weights.min_element() < 0.0 && weights.max_element() > 0.0;
        let weights =
            if outside || determinant == 0.0 { nearest_on_border(&p) } else { weights / determinant };
        let depth = weights.x * p[0].z + weights.y * p[1].z + weights.z * p[2].z;
        let t = if plane.is_nan() || outside { depth / direction[z] } else { plane };
        let leaves = plane <= 0.0 && t <= self.reach_of(&p) * f64::from(CANCELLATION);
        let hit = TriangleHit { t: t as f32, u: weights.y as f32, v: weights.z as f32 };
        if leaves { None } else { within(hit, t_max) }
    }

    /// Where the ray meets the triangle's plane; not a number if it has none.
    #[inline(always)]
    fn plane(&self, corners: &[Vec3; 3]) -> f64 {
        let corners = corners.map(Vec3::as_dvec3);
        let normal = cross(&corners);
        let [a, b, c] = corners.map(|p| p - self.origin.as_dvec3());
        let nearer = |p: DVec3, q: DVec3| if q.length_squared() < p.length_squared() { q } else { p };
        normal.dot(nearer(nearer(a, b), c)) / normal.dot(self.direction.as_dvec3())
    }

    /// Of the farthest corner, in multiples of the direction.
    fn reach_of(&self, corners: &[DVec3; 3]) -> f64 {
        let [a, b, c] = corners.map(|p| p.z.abs());
        a.max(b).max(c) * f64::from(self.shear.z.abs())
    }

    /// The edge functions of the sheared corners in double precision, where their products are exact;
    /// `None` if the ray passes outside, or in the plane.
    #[cold]
    fn exact_weights(&self, corners: &[Vec3; 3]) -> Option<[f64; 3]> {
        let [x, y, z] = AXES[self.axis];
        let [a, b, c] = corners.map(|p| {
            let p = p - self.origin;
            (f64::from(p[x] - self.shear.x * p[z]), f64::from(p[y] - self.shear.y * p[z]))
        });
        let edge = |p: (f64, f64), q: (f64, f64)| p.0 * q.1 - p.1 * q.0;
        let weights = [edge(c, b), edge(a, c), edge(b, a)];
        let outside = weights.iter().any(|&w| w < 0.0) && weights.iter().any(|&w| w > 0.0);
        (!outside && weights.iter().sum::<f64>() != 0.0).then_some(weights)
    }

    /// The same in double precision, for coordinates whose products overflow or vanish.
    #[cold]
    fn extreme_triangle(&self, corners: &[Vec3; 3]) -> Option<TriangleHit> {
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
        let [t, u, v] = [t, v / determinant, w / determinant].map(|x| x as f32);
        Some(TriangleHit { t, u, v })
    }
}

/// The normal of a triangle by its right-hand rule, twice as long as its area is large: of its two shorter edges. Two of a
/// needle's long ones are parallel but for what their difference has lost.
#[inline(always)]
#[must_use]
pub fn cross([a, b, c]: &[DVec3; 3]) -> DVec3 {
    let edges = [*b - *a, *c - *b, *a - *c];
    let [ab, bc, ca] = edges.map(DVec3::length_squared);
    let select = |which: bool, yes: DVec3, no: DVec3| DVec3::select(glam::BVec3::splat(which), yes, no);
    let longest_ab = ab > bc.max(ca);
    let longest_bc = bc > ca;
    let first = select(longest_ab, edges[1], select(longest_bc, edges[2], edges[0]));
    let second = select(longest_ab, edges[2], select(longest_bc, edges[0], edges[1]));
    first.cross(second)
}

/// A hit that counts.
#[inline(always)]
pub(super) fn within(hit: TriangleHit, t_max: f32) -> Option<TriangleHit> {
    // False for NaN too.
    (hit.t > 0.0 && hit.t <= t_max).then_some(hit)
}

/// Weights of the point on the triangle's border that is nearest to the origin in x and y.
fn nearest_on_border(corners: &[DVec3; 3]) -> DVec3 {
    let mut best = (f64::INFINITY, DVec3::X);
    for i in 0..3 {
        let k = (i + 1) % 3;
        let (p, q) = (corners[i].truncate(), corners[k].truncate());
        let along = q - p;
        let length2 = along.length_squared();
        let s = if length2 > 0.0 { (-p.dot(along) / length2).clamp(0.0, 1.0) } else { 0.0 };
        let distance2 = (p + along * s).length_squared();
        if distance2 < best.0 {
            let mut weights = DVec3::ZERO;
            weights[i] = 1.0 - s;
            weights[k] = s;
            best = (distance2, weights);
        }
    }
    best.1
}
