//! The triangles of the leaves, laid out for vectors.

use super::found::Found;
use super::packet::Packet;
use super::probe::AXES;
use super::rows::{GROUP, PACKET, each, lowest};
use super::simd::{Lanes, Mask, Octet, Simd, three};
use super::triangle::{Edges, Shear, TriangleHit, within};
use super::wide::MAX_LEAF;
use super::{Hit, Probe};
use glam::Vec3;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;

/// For a leaf of n triangles nine rows of n floats, without gaps: all first corners' x, their y, their z,
/// then those of the second and the third corners. So a leaf is as compact as its triangles, and a
/// vector over them is a load from anywhere.
///
/// Where most triangles are in several leaves all share one list of them, in which a leaf's are looked up.
#[derive(Clone, Debug, Default)]
pub(super) struct Leaves {
    /// A row after the other, or a triangle after the other.
    rows: Vec<f32>,
    /// [`WideBvh::prims`](super::WideBvh::prims).
    ids: Arc<[u32]>,
    shared: bool,
}

/// Floats of a triangle.
const FLOATS: usize = 9;

/// Whether leaves with so many entries in all share one list of the triangles.
fn is_shared(triangles: usize, entries: usize) -> bool {
    2 * entries > 3 * triangles
}

/// Bytes of leaves that have so many entries in all.
pub(super) fn bytes(triangles: usize, entries: usize) -> usize {
    let copies = if is_shared(triangles, entries) { triangles } else { entries };
    copies * FLOATS * size_of::<f32>() + entries * size_of::<u32>()
}

/// The rows of all `leaves`, given by first entry and number of entries, whose triangles are `ids`. Each list
/// is about all entries from the end of the last one on.
fn rows(leaves: Vec<Vec<[u32; 2]>>, ids: &[u32], triangles: &[[Vec3; 3]]) -> Vec<f32> {
    // A leaf's last vector may reach beyond its own rows. Zeroed memory comes when it is touched.
    let mut rows = vec![0.0; ids.len() * FLOATS + MAX_LEAF];
    let (mut rest, mut start) = (&mut *rows, 0);
    let mut places = Vec::with_capacity(leaves.len());
    for list in leaves {
        let entries = list.iter().map(|[_, count]| *count as usize).sum::<usize>();
        let (own, others) = rest.split_at_mut(entries * FLOATS);
        places.push((list, start, own));
        start += entries;
        rest = others;
    }
    places.into_par_iter().for_each(|(list, start, rows)| {
        for [first, count] in list {
            let (first, count) = (first as usize, count as usize);
            let own = &mut rows[(first - start) * FLOATS..][..count * FLOATS];
            fill_leaf(&ids[first..first + count], own, triangles);
        }
    });
    rows
}

/// Writes the rows of one leaf.
#[inline]
pub(super) fn fill_leaf(ids: &[u32], rows: &mut [f32], triangles: &[[Vec3; 3]]) {
    for (i, &id) in ids.iter().enumerate() {
        for (corner, p) in triangles[id as usize].iter().enumerate() {
            for axis in 0..3 {
                rows[(corner * 3 + axis) * ids.len() + i] = p[axis];
            }
        }
    }
}

impl Leaves {
    /// `leaves` as [`rows`] takes them, whose triangles are `ids`.
    pub fn new(leaves: Vec<Vec<[u32; 2]>>, ids: &Arc<[u32]>, triangles: &[[Vec3; 3]]) -> Self {
        let shared = is_shared(triangles.len(), ids.len());
        let rows =
            if shared { bytemuck::cast_slice(triangles).to_vec() } else { rows(leaves, ids, triangles) };
        Self { rows, ids: Arc::clone(ids), shared }
    }

    /// Those of one leaf, if it has its own.
    pub fn rows_of(&mut self, first: usize, count: usize) -> &mut [f32] {
        &mut self.rows[first * FLOATS..(first + count) * FLOATS]
    }

