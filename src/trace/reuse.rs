//! Paths that neighbours share: what was found at the end of one's first bounce, others see as well.
//!
//! Pixels of a tile form groups. Each member sends its path from its own point x to some point y, and the light
//! that y sends back, found once, is weighted among all members that see y, by how likely each would have come there
//! itself: n paths cost little more than n shadow rays each, and every pixel has n of them. No weight exceeds 1, and
//! those of a path add up to 1: nothing is biased, and nothing is noisier than before.
//!
//! Reference: P. Bekaert, M. Sbert, J. Halton, "Accelerating Path Tracing by Re-Using Paths", Eurographics Workshop on
//! Rendering 2002; the weights are E. Veach's balance heuristic.
//!
//! Members are of one colour of the chess board by which samples are allotted, so that a pixel's share still
//! does not depend on its samples. All members have the same share.

use super::film::{TILE, Tile};
use super::integrator::{Batch, Path, Work};
use super::sampler::hash;
use super::warp::offset;
use super::{Integrator, RenderSettings, TraceScene};
use crate::bvh::simd::{Job, Simd};
use crate::bvh::{Aabb, Ray};
use glam::{UVec2, Vec3};

/// Pixels that share: a power of two, at most half of a tile.
pub const MEMBERS: usize = 32;
const GROUPS: usize = (TILE * TILE) as usize / MEMBERS;
/// Rays between neighbours that are traced together.
const RAYS: usize = 4096;
/// Bound on the rounding of a ray between two points, over the size of their coordinates.
const ROUNDING: f32 = 4.0 / (1 << 24) as f32;

/// The group of a pixel of a tile: of one colour, and as far from each other as others of the group.
fn group(x: u32, y: u32) -> usize {
    let colour = (x ^ y) & 1;
    let finer = if GROUPS >= 8 { (x >> 1 & 1) << 1 | (y >> 1 & 1) << 2 } else { ((x ^ y) >> 1 & 1) << 1 };
    (colour | finer) as usize % GROUPS
}

/// Makes the shares of the members of each group equal; rows of a picture of `width` pixels.
pub(super) fn even_out(shares: &mut [f32], width: usize) {
    let tile = TILE as usize;
    let height = shares.len() / width.max(1);
    for (top, left) in (0..height).step_by(tile).flat_map(|y| (0..width).step_by(tile).map(move |x| (y, x))) {
        let pixels = || {
            (top..(top + tile).min(height)).flat_map(move |y| {
                (left..(left + tile).min(width))
                    .map(move |x| (group((x - left) as u32, (y - top) as u32), y * width + x))
            })
        };
        let (mut sums, mut counts) = ([0.0; GROUPS], [0.0; GROUPS]);
        for (group, i) in pixels() {
            sums[group] += shares[i];
            counts[group] += 1.0;
        }
        for (group, i) in pixels() {
            shares[i] = sums[group] / counts[group];
        }
    }
}

/// What a batch remembers of its paths' first bounces.
#[derive(Debug, Default)]
pub(super) struct Reuse {
    /// Whether paths are shared at all.
    pub(super) on: bool,
    groups: [Vec<u32>; GROUPS],
    /// Of each pixel of the tile: the first of its group, and its number in it.
    ranks: Vec<(u32, u32)>,
    sets: Vec<Set>,
    starts: Vec<Option<Start>>,
    ends: Vec<End>,
    rays: Vec<Ray>,
    blocked: Vec<bool>,
    ways: Vec<Way>,
    shared: Vec<Shared>,
}

/// Samples of the members of one group.
#[derive(Clone, Copy, Debug)]
struct Set {
    /// The entry of the first sample of each; the other samples follow.
    first: [u32; MEMBERS],
    members: usize,
    samples: u32,
}

/// Where a path began its first bounce.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    /// Of its ray.
    pub(super) origin: Vec3,
    /// Around which its direction was chosen.
    pub(super) normal: Vec3,
    /// Below which there is none.
    pub(super) side: Vec3,
    /// What light from there is worth at the eye: albedo.
    pub(super) throughput: Vec3,
}

