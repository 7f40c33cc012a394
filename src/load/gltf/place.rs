//! Where nodes stand, and what stands on them.

use super::Document;
use super::mesh::Built;
use super::parse::Placement;
use crate::load::error::LoadError;
use crate::load::report::Sink;
use crate::scene::{Instance, Pose, Transform};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf::json::{self, Index};

/// Most nodes and instances of one file together.
pub(super) const MOST_NODES: usize = 1 << 22;
/// Bytes that a node or instance takes in the world, with its name and places.
pub(super) const NODE_MEMORY: usize = 600;

/// Puts the mesh on its node, or once at each place that `EXT_mesh_gpu_instancing` lists.
pub(super) fn place(
    document: &Document<'_>,
    node: &json::Node,
    entity: Entity,
    built: &Built,
    user: &str,
    sink: &mut Sink<'_>,
) -> Result<(), LoadError> {
    let others = node.extensions.as_ref().map(|extensions| &extensions.others);
    let Some(lists) = others.and_then(|others| others.get("EXT_mesh_gpu_instancing")?.get("attributes"))
    else {
        instantiate(built, entity, sink);
        return Ok(());
    };
    let open = |name: &str, width: usize| {
        let index = lists.get(name).and_then(serde_json::Value::as_u64).and_then(|i| u32::try_from(i).ok());
        let Some(index) = index else { return Ok(None) };
        let elements = document.elements(&Index::new(index), &format!("{user}, instances {name}"))?;
        if elements.width == width {
            Ok(Some(elements))
        } else {
            Err(document.broken(user, format!("instances: {name} of a wrong type")))
        }
    };
    let (translation, rotation, scale) = (open("TRANSLATION", 3)?, open("ROTATION", 4)?, open("SCALE", 3)?);
    let counts = || [&translation, &rotation, &scale].into_iter().flatten().map(|elements| elements.count);
    let count = match counts().max() {
        Some(count) => count,
        // Those that have a number or a colour and no place stand all on the node.
        None => match lists.as_object().and_then(|lists| lists.values().next()?.as_u64()) {
            Some(index) => {
                let index = Index::new(u32::try_from(index).unwrap_or(u32::MAX));
                document.elements(&index, &format!("{user}, instances"))?.count
            }
            None => 0,
        },
    };
    if counts().any(|other| other != count) || sink.spawned().len() + count > MOST_NODES {
        return Err(document.broken(user, "instances: lists of unequal or too large count"));
    }
    let memory = NODE_MEMORY + built.materials.len() * size_of::<Entity>();
    document.budget.take(count as u64 * memory as u64, document.file, &format!("{user}, instances"))?;
    for i in 0..count {
        let parts = Placement {
            matrix: None,
            translation: translation.as_ref().map(|elements| elements.get(i)),
            rotation: rotation.as_ref().map(|elements| elements.get(i)),
            scale: scale.as_ref().map(|elements| elements.get(i)),
        };
        let name = Name::new(format!("instance {i}"));
        let copy = sink.spawn((name, Transform(parts.affine().0), ChildOf(entity)));
        instantiate(built, copy, sink);
    }
    Ok(())
}

pub(super) fn instantiate(built: &Built, entity: Entity, sink: &mut Sink<'_>) {
    sink.report.triangles += built.triangles;
    if let Some(mesh) = built.entity {
        sink.world.entity_mut(entity).insert(Instance { mesh, materials: built.materials.clone() });
    }
}

impl Placement {
    /// `parent_from_node`, and whether it had to be mended.
    fn affine(&self) -> (DAffine3, bool) {
        if let Some(matrix) = self.matrix {
            let matrix = DMat4::from_cols_array(&matrix);
            let is_affine = matrix.row(3) == glam::DVec4::W;
            return (DAffine3::from_mat4(matrix), !is_affine);
        }
        let length = self.stored_rotation().length();
        (Transform::from(self.parts()).0, (length - 1.0).abs() > 1e-2 || !length.is_finite())
    }

    /// What animations move one by one. Of a matrix, which the format does not let them move, one of its partings.
    pub(super) fn pose(&self) -> Pose {
        if self.matrix.is_none() {
            return self.parts();
        }
        let (scale, rotation, translation) = self.affine().0.to_scale_rotation_translation();
        Pose { translation, rotation, scale }
    }

    /// As the file has them: nobody can tell from their product which axes are mirrored, or how what has no size is turned.
    fn parts(&self) -> Pose {
        let stored = self.stored_rotation();
        let length = stored.length();
        let rotation = if length > 0.0 && length.is_finite() { stored / length } else { DQuat::IDENTITY };
        let translation = self.translation.map_or(DVec3::ZERO, DVec3::from);
        Pose { translation, rotation, scale: self.scale.map_or(DVec3::ONE, DVec3::from) }
    }

    fn stored_rotation(&self) -> DQuat {
        DQuat::from_array(self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]))
    }
}

pub(super) fn placement(
    document: &Document<'_>,
    i: usize,
    sink: &mut Sink<'_>,
) -> Result<DAffine3, LoadError> {
    let Some(placement) = document.placements.get(i) else {
        return Ok(DAffine3::IDENTITY);
    };
    let (affine, mended) = placement.affine();
    if !affine.is_finite() {
        return Err(document.broken(format!("node {i}"), "its transform is not finite"));
    }
    if mended {
        let what = if placement.matrix.is_some() {
            "matrix is not affine: its last row is ignored"
        } else {
            "rotation is not a unit quaternion: normalised"
        };
        sink.repaired(document.file, &format!("node {i}"), what);
    }
    Ok(affine)
}
