//! What a packet's rays have hit so far.

use super::Hit;
use super::packet::Packet;
use super::rows::{GROUP, PACKET, Row};
use super::simd::{Lanes, Simd};

/// The best hits of a packet's rays; their t is the packet's `t_max`.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Which rays have one.
    pub rays: u64,
    u: Row,
    v: Row,
    triangle: [u32; PACKET],
    instance: [u32; PACKET],
}

impl Found {
    pub fn blank() -> Self {
        let row = Row([0.0; PACKET]);
        Self { rays: 0, u: row, v: row, triangle: [0; PACKET], instance: [0; PACKET] }
    }

    /// The hit of a ray.
    #[inline(always)]
    pub fn hit(&self, packet: &Packet, lane: usize) -> Option<Hit> {
        let lane = lane % PACKET;
        (self.rays >> lane & 1 != 0).then(|| Hit {
            t: packet.rays.t_max.0[lane],
            u: self.u.0[lane],
            v: self.v.0[lane],
            triangle: self.triangle[lane],
            instance: self.instance[lane],
        })
    }

    /// Overwrites a lane by a lane of another packet's.
    #[inline(always)]
    pub fn copy(&mut self, to: usize, other: &Self, from: usize) {
        let (to, from) = (to % PACKET, from % PACKET);
        self.rays = self.rays & !(1 << to) | (other.rays >> from & 1) << to;
        self.u.0[to] = other.u.0[from];
        self.v.0[to] = other.v.0[from];
        self.triangle[to] = other.triangle[from];
        self.instance[to] = other.instance[from];
    }

    /// Takes the [t, u, v] of the lanes of `group` whose bits are set, all nearer than what was known.
    #[inline(always)]
    pub fn keep<S: Simd>(
        &mut self,
        simd: S,
        packet: &mut Packet,
        group: usize,
        lanes: u32,
        tuv: [S::F16; 3],
        triangle: u32,
        instance: u32,
    ) {
        for (row, new) in [&mut packet.rays.t_max, &mut self.u, &mut self.v].into_iter().zip(tuv) {
            row.set(group, S::F16::select(lanes, new, row.get(simd, group)));
        }
        let mut each = lanes;
        while each != 0 {
            let lane = (group * GROUP + each.trailing_zeros() as usize) % PACKET;
            each &= each - 1;
            self.triangle[lane] = triangle;
            self.instance[lane] = instance;
        }
        self.rays |= u64::from(lanes) << (group * GROUP);
    }

    /// Takes a hit at or before the ray's `t_max` if it is the better one and counts.
    #[inline(always)]
    pub fn offer(
        &mut self,
        packet: &mut Packet,
        lane: usize,
        hit: Hit,
        takes: impl FnOnce(&Hit) -> bool,
    ) -> bool {
        let better = self.hit(packet, lane).is_none_or(|known| hit.beats(&known)) && takes(&hit);
        if better {
            let lane = lane % PACKET;
            packet.rays.t_max.0[lane] = hit.t;
            self.u.0[lane] = hit.u;
            self.v.0[lane] = hit.v;
            self.triangle[lane] = hit.triangle;
            self.instance[lane] = hit.instance;
            self.rays |= 1 << lane;
        }
        better
    }
}