/// Where it arrived.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum End {
    /// Not on an evenly reflecting surface: what it brings, it has brought.
    #[default]
    Elsewhere,
    /// There, but the surface looks otherwise from elsewhere.
    Alone,
    /// There, and it looks the same from wherever it is seen.
    Seen {
        /// Where a ray to it ends: just off the surface.
        target: Vec3,
        /// Geometric, on the side that the path came from.
        normal: Vec3,
        /// The normal it is shaded with; only from where that is toward the eye it looks the same.
        shading: Vec3,
    },
}

/// To a neighbour's end.
#[derive(Clone, Copy, Debug)]
struct Way {
    entry: u32,
    /// Density of going there, by area times π.
    density: f32,
    /// Which member's end it is.
    to: u32,
}

/// An end that is shared.
#[derive(Clone, Copy, Debug)]
struct Shared {
    entry: u32,
    density: f32,
    ways: u32,
}

/// Whether pictures with these settings are made so.
pub(super) fn is_on(settings: &RenderSettings) -> bool {
    settings.reuse && settings.integrator == Integrator::Path && settings.max_depth > 1
}

impl Reuse {
    /// The groups of another tile.
    pub(super) fn enter(&mut self, scene: &TraceScene, size: UVec2) {
        self.on = is_on(scene.settings);
        if !self.on {
            return;
        }
        self.groups.iter_mut().for_each(Vec::clear);
        self.ranks.clear();
        for (i, (x, y)) in (0..).zip((0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y)))) {
            let group = &mut self.groups[group(x, y)];
            group.push(i);
            self.ranks.push((group[0], group.len() as u32 - 1));
        }
        self.sets.clear();
    }

    /// Notes the samples of a group, the keys of whose members are at `first`.
    fn note(&mut self, first: impl Iterator<Item = u32>, samples: u32) {
        let mut set = Set { first: [0; MEMBERS], members: 0, samples };
        for first in first {
            set.first[set.members] = first;
            set.members += 1;
        }
        self.sets.push(set);
    }

    /// Before the paths of `entries` samples are followed.
    pub(super) fn begin(&mut self, entries: usize) {
        if self.on {
            self.starts.clear();
            self.starts.resize(entries, None);
            self.ends.clear();
            self.ends.resize(entries, End::Elsewhere);
        }
    }

    /// Notes where a path begins its first bounce.
    pub(super) fn start(&mut self, entry: u32, start: Start) {
        self.starts[entry as usize] = Some(start);
    }

    /// A path has met an evenly reflecting surface: what it finds from there on is for all.
    pub(super) fn divert(&mut self, path: &mut Path) {
        if self.on && path.depth == 1 && self.starts[path.entry as usize].is_some() {
            self.ends[path.entry as usize] = End::Alone;
            path.entry += self.starts.len() as u32;
            path.throughput = Vec3::ONE;
        }
    }

    /// Where a path arrived, if its first bounce went there and it has been diverted.
    pub(super) fn end(&mut self, path: &Path, end: End) {
        if path.depth == 1
            && let Some(entry) = (path.entry as usize).checked_sub(self.starts.len())
            && let Some(here) = self.ends.get_mut(entry)
        {
            *here = end;
        }
    }
}

impl Batch {
    /// Notes which samples come next of a tile whose groups have shares.
    pub(super) fn begin_groups(&mut self, tile: &Tile, work: Work, together: u32) {
        for group in 0..GROUPS {
            let members = std::mem::take(&mut self.reuse.groups[group]);
            if let Some(&leader) = members.first() {
                let more = tile.more.get(leader as usize).copied().unwrap_or(0);
                let first = tile.next_sample + more;
                let room = together.saturating_sub(self.keys.len() as u32) / members.len() as u32;
                let count = match work {
                    Work::Even { until } => {
                        until.saturating_sub(first).min((together / tile.size.element_product()).max(1))
                    }
                    Work::Shares { beyond } => {
                        tile.goal(leader as usize, beyond).saturating_sub(more).min(room)
                    }
                };
                let base = self.keys.len() as u32;
                self.keys.extend(members.iter().flat_map(|&i| (first..first + count).map(move |s| (i, s))));
                self.reuse.note((0..members.len() as u32).map(|m| base + m * count), count);
            }
            self.reuse.groups[group] = members;
        }
    }

