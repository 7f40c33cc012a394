//! Surfaces that only reflect evenly: most of what there is, shaded by whole blocks.
//!
//! And where nothing can be in the way of a light, it is computed instead of sampled: no shadow rays, and no noise.
//! Whether that is so is asked once for the part of a triangle that a tile shows, whichever samples are in the batch:
//! a sample's result does not depend on its company.

use super::block::{Arrivals, Block, Depart, Departures, IntegrateQuad, LANES, SampleQuad};
use super::film::Tile;
use super::integrator::{
    Batch, Bounce, DIRECTION, LIGHT, LOBE, PAIRS_PER_BOUNCE, PICK, Path, ROULETTE_DEPTH, Shadow, mesh_emission,
    power_heuristic,
};
use super::light::FlatLight;
use super::shape_light::{Shape, ShapeLight};
use super::surface::Interaction;
use super::{Integrator, TraceScene};
use crate::bvh::{Hit, Ray, Shaft};
use glam::{DVec3, UVec2, Vec2, Vec3};
use std::f32::consts::PI;

/// Where paths of a wave have met diffuse surfaces, and what is needed to go on from there.
#[derive(Debug, Default)]
pub(super) struct Diffuse {
    /// Numbers of paths, by what their points need: those with a clear light, other flat ones, and the rest.
    kinds: [Vec<(u32, u32)>; 3],
    /// Rays through the corners of the tile, around it.
    corners: Option<[Ray; 4]>,
    /// That of the tile, which lends it.
    clear_lights: ClearLights,
    /// Lights that have been counted in full, a bit for each, of each point of the block.
    counted: Vec<u32>,
    block: Option<Box<Block>>,
    arrivals: Box<Arrivals>,
    departures: Box<Departures>,
}

/// Of some triangles the lights that are clear from their part of a tile.
#[derive(Clone, Debug, Default)]
pub(super) struct ClearLights(Vec<Known>);

/// What is known is no part of the picture.
impl PartialEq for ClearLights {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// (instance, triangle), and a bit for each light that is clear.
#[derive(Clone, Copy, Debug)]
struct Known {
    triangle: (u32, u32),
    clear: u32,
}

/// So many triangles are remembered at a time.
const KNOWN: usize = 16;
const NOTHING: Known = Known { triangle: (u32::MAX, u32::MAX), clear: 0 };

impl ClearLights {
    /// What is known of a triangle, or `find`s it out.
    fn of(&mut self, hit: &Hit, find: impl FnOnce() -> u32) -> u32 {
        if self.0.is_empty() {
            self.0.resize(KNOWN, NOTHING);
        }
        let triangle = (hit.instance, hit.triangle);
        let known = &mut self.0[(hit.triangle ^ hit.instance << 3) as usize % KNOWN];
        if known.triangle != triangle {
            *known = Known { triangle, clear: find() };
        }
        known.clear
    }
}

impl Diffuse {
    /// Begins with another batch.
    pub(super) fn enter(&mut self, scene: &TraceScene, tile: &mut Tile, size: UVec2) {
        let (low, high) = (tile.origin.as_vec2(), (tile.origin + tile.size).as_vec2());
        let ray = |x: f32, y: f32| scene.viewpoint.ray(Vec2::new(x, y), size);
        let around = || [ray(low.x, low.y), ray(high.x, low.y), ray(high.x, high.y), ray(low.x, high.y)];
        self.corners = (scene.settings.shafts && scene.lights.samples_all(0)).then(around);
        self.clear_lights = std::mem::take(&mut tile.clear_lights);
    }

    /// Ends with it.
    pub(super) fn leave(&mut self, tile: &mut Tile) {
        tile.clear_lights = std::mem::take(&mut self.clear_lights);
    }

    /// Notes that path number `path` ends in `hit`.
    pub(super) fn add(&mut self, scene: &TraceScene, path: usize, hit: &Hit, depth: u32) {
        let clear = if depth == 0 { self.clear(scene, hit) } else { 0 };
        let data = &scene.geometry.instances[hit.instance as usize];
        let flat = data.mesh.normals.is_empty()
            && data.mesh.colors.is_empty()
            && scene.geometry.tlas.placements()[hit.instance as usize].is_identity()
            && scene.surface_at(hit).1.base_color_texture.is_none();
        let kind = if !flat { 2 } else { usize::from(clear == 0) };
        self.kinds[kind].push((path as u32, clear));
    }

