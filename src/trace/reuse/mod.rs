//! Paths that neighbours share: what was found at the end of one's first bounce, others see as well.
//!
//! Pixels of a tile form groups. Each member sends its path from its own point x to some point y, and the light
//! that y sends back, found once, is weighted among all members that see y, by how likely each would have come there
//! itself: n paths cost little more than n shadow rays each, and every pixel has n of them. No weight exceeds 1, and
//! those of a path add up to 1: nothing is biased, and no pixel gets more from a path than whoever found it would have.
//! That holds too where something half-transparent is between them: who sees y is then a matter of chance, drawn for
//! each way by itself, and whoever found y is one who did see it.
//!
//! Reference: P. Bekaert, M. Sbert, J. Halton, "Accelerating Path Tracing by Re-Using Paths", Eurographics Workshop on
//! Rendering 2002; the weights are E. Veach's balance heuristic.
//!
//! Members are of one colour of the chess board by which samples are allotted, so that a pixel's share still
//! does not depend on its samples. All members have the same share.

mod group;
mod lanes;

pub(super) use group::even_out;

use super::TraceScene;
use super::film::Tile;
use super::integrator::{Batch, Work};
use super::path::Path;
use super::sampler::Sampler;
use crate::bvh::Ray;
use glam::{UVec2, Vec3};
use group::{GROUPS, Groups, MEMBERS};
use lanes::Lanes;

/// Marks the random numbers of ways to neighbours' ends, apart from those of bounces and shadows.
const WAY: u32 = 1 << 30;
/// Rays between neighbours that are traced together.
const RAYS: usize = 4096;

/// What a batch remembers of its paths' first bounces.
#[derive(Debug, Default)]
pub(super) struct Reuse {
    /// Whether paths are shared at all.
    pub(super) on: bool,
    groups: Groups,
    sets: Vec<Set>,
    starts: Vec<Option<Start>>,
    ends: Vec<End>,
    queue: Queue,
    lanes: Lanes,
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

/// Ends that are about to be shared, and the rays to them.
#[derive(Debug, Default)]
struct Queue {
    shared: Vec<Shared>,
    /// Of all that are shared, one after the other.
    ways: Vec<Way>,
    /// Along them.
    rays: Vec<Ray>,
    blocked: Vec<bool>,
}

/// To a neighbour's end.
#[derive(Clone, Copy, Debug)]
struct Way {
    entry: u32,
    /// Whose member of its group that is.
    member: u32,
    /// Whose end it is.
    owner: u32,
    /// Of going there, by area times π.
    density: f32,
}

/// An end, how likely its own path was to go there, and how many others may see it.
#[derive(Clone, Copy, Debug)]
struct Shared {
    entry: u32,
    density: f32,
    ways: u32,
}

impl Reuse {
    /// Begins with another batch, of a tile of this size.
    pub(super) fn enter(&mut self, scene: &TraceScene, size: UVec2) {
        self.on = scene.settings.shares_paths();
        if self.on {
            self.groups.of(size);
            self.sets.clear();
        }
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

    /// A path has met an evenly reflecting surface: if it came there by its first bounce, what it finds from there on is
    /// for all, and is gathered in an entry of its own.
    pub(super) fn divert(&mut self, path: &mut Path) {
        if self.on && path.depth == 1 && self.starts[path.entry as usize].is_some() {
            self.ends[path.entry as usize] = End::Alone;
            path.entry += self.starts.len() as u32;
            path.throughput = Vec3::ONE;
        }
    }

    /// Where a path arrived, if it has just been diverted.
    pub(super) fn end(&mut self, path: &Path, end: End) {
        if path.depth == 1
            && let Some(entry) = (path.entry as usize).checked_sub(self.starts.len())
            && let Some(here) = self.ends.get_mut(entry)
        {
            *here = end;
        }
    }

    /// Queues the end of member `m` of a set, and the rays to it from all others.
    fn queue(&mut self, scene: &TraceScene, m: usize, entry: u32) {
        let (density, ways) = match self.ends[entry as usize] {
            End::Elsewhere => return,
            End::Alone => (1.0, 0),
            End::Seen { target, normal, shading } => {
                self.lanes.weigh(scene.geometry.tlas.isa(), target, normal, shading);
                let (own, queue) = (self.lanes.density[m], &mut self.queue);
                if own > 0.0 {
                    (own, self.lanes.go(scene, m, [target, normal], &mut queue.rays, &mut queue.ways))
                } else {
                    // So flat an angle, or so near, that only the ray itself could tell.
                    (1.0, 0)
                }
            }
        };
        self.queue.shared.push(Shared { entry, density, ways });
    }
}

impl Batch {
    /// Notes which samples come next: as many of all members of a group.
    pub(super) fn begin_groups(&mut self, tile: &Tile, work: Work, together: u32) {
        let colour = self.colour;
        for group in 0..GROUPS {
            if colour.is_some_and(|colour| colour as usize % GROUPS != group) {
                continue;
            }
            let members = std::mem::take(&mut self.reuse.groups.members[group]);
            if let Some(&leader) = members.first() {
                let more = tile.more.get(leader as usize).copied().unwrap_or(0);
                let first = tile.next_sample + more;
                let count = match work {
                    _ if colour.is_some() => 1,
                    Work::Half => 0,
                    Work::Even { until } => {
                        let most = (together / tile.size.element_product()).max(1);
                        until.saturating_sub(first).min(most)
                    }
                    Work::Shares { beyond } => {
                        let room = together.saturating_sub(self.keys.len() as u32) / members.len() as u32;
                        tile.goal(leader as usize, beyond).saturating_sub(more).min(room)
                    }
                };
                let mut set = Set { first: [0; MEMBERS], members: members.len(), samples: count };
                for (of_member, &pixel) in set.first.iter_mut().zip(&members) {
                    *of_member = self.keys.len() as u32;
                    self.keys.extend((first..first + count).map(|sample| (pixel, sample)));
                }
                self.reuse.sets.push(set);
            }
            self.reuse.groups.members[group] = members;
        }
    }

