//! Top down by the surface area heuristic in bins.
//!
//! Reference: I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", RT 2007. At each level a list
//! is looked through three times: for the outermost centres, to sort it into bins between these, which tells the boxes of
//! both halves, and to part it. Lists longer than the cache are looked through twice: their box has the outermost
//! centres in it, and only if bins stay empty they are looked for.

use super::bins::{Bins, Grid};
use super::prim::{Extent, Prim};
use super::{Bvh, Node, PIECE, SAH_LEVELS};
use crate::bvh::merge::leaf_cost;
use glam::{Vec3, Vec4Swizzles};
use rayon::prelude::*;

/// Lists of at least this length are shared out among threads.
const LONG: usize = 2 * PIECE;
/// What a place in a node costs, over visiting the node.
const PLACE_COST: f32 = 0.3;
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
    (large(&mut prims, &mut spare, all, extent, extent, max_leaf, 0, finish), order)
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

/// The subtree over `prims`, which are in `extent` and whose centres are in `centers`; with threads while it is large.
fn large<T: Send>(
    prims: &mut [Prim],
    spare: &mut [Prim],
    order: Order,
    extent: Extent,
    mut centers: Extent,
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
    let (middle, [left_extent, right_extent]) = if prims.len() < LONG || depth >= SAH_LEVELS {
        part(prims, spare, depth)
    } else {
        part_long(prims, spare, &mut centers).unwrap_or_else(|| halve(prims, spare))
    };
    let (left_centers, right_centers) =
        (centers.intersection(&left_extent), centers.intersection(&right_extent));
    let (left, right) = spare.split_at_mut(middle);
    let (left_spare, right_spare) = prims.split_at_mut(middle);
    let (left_order, right_order) = order.split(middle);
    let depth = depth + 1;
    let (left, right) = rayon::join(
        || large(left, left_spare, left_order, left_extent, left_centers, max_leaf, depth, finish),
        || large(right, right_spare, right_order, right_extent, right_centers, max_leaf, depth, finish),
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
    if prims.len() <= max_leaf && !pays(prims, extent) {
        nodes[slot] = leaf(extent, first, prims.len());
        for (index, prim) in order.iter_mut().zip(prims) {
            *index = prim.index();
        }
        return;
    }
    let (middle, [left, right]) = part(prims, spare, depth);
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

/// Whether what would fit into a leaf is better split: whether there is a way to part it that costs less, a place in the
/// node above included.
fn pays(prims: &[Prim], extent: &Extent) -> bool {
    fn cost<const N: usize>(side: [&Prim; N]) -> f32 {
        let extent = side.into_iter().fold(Extent::EMPTY, Extent::with);
        extent.half_area() * leaf_cost(N as u32)
    }
    let least = match prims {
        [] | [_] => return false,
        [a, b] => cost([a]) + cost([b]),
        [a, b, c] => (cost([a, b]) + cost([c])).min(cost([a, c]) + cost([b])).min(cost([b, c]) + cost([a])),
        [a, b, c, d] => {
            let pairs = (cost([a, b]) + cost([c, d])).min(cost([a, c]) + cost([b, d]));
            let first = pairs.min(cost([a, d]) + cost([b, c]));
            let ends = (cost([a, b, c]) + cost([d])).min(cost([b, c, d]) + cost([a]));
            first.min(ends).min(cost([a, b, d]) + cost([c])).min(cost([a, c, d]) + cost([b]))
        }
        _ => return true,
    };
    least + PLACE_COST * extent.half_area() < extent.half_area() * leaf_cost(prims.len() as u32)
}

/// Moves `prims` to `spare`, parted in two, neither side empty; returns where, and the boxes of both.
///
/// The fewer there are the fewer bins: they cost more than what goes into them.
fn part(prims: &[Prim], spare: &mut [Prim], depth: usize) -> (usize, [Extent; 2]) {
    let parted = match prims.len() {
        _ if depth >= SAH_LEVELS => None,
        // One way only.
        0..3 => None,
        3..32 => part_binned::<4>(prims, spare),
        32..192 => part_binned::<8>(prims, spare),
        _ => part_binned::<16>(prims, spare),
    };
    parted.unwrap_or_else(|| halve(prims, spare))
}

/// In the middle of the list.
fn halve(prims: &[Prim], spare: &mut [Prim]) -> (usize, [Extent; 2]) {
    spare.copy_from_slice(prims);
    let (left, right) = prims.split_at(prims.len() / 2);
    (left.len(), [Extent::of(left), Extent::of(right)])
}

/// At the cheapest plane between `N` bins, if there is one.
fn part_binned<const N: usize>(prims: &[Prim], spare: &mut [Prim]) -> Option<(usize, [Extent; 2])> {
    let grid = Grid::new::<N>(&Extent::of_centers(prims));
    let bins = Bins::<N>::with(prims, grid);
    let plane = bins.best_plane()?;
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

/// The same in pieces by all threads. The centres are in `centers`, which becomes tighter if that is called for.
fn part_long(prims: &[Prim], to: &mut [Prim], centers: &mut Extent) -> Option<(usize, [Extent; 2])> {
    let mut binned = Binned::new(prims, centers);
    if binned.all.has_empty_ends() {
        let outermost = prims.par_chunks(PIECE).map(Extent::of_centers);
        *centers = outermost.reduce(|| Extent::EMPTY, Extent::union);
        binned = Binned::new(prims, centers);
    }
    let Binned { grid, pieces, all } = binned;
    let plane = all.best_plane()?;
    let middle = all.count_below(&plane);
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
            let is_left = grid.is_below::<LONG_BINS>(&plane, prim);
            let next = if is_left { to_left.next() } else { to_right.next() };
            if let Some(place) = next {
                *place = *prim;
            }
        }
    });
    Some((middle, all.sides(&plane)))
}

/// Bins for long lists.
const LONG_BINS: usize = 16;

/// A long list in bins, by pieces and all together.
struct Binned {
    grid: Grid,
    pieces: Vec<Bins<LONG_BINS>>,
    all: Bins<LONG_BINS>,
}

impl Binned {
    fn new(prims: &[Prim], centers: &Extent) -> Self {
        let grid = Grid::new::<LONG_BINS>(centers);
        let pieces: Vec<_> = prims.par_chunks(PIECE).map(|piece| Bins::with(piece, grid)).collect();
        let all = pieces.iter().fold(Bins::empty(grid), Bins::union);
        Self { grid, pieces, all }
    }
}
