//! Follows light back from the eye: all paths of a batch together, one bounce at a time.
//!
//! Each wave is four steps over whole batches: trace, shade (which queues shadow rays), trace the
//! shadows (or sooner, if they are many), keep the paths that go on. The result for a sample is a function of its
//! [`Sampler`] alone, so it does not matter who shares the batch.

use super::block::LANES;
use super::bsdf::Lobes;
use super::camera::LookOut;
use super::connect::{Look, RaysToLights, Shadow, looks, passed, power_heuristic};
use super::diffuse::Diffuse;
use super::film::Tile;
use super::light::FlatLight;
use super::light_tree::Receiver;
use super::lights::LightHit;
use super::pass::RayCounts;
use super::reuse::Reuse;
use super::sampler::{Sampler, SamplerRow};
use super::scene::Surface;
use super::surface::Interaction;
use super::{Integrator, TraceScene};
use crate::bvh::{Hit, Ray};
use glam::{UVec2, Vec2, Vec3};

/// One path under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    /// Which entry of the batch it adds to.
    pub(super) entry: u32,
    pub(super) sampler: Sampler,
    pub(super) ray: Ray,
    /// What light at the ray's end is worth at the eye.
    pub(super) throughput: Vec3,
    pub(super) depth: u32,
    /// How the last bounce chose the ray's direction; `None`: no light sample could have found it.
    pub(super) bounce: Option<Bounce>,
    /// Only collects what shines at its end.
    pub(super) last: bool,
    /// Absorption coefficient of the body that the ray crosses; zero outside.
    pub(super) absorption: Vec3,
}

impl Path {
    /// What absorbs beyond a vertex.
    fn absorption_toward(&self, surface: &Surface, at: &Interaction, wi: Vec3) -> Vec3 {
        match surface.body() {
            Some(body) if at.geometric_normal.dot(wi) < 0.0 => {
                if at.front {
                    body.absorption
                } else {
                    Vec3::ZERO
                }
            }
            _ => self.absorption,
        }
    }

    /// With what is left where its ray has come to `t`.
    fn after(mut self, t: f32) -> Self {
        if self.absorption != Vec3::ZERO {
            self.throughput *= passed(self.absorption, t * self.ray.direction.length());
        }
        self
    }
}

/// The smooth bounce that a ray comes from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounce {
    pub(super) pdf: f32,
    /// The very one for which lights were chosen: where it is they may be as likely by a factor of a hundred.
    pub(super) from: Receiver,
    /// Lights that have been counted in full where it comes from, a bit for each.
    pub(super) counted: u32,
}

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