    /// The random numbers of an entry's path beyond its own point: those of its group together are as even as those
    /// of one pixel.
    pub(super) fn shared_sampler(&self, entry: u32) -> Sampler {
        self.sampler_in(&self.reuse.groups, entry)
    }

    fn sampler_in(&self, groups: &Groups, entry: u32) -> Sampler {
        let (pixel, sample) = self.keys[entry as usize];
        let (leader, rank) = groups.ranks[pixel as usize];
        self.pixels[leader as usize].1[sample as usize & 1].at(sample).shared(rank, MEMBERS as u32)
    }

    /// Gives all members what their paths have found. Returns how many rays that took.
    pub(super) fn share(&mut self, scene: &TraceScene) -> u64 {
        if !self.reuse.on {
            return 0;
        }
        let mut reuse = std::mem::take(&mut self.reuse);
        let mut rays = 0;
        for i in 0..reuse.sets.len() {
            let set = reuse.sets[i];
            for sample in 0..set.samples {
                reuse.lanes.load(&set, sample, &reuse.starts);
                for m in 0..set.members {
                    let entry = set.first[m] + sample;
                    if self.radiance[reuse.starts.len() + entry as usize] != Vec3::ZERO {
                        reuse.queue(scene, m, entry);
                    }
                }
                if reuse.queue.rays.len() > RAYS - MEMBERS * MEMBERS {
                    rays += self.give(scene, &reuse.groups, &reuse.starts, &mut reuse.queue);
                }
            }
        }
        rays += self.give(scene, &reuse.groups, &reuse.starts, &mut reuse.queue);
        self.reuse = reuse;
        rays
    }

    /// Gives what the queued ends send back to all who see them.
    fn give(
        &mut self,
        scene: &TraceScene,
        groups: &Groups,
        starts: &[Option<Start>],
        queue: &mut Queue,
    ) -> u64 {
        let Queue { shared, ways, rays, blocked } = queue;
        blocked.clear();
        blocked.resize(rays.len(), false);
        scene.any_hits(rays, blocked, &[], |i, key| {
            let way = &ways[i];
            self.sampler_in(groups, way.owner).hashed(key, WAY | way.member)
        });
        let mut first = 0;
        for end in shared.iter() {
            let range = first..first + end.ways as usize;
            first = range.end;
            let all = ways[range.clone()].iter().zip(&blocked[range]);
            let seen = all.filter(|(_, blocked)| !**blocked).map(|(way, _)| (way.entry, way.density));
            let sum = end.density + seen.clone().map(|(_, density)| density).sum::<f32>();
            let found = self.radiance[starts.len() + end.entry as usize] / sum;
            for (entry, density) in seen.chain([(end.entry, end.density)]) {
                if let Some(start) = &starts[entry as usize] {
                    self.radiance[entry as usize] += start.throughput * found * density;
                }
            }
        }
        let count = rays.len() as u64;
        shared.clear();
        ways.clear();
        rays.clear();
        count
    }
}
