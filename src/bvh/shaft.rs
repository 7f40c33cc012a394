//! Is anything between here and there? Not for one ray but for all from one patch to another.
//!
//! A *shaft* is the convex hull of two flat pieces, say a patch of floor and a lamp. A triangle that is outside of
//! one of some planes around it, or has both pieces on one side of its own plane, is in the way of no segment between
//! them. So who is not named is certainly not in the way, and who is named may be harmless.
//!
//! Reference: E. A. Haines, J. R. Wallace, "Shaft Culling for Efficient Ray-Traced Radiosity", 1991.

use super::wide::{Child, WIDTH, WideBvh, WideNode};
use super::{Aabb, Blas, Tlas};
use glam::{DAffine3, DVec3, Vec3};

/// The space between two convex pieces.
#[derive(Clone, Debug)]
pub struct Shaft {
    /// Of the first piece, then of the second.
    corners: Vec<DVec3>,
    /// How many the first has.
    first: usize,
    bounds: Aabb,
    /// The largest coordinate of its corners, without sign.
    reach: f64,
    /// Outward normals, and what n · p is at most inside.
    planes: Vec<(DVec3, f64)>,
    /// The same in single precision, no tighter.
    coarse: Vec<([f32; 3], f32)>,
}

/// So many nodes may be looked at before the search is given up.
const PATIENCE: usize = 256;
/// Rounding of coordinates and of rays between them, as a part of the largest coordinate.
const MARGIN: f64 = 1.0 / (1 << 19) as f64;
/// What n · p may be off in single precision, as a part of its terms without sign: a few roundings.
const COARSENESS: f32 = 16.0 / (1 << 24) as f32;
/// How far behind a triangle's plane a patch that lies in it may seem to be, likewise.
const FLATNESS: f64 = 1.0 / (1 << 21) as f64;

impl Shaft {
    /// From one flat piece, the convex hull of its corners, to another.
    #[must_use]
    pub fn new(from: &[DVec3], to: &[DVec3]) -> Self {
        let corners = [from, to].concat();
        let mut normals = Vec::with_capacity(24);
        for axis in 0..3 {
            outline(&corners, axis, |normal| normals.push(normal));
        }
        Self::bounded(corners, from.len(), normals.into_iter())
    }

