//! Follows light back from the eye: all paths of a batch together, one bounce at a time.
//!
//! Each wave is four steps over whole batches: trace, shade (which queues shadow rays), trace the
//! shadows, keep the paths that go on. The result for a sample is a function of its
//! [`Sampler`] alone, so it does not matter who shares the batch.

use super::bsdf::{Bsdf, Evaluated, Lobes};
use super::film::Tile;
use super::light::{FlatLight, LightSample};
use super::pass::RayCounts;
use super::sampler::Sampler;
use super::scene::Surface;
use super::surface::Interaction;
use super::{Integrator, TraceScene};
use crate::bvh::{Hit, Ray};
use glam::{UVec2, Vec3};

/// One path under way.
#[derive(Clone, Copy, Debug)]
struct Path {
    /// Which entry of the batch it adds to.
    entry: u32,
    sampler: Sampler,
    ray: Ray,
    /// What light at the ray's end is worth at the eye.
    throughput: Vec3,
    depth: u32,
    /// How the last bounce chose the ray's direction; `None`: no light sample could have found it.
    bounce: Option<Bounce>,
    /// Only collects what shines at its end.
    last: bool,
    /// Absorption coefficient of the body that the ray crosses; zero outside.
    absorption: Vec3,
}

/// The smooth bounce that a ray comes from.
#[derive(Clone, Copy, Debug)]
struct Bounce {
    pdf: f32,
    normal: Vec3,
}

/// A ray toward a light, and what it brings if nothing is in the way.
#[derive(Clone, Copy, Debug)]
struct Shadow {
    entry: u32,
    sampler: Sampler,
    ray: Ray,
    light: u32,
    triangle: Option<(u32, u32)>,
    contribution: Vec3,
    key: u32,
}

/// Buffers of one thread, kept between batches.
#[derive(Debug, Default)]
pub struct Batch {
    pixels: Vec<(u32, UVec2, [Sampler; 2])>,
    paths: Vec<Path>,
    next: Vec<Path>,
    shadows: Vec<Shadow>,
    rays: Vec<Ray>,
    hits: Vec<Option<Hit>>,
    ignored: Vec<Option<(u32, u32)>>,
    blocked: Vec<bool>,
    radiance: Vec<Vec3>,
    keys: Vec<(u32, u32)>,
}

/// Dimensions of the sampler: pair 0 is the place in the pixel, then this many pairs a bounce.
const PAIRS_PER_BOUNCE: u32 = 32;
const LOBE: u32 = 1;
const DIRECTION: u32 = 2;
const PICK: u32 = 3;
const LIGHT: u32 = 4;
/// From this depth on a path may end by chance.
const ROULETTE_DEPTH: u32 = 4;

impl Batch {
    /// Adds the next `count` samples to each pixel of `tile`, or to those of one colour, for a picture of `size`.
    pub fn render(
        &mut self,
        scene: &TraceScene,
        tile: &mut Tile,
        size: UVec2,
        color: Option<usize>,
        count: u32,
        rays: &mut RayCounts,
    ) {
        let first = tile.next_sample + color.map_or(0, |color| tile.more[color]);
        self.paths.clear();
        self.keys.clear();
        let members =
            (0..tile.size.element_product()).filter(|&i| color.is_none_or(|color| tile.color(i) == color));
        self.pixels.clear();
        self.pixels.extend(members.map(|i| {
            let pixel = tile.origin + UVec2::new(i % tile.size.x, i / tile.size.x);
            (i, pixel, Sampler::halves(pixel, scene.settings))
        }));
        for sample in first..first + count {
            for &(i, pixel, halves) in &self.pixels {
                let sampler = halves[sample as usize & 1].at(sample);
                let ray = scene.viewpoint.ray(pixel.as_vec2() + sampler.pair(0), size);
                let entry = self.keys.len() as u32;
                self.keys.push((i, sample));
                let throughput = Vec3::ONE;
                self.paths.push(Path {
                    entry,
                    sampler,
                    ray,
                    throughput,
                    depth: 0,
                    bounce: None,
                    last: false,
                    absorption: Vec3::ZERO,
                });
            }
        }
        self.radiance.clear();
        self.radiance.resize(self.keys.len(), Vec3::ZERO);
        rays.camera += self.paths.len() as u64;
        while !self.paths.is_empty() {
            self.wave(scene, rays);
        }
        let mut dropped = 0;
        let pixels = tile.pixels_mut();
        for (&(pixel, sample), &radiance) in self.keys.iter().zip(&self.radiance) {
            dropped += u64::from(!pixels[pixel as usize].add(sample, radiance));
        }
        tile.dropped += dropped;
        match color {
            None => tile.next_sample += count,
            Some(color) => tile.more[color] += count,
        }
    }

