//! What is in the way of a lamp, as polygons that look convex: few edges to cut by.
//!
//! Whether a point is on one side of the plane of a triangle is a linear function of the point, so what holds at the corners of
//! a patch holds for all of it: which way a triangle looks, that two make a convex outline, that one hides another. A box
//! is one hexagon instead of a dozen triangles.

use glam::{DVec3, Vec3};
use std::cmp::Ordering;

/// Most corners of an outline.
pub const EDGES: usize = 8;
/// So far off, in proportion to its own size, a corner may be and count as on the line.
const FLAT: f64 = 1e-6;

/// Something convex that is in the way, as some points see it: a triangle, or several; without what is behind the lamp's plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blocker {
    pub(super) corners: [Vec3; EDGES],
    pub(super) count: usize,
    /// It goes around counterclockwise as seen from wherever it is asked about.
    pub(super) turned: bool,
}

impl Blocker {
    /// Some order, the same however they were found.
    #[must_use]
    pub fn order(&self, other: &Self) -> Ordering {
        let [these, others] = [self, other].map(|blocker| blocker.corners.map(|p| p.to_array()));
        let pairs = these.as_flattened().iter().zip(others.as_flattened());
        pairs.map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    }

    /// What of the triangle is above the plane through `on` with `normal` by more than `tolerance`, in units of both; `None`
    /// if nothing is.
    #[must_use]
    pub fn new(triangle: &[Vec3; 3], on: Vec3, normal: Vec3, tolerance: f32) -> Option<Self> {
        // In double precision, and corners that stay keep all their digits: a thousandth above the floor they count.
        let heights = triangle.map(|p| {
            let height = normal.as_dvec3().dot(p.as_dvec3() - on.as_dvec3());
            // What is cut off by a hair would be a corner twice, and the plane through that edge nothing.
            if height.abs() <= f64::from(tolerance) { 0.0 } else { height }
        });
        if heights.iter().all(|height| *height <= 0.0) {
            return None;
        }
        let mut out = Self { corners: [Vec3::ZERO; EDGES], count: 0, turned: false };
        for i in 0..3 {
            let next = (i + 1) % 3;
            if heights[i] >= 0.0 {
                out.push(triangle[i]);
            }
            if heights[i] * heights[next] < 0.0 {
                // The same point whichever way a neighbour goes along the edge.
                let (up, down) = if heights[i] > 0.0 { (i, next) } else { (next, i) };
                let part = heights[up] / (heights[up] - heights[down]);
                out.push(triangle[up].as_dvec3().lerp(triangle[down].as_dvec3(), part).as_vec3());
            }
        }
        (out.count > 2).then_some(out)
    }

    /// Its corners, around it.
    #[inline]
    pub(super) fn corners(&self) -> &[Vec3] {
        &self.corners[..self.count]
    }

