//! Rays side by side, and which of them may share a packet.

use super::Ray;
use super::simd::{Lanes, Mask, Simd, three};
use glam::Vec3;

/// Most rays of a packet.
pub(super) const PACKET: usize = 64;
/// Rays that are tested with one vector.
pub(super) const GROUP: usize = 16;

/// One float for each ray.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Row(pub [f32; PACKET]);

impl Row {
    #[inline(always)]
    pub fn get<V: Lanes>(&self, proof: V::Proof, group: usize) -> V {
        let from = group % (PACKET / GROUP) * GROUP;
        V::load(proof, &self.0[from..from + GROUP])
    }

    #[inline(always)]
    pub fn set<V: Lanes>(&mut self, group: usize, lanes: V) {
        let from = group % (PACKET / GROUP) * GROUP;
        lanes.store(&mut self.0[from..from + GROUP]);
    }
}

/// Up to 64 rays. What is beyond the last repeats it, but wants nothing.
#[derive(Clone, Debug)]
pub(super) struct Rays {
    pub origin: [Row; 3],
    pub direction: [Row; 3],
    /// What is still wanted of each ray.
    pub t_max: Row,
}

impl Rays {
    pub fn blank() -> Self {
        let row = [Row([0.0; PACKET]); 3];
        Self { origin: row, direction: row, t_max: row[0] }
    }

    /// Takes `count` rays.
    #[inline(always)]
    pub fn load(&mut self, count: usize, ray: impl Fn(usize) -> Ray) {
        for lane in 0..count {
            self.set(lane, &ray(lane));
        }
        self.pad(count);
    }

    /// Takes the given ones of others.
    #[inline(always)]
    pub fn gather(&mut self, others: &Self, lanes: u64) {
        let mut count = 0;
        for lane in each(lanes) {
            self.set(count, &others.get(lane));
            count += 1;
        }
        self.pad(count);
    }

    #[inline(always)]
    fn pad(&mut self, count: usize) {
        let last = Ray { t_max: 0.0, ..self.get(count - 1) };
        for lane in count..count.next_multiple_of(GROUP) {
            self.set(lane, &last);
        }
    }

    #[inline(always)]
    fn set(&mut self, lane: usize, ray: &Ray) {
        let lane = lane % PACKET;
        for axis in 0..3 {
            self.origin[axis].0[lane] = ray.origin[axis];
            self.direction[axis].0[lane] = ray.direction[axis];
        }
        self.t_max.0[lane] = ray.t_max;
    }

    /// One of the rays, as far as it is still wanted.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Ray {
        let lane = lane % PACKET;
        let vec = |rows: &[Row; 3]| Vec3::new(rows[0].0[lane], rows[1].0[lane], rows[2].0[lane]);
        Ray { origin: vec(&self.origin), direction: vec(&self.direction), t_max: self.t_max.0[lane] }
    }

    /// Parts the first `count` rays into classes.
    #[inline(always)]
    pub fn classes<S: Simd>(&self, simd: S, count: usize) -> Classes {
        let mut classes = Classes { rest: lowest(count), negative: [0; 3], largest: [0; 3] };
        for group in 0..count.div_ceil(GROUP) {
            let [x, y, z]: [S::F16; 3] = three!(|axis| self.direction[axis].get(simd, group));
            let shift = group * GROUP;
            for (negative, row) in classes.negative.iter_mut().zip([x, y, z]) {
                *negative |= u64::from(row.signs()) << shift;
            }
            // As `largest_axis`: the first of equals.
            let [x, y, z] = [x.abs(), y.abs(), z.abs()];
            let is_z = x.lt(z).and(y.lt(z)).bits();
            let is_y = x.lt(y).bits() & !is_z;
            classes.largest[1] |= u64::from(is_y) << shift;
            classes.largest[2] |= u64::from(is_z) << shift;
        }
        classes.largest[0] = !(classes.largest[1] | classes.largest[2]);
        classes
    }
}

/// The lowest `count` bits.
pub(super) fn lowest(count: usize) -> u64 {
    if count >= 64 { u64::MAX } else { (1 << count) - 1 }
}

/// The numbers of the set bits.
#[inline(always)]
pub(super) fn each(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
        bits &= bits - 1;
        Some(lane)
    })
}

/// What rays must have in common to share a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Class {
    /// Bit 0: x is negative, bit 1: y, bit 2: z.
    pub octant: usize,
    /// Axis of the largest component.
    pub axis: usize,
}

/// Rays by class.
pub(super) struct Classes {
    rest: u64,
    negative: [u64; 3],
    largest: [u64; 3],
}

impl Iterator for Classes {
    type Item = (Class, u64);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        if self.rest == 0 {
            return None;
        }
        let first = self.rest & self.rest.wrapping_neg();
        let mut same = self.rest;
        let mut octant = 0;
        for (axis, &negative) in self.negative.iter().enumerate() {
            let is = negative & first != 0;
            octant |= usize::from(is) << axis;
            same &= if is { negative } else { !negative };
        }
        let axis = if self.largest[2] & first != 0 { 2 } else { usize::from(self.largest[1] & first != 0) };
        same &= self.largest[axis];
        self.rest &= !same;
        Some((Class { octant, axis }, same))
    }
}
