//! All lights together: which to sample, and which a ray runs into.

use super::light::FlatLight;
use super::shape_light::{ShapeHit, ShapeLight};
use crate::bvh::{Aabb, Bvh, Probe, Ray, Shaft};
use bevy_ecs::prelude::*;
use std::ops::ControlFlow;

/// All lights, ready to be sampled and hit.
#[derive(Resource, Clone, Debug, Default)]
pub struct Lights {
    lights: Vec<FlatLight>,
    /// Probability of choosing each when only one is sampled.
    chances: Vec<f32>,
    cumulative: Vec<f32>,
    /// Solid shapes: a hierarchy over them and their numbers in `lights`.
    shapes: Bvh,
    shape_lights: Vec<u32>,
    /// Lights beyond the scene.
    beyond: Vec<u32>,
    /// (instance, material slot) → light, sorted.
    meshes: Vec<((u32, u16), u32)>,
}

/// A light picked for sampling, and the probability of that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Number of the light.
    pub light: u32,
    /// Expected number of times that it is picked: 1 if all lights are.
    pub chance: f32,
}

/// A solid light hit by a ray.
#[derive(Clone, Copy, Debug)]
pub struct LightHit<'a> {
    /// Number of the light.
    pub light: u32,
    /// Its shape.
    pub shape: &'a ShapeLight,
    /// Where.
    pub hit: ShapeHit,
}

/// Up to this many lights are all sampled where the eye looks; more are sampled by chance.
pub const ALL_LIGHTS: usize = 8;
/// Up to this many solid lights are not worth a hierarchy.
const FEW_SHAPES: usize = 4;

impl Lights {
    /// `meshes` names the light of each emissive (instance, slot); `scene_radius` is for the choice only.
    #[must_use]
    pub fn new(lights: Vec<FlatLight>, mut meshes: Vec<((u32, u16), u32)>, scene_radius: f32) -> Self {
        meshes.sort_unstable();
        // A power beyond f32 counts as its largest number, and their sum as what it is.
        let powers: Vec<f64> =
            lights.iter().map(|l| f64::from(l.power(scene_radius).clamp(0.0, f32::MAX))).collect();
        let total: f64 = powers.iter().sum();
        // Half by power, half evenly: a faint near light must not be forgotten.
        let even = 1.0 / lights.len().max(1) as f32;
        let chances: Vec<f32> = powers
            .iter()
            .map(|p| if total > 0.0 { 0.5 * (p / total) as f32 + 0.5 * even } else { even })
            .collect();
        let mut sum = 0.0;
        let cumulative = chances
            .iter()
            .map(|c| {
                sum += c;
                sum
            })
            .collect();
        let numbered = || lights.iter().zip(0u32..);
        let solid: Vec<(u32, Aabb)> = numbered()
            .filter_map(|(l, i)| match l {
                FlatLight::Shape(s) if s.visible => Some((i, s.shape.bounds())),
                _ => None,
            })
            .collect();
        let shapes = Bvh::build(&solid.iter().map(|(_, aabb)| *aabb).collect::<Vec<_>>());
        let shape_lights = solid.iter().map(|(i, _)| *i).collect();
        let beyond = numbered()
            .filter(|(l, _)| match l {
                FlatLight::Environment { .. } | FlatLight::Sky(_) => true,
                FlatLight::Directional { sin2_radius, .. } => *sin2_radius > 0.0,
                _ => false,
            })
            .map(|(_, i)| i)
            .collect();
        Self { chances, cumulative, shapes, shape_lights, beyond, meshes, lights }
    }

