//! Rays that go different ways: several at once, one step each in turn.
//!
//! A step of one ray waits for memory and for a long chain of dependent operations; the steps of other rays
//! fill that time.

use super::batch::{Inside, Target};
use super::filter::Filter;
use super::simd::{Part, Simd};
use super::single::{Boxes, Waiting};
use super::wide::Child;
use super::{Hit, Probe, Ray};
use std::ops::ControlFlow;

/// Rays under way at a time. Measured on bounces: 1 is 10 % slower, 3 are 5 %.
const WALKERS: usize = 2;

/// One ray under way.
struct Walker<'a, S: Simd> {
    number: usize,
    count: usize,
    t_max: f32,
    /// In the space of the nodes that it is among.
    boxes: Boxes<S>,
    probe: Probe,
    best: Option<Hit>,
    /// The instance that it is in, and how many children wait outside; not needed for one level.
    inside: Option<Inside<'a>>,
    outside: usize,
    ray: Ray,
    world: Probe,
    waiting: Waiting,
}

/// Traces `ray(number)` for each of `numbers` and reports the hit.
pub(super) struct Walk<'a, T, F, G, N, R, const ANY: bool> {
    pub target: &'a T,
    pub ray: &'a G,
    pub numbers: N,
    pub filter: F,
    pub report: &'a mut R,
}

impl<S, T, F, G, N, R, const ANY: bool> Part<S> for Walk<'_, T, F, G, N, R, ANY>
where
    S: Simd,
    T: Target,
    F: Filter,
    G: Fn(usize) -> Ray,
    N: IntoIterator<Item = usize>,
    R: FnMut(usize, Option<Hit>),
{
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { target, ray, numbers, filter, report } = self;
        let mut numbers = numbers.into_iter();
        let mut walkers: Vec<Walker<S>> = Vec::with_capacity(WALKERS);
        for number in numbers.by_ref().take(WALKERS) {
            walkers.push(Walker::new(simd, target, number, ray(number)));
        }
        while !walkers.is_empty() {
            let mut i = 0;
            while i < walkers.len() {
                let walker = &mut walkers[i];
                if walker.step::<T, F, ANY>(simd, target, filter) {
                    i += 1;
                    continue;
                }
                report(walker.number, walker.best);
                if let Some(number) = numbers.next() {
                    walker.number = number;
                    walker.start(simd, target, ray(number));
                    i += 1;
                } else {
                    walkers.swap_remove(i);
                }
            }
        }
    }
}

impl<'a, S: Simd> Walker<'a, S> {
    #[inline(always)]
    fn new<T: Target>(simd: S, target: &'a T, number: usize, ray: Ray) -> Self {
        let probe = target.probe(&ray);
        let mut walker = Self {
            number,
            count: 0,
            t_max: ray.t_max,
            boxes: Boxes::new(simd, &probe),
            probe,
            best: None,
            inside: None,
            outside: 0,
            ray,
            world: probe,
            waiting: Waiting::default(),
        };
        walker.start(simd, target, ray);
        walker
    }

    #[inline(always)]
    fn start<T: Target>(&mut self, simd: S, target: &'a T, ray: Ray) {
        self.t_max = ray.t_max;
        self.best = None;
        self.probe = target.probe(&ray);
        self.count = 0;
        if !T::ONE_LEVEL {
            (self.inside, self.outside) = (None, 0);
            (self.ray, self.world) = (ray, self.probe);
        }
        self.boxes = Boxes::new(simd, &self.probe);
        if let Some(root) = target.nodes().first() {
            self.count += self.boxes.enter(root, self.t_max, &mut self.waiting, self.count);
        }
    }

    /// Visits the next child; false if there is none, or if no more is wanted.
    #[inline(always)]
    fn step<T: Target, F: Filter, const ANY: bool>(&mut self, simd: S, target: &'a T, filter: F) -> bool {
        loop {
            if !T::ONE_LEVEL
                && self.count == self.outside
                && let Some(inside) = self.inside
            {
                if inside.moved {
                    self.probe = self.world;
                    self.boxes = Boxes::new(simd, &self.probe);
                }
                (self.inside, self.outside) = (None, 0);
            }
            if self.count == 0 {
                return false;
            }
            self.count -= 1;
            let (near, child) = self.waiting.get(self.count);
            if near <= self.t_max {
                return self.visit::<T, F, ANY>(simd, target, filter, Child::unpack(child));
            }
        }
    }

    #[inline(always)]
    fn visit<T: Target, F: Filter, const ANY: bool>(
        &mut self,
        simd: S,
        target: &'a T,
        filter: F,
        child: Child,
    ) -> bool {
        let inside = if T::ONE_LEVEL { target.only() } else { self.inside };
        let nodes = inside.map_or(target.nodes(), |inside| &inside.blas.wide.nodes);
        match (child, inside) {
            (Child::Node(index), _) => {
                self.count += self.boxes.enter(&nodes[index], self.t_max, &mut self.waiting, self.count);
            }
            (Child::Leaf { first, count }, Some(Inside { blas, instance, .. })) => {
                let (best, number) = (&mut self.best, self.number);
                let leaf = (first, count);
                let all = F::ALL || !filter.asks(instance);
                let end =
                    blas.leaves.test_one::<S, ANY>(simd, &self.probe, leaf, instance, self.t_max, |hit| {
                        let better =
                            best.is_none_or(|known| hit.beats(&known)) && (all || filter.takes(number, &hit));
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
            (Child::Leaf { first, .. }, None) => {
                let (inside, child, local) = target.enter(first, &self.ray);
                if let Some(local) = local {
                    self.probe = local;
                    self.boxes = Boxes::new(simd, &self.probe);
                }
                (self.inside, self.outside) = (Some(inside), self.count);
                if let Child::Node(root) = Child::unpack(child) {
                    let root = &inside.blas.wide.nodes[root];
                    self.count += self.boxes.enter(root, self.t_max, &mut self.waiting, self.count);
                } else {
                    self.waiting.put(self.count, child);
                    self.count += 1;
                }
            }
        }
        true
    }
}
