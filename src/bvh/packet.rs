//! Up to 64 rays through a hierarchy together.
//!
//! All rays of a packet have their signs and their largest component in common. Inner nodes are first
//! tested against all rays at once, by intervals that bound their origins and directions, eight children
//! with one vector; only where that lets something pass, and only until one ray is found that enters,
//! are the rays themselves asked. References: R. Overbeck, R. Ramamoorthi, W. Mark, "Large Ray Packets
//! for Real-time Whitted Ray Tracing", RT 2008 (ranged traversal); S. Boulos, I. Wald, P. Shirley,
//! "Geometric and Arithmetic Culling Methods for Entire Ray Packets", 2006 (interval arithmetic).

use super::probe::{AXES, Probe, SLACK, is_extreme, largest_axis};
use super::simd::{Lanes, Mask, Octet, Simd, three};
use super::single::Waiting;
use super::wide::{Child, MAX_WAITING, WIDTH, WideBvh, WideNode};
use super::triangle::Shear;
use super::{Aabb, Hit, Ray};
use glam::Vec3;
use std::ops::ControlFlow;

/// Most rays of a packet.
pub(super) const PACKET: usize = 64;
/// Rays that are tested with one vector.
pub(super) const GROUP: usize = 16;
/// With no more rays than this left, each goes on alone.
const FEW: u32 = 4;

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

/// Rays of one octant and one largest axis, side by side. Lanes without a ray repeat the last one.
#[derive(Clone, Debug)]
pub(super) struct Packet {
    /// As in [`Probe`].
    pub axis: usize,
    pub octant: usize,
    pub origin: [Row; 3],
    pub direction: [Row; 3],
    pub shear: [Row; 3],
    pub inverse: [Row; 3],
    pub near_origin: [Row; 3],
    pub far_origin: [Row; 3],
    pub extreme: bool,
    /// What is still wanted of each ray.
    pub t_max: Row,
    /// Of all near origins the one that meets boxes first; of all far origins the one that leaves them last.
    first: [f32; 3],
    last: [f32; 3],
    /// Least and greatest reciprocal directions.
    inverse_span: [[f32; 2]; 3],
}

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
            t: packet.t_max.0[lane],
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
        for (row, new) in [&mut packet.t_max, &mut self.u, &mut self.v].into_iter().zip(tuv) {
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
            packet.t_max.0[lane] = hit.t;
            self.u.0[lane] = hit.u;
            self.v.0[lane] = hit.v;
            self.triangle[lane] = hit.triangle;
            self.instance[lane] = hit.instance;
            self.rays |= 1 << lane;
        }
        better
    }
}

/// What a traversal does at leaves.
pub(super) trait Visitor<S: Simd> {
    /// Tests the `rays` (bits) of the packet with `count` entries from `first` on, shortening their
    /// `t_max`; returns those that need no more.
    fn many(&mut self, simd: S, packet: &mut Packet, first: usize, count: usize, rays: u64) -> u64;

    /// The same for the ray of one lane, made ready; answers with the ray's new `t_max`.
    fn one(&mut self, simd: S, packet: &mut Packet, probe: &Probe, lane: usize, first: usize, count: usize)
    -> ControlFlow<(), f32>;
}

/// Children that a packet has yet to visit.
#[derive(Debug)]
pub(super) struct PacketWaiting {
    nears: [f32; MAX_WAITING],
    /// Node · 8 + number of the child.
    children: [u32; MAX_WAITING],
    /// The rays that entered the node.
    rays: [u64; MAX_WAITING],
    pub single: Waiting,
}

impl Default for PacketWaiting {
    fn default() -> Self {
        Self {
            nears: [0.0; MAX_WAITING],
            children: [0; MAX_WAITING],
            rays: [0; MAX_WAITING],
            single: Waiting::default(),
        }
    }
}

/// The lowest `count` bits.
pub(super) fn lowest(count: usize) -> u64 {
    if count >= 64 { u64::MAX } else { (1 << count) - 1 }
}

impl Packet {
    pub fn blank() -> Self {
        let row = [Row([0.0; PACKET]); 3];
        Self {
            axis: 2,
            octant: 0,
            origin: row,
            direction: row,
            shear: row,
            inverse: row,
            near_origin: row,
            far_origin: row,
            extreme: false,
            t_max: row[0],
            first: [0.0; 3],
            last: [0.0; 3],
            inverse_span: [[0.0; 2]; 3],
        }
    }

