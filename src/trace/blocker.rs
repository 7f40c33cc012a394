//! What is in the way of a lamp, as polygons that look convex: few edges to cut by.
//!
//! Whether a point is on one side of the plane of a triangle is a linear function of the point, so what holds at the corners of
//! a patch holds for all of it: which way a triangle looks, that two make a convex outline, that one hides another. A box
//! is one hexagon instead of a dozen triangles.

use glam::{DVec3, Vec3};

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
    /// What of the triangle is above the plane through `on` with `normal` by more than `tolerance`, in units of both; `None`
    /// if nothing is.
    #[must_use]
    pub fn new(triangle: &[Vec3; 3], on: Vec3, normal: Vec3, tolerance: f32) -> Option<Self> {
        // In double precision, and corners that stay keep all their digits: a thousandth above the floor they count.
        let height = |p: Vec3| normal.as_dvec3().dot(p.as_dvec3() - on.as_dvec3());
        if !triangle.iter().any(|p| height(*p) > f64::from(tolerance)) {
            return None;
        }
        let mut out = Self { corners: [Vec3::ZERO; EDGES], count: 0, turned: false };
        for i in 0..3 {
            let (here, next) = (triangle[i], triangle[(i + 1) % 3]);
            let (above, above_next) = (height(here), height(next));
            if above > 0.0 {
                out.push(here);
            }
            if (above > 0.0) != (above_next > 0.0) {
                // The same point whichever way a neighbour goes along the edge.
                let (up, down) = if above > 0.0 { (here, next) } else { (next, here) };
                let (high, low) = (above.max(above_next), above.min(above_next));
                out.push(up.as_dvec3().lerp(down.as_dvec3(), high / (high - low)).as_vec3());
            }
        }
        (out.count > 2).then_some(out)
    }

    /// Its corners, around it.
    #[inline]
    pub(super) fn corners(&self) -> &[Vec3] {
        &self.corners[..self.count]
    }

    fn push(&mut self, corner: Vec3) {
        if self.count < EDGES {
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
        let (a, b, c) = (self.corners[0], self.corners[1], self.corners[2]);
        let sides = patch.iter().map(|p| side(*p, a, b, c));
        if sides.clone().all(|side| side < 0.0) {
            self.corners[..self.count].reverse();
        } else if !sides.clone().all(|side| side > 0.0) {
            return None;
        }
        self.turned = true;
        Some(self)
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

    /// Both in one, if they have an edge in common and look convex from all of `patch`.
    fn merged(&self, other: &Self, patch: &[DVec3]) -> Option<Self> {
        let (here, there) = (self.corners(), other.corners());
        let total = here.len() + there.len() - 2;
        if total > EDGES {
            return None;
        }
        let (i, j) = (0..here.len()).find_map(|i| {
            let edge = (here[(i + 1) % here.len()], here[i]);
            (0..there.len()).find(|&j| (there[j], there[(j + 1) % there.len()]) == edge).map(|j| (i, j))
        })?;
        let mut out = Self { corners: [Vec3::ZERO; EDGES], count: 0, turned: true };
        // All of this one from behind the edge on; then what of the other one is not on it.
        (1..=here.len()).for_each(|k| out.push(here[(i + k) % here.len()]));
        (2..there.len()).for_each(|k| out.push(there[(j + k) % there.len()]));
        let is_simple = (0..total).all(|k| !out.corners[..k].contains(&out.corners[k]));
        (is_simple && out.covers(&out, patch)).then_some(out)
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
    let mut i = 0;
    while i < outlines.len() {
        let grown = (0..outlines.len())
            .filter(|&k| k != i)
            .find_map(|k| Some((k, outlines[i].merged(&outlines[k], patch)?)));
        match grown {
            Some((k, merged)) => {
                outlines[i] = merged;
                outlines.swap_remove(k);
                i = 0;
            }
            None => i += 1,
        }
    }
    let mut i = 0;
    while i < outlines.len() {
        if (0..outlines.len()).any(|k| k != i && outlines[k].covers(&outlines[i], patch)) {
            outlines.swap_remove(i);
        } else {
            i += 1;
        }
    }
    blockers.append(&mut outlines);
    blockers.append(&mut others);
}
