//! Triangles whose boxes are mostly empty → references to parts of them.
//!
//! A long thin triangle across a corner of its box is hit by hardly any of the rays that hit the box. Parted
//! at planes that all triangles share, its parts together have a much smaller surface. Reference: T. Karras,
//! T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume Hierarchies", HPG 2013, section 4;
//! here parts are shared out by the square root of the area to be saved, which is what minimises the sum
//! for needles (n parts of one have an n-th of its area).

use super::MOST_ENTRIES;
use super::prim::Prim;
use crate::bvh::Aabb;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Boxes larger than this many times the least that their triangle needs ...
const SLIVER: f32 = 8.0;
/// ... are split if they have this part of the area of all boxes.
const WORTH_SPLITTING: f64 = 0.1;
/// A mesh is mostly slivers if they have this part of the sizes (roots of areas) of all boxes.
const MOSTLY_SLIVERS: f64 = 0.5;
/// No triangle has more parts.
const MAX_PARTS: f64 = 4096.0;
/// Never too many, where a small mesh is mostly slivers.
const FEW_PARTS: usize = 1000;

/// How much of the boxes of triangles is empty.
#[derive(Clone, Copy, Default)]
pub(super) struct Waste {
    /// Half areas of all boxes.
    all: f64,
    /// Of those that are much larger than their triangle needs.
    slivers: f64,
    /// Square roots of the half areas of all boxes.
    sizes: f64,
    /// Square roots of what could be saved at most of slivers.
    roots: f64,
}

impl Waste {
    #[inline]
    pub fn add(&mut self, prim: &Prim, corners: &[Vec3; 3]) {
        let (area, least) = (prim.half_area(), least_half_area(corners));
        self.all += f64::from(area);
        self.sizes += f64::from(area).sqrt();
        self.roots += root(area, least);
        if area > SLIVER * least {
            self.slivers += f64::from(area);
        }
    }

    pub fn union(self, other: Self) -> Self {
        let Self { all, slivers, sizes, roots } = other;
        Self {
            all: self.all + all,
            slivers: self.slivers + slivers,
            sizes: self.sizes + sizes,
            roots: self.roots + roots,
        }
    }

    /// Whether splitting is worth it.
    fn is_much(&self) -> bool {
        self.slivers > WORTH_SPLITTING * self.all && self.roots > 0.0 && self.roots.is_finite()
    }

    /// How many more references than triangles there may be.
    fn budget(&self, triangles: usize) -> usize {
        let wanted = if self.roots > MOSTLY_SLIVERS * self.sizes {
            (triangles * 17 / 10).max((16 * triangles).min(FEW_PARTS))
        } else {
            triangles / 4
        };
        wanted.min(MOST_ENTRIES - triangles)
    }
}

/// Of what could be saved of a sliver's box; nothing of others.
#[inline]
fn root(area: f32, least: f32) -> f64 {
    if area > SLIVER * least { f64::from(area - least).sqrt() } else { 0.0 }
}

/// Replaces references to whole triangles by several to parts, where that pays.
pub(super) fn split(prims: Vec<Prim>, waste: &Waste, triangles: &[[Vec3; 3]]) -> Vec<Prim> {
    if !waste.is_much() {
        return prims;
    }
    let bounds = prims.iter().fold(Aabb::EMPTY, |bounds, prim| bounds.union(prim.aabb()));
    let grid = Grid::new(&bounds);
    let share = waste.budget(prims.len()) as f64 / waste.roots;
    let parts: Vec<Vec<Prim>> = prims
        .par_chunks(1 << 12)
        .map(|piece| {
            let wanted = |prim: &Prim, corners: &[Vec3; 3]| {
                (root(prim.half_area(), least_half_area(corners)) * share).min(MAX_PARTS) as u32
            };
            let all = piece.iter().map(|prim| wanted(prim, &triangles[prim.index() as usize]) as usize + 1);
            let mut parts = Vec::with_capacity(all.sum());
            for prim in piece {
                let corners = &triangles[prim.index() as usize];
                let wanted = wanted(prim, corners);
                split_one(&grid, &corners.map(Vec3::as_dvec3), prim.aabb(), prim.index(), wanted, &mut parts);
            }
            parts
        })
        .collect();
    drop(prims);
    parts.concat()
}

/// The sum of the triangle's three shadows along the axes: what infinitely many boxes would come to.
fn least_half_area([a, b, c]: &[Vec3; 3]) -> f32 {
    (*b - *a).cross(*c - *a).abs().element_sum() * 0.5
}

/// Planes at which everything is split, so that parts of neighbours have common borders.
struct Grid {
    origin: DVec3,
    /// Steps per unit of length.
    scale: f64,
}

/// Steps along the longest side.
const STEPS: f64 = (1 << 20) as f64;

impl Grid {
    fn new(bounds: &Aabb) -> Self {
        let origin = bounds.min.as_dvec3();
        let size = (bounds.max.as_dvec3() - origin).max_element();
        Self { origin, scale: STEPS / size }
    }

    /// Of all planes between two places on an axis the one that most others are split at too: that whose
    /// number has the most zeros at its end.
    fn plane(&self, axis: usize, from: f32, to: f32) -> Option<f32> {
        let steps = |x: f32| ((f64::from(x) - self.origin[axis]) * self.scale).clamp(0.0, STEPS);
        // Planes strictly between: the last one below `to`, if not at or below `from`.
        let (low, high) = (steps(from) as u32, (steps(to).ceil() as u32).saturating_sub(1));
        if high <= low {
            return None;
        }
        let differing = (low ^ high).checked_ilog2()?;
        let number = high >> differing << differing;
        let plane = (f64::from(number) / self.scale + self.origin[axis]) as f32;
        (from < plane && plane < to).then_some(plane)
    }
}