    /// Makes the rays ready for boxes and triangles inside `bounds`, as [`Probe::with_slack`] does, to the
    /// bit. `ray(i)` for `i` below `count` are all of the given class.
    #[inline(always)]
    pub fn prepare<S: Simd>(
        &mut self,
        simd: S,
        class: Class,
        count: usize,
        ray: impl Fn(usize) -> Ray,
        bounds: &Aabb,
        slack: f32,
    ) {
        let groups = count.div_ceil(GROUP);
        for lane in 0..groups * GROUP {
            let Ray { origin, direction, t_max } = ray(lane.min(count - 1));
            for axis in 0..3 {
                self.origin[axis].0[lane] = origin[axis];
                self.direction[axis].0[lane] = direction[axis];
            }
            // Nothing is wanted where there is no ray.
            self.t_max.0[lane] = if lane < count { t_max } else { 0.0 };
        }
        self.octant = class.octant();
        self.axis = class.axis();
        let [x, y, z] = AXES[self.axis];
        let constant = |x: f32| S::F16::splat(simd, x);
        let one = constant(1.0);
        let finite = |lanes: S::F16| lanes.min(constant(f32::MAX)).max(constant(-f32::MAX));
        let mut spans = [[[constant(f32::INFINITY), constant(f32::NEG_INFINITY)]; 3]; 3];
        let mut reaches = [constant(f32::INFINITY), constant(0.0)];
        for group in 0..groups {
            let row = |rows: &[Row; 3], axis: usize| rows[axis].get::<S::F16>(simd, group);
            let origin: [S::F16; 3] = three(|axis| row(&self.origin, axis));
            let direction: [S::F16; 3] = three(|axis| row(&self.direction, axis));
            let reach: [S::F16; 3] = three(|axis| {
                let below = (constant(bounds.min[axis]) - origin[axis]).abs();
                below.max((constant(bounds.max[axis]) - origin[axis]).abs())
            });
            for axis in 0..3 {
                let step = origin[axis].abs() * constant(2.0 * f32::EPSILON) + constant(f32::MIN_POSITIVE);
                let slack = (reach[axis] + reach[z]) * constant(SLACK * slack) + step;
                let (less, more) = (origin[axis] - slack, origin[axis] + slack);
                let (near, far) = if self.octant >> axis & 1 == 0 { (more, less) } else { (less, more) };
                let [near, far, inverse] = [finite(near), finite(far), finite(one / direction[axis])];
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
            reaches = [reaches[0].min(farthest), reaches[1].max(farthest)];
        }
        for axis in 0..3 {
            let [near, far, inverse] = three(|i| [lane_min(spans[axis][i][0]), lane_max(spans[axis][i][1])]);
            let backward = self.octant >> axis & 1;
            self.first[axis] = near[1 - backward];
            self.last[axis] = far[backward];
            self.inverse_span[axis] = inverse;
        }
        self.extreme = is_extreme(lane_min(reaches[0])) || is_extreme(lane_max(reaches[1]));
    }

    /// One of the rays, as far as it is still wanted.
    #[inline(always)]
    pub fn ray(&self, lane: usize) -> Ray {
        let lane = lane % PACKET;
        let vec = |rows: &[Row; 3]| Vec3::new(rows[0].0[lane], rows[1].0[lane], rows[2].0[lane]);
        Ray { origin: vec(&self.origin), direction: vec(&self.direction), t_max: self.t_max.0[lane] }
    }

    /// One of the rays, alone and ready.
    #[inline(always)]
    pub fn probe(&self, lane: usize) -> Probe {
        let lane = lane % PACKET;
        let [x, y, z] = AXES[self.axis];
        let vec = |rows: &[Row; 3]| Vec3::new(rows[0].0[lane], rows[1].0[lane], rows[2].0[lane]);
        Probe {
            origin: vec(&self.origin),
            direction: vec(&self.direction),
            axis: self.axis,
            sheared_origin: Vec3::new(self.origin[x].0[lane], self.origin[y].0[lane], self.origin[z].0[lane]),
            shear: vec(&self.shear),
            inverse: vec(&self.inverse),
            near_origin: vec(&self.near_origin),
            far_origin: vec(&self.far_origin),
            extreme: self.extreme,
        }
    }

    /// A group of rays, for triangles.
    #[inline(always)]
    pub fn shear<S: Simd>(&self, simd: S, group: usize) -> Shear<S::F16> {
        let axes = AXES[self.axis];
        Shear {
            origin: three(|i| self.origin[axes[i]].get(simd, group)),
            shear: three(|i| self.shear[i].get(simd, group)),
        }
    }

    /// Where a group of rays enters the box of a triangle, if it does.
    #[inline(always)]
    pub fn entry<S: Simd>(&self, simd: S, group: usize, corners: &[Vec3; 3]) -> S::F16 {
        let [a, b, c] = *corners;
        let (min, max) = (a.min(b).min(c), a.max(b).max(c));
        let enter = |axis: usize| {
            let side = if self.octant >> axis & 1 == 0 { min[axis] } else { max[axis] };
            (S::F16::splat(simd, side) - self.near_origin[axis].get(simd, group))
                * self.inverse[axis].get(simd, group)
        };
        enter(0).max(enter(1)).max(enter(2).max(S::F16::splat(simd, 0.0)))
    }

    /// Which rows of [`WideNode::bounds`] are the sides where the rays come in.
    #[inline(always)]
    fn near_rows(&self) -> [usize; 3] {
        [self.octant & 1, 2 + (self.octant >> 1 & 1), 4 + (self.octant >> 2 & 1)]
    }

    /// Which of `rays` enter a child. With `ranged`, the search ends with the first group of which a ray does;
    /// those behind it are taken along unasked.
    #[inline(always)]
    fn entering<S: Simd>(&self, simd: S, node: &WideNode, slot: usize, rays: u64, ranged: bool) -> u64 {
        let rows = self.near_rows();
        let near: [S::F16; 3] =
            three(|axis| S::F16::splat(simd, node.bounds[rows[axis] % 6][slot % 8]));
        let far: [S::F16; 3] =
            three(|axis| S::F16::splat(simd, node.bounds[(rows[axis] ^ 1) % 6][slot % 8]));
        let zero = S::F16::splat(simd, 0.0);
        let mut entering = rays;
        let mut rest = rays;
        while rest != 0 {
            let group = rest.trailing_zeros() as usize / GROUP;
            let row = |rows: &[Row; 3], axis: usize| rows[axis].get::<S::F16>(simd, group);
            let inverse: [S::F16; 3] = three(|axis| row(&self.inverse, axis));
            let enter = |axis: usize| (near[axis] - row(&self.near_origin, axis)) * inverse[axis];
            let leave = |axis: usize| (far[axis] - row(&self.far_origin, axis)) * inverse[axis];
            let entry = enter(0).max(enter(1)).max(enter(2).max(zero));
            let exit = leave(0).min(leave(1)).min(leave(2).min(self.t_max.get(simd, group)));
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

    fn t_bound<S: Simd>(&self, simd: S, count: usize) -> f32 {
        let groups = count.div_ceil(GROUP);
        let most = (1..groups)
            .fold(self.t_max.get::<S::F16>(simd, 0), |most, group| most.max(self.t_max.get(simd, group)));
        lane_max(most)
    }
}

#[inline(always)]
fn lane_min<V: Lanes>(lanes: V) -> f32 {
    let mut all = [f32::INFINITY; GROUP];
    lanes.store(&mut all);
    all.iter().fold(f32::INFINITY, |a, &b| if b < a { b } else { a })
}

#[inline(always)]
fn lane_max<V: Lanes>(lanes: V) -> f32 {
    let mut all = [f32::NEG_INFINITY; GROUP];
    lanes.store(&mut all);
    all.iter().fold(f32::NEG_INFINITY, |a, &b| if b > a { b } else { a })
}

/// What rays must have in common to share a packet: octant and largest axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Class(u8);

/// How many there are.
pub(super) const CLASSES: usize = 24;

impl Class {
    #[inline(always)]
    pub fn of(direction: Vec3) -> Self {
        Self((direction.is_negative_bitmask() as u8) | (largest_axis(direction) as u8) << 3)
    }

    #[inline(always)]
    pub fn from_index(index: u32) -> Self {
        Self(index as u8)
    }

    #[inline(always)]
    pub fn octant(self) -> usize {
        usize::from(self.0 & 7)
    }

    #[inline(always)]
    pub fn axis(self) -> usize {
        usize::from(self.0 >> 3) % 3
    }

    #[inline(always)]
    pub fn index(self) -> usize {
        usize::from(self.0)
    }
}

impl WideBvh {
    /// Takes the `rays` of the packet through all leaves that any of them enters; returns those of which
    /// the visitor said that they need no more.
    #[inline(always)]
    pub(super) fn traverse_packet<S: Simd>(
        &self,
        simd: S,
        packet: &mut Packet,
        rays: u64,
        waiting: &mut PacketWaiting,
        visitor: &mut impl Visitor<S>,
    ) -> u64 {
        if self.nodes.is_empty() {
            return 0;
        }
        let lanes = 64 - rays.leading_zeros() as usize;
        let mut alive = rays;
        let mut t_bound = packet.t_bound(simd, lanes);
        let mut count = 0;
        let mut node = 0;
        let mut entered = rays;
        loop {
            count += packet.enter(simd, &self.nodes[node], node, t_bound, entered, waiting, count);
            loop {
                if count == 0 {
                    return rays & !alive;
                }
                count -= 1;
                let rays = waiting.rays[count] & alive;
                if rays == 0 || waiting.nears[count] > t_bound {
                    continue;
                }
                let (parent, slot) = (waiting.children[count] as usize / 8, waiting.children[count] as usize % 8);
                let parent = &self.nodes[parent];
                match Child::unpack(parent.children[slot]) {
                    Child::Node(child) => {
                        let rays = packet.entering(simd, parent, slot, rays, true);
                        if rays == 0 {
                            continue;
                        }
                        if rays.count_ones() <= FEW {
                            alive &= !self.each_alone(simd, packet, child, rays, &mut waiting.single, visitor);
                            continue;
                        }
                        (node, entered) = (child, rays);
                        break;
                    }
                    Child::Leaf { first, count } => {
                        let rays = packet.entering(simd, parent, slot, rays, false);
                        if rays != 0 {
                            alive &= !visitor.many(simd, packet, first, count, rays);
                            t_bound = packet.t_bound(simd, lanes);
                        }
                    }
                }
            }
        }
    }

    /// Takes a few rays through the nodes below `root`, one after the other.
    #[inline(always)]
    fn each_alone<S: Simd>(
        &self,
        simd: S,
        packet: &mut Packet,
        root: usize,
        rays: u64,
        waiting: &mut Waiting,
        visitor: &mut impl Visitor<S>,
    ) -> u64 {
        let mut done = 0;
        let mut rest = rays;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let probe = packet.probe(lane);
            let t_max = packet.t_max.0[lane % PACKET];
            let end = self.traverse(simd, &probe, root, t_max, waiting, |first, count, _| {
                visitor.one(simd, packet, &probe, lane, first, count)
            });
            if end.is_break() {
                done |= 1 << lane;
            }
        }
        done
    }
}

impl Packet {
    /// Puts the children that any ray may enter on top of the `count` waiting ones; returns how many.
    #[inline(always)]
    fn enter<S: Simd>(
        &self,
        simd: S,
        node: &WideNode,
        index: usize,
        t_bound: f32,
        rays: u64,
        waiting: &mut PacketWaiting,
        count: usize,
    ) -> usize {
        let rows = self.near_rows();
        let splat = |x: f32| S::F8::splat(simd, x);
        let row = |row: usize| S::F8::load(simd, &node.bounds[row % 6]);
        let enter = |axis: usize| {
            let p = row(rows[axis]) - splat(self.first[axis]);
            let [low, high] = [splat(self.inverse_span[axis][0]), splat(self.inverse_span[axis][1])];
            (p * low).min(p * high)
        };
        let leave = |axis: usize| {
            let p = row(rows[axis] ^ 1) - splat(self.last[axis]);
            let [low, high] = [splat(self.inverse_span[axis][0]), splat(self.inverse_span[axis][1])];
            (p * low).max(p * high)
        };
        let entry = enter(0).max(enter(1)).max(enter(2).max(splat(0.0)));
        let exit = leave(0).min(leave(1)).min(leave(2).min(splat(t_bound)));
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
