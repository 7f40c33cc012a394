//! The loop of a packet through a hierarchy.

use super::Probe;
use super::packet::Packet;
use super::rows::each;
use super::simd::{Part, Simd};
use super::single::Waiting;
use super::wide::{Child, MAX_WAITING, WideBvh};
use std::ops::ControlFlow;

/// With no more rays than this left, each goes on alone.
const FEW: u32 = 4;

/// What a traversal does at leaves.
pub(super) trait Visitor<S: Simd> {
    /// Tests the `rays` (bits) of the packet with `count` entries from `first` on, shortening their
    /// `t_max`; returns those that need no more.
    fn many(&mut self, simd: S, packet: &mut Packet, first: usize, count: usize, rays: u64) -> u64;

    /// The same for the ray of one lane, made ready; answers with the ray's new `t_max`.
    fn one(
        &mut self,
        simd: S,
        packet: &mut Packet,
        probe: &Probe,
        lane: usize,
        first: usize,
        count: usize,
    ) -> ControlFlow<(), f32>;
}

/// A leaf that blocked a ray: it may well block those of the next packet too, which is asked first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Blocker {
    /// Address of its hierarchy, good within one batch.
    hierarchy: usize,
    first: usize,
    count: usize,
}

/// Children that a packet has yet to visit.
#[derive(Debug)]
pub(super) struct PacketWaiting {
    pub nears: [f32; MAX_WAITING],
    /// Node · 8 + number of the child.
    pub children: [u32; MAX_WAITING],
    /// The rays that entered the node.
    pub rays: [u64; MAX_WAITING],
    pub single: Waiting,
    /// The leaf that blocked a ray last.
    pub blocker: Option<Blocker>,
}

impl Default for PacketWaiting {
    fn default() -> Self {
        Self {
            nears: [0.0; MAX_WAITING],
            children: [0; MAX_WAITING],
            rays: [0; MAX_WAITING],
            single: Waiting::default(),
            blocker: None,
        }
    }
}

impl WideBvh {
    /// Takes the `rays` of the packet through all leaves below node `root` that any of them enters; returns those of which
    /// the visitor said that they need no more.
    #[inline(always)]
    pub(super) fn traverse_packet<S: Simd, const ANY: bool>(
        &self,
        simd: S,
        packet: &mut Packet,
        root: usize,
        rays: u64,
        waiting: &mut PacketWaiting,
        visitor: &mut impl Visitor<S>,
    ) -> u64 {
        if self.nodes.is_empty() {
            return 0;
        }
        let lanes = 64 - rays.leading_zeros() as usize;
        let mut alive = rays;
        let hierarchy = std::ptr::from_ref(self).addr();
        if ANY && let Some(last) = waiting.blocker.filter(|last| last.hierarchy == hierarchy) {
            let done = visitor.many(simd, packet, last.first, last.count, rays);
            alive &= !done;
            if alive == 0 {
                return rays;
            }
            if done == 0 {
                waiting.blocker = None;
            }
        }
        let mut t_bound = packet.t_bound(simd, lanes);
        let mut count = 0;
        let mut node = root;
        let mut entered = rays;
        loop {
            count += packet.enter(simd, &self.nodes[node], node, t_bound, entered, waiting, count);
            loop {
                if count == 0 {
                    return rays & !alive;
                }
                count -= 1;
                let rays = waiting.rays[count] & alive;
                if rays == 0 || waiting.nears[count] > t_bound {
                    continue;
                }
                let (parent, slot) =
                    (waiting.children[count] as usize / 8, waiting.children[count] as usize % 8);
                let parent = &self.nodes[parent];
                match Child::unpack(parent.children[slot]) {
                    Child::Node(child) => {
                        let rays = packet.entering(simd, parent, slot, rays, true);
                        if rays == 0 {
                            continue;
                        }
                        if rays.count_ones() <= FEW {
                            let waiting = &mut waiting.single;
                            let few = Few { hierarchy: self, packet, root: child, rays, waiting, visitor };
                            alive &= !simd.call(few);
                            continue;
                        }
                        (node, entered) = (child, rays);
                        break;
                    }
                    Child::Leaf { first, count: entries } => {
                        let rays = packet.entering(simd, parent, slot, rays, false);
                        if rays != 0 {
                            let done = visitor.many(simd, packet, first, entries, rays);
                            if ANY && done != 0 {
                                waiting.blocker = Some(Blocker { hierarchy, first, count: entries });
                            }
                            alive &= !done;
                            t_bound = packet.t_bound(simd, lanes);
                        }
                    }
                }
            }
        }
    }
}

/// A few rays of a packet, to be taken through the nodes below `root` one after the other.
struct Few<'a, V> {
    hierarchy: &'a WideBvh,
    packet: &'a mut Packet,
    root: usize,
    rays: u64,
    waiting: &'a mut Waiting,
    visitor: &'a mut V,
}

impl<S: Simd, V: Visitor<S>> Part<S> for Few<'_, V> {
    type Output = u64;

    #[inline(always)]
    fn run(self, simd: S) -> u64 {
        let Self { hierarchy, packet, root, rays, waiting, visitor } = self;
        let mut done = 0;
        for lane in each(rays) {
            let probe = packet.probe(lane);
            if hierarchy.traverse_one(simd, packet, &probe, lane, root, waiting, visitor).is_break() {
                done |= 1 << lane;
            }
        }
        done
    }
}