    /// Not twice: an edge has a length.
    fn push(&mut self, corner: Vec3) {
        if self.count < EDGES && !self.corners().contains(&corner) {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    /// From one corner to the next.
    fn edges(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        let corners = self.corners();
        corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
    }

    /// Turned so that it goes around counterclockwise as seen from all of `patch`; `None` if some points see its back.
    fn turned(mut self, patch: &[DVec3]) -> Option<Self> {
        let sides = patch.iter().map(|p| self.side(*p));
        if sides.clone().all(|side| side < 0.0) {
            self.corners[..self.count].reverse();
        } else if !sides.clone().all(|side| side > 0.0) {
            return None;
        }
        self.turned = true;
        Some(self)
    }

    /// Positive where it looks counterclockwise, if it is convex; by all of its corners, for some may be close together.
    pub(super) fn side(&self, from: DVec3) -> f64 {
        let corners = self.corners();
        corners.windows(2).map(|pair| side(from, corners[0], pair[0], pair[1])).sum()
    }

    /// Whether no corner of `other` is outside of it, as seen from any point of `patch`, from which both look
    /// counterclockwise.
    fn covers(&self, other: &Self, patch: &[DVec3]) -> bool {
        self.edges().all(|(a, b)| {
            other.corners().iter().all(|&c| {
                c == a
                    || c == b
                    || patch.iter().all(|&p| {
                        let side = side(p, a, b, c);
                        side >= 0.0 || -side <= FLAT * f64::from(a.distance(c)) * area(p, a, b)
                    })
            })
        })
    }

    /// Whether they have an edge in common, on either side of which they are.
    fn touches(&self, other: &Self) -> bool {
        self.edges().any(|(a, b)| other.edges().any(|edge| edge == (b, a)))
    }

    /// All in one, if what is around those, who hang together and go around counterclockwise, looks convex from all of `patch`.
    ///
    /// A convex rim once around, parts of one orientation, none with a corner outside: they cover the inside, each place once.
    fn around(parts: &[Self], patch: &[DVec3]) -> Option<Self> {
        let edges = || parts.iter().flat_map(Self::edges);
        let mut rim: Vec<_> = edges().filter(|&(a, b)| !edges().any(|edge| edge == (b, a))).collect();
        if !(3..=EDGES).contains(&rim.len()) {
            return None;
        }
        let length = rim.len();
        let mut out = Self { corners: [Vec3::ZERO; EDGES], count: 0, turned: true };
        let (first, mut end) = rim.swap_remove(0);
        out.push(first);
        while let Some(next) = rim.iter().position(|edge| edge.0 == end) {
            out.push(end);
            end = rim.swap_remove(next).1;
        }
        // Each corner once.
        let is_simple = rim.is_empty() && end == first && out.count == length;
        let is_convex = is_simple && out.covers(&out, patch);
        (is_convex && parts.iter().all(|part| out.covers(part, patch))).then_some(out)
    }
}

/// On which side of the plane through `p`, `a` and `b` `c` is: linear in each of them.
fn side(p: DVec3, a: Vec3, b: Vec3, c: Vec3) -> f64 {
    (a.as_dvec3() - p).cross(b.as_dvec3() - p).dot(c.as_dvec3() - p)
}

fn area(p: DVec3, a: Vec3, b: Vec3) -> f64 {
    (a.as_dvec3() - p).cross(b.as_dvec3() - p).length()
}

/// Makes fewer of those from number `first` on, which hide the same from every point of `patch`, by its corners.
pub fn simplify(blockers: &mut Vec<Blocker>, first: usize, patch: &[DVec3]) {
    let mut outlines = Vec::with_capacity(blockers.len() - first);
    let mut others = Vec::new();
    for blocker in blockers.drain(first..) {
        match blocker.turned(patch) {
            Some(outline) => outlines.push(outline),
            None => others.push(blocker),
        }
    }
    // Whole bodies first: of three faces that meet in a corner no two look convex.
    let mut merged = Vec::new();
    while let Some(part) = outlines.pop() {
        let mut body = vec![part];
        let mut i = 0;
        while i < body.len() {
            let (near, far) = outlines.into_iter().partition(|other| body[i].touches(other));
            body.extend::<Vec<_>>(near);
            outlines = far;
            i += 1;
        }
        match Blocker::around(&body, patch) {
            Some(outline) => merged.push(outline),
            None => merge_pairs(body, patch, &mut merged),
        }
    }
    let mut outlines = merged;
    let mut i = 0;
    while i < outlines.len() {
        // The same outline from front and back, or what is behind another.
        if (0..outlines.len()).any(|k| k != i && outlines[k].covers(&outlines[i], patch)) {
            outlines.swap_remove(i);
        } else {
            i += 1;
        }
    }
    blockers.append(&mut outlines);
    blockers.append(&mut others);
}

/// Merges any two that can be, as long as there are some.
fn merge_pairs(mut parts: Vec<Blocker>, patch: &[DVec3], out: &mut Vec<Blocker>) {
    while let Some(mut part) = parts.pop() {
        let mut i = 0;
        while i < parts.len() {
            let pair = [part, parts[i]];
            match if part.touches(&pair[1]) { Blocker::around(&pair, patch) } else { None } {
                Some(merged) => {
                    part = merged;
                    parts.swap_remove(i);
                    i = 0;
                }
                None => i += 1,
            }
        }
        out.push(part);
    }
}
