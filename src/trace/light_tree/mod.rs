//! Which of many emitters to sample at a point: a hierarchy over them, descended by how much each part may bring.
//!
//! Every node has up to sixteen children; of each it knows a ball around its emitters, their intensity and to which sides they
//! send it on average; from these follows what they bring to a point, nearly, computed of all children at once. The way
//! down is chosen in proportion, so that the cost grows with the logarithm of their number.
//!
//! Reference: A. Conty Estevez, C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", Proc. ACM
//! Computer Graphics and Interactive Techniques 1(2), 2018. Theirs has two children to a node, and bounds by cones of normals.

mod build;
mod node;

use super::emitter::Receiver;
use crate::bvh::Isa;
use crate::bvh::simd::{Job, Simd};
use build::DEEPEST;
use node::{Child, Node, Seen};

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
    homes: Vec<Home>,
    /// Emitters as leaves have them, from first to last.
    order: Vec<u32>,
    /// Sums of the intensities of those before each place, and of all.
    sums: Vec<f64>,
}

/// Where an emitter is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Home {
    /// The node, and which of its children it is.
    node: u32,
    child: u32,
    /// In the order of the tree.
    place: u32,
}

impl LightTree {
    /// Whether there is nothing to choose from.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Chooses one by a number in [0, 1); `None` if there is none.
    #[must_use]
    pub fn sample(&self, to: &Receiver, random: f32) -> Option<Chosen> {
        let mut chosen = [None];
        self.sample_all(&[(*to, random)], &mut chosen);
        chosen[0]
    }

    /// [`LightTree::sample`] for each of these. Faster where some that follow each other are for one point.
    pub fn sample_all(&self, wanted: &[(Receiver, f32)], chosen: &mut [Option<Chosen>]) {
        Isa::detect().run(Sample { tree: self, wanted, chosen });
    }

    /// The [`Chosen::chance`] of an emitter.
    #[must_use]
    pub fn chance(&self, to: &Receiver, emitter: usize) -> f32 {
        Isa::detect().run(Chance { tree: self, to, emitter })
    }

    /// Sum of the intensities of those in `count` places.
    #[inline(always)]
    fn intensity(&self, first: usize, count: usize) -> f64 {
        self.sums[first + count] - self.sums[first]
    }
}

struct Sample<'a> {
    tree: &'a LightTree,
    wanted: &'a [(Receiver, f32)],
    chosen: &'a mut [Option<Chosen>],
}

impl Job for Sample<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { tree, wanted, chosen } = self;
        let (Some(root), Some((first, _))) = (tree.nodes.first(), wanted.first()) else { return };
        let (mut here, mut seen) = (first, root.seen(simd, first));
        for ((to, random), chosen) in wanted.iter().zip(chosen) {
            if to != here {
                (here, seen) = (to, root.seen(simd, to));
            }
            *chosen = tree.descend(simd, &seen, to, *random);
        }
    }
}

impl LightTree {
    /// Chooses one, where the root is `seen` so.
    #[inline(always)]
    fn descend<S: Simd>(&self, simd: S, seen: &Seen, to: &Receiver, random: f32) -> Option<Chosen> {
        let mut node = self.nodes.first()?;
        let (mut child, mut chance, left) = node.choose(simd, seen, random);
        let (mut rest, mut is_end) = (fresh(left), node.is_end(child, seen));
        while !is_end {
            node = &self.nodes[node.children[child].node as usize];
            let seen = node.seen(simd, to);
            let (next, share, left) = node.choose(simd, &seen, rest);
            (child, chance, rest) = (next, chance * share, fresh(left));
            is_end = node.is_end(child, &seen);
        }
        let Child { first, count, .. } = node.children[child];
        let (mut place, count) = (first as usize, count as usize);
        if count > 1 {
            let all = self.intensity(place, count);
            let wanted = self.sums[place] + f64::from(rest) * all;
            place += self.sums[place + 1..place + count].partition_point(|&sum| sum <= wanted);
            let own = self.intensity(place, 1);
            chance *= (own / all) as f32;
            rest = fresh(((wanted - self.sums[place]) / own) as f32);
        }
        (chance > 0.0).then(|| Chosen { emitter: self.order[place] as usize, chance, rest })
    }
}

struct Chance<'a> {
    tree: &'a LightTree,
    to: &'a Receiver,
    emitter: usize,
}

impl Job for Chance<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> f32 {
        let Self { tree, to, emitter } = self;
        let Some(&Home { mut node, mut child, place }) = tree.homes.get(emitter) else { return 0.0 };
        // The way up from there is the way down to it.
        let (mut way, mut depth) = ([(0, 0); DEEPEST], 0);
        while node > 0 {
            way[depth] = (node, child);
            depth += 1;
            (node, child) = tree.nodes[node as usize].parent;
        }
        let mut chance = 1.0;
        loop {
            let (here, which) = (&tree.nodes[node as usize], child as usize);
            let seen = here.seen(simd, to);
            chance *= here.chance(&seen, which);
            if here.is_end(which, &seen) {
                let Child { first, count, .. } = here.children[which];
                if count > 1 {
                    let all = tree.intensity(first as usize, count as usize);
                    chance *= (tree.intensity(place as usize, 1) / all) as f32;
                }
                return chance;
            }
            depth -= 1;
            (node, child) = way[depth];
        }
    }
}