    fn wave(&mut self, scene: &TraceScene, rays: &mut RayCounts) {
        self.next.clear();
        self.shadows.clear();
        self.rays.clear();
        self.rays.extend(self.paths.iter().map(|path| path.ray));
        self.hits.resize(self.rays.len(), None);
        let paths = &self.paths;
        let random = |i: usize, key: u32| paths[i].sampler.hashed(key ^ paths[i].depth);
        scene.closest_hits(&self.rays, &mut self.hits, random);
        for i in 0..self.paths.len() {
            let mut path = self.paths[i];
            if path.absorption != Vec3::ZERO
                && let Some(hit) = self.hits[i]
            {
                path.throughput *= passed(path.absorption, hit.t * path.ray.direction.length());
            }
            self.arrive(scene, &path, self.hits[i]);
        }
        rays.shadow += self.connect_lights(scene);
        rays.bounce += self.next.len() as u64;
        std::mem::swap(&mut self.paths, &mut self.next);
    }

    /// Adds the light of those queued shadow rays that nothing blocks; returns how many were traced.
    fn connect_lights(&mut self, scene: &TraceScene) -> u64 {
        self.shadows.retain(|shadow| !scene.lights.blocks(&shadow.ray, shadow.light));
        // Rays to one light go similar ways. Stable: the sum of a path does not depend on its neighbours.
        if scene.lights.len() > 1 {
            self.shadows.sort_by_key(|shadow| shadow.light);
        }
        self.rays.clear();
        self.rays.extend(self.shadows.iter().map(|shadow| shadow.ray));
        self.ignored.clear();
        self.ignored.extend(self.shadows.iter().map(|shadow| shadow.triangle));
        self.blocked.resize(self.rays.len(), false);
        let shadows = &self.shadows;
        let random = |i: usize, key: u32| shadows[i].sampler.hashed(key ^ shadows[i].key);
        scene.any_hits(&self.rays, &mut self.blocked, &self.ignored, random);
        for (shadow, _) in self.shadows.iter().zip(&self.blocked).filter(|(_, blocked)| !**blocked) {
            self.radiance[shadow.entry as usize] += shadow.contribution;
        }
        self.shadows.len() as u64
    }

