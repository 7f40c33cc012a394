//! Up to 64 rays through a hierarchy together.
//!
//! All rays of a packet have their signs and their largest component in common. Inner nodes are first
//! tested against all rays at once, by intervals that bound their origins and directions, eight children
//! with one vector; only where that lets something pass, and only until one ray is found that enters,
//! are the rays themselves asked. References: R. Overbeck, R. Ramamoorthi, W. Mark, "Large Ray Packets
//! for Real-time Whitted Ray Tracing", RT 2008 (ranged traversal); S. Boulos, I. Wald, P. Shirley,
//! "Geometric and Arithmetic Culling Methods for Entire Ray Packets", 2006 (interval arithmetic).

use super::Aabb;
use super::probe::{AXES, EXTREME, Probe, SLACK};
use super::rows::{Class, GROUP, PACKET, Rays, Row, lowest};
use super::simd::{Lanes, Mask, Octet, Simd, three};
use super::together::PacketWaiting;
use super::triangle::Shear;
use super::wide::{WIDTH, WideNode};
use glam::Vec3;

/// Rays of one octant and one largest axis, side by side. Lanes without a ray repeat the last one.
#[derive(Clone, Debug)]
pub(super) struct Packet {
    /// As in [`Probe`].
    pub axis: usize,
    pub octant: usize,
    pub rays: Rays,
    pub shear: [Row; 3],
    pub inverse: [Row; 3],
    pub near_origin: [Row; 3],
    pub far_origin: [Row; 3],
    /// Bits, as in [`Probe`]: each ray's own affair, or its hit would depend on its neighbours.
    pub extreme: u64,
    /// Of all near origins the one that meets boxes first; of all far origins the one that leaves them last.
    first: [f32; 3],
    last: [f32; 3],
    /// Least and greatest reciprocal directions.
    inverse_span: [[f32; 2]; 3],
}

impl Packet {
    pub fn blank() -> Self {
        let row = [Row([0.0; PACKET]); 3];
        Self {
            axis: 2,
            octant: 0,
            rays: Rays::blank(),
            shear: row,
            inverse: row,
            near_origin: row,
            far_origin: row,
            extreme: 0,
            first: [0.0; 3],
            last: [0.0; 3],
            inverse_span: [[0.0; 2]; 3],
        }
    }

    /// Makes `self.rays`, `count` of the given class, ready for boxes and triangles inside `bounds`, as
    /// [`Probe::with_slack`] does, to the bit.
    #[expect(clippy::needless_range_loop, reason = "an axis of seven arrays")]
    #[inline(always)]
    pub fn prepare<S: Simd>(&mut self, simd: S, class: Class, count: usize, bounds: &Aabb, slack: f32) {
        let groups = count.div_ceil(GROUP);
        (self.octant, self.axis) = (class.octant, class.axis);
        let [x, y, z] = AXES[self.axis];
        let one = S::F16::splat(simd, 1.0);
        let (least, most) = (S::F16::splat(simd, f32::MIN), S::F16::splat(simd, f32::MAX));
        let ulps = S::F16::splat(simd, 2.0 * f32::EPSILON);
        let tiny = S::F16::splat(simd, f32::MIN_POSITIVE);
        let slack = S::F16::splat(simd, SLACK * slack);
        let mut spans =
            [[[S::F16::splat(simd, f32::INFINITY), S::F16::splat(simd, f32::NEG_INFINITY)]; 3]; 3];
        self.extreme = 0;
        for group in 0..groups {
            let origin: [S::F16; 3] = three!(|axis| self.rays.origin[axis].get(simd, group));
            let direction: [S::F16; 3] = three!(|axis| self.rays.direction[axis].get(simd, group));
            let reach: [S::F16; 3] = three!(|axis| {
                let below = (S::F16::splat(simd, bounds.min[axis]) - origin[axis]).abs();
                below.max((S::F16::splat(simd, bounds.max[axis]) - origin[axis]).abs())
            });
            for axis in 0..3 {
                let step = origin[axis].abs() * ulps + tiny;
                let slack = (reach[axis] + reach[z]) * slack + step;
                let (less, more) = (origin[axis] - slack, origin[axis] + slack);
                let (near, far) = if self.octant >> axis & 1 == 0 { (more, less) } else { (less, more) };
                let near = near.min(most).max(least);
                let far = far.min(most).max(least);
                let inverse = (one / direction[axis]).min(most).max(least);
                self.near_origin[axis].set(group, near);
                self.far_origin[axis].set(group, far);
                self.inverse[axis].set(group, inverse);
                for (span, lanes) in spans[axis].iter_mut().zip([near, far, inverse]) {
                    *span = [span[0].min(lanes), span[1].max(lanes)];
                }
            }
            self.shear[0].set(group, direction[x] / direction[z]);
            self.shear[1].set(group, direction[y] / direction[z]);
            self.shear[2].set(group, one / direction[z]);
            let farthest = reach[0].max(reach[1]).max(reach[2]);
            let ordinary = S::F16::splat(simd, 1.0 / EXTREME).le(farthest);
            let ordinary = ordinary.and(farthest.lt(S::F16::splat(simd, EXTREME)));
            self.extreme |= u64::from(!ordinary.bits() & 0xffff) << (group * GROUP);
        }
        for axis in 0..3 {
            let [near, far, inverse] = spans[axis];
            let forward = self.octant >> axis & 1 == 0;
            self.first[axis] = if forward { near[1].highest() } else { near[0].lowest() };
            self.last[axis] = if forward { far[0].lowest() } else { far[1].highest() };
            self.inverse_span[axis] = [inverse[0].lowest(), inverse[1].highest()];
        }
    }

