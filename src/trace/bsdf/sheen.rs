//! Cloth: fibres that stand up from the surface.

use crate::trace::warp::spherical;
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// f · cos of a sheen of colour 1: Estevez and Kulla's distribution with Neubelt's visibility, as glTF has it.
///
/// Reference: A. Estevez, C. Kulla, "Production Friendly Microfacet Sheen BRDF", SIGGRAPH 2017;
/// `KHR_materials_sheen`.
pub(super) fn reflected(roughness: f32, wo: Vec3, wi: Vec3) -> f32 {
    let Some(h) = (wo + wi).try_normalize() else { return 0.0 };
    let inverse = 1.0 / (roughness * roughness);
    let sin = h.truncate().length().min(1.0);
    let distribution = (2.0 + inverse) * sin.powf(inverse) / (2.0 * PI);
    let visibility = 0.25 / (wi.z + wo.z - wi.z * wo.z);
    distribution * visibility * wi.z
}

/// A direction, more often near the horizon, where fine fibres shine.
pub(super) fn sample(u: Vec2) -> Vec3 {
    spherical(u.x * u.x, u.y)
}

/// Density of [`sample`].
pub(super) fn pdf(wi: Vec3) -> f32 {
    1.0 / (4.0 * PI * wi.z.max(1e-12).sqrt())
}
