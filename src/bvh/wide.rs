//! Nodes of eight children, laid out for vectors.

use super::build::MAX_DEPTH;
use super::{Aabb, Defect, Node};
use glam::Vec3;
use std::sync::Arc;

/// Children of a node.
pub const WIDTH: usize = 8;
/// A leaf has no more entries.
pub const MAX_LEAF: usize = 8;
/// No more children ever wait in a traversal: from each level all but the one that is entered, and room
/// for the eight that a vector is written over.
pub const MAX_WAITING: usize = MAX_DEPTH * (WIDTH - 1) + WIDTH;

/// Four cache lines: the boxes of eight children, and what is in them.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub struct WideNode {
    /// For x, y and z the children's least and their greatest. A child that is not there has an empty box,
    /// which nothing enters.
    pub bounds: [[[f32; WIDTH]; 2]; 3],
    /// What is there: see [`Child`].
    pub children: [u32; WIDTH],
    /// For each octant of directions (bit 0: x negative, bit 1: y, bit 2: z) the numbers of the children from
    /// the farthest to the nearest, three bits each, the farthest lowest.
    pub orders: [u32; 8],
}

/// What a child is, packed into 32 bits: the highest tells leaves from nodes, a leaf has three bits for
/// one less than its entries and 28 for the first, a node its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// Index of a [`WideNode`].
    Node(usize),
    /// A range of [`WideBvh::prims`].
    Leaf {
        /// Its first entry.
        first: usize,
        /// 1 to 8.
        count: usize,
    },
}

const LEAF: u32 = 1 << 31;
pub(super) const FIRST_BITS: u32 = 28;

impl Child {
    /// Unpacks.
    #[inline(always)]
    #[must_use]
    pub fn unpack(packed: u32) -> Self {
        if packed & LEAF == 0 {
            return Self::Node(packed as usize);
        }
        let first = packed & ((1 << FIRST_BITS) - 1);
        let count = (packed >> FIRST_BITS & 7) + 1;
        Self::Leaf { first: first as usize, count: count as usize }
    }

    pub(super) fn pack(self) -> u32 {
        match self {
            Self::Node(index) => index as u32,
            Self::Leaf { first, count } => {
                debug_assert!(
                    first >> FIRST_BITS == 0 && (1..=MAX_LEAF).contains(&count),
                    "{count} from {first} on"
                );
                LEAF | (count as u32 - 1) << FIRST_BITS | first as u32
            }
        }
    }
}

/// A hierarchy of eight-wide nodes in two flat arrays.
#[derive(Clone, Debug)]
pub struct WideBvh {
    /// The root first. Empty if there is nothing to find.
    pub nodes: Vec<WideNode>,
    /// Indices of what it was built over, in the order of the leaves.
    pub prims: Arc<[u32]>,
    /// Around everything.
    pub bounds: Aabb,
}

impl Default for WideBvh {
    fn default() -> Self {
        Self { nodes: Vec::new(), prims: Arc::default(), bounds: Aabb::EMPTY }
    }
}

impl WideNode {
    pub(super) const EMPTY: Self = Self {
        bounds: {
            let (min, max) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
            [[min, max]; 3]
        },
        children: [0; WIDTH],
        orders: [0; 8],
    };

    /// The box of a child.
    #[must_use]
    pub fn child_bounds(&self, slot: usize) -> Aabb {
        let b = &self.bounds;
        Aabb {
            min: Vec3::new(b[0][0][slot], b[1][0][slot], b[2][0][slot]),
            max: Vec3::new(b[0][1][slot], b[1][1][slot], b[2][1][slot]),
        }
    }

    /// The leaves among its children: first entry and number of entries of each.
    pub fn leaves(&self) -> impl Iterator<Item = (usize, usize)> {
        let there = (0..WIDTH).filter(|&slot| !self.child_bounds(slot).is_empty());
        there.filter_map(|slot| match Child::unpack(self.children[slot]) {
            Child::Leaf { first, count } => Some((first, count)),
            Child::Node(_) => None,
        })
    }

