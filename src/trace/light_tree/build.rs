//! How a [`LightTree`] is made: emitters are parted by two, then nodes of many children made of the pairs.

use super::node::{Group, Node, WIDTH};
use super::{Home, LightTree};
use crate::bvh::Aabb;
use crate::trace::emitter::Emitter;
use glam::Vec3;
use std::f32::consts::PI;

/// Cones up to this, in radians, are alike.
const ALIKE: f32 = 0.5;
/// Planes that are tried along each axis.
const BINS: usize = 12;
/// Of more emitters so many judge for all.
const JUDGED: usize = 1024;
/// From this depth on pairs are halves by number.
const DEEP: u32 = 30;
/// So no way down has more nodes: 2³² emitters are halved as often.
pub(super) const DEEPEST: usize = DEEP as usize + 32;

/// Emitters in two parts.
struct Pair {
    group: Group,
    /// Number of the first part, which the second follows; 0 for a single emitter.
    child: usize,
}

impl LightTree {
    /// Over these; those that bring nothing are chosen with those beside them, if ever.
    #[must_use]
    pub fn new(emitters: &[Emitter]) -> Self {
        let mut tree = Self { homes: vec![Home::default(); emitters.len()], ..Self::default() };
        if emitters.is_empty() {
            return tree;
        }
        let mut order: Vec<u32> = (0..emitters.len() as u32).collect();
        let mut pairs = Vec::with_capacity(2 * emitters.len());
        pairs.push(None);
        part(&mut pairs, 0, emitters, &mut order, [0, 0]);
        let pairs: Vec<Pair> = pairs.into_iter().flatten().collect();
        let mut sum = 0.0;
        tree.sums.push(sum);
        for (place, &emitter) in (0..).zip(&order) {
            sum += f64::from(emitters[emitter as usize].intensity);
            tree.sums.push(sum);
            tree.homes[emitter as usize].place = place;
        }
        tree.order = order;
        tree.add(&pairs, 0, (0, 0));
        tree
    }

    /// Adds a node of all that is below one of the `pairs`, and returns its number.
    fn add(&mut self, pairs: &[Pair], top: usize, parent: (u32, u32)) -> u32 {
        let mut members = vec![top];
        while members.len() < WIDTH {
            // What is most in need of being looked into.
            let few = if pairs[top].group.places.len() > WIDTH { WIDTH } else { 1 };
            let many =
                members.iter().enumerate().filter(|&(_, &member)| pairs[member].group.places.len() > few);
            let costs = many.map(|(i, &member)| (i, pairs[member].group.all.cost()));
            let Some((i, _)) = costs.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            let child = pairs[members[i]].child;
            // In the order of their places: so numbers that are near each other mean emitters that are.
            members.splice(i..=i, [child, child + 1]);
        }
        let groups: Vec<(&Group, f64)> = members
            .iter()
            .map(|&member| &pairs[member].group)
            .map(|group| (group, self.intensity(group.places.start, group.places.len())))
            .collect();
        let number = self.nodes.len() as u32;
        self.nodes.push(Node::new(&groups, parent));
        for (child, &member) in (0..).zip(&members) {
            if pairs[member].child > 0 {
                let node = self.add(pairs, member, (number, child));
                self.nodes[number as usize].children[child as usize].node = node;
            } else {
                let home = &mut self.homes[self.order[pairs[member].group.places.start] as usize];
                (home.node, home.child) = (number, child);
            }
        }
        number
    }
}

/// Makes pair number `at` of those of `order`, of which the first has this place among all; returns them together, and whether
/// they are alike.
fn part(
    pairs: &mut Vec<Option<Pair>>,
    at: usize,
    emitters: &[Emitter],
    order: &mut [u32],
    [place, depth]: [usize; 2],
) -> (Emitter, bool) {
    let places = place..place + order.len();
    if let [only] = *order {
        let all = emitters[only as usize];
        pairs[at] = Some(Pair { group: Group { all, alike: true, places }, child: 0 });
        return (all, true);
    }
    let middle = split(emitters, order, depth as u32);
    let child = pairs.len();
    pairs.extend([None, None]);
    let (left, right) = order.split_at_mut(middle);
    let (first, first_alike) = part(pairs, child, emitters, left, [place, depth + 1]);
    let (second, second_alike) = part(pairs, child + 1, emitters, right, [place + middle, depth + 1]);
    let all = first.union(&second);
    // Those of no common direction only if each of them shines to all sides.
    let is_one_way = |emitter: &Emitter| emitter.spread <= ALIKE;
    let is_every_way = |emitter: &Emitter| emitter.spread >= PI;
    let same = is_one_way(&all) || is_every_way(&first) && is_every_way(&second);
    let alike = first_alike && second_alike && same && first.two_sided == second.two_sided;
    pairs[at] = Some(Pair { group: Group { all, alike, places }, child });
    (all, alike)
}

/// Sorts `order` into two parts, neither of which is empty; returns where the second begins.
fn split(emitters: &[Emitter], order: &mut [u32], depth: u32) -> usize {
    if order.len() <= 2 {
        return 1;
    }
    let center = |i: u32| emitters[i as usize].bounds.center();
    let bounds = order.iter().fold(Aabb::EMPTY, |bounds, &i| bounds.with(center(i)));
    let size = bounds.max - bounds.min;
    let longest = size.max_element();
    let join = |sum: Option<Emitter>, more: Option<Emitter>| match (sum, more) {
        (Some(sum), Some(more)) => Some(sum.union(&more)),
        (sum, more) => sum.or(more),
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| size[axis] > 0.0 && depth < DEEP) {
        let mut bins: [Option<Emitter>; BINS] = [None; BINS];
        for &i in order.iter().step_by(order.len().div_ceil(JUDGED)) {
            let bin = &mut bins[bin(&bounds, axis, center(i))];
            *bin = join(*bin, Some(emitters[i as usize]));
        }
        // What is to the right of each plane, from the last on; then what is to the left, from the first on.
        let mut right = bins;
        for i in (0..BINS - 1).rev() {
            right[i] = join(bins[i], right[i + 1]);
        }
        // Long boxes are not cut along their length.
        let factor = longest / size[axis];
        let mut left = None;
        for plane in 1..BINS {
            left = join(left, bins[plane - 1]);
            if let (Some(left), Some(right)) = (left, right[plane]) {
                let cost = factor * (left.cost() + right.cost());
                if best.is_none_or(|best| cost < best.0) {
                    best = Some((cost, axis, plane));
                }
            }
        }
    }
    match best {
        Some((_, axis, plane)) => {
            order.sort_by_key(|&i| bin(&bounds, axis, center(i)) >= plane);
            order.partition_point(|&i| bin(&bounds, axis, center(i)) < plane)
        }
        None => order.len() / 2,
    }
}

fn bin(bounds: &Aabb, axis: usize, center: Vec3) -> usize {
    let place = (center[axis] - bounds.min[axis]) / (bounds.max[axis] - bounds.min[axis]);
    ((place * BINS as f32) as usize).min(BINS - 1)
}
