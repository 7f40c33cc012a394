//! Which outlines can hide anything of a lamp from which points: sixteen points at once, for sure.

use crate::bvh::simd::{Job, Lanes, Mask, Simd, three};
use crate::trace::block::{Block, LANES};
use crate::trace::blocker::Blocker;
use crate::trace::quad::Quad;
use glam::Vec3;
use std::ops::Range;

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
