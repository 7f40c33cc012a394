//! Many rays: sorted into packets, and what is left walks alone.

use super::filter::Filter;
use super::found::Found;
use super::packet::Packet;
use super::rows::{PACKET, Rays, each, lowest};
use super::simd::{Job, Simd};
use super::together::{PacketWaiting, Visitor};
use super::walk::Walk;
use super::wide::WideNode;
use super::{Aabb, Blas, Hit, Probe, Ray};
use std::cell::Cell;
use std::ops::ControlFlow;

/// Fewer rays of a class than this are not worth a packet.
const WORTH_A_PACKET: u32 = 6;

/// What rays can be traced through: one level or two.
pub(super) trait Target: Sync {
    /// Whether there are no instances.
    const ONE_LEVEL: bool;
    /// Where all begins.
    fn nodes(&self) -> &[WideNode];
    /// The triangles, if there is one level only.
    fn only(&self) -> Option<Inside<'_>>;
    /// A ray made ready for the top level.
    fn probe(&self, ray: &Ray) -> Probe;
    /// Around everything, and how much farther boxes reach than their borders.
    fn bounds(&self) -> (Aabb, f32);
    /// The instance of a top-level leaf, which of its nodes or leaves is entered (packed), and the ray made ready for it if that
    /// is another one.
    fn enter(&self, leaf: usize, ray: &Ray) -> (Inside<'_>, u32, Option<Probe>);
    /// Takes rays of a packet through everything; returns those that are done.
    fn traverse_packet<S: Simd, F: Filter, const ANY: bool>(
        &self,
        simd: S,
        scratch: &mut Scratch,
        rays: u64,
        filter: F,
    ) -> u64;
}

/// Whose nodes a ray is among.
#[derive(Clone, Copy)]
pub(super) struct Inside<'a> {
    pub blas: &'a Blas,
    pub instance: u32,
    /// Whether the ray is another one there.
    pub moved: bool,
}

/// Buffers of a batch, some 30 kB.
pub(super) struct Scratch {
    pub packet: Packet,
    pub found: Found,
    pub waiting: PacketWaiting,
    /// Which ray of the batch each lane is.
    pub numbers: [usize; PACKET],
    /// For rays in the space of an instance.
    pub inner: Option<Box<Scratch>>,
}

thread_local! {
    /// Kept from batch to batch: clearing it would cost as much as tracing some hundred rays.
    static SCRATCH: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

impl Scratch {
    pub fn new() -> Box<Self> {
        Box::new(Self {
            packet: Packet::blank(),
            found: Found::blank(),
            waiting: PacketWaiting::default(),
            numbers: [0; PACKET],
            inner: None,
        })
    }

    /// What was learned of the last batch's scene.
    fn forget(&mut self) {
        self.waiting.blocker = None;
        if let Some(inner) = &mut self.inner {
            inner.forget();
        }
    }
}

/// The triangles of one instance, asked for by a packet.
pub(super) struct Triangles<'a, F, const ANY: bool> {
    pub blas: &'a Blas,
    pub instance: u32,
    pub found: &'a mut Found,
    pub numbers: &'a [usize; PACKET],
    pub filter: F,
}

impl<S: Simd, F: Filter, const ANY: bool> Visitor<S> for Triangles<'_, F, ANY> {
    #[inline(always)]
    fn many(&mut self, simd: S, packet: &mut Packet, first: usize, count: usize, rays: u64) -> u64 {
        let (filter, numbers) = (self.filter, self.numbers);
        let all = F::ALL || !filter.asks(self.instance);
        let takes = |lane: usize, hit: &Hit| filter.takes(numbers[lane % PACKET], hit);
        let takes = (!all).then_some(takes);
        let leaves = &self.blas.leaves;
        let leaf = (first, count);
        leaves.test_many::<S, ANY>(simd, packet, leaf, self.instance, rays, self.found, takes)
    }

    #[inline(always)]
    fn one(
        &mut self,
        simd: S,
        packet: &mut Packet,
        probe: &Probe,
        lane: usize,
        first: usize,
        count: usize,
    ) -> ControlFlow<(), f32> {
        let t_max = packet.rays.t_max.0[lane % PACKET];
        let number = self.numbers[lane % PACKET];
        let all = F::ALL || !self.filter.asks(self.instance);
        self.blas.leaves.test_one::<S, ANY>(simd, probe, (first, count), self.instance, t_max, |hit| {
            self.found.offer(packet, lane, hit, |hit| all || self.filter.takes(number, hit))
        })
    }
}

/// Traces `count` rays and reports each one's hit.
pub(super) struct Batch<'a, T, F, G, R, const ANY: bool> {
    pub target: &'a T,
    pub count: usize,
    /// The ray of each number.
    pub ray: G,
    pub filter: F,
    pub report: R,
}

impl<T, F, G, R, const ANY: bool> Job for Batch<'_, T, F, G, R, ANY>
where
    T: Target,
    F: Filter,
    G: Fn(usize) -> Ray,
    R: FnMut(usize, Option<Hit>),
{
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { target, count, ray, filter, mut report } = self;
        if count < WORTH_A_PACKET as usize {
            let numbers = 0..count;
            simd.call(Walk::<_, _, _, _, _, ANY> { target, ray: &ray, numbers, filter, report: &mut report });
            return;
        }
        let mut alone: Vec<usize> = Vec::new();
        let (bounds, slack) = target.bounds();
        let mut scratch = SCRATCH.take().unwrap_or_else(Scratch::new);
        scratch.forget();
        let mut loaded = Rays::blank();
        for start in (0..count).step_by(PACKET) {
            let members = PACKET.min(count - start);
            loaded.load(members, |i| ray(start + i));
            for (class, lanes) in loaded.classes(simd, members) {
                let size = lanes.count_ones();
                if size < WORTH_A_PACKET {
                    alone.extend(each(lanes).map(|lane| start + lane));
                    continue;
                }
                let size = size as usize;
                if size == members {
                    scratch.packet.rays.clone_from(&loaded);
                } else {
                    scratch.packet.rays.gather(&loaded, lanes);
                }
                for (number, lane) in scratch.numbers.iter_mut().zip(each(lanes)) {
                    *number = start + lane;
                }
                scratch.packet.prepare(simd, class, size, &bounds, slack);
                scratch.found.rays = 0;
                let done = target.traverse_packet::<S, F, ANY>(simd, &mut scratch, lowest(size), filter);
                if ANY {
                    scratch.found.rays |= done;
                }
                for (lane, &number) in scratch.numbers[..size].iter().enumerate() {
                    report(number, scratch.found.hit(&scratch.packet, lane));
                }
            }
        }
        SCRATCH.set(Some(scratch));
        let report = &mut report;
        simd.call(Walk::<_, _, _, _, _, ANY> { target, ray: &ray, numbers: alone, filter, report });
    }
}
