//! The normal to shade with.

use super::reflect;
use crate::scene::NormalMap;
use crate::trace::TraceScene;
use crate::trace::scene::TextureIndex;
use crate::trace::surface::Interaction;
use glam::Vec3;

/// The interpolated normal, tilted as `map` says, in the frame of the mesh's tangents; without those it stays.
///
/// Reference: glTF 2.0 specification, 3.9.3 and 3.7.2.1; M. Mikkelsen, "Simulation of Wrinkled Surfaces
/// Revisited", 2008.
#[must_use]
pub fn tilted(scene: &TraceScene, map: &NormalMap<TextureIndex>, at: &Interaction) -> Vec3 {
    let tangent = at.tangent.truncate();
    if tangent == Vec3::ZERO {
        return at.normal;
    }
    let texel = scene.texture(Some(map.texture), at.uvs).truncate() * 2.0 - 1.0;
    let bitangent = at.normal.cross(tangent) * at.tangent.w;
    let along = tangent * (texel.x * map.scale) + bitangent * (texel.y * map.scale);
    (along + at.normal * texel.z).try_normalize().unwrap_or(at.normal)
}

/// `normal` for wide lobes, or the geometric one if they are on different sides of the surface.
///
/// How much light falls on a surface does not depend on who looks: unlike a mirror's, this normal may face away from the
/// eye. Bent toward it, the rims of smooth things would be lit that no light falls on.
#[must_use]
pub fn facing(normal: Vec3, at: &Interaction) -> Vec3 {
    if normal.dot(at.geometric_normal) > 0.0 { normal } else { at.geometric_normal }
}

/// Cosine to the geometric normal that a mirrored ray keeps at least.
const CLEAR: f32 = 1e-3;

/// `normal`, turned as little toward the eye as a mirror needs to send what it reflects away from the surface.
///
/// Without that, a shading normal lets the eye see itself below the surface: black, or a leak. Where the
/// mirrored ray already leaves the surface nothing changes, and the turning sets in continuously.
///
/// Reference: A. Keller et al., "The Iray Light Transport Simulation and Rendering System", 2017, A.3.
#[must_use]
pub fn clear_of_surface(normal: Vec3, at: &Interaction) -> Vec3 {
    let (wo, flat) = (at.wo, at.geometric_normal);
    let toward = normal.dot(wo);
    // Facing away from the eye: the nearest direction that doesn't.
    let normal = if toward < 0.0 { (normal - wo * toward).normalize_or(flat) } else { normal };
    let mirrored = reflect(wo, normal);
    // So near the horizon there may be no room for more.
    let clear = CLEAR.min(0.5 * flat.dot(wo));
    let height = flat.dot(mirrored);
    if height >= clear {
        return normal;
    }
    // Lifted along the shading normal, or along the geometric one where they hardly agree.
    let upward = if flat.dot(normal) > 0.1 { normal } else { flat };
    let lifted = mirrored + upward * ((clear - height) / flat.dot(upward));
    (wo + lifted.normalize_or(wo)).try_normalize().filter(|n| flat.dot(reflect(wo, *n)) > 0.0).unwrap_or(flat)
}
