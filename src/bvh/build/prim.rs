//! Boxes on their way through the builder.

use crate::bvh::Aabb;
use glam::{Vec3, Vec4, Vec4Swizzles};

/// A box to be sorted: the lower corner and the index in one vector, the upper corner in the other.
#[derive(Clone, Copy, Debug, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Prim {
    pub lo: Vec4,
    pub hi: Vec4,
}

/// Makes an index below 2²⁸ an ordinary float, so that vectors it is part of are not slowed down by a
/// denormal one.
const INDEX_MARK: u32 = 0x4000_0000;

/// A box around prims or their centres. The fourth components mean nothing.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    pub lo: Vec4,
    pub hi: Vec4,
}

impl Prim {
    #[inline]
    pub fn new(aabb: Aabb, index: u32) -> Self {
        debug_assert!(index < INDEX_MARK >> 2);
        Self { lo: aabb.min.extend(f32::from_bits(INDEX_MARK | index)), hi: aabb.max.extend(0.0) }
    }

    /// What takes the place of something without a surface.
    pub const NOTHING: Self = Self { lo: Vec4::NAN, hi: Vec4::NAN };

    /// Whether there is something.
    #[inline]
    pub fn is_some(&self) -> bool {
        self.hi.w == 0.0
    }

    #[inline]
    pub fn aabb(&self) -> Aabb {
        Aabb { min: self.lo.xyz(), max: self.hi.xyz() }
    }

    #[inline]
    pub fn index(&self) -> u32 {
        self.lo.w.to_bits() & !INDEX_MARK
    }

    /// Half its surface.
    #[inline]
    pub fn half_area(&self) -> f32 {
        half_area(self.lo, self.hi)
    }

    #[inline]
    pub fn center(&self) -> Vec4 {
        self.lo * 0.5 + self.hi * 0.5
    }
}

impl Extent {
    pub const EMPTY: Self = Self { lo: Vec4::INFINITY, hi: Vec4::NEG_INFINITY };

    #[inline]
    pub fn with(self, prim: &Prim) -> Self {
        Self { lo: self.lo.min(prim.lo), hi: self.hi.max(prim.hi) }
    }

    #[inline]
    pub fn add(&mut self, prim: &Prim) {
        *self = self.with(prim);
    }

    /// Half its surface, 0 if it is empty.
    #[inline]
    pub fn half_area(&self) -> f32 {
        half_area(self.lo, self.hi)
    }

    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    #[inline]
    pub fn intersection(&self, other: &Self) -> Self {
        Self { lo: self.lo.max(other.lo), hi: self.hi.min(other.hi) }
    }

    /// Around `prims`.
    #[inline]
    pub fn of(prims: &[Prim]) -> Self {
        prims.iter().fold(Self::EMPTY, Self::with)
    }

    /// Around the centres of `prims`.
    #[inline]
    pub fn of_centers(prims: &[Prim]) -> Self {
        prims
            .iter()
            .map(Prim::center)
            .fold(Self::EMPTY, |Self { lo, hi }, center| Self { lo: lo.min(center), hi: hi.max(center) })
    }
}

/// Of the box between two corners, 0 for an empty one.
#[inline]
fn half_area(lo: Vec4, hi: Vec4) -> f32 {
    let d: Vec3 = (hi - lo).xyz().max(Vec3::ZERO);
    d.x * d.y + d.y * d.z + d.z * d.x
}
