//! All lights together: which to sample, and which a ray runs into.

use super::emitter::{Emitter, Receiver};
use super::features::{Feature, count};
use super::light::FlatLight;
use super::light_sampling::LightSampling;
use super::light_tree::LightTree;
use super::shape_light::{ShapeHit, ShapeLight};
use crate::bvh::{Aabb, Bvh, Probe, Ray, Shaft};
use bevy_ecs::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;

/// All lights, ready to be sampled and hit.
#[derive(Resource, Clone, Debug, Default)]
pub struct Lights {
    lights: Vec<FlatLight>,
    /// Over those that are somewhere, if ever only one is sampled.
    tree: Arc<LightTree>,
    /// What it was made of.
    emitters: Vec<Emitter>,
    /// Their numbers in `lights`.
    placed: Vec<u32>,
    /// Of each light its place in `placed`; `u32::MAX` for others.
    places: Vec<u32>,
    /// Those that are nowhere: suns and skies.
    unplaced: Vec<u32>,
    /// Solid shapes that rays end at.
    seen: Shapes,
    /// Those that only shine: rays go through them.
    unseen: Shapes,
    /// Lights beyond the scene.
    beyond: Vec<u32>,
    /// (instance, material slot) → light, sorted.
    meshes: Vec<((u32, u16), u32)>,
    /// One of many is always chosen evenly: without the tree.
    all_alike: bool,
}

/// Some of the solid shapes: a hierarchy over them, and their numbers among all lights.
#[derive(Clone, Debug, Default)]
struct Shapes {
    hierarchy: Bvh,
    lights: Vec<u32>,
}

impl Shapes {
    fn of(lights: &[FlatLight], visible: bool) -> Self {
        let (numbers, boxes): (Vec<u32>, Vec<Aabb>) = (0..)
            .zip(lights)
            .filter_map(|(i, light)| match light {
                FlatLight::Shape(light) if light.visible == visible => Some((i, light.shape.bounds())),
                _ => None,
            })
            .unzip();
        Self { hierarchy: Bvh::build(&boxes), lights: numbers }
    }
}

/// A light picked for sampling, and how often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Number of the light.
    pub light: u32,
    /// Expected number of times that it is picked at a vertex: 1 if all lights are, once each.
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
/// Of up to this many it is found out what is in their way; they are the bits of a word. Of a room's 24 panels most are seen whole,
/// and none of these is left to chance.
pub const KNOWN_LIGHTS: usize = 32;
/// So often one of up to [`KNOWN_LIGHTS`] is chosen evenly: what they are expected to bring does not know what is in between.
const EVENLY: f32 = 0.25;
/// The same of more: of these hardly two can be mistaken for all light there is, and each even choice costs.
const RARELY: f32 = 0.1;
/// Up to this many solid lights are not worth a hierarchy.
const FEW_SHAPES: usize = 4;
/// Of more solid shapes nobody asks whether one is in view.
const ASKED_ABOUT: usize = 256;

impl Lights {
    /// `meshes` names the light of each emissive (instance, slot). What is as it was `before` is not made again.
    #[must_use]
    pub fn new(lights: Vec<FlatLight>, mut meshes: Vec<((u32, u16), u32)>, before: Option<&Self>) -> Self {
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
        let tree = match before {
            Some(before) if before.emitters == emitters => Arc::clone(&before.tree),
            _ => Arc::new(LightTree::new(&emitters)),
        };
        let [seen, unseen] = [true, false].map(|visible| Shapes::of(&lights, visible));
        let beyond = (0..)
            .zip(&lights)
            .filter(|(_, light)| match light {
                FlatLight::Environment { .. } | FlatLight::Sky(_) => true,
                FlatLight::Directional { sin2_radius, .. } => *sin2_radius > 0.0,
                _ => false,
            })
            .map(|(i, _)| i)
            .collect();
        let all_alike = false;
        Self { tree, emitters, placed, places, unplaced, seen, unseen, beyond, meshes, lights, all_alike }
    }

    /// The same lights, sampled otherwise: to compare.
    #[must_use]
    pub fn sampled(&self, sampling: LightSampling) -> Self {
        let mut lights = Self { all_alike: !sampling.tree, ..self.clone() };
        for light in &mut lights.lights {
            match light {
                FlatLight::Shape(shape) => shape.sampling = sampling,
                FlatLight::Mesh(mesh) => mesh.sample_so(sampling),
                _ => {}
            }
        }
        lights
    }

