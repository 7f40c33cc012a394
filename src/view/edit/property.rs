//! Everything about a thing that can be edited, as numbers with names.

use super::below;
use crate::bvh::Aabb;
use crate::load::settings::edit::{set_sizes, sizes, spectra};
use crate::scene::color::luminance;
use crate::scene::{ByHand, GlobalTransform, Glossy, Instance, Light, Material, Mesh, Transform};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat3, DQuat, DVec3, EulerRot, Vec3};
use std::f32::consts::FRAC_PI_2;
use std::f64::consts::PI;

/// One number of a thing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// Along a world axis, scene units.
    Position(usize),
    /// About a world axis (the one after the other: x, y, z), degrees.
    Turn(usize),
    /// Where a sun stands on the compass, degrees: 0 beyond -Z, 90 on the side of +X.
    Azimuth,
    /// How high it stands above the horizon, degrees.
    Elevation,
    /// Factor in all directions.
    Scale,
    /// A channel of the light's spectra, relative to the strongest.
    LightColor(usize),
    /// Mean luminance of its spectra.
    Power,
    /// See [`sizes`]; angles in degrees.
    Size(usize),
    /// A channel of the base colour, 0 to 1.
    BaseColor(usize),
    /// Of GGX, 0 to 1.
    Roughness,
    /// Of GGX, 0 to 1.
    Metallic,
    /// Of Blinn-Phong, grey, 0 to 1.
    Specular,
    /// Of Blinn-Phong.
    Exponent,
    /// Grey, 0 to 1.
    Mirror,
    /// Luminance that it emits.
    Emission,
    /// A channel of what it emits, relative to the strongest.
    EmissionColor(usize),
}

/// A property and its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Which.
    pub property: Property,
    /// What it is called.
    pub label: &'static str,
    /// How much it is.
    pub value: f64,
    /// What a press of a key or a point of the mouse adds; or, for `grows`, the part by which it grows.
    pub step: f64,
    /// Whether steps are factors.
    pub grows: bool,
    /// What it may be.
    pub range: [f64; 2],
}

impl Row {
    /// The value after `steps` presses.
    #[must_use]
    pub fn stepped(&self, steps: f64) -> f64 {
        let [low, high] = self.range;
        let next = if self.grows {
            self.value * (1.0 + self.step).powf(steps)
        } else {
            self.value + self.step * steps
        };
        // Nothing grows from nothing.
        let next = if self.grows && self.value == 0.0 && steps > 0.0 { self.step } else { next };
        next.clamp(low, high)
    }
}

const AXES: [[&str; 3]; 4] = [
    ["x", "y", "z"],
    ["turn x", "turn y", "turn z"],
    ["red", "green", "blue"],
    ["emits red", "emits green", "emits blue"],
];
const ANY: [f64; 2] = [-1e15, 1e15];
const UNIT: [f64; 2] = [0.0, 1.0];
const POSITIVE: [f64; 2] = [1e-9, 1e12];