    pub(super) fn set_child(&mut self, slot: usize, node: &Node, child: Child) {
        self.set_bounds(slot, &Aabb { min: node.min, max: node.max });
        self.children[slot] = child.pack();
    }

    /// Gives a child that is there another box.
    pub(super) fn set_bounds(&mut self, slot: usize, bounds: &Aabb) {
        for axis in 0..3 {
            self.bounds[axis][0][slot] = bounds.min[axis];
            self.bounds[axis][1][slot] = bounds.max[axis];
        }
    }

    /// Finds the orders: along the diagonal of the octant, by the boxes' middles.
    pub(super) fn sort(&mut self) {
        let middles: [Vec3; WIDTH] = std::array::from_fn(|slot| {
            let bounds = self.child_bounds(slot);
            if bounds.is_empty() { Vec3::INFINITY } else { bounds.center() }
        });
        for octant in 0..4 {
            let sign = |axis: usize| if octant >> axis & 1 == 0 { 1.0 } else { -1.0 };
            let diagonal = Vec3::new(sign(0), sign(1), sign(2));
            // Empty ones last; they are never entered.
            let keys = middles.map(|middle| {
                let along = middle.dot(diagonal);
                if along.is_finite() { -along } else { f32::INFINITY }
            });
            let (mut order, mut reversed) = (0, 0);
            for (slot, key) in keys.iter().enumerate() {
                // How many come before it: without branches, which could not be foretold.
                let before =
                    |(other, k): (usize, &f32)| u32::from(k < key) | u32::from(k == key && other < slot);
                let place: u32 = keys.iter().enumerate().map(before).sum();
                order |= (slot as u32) << (3 * place);
                reversed |= (slot as u32) << (3 * (WIDTH as u32 - 1 - place));
            }
            self.orders[octant] = order;
            self.orders[7 - octant] = reversed;
        }
    }
}

impl WideBvh {
    /// Bytes of the nodes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }

    /// Checks everything that a traversal relies on. Where each primitive is in one leaf, whole, `boxes` are
    /// what the hierarchy was built over, and must be inside their leaves too; else none.
    ///
    /// # Errors
    /// The first defect found.
    pub fn check(&self, boxes: Option<&[Aabb]>) -> Result<(), Defect> {
        let mut times = vec![0; boxes.map_or(0, <[Aabb]>::len)];
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![(0, 1, self.bounds)] };
        while let Some((index, depth, around)) = stack.pop() {
            if depth > MAX_DEPTH {
                return Err(Defect::TooDeep { node: index as u32, depth });
            }
            let dangling = Defect::Dangling { node: index as u32 };
            let node = self.nodes.get(index).ok_or(dangling)?;
            let named = |order: &u32| (0..WIDTH).fold(0_u32, |named, i| named | 1 << (order >> (3 * i) & 7));
            if node.orders.iter().any(|order| named(order) != (1 << WIDTH) - 1) {
                return Err(Defect::BadOrder { node: index as u32 });
            }
            for slot in 0..WIDTH {
                let bounds = node.child_bounds(slot);
                if bounds.is_empty() {
                    continue;
                }
                if !around.contains(&bounds) {
                    return Err(Defect::ChildOutsideParent { parent: index as u32, child: slot as u32 });
                }
                match Child::unpack(node.children[slot]) {
                    Child::Node(child) if child > index => stack.push((child, depth + 1, bounds)),
                    Child::Node(_) => return Err(dangling),
                    Child::Leaf { first, count } => {
                        for &prim in self.prims.get(first..first + count).ok_or(dangling)? {
                            let Some(boxes) = boxes else { continue };
                            if !bounds.contains(boxes.get(prim as usize).ok_or(dangling)?) {
                                return Err(Defect::PrimOutsideLeaf { leaf: index as u32, prim });
                            }
                            times[prim as usize] += 1;
                        }
                    }
                }
            }
        }
        match times.iter().position(|&t| t != 1) {
            Some(prim) => Err(Defect::NotOnce { prim: prim as u32, times: times[prim] }),
            None => Ok(()),
        }
    }
}
