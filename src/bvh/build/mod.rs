//! Boxes or triangles → binary hierarchy, the same for any number of threads.

mod binned;
mod check;

pub use check::Defect;

use super::Aabb;
use binned::Prim;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

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

/// Levels split by the heuristic; below them the list is halved, which ends after 32 levels more.
const SAH_LEVELS: usize = 32;
/// No path from the root has more inner nodes: the bound of every traversal stack.
pub const MAX_DEPTH: usize = SAH_LEVELS + 32;
/// Beyond this many triangles a leaf is always split.
const MAX_LEAF: usize = 4;

/// How much work goes into a hierarchy. What is hit is the same, bit for bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Quality {
    /// Soon ready: for what was just opened or changed.
    #[default]
    Interactive,
    /// Fast to trace: for a view that somebody looks at for some seconds.
    Rested,
}

impl Bvh {
    /// Builds over `boxes`, all finite and not empty, each in a leaf of its own. There may be none, or many
    /// equal ones.
    #[must_use]
    pub fn build(boxes: &[Aabb]) -> Self {
        let prims = boxes.iter().zip(0..).map(|(aabb, index)| Prim::new(*aabb, index)).collect();
        binned::build(prims, 1)
    }

    /// Builds over the `triangles` that have a surface.
    #[must_use]
    pub fn of_triangles(triangles: &[[Vec3; 3]]) -> Self {
        let prims: Vec<Prim> = triangles
            .par_iter()
            .enumerate()
            .with_min_len(4096)
            .filter(|(_, corners)| has_surface(corners))
            .map(|(index, corners)| Prim::new(Aabb::around(corners), index as u32))
            .collect();
        binned::build(prims, MAX_LEAF)
    }

    /// The box around everything; empty if there is nothing.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |root| Aabb { min: root.min, max: root.max })
    }
}

/// Judged in double precision, where differences and products of f32 are exact or nearly so.
pub(super) fn has_surface(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    normal.is_finite() && normal != DVec3::ZERO
}
