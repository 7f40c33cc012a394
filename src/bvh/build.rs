//! Boxes → hierarchy: binned surface area heuristic, in parallel, the same for any thread count.
//!
//! Reference: I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", RT 2007.

use super::Aabb;
use glam::Vec3;

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
    /// The root first, then pairs of siblings. Empty if there is nothing to find.
    pub nodes: Vec<Node>,
    /// Indices of the boxes it was built from, in the order of the leaves.
    pub prims: Vec<u32>,
}

/// Beyond this many boxes a leaf is always split.
const MAX_LEAF: usize = 4;
/// Levels split by the heuristic; below them the list is halved, which ends after 32 levels more.
const SAH_LEVELS: usize = 32;
/// No path from the root has more inner nodes: the bound of every traversal stack.
pub const MAX_DEPTH: usize = SAH_LEVELS + 32;
const BINS: usize = 16;
/// Cost of visiting a node over that of testing a triangle.
const NODE_COST: f32 = 1.0;
/// Below this many boxes threads cost more than they bring.
const PARALLEL_MIN: usize = 4096;

#[derive(Clone, Copy)]
struct Prim {
    aabb: Aabb,
    center: Vec3,
    index: u32,
}

#[derive(Clone, Copy)]
struct Bin {
    aabb: Aabb,
    count: u32,
}

impl Bvh {
    /// Builds over `boxes`, all finite and not empty. There may be none, or many equal ones.
    #[must_use]
    pub fn build(boxes: &[Aabb]) -> Self {
        if boxes.is_empty() {
            return Self::default();
        }
        let mut prims: Vec<Prim> =
            boxes.iter().zip(0..).map(|(&aabb, index)| Prim { aabb, center: aabb.center(), index }).collect();
        let unused = Node { min: Vec3::ZERO, first: 0, max: Vec3::ZERO, count: 0 };
        let mut nodes = vec![unused; 2 * prims.len() - 1];
        let (root, below) = nodes.split_at_mut(1);
        split(&mut root[0], below, 1, &mut prims, 0, 0);
        Self { nodes: compact(&nodes), prims: prims.iter().map(|p| p.index).collect() }
    }

    /// The box around everything; empty if there is nothing.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |root| Aabb { min: root.min, max: root.max })
    }
}

/// Makes `node` the root over `prims`, whose list starts at `first_prim`, putting its descendants into
/// `below`, which starts at index `base` of the final array and has room for 2 · `prims.len()` − 2.
fn split(
    node: &mut Node,
    below: &mut [Node],
    base: usize,
    prims: &mut [Prim],
    first_prim: usize,
    depth: usize,
) {
    let (bounds, centers) = extent(prims);
    let cut = if depth < SAH_LEVELS { sah_cut(prims, &bounds, &centers) } else { Cut::Halves };
    let middle = match cut {
        Cut::Leaf => 0,
        Cut::Halves if prims.len() <= MAX_LEAF => 0,
        Cut::Halves => prims.len() / 2,
        Cut::Plane(plane) => partition(prims, |p| plane.is_left(p)),
    };
    node.min = bounds.min;
    node.max = bounds.max;
    if middle == 0 || middle == prims.len() {
        node.first = first_prim as u32;
        node.count = prims.len() as u32;
        return;
    }
    node.first = base as u32;
    node.count = 0;
    let parallel = prims.len() >= PARALLEL_MIN;
    let (left_prims, right_prims) = prims.split_at_mut(middle);
    let (pair, below) = below.split_at_mut(2);
    let (left_below, right_below) = below.split_at_mut(2 * middle - 2);
    let (left, right) = pair.split_at_mut(1);
    let left_base = base + 2;
    let right_base = left_base + left_below.len();
    let mut go_left = || split(&mut left[0], left_below, left_base, left_prims, first_prim, depth + 1);
    let mut go_right =
        || split(&mut right[0], right_below, right_base, right_prims, first_prim + middle, depth + 1);
    if parallel {
        rayon::join(go_left, go_right);
    } else {
        go_left();
        go_right();
    }
}

/// The box of the boxes, and the box of their centres.
fn extent(prims: &[Prim]) -> (Aabb, Aabb) {
    prims.iter().fold((Aabb::EMPTY, Aabb::EMPTY), |(bounds, centers), p| {
        (bounds.union(p.aabb), centers.with(p.center))
    })
}

enum Cut {
    Leaf,
    Halves,
    Plane(Plane),
}

/// Bins along one axis; what falls into a bin below `bin` is left of the plane.
struct Plane {
    axis: usize,
    origin: f32,
    scale: f32,
    bin: usize,
}

impl Plane {
    fn is_left(&self, prim: &Prim) -> bool {
        bin_of(prim.center[self.axis], self.origin, self.scale) < self.bin
    }
}

fn bin_of(center: f32, origin: f32, scale: f32) -> usize {
    // The cast sends NaN to 0 and saturates.
    (((center - origin) * scale) as usize).min(BINS - 1)
}

