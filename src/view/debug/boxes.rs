//! The hierarchy: boxes of a level or of all leaves, and what it is made of.

use super::layer::Line;
use crate::bvh::wide::{Child, WIDTH};
use crate::bvh::{Aabb, Blas, Placement, Tlas, WideBvh};
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// Which boxes are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Boxes {
    /// None.
    #[default]
    Off,
    /// Those of this level; 0 is the one around everything.
    Level(u32),
    /// Those with triangles in them.
    Leaves,
}

/// What a hierarchy is made of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Levels of boxes, from the one around everything down.
    pub levels: u32,
    /// Placements of meshes.
    pub instances: usize,
    /// Nodes, of each mesh once.
    pub nodes: usize,
    /// Leaves of so many triangles, 1 to 8, of each mesh once.
    pub leaves: [usize; 8],
    /// Expected cost of a ray by the surface area heuristic, of the largest mesh.
    pub cost: f32,
    /// Bytes, of each mesh once.
    pub bytes: usize,
    /// Boxes shown, and those there are to show.
    pub shown: [usize; 2],
}

/// More boxes than this would be a grey fog, and slow.
const MOST: usize = 4000;

/// A box where it stands.
#[derive(Clone, Copy)]
pub(in crate::view) struct Placed<'a> {
    pub bounds: Aabb,
    /// `None`: in render space itself.
    pub placement: Option<&'a Placement>,
}

impl Placed<'_> {
    /// Its twelve edges.
    pub(in crate::view) fn lines(&self, color: [u8; 3], alpha: f32) -> impl Iterator<Item = Line> {
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.bounds.min } else { self.bounds.max }[axis];
            let local = Vec3::new(pick(0), pick(1), pick(2));
            match self.placement {
                Some(p) if !p.is_identity() => {
                    let world: DVec3 = p.world_from_local().transform_point3(local.as_dvec3());
                    world.as_vec3()
                }
                _ => local,
            }
        };
        let corners: [Vec3; 8] = std::array::from_fn(corner);
        (0..8).flat_map(move |i| {
            let up = (0..3).map(move |axis| (i, i | 1 << axis)).filter(|(i, j)| i != j);
            up.map(move |(i, j)| Line { ends: [corners[i], corners[j]], color, alpha })
        })
    }
}

/// A colour for each level, far from those of its neighbours.
#[must_use]
pub fn color_of(level: u32) -> [u8; 3] {
    const COLORS: [[u8; 3]; 8] = [
        [255, 120, 235],
        [255, 190, 92],
        [104, 208, 232],
        [255, 122, 150],
        [140, 230, 120],
        [190, 150, 255],
        [255, 235, 110],
        [110, 150, 255],
    ];
    COLORS[level as usize % COLORS.len()]
}

/// Tells `see` of each box below node `root`: its level, whether it is a leaf, and of how many entries.
fn walk(
    hierarchy: &WideBvh,
    root: usize,
    level: u32,
    see: &mut impl FnMut(u32, Aabb, Option<(usize, usize)>),
) {
    let mut stack = if hierarchy.nodes.is_empty() { Vec::new() } else { vec![(root, level)] };
    while let Some((index, level)) = stack.pop() {
        let node = &hierarchy.nodes[index];
        for slot in 0..WIDTH {
            let bounds = node.child_bounds(slot);
            if bounds.is_empty() {
                continue;
            }
            match Child::unpack(node.children[slot]) {
                Child::Node(child) => {
                    see(level + 1, bounds, None);
                    stack.push((child, level + 1));
                }
                Child::Leaf { first, count } => see(level + 1, bounds, Some((first, count))),
            }
        }
    }
}