/// Splits a part of a triangle `wanted` more times, as long as there are planes to do so.
fn split_one(
    grid: &Grid,
    corners: &[DVec3; 3],
    bounds: Aabb,
    index: u32,
    wanted: u32,
    parts: &mut Vec<Prim>,
) {
    let size = bounds.max - bounds.min;
    let axis = size.max_position();
    let plane = if wanted == 0 { None } else { grid.plane(axis, bounds.min[axis], bounds.max[axis]) };
    let Some(plane) = plane else {
        parts.push(Prim::new(bounds, index));
        return;
    };
    let [below, above] = halves(corners, &bounds, axis, plane);
    if below.is_empty() || above.is_empty() {
        // Rounding; one of them is everything.
        parts.push(Prim::new(bounds, index));
        return;
    }
    let longest = |aabb: &Aabb| (aabb.max - aabb.min).max_element();
    let ratio = longest(&below) / (longest(&below) + longest(&above));
    let left = ((wanted - 1) as f32 * ratio).round() as u32;
    split_one(grid, corners, below, index, left, parts);
    split_one(grid, corners, above, index, wanted - 1 - left.min(wanted - 1), parts);
}

/// Boxes inside `bounds` of what is below and above the plane, rounded outward.
fn halves(corners: &[DVec3; 3], bounds: &Aabb, axis: usize, plane: f32) -> [Aabb; 2] {
    let at = f64::from(plane);
    let mut halves = [Aabb::EMPTY; 2];
    for i in 0..3 {
        let (p, q) = (corners[i], corners[(i + 1) % 3]);
        if p[axis] <= at {
            halves[0] = halves[0].union(around(p));
        }
        if p[axis] >= at {
            halves[1] = halves[1].union(around(p));
        }
        if (p[axis] < at && q[axis] > at) || (p[axis] > at && q[axis] < at) {
            let crossing = p.lerp(q, (at - p[axis]) / (q[axis] - p[axis]));
            // Interpolation may miss by some units of 2⁻⁵³ of the ends, far less than the rounding to f32.
            let crossing = around(crossing);
            halves = halves.map(|half| half.union(crossing));
        }
    }
    halves[0].max[axis] = halves[0].max[axis].min(plane);
    halves[1].min[axis] = halves[1].min[axis].max(plane);
    halves.map(|half| Aabb { min: half.min.max(bounds.min), max: half.max.min(bounds.max) })
}

/// The smallest box of floats that surely has `p` inside.
fn around(p: DVec3) -> Aabb {
    let p = p.as_vec3();
    Aabb { min: p.map(f32::next_down), max: p.map(f32::next_up) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::build::prims_of;

    fn needles() -> Vec<[Vec3; 3]> {
        (0..50)
            .map(|i| {
                let at = Vec3::new((i % 7) as f32, (i % 5) as f32, i as f32 * 0.1);
                [at, at + Vec3::new(9.0, 8.0, 7.0), at + Vec3::new(9.0, 8.001, 7.0)]
            })
            .collect()
    }

    /// Whether every one of many points of each triangle is in one of its parts.
    fn covered(triangles: &[[Vec3; 3]], parts: &[Prim]) -> bool {
        triangles.iter().zip(0..).all(|(corners, index)| {
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            (0..1000).all(|k| {
                let (u, v) = (f64::from(k % 40) / 39.0, f64::from(k / 40) / 24.0);
                let p = a * (1.0 - u) + (b * (1.0 - v) + c * v) * u;
                // The point itself is rounded.
                let room = DVec3::splat(1e-12);
                let inside = |part: &Aabb| {
                    (p + room).cmpge(part.min.as_dvec3()).all() && (p - room).cmple(part.max.as_dvec3()).all()
                };
                parts.iter().any(|part| part.index() == index && inside(&part.aabb()))
            })
        })
    }

    fn parts_of(triangles: &[[Vec3; 3]]) -> Vec<Prim> {
        let (prims, waste) = prims_of(triangles);
        split(prims, &waste, triangles)
    }

    #[test]
    fn the_parts_of_a_triangle_cover_it() {
        let triangles = needles();
        let mut parts = parts_of(&triangles);
        assert!(parts.len() > 10 * triangles.len(), "{} parts", parts.len());
        assert!(covered(&triangles, &parts));
        parts.remove(parts.len() / 2);
        assert!(!covered(&triangles, &parts), "one is missing");
    }

    #[test]
    fn there_are_never_more_parts_than_leaves_can_name() {
        let needles = Waste { all: 1.0, slivers: 1.0, sizes: 1.0, roots: 1.0 };
        for triangles in [1, 1000, 90_000_000, 100_000_000, super::super::MOST_TRIANGLES] {
            let entries = triangles + needles.budget(triangles);
            assert!(entries > triangles && entries <= MOST_ENTRIES, "{entries} of {triangles}");
        }
        assert_eq!(needles.budget(1_000_000), 1_700_000);
    }

    #[test]
    fn what_fills_its_boxes_is_not_split() {
        let fat: Vec<_> =
            (0..50).map(|i| [Vec3::X, Vec3::Y, Vec3::ZERO].map(|p| p + Vec3::Z * i as f32)).collect();
        assert_eq!(parts_of(&fat).len(), fat.len());
    }
}
