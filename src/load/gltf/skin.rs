//! Skins in their rest pose: joints where the nodes put them.

use super::Document;
use super::accessor::Elements;
use crate::load::error::LoadError;
use crate::load::geometry::Part;
use glam::{DAffine3, DMat3, DMat4, DVec3};
use gltf::json::Index;
use gltf::json::skin::Skin;

/// `root_from_bind` of each joint, given `root_from_node` of each node.
pub(super) fn joints(
    document: &Document<'_>,
    index: &Index<Skin>,
    world: &[Option<DAffine3>],
    user: &str,
) -> Result<Vec<DAffine3>, LoadError> {
    let skin = document.at(&document.root.skins, index, "skin", user)?;
    let place = format!("skin {}", index.value());
    let inverse_bind = match &skin.inverse_bind_matrices {
        Some(accessor) => Some(document.elements(accessor, &place)?),
        None => None,
    };
    if inverse_bind
        .as_ref()
        .is_some_and(|matrices| matrices.width != 16 || matrices.count < skin.joints.len())
    {
        return Err(document.broken(&place, "inverse bind matrices of a wrong type or count"));
    }
    let mut joints = Vec::with_capacity(skin.joints.len());
    for (i, joint) in skin.joints.iter().enumerate() {
        document.at(&document.root.nodes, joint, "node", &place)?;
        let root_from_joint = world[joint.value()].unwrap_or(DAffine3::IDENTITY);
        let joint_from_bind = inverse_bind.as_ref().map_or(DAffine3::IDENTITY, |matrices| {
            DAffine3::from_mat4(DMat4::from_cols_array(&matrices.get::<16>(i)))
        });
        joints.push(root_from_joint * joint_from_bind);
    }
    Ok(joints)
}

/// Moves vertices by the weighted mean of their joints. One without weights stays.
pub(super) fn pose(
    part: &mut Part,
    vertices: &[u32],
    matrices: &[DAffine3],
    joints: &Elements<'_>,
    weights: &Elements<'_>,
) {
    for (i, &vertex) in vertices.iter().enumerate() {
        let (joint, weight) = (joints.get::<4>(vertex as usize), weights.get::<4>(vertex as usize));
        let mut sum = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
        let mut total = 0.0;
        for (joint, weight) in joint.into_iter().zip(weight) {
            if let Some(matrix) = matrices.get(joint as usize).filter(|_| weight > 0.0) {
                sum.matrix3 += matrix.matrix3 * weight;
                sum.translation += matrix.translation * weight;
                total += weight;
            }
        }
        if total <= 0.0 {
            continue;
        }
        let position = part.positions[i].as_dvec3();
        part.positions[i] = ((sum.matrix3 * position + sum.translation) / total).as_vec3();
        if let Some(tangents) = &mut part.tangents {
            let turned = (sum.matrix3 * tangents[i].truncate().as_dvec3()).normalize_or_zero().as_vec3();
            // A mirroring pose turns the cross product of normal and tangent round.
            tangents[i] = turned.extend(tangents[i].w * sum.matrix3.determinant().signum() as f32);
        }
        if let Some(normals) = &mut part.normals {
            // Cofactors are the inverse transpose times the determinant, and exist for flat matrices too.
            let [x, y, z] = [sum.matrix3.x_axis, sum.matrix3.y_axis, sum.matrix3.z_axis];
            let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
            let turned = cofactors * normals[i].as_dvec3() * sum.matrix3.determinant().signum();
            normals[i] = turned.normalize_or_zero().as_vec3();
        }
    }
}
