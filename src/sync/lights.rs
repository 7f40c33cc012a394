//! Lights and whatever emits → the light list.

use super::{Entities, Redone, RenderOrigin};
use crate::scene::color::luminance;
use crate::scene::{GlobalTransform, Hidden, Light, Material, TriangleMesh, Visible, rotation};
use crate::trace::light::FlatLight;
use crate::trace::mesh_light::MeshLight;
use crate::trace::quad::Quad;
use crate::trace::scene::InstanceData;
use crate::trace::shape_light::{Shape, ShapeLight};
use crate::trace::sky::SkyLight;
use crate::trace::{Geometry, Lights, Surfaces};
use bevy_ecs::prelude::*;
use glam::{DAffine3, Vec3};
use std::collections::BTreeMap;

#[expect(clippy::too_many_arguments, reason = "all that may emit")]
/// Makes the light list anew when a light changed, or something that emits may have.
pub fn sync_lights(
    mut lights: ResMut<Lights>,
    mut redone: ResMut<Redone>,
    origin: Res<RenderOrigin>,
    geometry: Res<Geometry>,
    surfaces: Res<Surfaces>,
    all: Query<(Entity, &Light, &GlobalTransform, Option<&Visible>), Without<Hidden>>,
    changed: Query<
        (),
        (With<Light>, Or<(Changed<Light>, Changed<GlobalTransform>, Changed<Visible>, Changed<Hidden>)>),
    >,
    mut entities: ResMut<Entities>,
    mut removed: (RemovedComponents<Light>, RemovedComponents<Visible>, RemovedComponents<Hidden>),
) {
    let removed = removed.0.read().count() + removed.1.read().count() + removed.2.read().count();
    if changed.is_empty() && removed == 0 && !geometry.is_changed() && !surfaces.is_changed() {
        return;
    }
    let mut placed: Vec<_> = all.iter().collect();
    // By index alone: numbers that were used before are no later for that.
    placed.sort_unstable_by_key(|(entity, ..)| entity.index_u32());
    entities.lights.clear();
    let mut flat: Vec<FlatLight> = Vec::new();
    for (entity, light, global, visible) in placed {
        if let Some(light) = flatten(light, &origin.render_from(global), visible, &lights) {
            entities.lights.push(entity);
            flat.push(light);
        }
    }
    let mut meshes = Vec::new();
    for (instance, data) in (0..).zip(&geometry.instances) {
        let placement = geometry.tlas.placements()[instance as usize].world_from_local();
        for (slot, light) in mesh_lights(instance, data, placement, &surfaces, &lights) {
            meshes.push(((instance, slot), flat.len() as u32));
            flat.push(FlatLight::Mesh(light));
        }
    }
    *lights = Lights::new(flat, meshes, Some(&lights));
    redone.lights += 1;
}