    /// Whether the triangles of a leaf are what `triangles` has in their places, to the bit.
    pub fn same(&self, leaf: (usize, usize), triangles: &[[Vec3; 3]]) -> bool {
        let bits = |corners: &[Vec3; 3]| corners.map(|p| p.to_array().map(f32::to_bits));
        self.numbered(leaf)
            .all(|(id, here)| triangles.get(id as usize).is_some_and(|there| bits(there) == bits(&here)))
    }

    /// The triangles of a leaf, with their numbers.
    pub fn numbered(&self, leaf: (usize, usize)) -> impl Iterator<Item = (u32, [Vec3; 3])> {
        (0..leaf.1).map(move |i| (self.ids[leaf.0 + i], self.corners(leaf, i)))
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&*self.rows) + size_of_val(&*self.ids)
    }

    /// A triangle of a leaf.
    #[inline(always)]
    fn corners(&self, (first, count): (usize, usize), i: usize) -> [Vec3; 3] {
        let (rows, step) = if self.shared {
            (&self.rows[self.ids[first + i] as usize * FLOATS..][..FLOATS], 1)
        } else {
            (&self.rows[first * FLOATS + i..], count)
        };
        three!(|c| Vec3::from_array(three!(|axis| rows[(3 * c + axis) * step])))
    }

    /// One ray, up to eight triangles. `offer` is told of each hit at or before `t_max`, and whether it takes
    /// it. Answers with the new `t_max`, or breaks if `ANY` hit will do.
    #[inline(always)]
    pub fn test_one<S: Simd, const ANY: bool>(
        &self,
        simd: S,
        probe: &Probe,
        leaf: (usize, usize),
        instance: u32,
        mut t_max: f32,
        mut offer: impl FnMut(Hit) -> bool,
    ) -> ControlFlow<(), f32> {
        let (first, count) = leaf;
        let gathered;
        let (rows, step) = if self.shared {
            gathered = S::F8::gather(simd, &self.rows, &self.ids[first..][..count]);
            (gathered.as_flattened(), MAX_LEAF)
        } else {
            (&self.rows[first * FLOATS..][..count * FLOATS + MAX_LEAF], count)
        };
        let mut candidates = lowest(count) as u32;
        let (mut certain, mut doubtful, mut close) = (0, 0, 0);
        let (mut ts, mut us, mut vs) = ([0.0; MAX_LEAF], [0.0; MAX_LEAF], [0.0; MAX_LEAF]);
        if !probe.extreme {
            let shear = Shear {
                origin: three!(|i| S::F8::splat(simd, probe.sheared_origin[i])),
                shear: three!(|i| S::F8::splat(simd, probe.shear[i])),
            };
            let edges = shear.edges(S::F8::load_corners(simd, rows, step, &AXES[probe.axis]));
            candidates &= edges.inside(simd).bits();
            if candidates == 0 {
                return ControlFlow::Continue(t_max);
            }
            let distance = shear.distance(simd, &edges);
            let on_edge = distance.on_edge.bits();
            let limit = S::F8::splat(simd, t_max);
            certain = distance.ahead.and(distance.t.le(limit)).bits() & !on_edge;
            let beyond = distance.rough.and((limit + distance.margin).lt(distance.t)).bits();
            doubtful = distance.doubtful.bits() & !on_edge & !beyond;
            close = distance.close.bits();
            candidates &= certain | doubtful | on_edge;
            distance.t.store(&mut ts);
            (edges.weights[1] * distance.inverse_determinant).store(&mut us);
            (edges.weights[2] * distance.inverse_determinant).store(&mut vs);
        }
        for i in each(u64::from(candidates)) {
            let i = i % MAX_LEAF;
            let corners = || self.corners(leaf, i);
            let rough = TriangleHit { t: ts[i], u: us[i], v: vs[i] };
            let found = if certain >> i & 1 != 0 {
                within(rough, t_max)
            } else if doubtful >> i & 1 != 0 {
                probe.doubtful_triangle(&corners(), t_max, close >> i & 1 != 0)
            } else {
                probe.triangle(&corners(), t_max)
            };
            if let Some(found) = found {
                let triangle = self.ids[first + i];
                let hit = Hit { t: found.t, u: found.u, v: found.v, triangle, instance };
                if offer(hit) {
                    t_max = hit.t;
                    if ANY {
                        return ControlFlow::Break(());
                    }
                }
            }
        }
        ControlFlow::Continue(t_max)
    }

    /// Rays of a packet, the triangles of a leaf one after the other. `takes` is asked about lanes' hits
    /// if given; otherwise all count. Returns the rays that need no more, which are those with a hit if `ANY` will do.
    #[inline(always)]
    pub fn test_many<S: Simd, const ANY: bool>(
        &self,
        simd: S,
        packet: &mut Packet,
        leaf: (usize, usize),
        instance: u32,
        rays: u64,
        found: &mut Found,
        takes: Option<impl Fn(usize, &Hit) -> bool>,
    ) -> u64 {
        let (first, count) = leaf;
        let axes = AXES[packet.axis];
        let mut done = 0;
        for i in 0..count {
            let corners = self.corners(leaf, i);
            let permuted = three!(|c| three!(|i| S::F16::splat(simd, corners[c][axes[i]])));
            let triangle = self.ids[first + i];
            let mut rest = rays & !done;
            while rest != 0 {
                let group = rest.trailing_zeros() as usize / GROUP;
                let base = group * GROUP;
                let members = (rest >> base) as u32 & 0xffff;
                rest &= !(0xffff << base);
                let shear = packet.shear::<S>(simd, group);
                let edges: Edges<S::F16> = shear.edges(permuted);
                let extreme = (packet.extreme >> base) as u32 & members;
                let inside = edges.inside(simd).bits() & members & !extreme;
                if inside | extreme == 0 {
                    continue;
                }
                let distance = shear.distance(simd, &edges);
                let on_edge = distance.on_edge.bits() & inside;
                let certain = distance.ahead.bits() & inside & !on_edge;
                let mut doubtful = distance.doubtful.bits() & inside & !on_edge;
                let close = distance.close.bits();
                let t_max: S::F16 = packet.rays.t_max.get(simd, group);
                if doubtful != 0 {
                    let beyond = distance.rough.and((t_max + distance.margin).lt(distance.t));
                    doubtful &= !beyond.bits();
                }
                let u = edges.weights[1] * distance.inverse_determinant;
                let v = edges.weights[2] * distance.inverse_determinant;
                let mut one_by_one = doubtful | on_edge | extreme;
                if certain != 0 {
                    let t = distance.t;
                    let closer = certain & t.lt(t_max).bits();
                    let equal = certain & t.eq(t_max).bits();
                    if ANY && takes.is_none() {
                        done |= u64::from(closer | equal) << base;
                    } else if takes.is_none() {
                        found.keep::<S>(simd, packet, group, closer, [t, u, v], triangle, instance);
                        one_by_one |= equal;
                    } else {
                        one_by_one |= closer | equal;
                    }
                }
                if one_by_one == 0 {
                    continue;
                }
                let (mut ts, mut us, mut vs) = ([0.0; GROUP], [0.0; GROUP], [0.0; GROUP]);
                distance.t.store(&mut ts);
                u.store(&mut us);
                v.store(&mut vs);
                for k in each(u64::from(one_by_one)) {
                    let k = k % GROUP;
                    let lane = base + k;
                    let rough = TriangleHit { t: ts[k], u: us[k], v: vs[k] };
                    let t_max = packet.rays.t_max.0[lane % PACKET];
                    let hit = if certain >> k & 1 != 0 {
                        Some(rough)
                    } else if doubtful >> k & 1 != 0 {
                        packet.probe(lane).doubtful_triangle(&corners, t_max, close >> k & 1 != 0)
                    } else {
                        packet.probe(lane).triangle(&corners, t_max)
                    };
                    let Some(TriangleHit { t, u, v }) = hit else { continue };
                    let hit = Hit { t, u, v, triangle, instance };
                    if found
                        .offer(packet, lane, hit, |hit| takes.as_ref().is_none_or(|takes| takes(lane, hit)))
                        && ANY
                    {
                        done |= 1 << lane;
                    }
                }
            }
        }
        done
    }
}
