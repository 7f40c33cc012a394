//! Rays toward lights: what light samples bring, if nothing is in the way.

use super::TraceScene;
use super::bsdf::{Bsdf, Evaluated, Lobes};
use super::emitter::Receiver;
use super::integrator::Batch;
use super::light::LightSample;
use super::lights::Pick;
use super::path::{LIGHT, PAIRS_PER_BOUNCE, PICK, Path};
use super::sampler::Sampler;
use super::surface::Interaction;
use crate::bvh::{Hit, Ray};
use glam::{Vec2, Vec3};

/// A ray toward a light, and what it brings if nothing is in the way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shadow {
    pub(super) entry: u32,
    pub(super) sampler: Sampler,
    pub(super) ray: Ray,
    pub(super) light: u32,
    pub(super) triangle: Option<(u32, u32)>,
    pub(super) contribution: Vec3,
    pub(super) key: u32,
}

/// One sample of a light, to be taken from a vertex.
pub(super) struct Look {
    /// The light; and how many such looks at it are expected at this vertex.
    pub(super) pick: Pick,
    /// Its own: for what is in the way.
    pub(super) sampler: Sampler,
    /// Random numbers: where on the light.
    pub(super) u: Vec2,
}

/// Among so many lights one is chosen by ten of the 24 digits of a random number.
const DIGITS_FOR: usize = 1024;

/// All that are taken at a vertex after `depth` bounces.
pub(super) fn looks<'a>(
    scene: &'a TraceScene<'a>,
    sampler: Sampler,
    depth: u32,
    to: Receiver,
) -> impl Iterator<Item = Look> + 'a {
    let base = 1 + depth * PAIRS_PER_BOUNCE;
    let by_chance = !scene.lights.samples_all(depth);
    (0..scene.lights.picks(depth)).flat_map(move |index| {
        let members = scene.light_samples(depth, (!by_chance).then_some(index as u32));
        (0..members).filter_map(move |member| {
            let sampler = sampler.member([member, members]);
            let u = sampler.pair(base + LIGHT + index as u32 * 2);
            // One number for which light and where on it, so that samples are spread over all of them together; of very many it
            // has not digits enough.
            let is_one = scene.lights.len() <= DIGITS_FOR;
            let random = if by_chance && !is_one { sampler.pair(base + PICK).x } else { u.x };
            let (mut pick, rest) = scene.lights.pick(depth, index, &to, random)?;
            pick.chance *= members as f32;
            Some(Look { pick, sampler, u: if is_one { Vec2::new(rest, u.y) } else { u } })
        })
    })
}

/// Shadow rays that are worth tracing before the rest of a batch is shaded.
const MANY: usize = 8192;

/// Shadow rays in the order in which they are traced.
#[derive(Debug, Default)]
pub(super) struct RaysToLights {
    /// Which light, and which of those that are queued.
    order: Vec<u64>,
    rays: Vec<Ray>,
    ignored: Vec<Option<(u32, u32)>>,
    blocked: Vec<bool>,
}

impl Batch {
    /// [`Batch::connect_lights`] if there are many: more would only need more memory. (Those of a path are queued together.)
    pub(super) fn connect_many(&mut self, scene: &TraceScene) -> u64 {
        if self.shadows.len() > MANY { self.connect_lights(scene) } else { 0 }
    }

    /// Adds the light of those queued shadow rays that nothing blocks; returns how many were traced.
    pub(super) fn connect_lights(&mut self, scene: &TraceScene) -> u64 {
        let Self { shadows, rays_to_lights: RaysToLights { order, rays, ignored, blocked }, .. } = self;
        // Rays to one light go similar ways; of one light in the order of the queue, so that the sum of a path does not depend on
        // its neighbours.
        order.clear();
        let waiting = (0_u64..).zip(&*shadows);
        let clear = waiting.filter(|(_, shadow)| !scene.lights.blocks(&shadow.ray, shadow.light));
        order.extend(clear.map(|(i, shadow)| u64::from(shadow.light) << 32 | i));
        if scene.lights.len() > 1 {
            order.sort_unstable();
        }
        let of = |at: u64| &shadows[at as u32 as usize];
        rays.clear();
        rays.extend(order.iter().map(|&at| of(at).ray));
        ignored.clear();
        ignored.extend(order.iter().map(|&at| of(at).triangle));
        blocked.clear();
        blocked.resize(rays.len(), false);
        let random = |i: usize, key: u32| of(order[i]).sampler.hashed(key, of(order[i]).key);
        scene.any_hits(rays, blocked, ignored, random);
        for (&at, _) in order.iter().zip(&*blocked).filter(|(_, blocked)| !**blocked) {
            self.radiance[of(at).entry as usize] += of(at).contribution;
        }
        shadows.clear();
        order.len() as u64
    }

    /// Queues the ray to a light sample. The path has what absorbs on the way there.
    #[expect(
        clippy::too_many_arguments,
        reason = "all of one vertex; a struct for one call would only rename them"
    )]
    pub(super) fn connect(
        &mut self,
        scene: &TraceScene,
        path: &Path,
        at: &Interaction,
        bsdf: &Bsdf,
        followed: Lobes,
        &Pick { light, chance }: &Pick,
        sampler: &Sampler,
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
        if path.absorption != Vec3::ZERO {
            let distance = sample.target.map_or(f32::MAX, |target| target.distance(at.position));
            contribution *= passed(path.absorption, distance);
        }
        if contribution == Vec3::ZERO {
            return;
        }
        let origin = at.lit_origin_toward(sample.wi);
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
            sampler: *sampler,
            ray,
            light,
            triangle: sample.triangle,
            contribution,
            key: shadow_key(light, path.depth),
        });
    }
}

/// Of the random numbers that a shadow ray needs on its way.
pub(super) fn shadow_key(light: u32, depth: u32) -> u32 {
    light.wrapping_add(depth << 16).wrapping_add(1 << 31)
}

/// What is left after that way (J. H. Lambert, "Photometria", 1760; A. Beer, 1852).
pub(super) fn passed(absorption: Vec3, distance: f32) -> Vec3 {
    (-absorption * distance).exp()
}

/// Radiance of an emissive triangle at a sampled point.
pub(super) fn mesh_emission(scene: &TraceScene, instance: u32, triangle: u32, sample: &LightSample) -> Vec3 {
    let hit = Hit { t: 0.0, u: sample.uv.x, v: sample.uv.y, triangle, instance };
    let (data, surface) = scene.surface_at(&hit);
    let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
    let corners = data.mesh.triangles[triangle as usize];
    let uvs = super::scene::both_uvs(&data.mesh, corners, weights);
    // Rays that run into it meet only what is there.
    surface.material.emission
        * scene.texture(surface.emission_texture, uvs).truncate()
        * scene.coverage_at(&hit)
}

/// Weight of a sample of density `a` that might have been taken with density `b`.
///
/// Reference: E. Veach, "Robust Monte Carlo Methods for Light Transport Simulation", 1997, 9.2.2.
pub(super) fn power_heuristic(a: f32, b: f32) -> f32 {
    // As a ratio: squares of large densities overflow.
    let ratio = b / a;
    1.0 / (1.0 + ratio * ratio)
}