/// Dimensions of the sampler: pair 0 is the place in the pixel, 1 that on the lens; a bounce has this many pairs
/// from 1 on, of which it does not use the first.
pub(super) const PAIRS_PER_BOUNCE: u32 = 32;
pub(super) const LOBE: u32 = 1;
pub(super) const DIRECTION: u32 = 2;
pub(super) const PICK: u32 = 3;
pub(super) const LIGHT: u32 = 4;
/// What is farther than a surface by no more than that is where it is: a lamp may lie in the plane of a ceiling.
const SAME_PLACE: f32 = 1.0 + 1e-6;
/// From this depth on a path may end by chance.
pub(super) const ROULETTE_DEPTH: u32 = 4;

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
        self.follow(scene, size, rays);
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

    /// Finds the radiance of all samples in `keys`.
    pub(super) fn follow(&mut self, scene: &TraceScene, size: UVec2, rays: &mut RayCounts) {
        self.look(scene, size);
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
    }

    /// Makes the camera rays.
    fn look(&mut self, scene: &TraceScene, size: UVec2) {
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
            scene.geometry.tlas.isa().run(LookOut { viewpoint, size, samplers, corners: [&x, &y], rays });
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

    /// What the end of a path's ray sends back along it, and where it goes on.
    fn arrive(&mut self, scene: &TraceScene, index: usize) {
        let (path, hit) = (self.path(index), self.hits[index]);
        let reach = hit.map_or(path.ray.t_max, |hit| hit.t * SAME_PLACE);
        let may_meet = path.depth > 0 || self.diffuse.lights_in_view;
        let found = may_meet.then(|| scene.lights.closest(&Ray { t_max: reach, ..path.ray })).flatten();
        // The back of a lamp is no surface.
        let is_seen = |found: &LightHit<'_>| {
            hit.is_none_or(|hit| found.hit.t <= hit.t)
                || found.shape.emitted(&path.ray, &found.hit) != Vec3::ZERO
        };
        let found = found.filter(is_seen);
        // A bounce finds also those that only shine; the eye and mirrors do not see them.
        if path.bounce.is_some() {
            let on_the_way = Ray { t_max: found.map_or(reach, |found| found.hit.t), ..path.ray };
            scene.lights.unseen_on(&on_the_way, |passed| self.meet(scene, &path, &passed));
        }
        if let Some(found) = found {
            self.meet(scene, &path, &found);
            return;
        }
        let dimmed = if path.absorption == Vec3::ZERO { None } else { hit.map(|hit| path.after(hit.t)) };
        let path = dimmed.as_ref().unwrap_or(&path);
        let Some(hit) = hit else {
            let normal = path.bounce.map_or(Vec3::Z, |b| b.from.normal);
            for (light, beyond) in scene.lights.beyond() {
                if let Some((radiance, pdf)) = beyond.beyond(normal, path.ray.direction) {
                    self.collect(scene, path, light, radiance, pdf);
                }
            }
            return;
        };
        let (instance, surface) = scene.surface_at(&hit);
        // Inside a body even the way from a light counts.
        if surface.is_diffuse() && path.absorption == Vec3::ZERO {
            if !path.last && path.depth < scene.settings.max_depth {
                self.diffuse.add(scene, index, &hit, path.depth);
                if let Some(path) = self.paths.get_mut(index) {
                    self.reuse.divert(path);
                }
            }
            return;
        }
        let at = Interaction::new(scene, instance, &hit, &path.ray);
        if surface.material.unlit {
            let texel = scene.texture(surface.base_color_texture, at.uvs) * at.color;
            let shown = surface.material.base_color * texel.truncate();
            self.radiance[path.entry as usize] += path.throughput * shown;
            return;
        }
        let emission = at.emission(scene, surface);
        if emission != Vec3::ZERO {
            let slot = instance.mesh.slot(hit.triangle as usize) as u16;
            match scene.lights.of_mesh(hit.instance, slot) {
                Some(light) => {
                    let distance2 = (at.position - path.ray.origin).length_squared();
                    let cos = at.geometric_normal.dot(path.ray.direction).abs();
                    let pdf = match scene.lights.get(light) {
                        FlatLight::Mesh(mesh) => path
                            .bounce
                            .map_or(0.0, |bounce| mesh.pdf(hit.triangle, &bounce.from, distance2, cos)),
                        _ => 0.0,
                    };
                    self.collect(scene, path, light, emission, pdf);
                }
                None => self.radiance[path.entry as usize] += path.throughput * emission,
            }
        }
        if !path.last && path.depth < scene.settings.max_depth {
            self.scatter(scene, path, surface, &at);
        }
    }

    /// Adds the light of a shape that a ray ran into.
    fn meet(&mut self, scene: &TraceScene, path: &Path, LightHit { light, shape, hit }: &LightHit<'_>) {
        let radiance = shape.emitted(&path.ray, hit);
        let pdf = path.bounce.map_or(0.0, |bounce| shape.pdf(&path.ray, bounce.from.normal, hit));
        self.collect(scene, &path.after(hit.t), *light, radiance, pdf);
    }

    /// Adds light that a ray ran into, weighted against the chance of having sampled it.
    fn collect(&mut self, scene: &TraceScene, path: &Path, light: u32, radiance: Vec3, pdf: f32) {
        let weight = path.bounce.map_or(1.0, |bounce| {
            if light < u32::BITS && bounce.counted >> light & 1 == 1 {
                return 0.0;
            }
            let light_pdf = pdf * scene.expected_looks(path.depth - 1, light, &bounce.from);
            power_heuristic(bounce.pdf, light_pdf)
        });
        self.radiance[path.entry as usize] += path.throughput * radiance * weight;
    }

    /// Queues shadow rays to lights, and the ray that goes on.
    pub(super) fn scatter(&mut self, scene: &TraceScene, path: &Path, surface: &Surface, at: &Interaction) {
        let bsdf = at.bsdf(scene, surface);
        let to = Receiver { point: at.position, normal: bsdf.normal() };
        let base = 1 + path.depth * PAIRS_PER_BOUNCE;
        // Direct lighting finds Lambert's share by light samples alone: no ray is spent on it.
        let followed = match scene.settings.integrator {
            Integrator::Direct => Lobes::SPECULAR,
            Integrator::Path => Lobes::ALL,
        };
        if bsdf.has_smooth_lobes() && !scene.lights.is_empty() {
            for Look { pick, sampler, u } in looks(scene, path.sampler, path.depth, to) {
                if let Some(sample) = scene.lights.get(pick.light).sample(at.position, bsdf.normal(), u) {
                    let path = Path { absorption: path.absorption_toward(surface, at, sample.wi), ..*path };
                    self.connect(scene, &path, at, &bsdf, followed, &pick, &sampler, &sample);
                }
            }
        }
        if !bsdf.has(followed) {
            return;
        }
        let choice = path.sampler.pair(base + LOBE);
        let Some(sample) = bsdf.sample(choice.x, path.sampler.pair(base + DIRECTION), followed) else {
            return;
        };
        let mut throughput = path.throughput * sample.weight;
        if path.depth >= ROULETTE_DEPTH {
            let survival = throughput.max_element().clamp(0.05, 1.0);
            if choice.y >= survival {
                return;
            }
            throughput /= survival;
        }
        let origin = match sample.pdf {
            Some(_) => at.lit_origin_toward(sample.wi),
            None => at.origin_toward(sample.wi),
        };
        let absorption = path.absorption_toward(surface, at, sample.wi);
        self.next.push(Path {
            entry: path.entry,
            sampler: path.sampler,
            ray: Ray::new(origin, sample.wi),
            throughput,
            depth: path.depth + 1,
            bounce: sample.pdf.map(|pdf| Bounce { pdf, from: to, counted: 0 }),
            last: !sample.follow && scene.settings.integrator == Integrator::Direct,
            absorption,
        });
    }
}
