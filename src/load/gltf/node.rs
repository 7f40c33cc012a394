//! The node hierarchy: checked, then spawned from the roots down without recursion.

use super::deform::{self, Follower};
use super::material::Palette;
use super::mesh::Meshes;
use super::place::{MOST_NODES, instantiate, place, placement};
use super::{Document, animation, light, units};
use crate::load::error::LoadError;
use crate::load::report::Sink;
use crate::scene::{Mesh, MorphWeights, Transform, TriangleMesh};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};

/// A skinned mesh whose first joint is farther from zero is counted from there.
const FAR_SKIN: f64 = 256.0;

/// Spawns the default scene (else the first, else all root nodes) below `root`.
pub(super) fn spawn_scene(
    document: &Document<'_>,
    root: Entity,
    mut palette: Palette,
    sink: &mut Sink<'_>,
) -> Result<(), LoadError> {
    let nodes = &document.root.nodes;
    if nodes.len() > MOST_NODES {
        return Err(document.broken("nodes", format!("{} nodes: the limit is {MOST_NODES}", nodes.len())));
    }
    let parents = check_hierarchy(document)?;
    let roots = scene_roots(document, &parents, sink)?;
    let local: Vec<DAffine3> =
        (0..nodes.len()).map(|i| placement(document, i, sink)).collect::<Result<_, _>>()?;
    let order = top_down(document, &roots);
    let hidden = hidden(document, &order, &parents, sink);
    // Where those of the scene stand in the file as a whole.
    let mut placed: Vec<Option<DAffine3>> = vec![None; nodes.len()];
    for &i in &order {
        placed[i] = Some(parents[i].and_then(|parent| placed[parent]).unwrap_or_default() * local[i]);
    }
    let mut entities: Vec<Option<Entity>> = vec![None; nodes.len()];
    let before = sink.spawned().len();
    let mut meshes = Meshes::default();
    if nodes.iter().all(|node| node.mesh.is_none()) && !document.root.meshes.is_empty() {
        sink.decide(document.file, "no node shows a mesh: each is shown once");
        for i in 0..document.root.meshes.len() {
            let built = meshes.get(document, &Index::new(i as u32), None, &mut palette, "file", sink)?;
            let entity = sink.spawn((Name::new(format!("mesh {i}")), Transform::default(), ChildOf(root)));
            instantiate(&built, entity, sink);
        }
    }
    for &i in &order {
        let node = &nodes[i];
        let user = format!("node {i}");
        let parent = parents[i].and_then(|parent| entities[parent]).unwrap_or(root);
        let name = Name::new(node.name.clone().unwrap_or_else(|| user.clone()));
        let entity = sink.spawn((name, Transform(local[i]), ChildOf(parent)));
        entities[i] = Some(entity);
        if hidden[i] {
            continue;
        }
        if let Some((name, camera, aspect)) = light::camera_of(document, node, &user, sink)? {
            sink.world.entity_mut(entity).insert(camera);
            if let Some(aspect) = aspect {
                sink.world.entity_mut(entity).insert(aspect);
            }
            sink.report.cameras.push((name, entity));
        }
    }
    for &i in &order {
        let (node, user) = (&nodes[i], format!("node {i}"));
        let (Some(index), Some(entity), false) = (&node.mesh, entities[i], hidden[i]) else { continue };
        let mesh = document.at(&document.root.meshes, index, "mesh", &user)?;
        let here = placed[i].unwrap_or_default();
        let is_moved = document.animations.good().is_some_and(|all| !all.is_empty());
        let weights = deform::weights_of(document, node, mesh, &user)?;
        let morphs = weights.iter().any(|&weight| weight != 0.0) || (!weights.is_empty() && is_moved);
        let holder = node.skin.as_ref().map(|skin| {
            let place = Transform(skin_place(document, skin, &placed, here));
            sink.spawn((Name::new(format!("{user} (skinned)")), place, ChildOf(root)))
        });
        let skin = match node.skin.as_ref().zip(holder) {
            Some((index, holder)) => Some(deform::skin(document, index, &entities, holder, &user, sink)?),
            None => None,
        };
        let follower = (morphs || skin.is_some()).then_some(Follower { node: i, weights: entity, skin });
        if morphs {
            sink.world.entity_mut(entity).insert(MorphWeights(weights));
        }
        let built = meshes.get(document, index, follower, &mut palette, &user, sink)?;
        if here.matrix3.determinant() == 0.0
            && !is_moved
            && built
                .entity
                .and_then(|mesh| sink.world.get::<Mesh>(mesh))
                .is_some_and(|m| vanishes(&m.0, here))
        {
            sink.ignored(document.file, &user, "scaled to nothing: not to be seen");
        }
        match holder {
            Some(holder) => instantiate(&built, holder, sink),
            None => place(document, node, entity, &built, &user, sink)?,
        }
    }
    // What lamps mean depends on what shines beside them.
    let light_units = units::of(document, before, sink);
    for &i in &order {
        let (Some(entity), false) = (entities[i], hidden[i]) else { continue };
        if let Some(light) = light::light_of(document, &nodes[i], light_units, &format!("node {i}"), sink)? {
            sink.world.entity_mut(entity).insert(light);
        }
    }
    // A mesh that says nothing of its place is left out of others, but is no scene.
    let mut primitives = document.root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let has_positions =
        |p: &Primitive| p.attributes.keys().any(|key| *key == Checked::Valid(Semantic::Positions));
    if document.root.meshes.iter().any(|mesh| !mesh.primitives.is_empty()) && !primitives.any(has_positions) {
        return Err(document.broken("meshes", "no POSITION in any: nothing says where vertices are"));
    }
    animation::spawn_all(document, &entities, sink)
}