    /// What the end of a path's ray sends back along it, and where it goes on.
    fn arrive(&mut self, scene: &TraceScene, path: &Path, hit: Option<Hit>) {
        let before_hit = Ray { t_max: hit.map_or(path.ray.t_max, |h| h.t), ..path.ray };
        if let Some(found) = scene.lights.closest(&before_hit) {
            let (radiance, pdf) = found.shape.emitted(&path.ray, &found.hit);
            self.collect(scene, path, found.light, radiance, pdf);
            return;
        }
        let Some(hit) = hit else {
            let normal = path.bounce.map_or(Vec3::Z, |b| b.normal);
            for (light, beyond) in scene.lights.beyond() {
                if let Some((radiance, pdf)) = beyond.beyond(normal, path.ray.direction) {
                    self.collect(scene, path, light, radiance, pdf);
                }
            }
            return;
        };
        let (instance, surface) = scene.surface_at(&hit);
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
                        FlatLight::Mesh(mesh) => mesh.pdf(hit.triangle, distance2, cos),
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

    /// Adds light that a ray ran into, weighted against the chance of having sampled it.
    fn collect(&mut self, scene: &TraceScene, path: &Path, light: u32, radiance: Vec3, pdf: f32) {
        let weight = path.bounce.map_or(1.0, |bounce| {
            let light_pdf = pdf * scene.lights.chance(path.depth - 1, light);
            power_heuristic(bounce.pdf, light_pdf)
        });
        self.radiance[path.entry as usize] += path.throughput * radiance * weight;
    }

    /// Queues shadow rays to lights, and the ray that goes on.
    fn scatter(&mut self, scene: &TraceScene, path: &Path, surface: &Surface, at: &Interaction) {
        let bsdf = at.bsdf(scene, surface);
        let base = 1 + path.depth * PAIRS_PER_BOUNCE;
        // Direct lighting finds Lambert's share by light samples alone: no ray is spent on it.
        let followed = match scene.settings.integrator {
            Integrator::Direct => Lobes::SPECULAR,
            Integrator::Path => Lobes::ALL,
        };
        if bsdf.has_smooth_lobes() && !scene.lights.is_empty() {
            for index in 0..scene.lights.picks(path.depth) {
                let pair = index as u32 * 2;
                let by_chance = !scene.lights.samples_all(path.depth);
                let random = if by_chance { path.sampler.pair(base + PICK).x } else { 0.0 };
                let pick = scene.lights.pick(path.depth, index, random);
                let u = path.sampler.pair(base + LIGHT + pair);
                if let Some(sample) = scene.lights.get(pick.light).sample(at.position, bsdf.normal(), u) {
                    self.connect(scene, path, at, &bsdf, followed, pick.light, pick.chance, &sample);
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
        let absorption = match surface.body() {
            Some(body) if at.geometric_normal.dot(sample.wi) < 0.0 => {
                if at.front {
                    body.absorption
                } else {
                    Vec3::ZERO
                }
            }
            _ => path.absorption,
        };
        self.next.push(Path {
            entry: path.entry,
            sampler: path.sampler,
            ray: Ray::new(at.origin_toward(sample.wi), sample.wi),
            throughput,
            depth: path.depth + 1,
            bounce: sample.pdf.map(|pdf| Bounce { pdf, normal: bsdf.normal() }),
            last: !sample.follow && scene.settings.integrator == Integrator::Direct,
            absorption,
        });
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "all of one vertex; a struct for one call would only rename them"
    )]
    fn connect(
        &mut self,
        scene: &TraceScene,
        path: &Path,
        at: &Interaction,
        bsdf: &Bsdf,
        followed: Lobes,
        light: u32,
        chance: f32,
        sample: &LightSample,
    ) {
        let Evaluated { diffuse, glossy, pdf: bounce_pdf } = bsdf.evaluate(sample.wi, followed);
        let weight = match sample.pdf {
            None => (diffuse + glossy) / chance,
            Some(pdf) => {
                let light_pdf = pdf * chance;
                let shared = power_heuristic(light_pdf, bounce_pdf);
                // What no bounce would find is the light samples' alone.
                (diffuse * if followed.diffuse { shared } else { 1.0 } + glossy * shared) / light_pdf
            }
        };
        let mut contribution = path.throughput * weight * sample.radiance;
        if let Some((instance, triangle)) = sample.triangle {
            contribution *= mesh_emission(scene, instance, triangle, sample);
        }
        if path.absorption != Vec3::ZERO && at.geometric_normal.dot(sample.wi) > 0.0 {
            let distance = sample.target.map_or(f32::MAX, |target| target.distance(at.position));
            contribution *= passed(path.absorption, distance);
        }
        if contribution == Vec3::ZERO {
            return;
        }
        let origin = at.origin_toward(sample.wi);
        let ray = match sample.target {
            Some(target) => Ray { origin, direction: target - origin, t_max: 1.0 },
            None => Ray::new(origin, sample.wi),
        };
        // A light nearer than rounding has no ray to it, and nothing fits between.
        if ray.direction == Vec3::ZERO {
            return;
        }
        self.shadows.push(Shadow {
            entry: path.entry,
            sampler: path.sampler,
            ray,
            light,
            triangle: sample.triangle,
            contribution,
            key: light.wrapping_add(path.depth << 16).wrapping_add(1 << 31),
        });
    }
}

/// What is left after that way (J. H. Lambert, "Photometria", 1760; A. Beer, 1852).
fn passed(absorption: Vec3, distance: f32) -> Vec3 {
    (-absorption * distance).exp()
}

/// Radiance of an emissive triangle at a sampled point.
fn mesh_emission(scene: &TraceScene, instance: u32, triangle: u32, sample: &LightSample) -> Vec3 {
    let hit = Hit { t: 0.0, u: sample.uv.x, v: sample.uv.y, triangle, instance };
    let (data, surface) = scene.surface_at(&hit);
    let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
    let corners = data.mesh.triangles[triangle as usize];
    let uvs = super::scene::both_uvs(&data.mesh, corners, weights);
    surface.material.emission * scene.texture(surface.emission_texture, uvs).truncate()
}

/// Weight of a sample of density `a` that might have been taken with density `b`.
///
/// Reference: E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997, 9.2.2.
fn power_heuristic(a: f32, b: f32) -> f32 {
    // As a ratio: squares of large densities overflow.
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}
