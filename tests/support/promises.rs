//! What loading promises of every scene it accepts.

use bevy_ecs::prelude::*;
use penumbra::scene::{ActiveCamera, GlobalTransform, Instance, Mesh, SceneBounds};

/// Every promise of the components that the rest of the program relies on.
pub fn broken_promise(world: &mut World) -> Option<String> {
    let camera = world.get_resource::<ActiveCamera>().map(|active| active.0);
    if camera.is_none_or(|camera| world.get::<GlobalTransform>(camera).is_none_or(|t| !t.0.is_finite())) {
        return Some("no usable active camera".to_owned());
    }
    let bounds = world.get_resource::<SceneBounds>().copied();
    if bounds
        .is_none_or(|bounds| !(bounds.center.is_finite() && bounds.radius > 0.0 && bounds.radius.is_finite()))
    {
        return Some(format!("bounds {bounds:?}"));
    }
    for Mesh(mesh) in world.query::<&Mesh>().iter(world) {
        let vertices = mesh.positions.len();
        let lengths = [mesh.normals.len(), mesh.uvs.len(), mesh.colors.len()];
        if lengths.iter().any(|&length| length != 0 && length != vertices) {
            return Some(format!("attributes of length {lengths:?} for {vertices} vertices"));
        }
        if !mesh.slots.is_empty() && mesh.slots.len() != mesh.triangles.len() {
            return Some("slots do not match triangles".to_owned());
        }
        for corner in mesh.triangles.iter().flatten() {
            if mesh.positions.get(*corner as usize).is_none_or(|p| !p.is_finite()) {
                return Some(format!("vertex {corner} is not there or not finite"));
            }
        }
        let is_unit = |normal: &glam::Vec3| (normal.length() - 1.0).abs() < 1e-4;
        if !mesh.normals.iter().all(is_unit) || !mesh.uvs.iter().all(|uv| uv.is_finite()) {
            return Some("normal not of unit length or texture coordinate not finite".to_owned());
        }
    }
    for instance in world.query::<&Instance>().iter(world) {
        let Some(mesh) = world.get::<Mesh>(instance.mesh) else {
            return Some("instance of no mesh".to_owned());
        };
        if (0..mesh.0.triangles.len()).any(|i| mesh.0.slot(i) >= instance.materials.len()) {
            return Some("slot without a material".to_owned());
        }
    }
    None
}
