//! Lights that are not part of a mesh. (An emissive [`super::Material`] makes its mesh a light.)

use super::Sky;
use bevy_ecs::prelude::*;
use glam::Vec3;

/// A light, placed and oriented by its entity's transform; its local axes and lengths are meant below.
///
/// All spectra are linear RGB, 0 or more. A scaled transform scales the shape, not the radiance.
#[derive(Component, Clone, Debug, PartialEq)]
#[require(super::Transform)]
pub enum Light {
    /// At the local origin, the same in all directions. Hard shadows.
    Point {
        /// Radiant intensity, W/sr.
        intensity: Vec3,
    },
    /// At the local origin along −Z. Hard shadows. `KHR_lights_punctual` fall-off.
    Spot {
        /// Radiant intensity on the axis, W/sr.
        intensity: Vec3,
        /// Half angle of full intensity, radians, at least 0.
        inner_angle: f32,
        /// Half angle of darkness, radians, above `inner_angle`, at most π/2.
        outer_angle: f32,
    },
    /// From infinitely far, travelling along local −Z.
    Directional {
        /// Irradiance on a surface facing it, W/m².
        irradiance: Vec3,
        /// Angular diameter of its disc, radians (the sun: 0.0093); 0 gives hard shadows.
        angle: f32,
    },
    /// From (−`half_length`, 0, 0) to (`half_length`, 0, 0): a line, seen by no ray.
    Segment {
        /// Half its length, above 0.
        half_length: f32,
        /// Intensity per length, W/(sr m), perpendicular to the axis: at −X and at +X, linear between.
        strength: [Vec3; 2],
        /// How it depends on the angle to the axis.
        emission: Emission,
    },
    /// Spanned around the local origin; emits to the side of `edge_u` × `edge_v`.
    Parallelogram {
        /// Whole first edge.
        edge_u: Vec3,
        /// Whole second edge.
        edge_v: Vec3,
        /// Radiance, W/(m² sr), at the corners −u−v, +u−v, −u+v, +u+v; bilinear between.
        radiance: [Vec3; 4],
        /// Emits to both sides.
        two_sided: bool,
    },
    /// Around the local origin in the XY plane, emits toward −Z.
    Disk {
        /// Radius, above 0.
        radius: f32,
        /// Radiance, W/(m² sr).
        radiance: Vec3,
        /// Emits to both sides.
        two_sided: bool,
    },
    /// Around the local origin.
    Sphere {
        /// Radius, above 0. A non-uniform scale uses the mean of the three axes.
        radius: f32,
        /// Radiance, W/(m² sr), on the outside and on the inside.
        radiance: Vec3,
    },
    /// Everywhere beyond the scene; no place and no orientation.
    Environment {
        /// Radiance, W/(m² sr).
        radiance: Vec3,
    },
    /// Everywhere beyond the scene, another in each direction; no place.
    Sky {
        /// Its picture, in local directions.
        sky: Sky,
        /// Multiplies the picture's radiance.
        scale: Vec3,
    },
}

/// Directional dependence of a segment's emission at angle θ to its axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Emission {
    /// The same at all θ.
    Isotropic,
    /// ∝ sin θ: the limit of a thin diffuse cylinder of radius ρ and radiance L, strength 2 ρ L.
    #[default]
    Sine,
}

/// Whether parallelogram, disk and sphere lights are solid: seen by rays, and blocking them.
///
/// Solid is the default; insert `Visible(false)` on the light's entity for a lamp that only shines.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visible(pub bool);
