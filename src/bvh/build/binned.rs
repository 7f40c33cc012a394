//! Top down by the surface area heuristic in bins.
//!
//! Reference: I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", RT 2007. Each level is
//! two passes over the list: one sorts it into bins, the other parts it in two and finds the extents of
//! both halves on the way.

use super::bins::{Bins, Grid, best_plane};
use super::prim::{Extent, Prim, half_area};
use super::{Bvh, Node, SAH_LEVELS};
use glam::{Vec3, Vec4Swizzles};
use rayon::prelude::*;

/// Cost of visiting a node over that of testing a triangle.
const NODE_COST: f32 = 1.0;
/// Lists of at least this length are shared out among threads in pieces of this length.
const PIECE: usize = 1 << 14;
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
    (large(&mut prims, &mut spare, all, extent, max_leaf, 0, finish), order)
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

/// The subtree over `prims`; with threads while it is large.
fn large<T: Send>(
    prims: &mut [Prim],
    spare: &mut [Prim],
    order: Order,
    extent: Extent,
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
    let (middle, extents) = part(prims, spare, &extent, depth);
    let (left, right) = spare.split_at_mut(middle);
    let (left_spare, right_spare) = prims.split_at_mut(middle);
    let (left_output, right_output) = order.split(middle);
    let [left_extent, right_extent] = extents;
    let (left, right) = rayon::join(
        || large(left, left_spare, left_output, left_extent, max_leaf, depth + 1, finish),
        || large(right, right_spare, right_output, right_extent, max_leaf, depth + 1, finish),
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
    if prims.len() <= max_leaf && !pays(prims, extent, max_leaf) {
        nodes[slot] = leaf(extent, first, prims.len());
        for (index, prim) in order.iter_mut().zip(prims) {
            *index = prim.index();
        }
        return;
    }
    let (middle, [left, right]) = part(prims, spare, extent, depth);
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

/// Whether splitting what would fit into a leaf is worth a node.
fn pays(prims: &[Prim], extent: &Extent, max_leaf: usize) -> bool {
    if prims.len() < 2 || max_leaf < 2 {
        return false;
    }
    if let [a, b] = prims {
        return NODE_COST * half_area(extent.lo, extent.hi) + half_area(a.lo, a.hi) + half_area(b.lo, b.hi)
            < 2.0 * half_area(extent.lo, extent.hi);
    }
    let Some((cost, _)) = best_plane(&Bins::<4>::with(prims, Grid::new(extent, 4))) else { return false };
    let area = half_area(extent.lo, extent.hi);
    NODE_COST * area + cost < area * prims.len() as f32
}

/// Moves `prims` to `spare`, parted in two, neither side empty; returns where, and the extents of both.
///
/// The fewer there are the fewer bins: they cost more than what goes into them.
fn part(prims: &[Prim], spare: &mut [Prim], extent: &Extent, depth: usize) -> (usize, [Extent; 2]) {
    let parted = match prims.len() {
        _ if depth >= SAH_LEVELS => None,
        // One way only.
        0..3 => None,
        3..12 => part_binned::<4>(prims, spare, extent),
        12..192 => part_binned::<8>(prims, spare, extent),
        _ => part_binned::<16>(prims, spare, extent),
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
    extent: &Extent,
) -> Option<(usize, [Extent; 2])> {
    let grid = Grid::new(extent, N);
    let pieces = prims.len() >= 2 * PIECE;
    let bins: Bins<N> = if pieces {
        let binned = prims.par_chunks(PIECE).map(|piece| Bins::with(piece, grid));
        binned.reduce(|| Bins::empty(grid), Bins::union)
    } else {
        Bins::with(prims, grid)
    };
    let (_, plane) = best_plane(&bins)?;
    let is_left = |prim: &Prim| grid.bin::<N>(prim)[plane.axis] < plane.bin;
    Some(if pieces { part_pieces(prims, spare, is_left) } else { part_piece(prims, spare, is_left) })
}

/// Those on the left from the front, those on the right from the back.
fn part_piece(prims: &[Prim], to: &mut [Prim], is_left: impl Fn(&Prim) -> bool) -> (usize, [Extent; 2]) {
    let mut extents = [Extent::EMPTY; 2];
    let (mut left, mut right) = (0, to.len());
    for prim in prims {
        // No branch, which could not be foretold: written to both ends, the other is overwritten later.
        let side = usize::from(!is_left(prim));
        to[left] = *prim;
        to[right - 1] = *prim;
        left += 1 - side;
        right -= side;
        extents[side].add(prim);
    }
    (left, extents)
}

/// The same in pieces by all threads.
fn part_pieces(
    prims: &[Prim],
    to: &mut [Prim],
    is_left: impl Fn(&Prim) -> bool + Sync,
) -> (usize, [Extent; 2]) {
    let counts: Vec<usize> =
        prims.par_chunks(PIECE).map(|piece| piece.iter().filter(|prim| is_left(prim)).count()).collect();
    let middle = counts.iter().sum();
    let (mut left, mut right) = to.split_at_mut(middle);
    let mut places = Vec::with_capacity(counts.len());
    for (piece, &count) in prims.chunks(PIECE).zip(&counts) {
        let (own_left, rest) = left.split_at_mut(count);
        left = rest;
        let (own_right, rest) = right.split_at_mut(piece.len() - count);
        right = rest;
        places.push((piece, own_left, own_right));
    }
    let extents = places
        .into_par_iter()
        .map(|(piece, left, right)| {
            let mut extents = [Extent::EMPTY; 2];
            let (mut to_left, mut to_right) = (left.iter_mut(), right.iter_mut());
            for prim in piece {
                let side = usize::from(!is_left(prim));
                let next = if side == 0 { to_left.next() } else { to_right.next() };
                if let Some(place) = next {
                    *place = *prim;
                }
                extents[side].add(prim);
            }
            extents
        })
        .reduce(|| [Extent::EMPTY; 2], |a, b| [a[0].union(b[0]), a[1].union(b[1])]);
    (middle, extents)
}
