//! Triangles that moved a little: the same hierarchy with new boxes.

use super::build::has_surface;
use super::leaves::fill_leaf;
use super::merge::leaf_cost;
use super::wide::{Child, WIDTH};
use super::{Aabb, Blas};
use glam::Vec3;

/// How much more than when it was built a ray through a hierarchy may be expected to cost.
const WORN_OUT: f32 = 1.3;

impl Blas {
    /// The hierarchy for moved `triangles`, with the structure of this one, which takes a fraction of a build's
    /// time. What is hit is what a new one hits.
    ///
    /// `None` if a new one has to be built: if there is another number of triangles, if some of the old or
    /// the new ones have no place or no surface, if some are in parts, or if by the surface area heuristic
    /// rays would cost more than 1.3 times what they did when it was built.
    #[must_use]
    pub fn refit(&self, triangles: &[[Vec3; 3]]) -> Option<Self> {
        if self.wide.prims.len() != triangles.len() || !triangles.iter().all(has_surface) {
            return None;
        }
        // As many may also be parts of some and nothing of others.
        let mut there = vec![false; triangles.len()];
        let is_new =
            |&id: &u32| there.get_mut(id as usize).is_some_and(|there| !std::mem::replace(there, true));
        if !self.wide.prims.iter().all(is_new) {
            return None;
        }
        let built = self.built_cost.unwrap_or_else(|| self.cost());
        let mut moved = self.clone();
        moved.built_cost = Some(built);
        let mut around = vec![Aabb::EMPTY; moved.wide.nodes.len()];
        // Children come after their parents.
        for index in (0..moved.wide.nodes.len()).rev() {
            let mut node = moved.wide.nodes[index];
            for slot in 0..WIDTH {
                if node.child_bounds(slot).is_empty() {
                    continue;
                }
                let bounds = match Child::unpack(node.children[slot]) {
                    Child::Node(child) => around[child],
                    Child::Leaf { first, count } => {
                        let ids = &moved.wide.prims[first..first + count];
                        fill_leaf(ids, moved.leaves.rows_of(first, count), triangles);
                        let boxes = ids.iter().map(|&id| Aabb::around(&triangles[id as usize]));
                        boxes.fold(Aabb::EMPTY, Aabb::union)
                    }
                };
                node.set_bounds(slot, &bounds);
                around[index] = around[index].union(bounds);
            }
            node.sort();
            moved.wide.nodes[index] = node;
        }
        moved.wide.bounds = around.first().copied().unwrap_or(Aabb::EMPTY);
        (moved.cost() <= WORN_OUT * built).then_some(moved)
    }

    /// What a ray that enters it costs, by the surface area heuristic: 1 for each node. Not finite if it has no
    /// extent.
    #[must_use]
    pub fn cost(&self) -> f32 {
        let all = f64::from(self.wide.bounds.half_area());
        let cost = |node: &super::wide::WideNode| -> f64 {
            let slots = (0..WIDTH).map(|slot| (node.child_bounds(slot), node.children[slot]));
            let there = slots.filter(|(bounds, _)| !bounds.is_empty());
            there
                .map(|(bounds, child)| {
                    let cost = match Child::unpack(child) {
                        Child::Node(_) => 1.0,
                        Child::Leaf { count, .. } => leaf_cost(count as u32),
                    };
                    f64::from(bounds.half_area()) * f64::from(cost)
                })
                .sum()
        };
        (self.wide.nodes.iter().map(cost).sum::<f64>() / all + 1.0) as f32
    }
}
