//! How a [`LightTree`] is made: emitters are parted by two, then nodes of many children made of the pairs.

use super::node::{Group, Node, WIDTH};
use super::{Home, LightTree};
use crate::bvh::Aabb;
use crate::trace::emitter::Emitter;
use glam::Vec3;
use std::f32::consts::PI;
use std::ops::Range;

/// Cones up to this, in radians, are alike.
const ALIKE: f32 = 0.5;
/// Planes that are tried along each axis.
const BINS: usize = 12;
/// Of more emitters so many judge for all.
const JUDGED: usize = 256;
/// More than this are parted by several threads.
const MANY: usize = 4096;
/// From this depth on pairs are halves by number.
const DEEP: u32 = 30;
/// So no way down has more nodes: 2³² emitters are halved as often.
pub(super) const DEEPEST: usize = DEEP as usize + 32;

/// Emitters in two parts, or as few as fit into one node.
struct Pair {
    group: Group,
    parts: Option<Box<[Pair; 2]>>,
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
        let pair = part(emitters, &mut order, 0, 0);
        let mut sum = 0.0;
        tree.sums.push(sum);
        for (place, &emitter) in (0..).zip(&order) {
            sum += f64::from(emitters[emitter as usize].intensity);
            tree.sums.push(sum);
            tree.homes[emitter as usize].place = place;
        }
        tree.order = order;
        tree.add(emitters, &pair, (0, 0));
        tree
    }

    /// Adds nodes of all that is in `pair`, and returns the number of the first.
    fn add(&mut self, emitters: &[Emitter], Pair { group, parts }: &Pair, parent: (u32, u32)) -> u32 {
        let Some(parts) = parts else { return self.add_each(emitters, group.places.clone(), parent) };
        let mut members: Vec<&Pair> = parts.iter().collect();
        while members.len() < WIDTH {
            // What is most in need of being looked into.
            let costs = members.iter().enumerate().filter_map(|(i, member)| {
                member.parts.as_ref().map(|parts| (i, parts, member.group.all.cost()))
            });
            let Some((i, parts, _)) = costs.max_by(|a, b| a.2.total_cmp(&b.2)) else { break };
            // In the order of their places: so numbers that are near each other mean emitters that are.
            members.splice(i..=i, parts.iter());
        }
        let number = self.push(members.iter().map(|member| &member.group), parent);
        for (child, member) in (0..).zip(members) {
            if let [only] = self.order[member.group.places.clone()] {
                let home = &mut self.homes[only as usize];
                (home.node, home.child) = (number, child);
            } else {
                let node = self.add(emitters, member, (number, child));
                self.nodes[number as usize].children[child as usize].node = node;
            }
        }
        number
    }

    /// Adds a node of the emitters in these places.
    fn add_each(&mut self, emitters: &[Emitter], places: Range<usize>, parent: (u32, u32)) -> u32 {
        let alone = |place: usize| {
            let all = emitters[self.order[place] as usize];
            Group { all, alike: true, places: place..place + 1 }
        };
        let groups: Vec<Group> = places.clone().map(alone).collect();
        let number = self.push(groups.iter(), parent);
        for (child, place) in (0..).zip(places) {
            let home = &mut self.homes[self.order[place] as usize];
            (home.node, home.child) = (number, child);
        }
        number
    }

    fn push<'a>(&mut self, groups: impl Iterator<Item = &'a Group>, parent: (u32, u32)) -> u32 {
        let groups: Vec<(&Group, f64)> =
            groups.map(|group| (group, self.intensity(group.places.start, group.places.len()))).collect();
        self.nodes.push(Node::new(&groups, parent));
        self.nodes.len() as u32 - 1
    }
}

/// Parts those of `order`, of which the first has this `place` among all.
fn part(emitters: &[Emitter], order: &mut [u32], place: usize, depth: u32) -> Pair {
    let places = place..place + order.len();
    if order.len() <= WIDTH {
        sort(emitters, order);
        let each = order.iter().map(|&i| (emitters[i as usize], true));
        let (all, alike) = each.reduce(together).unwrap_or_default();
        return Pair { group: Group { all, alike, places }, parts: None };
    }
    let middle = split(emitters, order, depth);
    let (left, right) = order.split_at_mut(middle);
    let mut first = || part(emitters, left, place, depth + 1);
    let mut second = || part(emitters, right, place + middle, depth + 1);
    let parts = if places.len() > MANY { rayon::join(&mut first, &mut second) } else { (first(), second()) };
    let of = |Pair { group: Group { all, alike, .. }, .. }: &Pair| (*all, *alike);
    let (all, alike) = together(of(&parts.0), of(&parts.1));
    Pair { group: Group { all, alike, places }, parts: Some(Box::new(parts.into())) }
}

/// Both, and whether they are alike; each of them may be many, alike or not.
fn together(
    (first, first_alike): (Emitter, bool),
    (second, second_alike): (Emitter, bool),
) -> (Emitter, bool) {
    let all = first.union(&second);
    // Those of no common direction only if each of them shines to all sides.
    let is_one_way = |emitter: &Emitter| emitter.spread <= ALIKE;
    let is_every_way = |emitter: &Emitter| emitter.spread >= PI;
    let same = is_one_way(&all) || is_every_way(&first) && is_every_way(&second);
    (all, first_alike && second_alike && same && first.two_sided == second.two_sided)
}

/// Those of a node, so that numbers that are near each other mean emitters that are.
fn sort(emitters: &[Emitter], order: &mut [u32]) {
    if order.len() <= 2 {
        return;
    }
    let center = |i: u32| emitters[i as usize].bounds.center();
    let bounds = order.iter().fold(Aabb::EMPTY, |bounds, &i| bounds.with(center(i)));
    let axis = (bounds.max - bounds.min).max_position();
    order.sort_by(|&a, &b| center(a)[axis].total_cmp(&center(b)[axis]));
    let (left, right) = order.split_at_mut(order.len() / 2);
    sort(emitters, left);
    sort(emitters, right);
}

/// Sorts `order` into two parts, neither of which is empty; returns where the second begins.
fn split(emitters: &[Emitter], order: &mut [u32], depth: u32) -> usize {
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
            let is_left = |i: &u32| bin(&bounds, axis, center(*i)) < plane;
            let (left, right): (Vec<u32>, Vec<u32>) = order.iter().partition(|&i| is_left(i));
            order[..left.len()].copy_from_slice(&left);
            order[left.len()..].copy_from_slice(&right);
            left.len()
        }
        None => order.len() / 2,
    }
}

fn bin(bounds: &Aabb, axis: usize, center: Vec3) -> usize {
    let place = (center[axis] - bounds.min[axis]) / (bounds.max[axis] - bounds.min[axis]);
    ((place * BINS as f32) as usize).min(BINS - 1)
}
