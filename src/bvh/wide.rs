//! Binary hierarchy → nodes of eight children, laid out for vectors.
//!
//! Which binary nodes to merge is decided by the surface area heuristic, exactly, by dynamic programming
//! over the binary tree. Reference: H. Ylitie, T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on
//! GPUs Through Compressed Wide BVHs", HPG 2017, section 3.

use super::build::MAX_DEPTH;
use super::{Aabb, Bvh, Defect, Node};
use glam::Vec3;

/// Children of a node.
pub const WIDTH: usize = 8;
/// A leaf has no more entries.
pub const MAX_LEAF: usize = 8;
/// No more children ever wait in a traversal: from each level all but the one that is entered, and room
/// for the eight that a vector is written over.
pub const MAX_WAITING: usize = MAX_DEPTH * (WIDTH - 1) + WIDTH;

/// Four cache lines: the boxes of eight children, and what is in them.
#[derive(Clone, Copy, Debug, PartialEq)]
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
const FIRST_BITS: u32 = 28;

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

    fn pack(self) -> u32 {
        match self {
            Self::Node(index) => index as u32,
            Self::Leaf { first, count } => LEAF | (count as u32 - 1) << FIRST_BITS | first as u32,
        }
    }
}

/// A hierarchy of eight-wide nodes in two flat arrays.
#[derive(Clone, Debug)]
pub struct WideBvh {
    /// The root first. Empty if there is nothing to find.
    pub nodes: Vec<WideNode>,
    /// Indices of what it was built over, in the order of the leaves.
    pub prims: Vec<u32>,
    /// Around everything.
    pub bounds: Aabb,
}

impl Default for WideBvh {
    fn default() -> Self {
        Self { nodes: Vec::new(), prims: Vec::new(), bounds: Aabb::EMPTY }
    }
}

/// Cost of visiting a node; that of a leaf is [`leaf_cost`].
const NODE_COST: f32 = 1.0;

/// Cost of testing the entries of a leaf.
fn leaf_cost(count: u32) -> f32 {
    0.9 + 0.1 * count as f32
}

/// What is known of a binary node's subtree when merging.
#[derive(Clone, Copy)]
struct Plan {
    /// Least cost of the subtree as at most i + 1 wide children.
    cost: [f32; WIDTH - 1],
    /// How many of the i + 1 the left side gets; 0: one less is as good. Entry 0 is about the eight
    /// children of a wide node in this place; 0: it is a leaf.
    left: [u8; WIDTH - 1],
    count: u32,
}

impl WideBvh {
    /// Merges the nodes of `bvh`, and leaves to such of at most `max_leaf` ≤ 8 entries where that is cheaper.
    #[must_use]
    pub fn new(bvh: &Bvh, max_leaf: usize) -> Self {
        let Some(root) = bvh.nodes.first() else { return Self::default() };
        let plans = plan(bvh, max_leaf);
        let mut merge =
            Merge { bvh, plans: &plans, nodes: Vec::new(), prims: Vec::with_capacity(bvh.prims.len()) };
        merge.nodes.push(WideNode::EMPTY);
        if plans[0].left[0] == 0 {
            let leaf = merge.leaf(0);
            merge.nodes[0].set_child(0, root, leaf);
            merge.nodes[0].sort();
        } else {
            merge.node(0, 0);
        }
        let Merge { mut nodes, prims, .. } = merge;
        nodes.shrink_to_fit();
        Self { nodes, prims, bounds: bvh.bounds() }
    }

    /// Bytes of the nodes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

fn plan(bvh: &Bvh, max_leaf: usize) -> Vec<Plan> {
    let empty = Plan { cost: [0.0; WIDTH - 1], left: [0; WIDTH - 1], count: 0 };
    let mut plans = vec![empty; bvh.nodes.len()];
    // Children come after their parents.
    for (i, node) in bvh.nodes.iter().enumerate().rev() {
        let area = Aabb { min: node.min, max: node.max }.half_area();
        plans[i] = if node.count > 0 {
            let cost = area * leaf_cost(node.count);
            Plan { cost: [cost; WIDTH - 1], left: [0; WIDTH - 1], count: node.count }
        } else {
            let first = node.first as usize;
            let (left, right) = (&plans[first], &plans[first + 1]);
            let count = left.count + right.count;
            let mut plan = Plan { count, ..empty };
            let (cost, split) = best_split(left, right, WIDTH);
            plan.cost[0] = area * NODE_COST + cost;
            plan.left[0] = split;
            if count as usize <= max_leaf && area * leaf_cost(count) <= plan.cost[0] {
                plan.cost[0] = area * leaf_cost(count);
                plan.left[0] = 0;
            }
            for n in 2..WIDTH {
                let (cost, split) = best_split(left, right, n);
                let fewer = plan.cost[n - 2];
                // Not `<=`: costs may overflow, and then everything has to be shared out all the same.
                (plan.cost[n - 1], plan.left[n - 1]) = if cost < fewer { (cost, split) } else { (fewer, 0) };
            }
            plan
        };
    }
    plans
}

/// The cheapest way to give `n` children to two sides, and how many of them go left.
fn best_split(left: &Plan, right: &Plan, n: usize) -> (f32, u8) {
    let mut best = (left.cost[0] + right.cost[n - 2], 1);
    for k in 2..n {
        let cost = left.cost[k - 1] + right.cost[n - k - 1];
        if cost < best.0 {
            best = (cost, k as u8);
        }
    }
    best
}

struct Merge<'a> {
    bvh: &'a Bvh,
    plans: &'a [Plan],
    nodes: Vec<WideNode>,
    prims: Vec<u32>,
}