/// All that can be edited of `entity`, whose material number `slot` was meant. `radius` is that of the scene.
#[must_use]
pub fn rows(world: &World, entity: Entity, slot: usize, radius: f64) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |property, label, value: f64, step: f64, grows: bool, range: [f64; 2]| {
        // Adding 0 turns −0 into 0.
        rows.push(Row { property, label, value: value + 0.0, step, grows, range });
    };
    let light = world.get::<Light>(entity);
    let has_place =
        !matches!(light, Some(Light::Environment { .. } | Light::Sky { .. } | Light::Directional { .. }));
    if let (Some(Light::Directional { .. }), Some(place)) = (light, world.get::<GlobalTransform>(entity)) {
        let [azimuth, elevation] = stands(&place.0);
        add(Property::Azimuth, "azimuth", azimuth, 5.0, false, ANY);
        add(Property::Elevation, "elevation", elevation, 5.0, false, [-90.0, 90.0]);
    }
    if let Some(place) = world.get::<GlobalTransform>(entity).filter(|_| has_place) {
        let (scale, rotation, translation) = parts(&place.0);
        for axis in 0..3 {
            add(Property::Position(axis), AXES[0][axis], translation[axis], radius / 50.0, false, ANY);
        }
        for axis in 0..3 {
            add(Property::Turn(axis), AXES[1][axis], rotation[axis].to_degrees(), 5.0, false, ANY);
        }
        if light.is_none() {
            add(Property::Scale, "scale", scale.abs().max_element(), 0.05, true, POSITIVE);
        }
    }
    if let Some(light) = light {
        let mut copy = light.clone();
        let all: Vec<Vec3> = spectra(&mut copy).into_iter().map(|s| *s).collect();
        let mean = all.iter().sum::<Vec3>() / all.len().max(1) as f32;
        add(Property::Power, "strength", f64::from(luminance(mean)), 0.1, true, [0.0, 1e12]);
        let most = f64::from(mean.max_element()).max(1e-30);
        for (channel, label) in AXES[2].into_iter().enumerate() {
            let share = f64::from(mean[channel]) / most;
            add(Property::LightColor(channel), label, share, 0.05, false, UNIT);
        }
        for (i, size) in sizes(light).into_iter().enumerate() {
            let (label, degrees) = size_label(light, i);
            let value = if degrees { f64::from(size).to_degrees() } else { f64::from(size) };
            let range = size_range(light, i, degrees);
            add(Property::Size(i), label, value, if degrees { 1.0 } else { 0.1 }, !degrees, range);
        }
    }
    if let Some(material) = material_of(world, entity, slot).and_then(|m| world.get::<Material>(m)) {
        for (channel, label) in AXES[2].into_iter().enumerate() {
            let value = f64::from(material.base_color[channel]);
            add(Property::BaseColor(channel), label, value, 0.05, false, UNIT);
        }
        match material.glossy {
            Glossy::None => {}
            Glossy::Ggx { metallic, roughness, .. } => {
                add(Property::Roughness, "roughness", f64::from(roughness), 0.05, false, UNIT);
                add(Property::Metallic, "metallic", f64::from(metallic), 0.1, false, UNIT);
            }
            Glossy::BlinnPhong { specular, exponent, .. } => {
                add(Property::Specular, "specular", f64::from(specular.max_element()), 0.05, false, UNIT);
                add(Property::Exponent, "exponent", f64::from(exponent), 0.2, true, [0.0, 1e6]);
            }
        }
        add(Property::Mirror, "mirror", f64::from(material.mirror.max_element()), 0.05, false, UNIT);
        add(Property::Emission, "emits", f64::from(luminance(material.emission)), 0.2, true, [0.0, 1e12]);
        let most = f64::from(material.emission.max_element());
        if most > 0.0 {
            for (channel, label) in AXES[3].into_iter().enumerate() {
                let share = f64::from(material.emission[channel]) / most;
                add(Property::EmissionColor(channel), label, share, 0.05, false, UNIT);
            }
        }
    }
    rows
}

/// What [`set_sizes`] takes.
fn size_range(light: &Light, i: usize, degrees: bool) -> [f64; 2] {
    match light {
        Light::Spot { outer_angle, .. } if i == 0 => [0.0, f64::from(*outer_angle).to_degrees()],
        // A right angle in single precision is more than one.
        Light::Spot { inner_angle, .. } => [f64::from(*inner_angle).to_degrees().min(90.0), 90.0],
        _ if degrees => [0.0, 180.0],
        _ => POSITIVE,
    }
}

fn size_label(light: &Light, i: usize) -> (&'static str, bool) {
    match light {
        Light::Spot { .. } => (["inner angle", "outer angle"][i % 2], true),
        Light::Directional { .. } => ("angle", true),
        Light::Segment { .. } => ("half length", false),
        Light::Parallelogram { .. } => (["edge u", "edge v"][i % 2], false),
        _ => ("radius", false),
    }
}

/// The material that `slot` of an instance wears.
#[must_use]
pub fn material_of(world: &World, entity: Entity, slot: usize) -> Option<Entity> {
    world.get::<Instance>(entity)?.materials.get(slot).copied()
}