fn sah_cut(prims: &[Prim], bounds: &Aabb, centers: &Aabb) -> Cut {
    if prims.len() == 1 {
        return Cut::Leaf;
    }
    let extent = centers.max - centers.min;
    let scale = extent.map(|e| if e > 0.0 { BINS as f32 / e } else { 0.0 });
    let mut bins = [[Bin { aabb: Aabb::EMPTY, count: 0 }; BINS]; 3];
    for prim in prims {
        for (axis, bins) in bins.iter_mut().enumerate() {
            let bin = &mut bins[bin_of(prim.center[axis], centers.min[axis], scale[axis])];
            bin.aabb = bin.aabb.union(prim.aabb);
            bin.count += 1;
        }
    }
    let mut best: Option<(f32, Plane)> = None;
    for (axis, bins) in bins.iter().enumerate() {
        if scale[axis] == 0.0 {
            continue;
        }
        // Cost of everything right of each plane, then sweep from the left.
        let mut right = [0.0; BINS];
        let (mut aabb, mut count) = (Aabb::EMPTY, 0);
        for i in (1..BINS).rev() {
            aabb = aabb.union(bins[i].aabb);
            count += bins[i].count;
            right[i] = aabb.half_area() * count as f32;
        }
        let (mut aabb, mut count) = (Aabb::EMPTY, 0);
        for i in 1..BINS {
            aabb = aabb.union(bins[i - 1].aabb);
            count += bins[i - 1].count;
            let cost = aabb.half_area() * count as f32 + right[i];
            if count > 0 && (count as usize) < prims.len() && best.as_ref().is_none_or(|(c, _)| cost < *c) {
                best = Some((cost, Plane { axis, origin: centers.min[axis], scale: scale[axis], bin: i }));
            }
        }
    }
    let area = bounds.half_area();
    let leaf_cost = area * prims.len() as f32;
    match best {
        // A large list is split even if its cost overflows.
        Some((cost, plane)) if prims.len() > MAX_LEAF || NODE_COST * area + cost < leaf_cost => {
            Cut::Plane(plane)
        }
        Some(_) => Cut::Leaf,
        None => Cut::Halves,
    }
}

/// Moves what is left to the front, keeping the order on both sides; returns how many.
fn partition(prims: &mut [Prim], is_left: impl Fn(&Prim) -> bool) -> usize {
    let mut right = Vec::with_capacity(prims.len());
    let mut middle = 0;
    for i in 0..prims.len() {
        let prim = prims[i];
        if is_left(&prim) {
            prims[middle] = prim;
            middle += 1;
        } else {
            right.push(prim);
        }
    }
    prims[middle..].copy_from_slice(&right);
    middle
}

/// Closes the gaps that leaves of several boxes left, in depth-first order.
fn compact(sparse: &[Node]) -> Vec<Node> {
    let mut dense = Vec::with_capacity(sparse.len());
    dense.push(sparse[0]);
    let mut stack = vec![0];
    while let Some(parent) = stack.pop() {
        let Node { first, count, .. } = dense[parent];
        if count == 0 {
            let pair = dense.len();
            dense.extend_from_slice(&sparse[first as usize..first as usize + 2]);
            dense[parent].first = pair as u32;
            stack.extend([pair + 1, pair]);
        }
    }
    dense.shrink_to_fit();
    dense
}

/// What [`Bvh::check`] can find.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Defect {
    /// A child's box sticks out of its parent's.
    #[error("node {child} is not inside its parent {parent}")]
    ChildOutsideParent {
        /// Index of the inner node.
        parent: u32,
        /// Index of its child.
        child: u32,
    },
    /// A box sticks out of its leaf's.
    #[error("box {prim} is not inside its leaf {leaf}")]
    PrimOutsideLeaf {
        /// Index of the leaf.
        leaf: u32,
        /// Index of the box.
        prim: u32,
    },
    /// Not every box is in exactly one leaf.
    #[error("box {prim} is in {times} leaves")]
    NotOnce {
        /// Index of the box.
        prim: u32,
        /// In how many leaves it is.
        times: u32,
    },
    /// A path from the root is longer than a traversal stack.
    #[error("node {node} is at depth {depth}")]
    TooDeep {
        /// Index of the node.
        node: u32,
        /// Inner nodes above it.
        depth: usize,
    },
    /// An index points outside its array.
    #[error("node {node} points outside")]
    Dangling {
        /// Index of the node.
        node: u32,
    },
}

impl Bvh {
    /// Checks everything that a traversal relies on, against the boxes it was built from.
    ///
    /// # Errors
    /// The first defect found.
    pub fn check(&self, boxes: &[Aabb]) -> Result<(), Defect> {
        let mut times = vec![0; boxes.len()];
        let mut stack: Vec<(u32, usize)> = self.nodes.iter().take(1).map(|_| (0, 0)).collect();
        while let Some((index, depth)) = stack.pop() {
            let node = self.nodes[index as usize];
            let aabb = Aabb { min: node.min, max: node.max };
            // Inner nodes above this one; a stack holds one entry for each.
            if depth > MAX_DEPTH {
                return Err(Defect::TooDeep { node: index, depth });
            }
            let dangling = Defect::Dangling { node: index };
            if node.count > 0 {
                let range = node.first as usize..node.first as usize + node.count as usize;
                for &prim in self.prims.get(range).ok_or(dangling)? {
                    let inner = boxes.get(prim as usize).ok_or(dangling)?;
                    if !aabb.contains(inner) {
                        return Err(Defect::PrimOutsideLeaf { leaf: index, prim });
                    }
                    times[prim as usize] += 1;
                }
            } else {
                for child in [node.first, node.first + 1] {
                    let inner = self.nodes.get(child as usize).filter(|_| child > index).ok_or(dangling)?;
                    if !aabb.contains(&Aabb { min: inner.min, max: inner.max }) {
                        return Err(Defect::ChildOutsideParent { parent: index, child });
                    }
                    stack.push((child, depth + 1));
                }
            }
        }
        match times.iter().position(|&t| t != 1) {
            Some(prim) => Err(Defect::NotOnce { prim: prim as u32, times: times[prim] }),
            None => Ok(()),
        }
    }
}
