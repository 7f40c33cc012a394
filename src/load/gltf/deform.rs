//! Morph targets and skins: what makes a mesh follow weights and joints.

use super::Document;
use super::accessor::Elements;
use crate::load::error::LoadError;
use crate::load::geometry::Part;
use crate::load::report::{Kind, Sink};
use crate::scene::{Influences, Skin, Target, TriangleMesh};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat4, Vec3};
use gltf::json;
use gltf::json::Index;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

/// Sets of four joints that are read: `JOINTS_0` to `JOINTS_7`.
const MOST_SETS: u32 = 8;

/// Bytes of one joint of a vertex and its weight.
const INFLUENCE_MEMORY: usize = size_of::<u16>() + size_of::<f32>();

/// Who makes a mesh change shape.
pub(super) struct Follower {
    /// Node that places it; such a mesh is not shared.
    pub(super) node: usize,
    /// Entity with the weights of its morph targets.
    pub(super) weights: Entity,
    /// The skin, still without what binds it to vertices.
    pub(super) skin: Option<Skin>,
}

/// Default weights of a node's mesh: the node's own, else the mesh's.
pub(super) fn weights_of(
    document: &Document<'_>,
    node: &json::Node,
    mesh: &json::Mesh,
    user: &str,
) -> Result<Vec<f32>, LoadError> {
    let count = mesh.primitives.iter().map(|p| p.targets.as_ref().map_or(0, Vec::len)).max().unwrap_or(0);
    let given = node.weights.as_ref().or(mesh.weights.as_ref());
    document.budget.take(8 * count as u64, document.file, user)?;
    let mut weights = given.cloned().unwrap_or_default();
    weights.resize(count, 0.0);
    weights.iter_mut().filter(|weight| !weight.is_finite()).for_each(|weight| *weight = 0.0);
    Ok(weights)
}

/// Joint entities with their inverse bind matrices.
pub(super) fn skin(
    document: &Document<'_>,
    index: &Index<json::Skin>,
    entities: &[Option<Entity>],
    space: Entity,
    user: &str,
    sink: &mut Sink<'_>,
) -> Result<Skin, LoadError> {
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
    // Each node that wears the skin has joints of its own.
    let memory = skin.joints.len() * size_of::<(Option<Entity>, DAffine3)>();
    document.budget.take(memory as u64, document.file, &format!("{user}, {place}"))?;
    let mut joints = Vec::with_capacity(skin.joints.len());
    for (i, joint) in skin.joints.iter().enumerate() {
        document.at(&document.root.nodes, joint, "node", &place)?;
        let entity = entities[joint.value()];
        if entity.is_none() {
            sink.repaired(document.file, &place, "joint that is not in the scene: stays at its origin");
        }
        let mut joint_from_bind = inverse_bind.as_ref().map_or(DAffine3::IDENTITY, |matrices| {
            DAffine3::from_mat4(DMat4::from_cols_array(&matrices.get::<16>(i)))
        });
        if !joint_from_bind.is_finite() {
            sink.repaired(document.file, &place, "inverse bind matrix not finite: the identity instead");
            joint_from_bind = DAffine3::IDENTITY;
        }
        joints.push((entity, joint_from_bind));
    }
    Ok(Skin { joints, influences: Influences::default(), space })
}

/// Reads what binds the vertices of a primitive to so many joints.
pub(super) fn influences(
    document: &Document<'_>,
    primitive: &Primitive,
    (vertices, count): (&[u32], usize),
    joint_count: usize,
    place: &str,
    sink: &mut Sink<'_>,
) -> Result<Influences, LoadError> {
    let mut sets = Vec::new();
    for set in 0..MOST_SETS {
        let open = |semantic: Semantic| match primitive.attributes.get(&Checked::Valid(semantic)) {
            Some(index) => attribute(document, index, 4, count, &format!("{place}, joints")).map(Some),
            None => Ok(None),
        };
        match open(Semantic::Joints(set))?.zip(open(Semantic::Weights(set))?) {
            Some(pair) => sets.push(pair),
            None => break,
        }
    }
    if sets.is_empty() {
        sink.ignored(
            document.file,
            place,
            "skin, but no JOINTS_0 and WEIGHTS_0: it stays where it is modelled",
        );
    }
    let memory = vertices.len() * 4 * sets.len() * INFLUENCE_MEMORY;
    document.budget.take(memory as u64, document.file, place)?;
    let mut found = Influences { per_vertex: 4 * sets.len(), ..Influences::default() };
    for &vertex in vertices {
        for (joints, weights) in &sets {
            found.joints.extend(joints.get::<4>(vertex as usize).map(|joint| joint as u16));
            found.weights.extend(weights.get_f32::<4>(vertex as usize));
        }
    }
    let pairs = found.joints.iter().zip(&found.weights);
    let lost = pairs.filter(|&(&joint, &weight)| weight > 0.0 && usize::from(joint) >= joint_count).count();
    if lost > 0 {
        let what = "vertices hang on joints that their skin does not have";
        sink.remark(Kind::Ignored, document.file, place, what.to_owned(), lost);
    }
    Ok(found)
}