/// Whether a mesh placed so has no area anywhere: what is flat may still be seen.
fn vanishes(mesh: &TriangleMesh, placed: DAffine3) -> bool {
    (0..mesh.triangles.len()).all(|triangle| {
        let [a, b, c] = mesh.corners(triangle).map(|corner| placed.transform_point3(corner.as_dvec3()));
        let (u, v) = (b - a, c - a);
        u.cross(v).length() <= 1e-12 * u.length() * v.length()
    })
}

/// Where a skinned mesh is counted from. The format: the transform of its own node `here` does not count; but whether that
/// mirrors decides which side of its triangles is their front (section 3.7.4).
fn skin_place(
    document: &Document<'_>,
    skin: &Index<json::Skin>,
    placed: &[Option<DAffine3>],
    here: DAffine3,
) -> DAffine3 {
    let mirror = if here.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
    let joint = document.root.skins.get(skin.value()).and_then(|skin| skin.joints.first());
    let joint = joint.and_then(|joint| *placed.get(joint.value())?);
    // Far from zero single precision would dent it.
    let place = joint.map(|joint| joint.translation).filter(|place| place.abs().max_element() > FAR_SKIN);
    DAffine3::from_translation(place.unwrap_or_default()) * DAffine3::from_scale(DVec3::new(mirror, 1.0, 1.0))
}

/// Parent of each node; refuses children that do not exist, second parents and cycles.
fn check_hierarchy(document: &Document<'_>) -> Result<Vec<Option<usize>>, LoadError> {
    let nodes = &document.root.nodes;
    let mut parents = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for child in node.children.iter().flatten() {
            document.at(nodes, child, "child node", &format!("node {i}"))?;
            if let Some(first) = parents[child.value()].replace(i) {
                let problem =
                    format!("has two parents, node {first} and node {i}: the hierarchy is not a tree");
                return Err(document.broken(format!("node {}", child.value()), problem));
            }
        }
    }
    // With one parent each, whoever never reaches a root walks in a cycle.
    let mut reaches_root = vec![false; nodes.len()];
    let mut path = Vec::new();
    for start in 0..nodes.len() {
        let mut here = Some(start);
        while let Some(i) = here.filter(|&i| !reaches_root[i]) {
            path.push(i);
            if path.len() > nodes.len() {
                return Err(document
                    .broken(format!("node {start}"), "is its own ancestor: a cycle in the node hierarchy"));
            }
            here = parents[i];
        }
        for i in path.drain(..) {
            reaches_root[i] = true;
        }
    }
    Ok(parents)
}

