//! Top down by the surface area heuristic in bins.
//!
//! Reference: I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", RT 2007. Each level is
//! two passes over the list: one sorts it into bins, which then know the boxes of both halves, the other parts
//! it in two. Where the centres are is looked up only in lists that are in the cache; those of longer ones are
//! taken to be anywhere in the box and where the list's they came from are.

use super::bins::{Bins, Grid, best_plane};
use super::prim::{Extent, Prim};
use super::{Bvh, Node, PIECE, SAH_LEVELS};
use crate::bvh::merge::leaf_cost;
use glam::{Vec3, Vec4Swizzles};
use rayon::prelude::*;

/// Lists of at least this length are shared out among threads.
const LONG: usize = 2 * PIECE;
/// Subtrees over fewer are one task.
const TASK: usize = 1 << 13;

/// What a subtree became.
pub(in crate::bvh) enum Subtree<T> {
    /// One thread's share, finished.
    Done(T),
    /// Its box is that of the node.
    Inner(Node, Box<[Self; 2]>),
}

/// Where a subtree's prims go: for each its index, in the order of the leaves.
struct Order<'a> {
    /// Of the first prim among all.
    first: usize,
    order: &'a mut [u32],
}

impl Order<'_> {
    fn split(self, middle: usize) -> (Self, Self) {
        let (order, right) = self.order.split_at_mut(middle);
        (Self { first: self.first, order }, Self { first: self.first + middle, order: right })
    }
}

/// Builds over `prims`, at least one, at most `max_leaf` to a leaf unless they cannot be told apart; also
/// returns their indices in the order of the leaves. `finish` gets the nodes of each subtree that one thread
/// built, numbered from its root; their leaves' `first` are among all prims.
pub(super) fn build<T: Send>(
    mut prims: Vec<Prim>,
    max_leaf: usize,
    finish: &(impl Fn(Vec<Node>) -> T + Sync),
) -> (Subtree<T>, Vec<u32>) {
    let extent = prims.par_chunks(PIECE).map(Extent::of).reduce(|| Extent::EMPTY, Extent::union);
    // Zeroed memory comes when it is touched, by the thread that does.
    let mut spare = bytemuck::zeroed_vec(prims.len());
    let mut order = vec![0; prims.len()];
    let all = Order { first: 0, order: &mut order };
    (large(&mut prims, &mut spare, all, [extent; 2], max_leaf, 0, finish), order)
}

/// The same without threads' shares.
pub(super) fn build_binary(prims: Vec<Prim>, max_leaf: usize) -> Bvh {
    if prims.is_empty() {
        return Bvh::default();
    }
    let (tree, order) = build(prims, max_leaf, &|nodes| nodes);
    let mut nodes = vec![Node { min: Vec3::ZERO, first: 0, max: Vec3::ZERO, count: 0 }];
    assemble(tree, 0, &mut nodes);
    Bvh { nodes, prims: order }
}

/// Puts `tree` into the array, its root at `slot`.
fn assemble(tree: Subtree<Vec<Node>>, slot: usize, nodes: &mut Vec<Node>) {
    match tree {
        Subtree::Done(own) => {
            // The root goes to its slot, the others to the end.
            let moved = |node: &Node| {
                let shift = if node.count == 0 { nodes.len() as u32 - 1 } else { 0 };
                Node { first: node.first + shift, ..*node }
            };
            let root = moved(&own[0]);
            let rest: Vec<Node> = own[1..].iter().map(moved).collect();
            nodes[slot] = root;
            nodes.extend(rest);
        }
        Subtree::Inner(node, children) => {
            let pair = nodes.len();
            nodes[slot] = Node { first: pair as u32, ..node };
            nodes.extend([node, node]);
            let [left, right] = *children;
            assemble(left, pair, nodes);
            assemble(right, pair + 1, nodes);
        }
    }
}

/// The subtree over `prims`, whose boxes are in the first and whose centres are in the second of `extents`; with
/// threads while it is large.
fn large<T: Send>(
    prims: &mut [Prim],
    spare: &mut [Prim],
    order: Order,
    [extent, centers]: [Extent; 2],
    max_leaf: usize,
    depth: usize,
    finish: &(impl Fn(Vec<Node>) -> T + Sync),
) -> Subtree<T> {
    if prims.len() < TASK {
        let mut nodes = Vec::with_capacity(prims.len());
        nodes.push(leaf(&extent, 0, 0));
        small(prims, spare, order.order, order.first, &extent, max_leaf, depth, 0, &mut nodes);
        return Subtree::Done(finish(nodes));
    }
    let centers = if prims.len() < LONG { Extent::of_centers(prims) } else { centers };
    let (middle, extents) = part(prims, spare, &centers, depth);
    let [left_extents, right_extents] = extents.map(|extent| [extent, centers.intersection(&extent)]);
    let (left, right) = spare.split_at_mut(middle);
    let (left_spare, right_spare) = prims.split_at_mut(middle);
    let (left_output, right_output) = order.split(middle);
    let (left, right) = rayon::join(
        || large(left, left_spare, left_output, left_extents, max_leaf, depth + 1, finish),
        || large(right, right_spare, right_output, right_extents, max_leaf, depth + 1, finish),
    );
    Subtree::Inner(leaf(&extent, 0, 0), Box::new([left, right]))
}