    /// Light number `index`.
    #[must_use]
    pub fn get(&self, index: u32) -> &FlatLight {
        &self.lights[index as usize]
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// How many lights are sampled at a vertex after `depth` bounces.
    #[must_use]
    pub fn picks(&self, depth: u32) -> usize {
        if self.samples_all(depth) { self.lights.len() } else { 1 }
    }

    /// Pick number `index` of [`Lights::picks`]; `random` in [0, 1) chooses if not all are taken.
    #[must_use]
    pub fn pick(&self, depth: u32, index: usize, random: f32) -> Pick {
        if self.samples_all(depth) {
            return Pick { light: index as u32, chance: 1.0 };
        }
        let light = self.cumulative.partition_point(|&c| c <= random).min(self.lights.len() - 1);
        Pick { light: light as u32, chance: self.chances[light] }
    }

    /// The [`Pick::chance`] of `light` after `depth` bounces.
    #[must_use]
    pub fn chance(&self, depth: u32, light: u32) -> f32 {
        if self.samples_all(depth) { 1.0 } else { self.chances[light as usize] }
    }

    /// Whether all lights are sampled at a vertex after `depth` bounces.
    #[must_use]
    pub fn samples_all(&self, depth: u32) -> bool {
        self.lights.len() <= if depth == 0 { ALL_LIGHTS } else { 1 }
    }

    /// The nearest solid shape on the ray.
    #[must_use]
    pub fn closest(&self, ray: &Ray) -> Option<LightHit<'_>> {
        let mut best: Option<LightHit> = None;
        let _ = self.shapes_on::<()>(ray, |light, shape, t_max| {
            if let Some(hit) = shape.intersect(&Ray { t_max, ..*ray }) {
                // Of equally near ones the first wins, whatever the order of the search.
                if best.is_none_or(|b| (hit.t, light) < (b.hit.t, b.light)) {
                    best = Some(LightHit { light, shape, hit });
                }
                return ControlFlow::Continue(hit.t);
            }
            ControlFlow::Continue(t_max)
        });
        best
    }

    /// Whether a solid shape other than light number `except` is on the ray.
    #[must_use]
    pub fn blocks(&self, ray: &Ray, except: u32) -> bool {
        self.shapes_on(ray, |light, shape, t_max| {
            if light != except && shape.intersect(ray).is_some() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(t_max)
            }
        })
        .is_break()
    }

    /// Whether surely no solid shape other than light number `except` is in the way within `shaft`.
    #[must_use]
    pub fn is_clear(&self, shaft: &Shaft, except: u32) -> bool {
        self.shape_lights.iter().all(|&light| match self.get(light) {
            FlatLight::Shape(shape) if light != except => shaft.misses_box(&shape.shape.bounds()),
            _ => true,
        })
    }

    /// Whether one of the boxes around solid shapes is such a one.
    #[must_use]
    pub fn any_shape(&self, is: impl Fn(Aabb) -> bool) -> bool {
        self.shape_lights.iter().any(|&light| match self.get(light) {
            FlatLight::Shape(shape) => is(shape.shape.bounds()),
            _ => false,
        })
    }

    fn shapes_on<'a, B>(
        &'a self,
        ray: &Ray,
        mut visit: impl FnMut(u32, &'a ShapeLight, f32) -> ControlFlow<B, f32>,
    ) -> ControlFlow<B> {
        // A few are tried faster than searched.
        if self.shape_lights.len() <= FEW_SHAPES {
            let mut t_max = ray.t_max;
            for &light in &self.shape_lights {
                if let FlatLight::Shape(shape) = &self.lights[light as usize] {
                    t_max = visit(light, shape, t_max)?;
                }
            }
            return ControlFlow::Continue(());
        }
        let probe = Probe::new(ray, &self.shapes.bounds());
        self.shapes.traverse(&probe, ray.t_max, |leaf, mut t_max| {
            for &prim in &self.shapes.prims[leaf] {
                let light = self.shape_lights[prim as usize];
                if let FlatLight::Shape(shape) = &self.lights[light as usize] {
                    t_max = visit(light, shape, t_max)?;
                }
            }
            ControlFlow::Continue(t_max)
        })
    }

    /// Lights beyond the scene: environment and sun discs, with their numbers.
    pub fn beyond(&self) -> impl Iterator<Item = (u32, &FlatLight)> {
        self.beyond.iter().map(|&i| (i, self.get(i)))
    }

    /// Instances that are lights; some several times.
    pub fn instances(&self) -> impl Iterator<Item = u32> {
        self.meshes.iter().map(|((instance, _), _)| *instance)
    }

    /// The light that the triangles of this slot of this instance are.
    #[must_use]
    pub fn of_mesh(&self, instance: u32, slot: u16) -> Option<u32> {
        let found = self.meshes.binary_search_by_key(&(instance, slot), |(key, _)| *key);
        found.ok().map(|i| self.meshes[i].1)
    }
}
