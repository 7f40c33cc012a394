//! Which of many emitters to sample at a point: a hierarchy over them, descended by how much each half may bring.
//!
//! Every node knows a box and a cone of normals around its emitters and their intensity; from these follows what
//! they could bring to a point at most, nearly. The way down is chosen in proportion, so that the cost grows with
//! the logarithm of their number.
//!
//! Reference: A. Conty Estevez, C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", Proc. ACM
//! Computer Graphics and Interactive Techniques 1(2), 2018.

mod node;

use super::emitter::{Emitter, Receiver};
use crate::bvh::Aabb;
use glam::Vec3;
use node::{Node, Prospect};
use std::f32::consts::PI;

/// One that was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chosen {
    /// Its number.
    pub emitter: usize,
    /// Probability of that.
    pub chance: f32,
    /// What is left of the random number: a fresh one.
    pub rest: f32,
}

/// A hierarchy over emitters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// The way to each emitter from the root: a bit for each node, the first lowest; and its place in `order`.
    ways: Vec<(u64, u32)>,
    /// Emitters as leaves have them, from first to last.
    order: Vec<u32>,
    /// Sums of the intensities of those before each place, and of all.
    sums: Vec<f64>,
}

/// Cones up to this, in radians, are alike.
const ALIKE: f32 = 0.5;
/// The least chance of a child that could bring anything: below it random numbers have gaps.
const LEAST: f32 = 1.0 / 4096.0;

/// Planes that are tried along each axis.
const BINS: usize = 12;
/// Of more emitters so many judge for all.
const JUDGED: usize = 1024;
/// From this depth on nodes are halved by number, so that a way has at most 64 bits.
const DEEP: u32 = 30;

impl LightTree {
    /// Over these; those that bring nothing are chosen with those beside them, if ever.
    #[must_use]
    pub fn new(emitters: &[Emitter]) -> Self {
        let mut tree = Self { ways: vec![(0, 0); emitters.len()], ..Self::default() };
        if emitters.is_empty() {
            return tree;
        }
        let mut order: Vec<u32> = (0..emitters.len() as u32).collect();
        tree.nodes.reserve(2 * emitters.len());
        tree.nodes.push(Node::default());
        tree.build(0, emitters, &mut order, [0, 0], 0);
        let mut sum = 0.0;
        tree.sums.push(sum);
        for (place, &emitter) in (0..).zip(&order) {
            sum += f64::from(emitters[emitter as usize].intensity);
            tree.sums.push(sum);
            tree.ways[emitter as usize].1 = place;
        }
        tree.order = order;
        tree
    }

    /// Whether there is nothing to choose from.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Fills `node` with those of `order`, of which the first has this place among all, and returns them together, and whether
    /// they are alike.
    fn build(
        &mut self,
        node: usize,
        emitters: &[Emitter],
        order: &mut [u32],
        [place, depth]: [usize; 2],
        way: u64,
    ) -> (Emitter, bool) {
        let places = place..place + order.len();
        if let [only] = *order {
            let emitter = emitters[only as usize];
            self.nodes[node] = Node::new(&emitter, false, 0, places);
            self.ways[only as usize].0 = way;
            return (emitter, true);
        }
        let middle = split(emitters, order, depth as u32);
        let child = self.nodes.len();
        self.nodes.extend([Node::default(); 2]);
        let (left, right) = order.split_at_mut(middle);
        let (first, first_alike) = self.build(child, emitters, left, [place, depth + 1], way);
        let way = way | 1 << depth;
        let (second, second_alike) = self.build(child + 1, emitters, right, [place + middle, depth + 1], way);
        let all = first.union(&second);
        // Those of no common direction only if each of them shines to all sides.
        let is_one_way = |emitter: &Emitter| emitter.spread <= ALIKE;
        let is_every_way = |emitter: &Emitter| emitter.spread >= PI;
        let same = is_one_way(&all) || is_every_way(&first) && is_every_way(&second);
        let alike = first_alike && second_alike && same;
        self.nodes[node] = Node::new(&all, alike, child, places);
        (all, alike)
    }

    /// Both children, and the probability of the first.
    #[inline(always)]
    fn branch(&self, node: &Node, to: &Receiver) -> ([&Node; 2], [Prospect; 2], f32) {
        let child = node.child as usize;
        let (first, second) = (&self.nodes[child], &self.nodes[child + 1]);
        let (a, b) = (first.from(to), second.from(to));
        // Scaled: of huge ones the sum would overflow.
        let share = 1.0 / (1.0 + b.importance / a.importance);
        let share = match share {
            _ if share.is_nan() => 0.5,
            _ if a.importance > 0.0 && b.importance > 0.0 => share.clamp(LEAST, 1.0 - LEAST),
            _ => share,
        };
        ([first, second], [a, b], share)
    }

    /// Chooses one by a number in [0, 1); `None` if there is none.
    #[must_use]
    pub fn sample(&self, to: &Receiver, random: f32) -> Option<Chosen> {
        let mut node = self.nodes.first()?;
        let mut is_far = node.from(to).is_far;
        let (mut chance, mut rest) = (1.0, random);
        while node.count > 1 && !is_far {
            let (children, prospects, share) = self.branch(node, to);
            let second = rest >= share;
            let (here, below) = if second { (1.0 - share, share) } else { (share, 0.0) };
            chance *= here;
            rest = ((rest - below) / here).clamp(0.0, 1.0 - f32::EPSILON);
            (node, is_far) = (children[usize::from(second)], prospects[usize::from(second)].is_far);
        }
        let mut place = node.first as usize;
        if node.count > 1 {
            let sums = &self.sums[place..=place + node.count as usize];
            let all = sums[node.count as usize] - sums[0];
            let wanted = sums[0] + f64::from(rest) * all;
            let i = sums[1..node.count as usize].partition_point(|&sum| sum <= wanted);
            let own = sums[i + 1] - sums[i];
            place += i;
            chance *= (own / all) as f32;
            rest = (((wanted - sums[i]) / own) as f32).clamp(0.0, 1.0 - f32::EPSILON);
        }
        (chance > 0.0).then_some(Chosen { emitter: self.order[place] as usize, chance, rest })
    }

