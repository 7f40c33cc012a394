//! Parallelograms that shine, as a surface point sees them: samples in proportion to very nearly what they bring,
//! and all that a point gets where nothing is in the way, in closed form.
//!
//! Everything here is written for loops over many points: no branches that matter, no calls, the same operations
//! whatever the instructions.

use glam::{Vec2, Vec3};

/// `corner` + a `u` + b `v`, a and b in 0..=1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    /// Where a and b are 0.
    pub corner: Vec3,
    /// Whole first edge.
    pub u: Vec3,
    /// Whole second edge.
    pub v: Vec3,
    /// Unit normal, u × v.
    pub normal: Vec3,
    /// |u × v|.
    pub area: f32,
}

/// How a point's irradiance depends on the place on a quad: bilinear between what the corners bring, up to a factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brightness {
    /// At (0, 0), (1, 0), (0, 1), (1, 1), each 0 or more.
    corners: [f32; 4],
}

/// A place on a quad, and its density by area times the area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// In 0..=1.
    pub a: f32,
    /// In 0..=1.
    pub b: f32,
    /// 1 where all places are alike; 0 if there is none that brings light.
    pub density: f32,
}

impl Place {
    /// The place for two numbers in [0, 1), all places alike.
    #[inline(always)]
    #[must_use]
    pub fn evenly(random: Vec2) -> Self {
        Self { a: random.x, b: random.y, density: 1.0 }
    }
}

impl Quad {
    /// Between these edges.
    #[must_use]
    pub fn new(corner: Vec3, u: Vec3, v: Vec3) -> Self {
        let cross = u.cross(v);
        Self { corner, u, v, normal: cross.normalize_or(Vec3::Z), area: cross.length() }
    }

    /// The corners around it.
    #[inline(always)]
    #[must_use]
    pub fn corners(&self) -> [Vec3; 4] {
        let (u, v) = (self.corner + self.u, self.corner + self.v);
        [self.corner, u, u + self.v, v]
    }

    /// The place (a, b).
    #[inline(always)]
    #[must_use]
    pub fn at(&self, place: &Place) -> Vec3 {
        self.corner + self.u * place.a + self.v * place.b
    }

    /// What `point` with unit `normal` sees of it. Irradiance goes with cos / d⁴ here: the light's own cosine is the
    /// point's height over it over d, and the height is the same for all of the light.
    ///
    /// A place between dark corners only is dark (n · d is linear in a and b), so no place that brings light is
    /// left out.
    #[inline(always)]
    #[must_use]
    pub fn brightness(&self, point: Vec3, normal: Vec3) -> Brightness {
        let d00 = self.corner - point;
        let d10 = d00 + self.u;
        let d01 = d00 + self.v;
        let d11 = d10 + self.v;
        let l00 = d00.length_squared();
        let l10 = d10.length_squared();
        let l01 = d01.length_squared();
        let l11 = d11.length_squared();
        // In units of the nearest corner's distance: the fourth power leaves the range of f32 soon.
        let nearest = lesser(lesser(l00, l10), lesser(l01, l11));
        Brightness {
            corners: [
                corner(normal.dot(d00), nearest, l00),
                corner(normal.dot(d10), nearest, l10),
                corner(normal.dot(d01), nearest, l01),
                corner(normal.dot(d11), nearest, l11),
            ],
        }
    }

    /// Irradiance at `point` with unit `normal` from radiance 1 of all of it, nothing being in the way. Right only
    /// where all of it is above the horizon; 0 or more on its front, 0 or less behind.
    ///
    /// Reference: J. H. Lambert, "Photometria", 1760; D. R. Baum, H. E. Rushmeier, J. M. Winget, "Improving
    /// Radiosity Solutions Through the Use of Analytically Determined Form-Factors", SIGGRAPH 1989.
    #[inline(always)]
    #[must_use]
    pub fn irradiance(&self, point: Vec3, normal: Vec3) -> f32 {
        let d00 = self.corner - point;
        let d10 = d00 + self.u;
        let d11 = d10 + self.v;
        let d01 = d00 + self.v;
        let l00 = d00.length();
        let l10 = d10.length();
        let l11 = d11.length();
        let l01 = d01.length();
        // The edges themselves instead of differences: no cancellation, however small it looks.
        let sum = edge(normal, d00, self.u, l00, l10, d00.dot(d10))
            + edge(normal, d10, self.v, l10, l11, d10.dot(d11))
            - edge(normal, d01, self.u, l01, l11, d11.dot(d01))
            - edge(normal, d00, self.v, l01, l00, d01.dot(d00));
        -0.5 * sum
    }

    /// Whether all of it is above the horizon of `normal`.
    #[inline(always)]
    #[must_use]
    pub fn is_above(&self, point: Vec3, normal: Vec3) -> bool {
        let (first, by_u, by_v) = (normal.dot(self.corner - point), normal.dot(self.u), normal.dot(self.v));
        (first > 0.0) & (first + by_u > 0.0) & (first + by_v > 0.0) & (first + by_u + by_v > 0.0)
    }

