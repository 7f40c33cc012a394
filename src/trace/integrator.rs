//! Follows light back from the eye: all paths of a batch together, one bounce at a time.
//!
//! Each wave is four steps over whole batches: trace, shade (which queues shadow rays), trace the
//! shadows (or sooner, if they are many), keep the paths that go on. The result for a sample is a function of its
//! [`Sampler`] alone, so it does not matter who shares the batch.

use super::TraceScene;
use super::block::LANES;
use super::camera::LookOut;
use super::connect::{RaysToLights, Shadow};
use super::diffuse::Diffuse;
use super::features;
use super::film::Tile;
use super::pass::RayCounts;
use super::path::Path;
use super::reuse::Reuse;
use super::sampler::{Sampler, SamplerRow};
use crate::bvh::{Hit, Ray};
use glam::{UVec2, Vec2, Vec3};

/// Which samples a tile is to get.
#[derive(Clone, Copy, Debug)]
pub enum Work {
    /// All pixels those below index `until`, as far as they do not have them.
    Even {
        /// The first that is not to be taken.
        until: u32,
    },
    /// The pixels of one colour of the chess board a sample, unless they have it: half of the picture in half of the time.
    Half,
    /// Each pixel its share.
    Shares {
        /// Samples per pixel of the picture beyond the even ones.
        beyond: u32,
    },
}

impl Default for Work {
    fn default() -> Self {
        Self::Even { until: 0 }
    }
}

/// Samples that are followed together: more would only need more memory (a thread's buffers take about 1 MB).
const TOGETHER: u32 = 2048;

/// Buffers of one thread, kept between batches.
#[derive(Debug, Default)]
pub struct Batch {
    /// Top left corners and samplers of the tile's pixels.
    pub(super) pixels: Vec<(Vec2, [Sampler; 2])>,
    work: Work,
    /// Only pixels of this one are looked at.
    pub(super) colour: Option<u32>,
    pub(super) paths: Vec<Path>,
    pub(super) next: Vec<Path>,
    pub(super) shadows: Vec<Shadow>,
    pub(super) diffuse: Diffuse,
    pub(super) reuse: Reuse,
    pub(super) rays: Vec<Ray>,
    pub(super) rays_to_lights: RaysToLights,
    pub(super) hits: Vec<Option<Hit>>,
    pub(super) radiance: Vec<Vec3>,
    /// Which of `pixels`, and which sample: all of one pixel, then of another.
    pub(super) keys: Vec<(u32, u32)>,
}

impl Batch {
    /// Notes which samples of `tile` come next, as many as are followed together. False if there is none.
    pub fn begin(&mut self, scene: &TraceScene, tile: &Tile, work: Work) -> bool {
        self.keys.clear();
        self.work = work;
        let pixels = tile.size.element_product();
        self.reuse.enter(scene, tile.size);
        self.colour = match work {
            _ if tile.half => Some(1),
            Work::Half => Some(0),
            _ => None,
        };
        match work {
            Work::Half if tile.half => {}
            _ if self.reuse.on => self.begin_groups(tile, work, TOGETHER),
            _ if self.colour.is_some() => {
                let colour = |i: u32| ((i % tile.size.x) ^ (i / tile.size.x)) & 1;
                let own = (0..pixels).filter(|&i| self.colour == Some(colour(i)));
                self.keys.extend(own.map(|i| (i, tile.next_sample)));
            }
            Work::Half => {}
            Work::Even { until } if tile.more.is_empty() => {
                let first = tile.next_sample;
                let count = until.saturating_sub(first).min((TOGETHER / pixels).max(1));
                self.keys
                    .extend((0..pixels).flat_map(|i| (first..first + count).map(move |sample| (i, sample))));
            }
            Work::Even { .. } | Work::Shares { .. } => {
                for (i, &more) in (0..pixels).zip(&tile.more) {
                    let room = TOGETHER - self.keys.len() as u32;
                    let goal = match work {
                        Work::Shares { beyond } => tile.goal(i as usize, beyond),
                        Work::Even { until } => until.saturating_sub(tile.next_sample),
                        Work::Half => 0,
                    };
                    let count = goal.saturating_sub(more).min(room);
                    let first = tile.next_sample + more;
                    self.keys.extend((first..first + count).map(|sample| (i, sample)));
                }
            }
        }
        if self.keys.is_empty() {
            return false;
        }
        self.pixels.clear();
        Sampler::tile(tile.origin, tile.size, scene.settings, |halves| {
            let i = self.pixels.len() as u32;
            let corner = tile.origin + UVec2::new(i % tile.size.x, i / tile.size.x);
            self.pixels.push((corner.as_vec2(), halves));
        });
        true
    }

