//! The loop of one ray through a hierarchy.

use super::probe::Probe;
use super::simd::{Lanes, Octet, Simd, three};
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
    /// Lets a child wait.
    #[inline(always)]
    pub fn set(&mut self, i: usize, near: f32, child: Child) {
        self.nears[i] = near;
        self.children[i] = child.pack();
    }

    /// Where the ray enters a waiting child, and what it is.
    #[inline(always)]
    pub fn get(&self, i: usize) -> (f32, u32) {
        (self.nears[i], self.children[i])
    }
}

impl WideBvh {
    /// Visits, roughly near before far, each leaf below node `root` whose box the ray enters at or before
    /// `t_max`.
    ///
    /// `visit` gets the leaf's first entry, their number and the current `t_max`, and answers
    /// `Continue(t_max)`, shortened if it found something, or `Break` to stop.
    #[inline(always)]
    pub(super) fn traverse<S: Simd, B>(
        &self,
        simd: S,
        probe: &Probe,
        root: usize,
        mut t_max: f32,
        waiting: &mut Waiting,
        mut visit: impl FnMut(usize, usize, f32) -> ControlFlow<B, f32>,
    ) -> ControlFlow<B> {
        let boxes = Boxes::<S>::new(simd, probe);
        let Some(mut node) = self.nodes.get(root) else { return ControlFlow::Continue(()) };
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
                        Child::Leaf { first, count } => t_max = visit(first, count, t_max)?,
                    }
                }
            }
        }
    }
}

/// A ray made ready for eight boxes at once.
pub(super) struct Boxes<S: Simd> {
    simd: S,
    near_origin: [S::F8; 3],
    far_origin: [S::F8; 3],
    inverse: [S::F8; 3],
    /// Rows of the sides where the ray comes in.
    near_rows: [usize; 3],
    octant: usize,
}

impl<S: Simd> Boxes<S> {
    #[inline(always)]
    pub fn new(simd: S, probe: &Probe) -> Self {
        let splat = |v: glam::Vec3| three(|axis| S::F8::splat(simd, v[axis]));
        let octant = probe.octant();
        Self {
            simd,
            near_origin: splat(probe.near_origin),
            far_origin: splat(probe.far_origin),
            inverse: splat(probe.inverse),
            near_rows: [octant & 1, 2 + (octant >> 1 & 1), 4 + (octant >> 2 & 1)],
            octant,
        }
    }

    /// Puts the children that the ray enters on top of the `count` waiting ones; returns how many.
    #[inline(always)]
    pub fn enter(&self, node: &WideNode, t_max: f32, waiting: &mut Waiting, count: usize) -> usize {
        let side = |axis: usize, row: usize, origin: &[S::F8; 3]| {
            (S::F8::load(self.simd, &node.bounds[row % 6]) - origin[axis]) * self.inverse[axis]
        };
        let near = |axis: usize| side(axis, self.near_rows[axis], &self.near_origin);
        let far = |axis: usize| side(axis, self.near_rows[axis] ^ 1, &self.far_origin);
        let zero = S::F8::splat(self.simd, 0.0);
        let t_max = S::F8::splat(self.simd, t_max);
        let entry = near(0).max(near(1)).max(near(2).max(zero));
        let exit = far(0).min(far(1)).min(far(2).min(t_max));
        let nears = (&mut waiting.nears[count..count + WIDTH]).try_into();
        let children = (&mut waiting.children[count..count + WIDTH]).try_into();
        let (Ok(nears), Ok(to)) = (nears, children) else { return 0 };
        S::F8::push_entered(entry, exit, node.orders[self.octant % 8], &node.children, nears, to)
    }
}
