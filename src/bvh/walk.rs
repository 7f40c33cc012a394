//! Rays that go different ways: several at once, one step each in turn.
//!
//! A step of one ray waits for memory and for a long chain of dependent operations; the steps of other rays
//! fill that time. What a ray needs next is prefetched while the others have their turns.

use super::batch::Target;
use super::leaves::Filter;
use super::simd::{Simd, prefetch};
use super::single::{Boxes, Waiting};
use super::wide::{Child, WideNode};
use super::{Blas, Hit, Probe, Ray};
use std::ops::ControlFlow;

/// Rays under way at a time: two wait for memory still, with four the caches begin to overflow.
const WALKERS: usize = 3;

/// One ray under way.
struct Walker<'a> {
    number: usize,
    ray: Ray,
    /// In the space of the nodes that it is among.
    probe: Probe,
    world: Probe,
    t_max: f32,
    best: Option<Hit>,
    nodes: &'a [WideNode],
    /// The instance that it is in, and how many children wait outside.
    inside: Option<(&'a Blas, u32)>,
    outside: usize,
    count: usize,
    waiting: Waiting,
}

/// Traces `ray(number)` for each of `numbers` and reports the hit.
#[inline(always)]
pub(super) fn walk<S: Simd, T: Target, F: Filter, const ANY: bool>(
    simd: S,
    target: &T,
    ray: &impl Fn(usize) -> Ray,
    numbers: impl IntoIterator<Item = usize>,
    filter: F,
    mut report: impl FnMut(usize, Option<Hit>),
) {
    let mut numbers = numbers.into_iter();
    let mut walkers: Vec<Walker> = Vec::with_capacity(WALKERS);
    for number in numbers.by_ref().take(WALKERS) {
        let mut walker = Walker::new(target, number, ray(number));
        walker.start(simd, target);
        walkers.push(walker);
    }
    while !walkers.is_empty() {
        let mut i = 0;
        while i < walkers.len() {
            let walker = &mut walkers[i];
            if walker.step::<S, T, F, ANY>(simd, target, filter) {
                i += 1;
                continue;
            }
            report(walker.number, walker.best);
            if let Some(number) = numbers.next() {
                walker.number = number;
                walker.ray = ray(number);
                walker.world = target.probe(&walker.ray);
                walker.start(simd, target);
                i += 1;
            } else {
                walkers.swap_remove(i);
            }
        }
    }
}

impl<'a> Walker<'a> {
    #[inline(always)]
    fn new<T: Target>(target: &'a T, number: usize, ray: Ray) -> Self {
        let world = target.probe(&ray);
        Self {
            number,
            ray,
            probe: world,
            world,
            t_max: ray.t_max,
            best: None,
            nodes: target.nodes(),
            inside: None,
            outside: 0,
            count: 0,
            waiting: Waiting::default(),
        }
    }

    #[inline(always)]
    fn start<S: Simd, T: Target>(&mut self, simd: S, target: &'a T) {
        self.t_max = self.ray.t_max;
        self.best = None;
        self.probe = self.world;
        self.nodes = target.nodes();
        self.inside = target.only();
        self.outside = 0;
        self.count = 0;
        self.enter_root(simd);
    }

    #[inline(always)]
    fn enter_root<S: Simd>(&mut self, simd: S) {
        if let Some(root) = self.nodes.first() {
            self.count += Boxes::<S>::new(simd, &self.probe).enter(root, self.t_max, &mut self.waiting, self.count);
        }
    }

    /// Visits the next child; false if there is none, or if no more is wanted.
    #[inline(always)]
    fn step<S: Simd, T: Target, F: Filter, const ANY: bool>(
        &mut self,
        simd: S,
        target: &'a T,
        filter: F,
    ) -> bool {
        loop {
            if self.count == self.outside {
                if self.count == 0 && (T::ONE_LEVEL || self.inside.is_none()) {
                    return false;
                }
                if !T::ONE_LEVEL {
                    self.probe = self.world;
                    self.nodes = target.nodes();
                    self.inside = None;
                    self.outside = 0;
                    continue;
                }
            }
            self.count -= 1;
            let (near, child) = self.waiting.get(self.count);
            if near > self.t_max {
                continue;
            }
            match (Child::unpack(child), self.inside) {
                (Child::Node(index), _) => {
                    let boxes = Boxes::<S>::new(simd, &self.probe);
                    self.count += boxes.enter(&self.nodes[index], self.t_max, &mut self.waiting, self.count);
                }
                (Child::Leaf { first, count }, Some((blas, instance))) => {
                    let (best, number) = (&mut self.best, self.number);
                    let leaf = (first, count);
                    let end = blas.leaves.test_one::<S, ANY>(simd, &self.probe, leaf, instance, self.t_max, |hit| {
                        let better = best.is_none_or(|known| hit.beats(&known)) && filter.takes(number, &hit);
                        if better {
                            *best = Some(hit);
                        }
                        better
                    });
                    match end {
                        ControlFlow::Continue(t_max) => self.t_max = t_max,
                        ControlFlow::Break(()) => return false,
                    }
                }
                (Child::Leaf { first, count }, None) => {
                    if count > 1 {
                        self.waiting.set(self.count, near, Child::Leaf { first: first + 1, count: count - 1 });
                        self.count += 1;
                    }
                    let (blas, instance, local) = target.enter(first, &self.ray);
                    self.probe = local.unwrap_or(self.world);
                    self.nodes = &blas.wide.nodes;
                    self.inside = Some((blas, instance));
                    self.outside = self.count;
                    self.enter_root(simd);
                }
            }
            self.prefetch_next();
            return true;
        }
    }

    #[inline(always)]
    fn prefetch_next(&self) {
        if self.count > 0 {
            match (Child::unpack(self.waiting.get(self.count - 1).1), self.inside) {
                (Child::Leaf { first, .. }, Some((blas, _))) => blas.leaves.prefetch(first),
                (Child::Node(index), _) => prefetch(self.nodes, index),
                (Child::Leaf { .. }, None) => {}
            }
        }
    }
}
