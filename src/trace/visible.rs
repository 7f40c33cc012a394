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
use crate::bvh::simd::{Job, Lanes, Mask, Simd, three};
use glam::Vec3;
use std::ops::Range;

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

/// Which of some blockers may hide some of a lamp from some points of a block.
pub struct Reach<'a> {
    /// The points.
    pub block: &'a Block,
    /// Which of them.
    pub lanes: Range<usize>,
    /// The lamp.
    pub quad: &'a Quad,
    /// Fewer than 32.
    pub blockers: &'a [Blocker],
    /// A bit for each of them, for each point of `lanes`; all are set where one hides all of it. For other points it may be
    /// anything then.
    pub out: &'a mut [u32; LANES],
}

/// All of a lamp is hidden.
pub const HIDDEN: u32 = u32::MAX;

impl Job for Reach<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { block, lanes, quad, blockers, out } = self;
        for group in lanes.start / GROUP..lanes.end.div_ceil(GROUP) {
            let found = &mut out[group * GROUP..][..GROUP];
            found.fill(0);
            let from = Outlook::new(simd, block, group * GROUP, quad);
            for (number, blocker) in (0..u32::BITS).zip(blockers) {
                let Sides { outside, inside } = from.sides(simd, blocker);
                let mut touched = ALL & !outside;
                while touched != 0 {
                    let lane = touched.trailing_zeros();
                    touched &= touched - 1;
                    found[lane as usize] |= if inside >> lane & 1 == 1 { HIDDEN } else { 1 << number };
                }
            }
        }
    }
}

/// Points that are looked at together, and a bit for each.
const GROUP: usize = 16;
const ALL: u32 = (1 << GROUP) - 1;

/// A lamp as seen from some points.
struct Outlook<F> {
    point: [F; 3],
    /// Its corners, relative to them.
    lamp: [[F; 3]; 4],
    /// No less than the distance of any place on it.
    far: F,
}

/// For which points all of a lamp is outside of a blocker's edge, and for which it is inside of all.
struct Sides {
    outside: u32,
    inside: u32,
}

impl<F: Lanes> Outlook<F> {
    #[inline(always)]
    fn new<S: Simd<F16 = F>>(simd: S, block: &Block, first: usize, quad: &Quad) -> Self
    where
        F: Lanes<Proof = S>,
    {
        let point = three!(|axis| F::load(simd, &block.position.0[axis][first..]));
        let [a, b, c, d] = quad.corners();
        let a = minus(&corner(simd, a), &point);
        let b = minus(&corner(simd, b), &point);
        let c = minus(&corner(simd, c), &point);
        let d = minus(&corner(simd, d), &point);
        let far = (size(&a) + size(&c)).max(size(&b) + size(&d));
        Self { point, lamp: [a, b, c, d], far }
    }

    /// Sure whatever the rounding, which is in proportion to the lengths.
    #[inline(always)]
    fn sides<S: Simd<F16 = F>>(&self, simd: S, blocker: &Blocker) -> Sides
    where
        F: Lanes<Proof = S>,
    {
        let corners = blocker.corners();
        let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
        let minus_one = F::splat(simd, -1.0);
        let start = minus(&corner(simd, corners[0]), &self.point);
        let mut sign = one;
        if !blocker.turned {
            let mut side = zero;
            let mut before = start;
            for &next in &corners[1..] {
                let next = minus(&corner(simd, next), &self.point);
                side = side + dot(&cross(&start, &before), &next);
                before = next;
            }
            sign = F::select(zero.lt(side).bits(), one, minus_one);
        }
        let (mut outside, mut inside) = (0, ALL);
        let (mut from, mut size_from) = (start, size(&start));
        for k in 0..corners.len() {
            let to = match corners.get(k + 1) {
                Some(&next) => minus(&corner(simd, next), &self.point),
                None => start,
            };
            let size_to = size(&to);
            let plane = cross(&from, &to);
            let plane = three!(|axis| plane[axis] * sign);
            let margin = size_from * size_to * self.far * F::splat(simd, 1e-6);
            let [a, b, c, d] = &self.lamp;
            let (a, b, c, d) = (dot(&plane, a), dot(&plane, b), dot(&plane, c), dot(&plane, d));
            outside |= a.max(b).max(c.max(d)).lt(zero - margin).bits();
            inside &= margin.lt(a.min(b).min(c.min(d))).bits();
            if outside == ALL {
                break;
            }
            (from, size_from) = (to, size_to);
        }
        Sides { outside, inside }
    }
}

#[inline(always)]
fn corner<F: Lanes>(proof: F::Proof, p: Vec3) -> [F; 3] {
    three!(|axis| F::splat(proof, p[axis]))
}

#[inline(always)]
fn minus<F: Lanes>(a: &[F; 3], b: &[F; 3]) -> [F; 3] {
    three!(|axis| a[axis] - b[axis])
}

#[inline(always)]
fn dot<F: Lanes>(a: &[F; 3], b: &[F; 3]) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<F: Lanes>(a: &[F; 3], b: &[F; 3]) -> [F; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Sum of the coordinates without sign: no less than the length, and sooner known.
#[inline(always)]
fn size<F: Lanes>(p: &[F; 3]) -> F {
    p[0].abs() + p[1].abs() + p[2].abs()
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
