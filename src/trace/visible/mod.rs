//! The part of a lamp that a point sees past a few outlines, exactly: penumbrae without noise.
//!
//! The lamp's parallelogram is cut along the planes through the point and each outline's edges; what is inside of all
//! of an outline's planes is hidden: what there is of one is subtracted. What more leave are convex pieces, each with Lambert's closed form. This is K. Weiler
//! and P. Atherton's "Hidden Surface Removal Using Polygon Area Sorting", SIGGRAPH 1977, with lamps for surfaces, as
//! T. Nishita and E. Nakamae used it for shadows, "Continuous Tone Representation of Three-Dimensional Objects Taking
//! Account of Shadows and Interreflection", 1985.

mod piece;
mod reach;

pub use reach::{HIDDEN, Reach};

use super::blocker::{Blocker, EDGES};
use super::quad::Quad;
use glam::Vec3;
use piece::Piece;

/// So many pieces may come of one lamp at one point.
const PIECES: u32 = 64;
/// What of the whole lamp's irradiance cuts may leave of nothing: 2⁻²³ for each of some corners.
const ROUNDING: f32 = 1e-6;
/// Irradiance above this is more than that in any case.
const FAINT: f32 = 4e-6;

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
    let mut cut = Cut::EMPTY;
    let mut cutting =
        blockers.iter().zip(0..).filter(|(_, i)| which >> i & 1 == 1).map(|(blocker, _)| blocker);
    if !cutting.any(|blocker| cut.put(blocker, &piece, point)) {
        return Some(whole());
    }
    let mut second = Cut::EMPTY;
    let sum = if cutting.any(|blocker| second.put(blocker, &piece, point)) {
        seen_past_all(&piece, normal, point, [cut, second], cutting, &mut budget)?.abs()
    } else {
        // Of the same formula: where all is hidden, nothing is left.
        piece.irradiance(normal).abs() - cut.hidden(piece, normal)
    };
    // Where blockers hide all of it by a hair, cutting leaves slivers of nothing but rounding.
    let is_dark = sum < FAINT && piece.count > 2 && sum <= ROUNDING * whole();
    (budget > 0).then_some(if is_dark { 0.0 } else { sum.max(0.0) })
}

/// From what of `piece` is behind neither those two nor any of `others`; `None` if they are too many.
fn seen_past_all<'a>(
    piece: &Piece,
    normal: Vec3,
    point: Vec3,
    [first, second]: [Cut; 2],
    others: impl Iterator<Item = &'a Blocker>,
    budget: &mut u32,
) -> Option<f32> {
    let mut cuts = [Cut::EMPTY; MOST_CUTS];
    (cuts[0], cuts[1]) = (first, second);
    let mut count = 2;
    for blocker in others {
        if cuts.get_mut(count)?.put(blocker, piece, point) {
            count += 1;
        }
    }
    Some(seen(piece, normal, &cuts[..count], budget))
}

/// From what of `piece` is behind none of those that cut it.
fn seen(piece: &Piece, normal: Vec3, cuts: &[Cut], budget: &mut u32) -> f32 {
    if piece.count < 3 || *budget == 0 {
        return 0.0;
    }
    // Outside of one plane is out of its reach: most are.
    let reaches = |cut: &Cut| !cut.planes().iter().any(|plane| piece.is_outside(*plane));
    let Some(first) = cuts.iter().position(reaches) else { return piece.irradiance(normal) };
    let mut left = *piece;
    let mut sum = 0.0;
    for plane in cuts[first].planes() {
        if left.is_inside(*plane) {
            continue;
        }
        let (mut inside, mut outside) = (Piece::EMPTY, Piece::EMPTY);
        left.split(*plane, &mut inside, &mut outside);
        *budget = budget.saturating_sub(if outside.is_full() || inside.is_full() { PIECES } else { 1 });
        sum += seen(&outside, normal, &cuts[first + 1..], budget);
        left = inside;
        if left.count < 3 {
            break;
        }
    }
    // What is inside of all of them is hidden.
    sum
}

/// Blockers that cut a lamp as seen from one point: no more than that are dealt with.
const MOST_CUTS: usize = 8;

/// The planes through a point and a blocker's edges, by their inward normals.
#[derive(Clone, Copy)]
struct Cut {
    planes: [Vec3; EDGES],
    count: usize,
}

impl Cut {
    const EMPTY: Self = Self { planes: [Vec3::ZERO; EDGES], count: 0 };

    fn planes(&self) -> &[Vec3] {
        &self.planes[..self.count]
    }

    /// Becomes that of `blocker` as seen from `point`. False if surely it hides nothing of `piece`: then it is none.
    fn put(&mut self, blocker: &Blocker, piece: &Piece, point: Vec3) -> bool {
        // Close to an edge the plane through it would be mostly rounding in single precision.
        let point = point.as_dvec3();
        let corners = blocker.corners();
        let first = corners[0].as_dvec3() - point;
        let mut here = first;
        let side = if blocker.turned { 1.0 } else { blocker.side(point) };
        // Seen edge-on.
        if side == 0.0 {
            return false;
        }
        let sign = side.signum();
        self.count = corners.len();
        for (i, plane) in self.planes[..corners.len()].iter_mut().enumerate() {
            let next = corners.get(i + 1).map_or(first, |p| p.as_dvec3() - point);
            *plane = (here.cross(next) * sign).as_vec3();
            if piece.is_outside(*plane) {
                return false;
            }
            here = next;
        }
        true
    }

    /// From what of `piece` is inside of all planes.
    fn hidden(&self, mut piece: Piece, normal: Vec3) -> f32 {
        for plane in self.planes() {
            if !piece.is_inside(*plane) {
                piece = piece.inside(*plane);
            }
        }
        piece.irradiance(normal).abs()
    }
}