    /// One of the rays, alone and ready.
    #[inline(always)]
    pub fn probe(&self, lane: usize) -> Probe {
        let lane = lane % PACKET;
        let [x, y, z] = AXES[self.axis];
        let vec = |rows: &[Row; 3]| Vec3::new(rows[0].0[lane], rows[1].0[lane], rows[2].0[lane]);
        Probe {
            origin: vec(&self.rays.origin),
            direction: vec(&self.rays.direction),
            axis: self.axis,
            sheared_origin: Vec3::new(
                self.rays.origin[x].0[lane],
                self.rays.origin[y].0[lane],
                self.rays.origin[z].0[lane],
            ),
            shear: vec(&self.shear),
            inverse: vec(&self.inverse),
            near_origin: vec(&self.near_origin),
            far_origin: vec(&self.far_origin),
            extreme: self.extreme >> lane & 1 != 0,
        }
    }

    /// A group of rays, for triangles.
    #[inline(always)]
    pub fn shear<S: Simd>(&self, simd: S, group: usize) -> Shear<S::F16> {
        let axes = AXES[self.axis];
        Shear {
            origin: three!(|i| self.rays.origin[axes[i]].get(simd, group)),
            shear: three!(|i| self.shear[i].get(simd, group)),
        }
    }

    /// By which side of boxes the rays come in along an axis: 0 for the less, 1 for the greater.
    #[inline(always)]
    fn near_side(&self, axis: usize) -> usize {
        self.octant >> axis & 1
    }

    /// Which of `rays` enter a child. With `ranged`, the search ends with the first group of which a ray does;
    /// those behind it are taken along unasked.
    #[inline(always)]
    pub fn entering<S: Simd>(&self, simd: S, node: &WideNode, slot: usize, rays: u64, ranged: bool) -> u64 {
        let slot = slot % WIDTH;
        let near = three!(|axis| S::F16::splat(simd, node.bounds[axis][self.near_side(axis)][slot]));
        let far = three!(|axis| S::F16::splat(simd, node.bounds[axis][self.near_side(axis) ^ 1][slot]));
        let zero = S::F16::splat(simd, 0.0);
        let mut entering = rays;
        let mut rest = rays;
        while rest != 0 {
            let group = rest.trailing_zeros() as usize / GROUP;
            let inverse: [S::F16; 3] = three!(|axis| self.inverse[axis].get(simd, group));
            let enter = three!(|axis| (near[axis] - self.near_origin[axis].get(simd, group)) * inverse[axis]);
            let leave = three!(|axis| (far[axis] - self.far_origin[axis].get(simd, group)) * inverse[axis]);
            let entry = enter[0].max(enter[1]).max(enter[2].max(zero));
            let exit = leave[0].min(leave[1]).min(leave[2].min(self.rays.t_max.get(simd, group)));
            let hit = u64::from(entry.le(exit).bits()) << (group * GROUP);
            let members = lowest(GROUP) << (group * GROUP);
            entering &= hit | !members;
            if ranged && entering & members != 0 {
                break;
            }
            rest &= !members;
        }
        entering
    }

    #[inline(always)]
    pub fn t_bound<S: Simd>(&self, simd: S, count: usize) -> f32 {
        let mut most: S::F16 = self.rays.t_max.get(simd, 0);
        for group in 1..count.div_ceil(GROUP) {
            most = most.max(self.rays.t_max.get(simd, group));
        }
        most.highest()
    }
}

impl Packet {
    /// Puts the children that any ray may enter on top of the `count` waiting ones; returns how many.
    #[inline(always)]
    pub fn enter<S: Simd>(
        &self,
        simd: S,
        node: &WideNode,
        index: usize,
        t_bound: f32,
        rays: u64,
        waiting: &mut PacketWaiting,
        count: usize,
    ) -> usize {
        let low = three!(|axis| S::F8::splat(simd, self.inverse_span[axis][0]));
        let high = three!(|axis| S::F8::splat(simd, self.inverse_span[axis][1]));
        let enter = three!(|axis| {
            let near = S::F8::load(simd, &node.bounds[axis][self.near_side(axis)]);
            let p = near - S::F8::splat(simd, self.first[axis]);
            (p * low[axis]).min(p * high[axis])
        });
        let leave = three!(|axis| {
            let far = S::F8::load(simd, &node.bounds[axis][self.near_side(axis) ^ 1]);
            let p = far - S::F8::splat(simd, self.last[axis]);
            (p * low[axis]).max(p * high[axis])
        });
        let entry = enter[0].max(enter[1]).max(enter[2].max(S::F8::splat(simd, 0.0)));
        let exit = leave[0].min(leave[1]).min(leave[2].min(S::F8::splat(simd, t_bound)));
        let base = (index * WIDTH) as u32;
        let children = [base, base + 1, base + 2, base + 3, base + 4, base + 5, base + 6, base + 7];
        let to = (
            (&mut waiting.nears[count..count + WIDTH]).try_into(),
            (&mut waiting.children[count..count + WIDTH]).try_into(),
        );
        let (Ok(nears), Ok(to)) = to else { return 0 };
        waiting.rays[count..count + WIDTH].fill(rays);
        S::F8::push_entered(entry, exit, node.orders[self.octant % 8], &children, nears, to)
    }
}
