//! Cameras.

use bevy_ecs::prelude::*;

/// Looks along local −Z, +Y up.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
#[require(super::Transform)]
pub struct Camera {
    /// How directions meet pixels.
    pub projection: Projection,
}

/// Width over height of the picture that a camera's author had in mind, above 0.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct Aspect(pub f32);

/// How directions meet pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Through one point.
    Perspective {
        /// Vertical field of view, radians, in (0, π).
        vertical_fov: f32,
    },
    /// In parallel.
    Orthographic {
        /// Height of the picture in scene units, above 0.
        height: f32,
    },
}

/// A lens with an extent, on a [`Camera`]'s entity: what is not in focus is blurred. Without it all is sharp.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of its opening in scene units, above 0.
    pub radius: f32,
    /// Distance of the plane that is sharp, along the line of sight, scene units, above 0.
    pub focus: f32,
}

impl Default for Camera {
    /// 45 degrees.
    fn default() -> Self {
        Self { projection: Projection::Perspective { vertical_fov: std::f32::consts::FRAC_PI_4 } }
    }
}

/// The entity whose [`Camera`] makes the picture.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Eq)]
pub struct ActiveCamera(pub Entity);