/// A random number again, whatever was rounded.
#[inline(always)]
fn fresh(left: f32) -> f32 {
    left.clamp(0.0, 1.0 - f32::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::Aabb;
    use crate::trace::emitter::Emitter;
    use crate::trace::sampler::{hash, unit_float};
    use glam::Vec3;

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

    /// What would be best is known: as much as each one brings; the second moment of its samples is 1. That of the tree is nearer than
    /// that of choosing by power, also in the midst of them.
    #[test]
    fn the_choice_follows_what_they_bring() {
        for all_round in [false, true] {
            let round = |e: Emitter| Emitter::all_round(e.bounds, e.intensity);
            let emitters = scattered(3000).into_iter().map(|e| if all_round { round(e) } else { e });
            let emitters: Vec<Emitter> = emitters.collect();
            let tree = LightTree::new(&emitters);
            let brought = |emitter: &Emitter, to: &Receiver| {
                let along = emitter.bounds.center() - to.point;
                let toward = along.normalize();
                let cosine = -emitter.axis.dot(toward);
                let sent = match emitter.two_sided {
                    _ if all_round => 1.0,
                    true => cosine.abs(),
                    false => cosine.max(0.0),
                };
                f64::from(emitter.intensity * sent * to.normal.dot(toward).max(0.0) / along.length_squared())
            };
            let power: f64 = emitters.iter().map(|e| f64::from(e.intensity)).sum();
            let (mut random, points) = (numbers(4), 40);
            let mut next = || random.next().unwrap_or_default();
            let mut sums = [0.0; 2];
            for _ in 0..points {
                let mut vector = || Vec3::new(next(), next(), next());
                let to = Receiver { point: vector() * 10.0, normal: (vector() - 0.5).normalize() };
                let total: f64 = emitters.iter().map(|e| brought(e, &to)).sum();
                let second = |chance: &dyn Fn(usize) -> f64| {
                    let squares =
                        emitters.iter().enumerate().map(|(i, e)| brought(e, &to).powi(2) / chance(i));
                    squares.sum::<f64>() / (total * total)
                };
                sums[0] += second(&|i| f64::from(tree.chance(&to, i))) / f64::from(points);
                sums[1] += second(&|i| f64::from(emitters[i].intensity) / power) / f64::from(points);
            }
            let [by_tree, by_power] = sums;
            assert!(by_tree < 3.0 && 4.0 * by_tree < by_power, "{all_round}: {by_tree}, power {by_power}");
        }
    }

    /// Where nothing can be computed, one is chosen all the same.
    #[test]
    fn what_is_infinitely_far_or_strong_ends() {
        let at = |place: f32, intensity| Emitter::all_round(Aabb::around(&[Vec3::splat(place)]), intensity);
        for odd in [at(f32::INFINITY, 1.0), at(1e30, 1.0), at(1.0, f32::INFINITY), at(f32::NAN, 1.0)] {
            let mut emitters = vec![at(0.5, 1.0); 40];
            emitters[0] = odd;
            let tree = LightTree::new(&emitters);
            for random in numbers(5).take(100) {
                let chosen = tree.sample(&HERE, random);
                assert!(
                    chosen.is_none_or(|chosen| chosen.emitter < 40 && chosen.chance <= 1.0),
                    "{chosen:?}"
                );
            }
            assert!((0..40).all(|i| !tree.chance(&HERE, i).is_nan()), "{odd:?}");
        }
    }

    /// Whatever instructions there are, and whether the root has been asked before.
    #[test]
    fn all_kernels_choose_the_same() {
        let tree = LightTree::new(&scattered(1000));
        let to = |i: usize| Receiver { point: HERE.point + Vec3::X * (i / 4) as f32, ..HERE };
        let wanted: Vec<(Receiver, f32)> = numbers(3).take(64).enumerate().map(|(i, u)| (to(i), u)).collect();
        let each: Vec<_> = wanted.iter().map(|(to, random)| tree.sample(to, *random)).collect();
        for isa in Isa::available() {
            let mut chosen = vec![None; wanted.len()];
            isa.run(Sample { tree: &tree, wanted: &wanted, chosen: &mut chosen });
            assert_eq!(chosen, each, "{}", isa.name());
        }
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
        let off = LightTree::new(&[dot.times(0.0), dot.times(0.0)]);
        assert_eq!(off.chance(&HERE, 0), 0.5);
    }
}
