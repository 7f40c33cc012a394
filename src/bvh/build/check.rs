//! Everything that a traversal relies on, checked.

use super::{Bvh, MAX_DEPTH};
use crate::bvh::Aabb;

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
    /// An order of a wide node's children does not name each once.
    #[error("node {node} has an order that leaves out a child")]
    BadOrder {
        /// Index of the node.
        node: u32,
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