    /// Of these corners, with planes of these normals around them.
    fn bounded(corners: Vec<DVec3>, first: usize, normals: impl Iterator<Item = DVec3>) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in &corners {
            (low, high) = (low.min(*p), high.max(*p));
        }
        let reach = low.abs().max(high.abs()).max_element();
        let margin = MARGIN * reach;
        let bounds = Aabb {
            min: (low - margin).as_vec3().map(f32::next_down),
            max: (high + margin).as_vec3().map(f32::next_up),
        };
        let plane = |normal: DVec3| {
            let most = corners.iter().map(|p| normal.dot(*p)).fold(f64::NEG_INFINITY, f64::max);
            (normal, most + margin * normal.abs().element_sum())
        };
        let planes: Vec<(DVec3, f64)> = normals.map(plane).collect();
        let coarse =
            planes.iter().map(|(normal, most)| (normal.as_vec3().to_array(), (*most as f32).next_up()));
        let coarse = coarse.collect();
        Self { corners, first, bounds, reach, planes, coarse }
    }

    /// As another space sees it into which `by` leads from its own, and `back` from there.
    fn moved(&self, by: &DAffine3, back: &DAffine3) -> Self {
        let corners = self.corners.iter().map(|p| by.transform_point3(*p)).collect();
        let turn = back.matrix3.transpose();
        let normals = self.planes.iter().map(|(normal, _)| (turn * *normal).normalize_or_zero());
        Self::bounded(corners, self.first, normals.filter(|normal| *normal != DVec3::ZERO))
    }

    /// Whether the box is surely outside.
    #[must_use]
    pub fn misses_box(&self, aabb: &Aabb) -> bool {
        let (min, max) = (aabb.min.as_dvec3(), aabb.max.as_dvec3());
        !aabb.overlaps(&self.bounds)
            || self.planes.iter().any(|(normal, most)| {
                let nearest = DVec3::select(normal.cmpgt(DVec3::ZERO), min, max);
                normal.dot(nearest) > *most
            })
    }

    /// [`Shaft::misses_box`] for the children of a node, all at once, so that vectors are used.
    fn misses_children(&self, node: &WideNode) -> [u32; WIDTH] {
        let mut missed = [0; WIDTH];
        for (axis, [min, max]) in node.bounds.iter().enumerate() {
            let (low, high) = (self.bounds.min[axis], self.bounds.max[axis]);
            for slot in 0..WIDTH {
                missed[slot] |= u32::from(min[slot] > high) | u32::from(max[slot] < low);
            }
        }
        for (normal, most) in &self.coarse {
            let [x, y, z] = [0, 1, 2].map(|axis| &node.bounds[axis][usize::from(normal[axis] <= 0.0)]);
            for slot in 0..WIDTH {
                let (x, y, z) = (normal[0] * x[slot], normal[1] * y[slot], normal[2] * z[slot]);
                let off = COARSENESS * (x.abs() + y.abs() + z.abs());
                missed[slot] |= u32::from(x + y + z - off > *most);
            }
        }
        missed
    }

    /// Whether the triangle is surely in nobody's way.
    #[must_use]
    pub fn misses_triangle(&self, corners: &[Vec3; 3]) -> bool {
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let around = Aabb::around(corners);
        if !around.overlaps(&self.bounds) {
            return true;
        }
        let outside = |(normal, most): &(DVec3, f64)| {
            normal.dot(a) > *most && normal.dot(b) > *most && normal.dot(c) > *most
        };
        if self.planes.iter().any(outside) {
            return true;
        }
        let normal = (b - a).cross(c - a);
        let tolerance = FLATNESS * normal.abs().element_sum() * self.reach;
        let height = |p: &DVec3| normal.dot(*p - a);
        // The first piece lies in its plane, or all is on one side.
        self.corners[..self.first].iter().all(|p| height(p).abs() <= tolerance)
            || self.corners.iter().all(|p| height(p) >= -tolerance)
            || self.corners.iter().all(|p| height(p) <= tolerance)
    }
}

impl Tlas {
    /// Calls `report` with the instance and the corners, placed, of each triangle that may be in the way of some segment
    /// within `shaft`; surfaces in which the shaft's first piece lies are not. Stops when `report` says false, or there
    /// is too much to look at; says whether neither happened.
    #[must_use]
    pub fn blockers(&self, shaft: &Shaft, mut report: impl FnMut(u32, [Vec3; 3]) -> bool) -> bool {
        let mut patience = PATIENCE;
        search(self.hierarchy(), Child::Node(0), shaft, &mut patience, |(leaf, _), patience| {
            let entry = self.entries()[self.hierarchy().prims[leaf] as usize];
            let instance = entry.instance;
            let placement = &self.placements()[instance as usize];
            let blas = placement.blas();
            if placement.is_identity() {
                return blas.blockers(entry.child(), shaft, patience, |triangle| report(instance, triangle));
            }
            let local = shaft.moved(placement.local_from_world(), placement.world_from_local());
            blas.blockers(entry.child(), &local, patience, |triangle| {
                let placed = |p: Vec3| placement.world_from_local().transform_point3(p.as_dvec3()).as_vec3();
                report(instance, triangle.map(placed))
            })
        })
    }
}

impl Blas {
    fn blockers(
        &self,
        root: Child,
        shaft: &Shaft,
        patience: &mut usize,
        mut report: impl FnMut([Vec3; 3]) -> bool,
    ) -> bool {
        shaft.misses_box(&self.bounds())
            || search(&self.wide, root, shaft, patience, |leaf, _| {
                self.leaves
                    .numbered(leaf)
                    .all(|(_, triangle)| shaft.misses_triangle(&triangle) || report(triangle))
            })
    }
}

