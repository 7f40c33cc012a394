//! AVX2 and AVX-512.

use super::portable::{Pair, pair_lanes};
use super::transpose::{gather, of_four};
use super::{Lanes, Mask, Octet, Part, Simd, portable::PairMask};
use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

/// Proof of AVX2, POPCNT, BMI1 and BMI2.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

/// Proof of AVX-512 F, VL, DQ and BW, and of all that [`Avx2`] proves.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(());

impl Avx2 {
    /// If this machine has them.
    pub fn detect() -> Option<Self> {
        let has = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("popcnt")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt");
        has.then_some(Self(()))
    }
}

impl Avx512 {
    /// If this machine has them.
    pub fn detect() -> Option<Self> {
        let has = Avx2::detect().is_some()
            && is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512bw");
        has.then_some(Self(()))
    }
}

impl Simd for Avx2 {
    type F8 = Eight;
    type F16 = Pair<Eight>;

    #[inline(always)]
    fn call<P: Part<Self>>(self, part: P) -> P::Output {
        #[inline(never)]
        #[target_feature(enable = "avx2,popcnt,bmi1,bmi2,lzcnt")]
        fn with<P: Part<Avx2>>(simd: Avx2, part: P) -> P::Output {
            part.run(simd)
        }
        // SAFETY: an `Avx2` exists only where the instructions do.
        unsafe { with(self, part) }
    }
}

impl Simd for Avx512 {
    type F8 = EightVl;
    type F16 = Sixteen;

    #[inline(always)]
    fn call<P: Part<Self>>(self, part: P) -> P::Output {
        #[inline(never)]
        #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,popcnt,bmi1,bmi2,lzcnt")]
        fn with<P: Part<Avx512>>(simd: Avx512, part: P) -> P::Output {
            part.run(simd)
        }
        // SAFETY: an `Avx512` exists only where the instructions do.
        unsafe { with(self, part) }
    }
}

/// Eight floats with AVX2.
#[derive(Clone, Copy, Debug)]
pub struct Eight(__m256);

/// Eight floats with AVX-512 VL: truth values are bits.
#[derive(Clone, Copy, Debug)]
pub struct EightVl(__m256);

/// Sixteen floats with AVX-512.
#[derive(Clone, Copy, Debug)]
pub struct Sixteen(__m512);

/// Truth values of [`Eight`].
#[derive(Clone, Copy, Debug)]
pub struct EightMask(__m256);

macro_rules! operators {
    ($name:ident: $($trait:ident $method:ident $intrinsic:ident),*) => {$(
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: whoever has a vector had the proof that makes it.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    )*};
}
operators!(Eight: Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps);
operators!(EightVl: Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps);
operators!(Sixteen: Add add _mm512_add_ps, Sub sub _mm512_sub_ps, Mul mul _mm512_mul_ps, Div div _mm512_div_ps);

