//! Boxes or triangles → binary hierarchy, the same for any number of threads.

mod binned;
mod bins;
mod check;
mod prim;
mod split;

pub(super) use binned::Subtree;
pub use check::Defect;

use super::leaves::{self, Leaves};
use super::{Aabb, WideBvh, merge, wide};
use glam::{DVec3, Vec3};
use merge::Part;
use prim::Prim;
use rayon::prelude::*;
use split::Waste;

/// 32 bytes, two to a cache line. Two children are neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct Node {
    /// Lower corner of its box.
    pub min: Vec3,
    /// Index of its first child (the other is the next one), or of its first entry in [`Bvh::prims`].
    pub first: u32,
    /// Upper corner of its box.
    pub max: Vec3,
    /// Entries of a leaf, 0 for an inner node.
    pub count: u32,
}

/// A binary bounding volume hierarchy in two flat arrays.
#[derive(Clone, Debug, Default)]
pub struct Bvh {
    /// The root first; children come after their parents, in pairs. Empty if there is nothing to find.
    pub nodes: Vec<Node>,
    /// Indices of what it was built from, in the order of the leaves.
    pub prims: Vec<u32>,
}

/// Triangles that fit into one mesh: fewer than entries.
pub const MOST_TRIANGLES: usize = 200_000_000;
/// Entries of leaves, triangles and parts: leaves tell the first by so many bits.
const MOST_ENTRIES: usize = 1 << wide::FIRST_BITS;
const _: () = assert!(MOST_TRIANGLES < MOST_ENTRIES);
/// Levels split by the heuristic; below them the list is halved, which ends after 32 levels more.
const SAH_LEVELS: usize = 32;
/// No path from the root has more inner nodes: the bound of every traversal stack.
pub const MAX_DEPTH: usize = SAH_LEVELS + 32;
/// Beyond this many triangles a leaf is always split.
const MAX_LEAF: usize = 4;
/// Long lists are worked at in pieces of this length, by all threads.
const PIECE: usize = 1 << 14;
/// Nodes and triangles take no more for each triangle of a mesh of thousands.
const BYTES: f32 = 72.0;

impl Bvh {
    /// Builds over `boxes`, all finite and not empty, each in a leaf of its own. There may be none, or many
    /// equal ones.
    #[must_use]
    pub fn build(boxes: &[Aabb]) -> Self {
        let prims = boxes.iter().zip(0..).map(|(aabb, index)| Prim::new(*aabb, index)).collect();
        binned::build_binary(prims, 1)
    }

    /// The box around everything; empty if there is nothing.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |root| Aabb { min: root.min, max: root.max })
    }
}

/// The `triangles` that have a surface, as boxes, and how much of these is empty.
fn prims_of(triangles: &[[Vec3; 3]]) -> (Vec<Prim>, Waste) {
    let mut prims: Vec<Prim> = bytemuck::zeroed_vec(triangles.len());
    let pieces = prims.par_chunks_mut(PIECE).zip(triangles.par_chunks(PIECE)).enumerate();
    let wastes: Vec<Waste> = pieces
        .map(|(piece, (prims, triangles))| {
            let mut waste = Waste::default();
            for (i, (to, corners)) in prims.iter_mut().zip(triangles).enumerate() {
                *to = if has_surface(corners) {
                    let prim = Prim::new(Aabb::around(corners), (piece * PIECE + i) as u32);
                    waste.add(&prim, corners);
                    prim
                } else {
                    Prim::NOTHING
                };
            }
            waste
        })
        .collect();
    // Hardly ever anything to do.
    if !prims.par_iter().with_min_len(PIECE).all(Prim::is_some) {
        prims.retain(Prim::is_some);
    }
    // In an order that does not depend on the threads.
    (prims, wastes.into_iter().fold(Waste::default(), Waste::union))
}

/// Wide hierarchy over `triangles`, and these as its leaves have them.
pub(super) fn build_triangles(triangles: &[[Vec3; 3]]) -> (WideBvh, Leaves) {
    assert!(triangles.len() <= MOST_TRIANGLES, "{} triangles in one mesh", triangles.len());
    let (prims, waste) = prims_of(triangles);
    let prims = split::split(prims, &waste, triangles);
    if prims.is_empty() {
        return (WideBvh::default(), Leaves::default());
    }
    // The boxes are gone, and nodes only once there, before there are corners: so the most memory that is ever
    // needed is that of the boxes.
    let room = room(triangles.len(), prims.len());
    let (tree, order) = binned::build(prims, MAX_LEAF, &|nodes| Part::new(&nodes, wide::MAX_LEAF, room));
    let leaves = tree.parts().into_par_iter().map(Part::leaf_list).collect();
    let wide = merge::join(tree, order);
    let leaves = Leaves::new(leaves, &wide.prims, triangles);
    (wide, leaves)
}

/// Bytes of nodes for each entry of a leaf.
fn room(triangles: usize, entries: usize) -> f32 {
    (BYTES * triangles as f32 - leaves::bytes(triangles, entries) as f32) / entries as f32
}

/// Judged in double precision, where differences and products of f32 are exact or nearly so.
pub(super) fn has_surface(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    normal.is_finite() && normal != DVec3::ZERO
}