/// Reads the offsets of a primitive's morph targets.
pub(super) fn targets(
    document: &Document<'_>,
    primitive: &Primitive,
    vertices: &[u32],
    count: usize,
    place: &str,
) -> Result<Vec<Target>, LoadError> {
    let targets = primitive.targets.iter().flatten().enumerate();
    targets
        .map(|(i, target)| {
            let place = format!("{place}, morph target {i}");
            let read = |index: &Option<Index<json::Accessor>>| -> Result<Vec<Vec3>, LoadError> {
                let Some(index) = index else { return Ok(Vec::new()) };
                let elements = attribute(document, index, 3, count, &place)?;
                document.budget.take(size_of_val(vertices) as u64 * 3, document.file, &place)?;
                Ok(vertices.iter().map(|&vertex| Vec3::from(elements.get_f32(vertex as usize))).collect())
            };
            Ok(Target { positions: read(&target.positions)?, normals: read(&target.normals)? })
        })
        .collect()
}

fn attribute<'d>(
    document: &'d Document<'_>,
    index: &Index<json::Accessor>,
    width: usize,
    count: usize,
    place: &str,
) -> Result<Elements<'d>, LoadError> {
    let elements = document.elements(index, place)?;
    if elements.width == width && elements.count == count {
        return Ok(elements);
    }
    let (theirs, other) = (elements.width, elements.count);
    let problem =
        format!("attribute has {theirs} components and a count of {other}, not {width} and {count}");
    Err(document.broken(&elements.place, problem))
}

/// Asks for what [`gather`] and what comes before it take: a part without normals beside others with them gets a vertex
/// for each corner.
pub(super) fn take_for(document: &Document<'_>, parts: &[Part], place: &str) -> Result<(), LoadError> {
    let any_normals = parts.iter().any(|part| part.normals.is_some());
    let vertices = |part: &Part| {
        let corners = if any_normals && part.normals.is_none() { 3 * part.triangles.len() } else { 0 };
        part.positions.len().max(corners)
    };
    let vertices: usize = parts.iter().map(vertices).sum();
    take(document, vertices, most_of(parts), place)
}

fn take(
    document: &Document<'_>,
    vertices: usize,
    [per_vertex, targets]: [usize; 2],
    place: &str,
) -> Result<(), LoadError> {
    let each = per_vertex * INFLUENCE_MEMORY + targets * 2 * size_of::<Vec3>();
    document.budget.take((vertices as u64).saturating_mul(each as u64), document.file, place)
}

/// The most joints of a vertex, and the most morph targets, that a part has.
fn most_of(parts: &[Part]) -> [usize; 2] {
    let joints = parts.iter().map(|part| part.influences.per_vertex).max().unwrap_or(0);
    [joints, parts.iter().map(|part| part.targets.len()).max().unwrap_or(0)]
}

/// What the parts of a mesh have, one after the other as [`crate::load::geometry::merge`] lays them out.
pub(super) fn gather(parts: &[Part]) -> (Influences, Vec<Target>) {
    let [per_vertex, targets] = most_of(parts);
    let mut influences = Influences { per_vertex, ..Influences::default() };
    let mut gathered = vec![Target::default(); targets];
    let mut vertices = 0;
    for part in parts {
        let own = &part.influences;
        for vertex in 0..part.positions.len() {
            let range = vertex * own.per_vertex..(vertex + 1) * own.per_vertex;
            influences.joints.extend_from_slice(&own.joints[range.clone()]);
            influences.weights.extend_from_slice(&own.weights[range]);
            influences.joints.resize(influences.joints.len() + per_vertex - own.per_vertex, 0);
            influences.weights.resize(influences.weights.len() + per_vertex - own.per_vertex, 0.0);
        }
        vertices += part.positions.len();
        for (i, gathered) in gathered.iter_mut().enumerate() {
            let own = part.targets.get(i);
            gathered.positions.extend(own.iter().flat_map(|target| &target.positions));
            gathered.positions.resize(vertices, Vec3::ZERO);
            gathered.normals.extend(own.iter().flat_map(|target| &target.normals));
            gathered.normals.resize(vertices, Vec3::ZERO);
        }
    }
    (influences, gathered)
}

/// Vertices that were split off after `gather` follow what their originals do: there were `count` of them when
/// the corners were those of `triangles`.
pub(super) fn follow_splits(
    document: &Document<'_>,
    (influences, targets): &mut (Influences, Vec<Target>),
    (count, triangles): (usize, &[[u32; 3]]),
    mesh: &TriangleMesh,
    place: &str,
) -> Result<(), LoadError> {
    let mut originals: Vec<usize> = (0..mesh.positions.len()).collect();
    for (&now, &before) in mesh.triangles.iter().flatten().zip(triangles.iter().flatten()) {
        originals[now as usize] = before as usize;
    }
    if originals.len() > count {
        take(document, originals.len(), [influences.per_vertex, targets.len()], place)?;
        *influences = influences.of(originals.iter().copied());
        targets.iter_mut().for_each(|target| *target = target.of(originals.iter().copied()));
    }
    Ok(())
}
