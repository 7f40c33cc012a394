//! Triangles and parallelograms so near that they fill much of the sky: sampled evenly by solid angle, and all that they
//! bring in double precision.
//!
//! A place on them, evenly by area, brings 1 / r² of what another does: near enough, nearly all comes from places that
//! are hardly ever sampled.

use super::quad::Quad;
use glam::{DVec3, Vec2, Vec3};

/// A triangle on the unit sphere.
#[derive(Clone, Copy, Debug)]
pub struct SphericalTriangle {
    a: DVec3,
    b: DVec3,
    c: DVec3,
    /// The angle at a.
    angle: f64,
    /// Its area.
    pub solid_angle: f64,
}

impl SphericalTriangle {
    /// Of a triangle with these corners, as seen from the origin. `None` if it is seen edge-on, or touched.
    ///
    /// Reference: A. van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", IEEE Transactions on Biomedical
    /// Engineering 30(2), 1983.
    #[must_use]
    pub fn new(corners: [DVec3; 3]) -> Option<Self> {
        let [Some(a), Some(b), Some(c)] = corners.map(DVec3::try_normalize) else { return None };
        let volume = a.dot(b.cross(c)).abs();
        let solid_angle = 2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        let angle = volume.atan2(a.cross(b).dot(a.cross(c)));
        (solid_angle > 0.0).then_some(Self { a, b, c, angle, solid_angle })
    }

    /// A unit vector inside, evenly distributed, for two numbers in [0, 1).
    ///
    /// Reference: J. Arvo, "Stratified Sampling of Spherical Triangles", SIGGRAPH 1995.
    #[must_use]
    pub fn sample(&self, x: f64, y: f64) -> DVec3 {
        let Self { a, b, c, angle, .. } = *self;
        // The triangle a, b, d of a share x of the area, with d between a and c.
        let turn = x * self.solid_angle - angle;
        let (sin, cos) = turn.sin_cos();
        let (sin_a, cos_a) = angle.sin_cos();
        // cos turn − cos angle, which may be nearly the same.
        let u = -2.0 * (0.5 * (turn + angle)).sin() * (0.5 * (turn - angle)).sin();
        let v = sin + sin_a * a.dot(b);
        let q = ((v * cos - u * sin) * cos_a - v) / ((v * sin + u * cos) * sin_a);
        // 0 / 0 where the share is nothing: d is a.
        let q = if q > -1.0 {
            q.min(1.0)
        } else if q.is_nan() {
            1.0
        } else {
            -1.0
        };
        let d = a * q + (c - a * c.dot(a)).normalize_or_zero() * (1.0 - q * q).sqrt();
        // Between b and d, 1 − cos from b.
        let w = y * 0.5 * (d - b).length_squared();
        b * (1.0 - w) + (d - b * d.dot(b)).normalize_or_zero() * (w * (2.0 - w)).max(0.0).sqrt()
    }
}

/// A parallelogram on the unit sphere, in two triangles.
#[derive(Clone, Copy, Debug)]
pub struct SphericalQuad {
    halves: [Option<SphericalTriangle>; 2],
    /// Its area.
    pub solid_angle: f64,
}

impl SphericalQuad {
    /// Of `quad` as seen from `point`. `None` if it is seen edge-on, or touched.
    #[must_use]
    pub fn new(quad: &Quad, point: Vec3) -> Option<Self> {
        let [a, b, c, d] = seen_from(quad, point);
        let halves = [[a, b, c], [a, c, d]].map(SphericalTriangle::new);
        let solid_angle = halves.iter().flatten().map(|half| half.solid_angle).sum();
        (solid_angle > 0.0).then_some(Self { halves, solid_angle })
    }

    /// A unit vector inside, evenly distributed, for two numbers in [0, 1).
    #[must_use]
    pub fn sample(&self, random: Vec2) -> Option<DVec3> {
        let first = self.halves[0].map_or(0.0, |half| half.solid_angle) / self.solid_angle;
        let (x, y) = (f64::from(random.x), f64::from(random.y));
        if x < first {
            self.halves[0].map(|half| half.sample(x / first, y))
        } else {
            self.halves[1].map(|half| half.sample((x - first) / (1.0 - first), y))
        }
    }
}

/// Where the direction `toward` from `point` meets the plane of `corners`, no farther away than any of them: from the point
/// itself, so that it is as exact as the direction. `None` if it runs along the plane.
#[must_use]
pub fn meet(corners: &[DVec3], point: Vec3, toward: DVec3) -> Option<DVec3> {
    let point = point.as_dvec3();
    let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let farthest = corners.iter().map(|p| p.distance(point)).fold(0.0, f64::max);
    let t = ((corners[0] - point).dot(normal) / toward.dot(normal)).min(farthest);
    (t > 0.0).then(|| point + toward * t)
}

