//! What lights bring to a block of points: computed where it is known what is in the way, else sampled.

use crate::bvh::Ray;
use crate::trace::block::{Arrivals, Block, LANES};
use crate::trace::connect::{Look, Shadow, looks, mesh_emission, power_heuristic, shadow_key};
use crate::trace::emitter::Receiver;
use crate::trace::integrator::Batch;
use crate::trace::light::{FlatLight, LightSample};
use crate::trace::lights::Pick;
use crate::trace::mesh_light::MeshLight;
use crate::trace::path::{LIGHT, PAIRS_PER_BOUNCE};
use crate::trace::quad_arrivals::{compute_quad, sample_quad};
use crate::trace::sampler::SamplerRow;
use crate::trace::shape_light::Shape;
use crate::trace::{Integrator, TraceScene};
use glam::Vec3;
use std::f32::consts::PI;

impl Batch {
    /// Adds what lights bring for sure, and queues shadow rays for the rest.
    pub(super) fn light_block(&mut self, scene: &TraceScene, block: &Block) {
        let depth = self.path(block.paths[0] as usize).depth;
        let base = 1 + depth * PAIRS_PER_BOUNCE;
        if !scene.lights.samples_all(depth) {
            self.light_by_chance(scene, block, depth);
            return;
        }
        let mut arrivals = std::mem::take(&mut self.diffuse.arrivals);
        for light in 0..scene.lights.len() as u32 {
            let dimension = base + LIGHT + 2 * light;
            match scene.lights.get(light) {
                FlatLight::Shape(shape) if matches!(shape.shape, Shape::Parallelogram(_)) => {
                    let sightlines = &self.diffuse.sightlines;
                    let missing = compute_quad(scene, block, sightlines, shape, light, &mut arrivals);
                    self.take_certain(block, light, &arrivals);
                    if missing == 0 {
                        continue;
                    }
                    let members = scene.light_samples(depth, Some(light));
                    for member in 0..members {
                        let samplers = block.samplers.members([member, members]);
                        sample_quad(scene, block, &samplers, shape, [dimension, members], &mut arrivals);
                        self.take_sampled(block, &samplers, light, depth, &arrivals);
                    }
                }
                FlatLight::Mesh(mesh) if mesh.has_tree() => {
                    self.light_mesh(scene, block, mesh, [light, dimension, depth]);
                }
                _ => {
                    let members = scene.light_samples(depth, Some(light));
                    let pick = Pick { light, chance: members as f32 };
                    for i in 0..block.count {
                        for member in 0..members {
                            let sampler = block.samplers.get(i).member([member, members]);
                            self.light_point(
                                scene,
                                block,
                                i,
                                &Look { pick, sampler, u: sampler.pair(dimension) },
                            );
                        }
                    }
                }
            }
        }
        self.diffuse.arrivals = arrivals;
    }

    /// Samples an emissive mesh, whose triangles are chosen for all points together.
    fn light_mesh(
        &mut self,
        scene: &TraceScene,
        block: &Block,
        mesh: &MeshLight,
        [light, dimension, depth]: [u32; 3],
    ) {
        let members = scene.light_samples(depth, Some(light));
        let pick = Pick { light, chance: members as f32 };
        let (mut wanted, mut chosen) = std::mem::take(&mut self.diffuse.choices);
        let look = |i: usize, member: u32| {
            let sampler = block.samplers.get(i).member([member, members]);
            Look { pick, sampler, u: sampler.pair(dimension) }
        };
        wanted.clear();
        for i in 0..block.count {
            let to = Receiver { point: block.position.get(i), normal: block.normal.get(i) };
            wanted.extend((0..members).map(|member| (to, look(i, member).u.x)));
        }
        chosen.clear();
        chosen.resize(wanted.len(), None);
        mesh.choose_all(&wanted, &mut chosen);
        for (i, chosen) in chosen.chunks(members as usize).enumerate() {
            for (member, chosen) in (0..).zip(chosen) {
                let look = look(i, member);
                let on = |chosen| mesh.sample_on(chosen, block.position.get(i), look.u.y);
                if let Some(sample) = chosen.as_ref().and_then(on) {
                    self.light_sample(scene, block, i, &look, &sample);
                }
            }
        }
        self.diffuse.choices = (wanted, chosen);
    }