    /// The lights that nothing keeps from the part of the triangle that the tile shows.
    fn clear(&mut self, scene: &TraceScene, hit: &Hit) -> u32 {
        let Some(corners) = &self.corners else { return 0 };
        self.clear_lights.of(hit, || clear_lights(scene, corners, hit))
    }
}

/// The lights that are clear from the patch that rays around a tile cut out of a triangle's plane. None if it is much
/// larger than the triangle: then the answer would cost more than it is worth.
fn clear_lights(scene: &TraceScene, around: &[Ray; 4], hit: &Hit) -> u32 {
    let data = &scene.geometry.instances[hit.instance as usize];
    let placement = &scene.geometry.tlas.placements()[hit.instance as usize];
    let [a, b, c] = data.mesh.corners(hit.triangle as usize).map(|p| {
        let p = p.as_dvec3();
        if placement.is_identity() { p } else { placement.world_from_local().transform_point3(p) }
    });
    let normal = (b - a).cross(c - a);
    let mut patch = [DVec3::ZERO; 4];
    for (corner, ray) in patch.iter_mut().zip(around) {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let t = normal.dot(a - origin) / normal.dot(direction);
        if !(t > 0.0 && t.is_finite()) {
            return 0;
        }
        *corner = origin + direction * t;
    }
    let across = (patch[2] - patch[0]).cross(patch[3] - patch[1]);
    if normal.length_squared() < 0.25 * across.length_squared() {
        return 0;
    }
    (0..scene.lights.len() as u32)
        .filter(|&number| match scene.lights.get(number) {
            FlatLight::Shape(ShapeLight { shape: Shape::Parallelogram(quad), .. }) => {
                let shaft = Shaft::new(patch, quad.corners().map(Vec3::as_dvec3));
                scene.lights.is_clear(&shaft, number) && scene.geometry.tlas.is_clear(&shaft)
            }
            _ => false,
        })
        .fold(0, |clear, number| clear | 1 << number)
}

/// What a parallelogram light brings: all of it where nothing is in the way, elsewhere by a sample each.
fn arrive_from_quad(
    scene: &TraceScene,
    block: &Block,
    shape: &ShapeLight,
    light: u32,
    dimension: u32,
    out: &mut Arrivals,
) {
    let Shape::Parallelogram(quad) = &shape.shape else { return };
    let (radiance, two_sided) = (&shape.radiance, shape.two_sided);
    let isa = scene.geometry.tlas.isa();
    let clear = block.clear[..block.count].iter().filter(|clear| *clear >> light & 1 == 1).count();
    let whole = clear > 0 && radiance.iter().all(|r| *r == radiance[0]);
    if whole && clear == block.count {
        isa.run(IntegrateQuad { block, quad, radiance: radiance[0], two_sided, light, out });
        if out.certain[..block.count].iter().all(|&certain| certain) {
            return;
        }
    }
    let shared = scene.settings.integrator == Integrator::Path;
    isa.run(SampleQuad { block, quad, radiance, two_sided, dimension, shared, out });
    if whole {
        isa.run(IntegrateQuad { block, quad, radiance: radiance[0], two_sided, light, out });
    }
}

impl Batch {
    /// What comes from all points that [`Diffuse::add`] has noted.
    pub(super) fn shade_diffuse(&mut self, scene: &TraceScene) {
        for kind in 0..3 {
            let points = std::mem::take(&mut self.diffuse.kinds[kind]);
            for chunk in points.chunks(LANES) {
                let like = self.path(chunk[0].0 as usize).sampler;
                let mut block = self.diffuse.block.take().unwrap_or_else(|| Box::new(Block::new(like)));
                self.fill(scene, &mut block, chunk, kind < 2);
                self.diffuse.counted.clear();
                self.diffuse.counted.resize(chunk.len(), 0);
                self.light_block(scene, &block);
                if scene.settings.integrator == Integrator::Path {
                    self.follow_block(scene, &block);
                }
                self.diffuse.block = Some(block);
            }
            self.diffuse.kinds[kind] = points;
            self.diffuse.kinds[kind].clear();
        }
    }

    fn fill(&self, scene: &TraceScene, block: &mut Block, points: &[(u32, u32)], flat: bool) {
        block.count = points.len();
        for (i, &(number, clear)) in points.iter().enumerate() {
            let path = self.path(number as usize);
            let Some(hit) = &self.hits[number as usize] else { continue };
            block.paths[i] = number;
            block.clear[i] = clear;
            block.samplers.set(i, &path.sampler);
            let (instance, surface) = scene.surface_at(hit);
            let mut albedo = surface.material.base_color;
            if flat {
                let corners = instance.mesh.corners(hit.triangle as usize);
                for (rows, corner) in block.corners.iter_mut().zip(corners) {
                    rows.set(i, corner);
                }
                block.weights.set(i, Vec3::new(hit.u, hit.v, 0.0));
                block.direction.set(i, path.ray.direction);
            } else {
                let at = Interaction::new(scene, instance, hit, &path.ray);
                let texel = scene.texture(surface.base_color_texture, at.uv) * at.color;
                albedo *= texel.truncate();
                block.set_point(i, &at);
            }
            block.throughput.set(i, path.throughput * albedo);
        }
        if flat {
            block.find_points(scene.geometry.tlas.isa());
        }
    }

