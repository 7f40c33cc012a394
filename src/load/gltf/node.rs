//! The node hierarchy: checked, then spawned from the roots down without recursion.

use super::deform::{self, Follower};
use super::material::Palette;
use super::mesh::Meshes;
use super::place::{MOST_NODES, instantiate, place, placement};
use super::{Document, animation, light, units};
use crate::load::error::LoadError;
use crate::load::report::{Kind, Sink};
use crate::scene::{MorphWeights, Transform};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::DAffine3;
use gltf::json::Index;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

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
    let mut flat: Vec<bool> = local.iter().map(|local| local.matrix3.determinant() == 0.0).collect();
    order.iter().for_each(|&i| flat[i] |= parents[i].is_some_and(|parent| flat[parent]));
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
        if flat[i] && node.skin.is_none() {
            let what = "scaled to nothing: its mesh is flat, or not to be seen";
            sink.remark(Kind::Approximated, document.file, &user, what.to_owned(), 1);
        }
        let weights = deform::weights_of(document, node, mesh, &user)?;
        let morphs = weights.iter().any(|&weight| weight != 0.0)
            || (!weights.is_empty() && document.animations.good().is_some_and(|all| !all.is_empty()));
        // The format: the transform of a skinned mesh's own node does not count.
        let holder = node.skin.as_ref().map(|_| {
            sink.spawn((Name::new(format!("{user} (skinned)")), Transform::default(), ChildOf(root)))
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
