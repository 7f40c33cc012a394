//! The loop of one ray through a hierarchy.

use super::packet::Packet;
use super::probe::Probe;
use super::rows::PACKET;
use super::simd::{Lanes, Octet, Simd, three};
use super::together::Visitor;
use super::wide::{Child, MAX_WAITING, WIDTH, WideBvh, WideNode};
use std::ops::ControlFlow;

/// Those of an instance on top of those of the world.
const BOTH_LEVELS: usize = 2 * MAX_WAITING;

/// Children that a ray has yet to visit, and where it enters them. Kept between rays: clearing it would
/// cost as much as some rays.
#[derive(Debug)]
pub struct Waiting {
    nears: [f32; BOTH_LEVELS],
    children: [u32; BOTH_LEVELS],
}

impl Default for Waiting {
    fn default() -> Self {
        Self { nears: [0.0; BOTH_LEVELS], children: [0; BOTH_LEVELS] }
    }
}

impl Waiting {
    /// Where the ray enters a waiting child, and what it is.
    #[inline(always)]
    pub fn get(&self, i: usize) -> (f32, u32) {
        (self.nears[i], self.children[i])
    }

    /// Has a child wait that is entered in any case.
    #[inline(always)]
    pub fn put(&mut self, i: usize, child: u32) {
        (self.nears[i], self.children[i]) = (0.0, child);
    }
}

impl WideBvh {
    /// Takes one ray of a packet, made ready as `probe`, roughly near before far to each leaf below node
    /// `root` whose box it enters at or before its `t_max`.
    ///
    /// Not with a closure for what to do there: that would be compiled apart, for the oldest machine.
    #[inline(always)]
    pub(super) fn traverse_one<S: Simd>(
        &self,
        simd: S,
        packet: &mut Packet,
        probe: &Probe,
        lane: usize,
        root: usize,
        waiting: &mut Waiting,
        visitor: &mut impl Visitor<S>,
    ) -> ControlFlow<()> {
        let boxes = Boxes::<S>::new(simd, probe);
        let Some(mut node) = self.nodes.get(root) else { return ControlFlow::Continue(()) };
        let mut t_max = packet.rays.t_max.0[lane % PACKET];
        let mut count = 0;
        loop {
            count += boxes.enter(node, t_max, waiting, count);
            loop {
                if count == 0 {
                    return ControlFlow::Continue(());
                }
                count -= 1;
                // Equal distances stay in: of coincident faces the lower index wins, wherever it is.
                if waiting.nears[count] <= t_max {
                    match Child::unpack(waiting.children[count]) {
                        Child::Node(index) => {
                            node = &self.nodes[index];
                            break;
                        }
                        Child::Leaf { first, count } => {
                            t_max = visitor.one(simd, packet, probe, lane, first, count)?;
                        }
                    }
                }
            }
        }
    }
}

/// A ray made ready for eight boxes at once.
#[derive(Clone, Copy)]
pub(super) struct Boxes<S: Simd> {
    simd: S,
    near_origin: [S::F8; 3],
    far_origin: [S::F8; 3],
    inverse: [S::F8; 3],
    /// For each axis whether the ray comes in by the greater side, 1, or the less, 0.
    near_side: [usize; 3],
    octant: usize,
}

impl<S: Simd> Boxes<S> {
    #[inline(always)]
    pub fn new(simd: S, probe: &Probe) -> Self {
        let octant = probe.octant();
        Self {
            simd,
            near_origin: three!(|axis| S::F8::splat(simd, probe.near_origin[axis])),
            far_origin: three!(|axis| S::F8::splat(simd, probe.far_origin[axis])),
            inverse: three!(|axis| S::F8::splat(simd, probe.inverse[axis])),
            near_side: three!(|axis| octant >> axis & 1),
            octant,
        }
    }

    /// Puts the children that the ray enters on top of the `count` waiting ones; returns how many.
    #[inline(always)]
    pub fn enter(&self, node: &WideNode, t_max: f32, waiting: &mut Waiting, count: usize) -> usize {
        let entry = self.near(node, 0).max(self.near(node, 1)).max(self.near(node, 2));
        let exit = self.far(node, 0).min(self.far(node, 1)).min(self.far(node, 2));
        let entry = entry.max(S::F8::splat(self.simd, 0.0));
        let exit = exit.min(S::F8::splat(self.simd, t_max));
        // One check instead of one for each array.
        assert!(count <= BOTH_LEVELS - WIDTH);
        let nears = waiting.nears[count..].first_chunk_mut();
        let children = waiting.children[count..].first_chunk_mut();
        let (Some(nears), Some(to)) = (nears, children) else { return 0 };
        S::F8::push_entered(entry, exit, node.orders[self.octant & 7], &node.children, nears, to)
    }

    /// Where the ray comes into each child's extent along an axis.
    #[inline(always)]
    fn near(&self, node: &WideNode, axis: usize) -> S::F8 {
        let side = S::F8::load(self.simd, &node.bounds[axis][self.near_side[axis] & 1]);
        (side - self.near_origin[axis]) * self.inverse[axis]
    }

    /// Where it leaves it.
    #[inline(always)]
    fn far(&self, node: &WideNode, axis: usize) -> S::F8 {
        let side = S::F8::load(self.simd, &node.bounds[axis][self.near_side[axis] & 1 ^ 1]);
        (side - self.far_origin[axis]) * self.inverse[axis]
    }
}