/// Weights of `u` and `v` in the point `p` of the parallelogram or triangle that they span from `corner`; about 0 to 1.
#[must_use]
pub fn weights(corner: DVec3, u: DVec3, v: DVec3, p: DVec3) -> [f32; 2] {
    let (normal, p) = (u.cross(v), p - corner);
    let inverse = 1.0 / normal.length_squared();
    let weight = |volume: f64| (volume * inverse).clamp(0.0, 1.0) as f32;
    [weight(p.cross(v).dot(normal)), weight(u.cross(p).dot(normal))]
}

fn seen_from(quad: &Quad, point: Vec3) -> [DVec3; 4] {
    let [corner, u, v] = [quad.corner, quad.u, quad.v].map(Vec3::as_dvec3);
    let from = corner - point.as_dvec3();
    [from, from + u, from + u + v, from + v]
}

/// [`Quad::irradiance`] of what of `quad` is above the horizons of both normals, however small, large, near or far it is.
/// 0 or more.
#[must_use]
pub fn irradiance(quad: &Quad, point: Vec3, normals: [Vec3; 2]) -> f64 {
    let [normal, geometric] = normals.map(Vec3::as_dvec3);
    let mut piece = Polygon { corners: [DVec3::ZERO; 8], count: 4 };
    piece.corners[..4].copy_from_slice(&seen_from(quad, point));
    piece.cut(normal);
    if geometric != normal {
        piece.cut(geometric);
    }
    piece.irradiance(normal)
}

/// A convex polygon as seen from the origin.
struct Polygon {
    corners: [DVec3; 8],
    count: usize,
}

impl Polygon {
    /// Leaves what is on the side to which `plane`, a normal, points.
    fn cut(&mut self, plane: DVec3) {
        let before = std::mem::replace(self, Self { corners: [DVec3::ZERO; 8], count: 0 });
        for i in 0..before.count {
            let (a, b) = (before.corners[i], before.corners[(i + 1) % before.count]);
            let (height_a, height_b) = (plane.dot(a), plane.dot(b));
            if height_a > 0.0 {
                self.push(a);
            }
            if (height_a > 0.0) != (height_b > 0.0) {
                self.push(a + (b - a) * (height_a / (height_a - height_b)));
            }
        }
    }

    fn push(&mut self, corner: DVec3) {
        // A cut adds one corner at most: 4, 5, 6.
        if self.count < self.corners.len() {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    fn irradiance(&self, normal: DVec3) -> f64 {
        let sum: f64 = (0..self.count)
            .map(|i| {
                let (a, b) = (self.corners[i], self.corners[(i + 1) % self.count]);
                let cross = a.cross(b - a);
                let sine = cross.length();
                if sine > 0.0 { sine.atan2(a.dot(b)) * normal.dot(cross) / sine } else { 0.0 }
            })
            .sum();
        0.5 * sum.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn an_octant_is_an_eighth_of_the_sphere_evenly() {
        let octant = SphericalTriangle::new([DVec3::X * 3.0, DVec3::Y, DVec3::Z * 0.1]).unwrap();
        assert!((octant.solid_angle - PI / 2.0).abs() < 1e-14);
        let (n, mut sum) = (200, DVec3::ZERO);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n);
            let p = octant.sample(at(i), at(j));
            assert!((p.length() - 1.0).abs() < 1e-12 && p.min_element() > 0.0, "{p}");
            sum += p;
        }
        // The mean height over an octant is a half.
        assert!((sum / f64::from(n * n) - 0.5).abs().max_element() < 1e-4, "{sum}");
    }

    #[test]
    fn corners_of_the_square_are_inside() {
        let quad = Quad::new(Vec3::new(-5e5, -5e5, 1.0), Vec3::X * 1e6, Vec3::Y * 1e6);
        let seen = SphericalQuad::new(&quad, Vec3::ZERO).unwrap();
        assert!((seen.solid_angle / (2.0 * PI) - 1.0).abs() < 1e-5);
        for (x, y) in [(0.0, 0.0), (0.0, 1.0), (0.999_999_9, 0.0), (0.5, 0.5), (0.25, 0.75)] {
            let toward = seen.sample(Vec2::new(x, y)).unwrap();
            assert!((toward.length() - 1.0).abs() < 1e-9 && toward.z > -1e-9, "{toward}");
        }
        assert!((irradiance(&quad, Vec3::ZERO, [Vec3::Z; 2]) - PI).abs() < 1e-10);
    }

    #[test]
    fn what_is_touched_or_edge_on_sends_nothing() {
        let quad = Quad::new(Vec3::ZERO, Vec3::Y, Vec3::Z);
        for point in [Vec3::ZERO, Vec3::new(0.0, -1.0, 0.5), Vec3::new(0.0, 2.0, 2.0)] {
            assert!(SphericalQuad::new(&quad, point).is_none());
            assert_eq!(irradiance(&quad, point, [Vec3::X; 2]), 0.0);
        }
    }
}
