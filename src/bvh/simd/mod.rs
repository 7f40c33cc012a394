//! The project's one unsafe room: vectors of `f32` for each instruction set, behind one safe trait.
//!
//! Kernels are written once, over [`Simd`], and compiled once for each instruction set by [`Isa::run`].
//! A vector can only be made from a *proof*, a value that exists only where the machine has been seen
//! to have the instructions. No operation here rounds otherwise than the same operation on single
//! floats (there is no fused multiply-add and no approximate reciprocal), so every kernel gives the
//! same bits.

#![expect(unsafe_code, reason = "instructions that not every machine has; see each block")]

mod isa;
mod portable;
#[cfg(target_arch = "x86_64")]
mod transpose;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use isa::{Isa, Job};
pub use portable::{Narrow, One, Plain};

use std::ops::{Add, Div, Mul, Sub};

/// `three!(|i| f(i))` is `[f(0), f(1), f(2)]`.
///
/// No closure: the compiler need not inline one that is called more than once, and what it does not inline
/// it compiles for the oldest machine, where every vector operation is then a call. So kernels have no
/// closures with vectors in them; `.ci/run` sees to it.
macro_rules! three {
    (|$i:ident| $value:expr) => {
        [
            {
                let $i = 0_usize;
                $value
            },
            {
                let $i = 1_usize;
                $value
            },
            {
                let $i = 2_usize;
                $value
            },
        ]
    };
}
pub(crate) use three;

/// An instruction set: its vector types, and (as a value) the proof that the machine has it.
pub trait Simd: Copy {
    /// Eight floats.
    type F8: Lanes<Proof = Self> + Octet;
    /// Sixteen floats.
    type F16: Lanes<Proof = Self>;

    /// Runs `part` as a function of its own, compiled for these instructions: where everything is inlined
    /// into one, the compiler runs out of registers.
    fn call<P: Part<Self>>(self, part: P) -> P::Output;
}

/// A part of a [`Job`], for one instruction set.
pub trait Part<S: Simd> {
    /// What comes out.
    type Output;
    /// Does it; `#[inline(always)]` as [`Job::run`].
    fn run(self, simd: S) -> Self::Output;
}

/// Some floats side by side. Nothing here is NaN, hence nothing is promised about NaN.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// How many.
    const N: usize;
    /// That they may be used.
    type Proof: Copy;
    /// A truth value for each.
    type Mask: Mask;

    /// The same in each lane.
    fn splat(proof: Self::Proof, x: f32) -> Self;
    /// The first of `from`, which must be at least as many.
    fn load(proof: Self::Proof, from: &[f32]) -> Self;
    /// Nine rows of `stride` floats, the corners' coordinates, in another order of the axes.
    ///
    /// # Panics
    /// Unless each row has as many floats behind its start.
    #[inline(always)]
    fn load_corners(proof: Self::Proof, rows: &[f32], stride: usize, axes: &[usize; 3]) -> [[Self; 3]; 3] {
        assert!(rows.len() >= 8 * stride + Self::N);
        three!(|corner| three!(|i| {
            let start = (3 * corner + axes[i] % 3) * stride;
            // SAFETY: at most 8 strides are in front of it, so that `N` floats are left, as asserted.
            Self::load(proof, unsafe { rows.get_unchecked(start..start + Self::N) })
        }))
    }
    /// Into the first of `to`, which must be at least as many.
    fn store(self, to: &mut [f32]);
    /// The smaller of each pair.
    fn min(self, other: Self) -> Self;
    /// The larger of each pair.
    fn max(self, other: Self) -> Self;
    /// Without sign.
    fn abs(self) -> Self;
    /// Less than or equal.
    fn le(self, other: Self) -> Self::Mask;
    /// Less than.
    fn lt(self, other: Self) -> Self::Mask;
    /// Equal.
    fn eq(self, other: Self) -> Self::Mask;
    /// The least of all.
    fn lowest(self) -> f32;
    /// The greatest of all.
    fn highest(self) -> f32;
    /// The sign bits, the first lane's lowest; set for -0 too.
    fn signs(self) -> u32;
    /// `a` where the bit is set, else `b`; the lowest bit is for the first lane.
    fn select(bits: u32, a: Self, b: Self) -> Self;
    /// The sum of each lane and all before it, of at most sixteen: always added in the same order, in steps of 1, 2, 4 and 8 lanes.
    #[inline(always)]
    fn running_sums(self, proof: Self::Proof) -> Self {
        let mut sums = [0.0; 16];
        self.store(&mut sums);
        let mut step = 1;
        while step < Self::N {
            let before = sums;
            for i in step..Self::N {
                sums[i] = before[i] + before[i - step];
            }
            step *= 2;
        }
        Self::load(proof, &sums)
    }
}

/// Truth values of [`Lanes`].
pub trait Mask: Copy {
    /// Both.
    fn and(self, other: Self) -> Self;
    /// At least one.
    fn or(self, other: Self) -> Self;
    /// As the lowest bits of a number, the first lane's the lowest.
    fn bits(self) -> u32;
}

/// What only vectors of eight are asked for: the children of a node, the triangles of a leaf.
pub trait Octet: Lanes {
    /// For each of nine coordinates a row of those of the `triangles`, nine floats each, that `ids` name, one to
    /// eight. What follows them in the rows is finite if they are.
    ///
    /// # Panics
    /// Without ids, or where there is no such triangle.
    #[inline(always)]
    fn gather(_: Self::Proof, triangles: &[f32], ids: &[u32]) -> [[f32; 8]; 9] {
        let mut rows = [[0.0; 8]; 9];
        for (lane, &id) in ids.iter().take(8).enumerate() {
            let triangle = &triangles[id as usize * 9..][..9];
            for (row, x) in rows.iter_mut().zip(triangle) {
                row[lane] = *x;
            }
        }
        rows
    }

    /// Puts the lanes of `near` for which `near` ≤ `far`, and their `children`, at the front of the
    /// stacks, in the order that the eight triples of bits of `order` name; returns how many. The
    /// stacks have room for eight, and may be left with anything beyond the ones counted.
    fn push_entered(
        near: Self,
        far: Self,
        order: u32,
        children: &[u32; 8],
        nears: &mut [f32; 8],
        waiting: &mut [u32; 8],
    ) -> usize;
}
