//! Why a pixel looks as it does: samples of it once more, with everything written down.

use super::TraceScene;
use super::bsdf::Bsdf;
use super::camera::LENS;
use super::connect::Shadow;
use super::connect::{Look, looks};
use super::emitter::Receiver;
use super::integrator::Batch;
use super::light::FlatLight;
use super::path::Path;
use super::sampler::Sampler;
use super::surface::Interaction;
use crate::bvh::inspect::Order;
use crate::bvh::{Hit, Ray};
use crate::scene::color::luminance;
use glam::{UVec2, Vec3};
use std::ops::Range;

/// What a segment is, or what became of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// From the eye.
    Camera,
    /// Mirrored or refracted.
    Specular,
    /// In a direction chosen at random.
    Bounce,
    /// To a sampled point of a light, which it brings light from.
    Lit,
    /// To a light without extent, but something is in the way.
    Shadow,
    /// To a sampled point of a light with extent, but something is in the way.
    Blocked,
}

/// A straight piece of a path, in render space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Where it begins.
    pub from: Vec3,
    /// Where it ends; of one that meets nothing, some way out.
    pub to: Vec3,
    /// What it is.
    pub kind: Kind,
}

/// What one light did at one bounce, over all samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightRow {
    /// Bounces before.
    pub depth: u32,
    /// Number of the light.
    pub light: u32,
    /// What kind of light it is.
    pub name: &'static str,
    /// How often it was sampled.
    pub samples: u32,
    /// How often from its dark side, or where the surface would reflect nothing.
    pub dark: u32,
    /// How often nothing was in the way.
    pub lit: u32,
    /// Least and greatest density in solid angle; `None` for a light without extent.
    pub pdf: Option<[f32; 2]>,
    /// Mean luminance that a ray to it would bring if nothing were in the way.
    pub unblocked: f32,
    /// Mean luminance that it adds to the pixel.
    pub contribution: f32,
    /// Nodes and triangles that a ray to it meets, on average.
    pub visits: [f32; 2],
}

/// All about some samples of a pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Explanation {
    /// Which pixel.
    pub pixel: UVec2,
    /// All rays.
    pub segments: Vec<Segment>,
    /// By bounce, then light.
    pub lights: Vec<LightRow>,
    /// Light that the samples of lights bring to each; what rays run into is not in it.
    pub radiance: Vec<Vec3>,
    /// The first sample's camera ray.
    pub ray: Option<Ray>,
}

/// Follows `samples` of `pixel`, and samples all light on the way: also what the film would rather compute in closed
/// form, so that one sees where it comes from. `far` is how long a ray that meets nothing is drawn.
#[must_use]
pub fn explain(scene: &TraceScene, pixel: UVec2, samples: Range<u32>, far: f32) -> Explanation {
    let halves = Sampler::halves(pixel, scene.settings);
    let mut paths: Vec<Path> = samples
        .zip(0..)
        .map(|(sample, entry)| {
            let sampler = halves[sample as usize & 1].at(sample);
            let ray = scene.viewpoint.ray(pixel.as_vec2() + sampler.pair(0), scene.settings.size);
            let ray = scene.viewpoint.through_lens(ray, sampler.pair(LENS));
            Path {
                entry,
                sampler,
                ray,
                throughput: Vec3::ONE,
                depth: 0,
                bounce: None,
                absorption: Vec3::ZERO,
                last: false,
            }
        })
        .collect();
    let ray = paths.first().map(|path| path.ray);
    let mut told =
        Explanation { pixel, ray, radiance: vec![Vec3::ZERO; paths.len()], ..Explanation::default() };
    let mut batch = Batch::default();
    while !paths.is_empty() {
        batch.next.clear();
        batch.shadows.clear();
        for path in &paths {
            let mut hit = [None];
            let looks = |_| path.bounce.is_none();
            scene.closest_hits(&[path.ray], &mut hit, looks, |_, key| path.sampler.hashed(key, path.depth));
            told.segments.push(path_segment(scene, path, hit[0].as_ref(), far));
            told.arrive(scene, &mut batch, path, hit[0]);
        }
        let depth = paths.first().map_or(0, |path| path.depth);
        for shadow in &batch.shadows {
            told.connected(scene, shadow, depth, far);
        }
        paths = std::mem::take(&mut batch.next);
    }
    told.finish();
    told
}

fn path_segment(scene: &TraceScene, path: &Path, hit: Option<&Hit>, far: f32) -> Segment {
    let t_max = hit.map_or(f32::INFINITY, |hit| hit.t);
    let lamp = scene.lights.closest(&Ray { t_max, ..path.ray }).map(|lamp| lamp.hit.t);
    let t = lamp.or(hit.map(|hit| hit.t)).unwrap_or(far);
    let kind = match (path.depth, path.bounce) {
        (0, _) => Kind::Camera,
        (_, None) => Kind::Specular,
        (_, Some(_)) => Kind::Bounce,
    };
    Segment { from: path.ray.origin, to: path.ray.at(t), kind }
}