    /// Adds the samples that [`Batch::begin`] has noted, of a picture of `size`.
    pub fn render(&mut self, scene: &TraceScene, tile: &mut Tile, size: UVec2, rays: &mut RayCounts) {
        self.diffuse.enter(scene, tile, size);
        self.follow(scene, size, false, rays);
        self.diffuse.leave(tile);
        let mut dropped = 0;
        let mut done = 0;
        for run in self.keys.chunk_by(|a, b| a.0 == b.0) {
            let samples = run.iter().zip(&self.radiance[done..]).map(|(key, radiance)| (key.1, *radiance));
            dropped += tile.add(run[0].0 as usize, samples);
            done += run.len();
        }
        tile.dropped += dropped;
        match self.work {
            Work::Half => tile.half = true,
            Work::Even { .. } if tile.half => {
                tile.half = false;
                tile.next_sample += 1;
            }
            Work::Even { .. } if tile.more.is_empty() => {
                tile.next_sample += (self.keys.len() / self.pixels.len()) as u32;
            }
            Work::Even { .. } | Work::Shares { .. } => {
                for key in &self.keys {
                    tile.more[key.0 as usize] += 1;
                }
            }
        }
    }

    /// Finds the radiance of all samples in `keys`, anywhere in their pixels or in their `middles`.
    pub(super) fn follow(&mut self, scene: &TraceScene, size: UVec2, middles: bool, rays: &mut RayCounts) {
        // What others have looked up in this thread is not ours.
        let _ = features::take();
        self.look(scene, size, middles);
        self.radiance.clear();
        // What is shared comes after what is each one's own.
        let banks = if self.reuse.on { 2 } else { 1 };
        self.radiance.resize(banks * self.keys.len(), Vec3::ZERO);
        self.reuse.begin(self.keys.len());
        rays.camera += self.rays.len() as u64;
        self.paths.clear();
        self.wave(scene, rays);
        while !self.paths.is_empty() {
            self.rays.clear();
            self.rays.extend(self.paths.iter().map(|path| path.ray));
            self.wave(scene, rays);
        }
        rays.shadow += self.share(scene);
        rays.features = rays.features + features::take();
    }

    /// Makes the camera rays, anywhere in their pixels or through their `middles`.
    fn look(&mut self, scene: &TraceScene, size: UVec2, middles: bool) {
        self.rays.clear();
        self.rays.resize(self.keys.len(), Ray::new(Vec3::ZERO, Vec3::Z));
        for (keys, rays) in self.keys.chunks(LANES).zip(self.rays.chunks_mut(LANES)) {
            let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
            let mut samplers = SamplerRow::new(self.pixels[keys[0].0 as usize].1[0]);
            for (i, &(pixel, sample)) in keys.iter().enumerate() {
                let (corner, halves) = &self.pixels[pixel as usize];
                (x[i], y[i]) = (corner.x, corner.y);
                samplers.set(i, &halves[sample as usize & 1].at(sample));
            }
            let (viewpoint, samplers) = (scene.viewpoint, &samplers);
            scene.geometry.tlas.isa().run(LookOut {
                viewpoint,
                size,
                samplers,
                corners: [&x, &y],
                middles,
                rays,
            });
        }
    }

    /// Path number `index` of this wave. Those of the first one are as they begin.
    #[inline]
    pub(super) fn path(&self, index: usize) -> Path {
        if let Some(path) = self.paths.get(index) {
            return *path;
        }
        let (pixel, sample) = self.keys[index];
        Path {
            entry: index as u32,
            sampler: self.pixels[pixel as usize].1[sample as usize & 1].at(sample),
            ray: self.rays[index],
            throughput: Vec3::ONE,
            depth: 0,
            bounce: None,
            last: false,
            absorption: Vec3::ZERO,
        }
    }

    /// Its entry alone.
    #[inline]
    pub(super) fn entry(&self, index: usize) -> u32 {
        self.paths.get(index).map_or(index as u32, |path| path.entry)
    }

    /// Follows `rays`, which are those of `paths`; in the first wave there are none yet.
    fn wave(&mut self, scene: &TraceScene, rays: &mut RayCounts) {
        self.next.clear();
        self.shadows.clear();
        let mut hits = std::mem::take(&mut self.hits);
        hits.resize(self.rays.len(), None);
        let random = |i: usize, key: u32| {
            let path = self.path(i);
            path.sampler.hashed(key, path.depth)
        };
        // What was found by a light sample too has to be met by both alike.
        let looks = |i: usize| self.paths.get(i).is_none_or(|path| path.bounce.is_none());
        scene.closest_hits(&self.rays, &mut hits, looks, random);
        self.hits = hits;
        for i in 0..self.rays.len() {
            self.arrive(scene, i);
            rays.shadow += self.connect_many(scene);
        }
        rays.shadow += self.shade_diffuse(scene);
        rays.shadow += self.connect_lights(scene);
        rays.bounce += self.next.len() as u64;
        std::mem::swap(&mut self.paths, &mut self.next);
    }
}