/// The light in render space; `None` if it emits nothing, has no place, or its placement left it no extent.
fn flatten(
    light: &Light,
    placed: &DAffine3,
    visible: Option<&Visible>,
    before: &Lights,
) -> Option<FlatLight> {
    if !placed.is_finite() {
        return None;
    }
    let is_off = match light {
        Light::Point { intensity } | Light::Spot { intensity, .. } => *intensity == Vec3::ZERO,
        Light::Directional { irradiance, .. } => *irradiance == Vec3::ZERO,
        Light::Segment { strength, .. } => *strength == [Vec3::ZERO; 2],
        // Those below ask for themselves.
        _ => false,
    };
    if is_off {
        return None;
    }
    let position = placed.translation.as_vec3();
    let vector = |v: Vec3| placed.transform_vector3(v.as_dvec3()).as_vec3();
    let axis = || vector(Vec3::NEG_Z).try_normalize();
    let solid = |shape: Shape, radiance: [Vec3; 4], two_sided: bool| {
        let visible = visible.is_none_or(|v| v.0);
        let area = shape.area();
        let emits = radiance != [Vec3::ZERO; 4];
        let light = ShapeLight::new(shape, radiance, two_sided, visible);
        (area > 0.0 && area.is_finite() && emits).then_some(FlatLight::Shape(light))
    };
    match *light {
        Light::Point { intensity } => Some(FlatLight::Point { position, intensity }),
        Light::Spot { intensity, inner_angle, outer_angle } => Some(FlatLight::Spot {
            position,
            axis: axis()?,
            intensity,
            inner: 2.0 * (0.5 * inner_angle).sin().powi(2),
            outer: 2.0 * (0.5 * outer_angle).sin().powi(2),
        }),
        Light::Directional { irradiance, angle } => {
            let sin2_radius = (0.5 * angle).sin().powi(2);
            Some(FlatLight::Directional { axis: axis()?, irradiance, sin2_radius })
        }
        Light::Segment { half_length, strength, emission } => {
            let half = vector(Vec3::X * half_length);
            let (from, to) = (position - half, position + half);
            (from != to).then_some(FlatLight::Segment { from, to, strength, emission })
        }
        Light::Parallelogram { edge_u, edge_v, radiance, two_sided } => {
            // A mirroring placement turns the cross product round; walking the first edge backward turns
            // it back, so that the front stays where the mirror image has it.
            let [a, b, c, d] = radiance;
            let mirrored = placed.matrix3.determinant() < 0.0;
            let (edge_u, radiance) = if mirrored { (-edge_u, [b, a, d, c]) } else { (edge_u, radiance) };
            // Double precision until the corner is known.
            let edge = |v: Vec3| placed.transform_vector3(v.as_dvec3());
            let corner = (placed.translation - (edge(edge_u) + edge(edge_v)) * 0.5).as_vec3();
            solid(
                Shape::Parallelogram(Quad::new(corner, vector(edge_u), vector(edge_v))),
                radiance,
                two_sided,
            )
        }
        Light::Disk { radius, radiance, two_sided } => {
            let scale = vector(Vec3::X).length();
            solid(
                Shape::Disk { center: position, normal: axis()?, radius: radius * scale },
                [radiance; 4],
                two_sided,
            )
        }
        Light::Sphere { radius, radiance } => {
            let scale = Vec3::AXES.map(|a| vector(a).length()).iter().sum::<f32>() / 3.0;
            solid(Shape::Sphere { center: position, radius: radius * scale }, [radiance; 4], true)
        }
        Light::Sky { ref sky, scale } => {
            let turned = rotation(placed.matrix3).as_mat3();
            let old = (0..before.len() as u32).find_map(|i| match before.get(i) {
                FlatLight::Sky(old) => Some(old),
                _ => None,
            });
            SkyLight::new(sky, scale, turned, old).map(FlatLight::Sky)
        }
        Light::Environment { radiance } => {
            (radiance != Vec3::ZERO).then_some(FlatLight::Environment { radiance })
        }
    }
}

/// The emissive slots of an instance, each as a light.
fn mesh_lights(
    instance: u32,
    data: &InstanceData,
    placed: &DAffine3,
    surfaces: &Surfaces,
    before: &Lights,
) -> Vec<(u16, MeshLight)> {
    let surface = |slot: u16| {
        let number = data.materials.get(usize::from(slot)).copied().unwrap_or(0);
        &surfaces.materials[number as usize].material
    };
    let slots = 0..data.materials.len().max(1) as u16;
    let emissive = slots.filter(|&slot| surface(slot).emission != Vec3::ZERO);
    let mut triangles: BTreeMap<u16, Vec<u32>> = emissive.map(|slot| (slot, Vec::new())).collect();
    if triangles.is_empty() {
        return Vec::new();
    }
    for triangle in 0..data.mesh.triangles.len() {
        if let Some(own) = triangles.get_mut(&(data.mesh.slot(triangle) as u16)) {
            own.push(triangle as u32);
        }
    }
    let light = |(slot, own): (u16, Vec<u32>)| {
        let before = before.of_mesh(instance, slot).and_then(|light| match before.get(light) {
            FlatLight::Mesh(light) => Some(light),
            _ => None,
        });
        Some((slot, mesh_light(instance, &data.mesh, &own, placed, surface(slot), before)?))
    };
    triangles.into_iter().filter_map(light).collect()
}

/// Of the triangles of an instance that wear one material.
fn mesh_light(
    instance: u32,
    mesh: &TriangleMesh,
    own: &[u32],
    placed: &DAffine3,
    material: &Material,
    before: Option<&MeshLight>,
) -> Option<MeshLight> {
    let mirrored = placed.matrix3.determinant() < 0.0;
    let triangles = own.iter().map(|&triangle| {
        let corners = mesh.corners(triangle as usize);
        (triangle, corners.map(|p| placed.transform_point3(p.as_dvec3()).as_vec3()))
    });
    let sides = [material.double_sided, mirrored];
    MeshLight::new(instance, triangles, sides, luminance(material.emission), before)
}
