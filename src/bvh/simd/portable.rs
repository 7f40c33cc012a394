//! Vectors that every machine has: plain floats, and four at a time through `glam`, which is SSE2 on
//! x86 and NEON on ARM. Wider ones are pairs of narrower ones. No unsafe code.

use super::{Lanes, Mask, Octet, Part, Simd};
use glam::{BVec4A, Vec4};
use std::ops::{Add, Div, Mul, Sub};

/// One float at a time: the reference for all others.
#[derive(Clone, Copy, Debug)]
pub struct Plain;

/// Four floats at a time: SSE2, NEON.
#[derive(Clone, Copy, Debug)]
pub struct Narrow;

impl Simd for Plain {
    type F8 = Pair<Pair<Pair<One>>>;
    type F16 = Pair<Self::F8>;

    #[inline(never)]
    fn call<P: Part<Self>>(self, part: P) -> P::Output {
        part.run(self)
    }
}

impl Simd for Narrow {
    type F8 = Pair<Four>;
    type F16 = Pair<Self::F8>;

    #[inline(never)]
    fn call<P: Part<Self>>(self, part: P) -> P::Output {
        part.run(self)
    }
}

/// A single float.
#[derive(Clone, Copy, Debug)]
pub struct One(f32);

/// Four floats.
#[derive(Clone, Copy, Debug)]
pub struct Four(Vec4);

/// Twice as many lanes.
#[derive(Clone, Copy, Debug)]
pub struct Pair<T>(pub(super) T, pub(super) T);

impl One {
    /// The float.
    #[inline(always)]
    pub fn get(self) -> f32 {
        self.0
    }
}

macro_rules! operators {
    ($($trait:ident $method:ident),*) => {$(
        impl $trait for One {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self($trait::$method(self.0, other.0))
            }
        }
        impl $trait for Four {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self($trait::$method(self.0, other.0))
            }
        }
        impl<T: $trait<Output = T>> $trait for Pair<T> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self($trait::$method(self.0, other.0), $trait::$method(self.1, other.1))
            }
        }
    )*};
}
operators!(Add add, Sub sub, Mul mul, Div div);

impl Mask for bool {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self & other
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self | other
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

impl Lanes for One {
    const N: usize = 1;
    type Proof = Plain;
    type Mask = bool;

    #[inline(always)]
    fn splat(_: Plain, x: f32) -> Self {
        Self(x)
    }
    #[inline(always)]
    fn load(_: Plain, from: &[f32]) -> Self {
        Self(from[0])
    }
    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        to[0] = self.0;
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(if self.0 < other.0 { self.0 } else { other.0 })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(if self.0 > other.0 { self.0 } else { other.0 })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self.0 <= other.0
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self.0 < other.0
    }
    #[inline(always)]
    fn eq(self, other: Self) -> bool {
        self.0 == other.0
    }
    #[inline(always)]
    fn lowest(self) -> f32 {
        self.0
    }
    #[inline(always)]
    fn highest(self) -> f32 {
        self.0
    }
    #[inline(always)]
    fn signs(self) -> u32 {
        u32::from(self.0.is_sign_negative())
    }
    #[inline(always)]
    fn select(bits: u32, a: Self, b: Self) -> Self {
        if bits & 1 != 0 { a } else { b }
    }
}

impl Mask for BVec4A {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self & other
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self | other
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        self.bitmask()
    }
}

impl Lanes for Four {
    const N: usize = 4;
    type Proof = Narrow;
    type Mask = BVec4A;

    #[inline(always)]
    fn splat(_: Narrow, x: f32) -> Self {
        Self(Vec4::splat(x))
    }
    #[inline(always)]
    fn load(_: Narrow, from: &[f32]) -> Self {
        Self(Vec4::from_slice(from))
    }
    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        self.0.write_to_slice(to);
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0))
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn le(self, other: Self) -> BVec4A {
        self.0.cmple(other.0)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> BVec4A {
        self.0.cmplt(other.0)
    }
    #[inline(always)]
    fn eq(self, other: Self) -> BVec4A {
        self.0.cmpeq(other.0)
    }
    #[inline(always)]
    fn lowest(self) -> f32 {
        self.0.min_element()
    }
    #[inline(always)]
    fn highest(self) -> f32 {
        self.0.max_element()
    }
    #[inline(always)]
    fn signs(self) -> u32 {
        self.0.is_negative_bitmask()
    }
    #[inline(always)]
    fn select(bits: u32, a: Self, b: Self) -> Self {
        let lane = |i: u32| bits >> i & 1 != 0;
        Self(Vec4::select(BVec4A::new(lane(0), lane(1), lane(2), lane(3)), a.0, b.0))
    }
}