    /// The [`Chosen::chance`] of an emitter.
    #[must_use]
    pub fn chance(&self, to: &Receiver, emitter: usize) -> f32 {
        let (Some(&(way, place)), Some(mut node)) = (self.ways.get(emitter), self.nodes.first()) else {
            return 0.0;
        };
        let mut is_far = node.from(to).is_far;
        let (mut way, mut chance) = (way, 1.0);
        while node.count > 1 && !is_far {
            let (children, prospects, share) = self.branch(node, to);
            let second = way & 1 == 1;
            chance *= if second { 1.0 - share } else { share };
            way >>= 1;
            (node, is_far) = (children[usize::from(second)], prospects[usize::from(second)].is_far);
        }
        if node.count > 1 {
            let sum = |place: u32| self.sums[place as usize];
            let all = sum(node.first + node.count) - sum(node.first);
            chance *= ((sum(place + 1) - sum(place)) / all) as f32;
        }
        chance
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::sampler::{hash, unit_float};

    fn numbers(seed: u32) -> impl Iterator<Item = f32> {
        (0..).map(move |i| unit_float(hash(hash(i) ^ seed)))
    }

    /// Scattered over a cube, facing anywhere, of powers that differ by four decades.
    fn scattered(count: usize) -> Vec<Emitter> {
        let mut random = numbers(1);
        let mut next = || random.next().unwrap_or_default();
        let mut emitter = |_| {
            let middle = Vec3::new(next(), next(), next()) * 10.0;
            let normal = (Vec3::new(next(), next(), next()) - 0.5).normalize();
            let bounds = Aabb::around(&[middle - 0.01, middle + 0.01]);
            Emitter::flat(bounds, normal, next() < 0.3, 10f32.powf(4.0 * next() - 2.0))
        };
        (0..count).map(&mut emitter).collect()
    }

    const HERE: Receiver = Receiver { point: Vec3::new(3.0, 2.0, 5.0), normal: Vec3::Y };

    #[test]
    fn chances_sum_to_one_and_are_those_of_choosing() {
        for count in [1, 2, 3, 100, 3000] {
            let tree = LightTree::new(&scattered(count));
            let sum: f64 = (0..count).map(|i| f64::from(tree.chance(&HERE, i))).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{count}: {sum}");
            for random in numbers(2).take(1000) {
                let chosen = tree.sample(&HERE, random).unwrap();
                let chance = tree.chance(&HERE, chosen.emitter);
                assert!((chosen.chance / chance - 1.0).abs() < 1e-5, "{chosen:?} {chance}");
                assert!((0.0..1.0).contains(&chosen.rest), "{chosen:?}");
            }
        }
        assert_eq!(LightTree::new(&[]).sample(&HERE, 0.5), None);
    }

    /// What would be best is known: as much as each one brings. The tree is nearer to it than choosing by power. (All
    /// shine to both sides: where neighbours face anywhere, no cone can say which of them do not shine here.)
    #[test]
    fn the_choice_follows_what_they_bring() {
        let round = |e: Emitter| Emitter::all_round(e.bounds, e.intensity);
        let emitters: Vec<Emitter> = scattered(3000).into_iter().map(round).collect();
        let tree = LightTree::new(&emitters);
        let brought = |emitter: &Emitter| {
            let along = emitter.bounds.center() - HERE.point;
            let toward = along.normalize();
            let arrives = HERE.normal.dot(toward).max(0.0);
            f64::from(emitter.intensity * arrives / along.length_squared())
        };
        let total: f64 = emitters.iter().map(brought).sum();
        let power: f64 = emitters.iter().map(|e| f64::from(e.intensity)).sum();
        let second = |chance: &dyn Fn(usize) -> f64| {
            emitters.iter().enumerate().map(|(i, e)| brought(e).powi(2) / chance(i)).sum::<f64>()
                / total.powi(2)
        };
        let by_tree = second(&|i| f64::from(tree.chance(&HERE, i)));
        let by_power = second(&|i| f64::from(emitters[i].intensity) / power);
        assert!(1.7 * by_tree < by_power, "tree {by_tree}, power {by_power}");
    }

    #[test]
    fn what_cannot_be_told_apart_is_still_found() {
        let dot = Emitter::all_round(Aabb::around(&[Vec3::ONE]), 1.0);
        let tree = LightTree::new(&vec![dot; 5000]);
        let line: Vec<Emitter> =
            (0..100).map(|i| Emitter::all_round(Aabb::around(&[Vec3::X * 2f32.powi(-i)]), 1.0)).collect();
        let deep = LightTree::new(&line);
        for (tree, count) in [(tree, 5000), (deep, 100)] {
            let least = (0..count).map(|i| tree.chance(&HERE, i)).fold(1.0, f32::min);
            assert!(least > 1e-6, "{least}");
        }
        let off = LightTree::new(&[Emitter { intensity: 0.0, ..dot }, Emitter { intensity: 0.0, ..dot }]);
        assert_eq!(off.chance(&HERE, 0), 0.5);
    }
}