impl Explanation {
    fn row(&mut self, scene: &TraceScene, depth: u32, light: u32) -> &mut LightRow {
        let found = self.lights.iter().position(|row| (row.depth, row.light) == (depth, light));
        let index = found.unwrap_or_else(|| {
            let name = name_of(scene.lights.get(light));
            let (pdf, unblocked, contribution, visits) = (None, 0.0, 0.0, [0.0; 2]);
            let row = LightRow {
                depth,
                light,
                name,
                samples: 0,
                dark: 0,
                lit: 0,
                pdf,
                unblocked,
                contribution,
                visits,
            };
            self.lights.push(row);
            self.lights.len() - 1
        });
        &mut self.lights[index]
    }

    /// Samples the lights where `path` ends, and goes on from there.
    fn arrive(&mut self, scene: &TraceScene, batch: &mut Batch, path: &Path, hit: Option<Hit>) {
        let Some(hit) = hit else { return };
        let ends = path.last || path.depth >= scene.settings.max_depth;
        if ends || scene.lights.closest(&Ray { t_max: hit.t, ..path.ray }).is_some() {
            return;
        }
        let (instance, surface) = scene.surface_at(&hit);
        if surface.material.unlit {
            return;
        }
        let at = Interaction::new(scene, instance, &hit, &path.ray);
        batch.scatter(scene, path, surface, &at);
        self.sampled(scene, path, &at, &at.bsdf(scene, surface));
    }

    /// Notes the lights that were sampled: the same numbers choose the same points.
    fn sampled(&mut self, scene: &TraceScene, path: &Path, at: &Interaction, bsdf: &Bsdf) {
        if !bsdf.has_smooth_lobes() || scene.lights.is_empty() {
            return;
        }
        let to = Receiver { point: at.position, normal: bsdf.normal() };
        for Look { pick, u, .. } in looks(scene, path.sampler, path.depth, to) {
            let sample = scene.lights.get(pick.light).sample(at.position, bsdf.normal(), u);
            let row = self.row(scene, path.depth, pick.light);
            row.samples += 1;
            row.dark += 1;
            if let Some(pdf) = sample.and_then(|sample| sample.pdf) {
                let [least, most] = row.pdf.unwrap_or([pdf; 2]);
                row.pdf = Some([least.min(pdf), most.max(pdf)]);
            }
        }
    }

    /// Notes a ray to a light, and whether it comes through.
    fn connected(&mut self, scene: &TraceScene, shadow: &Shadow, depth: u32, far: f32) {
        let mut blocked = [false];
        let random = |_: usize, key: u32| shadow.sampler.hashed(key, shadow.key);
        scene.any_hits(&[shadow.ray], &mut blocked, &[shadow.triangle], random);
        let blocked = blocked[0] || scene.lights.blocks(&shadow.ray, shadow.light);
        let (_, visits) = scene.geometry.tlas.inspect(&shadow.ray, Order::NearFirst, true, |_| {});
        let light = scene.lights.get(shadow.light);
        let kind = match (blocked, light.has_extent()) {
            (false, _) => Kind::Lit,
            (true, false) => Kind::Shadow,
            (true, true) => Kind::Blocked,
        };
        let t = if shadow.ray.t_max.is_finite() { shadow.ray.t_max } else { far };
        self.segments.push(Segment { from: shadow.ray.origin, to: shadow.ray.at(t), kind });
        let picked = scene.lights.samples_all(depth).then_some(shadow.light);
        let together = scene.light_samples(depth, picked);
        let row = self.row(scene, depth, shadow.light);
        row.dark = row.dark.saturating_sub(1);
        row.visits[0] += visits.nodes as f32;
        row.visits[1] += visits.triangles as f32;
        // As if it were the only one.
        row.unblocked += luminance(shadow.contribution) * together as f32;
        if !blocked {
            self.radiance[shadow.entry as usize] += shadow.contribution;
            let row = self.row(scene, depth, shadow.light);
            row.lit += 1;
            row.contribution += luminance(shadow.contribution);
        }
    }

    /// Sums to means.
    fn finish(&mut self) {
        let samples = self.radiance.len().max(1) as f32;
        for row in &mut self.lights {
            let rays = (row.samples.saturating_sub(row.dark)).max(1) as f32;
            row.visits = row.visits.map(|visits| visits / rays);
            row.unblocked /= rays;
            row.contribution /= samples;
        }
        self.lights.sort_by_key(|row| (row.depth, row.light));
    }
}

/// What people call it.
#[must_use]
pub fn name_of(light: &FlatLight) -> &'static str {
    use super::shape_light::Shape;
    match light {
        FlatLight::Point { .. } => "point",
        FlatLight::Spot { .. } => "spot",
        FlatLight::Directional { .. } => "sun",
        FlatLight::Segment { .. } => "segment",
        FlatLight::Shape(light) => match light.shape {
            Shape::Parallelogram(_) => "parallelogram",
            Shape::Disk { .. } => "disk",
            Shape::Sphere { .. } => "sphere",
        },
        FlatLight::Mesh(_) => "mesh",
        FlatLight::Environment { .. } | FlatLight::Sky(_) => "sky",
    }
}
