//! Which thing is edited: the one under the cursor, or the next one in order.

use super::super::orbit::ray_through;
use super::marks::ends_of;
use super::{Selection, below};
use crate::bvh::Ray;
use crate::scene::{GlobalTransform, Hidden, Instance, Light, Visible};
use crate::sync::{self, Entities, RenderOrigin};
use crate::trace::{Geometry, Lights, RenderSettings, Viewpoint};
use bevy_ecs::prelude::*;
use glam::{DVec2, Vec2};

/// A lamp that no ray meets is under the cursor within so many pixels.
const NEAR: f32 = 10.0;

/// All that can be edited, hidden or not: lights, of which there are few, then each material of each instance, in the
/// order in which they were made.
pub(super) fn things(world: &World) -> Vec<Selection> {
    let (mut lights, mut instances) = (Vec::new(), Vec::new());
    for thing in world.iter_entities() {
        let entity = thing.id();
        if thing.contains::<Light>() {
            lights.push(Selection { entity, slot: 0 });
        } else if let Some(instance) = thing.get::<Instance>() {
            instances.extend((0..instance.materials.len().max(1)).map(|slot| Selection { entity, slot }));
        }
    }
    for list in [&mut lights, &mut instances] {
        list.sort_by_key(|thing| (thing.entity.index_u32(), thing.slot));
    }
    lights.extend(instances);
    lights
}

/// The thing `by` places behind `from`, round and round; without one the first or the last.
pub(super) fn stepped(things: &[Selection], from: Option<Selection>, by: i64) -> Option<Selection> {
    let here = from.and_then(|from| things.iter().position(|&thing| thing == from));
    let here = here.map_or(if by > 0 { -1 } else { 0 }, |here| here as i64);
    let there = (here + by).checked_rem_euclid(things.len() as i64)?;
    things.get(there as usize).copied()
}

/// What is at `cursor`. A lamp that no ray meets counts where it is before all surfaces, or anywhere if it is `marked`.
pub(super) fn pick(world: &World, cursor: DVec2, marked: bool) -> Option<Selection> {
    let geometry = world.resource::<Geometry>();
    let viewpoint = world.resource::<Viewpoint>();
    let ray = ray_through(viewpoint, world.resource::<RenderSettings>(), cursor);
    let hit = sync::traceable(world).first_seen(&ray);
    let entities = world.resource::<Entities>();
    let t_max = hit.map_or(f32::INFINITY, |hit| hit.t);
    let lamp = world.resource::<Lights>().closest(&Ray { t_max, ..ray });
    let surface = lamp.map_or(t_max, |lamp| lamp.hit.t);
    let can_hide = surface.is_finite() && !marked;
    let depth = if can_hide { viewpoint.depth(&ray, surface) } else { f32::INFINITY };
    if let Some(entity) = lamp_near(world, cursor, depth) {
        return Some(Selection { entity, slot: 0 });
    }
    if let Some(lamp) = lamp {
        let entity = *entities.lights.get(lamp.light as usize)?;
        return Some(Selection { entity, slot: 0 });
    }
    let hit = hit?;
    let slot = geometry.instances[hit.instance as usize].mesh.slot(hit.triangle as usize);
    Some(Selection { entity: *entities.instances.get(hit.instance as usize)?, slot })
}

/// The lamp nearest to `cursor` in the picture of those that are no deeper than `depth`.
fn lamp_near(world: &World, cursor: DVec2, depth: f32) -> Option<Entity> {
    let (viewpoint, origin) = (world.resource::<Viewpoint>(), world.resource::<RenderOrigin>());
    let size = world.resource::<RenderSettings>().size;
    let cursor = (cursor * size.as_dvec2()).as_vec2();
    let lamps = world.iter_entities().filter(|thing| !thing.contains::<Hidden>()).filter_map(|thing| {
        let placed = origin.render_from(thing.get::<GlobalTransform>()?);
        let ends = ends_of(thing.get::<Light>()?, thing.get::<Visible>(), &placed)?;
        let [a, b] = ends.map(|end| viewpoint.project(end, size));
        let in_sight = a.z.min(b.z) > 0.0 && a.z.min(b.z) <= depth;
        in_sight.then(|| (distance(cursor, [a.truncate(), b.truncate()]), thing.id()))
    });
    let near = lamps.filter(|(distance, _)| *distance <= NEAR);
    near.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, entity)| entity)
}

/// Of `point` from the line between two points.
fn distance(point: Vec2, [a, b]: [Vec2; 2]) -> f32 {
    let along = b - a;
    let part = ((point - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
    point.distance(a + along * part)
}

/// What kind of light it is; which material of an instance that has several is meant; or how many things a group has.
pub(super) fn kind_of(world: &World, Selection { entity, slot }: Selection) -> Option<String> {
    if let Some(light) = world.get::<Light>(entity) {
        return Some(light_kind(light).to_owned());
    }
    let Some(instance) = world.get::<Instance>(entity) else {
        return Some(match below(world, entity).len() {
            1 => "group of 1 thing".to_owned(),
            count => format!("group of {count} things"),
        });
    };
    let materials = &instance.materials;
    let name = materials.get(slot).and_then(|&material| world.get::<Name>(material));
    let name = name.map_or_else(|| format!("material {}", slot + 1), |name| name.as_str().to_owned());
    (materials.len() > 1).then_some(name)
}

fn light_kind(light: &Light) -> &'static str {
    match light {
        Light::Point { .. } => "point light",
        Light::Spot { .. } => "spot light",
        Light::Directional { .. } => "sun",
        Light::Segment { .. } => "segment light",
        Light::Parallelogram { .. } => "parallelogram light",
        Light::Disk { .. } => "disk light",
        Light::Sphere { .. } => "sphere light",
        Light::Environment { .. } | Light::Sky { .. } => "sky",
    }
}