/// The boxes as lines, and the statistics. (For the latter each mesh is looked at once, however often it is placed.)
#[must_use]
pub fn show(tlas: &Tlas, boxes: Boxes) -> (Vec<Line>, Statistics) {
    let placements = tlas.placements();
    let mut statistics = Statistics { instances: placements.len(), ..Statistics::default() };
    let (mut lines, mut wanted) = (Vec::new(), 0);
    let mut add = |level: u32, placed: Placed, is_leaf: bool| {
        let chosen = match boxes {
            Boxes::Off => false,
            Boxes::Level(chosen) => level == chosen,
            Boxes::Leaves => is_leaf,
        };
        wanted += usize::from(chosen);
        if chosen && wanted <= MOST {
            lines.extend(placed.lines(color_of(level), 0.75));
        }
    };
    add(0, Placed { bounds: tlas.bounds(), placement: None }, false);
    let mut inner = Vec::new();
    walk(tlas.hierarchy(), 0, 0, &mut |level, bounds, leaf| {
        let entry = leaf.map(|(first, _)| tlas.entries()[tlas.hierarchy().prims[first] as usize]);
        let is_leaf = entry.is_some_and(|entry| matches!(entry.child(), Child::Leaf { .. }));
        add(level, Placed { bounds, placement: None }, is_leaf);
        statistics.levels = statistics.levels.max(level + 1);
        inner.extend(entry.map(|entry| (entry, level)));
    });
    statistics.nodes += tlas.hierarchy().nodes.len();
    let mut counted: HashMap<*const Blas, u32> = HashMap::new();
    let mut largest = 0;
    for (entry, level) in inner {
        let placement = &placements[entry.instance as usize];
        let blas = placement.blas();
        let hierarchy = blas.hierarchy();
        let by = counted.entry(Arc::as_ptr(blas)).or_insert_with(|| {
            statistics.nodes += hierarchy.nodes.len();
            statistics.bytes += blas.bytes();
            if hierarchy.prims.len() > largest {
                (largest, statistics.cost) = (hierarchy.prims.len(), blas.cost());
            }
            entry.instance
        });
        let is_counted = *by == entry.instance;
        let root = match entry.child() {
            Child::Node(root) => root,
            Child::Leaf { count, .. } => {
                statistics.leaves[count - 1] += usize::from(is_counted);
                continue;
            }
        };
        walk(hierarchy, root, level, &mut |level, bounds, leaf| {
            add(level, Placed { bounds, placement: Some(placement) }, leaf.is_some());
            statistics.levels = statistics.levels.max(level + 1);
            if let (true, Some((_, count))) = (is_counted, leaf) {
                statistics.leaves[count - 1] += 1;
            }
        });
    }
    statistics.shown = [wanted.min(MOST), wanted];
    (lines, statistics)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    fn tlas() -> Tlas {
        let triangle = |i: u32| {
            let p = Vec3::new((i % 16) as f32, (i / 16) as f32, (i * 7 % 5) as f32);
            [p, p + Vec3::X * 0.5, p + Vec3::Y * 0.5]
        };
        let blas = Arc::new(Blas::build(&(0..256).map(triangle).collect::<Vec<_>>()));
        let places = [0.0, 30.0].map(|x| DAffine3::from_translation(DVec3::X * x));
        Tlas::build(places.map(|place| Placement::new(Arc::clone(&blas), place).unwrap()).into())
    }

    #[test]
    fn leaves_hold_all_triangles_of_a_mesh_once() {
        let (_, statistics) = show(&tlas(), Boxes::Off);
        let triangles: usize = statistics.leaves.iter().zip(1..).map(|(leaves, size)| leaves * size).sum();
        assert_eq!((triangles, statistics.instances), (256, 2));
        assert_eq!(statistics.shown, [0, 0]);
        assert!(statistics.cost > 1.0 && statistics.bytes > 256 * 36 && statistics.levels > 2);
    }

    #[test]
    fn levels_and_leaves_are_boxes_of_twelve_edges_in_their_parents() {
        let tlas = tlas();
        for boxes in (0..5).map(Boxes::Level).chain([Boxes::Leaves]) {
            let (lines, statistics) = show(&tlas, boxes);
            assert_eq!(lines.len(), 12 * statistics.shown[0], "{boxes:?}");
            let all = tlas.bounds();
            let inside = |p: Vec3| p.cmpge(all.min - 1e-3).all() && p.cmple(all.max + 1e-3).all();
            assert!(lines.iter().flat_map(|l| l.ends).all(inside));
            // Along an axis each, as the placements only shift.
            let axes = |l: &Line| (l.ends[1] - l.ends[0]).to_array().iter().filter(|&&x| x != 0.0).count();
            assert!(lines.iter().all(|line| axes(line) <= 1));
        }
        assert_eq!(show(&tlas, Boxes::Level(0)).1.shown, [1, 1]);
        let leaves: usize = show(&tlas, Boxes::Off).1.leaves.iter().sum();
        assert_eq!(show(&tlas, Boxes::Leaves).1.shown, [2 * leaves; 2]);
    }
}