fn leaf(extent: &Extent, first: usize, count: usize) -> Node {
    Node { min: extent.lo.xyz(), first: first as u32, max: extent.hi.xyz(), count: count as u32 }
}

/// The same by one thread, the root being node `slot`.
#[expect(clippy::too_many_arguments, reason = "the state of a recursion that must not allocate")]
fn small(
    prims: &mut [Prim],
    spare: &mut [Prim],
    order: &mut [u32],
    first: usize,
    extent: &Extent,
    max_leaf: usize,
    depth: usize,
    slot: usize,
    nodes: &mut Vec<Node>,
) {
    if prims.len() == 1 || prims.len() <= max_leaf && !pays(prims, extent) {
        nodes[slot] = leaf(extent, first, prims.len());
        for (index, prim) in order.iter_mut().zip(prims) {
            *index = prim.index();
        }
        return;
    }
    let (middle, [left, right]) = part(prims, spare, &Extent::of_centers(prims), depth);
    let pair = nodes.len();
    nodes[slot] = leaf(extent, pair, 0);
    nodes.extend([leaf(&left, 0, 0), leaf(&right, 0, 0)]);
    let (left_prims, right_prims) = spare.split_at_mut(middle);
    let (left_spare, right_spare) = prims.split_at_mut(middle);
    let (left_order, right_order) = order.split_at_mut(middle);
    small(left_prims, left_spare, left_order, first, &left, max_leaf, depth + 1, pair, nodes);
    let first = first + middle;
    small(right_prims, right_spare, right_order, first, &right, max_leaf, depth + 1, pair + 1, nodes);
}

/// Whether what would fit into a leaf is better split: whether one leaf costs more than as many as there are prims,
/// if nodes above had room for them.
fn pays(prims: &[Prim], extent: &Extent) -> bool {
    let apart: f32 = prims.iter().map(Prim::half_area).sum();
    apart * leaf_cost(1) < extent.half_area() * leaf_cost(prims.len() as u32)
}

/// Moves `prims`, whose centres are in `centers`, to `spare`, parted in two, neither side empty; returns where, and
/// the boxes of both.
///
/// The fewer there are the fewer bins: they cost more than what goes into them.
fn part(prims: &[Prim], spare: &mut [Prim], centers: &Extent, depth: usize) -> (usize, [Extent; 2]) {
    let parted = match prims.len() {
        _ if depth >= SAH_LEVELS => None,
        // One way only.
        0..3 => None,
        3..32 => part_binned::<4>(prims, spare, centers),
        32..192 => part_binned::<8>(prims, spare, centers),
        192..LONG => part_binned::<16>(prims, spare, centers),
        _ => part_long(prims, spare, centers).or_else(|| part_long(prims, spare, &Extent::of_centers(prims))),
    };
    parted.unwrap_or_else(|| {
        spare.copy_from_slice(prims);
        let middle = prims.len() / 2;
        (middle, [Extent::of(&prims[..middle]), Extent::of(&prims[middle..])])
    })
}

/// At the cheapest plane between `N` bins, if there is one.
fn part_binned<const N: usize>(
    prims: &[Prim],
    spare: &mut [Prim],
    centers: &Extent,
) -> Option<(usize, [Extent; 2])> {
    let grid = Grid::new(centers, N);
    let bins = Bins::<N>::with(prims, grid);
    let (_, plane) = best_plane(&bins)?;
    let (mut left, mut right) = (0, spare.len());
    for prim in prims {
        // No branch, which could not be foretold: written to both ends, the other is overwritten later.
        let is_left = usize::from(grid.is_below::<N>(&plane, prim));
        spare[left] = *prim;
        spare[right - 1] = *prim;
        left += is_left;
        right -= 1 - is_left;
    }
    Some((left, bins.sides(&plane)))
}

/// The same in pieces by all threads.
fn part_long(prims: &[Prim], to: &mut [Prim], centers: &Extent) -> Option<(usize, [Extent; 2])> {
    const BINS: usize = 16;
    let grid = Grid::new(centers, BINS);
    let pieces: Vec<Bins<BINS>> = prims.par_chunks(PIECE).map(|piece| Bins::with(piece, grid)).collect();
    let bins = pieces.iter().fold(Bins::empty(grid), Bins::union);
    let (_, plane) = best_plane(&bins)?;
    let middle = bins.count_below(&plane);
    let (mut left, mut right) = to.split_at_mut(middle);
    let mut places = Vec::with_capacity(pieces.len());
    for (piece, bins) in prims.chunks(PIECE).zip(&pieces) {
        let count = bins.count_below(&plane);
        let (own_left, rest) = left.split_at_mut(count);
        left = rest;
        let (own_right, rest) = right.split_at_mut(piece.len() - count);
        right = rest;
        places.push((piece, own_left, own_right));
    }
    places.into_par_iter().for_each(|(piece, left, right)| {
        let (mut to_left, mut to_right) = (left.iter_mut(), right.iter_mut());
        for prim in piece {
            let next = if grid.is_below::<BINS>(&plane, prim) { to_left.next() } else { to_right.next() };
            if let Some(place) = next {
                *place = *prim;
            }
        }
    });
    Some((middle, bins.sides(&plane)))
}
