//! What a path finds at the end of its ray: lights, what shines, and surfaces of all kinds but those of
//! [`super::diffuse`].

use super::bsdf::Lobes;
use super::connect::{Look, looks, power_heuristic};
use super::emitter::Receiver;
use super::features::{Feature, count};
use super::integrator::Batch;
use super::light::FlatLight;
use super::lights::LightHit;
use super::path::{Bounce, DIRECTION, LOBE, PAIRS_PER_BOUNCE, Path, ROULETTE_DEPTH};
use super::scene::Surface;
use super::surface::Interaction;
use super::{Integrator, TraceScene};
use crate::bvh::Ray;
use glam::Vec3;

/// What is farther than a surface by no more than that is where it is: a lamp may lie in the plane of a ceiling.
const SAME_PLACE: f32 = 1.0 + 1e-6;

impl Batch {
    /// What the end of a path's ray sends back along it, and where it goes on.
    #[inline]
    pub(super) fn arrive(&mut self, scene: &TraceScene, index: usize) {
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
            None => {
                count(Feature::MirrorRay);
                at.origin_toward(sample.wi)
            }
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
