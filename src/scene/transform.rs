//! Placement in double precision, so that large translations which cancel do not lose the model.

use bevy_ecs::prelude::*;
use glam::{DAffine3, DQuat, DVec3};

/// `parent_from_local` as an affine map (shear is allowed: glTF matrices may have it).
#[derive(Component, Clone, Copy, Debug, PartialEq)]
#[require(GlobalTransform)]
pub struct Transform(pub DAffine3);

/// `world_from_local`, derived by [`propagate_transforms`]; read-only for everybody else.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub struct GlobalTransform(pub DAffine3);

impl Default for Transform {
    fn default() -> Self {
        Self(DAffine3::IDENTITY)
    }
}

impl Default for GlobalTransform {
    fn default() -> Self {
        Self(DAffine3::IDENTITY)
    }
}

impl Transform {
    /// Scale first, then rotate, then translate.
    #[must_use]
    pub fn from_parts(translation: DVec3, rotation: DQuat, scale: DVec3) -> Self {
        Self(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
    }

    /// A pure translation.
    #[must_use]
    pub fn from_translation(translation: DVec3) -> Self {
        Self(DAffine3::from_translation(translation))
    }

    /// At `eye`, local −Z toward `target`, local +Y as near to `up` as it can be.
    ///
    /// A zero distance, or an `up` along the line of sight, is mended by another axis.
    #[must_use]
    pub fn looking_at(eye: DVec3, target: DVec3, up: DVec3) -> Self {
        let forward = (target - eye).try_normalize().unwrap_or(DVec3::NEG_Z);
        let right = forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        let up = right.cross(forward);
        Self(DAffine3 { matrix3: glam::DMat3::from_cols(right, up, -forward), translation: eye })
    }
}

/// Recomputes [`GlobalTransform`] along the [`ChildOf`] hierarchy, writing only what differs.
///
/// An ancestor without a [`Transform`] counts as the identity. No recursion: a chain of 100,000
/// nodes is fine.
pub fn propagate_transforms(
    changed: Query<(), Or<(Changed<Transform>, Changed<ChildOf>)>>,
    mut orphaned: RemovedComponents<ChildOf>,
    roots: Query<Entity, (Or<(With<Transform>, With<Children>)>, Without<ChildOf>)>,
    children: Query<&Children>,
    local: Query<&Transform>,
    mut global: Query<&mut GlobalTransform>,
) {
    if orphaned.read().count() == 0 && changed.is_empty() {
        return;
    }
    let mut stack: Vec<(Entity, DAffine3)> = roots.iter().map(|root| (root, DAffine3::IDENTITY)).collect();
    while let Some((entity, world_from_parent)) = stack.pop() {
        let parent_from_here = local.get(entity).map_or(DAffine3::IDENTITY, |t| t.0);
        let world_from_here = world_from_parent * parent_from_here;
        if let Ok(mut global) = global.get_mut(entity) {
            global.set_if_neq(GlobalTransform(world_from_here));
        }
        if let Ok(children) = children.get(entity) {
            stack.extend(children.iter().map(|child| (child, world_from_here)));
        }
    }
}