macro_rules! lanes {
    (
        $name:ident, $n:literal, $proof:ident, $mask:ident;
        $splat:ident $load:ident $store:ident $min:ident $max:ident $abs:expr, $lowest:expr, $highest:expr, $signs:expr;
        |$a:ident, $b:ident| $le:expr, $lt:expr, $eq:expr;
        |$bits:ident| $select:expr
        $(; running_sums $running_sums:expr)?
    ) => {
        impl Lanes for $name {
            const N: usize = $n;
            type Proof = $proof;
            type Mask = $mask;

            #[inline(always)]
            fn splat(_: $proof, x: f32) -> Self {
                // SAFETY: the caller has the proof.
                Self(unsafe { $splat(x) })
            }
            #[inline(always)]
            fn load(_: $proof, from: &[f32]) -> Self {
                let from = &from[..$n];
                // SAFETY: the caller has the proof, and `from` has as many floats; no alignment is needed.
                Self(unsafe { $load(from.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, to: &mut [f32]) {
                let to = &mut to[..$n];
                // SAFETY: the vector proves the instructions, and `to` has room; no alignment is needed.
                unsafe { $store(to.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                // SAFETY: whoever has a vector had the proof that makes it.
                Self(unsafe { $min(self.0, other.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // SAFETY: whoever has a vector had the proof that makes it.
                Self(unsafe { $max(self.0, other.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                let $a = self.0;
                // SAFETY: whoever has a vector had the proof that makes it.
                Self(unsafe { $abs })
            }
            #[inline(always)]
            fn le(self, other: Self) -> $mask {
                let ($a, $b) = (self.0, other.0);
                // SAFETY: whoever has a vector had the proof that makes it.
                unsafe { $le }
            }
            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                let ($a, $b) = (self.0, other.0);
                // SAFETY: whoever has a vector had the proof that makes it.
                unsafe { $lt }
            }
            #[inline(always)]
            fn eq(self, other: Self) -> $mask {
                let ($a, $b) = (self.0, other.0);
                // SAFETY: whoever has a vector had the proof that makes it.
                unsafe { $eq }
            }
            #[inline(always)]
            fn lowest(self) -> f32 {
                let $a = self.0;
                // SAFETY: whoever has a vector had the proof that makes it.
                unsafe { $lowest }
            }
            #[inline(always)]
            fn highest(self) -> f32 {
                let $a = self.0;
                // SAFETY: whoever has a vector had the proof that makes it.
                unsafe { $highest }
            }
            #[inline(always)]
            fn signs(self) -> u32 {
                let $a = self.0;
                // SAFETY: whoever has a vector had the proof that makes it.
                unsafe { $signs }
            }
            #[inline(always)]
            fn select($bits: u32, a: Self, b: Self) -> Self {
                let ($a, $b) = (a.0, b.0);
                // SAFETY: whoever has a vector had the proof that makes it.
                Self(unsafe { $select })
            }
            $(
                #[inline(always)]
                fn running_sums(self, _: $proof) -> Self {
                    let $a = self.0;
                    // SAFETY: whoever has a vector had the proof that makes it.
                    Self(unsafe { $running_sums })
                }
            )?
        }
    };
}

macro_rules! of_eight {
    ($op:ident, $a:expr) => {{
        let a = $op(_mm256_castps256_ps128($a), _mm256_extractf128_ps::<1>($a));
        let a = $op(a, _mm_movehl_ps(a, a));
        _mm_cvtss_f32($op(a, _mm_shuffle_ps::<1>(a, a)))
    }};
}

lanes!(
    Eight, 8, Avx2, EightMask;
    _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps _mm256_min_ps _mm256_max_ps
    _mm256_andnot_ps(_mm256_set1_ps(-0.0), a),
    of_eight!(_mm_min_ps, a), of_eight!(_mm_max_ps, a), _mm256_movemask_ps(a) as u32;
    |a, b|
    EightMask(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)),
    EightMask(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)),
    EightMask(_mm256_cmp_ps::<_CMP_EQ_OQ>(a, b));
    |bits| {
        let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        let set = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(bits as i32), lanes), lanes);
        _mm256_blendv_ps(b, a, _mm256_castsi256_ps(set))
    }
);
lanes!(
    EightVl, 8, Avx512, u8;
    _mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps _mm256_min_ps _mm256_max_ps
    _mm256_andnot_ps(_mm256_set1_ps(-0.0), a),
    of_eight!(_mm_min_ps, a), of_eight!(_mm_max_ps, a), _mm256_movemask_ps(a) as u32;
    |a, b|
    _mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b),
    _mm256_cmp_ps_mask::<_CMP_LT_OQ>(a, b),
    _mm256_cmp_ps_mask::<_CMP_EQ_OQ>(a, b);
    |bits| _mm256_mask_blend_ps(bits as u8, b, a)
);
/// Sixteen lanes moved up by 16 less so many, zeros below.
macro_rules! shifted {
    ($left:literal, $a:expr) => {
        _mm512_castsi512_ps(_mm512_alignr_epi32::<$left>(_mm512_castps_si512($a), _mm512_setzero_si512()))
    };
}

lanes!(
    Sixteen, 16, Avx512, u16;
    _mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps _mm512_min_ps _mm512_max_ps
    _mm512_abs_ps(a), _mm512_reduce_min_ps(a), _mm512_reduce_max_ps(a),
    u32::from(_mm512_movepi32_mask(_mm512_castps_si512(a)));
    |a, b|
    _mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b),
    _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b),
    _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a, b);
    |bits| _mm512_mask_blend_ps(bits as u16, b, a);
    running_sums {
        let a = _mm512_add_ps(a, shifted!(15, a));
        let a = _mm512_add_ps(a, shifted!(14, a));
        let a = _mm512_add_ps(a, shifted!(12, a));
        _mm512_add_ps(a, shifted!(8, a))
    }
);
pair_lanes!(Eight, 8);

impl Mask for EightMask {
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        // SAFETY: whoever has a mask had the vectors it comes from.
        Self(unsafe { _mm256_and_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        // SAFETY: whoever has a mask had the vectors it comes from.
        Self(unsafe { _mm256_or_ps(self.0, other.0) })
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: whoever has a mask had the vectors it comes from.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

macro_rules! bit_mask {
    ($name:ident) => {
        impl Mask for $name {
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
    };
}
bit_mask!(u8);
bit_mask!(u16);

/// Which lanes the set bits of a number are, each lane in a byte, the first lowest.
static COMPRESS: [u64; 256] = {
    let mut table = [0; 256];
    let mut bits = 0;
    while bits < 256 {
        let (mut lane, mut count) = (0, 0);
        while lane < 8 {
            if bits >> lane & 1 != 0 {
                table[bits] |= lane << (8 * count);
                count += 1;
            }
            lane += 1;
        }
        bits += 1;
    }
    table
};

/// The eight triples of bits of `order`, lowest first, one to a lane.
///
/// The upper bits of the lanes are not cleared: permutations look at the lowest three only. A macro, because
/// a function might be called instead of inlined.
macro_rules! order_lanes {
    ($order:expr) => {
        _mm256_srlv_epi32(_mm256_set1_epi32($order as i32), _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21))
    };
}

impl Octet for Eight {
    gather!();

    #[inline(always)]
    fn push_entered(
        near: Self,
        far: Self,
        order: u32,
        children: &[u32; 8],
        nears: &mut [f32; 8],
        waiting: &mut [u32; 8],
    ) -> usize {
        // SAFETY: the vectors prove AVX2; all pointers are to eight numbers and need no alignment.
        unsafe {
            let order = order_lanes!(order);
            let near_ordered = _mm256_permutevar8x32_ps(near.0, order);
            let entered = _mm256_cmp_ps::<_CMP_LE_OQ>(near.0, far.0);
            let entered = _mm256_permutevar8x32_ps(entered, order);
            let bits = _mm256_movemask_ps(entered) as usize;
            let front = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(COMPRESS[bits] as i64));
            let children = _mm256_loadu_si256(children.as_ptr().cast());
            let children = _mm256_permutevar8x32_epi32(_mm256_permutevar8x32_epi32(children, order), front);
            _mm256_storeu_ps(nears.as_mut_ptr(), _mm256_permutevar8x32_ps(near_ordered, front));
            _mm256_storeu_si256(waiting.as_mut_ptr().cast(), children);
            bits.count_ones() as usize
        }
    }
}

impl Octet for EightVl {
    gather!();

    #[inline(always)]
    fn push_entered(
        near: Self,
        far: Self,
        order: u32,
        children: &[u32; 8],
        nears: &mut [f32; 8],
        waiting: &mut [u32; 8],
    ) -> usize {
        // SAFETY: the vectors prove AVX-512 VL; all pointers are to eight numbers and need no alignment.
        unsafe {
            let order = order_lanes!(order);
            let near = _mm256_permutevar8x32_ps(near.0, order);
            let far = _mm256_permutevar8x32_ps(far.0, order);
            let entered = _mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far);
            let children = _mm256_loadu_si256(children.as_ptr().cast());
            let children = _mm256_permutevar8x32_epi32(children, order);
            _mm256_storeu_ps(nears.as_mut_ptr(), _mm256_maskz_compress_ps(entered, near));
            _mm256_storeu_si256(waiting.as_mut_ptr().cast(), _mm256_maskz_compress_epi32(entered, children));
            entered.count_ones() as usize
        }
    }
}
