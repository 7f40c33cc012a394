//! The one loop through a hierarchy.

use super::build::MAX_DEPTH;
use super::{Bvh, Probe};
use std::ops::{ControlFlow, Range};

impl Bvh {
    /// Visits, near before far, each leaf whose box the ray enters at or before `t_max`.
    ///
    /// `visit` gets the leaf's range of [`Bvh::prims`] and the current `t_max`, and answers
    /// `Continue(t_max)`, shortened if it found something, or `Break` to stop.
    #[inline]
    pub fn traverse<B>(
        &self,
        probe: &Probe,
        mut t_max: f32,
        mut visit: impl FnMut(Range<usize>, f32) -> ControlFlow<B, f32>,
    ) -> ControlFlow<B> {
        let Some(root) = self.nodes.first() else { return ControlFlow::Continue(()) };
        if probe.enter(root.min, root.max, t_max).is_none() {
            return ControlFlow::Continue(());
        }
        let mut node = root;
        let mut stack = [(0, 0.0); MAX_DEPTH];
        let mut waiting = 0;
        loop {
            if node.count > 0 {
                let first = node.first as usize;
                t_max = visit(first..first + node.count as usize, t_max)?;
            } else {
                let left = &self.nodes[node.first as usize];
                let right = &self.nodes[node.first as usize + 1];
                match (probe.enter(left.min, left.max, t_max), probe.enter(right.min, right.max, t_max)) {
                    (Some(l), Some(r)) => {
                        let left_first = l <= r;
                        let far = if left_first { (node.first + 1, r) } else { (node.first, l) };
                        stack[waiting] = far;
                        waiting += 1;
                        node = if left_first { left } else { right };
                        continue;
                    }
                    (Some(_), None) => {
                        node = left;
                        continue;
                    }
                    (None, Some(_)) => {
                        node = right;
                        continue;
                    }
                    (None, None) => {}
                }
            }
            // Equal distances stay in: of coincident faces the lower index wins, wherever it is.
            loop {
                if waiting == 0 {
                    return ControlFlow::Continue(());
                }
                waiting -= 1;
                let (index, near) = stack[waiting];
                if near <= t_max {
                    node = &self.nodes[index as usize];
                    break;
                }
            }
        }
    }
}
