//! The part of a lamp that a point sees past a few outlines, exactly: penumbrae without noise.
//!
//! The lamp's parallelogram is cut along the planes through the point and each outline's edges; what is inside of all
//! of an outline's planes is hidden: what there is of one is subtracted. What more leave are convex pieces, each with Lambert's closed form. This is K. Weiler
//! and P. Atherton's "Hidden Surface Removal Using Polygon Area Sorting", SIGGRAPH 1977, with lamps for surfaces, as
//! T. Nishita and E. Nakamae used it for shadows, "Continuous Tone Representation of Three-Dimensional Objects Taking
//! Account of Shadows and Interreflection", 1985.

use super::block::{Block, LANES};
use super::blocker::{Blocker, EDGES};
use super::quad::{Quad, angle_over_sine};
use crate::bvh::simd::{Job, Simd};
use glam::Vec3;

/// Most corners of a piece: four, and at most one more for each plane that cut it: two horizons and those of one blocker.
const CORNERS: usize = 6 + EDGES;
/// So many pieces may come of one lamp at one point.
const PIECES: u32 = 64;
/// What of the whole lamp's irradiance cuts may leave of nothing: 2⁻²³ for each of some corners.
const ROUNDING: f32 = 1e-6;
/// Irradiance above this is more than that in any case.
const FAINT: f32 = 4e-6;

/// A convex polygon as seen from a point, by its corners relative to it.
#[derive(Clone, Copy)]
struct Piece {
    corners: [Vec3; CORNERS],
    count: usize,
}

/// Irradiance at `point` with the first of `normals` from radiance 1 of what of `quad` is above both horizons and behind
/// none of those `blockers` whose bits are set in `which`. `None` if it would be in too many pieces.
#[must_use]
pub fn irradiance(
    quad: &Quad,
    point: Vec3,
    normals: [Vec3; 2],
    blockers: &[Blocker],
    which: u32,
) -> Option<f32> {
    let [normal, geometric] = normals;
    let mut piece = Piece { count: 4, ..Piece::EMPTY };
    for (to, corner) in piece.corners.iter_mut().zip(quad.corners()) {
        *to = corner - point;
    }
    let mut budget = PIECES;
    piece = piece.inside(normal);
    if geometric != normal {
        piece = piece.inside(geometric);
    }
    let whole = || {
        // To the bit what it is where nobody asks.
        let all_above = quad.is_above(point, normal) && quad.is_above(point, geometric);
        if all_above { quad.irradiance(point, normal).abs() } else { piece.irradiance(normal).abs() }
    };
    let mut planes = [[Vec3::ZERO; EDGES]; 2];
    let mut cutting = (0..blockers.len()).filter(|&i| which >> i & 1 == 1);
    let Some(first) = cutting.find(|&i| blockers[i].reaches(&piece, point, &mut planes[0])) else {
        return Some(whole());
    };
    let sum = if cutting.any(|i| blockers[i].reaches(&piece, point, &mut planes[1])) {
        seen(piece, normal, point, blockers, which & (u32::MAX << first), &mut budget).abs()
    } else {
        // Of the same formula: where all is hidden, nothing is left.
        piece.irradiance(normal).abs() - hidden(piece, normal, &planes[0][..blockers[first].count])
    };
    // Where blockers hide all of it by a hair, cutting leaves slivers of nothing but rounding.
    let is_dark = sum < FAINT && piece.count > 2 && sum <= ROUNDING * whole();
    (budget > 0).then_some(if is_dark { 0.0 } else { sum.max(0.0) })
}

/// From what of `piece` is inside of all of some planes.
fn hidden(mut piece: Piece, normal: Vec3, planes: &[Vec3]) -> f32 {
    for plane in planes {
        if !piece.is_inside(*plane) {
            piece = piece.inside(*plane);
        }
    }
    piece.irradiance(normal).abs()
}

/// From what of `piece` is behind none of `blockers`.
fn seen(
    mut piece: Piece,
    normal: Vec3,
    point: Vec3,
    blockers: &[Blocker],
    mut which: u32,
    budget: &mut u32,
) -> f32 {
    if piece.count < 3 || *budget == 0 {
        return 0.0;
    }
    while which != 0 {
        let blocker = &blockers[which.trailing_zeros() as usize];
        which &= which - 1;
        let mut planes = [Vec3::ZERO; EDGES];
        // Outside of one of them is out of its reach: most are.
        if !blocker.reaches(&piece, point, &mut planes) {
            continue;
        }
        let mut sum = 0.0;
        for plane in &planes[..blocker.count] {
            let (mut inside, mut outside) = (Piece::EMPTY, Piece::EMPTY);
            piece.split(*plane, &mut inside, &mut outside);
            if outside.count > 2 {
                piece = inside;
                *budget =
                    budget.saturating_sub(if outside.is_full() || piece.is_full() { PIECES } else { 1 });
                sum += seen(outside, normal, point, blockers, which, budget);
                if piece.count < 3 {
                    break;
                }
            }
        }
        // What is inside of all of them is hidden.
        return sum;
    }
    piece.irradiance(normal)
}

/// Which of some blockers may hide some of a lamp from each point of a block.
pub struct Reach<'a> {
    /// The points.
    pub block: &'a Block,
    /// The lamp.
    pub quad: &'a Quad,
    /// Fewer than 32.
    pub blockers: &'a [Blocker],
    /// A bit for each of them; all are set where one hides all of it.
    pub out: &'a mut [u32; LANES],
}

/// All of a lamp is hidden.
pub const HIDDEN: u32 = u32::MAX;