    /// Adds what lights bring for sure, and queues shadow rays for the rest.
    fn light_block(&mut self, scene: &TraceScene, block: &Block) {
        let depth = self.path(block.paths[0] as usize).depth;
        let base = 1 + depth * PAIRS_PER_BOUNCE;
        if !scene.lights.samples_all(depth) {
            for i in 0..block.count {
                let random = self.path(block.paths[i] as usize).sampler.pair(base + PICK).x;
                let pick = scene.lights.pick(depth, 0, random);
                self.light_point(scene, block, i, pick.light, pick.chance, base + LIGHT);
            }
            return;
        }
        let mut arrivals = std::mem::take(&mut self.diffuse.arrivals);
        for light in 0..scene.lights.len() as u32 {
            let dimension = base + LIGHT + 2 * light;
            match scene.lights.get(light) {
                FlatLight::Shape(shape) if matches!(shape.shape, Shape::Parallelogram(_)) => {
                    arrive_from_quad(scene, block, shape, light, dimension, &mut arrivals);
                    self.take_arrivals(block, light, depth, &arrivals);
                }
                _ => {
                    for i in 0..block.count {
                        self.light_point(scene, block, i, light, 1.0, dimension);
                    }
                }
            }
        }
        self.diffuse.arrivals = arrivals;
    }

    fn take_arrivals(&mut self, block: &Block, light: u32, depth: u32, arrivals: &Arrivals) {
        for i in 0..block.count {
            let contribution = arrivals.contribution.get(i);
            if contribution == Vec3::ZERO {
                continue;
            }
            let path = self.path(block.paths[i] as usize);
            if arrivals.certain[i] || block.clear[i] >> light & 1 == 1 {
                self.radiance[path.entry as usize] += contribution;
                self.diffuse.counted[i] |= u32::from(arrivals.certain[i]) << light;
                continue;
            }
            let origin = block.origin.get(i);
            let ray = Ray { origin, direction: arrivals.target.get(i) - origin, t_max: 1.0 };
            // A light nearer than rounding has no ray to it, and nothing fits between.
            if ray.direction != Vec3::ZERO {
                let key = light.wrapping_add(depth << 16).wrapping_add(1 << 31);
                let (entry, sampler) = (path.entry, path.sampler);
                self.shadows.push(Shadow { entry, sampler, ray, light, triangle: None, contribution, key });
            }
        }
    }

    /// Samples any light for one point.
    fn light_point(
        &mut self,
        scene: &TraceScene,
        block: &Block,
        i: usize,
        light: u32,
        chance: f32,
        dimension: u32,
    ) {
        let path = self.path(block.paths[i] as usize);
        let (position, normal, geometric) =
            (block.position.get(i), block.normal.get(i), block.geometric_normal.get(i));
        let random = path.sampler.pair(dimension);
        let Some(sample) = scene.lights.get(light).sample(position, normal, random) else { return };
        let cosine = normal.dot(sample.wi);
        if cosine <= 0.0 || geometric.dot(sample.wi) <= 0.0 {
            return;
        }
        let weight = match sample.pdf {
            None => cosine / (PI * chance),
            Some(pdf) => {
                let light_pdf = pdf * chance;
                let shared = match scene.settings.integrator {
                    Integrator::Direct => 1.0,
                    Integrator::Path => power_heuristic(light_pdf, cosine / PI),
                };
                cosine * shared / (PI * light_pdf)
            }
        };
        let mut contribution = block.throughput.get(i) * sample.radiance * weight;
        if let Some((instance, triangle)) = sample.triangle {
            contribution *= mesh_emission(scene, instance, triangle, &sample);
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
            let key = light.wrapping_add(path.depth << 16).wrapping_add(1 << 31);
            let (entry, sampler, triangle) = (path.entry, path.sampler, sample.triangle);
            self.shadows.push(Shadow { entry, sampler, ray, light, triangle, contribution, key });
        }
    }

    /// Sends paths on.
    fn follow_block(&mut self, scene: &TraceScene, block: &Block) {
        let depth = self.path(block.paths[0] as usize).depth;
        let base = 1 + depth * PAIRS_PER_BOUNCE;
        let mut out = std::mem::take(&mut self.diffuse.departures);
        scene.geometry.tlas.isa().run(Depart { block, dimension: base + DIRECTION, out: &mut out });
        for i in 0..block.count {
            let path = self.path(block.paths[i] as usize);
            let mut throughput = block.throughput.get(i);
            let pdf = out.pdf[i];
            if pdf <= 0.0 || throughput == Vec3::ZERO {
                continue;
            }
            if depth >= ROULETTE_DEPTH {
                let survival = throughput.max_element().clamp(0.05, 1.0);
                if path.sampler.pair(base + LOBE).y >= survival {
                    continue;
                }
                throughput /= survival;
            }
            let direction = out.direction.get(i);
            self.next.push(Path {
                entry: path.entry,
                sampler: path.sampler,
                ray: Ray::new(block.origin.get(i), direction),
                throughput,
                depth: depth + 1,
                bounce: Some(Bounce { pdf, normal: block.normal.get(i), counted: self.diffuse.counted[i] }),
                last: false,
            });
        }
        self.diffuse.departures = out;
    }
}