/// Scale along the local axes, rotation about x, then y, then z in radians, and place.
fn parts(place: &DAffine3) -> (DVec3, DVec3, DVec3) {
    let (scale, rotation, translation) = place.to_scale_rotation_translation();
    let (z, y, x) = rotation.to_euler(EulerRot::ZYX);
    // Of the two ways to say it the one with less about x and z: who turns a thing about y goes on beyond a right angle.
    let other = DVec3::new(x - PI.copysign(x), PI.copysign(y) - y, z - PI.copysign(z));
    let turn = if x.abs() + z.abs() > PI { other } else { DVec3::new(x, y, z) };
    (scale, turn, translation)
}

/// About what a thing is turned and scaled, in its own space: its origin, but where that is outside of all that it shows, as with
/// files that have all of their objects in one place, the middle of these.
fn pivot(world: &World, entity: Entity, global: &DAffine3) -> DVec3 {
    let local = global.inverse();
    let shown = below(world, entity).into_iter().chain([entity]);
    let mut bounds = Aabb::EMPTY;
    for thing in shown {
        let mesh = world.get::<Instance>(thing).and_then(|instance| world.get::<Mesh>(instance.mesh));
        let (Some(mesh), Some(place)) = (mesh, world.get::<GlobalTransform>(thing)) else { continue };
        let own = if thing == entity { DAffine3::IDENTITY } else { local * place.0 };
        let aabb = Aabb::around(&mesh.0.positions);
        for corner in 0..if aabb.is_empty() { 0 } else { 8 } {
            let side = |axis: usize| if corner >> axis & 1 == 0 { aabb.min[axis] } else { aabb.max[axis] };
            let corner = Vec3::new(side(0), side(1), side(2)).as_dvec3();
            bounds = bounds.with(own.transform_point3(corner).as_vec3());
        }
    }
    let has_origin = bounds.is_empty() || bounds.contains(&Aabb::around(&[Vec3::ZERO]));
    if has_origin { DVec3::ZERO } else { bounds.center().as_dvec3() }
}

/// Azimuth and elevation of a sun, degrees. It shines along its -Z.
fn stands(place: &DAffine3) -> [f64; 2] {
    let towards = place.matrix3.z_axis.normalize_or(DVec3::Y);
    // At the zenith what is across still knows where it came from.
    let across = place.matrix3.x_axis;
    let (east, north) = match towards.x.hypot(towards.z) > 1e-6 {
        true => (towards.x, -towards.z),
        false => (-across.z, -across.x),
    };
    let azimuth = east.atan2(north).to_degrees();
    [if azimuth < 0.0 { azimuth + 360.0 } else { azimuth }, towards.y.clamp(-1.0, 1.0).asin().to_degrees()]
}

/// The rotation of a sun that stands there.
fn turned([azimuth, elevation]: [f64; 2]) -> DMat3 {
    DMat3::from_rotation_y(PI - azimuth.to_radians()) * DMat3::from_rotation_x(-elevation.to_radians())
}

/// Gives `property` of `entity` the value. What the thing does not have stays.
pub fn set(world: &mut World, entity: Entity, slot: usize, property: Property, value: f64) {
    match property {
        Property::Position(_)
        | Property::Turn(_)
        | Property::Azimuth
        | Property::Elevation
        | Property::Scale => place(world, entity, property, value),
        Property::LightColor(_) | Property::Power | Property::Size(_) => {
            if let Some(mut light) = world.get_mut::<Light>(entity) {
                set_light(&mut light, property, value as f32);
            }
        }
        _ => {
            let material = material_of(world, entity, slot);
            if let Some(mut material) = material.and_then(|m| world.get_mut::<Material>(m)) {
                set_material(&mut material, property, value as f32);
            }
        }
    }
}

