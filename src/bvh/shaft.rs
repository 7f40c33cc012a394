//! Is anything between here and there? Not for one ray but for all from one patch to another.
//!
//! A *shaft* is the convex hull of two convex pieces, say a patch of floor and a lamp. A triangle that is outside of
//! one of some planes around it, or has both pieces on one side of its own plane, is in the way of no segment between
//! them. So "clear" is certain, and "not clear" may be a false alarm.
//!
//! Reference: E. A. Haines, J. R. Wallace, "Shaft Culling for Efficient Ray-Traced Radiosity", 1991.

use super::wide::{Child, WIDTH, WideBvh};
use super::{Aabb, Blas, Tlas};
use glam::{DAffine3, DVec3, Vec3};

/// The space between two parallelograms or other pieces of four corners.
#[derive(Clone, Debug)]
pub struct Shaft {
    corners: [DVec3; 8],
    bounds: Aabb,
    /// Outward normals, and what n · p is at most inside.
    planes: Vec<(DVec3, f64)>,
}

/// So many nodes may be looked at before the answer is "perhaps not".
const PATIENCE: usize = 256;
/// Rounding of coordinates and of rays between them, as a part of the largest coordinate.
const MARGIN: f64 = 1.0 / (1 << 19) as f64;
/// How far behind a triangle's plane a patch that lies in it may seem to be, likewise.
const FLATNESS: f64 = 1.0 / (1 << 21) as f64;

impl Shaft {
    /// Between two pieces, each the convex hull of four corners.
    #[must_use]
    pub fn new(from: [DVec3; 4], to: [DVec3; 4]) -> Self {
        let [a, b, c, d] = from;
        let [e, f, g, h] = to;
        let corners = [a, b, c, d, e, f, g, h];
        let (mut low, mut high) = (a, a);
        for p in corners {
            (low, high) = (low.min(p), high.max(p));
        }
        let margin = MARGIN * reach(&corners);
        let bounds = Aabb {
            min: (low - margin).as_vec3().map(f32::next_down),
            max: (high + margin).as_vec3().map(f32::next_up),
        };
        let mut planes = Vec::with_capacity(24);
        for axis in 0..3 {
            outline(&corners, axis, |normal| {
                let most = corners.iter().map(|p| normal.dot(*p)).fold(f64::NEG_INFINITY, f64::max);
                planes.push((normal, most + margin * normal.abs().element_sum()));
            });
        }
        Self { corners, bounds, planes }
    }

    fn moved(&self, by: &DAffine3) -> Self {
        let [a, b, c, d, e, f, g, h] = self.corners.map(|p| by.transform_point3(p));
        Self::new([a, b, c, d], [e, f, g, h])
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
        let tolerance = FLATNESS * normal.abs().element_sum() * reach(&self.corners);
        let heights = self.corners.map(|p| normal.dot(p - a));
        // Both pieces in the plane itself: no segment crosses it either.
        heights.iter().all(|&h| h >= -tolerance) || heights.iter().all(|&h| h <= tolerance)
    }
}

impl Tlas {
    /// Whether surely no triangle is in the way of any segment within `shaft`. Surfaces in which one of its pieces
    /// lies are not.
    #[must_use]
    pub fn is_clear(&self, shaft: &Shaft) -> bool {
        let mut patience = PATIENCE;
        search(self.hierarchy(), shaft, &mut patience, |entry, patience| {
            let placement = &self.placements()[self.hierarchy().prims[entry.0] as usize];
            let blas = placement.blas();
            if placement.is_identity() {
                blas.is_clear(shaft, patience)
            } else {
                blas.is_clear(&shaft.moved(placement.local_from_world()), patience)
            }
        })
    }
}

impl Blas {
    fn is_clear(&self, shaft: &Shaft, patience: &mut usize) -> bool {
        shaft.misses_box(&self.bounds())
            || search(&self.wide, shaft, patience, |(first, count), _| {
                self.leaves.triangles(first, count).all(|triangle| shaft.misses_triangle(&triangle))
            })
    }
}

/// Whether `clear` says so of all leaves, first entry and number of entries, that are not outside.
fn search(
    wide: &WideBvh,
    shaft: &Shaft,
    patience: &mut usize,
    mut clear: impl FnMut((usize, usize), &mut usize) -> bool,
) -> bool {
    let mut waiting = Vec::with_capacity(64);
    if !wide.nodes.is_empty() {
        waiting.push(0);
    }
    while let Some(index) = waiting.pop() {
        if *patience == 0 {
            return false;
        }
        *patience -= 1;
        let node = &wide.nodes[index];
        for slot in 0..WIDTH {
            let bounds = node.child_bounds(slot);
            if bounds.is_empty() || shaft.misses_box(&bounds) {
                continue;
            }
            match Child::unpack(node.children[slot]) {
                Child::Node(child) => waiting.push(child),
                Child::Leaf { first, count } => {
                    if !clear((first, count), patience) {
                        return false;
                    }
                }
            }
        }
    }
    true
}

/// The largest coordinate without sign.
fn reach(corners: &[DVec3; 8]) -> f64 {
    corners.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max)
}

/// The outward normals of the edges of what the corners look like along `axis`.
fn outline(corners: &[DVec3; 8], axis: usize, mut report: impl FnMut(DVec3)) {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut flat = corners.map(|p| (p[i], p[j]));
    flat.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let turn = |a: (f64, f64), b: (f64, f64), c: (f64, f64)| (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0);
    // The lower chain, then the upper one (A. M. Andrew, 1979).
    for upper in [false, true] {
        let mut chain = [(0.0, 0.0); 8];
        let mut length = 0;
        for k in 0..8 {
            let p = flat[if upper { 7 - k } else { k }];
            while length > 1 && turn(chain[length - 2], chain[length - 1], p) <= 0.0 {
                length -= 1;
            }
            chain[length] = p;
            length += 1;
        }
        for edge in chain[..length].windows(2) {
            let mut normal = DVec3::ZERO;
            normal[i] = edge[1].1 - edge[0].1;
            normal[j] = edge[0].0 - edge[1].0;
            let normal = normal.normalize_or_zero();
            if normal != DVec3::ZERO {
                report(normal);
            }
        }
    }
}