/// Truth values of a [`Pair`] whose halves have `N` lanes each.
#[derive(Clone, Copy, Debug)]
pub struct PairMask<M, const N: usize>(pub(super) M, pub(super) M);

impl<M: Mask, const N: usize> Mask for PairMask<M, N> {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0.and(other.0), self.1.and(other.1))
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(self.0.or(other.0), self.1.or(other.1))
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.bits() | self.1.bits() << N
    }
}

macro_rules! pair_lanes {
    ($half:ty, $n:literal) => {
        impl Lanes for Pair<$half> {
            const N: usize = 2 * $n;
            type Proof = <$half as Lanes>::Proof;
            type Mask = PairMask<<$half as Lanes>::Mask, $n>;

            #[inline(always)]
            fn splat(proof: Self::Proof, x: f32) -> Self {
                Self(<$half>::splat(proof, x), <$half>::splat(proof, x))
            }
            #[inline(always)]
            fn load(proof: Self::Proof, from: &[f32]) -> Self {
                Self(<$half>::load(proof, from), <$half>::load(proof, &from[$n..]))
            }
            #[inline(always)]
            fn store(self, to: &mut [f32]) {
                self.0.store(to);
                self.1.store(&mut to[$n..]);
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self(self.0.min(other.0), self.1.min(other.1))
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self(self.0.max(other.0), self.1.max(other.1))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.0.abs(), self.1.abs())
            }
            #[inline(always)]
            fn le(self, other: Self) -> Self::Mask {
                PairMask(self.0.le(other.0), self.1.le(other.1))
            }
            #[inline(always)]
            fn lt(self, other: Self) -> Self::Mask {
                PairMask(self.0.lt(other.0), self.1.lt(other.1))
            }
            #[inline(always)]
            fn eq(self, other: Self) -> Self::Mask {
                PairMask(self.0.eq(other.0), self.1.eq(other.1))
            }
            #[inline(always)]
            fn lowest(self) -> f32 {
                self.0.min(self.1).lowest()
            }
            #[inline(always)]
            fn highest(self) -> f32 {
                self.0.max(self.1).highest()
            }
            #[inline(always)]
            fn signs(self) -> u32 {
                self.0.signs() | self.1.signs() << $n
            }
            #[inline(always)]
            fn select(bits: u32, a: Self, b: Self) -> Self {
                Self(<$half>::select(bits, a.0, b.0), <$half>::select(bits >> $n, a.1, b.1))
            }
        }
    };
}
#[cfg(target_arch = "x86_64")]
pub(super) use pair_lanes;

pair_lanes!(One, 1);
pair_lanes!(Pair<One>, 2);
pair_lanes!(Pair<Pair<One>>, 4);
pair_lanes!(Pair<Pair<Pair<One>>>, 8);
pair_lanes!(Four, 4);
pair_lanes!(Pair<Four>, 8);

/// For machines that cannot compress a vector: child by child.
macro_rules! octet_one_by_one {
    ($f8:ty) => {
        impl Octet for $f8 {
            #[inline(always)]
            fn push_entered(
                near: Self,
                far: Self,
                order: u32,
                children: &[u32; 8],
                nears: &mut [f32; 8],
                waiting: &mut [u32; 8],
            ) -> usize {
                let entered = near.le(far).bits();
                let mut distances = [0.0; 8];
                near.store(&mut distances);
                let mut count = 0;
                for i in 0..8 {
                    let child = (order >> (3 * i) & 7) as usize;
                    if entered >> child & 1 != 0 {
                        nears[count] = distances[child];
                        waiting[count] = children[child];
                        count += 1;
                    }
                }
                count
            }
        }
    };
}
octet_one_by_one!(Pair<Pair<Pair<One>>>);
octet_one_by_one!(Pair<Four>);