/// Moves it in the world; what it hangs on stays.
fn place(world: &mut World, entity: Entity, property: Property, value: f64) {
    let Some(global) = world.get::<GlobalTransform>(entity).map(|global| global.0) else { return };
    let (scale, turn, translation) = parts(&global);
    let mut moved = global;
    let pivot = match property {
        Property::Turn(_) | Property::Scale => pivot(world, entity, &global),
        _ => DVec3::ZERO,
    };
    match property {
        Property::Position(axis) => {
            let mut to = translation;
            to[axis] = value;
            moved.translation = to;
        }
        Property::Turn(axis) => {
            let rotation =
                |turn: DVec3| DMat3::from_quat(DQuat::from_euler(EulerRot::ZYX, turn.z, turn.y, turn.x));
            let mut to = turn;
            to[axis] = value.to_radians();
            moved.matrix3 = rotation(to) * rotation(turn).inverse() * global.matrix3;
        }
        Property::Azimuth => moved.matrix3 = turned([value, stands(&global)[1]]),
        Property::Elevation => moved.matrix3 = turned([stands(&global)[0], value]),
        _ => moved.matrix3 *= value / scale.abs().max_element(),
    }
    if pivot != DVec3::ZERO {
        moved.translation = global.transform_point3(pivot) - moved.matrix3 * pivot;
    }
    let parent = world.get::<ChildOf>(entity).map(ChildOf::parent);
    let world_from_parent = parent.and_then(|p| world.get::<GlobalTransform>(p)).map(|g| g.0);
    let local = world_from_parent.map_or(moved, |parent| parent.inverse() * moved);
    if local.is_finite()
        && let Some(mut transform) = world.get_mut::<Transform>(entity)
    {
        transform.set_if_neq(Transform(local));
        world.entity_mut(entity).insert(ByHand);
    }
    // The next edit of the same frame starts from here.
    crate::app::propagate(world);
}

fn set_light(light: &mut Light, property: Property, value: f32) {
    let mean = |light: &mut Light| {
        let all = spectra(light);
        let count = all.len().max(1) as f32;
        all.into_iter().map(|s| *s).sum::<Vec3>() / count
    };
    match property {
        Property::Power => {
            let old = luminance(mean(light));
            for spectrum in spectra(light) {
                *spectrum = if old > 0.0 { *spectrum * (value / old) } else { Vec3::splat(value) };
            }
        }
        Property::LightColor(channel) => {
            let old = mean(light);
            let wanted = value * old.max_element();
            for spectrum in spectra(light) {
                let share = if old[channel] > 0.0 { spectrum[channel] / old[channel] } else { 1.0 };
                spectrum[channel] = wanted * share;
            }
        }
        Property::Size(i) => {
            let mut wanted = sizes(light);
            let degrees = size_label(light, i).1;
            if let Some(size) = wanted.get_mut(i) {
                *size = if degrees { value.to_radians() } else { value };
                // Degrees and back may round beyond the other angle.
                if let Light::Spot { inner_angle, outer_angle, .. } = light {
                    let limits = if i == 0 { [0.0, *outer_angle] } else { [*inner_angle, FRAC_PI_2] };
                    wanted[i] = wanted[i].max(limits[0]).min(limits[1]);
                }
                // One that cannot be stays as it is.
                set_sizes(light, &wanted);
            }
        }
        _ => {}
    }
}

fn set_material(material: &mut Material, property: Property, value: f32) {
    // A grey mirror or a light of the same colour, however dark it was.
    let scaled = |color: Vec3, old: f32| if old > 0.0 { color * (value / old) } else { Vec3::splat(value) };
    match property {
        Property::BaseColor(channel) => material.base_color[channel] = value,
        Property::Mirror => material.mirror = scaled(material.mirror, material.mirror.max_element()),
        Property::EmissionColor(channel) => {
            material.emission[channel] = value * material.emission.max_element();
        }
        Property::Emission => material.emission = scaled(material.emission, luminance(material.emission)),
        Property::Roughness | Property::Metallic => {
            if let Glossy::Ggx { metallic, roughness, .. } = &mut material.glossy {
                *(if property == Property::Roughness { roughness } else { metallic }) = value;
            }
        }
        Property::Specular => {
            if let Glossy::BlinnPhong { specular, .. } = &mut material.glossy {
                *specular = scaled(*specular, specular.max_element());
            }
        }
        Property::Exponent => {
            if let Glossy::BlinnPhong { exponent, .. } = &mut material.glossy {
                *exponent = value;
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests;
