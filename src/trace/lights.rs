//! All lights together: which to sample, and which a ray runs into.

use super::light::FlatLight;
use super::light_tree::{LightTree, Receiver};
use super::shape_light::{ShapeHit, ShapeLight};
use crate::bvh::{Aabb, Bvh, Probe, Ray, Shaft};
use bevy_ecs::prelude::*;
use std::ops::ControlFlow;

/// All lights, ready to be sampled and hit.
#[derive(Resource, Clone, Debug, Default)]
pub struct Lights {
    lights: Vec<FlatLight>,
    /// Over those that are somewhere, if ever only one is sampled.
    tree: LightTree,
    /// Their numbers in `lights`.
    placed: Vec<u32>,
    /// Of each light its place in `placed`; `u32::MAX` for others.
    places: Vec<u32>,
    /// Those that are nowhere: suns and skies.
    unplaced: Vec<u32>,
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
/// So often one of many is chosen evenly: what they are expected to bring does not know what is in between.
const EVENLY: f32 = 0.25;
/// Up to this many solid lights are not worth a hierarchy.
const FEW_SHAPES: usize = 4;

impl Lights {
    /// `meshes` names the light of each emissive (instance, slot).
    #[must_use]
    pub fn new(lights: Vec<FlatLight>, mut meshes: Vec<((u32, u16), u32)>) -> Self {
        meshes.sort_unstable();
        let (mut placed, mut unplaced) = (Vec::new(), Vec::new());
        let (mut emitters, mut places) = (Vec::new(), vec![u32::MAX; lights.len()]);
        if lights.len() > 1 {
            for (i, light) in (0..).zip(&lights) {
                if let Some(emitter) = light.emitter() {
                    places[i as usize] = placed.len() as u32;
                    placed.push(i);
                    emitters.push(emitter);
                } else {
                    unplaced.push(i);
                }
            }
        }
        let tree = LightTree::new(&emitters);
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
        Self { tree, placed, places, unplaced, shapes, shape_lights, beyond, meshes, lights }
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
    pub fn pick(&self, depth: u32, index: usize, to: &Receiver, random: f32) -> Pick {
        if self.samples_all(depth) {
            return Pick { light: index as u32, chance: 1.0 };
        }
        if random < EVENLY {
            let light = (random / EVENLY * self.lights.len() as f32) as usize;
            let light = light.min(self.lights.len() - 1) as u32;
            return Pick { light, chance: self.chance(depth, light, to) };
        }
        let rest = (random - EVENLY) / (1.0 - EVENLY) * self.groups();
        let last = self.lights.len() as u32 - 1;
        let (light, among) = match (self.unplaced.get(rest as usize), self.tree.sample(to, rest.fract())) {
            (Some(&light), _) => (light, 1.0),
            (None, Some(chosen)) => (self.placed[chosen.emitter], chosen.chance),
            (None, None) => (self.unplaced.last().copied().unwrap_or(last), 1.0),
        };
        Pick { light, chance: self.mixed(among) }
    }

    /// The [`Pick::chance`] of `light` after `depth` bounces.
    #[must_use]
    pub fn chance(&self, depth: u32, light: u32, to: &Receiver) -> f32 {
        if self.samples_all(depth) {
            return 1.0;
        }
        let among = match self.places[light as usize] {
            u32::MAX => 1.0,
            place => self.tree.chance(to, place as usize),
        };
        self.mixed(among)
    }

    /// Suns and skies each, and all that is in the scene together, are chosen alike.
    fn groups(&self) -> f32 {
        self.unplaced.len() as f32 + if self.tree.is_empty() { 0.0 } else { 1.0 }
    }

    /// The chance of one that has this chance `among` its group, if it is chosen so.
    fn mixed(&self, among: f32) -> f32 {
        EVENLY / self.lights.len() as f32 + (1.0 - EVENLY) * among / self.groups()
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