impl Merge<'_> {
    /// Fills wide node `index` with what is below binary node `root`.
    fn node(&mut self, index: usize, root: usize) {
        let mut roots = [0; WIDTH];
        let mut count = 0;
        let first = self.bvh.nodes[root].first as usize;
        let left = usize::from(self.plans[root].left[0]);
        self.gather(first, left, &mut roots, &mut count);
        self.gather(first + 1, WIDTH - left, &mut roots, &mut count);
        let roots = &roots[..count];
        let inner = |&&r: &&usize| self.plans[r].left[0] != 0;
        let mut below = self.nodes.len();
        self.nodes.resize(below + roots.iter().filter(inner).count(), WideNode::EMPTY);
        for (slot, &root) in roots.iter().enumerate() {
            let child = if self.plans[root].left[0] == 0 {
                self.leaf(root)
            } else {
                below += 1;
                self.node(below - 1, root);
                Child::Node(below - 1)
            };
            self.nodes[index].set_child(slot, &self.bvh.nodes[root], child);
        }
        self.nodes[index].sort();
    }

    /// Finds the at most `n` wide children that the subtree of binary node `root` becomes.
    fn gather(&self, root: usize, n: usize, roots: &mut [usize; WIDTH], count: &mut usize) {
        let plan = &self.plans[root];
        let mut n = n;
        while n > 1 && plan.left[n - 1] == 0 {
            n -= 1;
        }
        if n == 1 {
            roots[*count] = root;
            *count += 1;
        } else {
            let first = self.bvh.nodes[root].first as usize;
            let left = usize::from(plan.left[n - 1]);
            self.gather(first, left, roots, count);
            self.gather(first + 1, n - left, roots, count);
        }
    }

    /// All entries below a binary node.
    fn leaf(&mut self, root: usize) -> Child {
        let first = self.prims.len();
        self.entries(root);
        Child::Leaf { first, count: self.prims.len() - first }
    }

    fn entries(&mut self, root: usize) {
        let Node { first, count, .. } = self.bvh.nodes[root];
        let first = first as usize;
        if count > 0 {
            self.prims.extend_from_slice(&self.bvh.prims[first..first + count as usize]);
        } else {
            self.entries(first);
            self.entries(first + 1);
        }
    }
}

impl WideNode {
    const EMPTY: Self = Self {
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

    fn set_child(&mut self, slot: usize, node: &Node, child: Child) {
        for axis in 0..3 {
            self.bounds[axis][0][slot] = node.min[axis];
            self.bounds[axis][1][slot] = node.max[axis];
        }
        self.children[slot] = child.pack();
    }

    /// Finds the orders: along the diagonal of the octant, by the boxes' middles.
    fn sort(&mut self) {
        let middles: [Vec3; WIDTH] = std::array::from_fn(|slot| {
            let bounds = self.child_bounds(slot);
            if bounds.is_empty() { Vec3::INFINITY } else { bounds.center() }
        });
        for (octant, order) in self.orders.iter_mut().enumerate() {
            let sign = |axis: usize| if octant >> axis & 1 == 0 { 1.0 } else { -1.0 };
            let diagonal = Vec3::new(sign(0), sign(1), sign(2));
            let mut slots: [(f32, u32); WIDTH] = std::array::from_fn(|slot| {
                // Empty ones last, that is, nearest: they are never entered.
                let along = middles[slot].dot(diagonal);
                (if along.is_finite() { -along } else { f32::INFINITY }, slot as u32)
            });
            slots.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            *order = slots.iter().enumerate().fold(0, |order, (i, &(_, slot))| order | slot << (3 * i));
        }
    }
}

impl WideBvh {
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