    /// The random numbers of an entry's path beyond its own point: those of its group together are as even as those
    /// of one pixel.
    pub(super) fn shared_sampler(&self, entry: u32) -> super::sampler::Sampler {
        let (pixel, sample) = self.keys[entry as usize];
        let (leader, rank) = self.reuse.ranks[pixel as usize];
        self.pixels[leader as usize].1[sample as usize & 1].at(sample).shared(rank, MEMBERS as u32)
    }

    /// Gives all members what their paths have found. Returns how many rays that took.
    pub(super) fn share(&mut self, scene: &TraceScene) -> u64 {
        if !self.reuse.on {
            return 0;
        }
        let mut reuse = std::mem::take(&mut self.reuse);
        let mut rays = 0;
        let mut lanes = Lanes::default();
        for set in &reuse.sets {
            for sample in 0..set.samples {
                lanes.load(set, sample, &reuse.starts);
                for m in 0..set.members {
                    let entry = set.first[m] + sample;
                    let found = self.radiance[reuse.starts.len() + entry as usize];
                    if found == Vec3::ZERO {
                        continue;
                    }
                    let alone = Shared { entry, density: 1.0, ways: 0 };
                    let shared = match reuse.ends[entry as usize] {
                        End::Elsewhere => continue,
                        End::Alone => alone,
                        End::Seen { target, normal, shading } => {
                            lanes.weigh(scene, target, normal, shading);
                            let own = lanes.density[m];
                            if own > 0.0 && own.is_finite() {
                                let ways =
                                    lanes.ways(scene, m, [target, normal], &mut reuse.rays, &mut reuse.ways);
                                Shared { entry, density: own, ways }
                            } else {
                                alone
                            }
                        }
                    };
                    reuse.shared.push(shared);
                }
                if reuse.rays.len() > RAYS - MEMBERS * MEMBERS {
                    rays += self.give(
                        scene,
                        &reuse.starts,
                        &mut reuse.shared,
                        &mut reuse.rays,
                        &mut reuse.ways,
                        &mut reuse.blocked,
                    );
                }
            }
        }
        rays += self.give(
            scene,
            &reuse.starts,
            &mut reuse.shared,
            &mut reuse.rays,
            &mut reuse.ways,
            &mut reuse.blocked,
        );
        self.reuse = reuse;
        rays
    }

    /// Gives out what the noted ends send back, to all who see them.
    fn give(
        &mut self,
        scene: &TraceScene,
        starts: &[Option<Start>],
        shared: &mut Vec<Shared>,
        rays: &mut Vec<Ray>,
        ways: &mut Vec<Way>,
        blocked: &mut Vec<bool>,
    ) -> u64 {
        blocked.clear();
        blocked.resize(rays.len(), false);
        let random = |i: usize, key: u32| {
            let (pixel, sample) = self.keys[ways[i].entry as usize];
            self.pixels[pixel as usize].1[sample as usize & 1].at(sample).hashed(hash(key ^ hash(ways[i].to)))
        };
        scene.any_hits(rays, blocked, &[], random);
        let mut first = 0;
        for end in shared.iter() {
            let range = first..first + end.ways as usize;
            first = range.end;
            let seen =
                || ways[range.clone()].iter().zip(&blocked[range.clone()]).filter(|(_, blocked)| !**blocked);
            let sum = end.density + seen().map(|(way, _)| way.density).sum::<f32>();
            let found = self.radiance[starts.len() + end.entry as usize] / sum;
            let seen = seen().map(|(way, _)| (way.entry, way.density));
            for (entry, density) in seen.chain([(end.entry, end.density)]) {
                if let Some(start) = &starts[entry as usize] {
                    self.radiance[entry as usize] += start.throughput * found * density;
                }
            }
        }
        let count = rays.len() as u64;
        shared.clear();
        rays.clear();
        ways.clear();
        count
    }
}

