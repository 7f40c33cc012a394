//! Places where light arrives, and how much of it should.

use super::meter::larger;
use super::oracle;
use crate::scene::{Light, Material, TriangleMesh, Visible};
use crate::torture::Place;
use crate::torture::stage::{Stage, quad};
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// See [`Spot::bound`].
pub const BOUND: f64 = 1e-3;

/// Of all receivers.
pub const ALBEDO: f32 = 0.8;

/// 2⁻²⁴, the rounding unit of f32.
pub const UNIT: f64 = 1.0 / (1 << 24) as f64;

/// Roundings on the way to a term of Lambert's sum in single precision: differences of corners 2, cross product 3, dot
/// products 6, lengths 6, quotients 4, polynomial 4; then sum 3, albedo and π 4.
const ROUNDINGS: f64 = 32.0;

/// A function of the place.
pub type AtPoint = Arc<dyn Fn(DVec3) -> f64 + Send + Sync>;

/// A place on a diffuse receiver, and what shines on it.
#[derive(Clone)]
pub struct Spot {
    /// In a few words.
    pub name: String,
    /// Where.
    pub point: DVec3,
    /// Unit normal of the receiver.
    pub normal: DVec3,
    /// Half the side of the receiver, a square.
    pub half: f64,
    /// Height of the camera above it.
    pub eye: f64,
    /// Largest extent of all meshes: coordinates far from the world's origin are known to 2⁻²⁴ of it.
    pub extent: f64,
    /// Lights and what hides them.
    pub things: Vec<Thing>,
    /// What should arrive.
    pub expected: Expected,
    /// Whether it is computed, not sampled, unless somebody wants it to be sampled.
    pub computed: bool,
    /// The largest that 4.5 standard errors may be of it: a test that accepts everything is no test.
    pub bound: f64,
}

/// Something to put on the stage.
#[derive(Clone)]
pub enum Thing {
    /// A light.
    Light(Light, DAffine3),
    /// A light that cameras do not see.
    Unseen(Light, DAffine3),
    /// A mesh.
    Mesh(TriangleMesh, Box<Material>, DAffine3),
}

/// What should arrive at a [`Spot`].
#[derive(Clone)]
pub enum Expected {
    /// Irradiance, and how large the numbers are that it is the sum of.
    Value {
        /// In closed form.
        exact: AtPoint,
        /// See [`oracle::polygon_condition`].
        condition: AtPoint,
        /// What the model itself is off by, relative: a box for a line.
        model: f64,
    },
    /// Exactly nothing.
    Dark,
    /// To the bit what arrives there.
    Same(Box<Spot>),
    /// A number from 0 to 4 π, the most that samples of a ball around the place can bring: it has no answer, or several.
    Finite,
}

impl Spot {
    /// A spot that gets `exact`, of lights that are to be added.
    #[must_use]
    pub fn new(
        name: impl Into<String>,
        point: DVec3,
        normal: DVec3,
        exact: impl Fn(DVec3) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let exact: AtPoint = Arc::new(exact);
        let expected = Expected::Value { condition: Arc::clone(&exact), exact, model: 0.0 };
        Self::that_is(name, point, normal, expected)
    }

    /// A spot of which something else is known.
    #[must_use]
    pub fn that_is(name: impl Into<String>, point: DVec3, normal: DVec3, expected: Expected) -> Self {
        Self {
            name: name.into(),
            point,
            normal: normal.normalize(),
            half: 1.0,
            eye: 0.25,
            extent: 2.0,
            things: Vec::new(),
            expected,
            computed: false,
            bound: BOUND,
        }
    }

    /// One that a parallelogram of radiance 1 shines on, from both its sides.
    #[must_use]
    pub fn under(name: impl Into<String>, point: DVec3, normal: DVec3, [corner, u, v]: [DVec3; 3]) -> Self {
        let corners = [corner, corner + u, corner + u + v, corner + v];
        let normal = normal.normalize();
        let mut spot = Self::new(name, point, normal, move |p| oracle::polygon(&corners, p, normal));
        spot.computed = true;
        spot.with_condition(move |p| oracle::polygon_condition(&corners, p, normal)).with(panel(corner, u, v))
    }

    /// With one more thing.
    #[must_use]
    pub fn with(mut self, thing: Thing) -> Self {
        if let Thing::Mesh(mesh, _, place) = &thing {
            let all = mesh.positions.iter().map(|p| place.transform_point3(p.as_dvec3()));
            let far = all.map(|p| (p - self.point).abs().max_element()).fold(0.0, f64::max);
            self.extent = self.extent.max(far + self.half);
        }
        self.things.push(thing);
        self
    }

    /// With a receiver, and a camera above it, so much smaller than usual that single precision tells its places apart.
    #[must_use]
    pub fn half(mut self, half: f64) -> Self {
        self.half = half;
        self.eye = self.eye.min(4.0 * half);
        self.extent = self.extent.max(2.0 * half);
        if self.things.iter().all(|thing| !matches!(thing, Thing::Mesh(..))) {
            self.extent = 2.0 * half;
        }
        self
    }