    /// Whether it is so near that places are not sampled by what they bring, but evenly by solid angle: nearer than a quarter
    /// of its longer edge. (There the corners say little about the middle; evenly by area, what is right above would have
    /// 1.3 times the variance.)
    #[inline(always)]
    #[must_use]
    pub fn is_near(&self, point: Vec3) -> bool {
        let d = point - self.corner;
        let inverse = 1.0 / self.area;
        let a = d.cross(self.v).dot(self.normal) * inverse;
        let b = self.u.cross(d).dot(self.normal) * inverse;
        let a = greater(lesser(a, 1.0), 0.0);
        let b = greater(lesser(b, 1.0), 0.0);
        let off = d - self.u * a - self.v * b;
        16.0 * off.length_squared() < greater(self.u.length_squared(), self.v.length_squared())
    }

    /// Whether it looks so large that rounding leaves 16 bits of [`Quad::irradiance`] at least. And it is not so near that
    /// the angle of an edge comes close to half a turn.
    #[inline(always)]
    #[must_use]
    pub fn is_large(&self, point: Vec3) -> bool {
        let d00 = self.corner - point;
        let d11 = d00 + self.u + self.v;
        let far2 = greater(d00.length_squared(), d11.length_squared());
        let (u2, v2) = (self.u.length_squared(), self.v.length_squared());
        let height = self.normal.dot(d00);
        (lesser(u2, v2) > 4e-4 * far2) & (height * height > 1e-4 * greater(u2, v2))
    }
}

impl Brightness {
    #[inline(always)]
    fn sum(&self) -> f32 {
        let [f00, f10, f01, f11] = self.corners;
        (f00 + f10) + (f01 + f11)
    }

    /// The density at (a, b) as [`Place::density`].
    #[inline(always)]
    #[must_use]
    pub fn density(&self, a: f32, b: f32) -> f32 {
        let [f00, f10, f01, f11] = self.corners;
        let sum = self.sum();
        let here = (f00 + (f10 - f00) * a) * (1.0 - b) + (f01 + (f11 - f01) * a) * b;
        let density = 4.0 * here / sum;
        if sum > 0.0 { density } else { 0.0 }
    }

    /// The place for two numbers in [0, 1), evenly distributed.
    #[inline(always)]
    #[must_use]
    pub fn sample(&self, random: Vec2) -> Place {
        let [f00, f10, f01, f11] = self.corners;
        let b = linear(random.y, f00 + f10, f01 + f11);
        let a = linear(random.x, f00 + (f01 - f00) * b, f10 + (f11 - f10) * b);
        Place { a, b, density: self.density(a, b) }
    }
}

/// One corner's part of a [`Brightness`].
#[inline(always)]
fn corner(height: f32, nearest: f32, distance2: f32) -> f32 {
    let ratio = nearest / distance2;
    // A corner at the very point gives NaN, and counts as dark.
    let brought = height * (ratio * ratio);
    if (height > 0.0) & (ratio > 0.0) { brought } else { 0.0 }
}

/// A number in 0..=1 with a density that goes linearly from `at_0` to `at_1`.
#[inline(always)]
fn linear(random: f32, at_0: f32, at_1: f32) -> f32 {
    let root = (at_0 * at_0 + random * ((at_1 - at_0) * (at_1 + at_0))).sqrt();
    let x = random * (at_0 + at_1) / (at_0 + root);
    // Also for 0 / 0: a place of no density.
    if x < 1.0 { x } else { 1.0 }
}

/// One edge's part of the sum: (n · d × e) times the angle it is seen at over |d × e|, with `cosine` that of the angle
/// times both distances.
#[inline(always)]
fn edge(normal: Vec3, d: Vec3, e: Vec3, l0: f32, l1: f32, cosine: f32) -> f32 {
    let scale = 1.0 / (l0 * l1);
    normal.dot(d.cross(e)) * scale * angle_over_sine(cosine * scale)
}

/// arccos(c) / √(1 − c²), by a polynomial of arcsin(√z) / √z in z = (1 − |c|) / 2: within 2⁻²² of it, relatively, for
/// c above −0.99.
#[inline(always)]
#[must_use]
pub fn angle_over_sine(c: f32) -> f32 {
    let magnitude = lesser(c.abs(), 1.0);
    let z = 0.5 - 0.5 * magnitude;
    let mut p = P[0];
    for coefficient in &P[1..] {
        p = p * z + coefficient;
    }
    // θ = 2 √z p and sin θ = 2 √z √(1 − z).
    let acute = p / (1.0 - z).sqrt();
    let sine = 2.0 * (z * (1.0 - z)).sqrt();
    if c > 0.0 { acute } else { std::f32::consts::PI / sine - acute }
}

/// From the highest power down.
const P: [f32; 8] =
    [0.111960895, -0.09404627, 0.07822892, 0.015827905, 0.046636216, 0.07486847, 0.16666993, 1.0];

#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
