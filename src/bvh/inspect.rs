//! One ray, step by step: to count what it costs and to show where it goes. Not the fast way, but the same hits.

use super::batch::Target;
use super::wide::{Child, WIDTH, WideNode};
use super::{Aabb, Blas, Hit, Probe, Ray, Tlas};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Which of the boxes that a ray has yet to visit comes next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// A stack; of the children of a node the nearest goes on top. What the engine does.
    #[default]
    NearFirst,
    /// The nearest of all that wait: fewest boxes, but each costs a sorted queue.
    Queue,
}

/// How much a ray has met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Nodes of eight children whose boxes were tested.
    pub nodes: u32,
    /// Boxes tested.
    pub boxes: u32,
    /// Triangles tested.
    pub triangles: u32,
    /// Most boxes that waited at a time.
    pub waiting: u32,
}

/// What a ray visits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visited {
    /// Boxes around boxes.
    Node,
    /// One placement of a mesh.
    Instance,
    /// Triangles.
    Leaf,
}

/// One visit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// What.
    pub visited: Visited,
    /// Its box: in the space of `instance`, or of the world.
    pub bounds: Aabb,
    /// Whose triangles these are.
    pub instance: Option<u32>,
    /// Where the ray enters the box.
    pub near: f32,
    /// Where the nearest hit so far is; infinite if there is none yet.
    pub found: f32,
}

/// A box that waits.
#[derive(Clone, Copy)]
struct Entry {
    near: f32,
    /// Of equally near ones the later comes first, as on a stack.
    number: u32,
    child: Child,
    bounds: Aabb,
    instance: Option<u32>,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    /// The nearest is the greatest.
    fn cmp(&self, other: &Self) -> Ordering {
        other.near.total_cmp(&self.near).then(self.number.cmp(&other.number))
    }
}

enum Waiting {
    Stack(Vec<Entry>),
    Queue(BinaryHeap<Entry>),
}

impl Waiting {
    /// Adds children of one node.
    fn push(&mut self, entries: &mut [Entry]) {
        match self {
            Self::Stack(stack) => {
                entries.sort();
                stack.extend_from_slice(entries);
            }
            Self::Queue(queue) => queue.extend(entries.iter()),
        }
    }

    fn pop(&mut self) -> Option<Entry> {
        match self {
            Self::Stack(stack) => stack.pop(),
            Self::Queue(queue) => queue.pop(),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Stack(stack) => stack.len(),
            Self::Queue(queue) => queue.len(),
        }
    }
}

impl Tlas {
    /// Follows `ray` in this order to its nearest hit, or to `any`, and tells `see` of each visit. Every
    /// triangle counts: nobody is asked about alpha.
    pub fn inspect(
        &self,
        ray: &Ray,
        order: Order,
        any: bool,
        mut see: impl FnMut(&Step),
    ) -> (Option<Hit>, Visits) {
        let mut waiting = match order {
            Order::NearFirst => Waiting::Stack(Vec::new()),
            Order::Queue => Waiting::Queue(BinaryHeap::new()),
        };
        let mut walk = Walk { visits: Visits::default(), number: 0, best: None, t_max: ray.t_max };
        let world = self.probe(ray);
        let hierarchy = self.hierarchy();
        // The probe of the instance visited last: a queue goes to and fro, but not often.
        let mut local: Option<(u32, Probe)> = None;
        if let Some(root) = hierarchy.nodes.first() {
            let step = walk.step(Visited::Node, hierarchy.bounds, None, 0.0);
            see(&step);
            walk.open(root, &world, None, &mut waiting);
        }
        while let Some(entry) = waiting.pop() {
            if entry.near > walk.t_max {
                continue;
            }
            let probe = match entry.instance {
                None => world,
                Some(instance) => match local {
                    Some((known, probe)) if known == instance => probe,
                    _ => {
                        let probe = self.local_probe(instance, ray, &world);
                        local = Some((instance, probe));
                        probe
                    }
                },
            };
            let nodes = |instance: u32| self.placements()[instance as usize].blas();
            let Entry { child, bounds, instance, near, .. } = entry;
            match (child, instance) {
                (Child::Node(index), _) => {
                    let node = match instance {
                        None => &hierarchy.nodes[index],
                        Some(instance) => &nodes(instance).hierarchy().nodes[index],
                    };
                    see(&walk.step(Visited::Node, bounds, instance, near));
                    walk.open(node, &probe, instance, &mut waiting);
                }
                (Child::Leaf { first, .. }, None) => {
                    let inner = self.entries()[hierarchy.prims[first] as usize];
                    let instance = inner.instance;
                    see(&walk.step(Visited::Instance, bounds, None, near));
                    let probe = self.local_probe(instance, ray, &world);
                    local = Some((instance, probe));
                    match inner.child() {
                        Child::Node(root) => {
                            let root = &nodes(instance).hierarchy().nodes[root];
                            walk.open(root, &probe, Some(instance), &mut waiting);
                        }
                        Child::Leaf { first, count } => {
                            walk.test(nodes(instance), &probe, (first, count), instance);
                            if any && walk.best.is_some() {
                                break;
                            }
                        }
                    }
                }
                (Child::Leaf { first, count }, Some(instance)) => {
                    see(&walk.step(Visited::Leaf, bounds, Some(instance), near));
                    walk.test(nodes(instance), &probe, (first, count), instance);
                    if any && walk.best.is_some() {
                        break;
                    }
                }
            }
        }
        (walk.best, walk.visits)
    }

    fn local_probe(&self, instance: u32, ray: &Ray, world: &Probe) -> Probe {
        let placement = &self.placements()[instance as usize];
        if placement.is_identity() {
            return *world;
        }
        Probe::new(&placement.local(ray), &placement.blas().bounds())
    }
}

struct Walk {
    visits: Visits,
    number: u32,
    best: Option<Hit>,
    t_max: f32,
}

impl Walk {
    fn step(&self, visited: Visited, bounds: Aabb, instance: Option<u32>, near: f32) -> Step {
        let found = self.best.map_or(f32::INFINITY, |hit| hit.t);
        Step { visited, bounds, instance, near, found }
    }

    /// Tests the boxes of a node.
    fn open(&mut self, node: &WideNode, probe: &Probe, instance: Option<u32>, waiting: &mut Waiting) {
        self.visits.nodes += 1;
        let mut entered = Vec::with_capacity(WIDTH);
        for slot in 0..WIDTH {
            let bounds = node.child_bounds(slot);
            if bounds.is_empty() {
                continue;
            }
            self.visits.boxes += 1;
            if let Some(near) = probe.enter(bounds.min, bounds.max, self.t_max) {
                self.number += 1;
                let child = Child::unpack(node.children[slot]);
                entered.push(Entry { near, number: self.number, child, bounds, instance });
            }
        }
        waiting.push(&mut entered);
        self.visits.waiting = self.visits.waiting.max(waiting.len() as u32);
    }

    /// Tests the triangles of a leaf.
    fn test(&mut self, blas: &Blas, probe: &Probe, leaf: (usize, usize), instance: u32) {
        for (triangle, corners) in blas.leaves.numbered(leaf) {
            self.visits.triangles += 1;
            if let Some(found) = probe.triangle(&corners, self.t_max) {
                let hit = Hit { t: found.t, u: found.u, v: found.v, triangle, instance };
                if self.best.is_none_or(|best| hit.beats(&best)) {
                    self.best = Some(hit);
                    self.t_max = hit.t;
                }
            }
        }
    }
}
