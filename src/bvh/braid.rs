//! Where the top level enters the bottom levels: not only at their roots.
//!
//! The box of a room is around everything in it, so each ray would go through the room's hierarchy from its root and then
//! through that of each thing, as if they were strangers. So large roots are opened: what hangs below them enters the top level
//! by itself, which sorts it among the nodes of the others. Reference: C. Benthin, S. Woop, I. Wald, A. T. Áfra,
//! "Improved Two-Level BVHs using Partial Re-Braiding", HPG 2017.

use super::wide::{Child, WIDTH};
use super::{Aabb, Placement};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// As a part of the area of everything: smaller boxes are not worth another entry.
const LARGE: f32 = 1.0 / 100.0;
/// So many entries in any case, and more for each placement.
const MOST: usize = 64;
const MOST_EACH: usize = 4;

/// A node or a leaf of a placed bottom level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Whose.
    pub instance: u32,
    /// Which: a packed [`Child`].
    pub(super) child: u32,
}

impl Entry {
    /// What it is in the bottom level of its instance.
    #[inline(always)]
    #[must_use]
    pub fn child(&self) -> Child {
        Child::unpack(self.child)
    }
}

/// An entry that may be opened; the largest comes first.
struct Open {
    area: f32,
    number: usize,
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> Ordering {
        self.area.total_cmp(&other.area).then(other.number.cmp(&self.number))
    }
}

/// What the top level is built over: for each placement with a surface its root, or what hangs below; and their boxes.
pub(super) fn entries(placements: &[Placement]) -> (Vec<Entry>, Vec<Aabb>) {
    let (mut entries, mut boxes) = (Vec::new(), Vec::new());
    let mut largest = BinaryHeap::new();
    let mut whole = Aabb::EMPTY;
    // Into what is moved rays have to be taken: for each of its entries anew.
    let openable =
        |placement: &Placement, child: Child| placement.is_identity() && matches!(child, Child::Node(_));
    for (instance, placement) in (0..).zip(placements) {
        let bounds = placement.world_bounds(placement.blas().bounds());
        if bounds.is_empty() {
            continue;
        }
        whole = whole.union(bounds);
        let child = Child::Node(0);
        if openable(placement, child) {
            largest.push(Open { area: bounds.half_area(), number: entries.len() });
        }
        entries.push(Entry { instance, child: child.pack() });
        boxes.push(bounds);
    }
    let most = MOST + MOST_EACH * entries.len();
    let least = whole.half_area() * LARGE;
    while let Some(Open { area, number }) = largest.pop() {
        if entries.len() + WIDTH > most || area < least {
            break;
        }
        let Entry { instance, child } = entries[number];
        let placement = &placements[instance as usize];
        let Child::Node(index) = Child::unpack(child) else { continue };
        let node = &placement.blas().hierarchy().nodes[index];
        let mut place = number;
        for slot in (0..WIDTH).filter(|&slot| !node.child_bounds(slot).is_empty()) {
            let bounds = placement.world_bounds(node.child_bounds(slot));
            let child = Child::unpack(node.children[slot]);
            if place == entries.len() {
                entries.push(Entry { instance, child: child.pack() });
                boxes.push(bounds);
            } else {
                entries[place] = Entry { instance, child: child.pack() };
                boxes[place] = bounds;
            }
            if openable(placement, child) {
                largest.push(Open { area: bounds.half_area(), number: place });
            }
            place = entries.len();
        }
    }
    (entries, boxes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Blas, Tlas};
    use crate::torture::oracle::Rng;
    use glam::{DAffine3, DVec3, Vec3};
    use std::sync::Arc;

    /// Small triangles in a box of this size.
    fn crowd(rng: &mut Rng, size: f32) -> Arc<Blas> {
        let mut point = |size: f32| Vec3::new(rng.unit() - 0.5, rng.unit() - 0.5, rng.unit() - 0.5) * size;
        let triangles: Vec<_> = (0..500)
            .map(|_| {
                let corner = point(size);
                [corner, corner + point(0.2), corner + point(0.2)]
            })
            .collect();
        Arc::new(Blas::build(&triangles))
    }

    /// How often each triangle is below an entry.
    fn times(blas: &Blas, entries: &[Entry]) -> Vec<u32> {
        let hierarchy = blas.hierarchy();
        let mut times = vec![0; 500];
        let mut waiting: Vec<Child> = entries.iter().map(Entry::child).collect();
        while let Some(child) = waiting.pop() {
            match child {
                Child::Node(index) => {
                    let node = &hierarchy.nodes[index];
                    let there = (0..WIDTH).filter(|&slot| !node.child_bounds(slot).is_empty());
                    waiting.extend(there.map(|slot| Child::unpack(node.children[slot])));
                }
                Child::Leaf { first, count } => {
                    hierarchy.prims[first..first + count].iter().for_each(|&id| times[id as usize] += 1);
                }
            }
        }
        times
    }

    #[test]
    fn large_ones_that_are_not_moved_are_opened_and_nothing_is_lost_or_twice() {
        let mut rng = Rng(3);
        let (room, thing) = (crowd(&mut rng, 4.0), crowd(&mut rng, 0.01));
        let moved = DAffine3::from_translation(DVec3::X);
        let places = [(&room, DAffine3::IDENTITY), (&thing, DAffine3::IDENTITY), (&room, moved)];
        let placements = places.map(|(blas, place)| Placement::new(Arc::clone(blas), place).unwrap());
        let (all, boxes) = entries(&placements);
        assert_eq!(all.len(), boxes.len());
        let of = |instance| all.iter().copied().filter(|e| e.instance == instance).collect::<Vec<_>>();
        assert!(of(0).len() > 4, "{all:?}");
        assert_eq!((of(1).len(), of(2).len()), (1, 1), "one is small, one moved");
        for (instance, (blas, _)) in (0..).zip(places) {
            let of = of(instance);
            // Slivers are in several leaves.
            let whole = times(blas, &[Entry { instance, child: Child::Node(0).pack() }]);
            assert!(!whole.contains(&0));
            assert_eq!(times(blas, &of), whole);
            assert_ne!(times(blas, &of[1..]), whole, "one less is seen");
        }
        let tlas = Tlas::build(placements.into());
        assert_eq!(tlas.hierarchy().check(Some(&boxes)), Ok(()));
    }

    #[test]
    fn entries_are_few_and_what_has_no_surface_has_none() {
        let mut rng = Rng(4);
        let place = |blas: &Arc<Blas>| Placement::new(Arc::clone(blas), DAffine3::IDENTITY).unwrap();
        // All lie through one another: each box is large.
        let crowds: Vec<_> = (0..100).map(|_| place(&crowd(&mut rng, 4.0))).collect();
        let (all, _) = entries(&crowds);
        assert!((crowds.len()..=MOST + MOST_EACH * crowds.len()).contains(&all.len()), "{}", all.len());
        let nothing = Arc::new(Blas::build(&[]));
        assert_eq!(entries(&[place(&nothing)]), (Vec::new(), Vec::new()));
    }
}