    /// With another expectation.
    #[must_use]
    pub fn expecting(self, expected: Expected) -> Self {
        Self { expected, ..self }
    }

    /// With another [`Expected::Value`]'s condition.
    #[must_use]
    pub fn with_condition(mut self, of: impl Fn(DVec3) -> f64 + Send + Sync + 'static) -> Self {
        if let Expected::Value { condition, .. } = &mut self.expected {
            *condition = Arc::new(of);
        }
        self
    }

    /// Of which no more is rounded than the sum: where terms are much larger than that, light is computed in double
    /// precision. A limit by single precision's terms would let black pass.
    #[must_use]
    pub fn in_double_precision(mut self) -> Self {
        if let Expected::Value { exact, condition, .. } = &mut self.expected {
            *condition = Arc::clone(exact);
        }
        self
    }

    /// Side of the picture of it: a few units in the last place of the receiver.
    #[must_use]
    pub fn picture(&self) -> f64 {
        self.half * 2f64.powi(-20)
    }

    /// So far off may the place be at which it is measured, along each axis, before scaling: barycentric weights, the
    /// picture's width, the camera's place and direction, and coordinates far from the origin.
    #[must_use]
    pub fn off(&self, place: Place) -> DVec3 {
        let here = 2.0 * UNIT * (4.0 * self.half + self.eye) + self.picture();
        let there =
            if place.shift == 0.0 { 0.0 } else { 2.0 * UNIT * self.extent + 2f64.powi(-50) * place.shift };
        DVec3::splat(here + there / place.scale) + self.point.abs() * (2.0 * UNIT)
    }

    /// What rounding in single precision may change the irradiance by. `None` if nothing is known of it.
    #[must_use]
    pub fn rounding(&self, place: Place) -> Option<f64> {
        let Expected::Value { exact, condition, model } = &self.expected else { return None };
        let (off, here) = (self.off(place), exact(self.point));
        let corners = (0..8).map(|i| {
            let sign = DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * 2.0 - 1.0;
            // The receiver moves in its own plane and with it.
            (exact(self.point + sign * off) - here).abs()
        });
        // A film counts in multiples of 2⁻⁶⁰ of what leaves the receiver.
        let quantum = 2f64.powi(-61) * std::f64::consts::PI / f64::from(ALBEDO);
        let sums = ROUNDINGS * UNIT * condition(self.point);
        Some(corners.fold(0.0, larger) + sums + quantum + model * here.abs())
    }

    /// Puts all of it on a stage.
    pub fn set(&self, stage: &mut Stage, place: Place) {
        let (a, b) = self.normal.any_orthonormal_pair();
        let corner = (self.point - (a + b) * self.half).as_vec3();
        let (u, v) = ((a * 2.0 * self.half).as_vec3(), (b * 2.0 * self.half).as_vec3());
        stage.add_mesh(quad(corner, u, v), Material::lambert(Vec3::splat(ALBEDO)), DAffine3::IDENTITY);
        for thing in &self.things {
            match thing {
                Thing::Light(light, at) => {
                    stage.add(scaled(light, place.scale), *at);
                }
                Thing::Unseen(light, at) => {
                    stage.add((scaled(light, place.scale), Visible(false)), *at);
                }
                Thing::Mesh(mesh, material, at) => {
                    stage.add_mesh(mesh.clone(), (**material).clone(), *at);
                }
            }
        }
        stage.look(self.point + self.normal * self.eye, self.point, a, self.picture());
    }
}

/// Light that brings the same to a stage `scale` times as large: of lines, and of points.
fn scaled(light: &Light, scale: f64) -> Light {
    let mut light = light.clone();
    match &mut light {
        Light::Segment { strength, .. } => strength.iter_mut().for_each(|s| *s *= scale as f32),
        Light::Point { intensity } | Light::Spot { intensity, .. } => *intensity *= (scale * scale) as f32,
        _ => {}
    }
    light
}

/// A parallelogram of radiance 1 that emits to both sides.
#[must_use]
pub fn panel(corner: DVec3, u: DVec3, v: DVec3) -> Thing {
    Thing::Light(parallelogram(u, v, true), DAffine3::from_translation(corner + (u + v) * 0.5))
}

/// The same around its own middle.
#[must_use]
pub fn parallelogram(u: DVec3, v: DVec3, two_sided: bool) -> Light {
    Light::Parallelogram { edge_u: u.as_vec3(), edge_v: v.as_vec3(), radiance: [Vec3::ONE; 4], two_sided }
}

/// Something opaque.
#[must_use]
pub fn opaque(corner: DVec3, u: DVec3, v: DVec3) -> Thing {
    let mesh = quad(corner.as_vec3(), u.as_vec3(), v.as_vec3());
    Thing::Mesh(mesh, Box::default(), DAffine3::IDENTITY)
}

/// Something that shines with radiance 1 to both sides.
#[must_use]
pub fn shining(mesh: TriangleMesh) -> Thing {
    let material = Material { double_sided: true, ..Material::emissive(Vec3::ONE) };
    Thing::Mesh(mesh, Box::new(material), DAffine3::IDENTITY)
}
