//! Many rays: sorted into packets, and what is left one by one.

use super::leaves::{All, Filter};
use super::packet::{CLASSES, Class, Found, PACKET, Packet, PacketWaiting, Visitor, lowest};
use super::simd::Simd;
use super::{Blas, Hit, Probe, Ray};
use std::ops::ControlFlow;

/// Fewer rays of a class than this are not worth a packet.
const WORTH_A_PACKET: usize = 4;

/// Buffers of a batch, some 20 kB.
pub(super) struct Scratch {
    packet: Packet,
    found: Found,
    waiting: PacketWaiting,
}

impl Scratch {
    pub fn new() -> Box<Self> {
        Box::new(Self { packet: Packet::blank(), found: Found::blank(), waiting: PacketWaiting::default() })
    }
}

/// The triangles of one instance, asked for by a packet.
struct Triangles<'a, F, const ANY: bool> {
    blas: &'a Blas,
    instance: u32,
    found: &'a mut Found,
    filter: F,
}

impl<S: Simd, F: Filter, const ANY: bool> Visitor<S> for Triangles<'_, F, ANY> {
    #[inline(always)]
    fn many(&mut self, simd: S, packet: &mut Packet, first: usize, count: usize, rays: u64) -> u64 {
        let leaf = (first, count);
        let leaves = &self.blas.leaves;
        leaves.test_many::<S, F, ANY>(simd, packet, leaf, self.instance, rays, self.found, self.filter)
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
        let leaf = (first, count);
        let t_max = packet.t_max.0[lane % PACKET];
        self.blas.leaves.test_one::<S, ANY>(simd, probe, leaf, self.instance, t_max, |hit| {
            self.found.offer(packet, lane, hit, self.filter)
        })
    }
}

/// Traces `rays` and reports each one's hit.
#[inline(always)]
pub(super) fn trace_batch<S: Simd, const ANY: bool>(
    simd: S,
    blas: &Blas,
    rays: &[Ray],
    mut report: impl FnMut(usize, Option<Hit>),
) {
    let bounds = blas.bounds();
    let mut scratch = Scratch::new();
    for (chunk, rays) in rays.chunks(PACKET).enumerate() {
        let mut members = [0u64; CLASSES];
        let mut classes = 0u32;
        for (i, ray) in rays.iter().enumerate() {
            let class = Class::of(ray.direction);
            members[class.index()] |= 1 << i;
            classes |= 1 << class.index();
        }
        while classes != 0 {
            let class = Class::from_index(classes.trailing_zeros());
            classes &= classes - 1;
            let mut numbers = [0u8; PACKET];
            let mut count = 0;
            let mut rest = members[class.index()];
            while rest != 0 {
                numbers[count % PACKET] = rest.trailing_zeros() as u8;
                count += 1;
                rest &= rest - 1;
            }
            let Scratch { packet, found, waiting } = &mut *scratch;
            if count >= WORTH_A_PACKET {
                packet.prepare(simd, class, count, |i| rays[numbers[i % PACKET] as usize], &bounds, 1.0);
            }
            if count < WORTH_A_PACKET || packet.extreme {
                for &number in &numbers[..count] {
                    let i = usize::from(number);
                    report(chunk * PACKET + i, blas.trace_one::<S, ANY>(simd, &rays[i], &mut waiting.single));
                }
                continue;
            }
            found.rays = 0;
            let mut visitor = Triangles::<All, ANY> { blas, instance: 0, found, filter: All };
            let done = blas.wide.traverse_packet(simd, packet, lowest(count), waiting, &mut visitor);
            if ANY {
                found.rays |= done;
            }
            for (lane, &number) in numbers[..count].iter().enumerate() {
                report(chunk * PACKET + usize::from(number), found.hit(packet, lane));
            }
        }
    }
}