impl Job for Reach<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { block, quad, blockers, out } = self;
        let lamp = quad.corners();
        *out = [0; LANES];
        for (number, blocker) in (0..u32::BITS).zip(blockers) {
            let corners = blocker.corners();
            let mut sign = [1.0; LANES];
            if !blocker.turned {
                for (i, sign) in sign.iter_mut().enumerate() {
                    let point = block.position.get(i);
                    let mut side = 0.0;
                    for pair in corners.windows(2) {
                        side += (corners[0] - point).cross(pair[0] - point).dot(pair[1] - point);
                    }
                    *sign = if side > 0.0 { 1.0 } else { -1.0 };
                }
            }
            let (mut outside, mut inside) = ([false; LANES], [true; LANES]);
            for (k, &corner) in corners.iter().enumerate() {
                let next = corners[(k + 1) % corners.len()];
                for i in 0..LANES {
                    let point = block.position.get(i);
                    let (a, b) = (corner - point, next - point);
                    let lamp = [lamp[0] - point, lamp[1] - point, lamp[2] - point, lamp[3] - point];
                    let far = size(lamp[0]) + size(lamp[2]);
                    let (is_outside, is_inside) = sides(a.cross(b) * sign[i], size(a) * size(b) * far, &lamp);
                    outside[i] |= is_outside;
                    inside[i] &= is_inside;
                }
            }
            for i in 0..LANES {
                let bit = if outside[i] { 0 } else { 1 << number };
                out[i] |= if inside[i] & !outside[i] { HIDDEN } else { bit };
            }
        }
    }
}

/// Sum of the coordinates without sign: no less than the length, and sooner known.
#[inline(always)]
fn size(p: Vec3) -> f32 {
    p.x.abs() + p.y.abs() + p.z.abs()
}

/// Whether all of a lamp is surely outside of a plane, and whether all is surely inside, whatever the rounding, which is in
/// proportion to `scale`.
#[inline(always)]
fn sides(plane: Vec3, scale: f32, lamp: &[Vec3; 4]) -> (bool, bool) {
    let margin = scale * 1e-6;
    let (a, b, c, d) = (plane.dot(lamp[0]), plane.dot(lamp[1]), plane.dot(lamp[2]), plane.dot(lamp[3]));
    let outside = (a < -margin) & (b < -margin) & (c < -margin) & (d < -margin);
    (outside, (a > margin) & (b > margin) & (c > margin) & (d > margin))
}

impl Blocker {
    /// Whether it may hide some of the piece. Then `planes` are the inward normals of those through `point` and its
    /// edges.
    fn reaches(&self, piece: &Piece, point: Vec3, planes: &mut [Vec3; EDGES]) -> bool {
        // Close to an edge the plane through it would be mostly rounding in single precision.
        let point = point.as_dvec3();
        let corners = self.corners();
        let first = corners[0].as_dvec3() - point;
        let mut here = first;
        let side = if self.turned { 1.0 } else { self.side(point) };
        // Seen edge-on.
        if side == 0.0 {
            return false;
        }
        let sign = side.signum();
        for (i, plane) in planes[..self.count].iter_mut().enumerate() {
            let next = corners.get(i + 1).map_or(first, |p| p.as_dvec3() - point);
            *plane = (here.cross(next) * sign).as_vec3();
            if piece.is_outside(*plane) {
                return false;
            }
            here = next;
        }
        true
    }
}

impl Piece {
    const EMPTY: Self = Self { corners: [Vec3::ZERO; CORNERS], count: 0 };

    /// Whether no corner is inside.
    #[inline]
    fn is_outside(&self, plane: Vec3) -> bool {
        self.corners[..self.count].iter().all(|p| plane.dot(*p) <= 0.0)
    }

    /// Whether all corners are inside.
    #[inline]
    fn is_inside(&self, plane: Vec3) -> bool {
        self.corners[..self.count].iter().all(|p| plane.dot(*p) > 0.0)
    }

    /// What is on the side to which `plane`, a normal, points.
    fn inside(&self, plane: Vec3) -> Self {
        let (mut inside, mut outside) = (Self::EMPTY, Self::EMPTY);
        self.split(plane, &mut inside, &mut outside);
        inside
    }

    /// Adds what is on the side to which `plane`, a normal, points, and what is on the other, to two empty pieces. They
    /// have the corners in the plane in common.
    ///
    /// Reference: I. E. Sutherland, G. W. Hodgman, "Reentrant Polygon Clipping", CACM 17(1), 1974.
    fn split(&self, plane: Vec3, inside: &mut Self, outside: &mut Self) {
        let Some(&last) = self.corners[..self.count].last() else { return };
        let mut before = last;
        let mut height_before = plane.dot(before);
        for &here in &self.corners[..self.count] {
            let height = plane.dot(here);
            if (height > 0.0) != (height_before > 0.0) {
                let crossing = before + (here - before) * (height_before / (height_before - height));
                inside.push(crossing);
                outside.push(crossing);
            }
            if height > 0.0 {
                inside.push(here);
            } else {
                outside.push(here);
            }
            (before, height_before) = (here, height);
        }
    }

    /// Perhaps too many corners for it.
    fn is_full(&self) -> bool {
        self.count == CORNERS
    }

    fn push(&mut self, corner: Vec3) {
        if self.count < CORNERS {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    /// By the sum over its edges; its sign is that of the corners' sense of rotation.
    fn irradiance(&self, normal: Vec3) -> f32 {
        let corners = &self.corners[..self.count];
        let Some(&(mut before)) = corners.last() else { return 0.0 };
        let mut length_before = before.length();
        let mut sum = 0.0;
        for &here in corners {
            let length = here.length();
            let scale = 1.0 / (length_before * length);
            let cross = before.cross(here - before);
            sum += normal.dot(cross) * scale * angle_over_sine(before.dot(here) * scale);
            (before, length_before) = (here, length);
        }
        0.5 * sum
    }
}