/// Nodes at the top of what is shown.
fn scene_roots(
    document: &Document<'_>,
    parents: &[Option<usize>],
    sink: &mut Sink<'_>,
) -> Result<Vec<usize>, LoadError> {
    let root = &document.root;
    let file = document.file;
    let names = root.scenes.iter().enumerate();
    let names: Vec<(String, usize)> =
        names.map(|(i, scene)| (scene.name.clone().unwrap_or_else(|| format!("scene {i}")), i)).collect();
    let shown = match (&sink.options.scene, &root.scene) {
        (Some(wanted), _) => document.chosen(wanted, "scene", &names)?,
        (None, Some(index)) => {
            document.at(&root.scenes, index, "scene", "default scene")?;
            index.value()
        }
        (None, None) => 0,
    };
    let scene = root.scenes.get(shown);
    if names.len() > 1 {
        let all: Vec<&str> = names.iter().map(|(name, _)| name.as_str()).collect();
        let what = format!("shows scene {shown} of {} (--gltf-scene: {})", names.len(), all.join(", "));
        sink.decide(file, what);
    }
    let Some(scene) = scene else {
        if !parents.is_empty() {
            sink.decide(file, "no scene in it; shows all nodes");
        }
        return Ok((0..parents.len()).filter(|&i| parents[i].is_none()).collect());
    };
    let mut listed = vec![false; parents.len()];
    for node in &scene.nodes {
        document.at(&root.nodes, node, "node", "scene")?;
        listed[node.value()] = true;
    }
    // Below a listed node: found from the tops down, so that no chain is walked twice.
    let tops: Vec<usize> = (0..parents.len()).filter(|&i| parents[i].is_none()).collect();
    let mut shown_above = vec![false; parents.len()];
    for i in top_down(document, &tops) {
        shown_above[i] = parents[i].is_some_and(|parent| listed[parent] || shown_above[parent]);
    }
    let mut roots = Vec::new();
    for node in scene.nodes.iter().map(Index::value) {
        if shown_above[node] || !std::mem::take(&mut listed[node]) {
            sink.repaired(file, &format!("node {node}"), "listed in the scene although it is shown already");
        } else {
            roots.push(node);
        }
    }
    Ok(roots)
}

/// Which nodes do not show (`KHR_node_visibility`): they still stand where joints may need them.
fn hidden(
    document: &Document<'_>,
    order: &[usize],
    parents: &[Option<usize>],
    sink: &mut Sink<'_>,
) -> Vec<bool> {
    let is_hidden = |i: usize| {
        let others = document.root.nodes[i].extensions.as_ref().map(|extensions| &extensions.others);
        let extension = others.and_then(|others| others.get("KHR_node_visibility"));
        extension.and_then(|e| e.get("visible")).is_some_and(|visible| visible == false)
    };
    let mut hidden = vec![false; document.root.nodes.len()];
    for &i in order {
        hidden[i] = is_hidden(i) || parents[i].is_some_and(|parent| hidden[parent]);
    }
    let count = hidden.iter().filter(|&&hidden| hidden).count();
    if count > 0 {
        sink.decide(document.file, format!("leaves out {count} nodes that are not visible"));
    }
    hidden
}

/// All nodes below the roots, parents before children, in file order.
fn top_down(document: &Document<'_>, roots: &[usize]) -> Vec<usize> {
    let mut stack: Vec<usize> = roots.iter().rev().copied().collect();
    let mut order = Vec::new();
    while let Some(i) = stack.pop() {
        order.push(i);
        stack.extend(document.root.nodes[i].children.iter().flatten().rev().map(Index::value));
    }
    order
}