/// Where the members of a group start, side by side.
#[derive(Debug, Default)]
struct Lanes {
    origin: [[f32; MEMBERS]; 3],
    normal: [[f32; MEMBERS]; 3],
    side: [[f32; MEMBERS]; 3],
    entry: [u32; MEMBERS],
    /// Of going to some end; 0 where there is no way.
    density: [f32; MEMBERS],
    bounds: Aabb,
}

impl Lanes {
    fn load(&mut self, set: &Set, sample: u32, starts: &[Option<Start>]) {
        self.bounds = Aabb::EMPTY;
        for m in 0..MEMBERS {
            let entry = set.first[m] + sample;
            let start = if m < set.members { starts[entry as usize] } else { None };
            self.entry[m] = entry;
            if let Some(start) = &start {
                self.bounds = self.bounds.with(start.origin);
            }
            let blank =
                Start { origin: Vec3::ZERO, normal: Vec3::ZERO, side: Vec3::ZERO, throughput: Vec3::ZERO };
            let start = start.unwrap_or(blank);
            for axis in 0..3 {
                self.origin[axis][m] = start.origin[axis];
                self.normal[axis][m] = start.normal[axis];
                self.side[axis][m] = start.side[axis];
            }
        }
    }

    /// How likely each member's path would have gone to this end.
    fn weigh(&mut self, scene: &TraceScene, target: Vec3, normal: Vec3, shading: Vec3) {
        scene.geometry.tlas.isa().run(Weigh { lanes: self, target, normal, shading });
    }

    /// Queues rays to it from all but `own`.
    fn ways(
        &self,
        scene: &TraceScene,
        own: usize,
        [target, normal]: [Vec3; 2],
        rays: &mut Vec<Ray>,
        ways: &mut Vec<Way>,
    ) -> u32 {
        // A ray rounds on its way; it must not meet the surface that it ends on.
        let reach = self.bounds.min.abs().max(self.bounds.max.abs()) + target.abs();
        let target = offset(target, reach * ROUNDING, normal);
        let around = self.bounds.with(target);
        let lamps = scene.lights.any_shape(|bounds| bounds.overlaps(&around));
        let before = ways.len();
        for m in (0..MEMBERS).filter(|m| *m != own && self.density[*m] > 0.0) {
            let origin = Vec3::new(self.origin[0][m], self.origin[1][m], self.origin[2][m]);
            let ray = Ray { origin, direction: target - origin, t_max: 1.0 };
            if lamps && scene.lights.blocks(&ray, u32::MAX) {
                continue;
            }
            rays.push(ray);
            ways.push(Way { entry: self.entry[m], density: self.density[m], to: own as u32 });
        }
        (ways.len() - before) as u32
    }
}

struct Weigh<'a> {
    lanes: &'a mut Lanes,
    target: Vec3,
    normal: Vec3,
    shading: Vec3,
}

impl Job for Weigh<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self { lanes, target, normal, shading } = self;
        for m in 0..MEMBERS {
            let of = |rows: &[[f32; MEMBERS]; 3]| Vec3::new(rows[0][m], rows[1][m], rows[2][m]);
            let d = target - of(&lanes.origin);
            let distance2 = d.length_squared();
            let leaves = of(&lanes.normal).dot(d);
            let arrives = -normal.dot(d);
            let seen =
                (leaves > 0.0) & (of(&lanes.side).dot(d) > 0.0) & (arrives > 0.0) & (shading.dot(d) < 0.0);
            let density = (leaves / distance2) * (arrives / distance2);
            let finite = density < f32::MAX;
            lanes.density[m] = if seen & finite { density } else { 0.0 };
        }
    }
}
