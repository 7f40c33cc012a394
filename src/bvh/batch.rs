//! Many rays: sorted into packets, and what is left walks alone.

use super::leaves::Filter;
use super::packet::{CLASSES, Class, Found, PACKET, Packet, PacketWaiting, Visitor, lowest};
use super::simd::{Isa, Job, Simd};
use super::walk::walk;
use super::wide::WideNode;
use super::{Aabb, Blas, Hit, Probe, Ray};
use std::ops::ControlFlow;

/// Fewer rays of a class than this are not worth a packet.
const WORTH_A_PACKET: u32 = 8;

/// What rays can be traced through: one level or two.
pub(super) trait Target: Sync {
    /// Whether there are no instances.
    const ONE_LEVEL: bool;
    /// Where all begins.
    fn nodes(&self) -> &[WideNode];
    /// The triangles, if there is one level only.
    fn only(&self) -> Option<(&Blas, u32)>;
    /// A ray made ready for the top level.
    fn probe(&self, ray: &Ray) -> Probe;
    /// Around everything, and how much farther boxes reach than their borders.
    fn bounds(&self) -> (Aabb, f32);
    /// The instance of a top-level leaf, and the ray made ready for it if that is another one.
    fn enter(&self, entry: usize, ray: &Ray) -> (&Blas, u32, Option<Probe>);
    /// Takes rays of a packet through everything; returns those that are done.
    fn traverse_packet<S: Simd, F: Filter, const ANY: bool>(
        &self,
        simd: S,
        scratch: &mut Scratch,
        rays: u64,
        filter: F,
    ) -> u64;
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
        let takes = |lane: usize, hit: &Hit| filter.takes(numbers[lane % PACKET], hit);
        let leaves = &self.blas.leaves;
        let leaf = (first, count);
        leaves.test_many::<S, F, ANY>(simd, packet, leaf, self.instance, rays, self.found, takes)
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
        let t_max = packet.t_max.0[lane % PACKET];
        let number = self.numbers[lane % PACKET];
        self.blas.leaves.test_one::<S, ANY>(simd, probe, (first, count), self.instance, t_max, |hit| {
            self.found.offer(packet, lane, hit, |hit| self.filter.takes(number, hit))
        })
    }
}

/// Up to 64 rays by class.
pub(super) struct Classes {
    members: [u64; CLASSES],
    present: u32,
}

impl Classes {
    #[inline(always)]
    pub fn of(rays: &[Ray]) -> Self {
        let mut classes = Self { members: [0; CLASSES], present: 0 };
        for (i, ray) in rays.iter().enumerate().take(PACKET) {
            let class = Class::of(ray.direction);
            classes.members[class.index() % CLASSES] |= 1 << i;
            classes.present |= 1 << class.index();
        }
        classes
    }
}

impl Iterator for Classes {
    type Item = (Class, u64);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        let class = (self.present != 0).then(|| Class::from_index(self.present.trailing_zeros()))?;
        self.present &= self.present - 1;
        Some((class, self.members[class.index() % CLASSES]))
    }
}

/// The numbers of the set bits.
#[inline(always)]
pub(super) fn each(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
        bits &= bits - 1;
        Some(lane)
    })
}

/// Traces all of `rays` and reports each one's hit.
pub(super) struct Batch<'a, T, F, R, const ANY: bool> {
    pub target: &'a T,
    pub rays: &'a [Ray],
    pub filter: F,
    pub report: R,
}

impl<T: Target, F: Filter, R: FnMut(usize, Option<Hit>), const ANY: bool> Batch<'_, T, F, R, ANY> {
    /// With the given instructions.
    pub fn run(self, isa: Isa) {
        isa.run(self);
    }
}

impl<T: Target, F: Filter, R: FnMut(usize, Option<Hit>), const ANY: bool> Job for Batch<'_, T, F, R, ANY> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { target, rays, filter, mut report } = self;
        let mut alone: Vec<usize> = Vec::new();
        if rays.len() < WORTH_A_PACKET as usize {
            walk::<S, T, F, ANY>(simd, target, rays, 0..rays.len(), filter, report);
            return;
        }
        let (bounds, slack) = target.bounds();
        let mut scratch = Scratch::new();
        for (chunk, members) in rays.chunks(PACKET).enumerate() {
            for (class, lanes) in Classes::of(members) {
                let mut count = 0;
                for lane in each(lanes) {
                    scratch.numbers[count % PACKET] = chunk * PACKET + lane;
                    count += 1;
                }
                let numbers = &scratch.numbers;
                if lanes.count_ones() < WORTH_A_PACKET {
                    alone.extend_from_slice(&numbers[..count]);
                    continue;
                }
                scratch.packet.prepare(simd, class, count, |i| rays[numbers[i % PACKET]], &bounds, slack);
                scratch.found.rays = 0;
                let done = target.traverse_packet::<S, F, ANY>(simd, &mut scratch, lowest(count), filter);
                if ANY {
                    scratch.found.rays |= done;
                }
                for (lane, &number) in scratch.numbers[..count].iter().enumerate() {
                    report(number, scratch.found.hit(&scratch.packet, lane));
                }
            }
        }
        walk::<S, T, F, ANY>(simd, target, rays, alone, filter, report);
    }
}
