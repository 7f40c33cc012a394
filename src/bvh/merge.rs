//! Binary hierarchy → nodes of eight children.
//!
//! Which binary nodes to merge is decided by the surface area heuristic, exactly, by dynamic programming
//! over the binary tree. Reference: H. Ylitie, T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on
//! GPUs Through Compressed Wide BVHs", HPG 2017, section 3.

use super::build::Subtree;
use super::wide::{Child, WIDTH, WideBvh, WideNode};
use super::{Aabb, Bvh, Node};
use glam::Vec3;
use rayon::prelude::*;

/// Cost of visiting a node; that of a leaf is [`leaf_cost`].
const NODE_COST: f32 = 1.0;
/// So many times more where nodes take too much memory, and again ...
const DEARER: f32 = 1.5;
/// ... up to this.
const DEAREST_NODE: f32 = 10.0;
/// Never too many: 16 kB.
const FEW_NODES: usize = 64;

/// Cost of testing the entries of a leaf.
pub(super) fn leaf_cost(count: u32) -> f32 {
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

/// A subtree as wide nodes, numbered from its own root.
pub(super) struct Part {
    nodes: Vec<WideNode>,
    /// Box, and the number of entries.
    root: Node,
    cost: f32,
    /// The first of `nodes`, or a leaf without any.
    child: Child,
}

impl Part {
    /// Merges the binary `nodes`, at least one, and leaves to such of at most `max_leaf` ≤ 8 entries where that
    /// is cheaper.
    ///
    /// Should wide nodes take more than `room` bytes for each entry, visiting one is taken to cost more, until they
    /// do not: larger leaves become worth it.
    pub fn new(nodes: &[Node], max_leaf: usize, room: f32) -> Self {
        let mut node_cost = NODE_COST;
        loop {
            let plans = plan(nodes, max_leaf, node_cost, |node, area| area * leaf_cost(node.count));
            let mut merge = Merge {
                binary: nodes,
                plans: &plans,
                nodes: Vec::new(),
                leaf: |first, count| Child::Leaf { first, count },
            };
            let child = merge.subtree();
            let mut wide = merge.nodes;
            let root = Node { count: plans[0].count, ..nodes[0] };
            let too_many = wide.len() > FEW_NODES && size_of_val(&*wide) as f32 > room * root.count as f32;
            if too_many && node_cost < DEAREST_NODE {
                node_cost *= DEARER;
                continue;
            }
            wide.shrink_to_fit();
            return Self { nodes: wide, root, cost: plans[0].cost[0], child };
        }
    }

    /// First entry and number of entries of all leaves.
    pub fn leaf_list(&self) -> Vec<[u32; 2]> {
        let alone = match self.child {
            Child::Leaf { first, count } => Some((first, count)),
            Child::Node(_) => None,
        };
        let all = alone.into_iter().chain(self.nodes.iter().flat_map(WideNode::leaves));
        all.map(|(first, count)| [first as u32, count as u32]).collect()
    }
}

impl<T> Subtree<T> {
    /// One thread's shares, in the order of the leaves.
    pub fn parts(&self) -> Vec<&T> {
        match self {
            Self::Done(part) => vec![part],
            Self::Inner(_, children) => children.iter().flat_map(Self::parts).collect(),
        }
    }
}

/// Marks a child that is a [`Part`], by its number.
const IS_PART: usize = 1 << 30;

/// The whole of its parts; `prims` are the entries of their leaves.
pub(super) fn join(tree: Subtree<Part>, prims: Vec<u32>) -> WideBvh {
    let mut parts = Vec::new();
    let mut binary = vec![EMPTY_BINARY];
    collect(tree, 0, &mut binary, &mut parts);
    let bounds = Aabb { min: binary[0].min, max: binary[0].max };
    // Nodes above the parts, which are to them what leaves are to others.
    let plans = plan(&binary, 0, NODE_COST, |node, _| parts[node.first as usize].cost);
    let mut merge = Merge {
        binary: &binary,
        plans: &plans,
        nodes: Vec::new(),
        leaf: |part, _| Child::Node(IS_PART + part),
    };
    let root = merge.subtree();
    let mut upper = merge.nodes;
    if let Child::Node(IS_PART) = root
        && let Child::Leaf { .. } = parts[0].child
    {
        // A single leaf has nobody to carry its box.
        let mut node = WideNode::EMPTY;
        node.set_child(0, &binary[0], root);
        node.sort();
        upper.push(node);
    }
    let mut offsets = Vec::with_capacity(parts.len());
    let mut total = upper.len();
    for part in &parts {
        offsets.push(total);
        total += part.nodes.len();
    }
    for child in upper.iter_mut().flat_map(|node| &mut node.children) {
        if let Child::Node(index) = Child::unpack(*child)
            && index >= IS_PART
        {
            let part = index - IS_PART;
            let root = parts[part].child;
            *child = if let Child::Node(_) = root { Child::Node(offsets[part]) } else { root }.pack();
        }
    }
    let mut nodes = bytemuck::zeroed_vec(total);
    let (to_upper, mut rest) = nodes.split_at_mut(upper.len());
    to_upper.copy_from_slice(&upper);
    let mut places = Vec::with_capacity(parts.len());
    for (part, offset) in parts.iter().zip(offsets) {
        let (own, others) = rest.split_at_mut(part.nodes.len());
        places.push((part, offset, own));
        rest = others;
    }
    places.into_par_iter().for_each(|(part, offset, to)| {
        for (to, node) in to.iter_mut().zip(&part.nodes) {
            *to = *node;
            for child in &mut to.children {
                if let Child::Node(index) = Child::unpack(*child) {
                    *child = Child::Node(index + offset).pack();
                }
            }
        }
    });
    WideBvh { nodes, prims: prims.into(), bounds }
}

const EMPTY_BINARY: Node = Node { min: Vec3::ZERO, first: 0, max: Vec3::ZERO, count: 0 };

/// Puts `tree` into the array of binary nodes, its root at `slot`, with parts as leaves.
fn collect(tree: Subtree<Part>, slot: usize, nodes: &mut Vec<Node>, parts: &mut Vec<Part>) {
    match tree {
        Subtree::Done(part) => {
            nodes[slot] = Node { first: parts.len() as u32, ..part.root };
            parts.push(part);
        }
        Subtree::Inner(node, children) => {
            let pair = nodes.len();
            nodes[slot] = Node { first: pair as u32, ..node };
            nodes.extend([EMPTY_BINARY; 2]);
            let [left, right] = *children;
            collect(left, pair, nodes, parts);
            collect(right, pair + 1, nodes, parts);
        }
    }
}

impl WideBvh {
    /// Merges the nodes of `bvh`, and leaves to such of at most `max_leaf` ≤ 8 entries where that is cheaper.
    #[must_use]
    pub fn new(bvh: &Bvh, max_leaf: usize) -> Self {
        if bvh.nodes.is_empty() {
            return Self::default();
        }
        join(Subtree::Done(Part::new(&bvh.nodes, max_leaf, f32::INFINITY)), bvh.prims.clone())
    }
}

/// For each binary node. `cost` is that of a leaf, given also its area.
fn plan(nodes: &[Node], max_leaf: usize, node_cost: f32, cost: impl Fn(&Node, f32) -> f32) -> Vec<Plan> {
    let empty = Plan { cost: [0.0; WIDTH - 1], left: [0; WIDTH - 1], count: 0 };
    let mut plans = vec![empty; nodes.len()];
    // Children come after their parents.
    for (i, node) in nodes.iter().enumerate().rev() {
        let area = Aabb { min: node.min, max: node.max }.half_area();
        plans[i] = if node.count > 0 {
            let cost = cost(node, area);
            Plan { cost: [cost; WIDTH - 1], left: [0; WIDTH - 1], count: node.count }
        } else {
            let first = node.first as usize;
            let (left, right) = (&plans[first], &plans[first + 1]);
            let count = left.count + right.count;
            let mut plan = Plan { count, ..empty };
            let (cost, split) = best_split(left, right, WIDTH);
            plan.cost[0] = area * node_cost + cost;
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

struct Merge<'a, L> {
    binary: &'a [Node],
    plans: &'a [Plan],
    nodes: Vec<WideNode>,
    /// What a leaf with the given first entry and number of entries becomes.
    leaf: L,
}

impl<L: Fn(usize, usize) -> Child> Merge<'_, L> {
    /// All of it.
    fn subtree(&mut self) -> Child {
        if self.plans[0].left[0] == 0 {
            return self.leaf(0);
        }
        self.nodes.push(WideNode::EMPTY);
        self.node(0, 0);
        Child::Node(0)
    }

    /// Fills wide node `index` with what is below binary node `root`.
    fn node(&mut self, index: usize, root: usize) {
        let mut roots = [0; WIDTH];
        let mut count = 0;
        let first = self.binary[root].first as usize;
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
            self.nodes[index].set_child(slot, &self.binary[root], child);
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
            let first = self.binary[root].first as usize;
            let left = usize::from(plan.left[n - 1]);
            self.gather(first, left, roots, count);
            self.gather(first + 1, n - left, roots, count);
        }
    }

    /// All entries below a binary node, which are neighbours.
    fn leaf(&self, root: usize) -> Child {
        let mut leftmost = &self.binary[root];
        while leftmost.count == 0 {
            leftmost = &self.binary[leftmost.first as usize];
        }
        (self.leaf)(leftmost.first as usize, self.plans[root].count as usize)
    }
}