    /// Each of them.
    pub fn iter(&self) -> impl Iterator<Item = &FlatLight> {
        self.lights.iter()
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

    /// Pick number `index` of [`Lights::picks`]; `random` in [0, 1) chooses if not all are taken. Also what is left of it, a
    /// fresh number. `None` if none could bring anything.
    #[must_use]
    pub fn pick(&self, depth: u32, index: usize, to: &Receiver, random: f32) -> Option<(Pick, f32)> {
        if self.samples_all(depth) {
            return Some((Pick { light: index as u32, chance: 1.0 }, random));
        }
        let evenly = self.evenly();
        if random < evenly {
            let place = random / evenly * self.lights.len() as f32;
            let light = (place as usize).min(self.lights.len() - 1) as u32;
            return Some((Pick { light, chance: self.chance(depth, light, to) }, place.fract()));
        }
        let place = (random - evenly) / (1.0 - evenly) * self.groups();
        if let Some(&light) = self.unplaced.get(place as usize) {
            return Some((Pick { light, chance: self.mixed(1.0) }, place.fract()));
        }
        count(Feature::LightChoice);
        let chosen = self.tree.sample(to, place.fract())?;
        let light = self.placed[chosen.emitter];
        Some((Pick { light, chance: self.mixed(chosen.chance) }, chosen.rest))
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

    /// How often one is chosen evenly.
    fn evenly(&self) -> f32 {
        match self.lights.len() {
            _ if self.all_alike => 1.0,
            ..=KNOWN_LIGHTS => EVENLY,
            _ => RARELY,
        }
    }

    /// The chance of one that has this chance `among` its group, if it is chosen so.
    fn mixed(&self, among: f32) -> f32 {
        let evenly = self.evenly();
        evenly / self.lights.len() as f32 + (1.0 - evenly) * among / self.groups()
    }

    /// Suns and skies each, and all that is in the scene together, are chosen alike.
    fn groups(&self) -> f32 {
        self.unplaced.len() as f32 + if self.tree.is_empty() { 0.0 } else { 1.0 }
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
        let _ = self.shapes_on::<()>(&self.seen, ray, |light, shape, t_max| {
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

    /// Visits all shapes on the ray that only shine.
    pub fn unseen_on<'a>(&'a self, ray: &Ray, mut visit: impl FnMut(LightHit<'a>)) {
        let _ = self.shapes_on::<()>(&self.unseen, ray, |light, shape, t_max| {
            if let Some(hit) = shape.intersect(ray) {
                visit(LightHit { light, shape, hit });
            }
            ControlFlow::Continue(t_max)
        });
    }

    /// Whether a solid shape other than light number `except` is on the ray.
    #[must_use]
    pub fn blocks(&self, ray: &Ray, except: u32) -> bool {
        self.shapes_on(&self.seen, ray, |light, shape, t_max| {
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
        self.seen.lights.iter().all(|&light| match self.get(light) {
            FlatLight::Shape(shape) if light != except => shaft.misses_box(&shape.shape.bounds()),
            _ => true,
        })
    }

    /// Whether one of the boxes around solid shapes is such a one; if they are very many, that is taken for granted.
    #[must_use]
    pub fn any_shape(&self, is: impl Fn(Aabb) -> bool) -> bool {
        // To ask about thousands would cost more than what is known then is worth.
        self.seen.lights.len() > ASKED_ABOUT
            || self.seen.lights.iter().any(|&light| match self.get(light) {
                FlatLight::Shape(shape) => is(shape.shape.bounds()),
                _ => false,
            })
    }

    fn shapes_on<'a, B>(
        &'a self,
        shapes: &'a Shapes,
        ray: &Ray,
        mut visit: impl FnMut(u32, &'a ShapeLight, f32) -> ControlFlow<B, f32>,
    ) -> ControlFlow<B> {
        // A few are tried faster than searched.
        if shapes.lights.len() <= FEW_SHAPES {
            let mut t_max = ray.t_max;
            for &light in &shapes.lights {
                if let FlatLight::Shape(shape) = &self.lights[light as usize] {
                    t_max = visit(light, shape, t_max)?;
                }
            }
            return ControlFlow::Continue(());
        }
        let probe = Probe::new(ray, &shapes.hierarchy.bounds());
        shapes.hierarchy.traverse(&probe, ray.t_max, |leaf, mut t_max| {
            for &prim in &shapes.hierarchy.prims[leaf] {
                let light = shapes.lights[prim as usize];
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A sky, a sun and twenty lamps.
    fn mixed() -> Lights {
        let mut lights = vec![
            FlatLight::Environment { radiance: Vec3::ONE },
            FlatLight::Directional { axis: Vec3::NEG_Y, irradiance: Vec3::ONE, sin2_radius: 0.0 },
        ];
        let at = |i: u8| Vec3::new(f32::from(i), 3.0, f32::from(i % 3));
        lights.extend((0..20).map(|i| FlatLight::Point { position: at(i), intensity: Vec3::ONE }));
        Lights::new(lights, Vec::new(), None)
    }

    #[test]
    fn chances_are_those_of_picks_and_sum_to_one() {
        let (lights, to) = (mixed(), Receiver { point: Vec3::ZERO, normal: Vec3::Y });
        let chances: Vec<f64> = (0..22).map(|light| f64::from(lights.chance(0, light, &to))).collect();
        assert!((chances.iter().sum::<f64>() - 1.0).abs() < 1e-6, "{chances:?}");
        let (mut counts, count) = ([0.0; 22], 1 << 16);
        for i in 0..count {
            let (pick, _) = lights.pick(0, 0, &to, (i as f32 + 0.5) / count as f32).unwrap();
            let chance = chances[pick.light as usize];
            assert!((f64::from(pick.chance) / chance - 1.0).abs() < 1e-5, "{pick:?} {chance}");
            counts[pick.light as usize] += 1.0 / f64::from(count);
        }
        for (count, chance) in counts.iter().zip(&chances) {
            assert!((count - chance).abs() < 1e-3, "{counts:?} {chances:?}");
        }
    }

    #[test]
    fn what_is_as_it_was_is_not_made_again() {
        let before = mixed();
        let same = Lights::new(before.lights.clone(), Vec::new(), Some(&before));
        assert!(Arc::ptr_eq(&same.tree, &before.tree));
        let other = Lights::new(before.lights[..21].to_vec(), Vec::new(), Some(&before));
        assert!(!Arc::ptr_eq(&other.tree, &before.tree));
    }
}