    /// Samples lights that are chosen by chance, but for those that are known.
    fn light_by_chance(&mut self, scene: &TraceScene, block: &Block, depth: u32) {
        if block.known[..block.count].iter().any(Option::is_some) {
            self.take_known(scene, block);
        }
        for i in 0..block.count {
            let counted = self.diffuse.counted[i];
            if counted.count_ones() as usize == scene.lights.len() {
                continue;
            }
            let to = Receiver { point: block.position.get(i), normal: block.normal.get(i) };
            for look in looks(scene, block.samplers.get(i), depth, to) {
                if counted == 0 || counted >> look.pick.light & 1 == 0 {
                    self.light_point(scene, block, i, &look);
                }
            }
        }
    }

    /// Adds what lights bring for sure of which the others are sampled by chance.
    fn take_known(&mut self, scene: &TraceScene, block: &Block) {
        let mut arrivals = std::mem::take(&mut self.diffuse.arrivals);
        for light in 0..scene.lights.len() as u32 {
            if let FlatLight::Shape(shape) = scene.lights.get(light)
                && matches!(shape.shape, Shape::Parallelogram(_))
            {
                compute_quad(scene, block, &self.diffuse.sightlines, shape, light, &mut arrivals);
                self.take_certain(block, light, &arrivals);
            }
        }
        self.diffuse.arrivals = arrivals;
    }

    fn take_certain(&mut self, block: &Block, light: u32, arrivals: &Arrivals) {
        for i in 0..block.count {
            if arrivals.certain[i] {
                self.diffuse.counted[i] |= 1 << light;
                let entry = self.entry(block.paths[i] as usize);
                self.radiance[entry as usize] += arrivals.contribution.get(i);
            }
        }
    }

    fn take_sampled(
        &mut self,
        block: &Block,
        samplers: &SamplerRow<LANES>,
        light: u32,
        depth: u32,
        arrivals: &Arrivals,
    ) {
        for i in 0..block.count {
            let contribution = arrivals.contribution.get(i);
            if arrivals.certain[i] || contribution == Vec3::ZERO {
                continue;
            }
            let origin = block.origin.get(i);
            let ray = Ray { origin, direction: arrivals.target.get(i) - origin, t_max: 1.0 };
            // A light nearer than rounding has no ray to it, and nothing fits between.
            if ray.direction != Vec3::ZERO {
                let (entry, sampler) = (self.entry(block.paths[i] as usize), samplers.get(i));
                let key = shadow_key(light, depth);
                self.shadows.push(Shadow { entry, sampler, ray, light, triangle: None, contribution, key });
            }
        }
    }

    /// Samples any light for one point.
    fn light_point(&mut self, scene: &TraceScene, block: &Block, i: usize, look: &Look) {
        let (position, normal) = (block.position.get(i), block.normal.get(i));
        if let Some(sample) = scene.lights.get(look.pick.light).sample(position, normal, look.u) {
            self.light_sample(scene, block, i, look, &sample);
        }
    }

    /// Queues the shadow ray of a sample, with what it brings if nothing is in the way.
    fn light_sample(
        &mut self,
        scene: &TraceScene,
        block: &Block,
        i: usize,
        look: &Look,
        sample: &LightSample,
    ) {
        let Look { pick: Pick { light, chance }, sampler, .. } = *look;
        let path = self.path(block.paths[i] as usize);
        let (normal, geometric) = (block.normal.get(i), block.geometric_normal.get(i));
        let cosine = normal.dot(sample.wi);
        if cosine <= 0.0 || geometric.dot(sample.wi) <= 0.0 {
            return;
        }
        let weight = match sample.pdf {
            None => cosine / (PI * chance),
            Some(pdf) => {
                let light_pdf = pdf * chance;
                let shared = match scene.settings.integrator {
                    Integrator::Path => power_heuristic(light_pdf, cosine / PI),
                    Integrator::Direct => 1.0,
                };
                cosine * shared / (PI * light_pdf)
            }
        };
        let mut contribution = block.throughput.get(i) * sample.radiance * weight;
        if let Some((instance, triangle)) = sample.triangle {
            contribution *= mesh_emission(scene, instance, triangle, sample);
        }
        if contribution == Vec3::ZERO {
            return;
        }
        let origin = block.origin.get(i);
        let ray = match sample.target {
            Some(target) => Ray { origin, direction: target - origin, t_max: 1.0 },
            None => Ray::new(origin, sample.wi),
        };
        if ray.direction != Vec3::ZERO {
            let key = shadow_key(light, path.depth);
            let (entry, triangle) = (path.entry, sample.triangle);
            self.shadows.push(Shadow { entry, sampler, ray, light, triangle, contribution, key });
        }
    }
}