/// Calls `visit` with all leaves below `root`, first entry and number of entries, that are not outside, until it says false.
fn search(
    wide: &WideBvh,
    root: Child,
    shaft: &Shaft,
    patience: &mut usize,
    mut visit: impl FnMut((usize, usize), &mut usize) -> bool,
) -> bool {
    if wide.nodes.is_empty() {
        return true;
    }
    let mut waiting = Vec::with_capacity(64);
    match root {
        Child::Node(root) => waiting.push(root),
        Child::Leaf { first, count } => return visit((first, count), patience),
    }
    while let Some(index) = waiting.pop() {
        if *patience == 0 {
            return false;
        }
        *patience -= 1;
        let node = &wide.nodes[index];
        let missed = shaft.misses_children(node);
        let is_there = |&slot: &usize| missed[slot] == 0 && !node.child_bounds(slot).is_empty();
        for slot in (0..WIDTH).filter(is_there) {
            match Child::unpack(node.children[slot]) {
                Child::Node(child) => waiting.push(child),
                Child::Leaf { first, count } => {
                    if !visit((first, count), patience) {
                        return false;
                    }
                }
            }
        }
    }
    true
}

/// The outward normals of the edges of what the corners look like along `axis`.
fn outline(corners: &[DVec3], axis: usize, mut report: impl FnMut(DVec3)) {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut flat: Vec<_> = corners.iter().map(|p| (p[i], p[j])).collect();
    flat.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let turn =
        |a: (f64, f64), b: (f64, f64), c: (f64, f64)| (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
    // The lower chain, then the upper one (A. M. Andrew, 1979).
    let mut chain: Vec<(f64, f64)> = Vec::with_capacity(flat.len());
    for _ in 0..2 {
        chain.clear();
        for &p in &flat {
            while let [.., a, b] = chain[..]
                && turn(a, b, p) <= 0.0
            {
                chain.pop();
            }
            chain.push(p);
        }
        for edge in chain.windows(2) {
            let mut normal = DVec3::ZERO;
            normal[i] = edge[1].1 - edge[0].1;
            normal[j] = edge[0].0 - edge[1].0;
            let normal = normal.normalize_or_zero();
            if normal != DVec3::ZERO {
                report(normal);
            }
        }
        flat.reverse();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torture::oracle::Rng;

    #[test]
    fn eight_boxes_at_once_are_missed_as_one_by_one_but_for_rounding() {
        let mut rng = Rng(5);
        let mut point =
            |scale: f64| DVec3::from_array([0, 1, 2].map(|_| (f64::from(rng.unit()) - 0.5) * scale));
        let (mut all, mut both) = (0, 0);
        for i in 0..2000 {
            let scale = [1e-3, 1.0, 1e5][i % 3];
            let shift = point(scale * 10.0);
            let mut patch = |size: f64| {
                let (corner, u, v) = (point(scale) + shift, point(size), point(size));
                [corner, corner + u, corner + u + v, corner + v]
            };
            let shaft = Shaft::new(&patch(0.1 * scale), &patch(0.3 * scale));
            let mut node = WideNode::EMPTY;
            for slot in 0..WIDTH - 1 {
                let (middle, size) =
                    ((point(2.0 * scale) + shift).as_vec3(), point(0.3 * scale).abs().as_vec3());
                node.set_bounds(slot, &Aabb { min: middle - size, max: middle + size });
            }
            let missed = shaft.misses_children(&node);
            assert_eq!(missed[WIDTH - 1], 1, "one that is not there");
            for (slot, missed) in missed.iter().enumerate().take(WIDTH - 1) {
                let surely = shaft.misses_box(&node.child_bounds(slot));
                assert!(surely || *missed == 0, "{slot} of {node:?}");
                all += u32::from(surely);
                both += *missed;
            }
        }
        assert!(both > 5000 && both * 1000 > all * 999, "{both} of {all}");
    }
}
