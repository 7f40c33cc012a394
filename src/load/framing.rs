//! What the program decides when a file has no camera or no light, and how large the scene is.

use super::report::{Kind, Sink};
use super::studio;
use crate::scene::{
    ActiveCamera, Camera, GlobalTransform, Hidden, Instance, Light, Material, Mesh, Projection, SceneBounds,
    Transform, Visible, propagate_transforms,
};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Triangles that are looked at to find the bounds.
const MOST_SAMPLES: usize = 100_000;
/// World coordinates beyond this cannot be traced.
const FAR: f64 = 1e18;
/// Share of the area, or of the triangles, beyond which a corner is an outlier, at each end of each axis.
const OUTLIERS: f64 = 0.01;
/// Few triangles count as outliers if they make the scene this much larger: far debris by area ...
const FAR_DEBRIS: f64 = 4.0;
/// ... and a large floor or backdrop by number.
const BACKDROP: f64 = 3.0;
/// Surfaces that face one side by more than this share of their area make that side the front.
const ONE_SIDED: f64 = 0.08;
/// Radiance of a white surface at the centre that faces the key light.
const KEY_RADIANCE: f64 = 0.8;
/// Radiance of the environment beside it.
const FILL_RADIANCE: f32 = 0.25;

/// Derives transforms, sets bounds and active camera, and adds camera and light where there are none.
pub(super) fn complete(file: &str, camera: Option<Entity>, sink: &mut Sink<'_>) {
    propagate(sink.world);
    drop_far_instances(file, sink);
    let survey = survey(sink.world);
    let bounds = survey.bounds.unwrap_or(Box3 { min: DVec3::splat(-1.0), max: DVec3::ONE });
    let ball = bounds.ball();
    sink.world.insert_resource(ball);
    if survey.bounds.is_none() {
        sink.ignored(file, "", "no triangle to see in it: the picture will be empty");
    }
    let first = sink.report.cameras.first().map(|&(_, camera)| camera);
    let active = camera.or(first).unwrap_or_else(|| frame(file, &survey, &bounds, ball, sink));
    sink.world.insert_resource(ActiveCamera(active));
    if !has_light(sink.world) {
        add_light(sink.world, active, ball).into_iter().for_each(|light| sink.note_spawned(light));
        sink.decide(file, format!("no light in it; {ADDED_LIGHT}"));
    }
    propagate(sink.world);
}

fn propagate(world: &mut World) {
    // It has no parameter that could be missing.
    let _ = world.run_system_once(propagate_transforms);
}

/// Around what is seen as it is now; `None` without triangles. Outliers are left out.
#[must_use]
pub fn bounds_now(world: &mut World) -> Option<SceneBounds> {
    survey(world).bounds.map(|bounds| bounds.ball())
}

/// An axis-aligned box in world space.
#[derive(Clone, Copy)]
struct Box3 {
    min: DVec3,
    max: DVec3,
}

impl Box3 {
    fn diagonal(&self) -> f64 {
        (self.max - self.min).length()
    }

    fn ball(&self) -> SceneBounds {
        SceneBounds { center: 0.5 * (self.min + self.max), radius: (0.5 * self.diagonal()).max(1e-30) }
    }
}

/// What a glance at the triangles says.
struct Survey {
    /// None without triangles.
    bounds: Option<Box3>,
    /// Sum of area times normal, over the sum of areas.
    facing: DVec3,
    /// Whether outliers were left out.
    trimmed: bool,
}

/// A corner and the area it stands for.
struct Sample {
    corner: DVec3,
    area: f64,
}

fn survey(world: &mut World) -> Survey {
    let query = world.query_filtered::<(&Instance, &GlobalTransform), Without<Hidden>>();
    let meshes = |instance: &Instance| world.get::<Mesh>(instance.mesh).map(|mesh| &mesh.0);
    let total: usize =
        query.iter_manual(world).filter_map(|(i, _)| meshes(i)).map(|mesh| mesh.triangles.len()).sum();
    let step = total.div_ceil(MOST_SAMPLES).max(1);
    let mut samples = Vec::with_capacity(3 * total / step + 3);
    let (mut all, mut area_sum, mut normal_sum) = (None::<Box3>, 0.0, DVec3::ZERO);
    let mut count = 0;
    for (instance, transform) in query.iter_manual(world) {
        let Some(mesh) = meshes(instance) else {
            continue;
        };
        // The same step across instances, so that many small ones count as one large.
        let skip = (step - count % step) % step;
        count += mesh.triangles.len();
        for i in (skip..mesh.triangles.len()).step_by(step) {
            let corners = mesh.corners(i).map(|p| transform.0.transform_point3(p.as_dvec3()));
            let normal = 0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let area = normal.length();
            area_sum += area;
            normal_sum += normal;
            for corner in corners {
                let known = all.unwrap_or(Box3 { min: corner, max: corner });
                all = Some(Box3 { min: known.min.min(corner), max: known.max.max(corner) });
                samples.push(Sample { corner, area });
            }
        }
    }
    let facing = if area_sum > 0.0 { normal_sum / area_sum } else { DVec3::ZERO };
    let Some(all) = all else {
        return Survey { bounds: None, facing, trimmed: false };
    };
    let [by_area, by_number] = trimmed(&mut samples);
    // Only what leaves the rest a speck is worth cutting off.
    let is_far = |core: &Box3, times: f64| all.diagonal() > times * core.diagonal();
    let (bounds, trimmed) = if is_far(&by_area, FAR_DEBRIS) {
        (by_area, true)
    } else if is_far(&by_number, BACKDROP) && by_number.diagonal() > 0.0 {
        (by_number, true)
    } else {
        (all, false)
    };
    Survey { bounds: Some(bounds), facing, trimmed }
}

/// The boxes between the first and last hundredth along each axis: of the area, and of the triangles.
fn trimmed(samples: &mut [Sample]) -> [Box3; 2] {
    let total: f64 = samples.iter().map(|sample| sample.area).sum();
    let number = samples.len() as f64;
    let mut cores = [Box3 { min: DVec3::ZERO, max: DVec3::ZERO }; 2];
    for axis in 0..3 {
        samples.par_sort_unstable_by(|a, b| a.corner[axis].total_cmp(&b.corner[axis]));
        let edges = |weight: fn(&Sample) -> f64, outside: f64| {
            [
                inner_edge(samples.iter(), axis, weight, outside),
                inner_edge(samples.iter().rev(), axis, weight, outside),
            ]
        };
        let both = [edges(|sample| sample.area, OUTLIERS * total), edges(|_| 1.0, OUTLIERS * number)];
        for (core, [min, max]) in cores.iter_mut().zip(both) {
            (core.min[axis], core.max[axis]) = (min, max);
        }
    }
    cores
}

/// Coordinate of the first sample with more than `outside` of the weight at or before it.
fn inner_edge<'s>(
    samples: impl Iterator<Item = &'s Sample>,
    axis: usize,
    weight: fn(&Sample) -> f64,
    outside: f64,
) -> f64 {
    let mut passed = 0.0;
    for sample in samples {
        passed += weight(sample);
        if passed > outside {
            return sample.corner[axis];
        }
    }
    0.0
}

/// Instances whose corners leave the range of single precision are taken out of the picture.
fn drop_far_instances(file: &str, sink: &mut Sink<'_>) {
    let query = sink.world.query::<(Entity, &Instance, &GlobalTransform)>();
    let is_far = |instance: &Instance, transform: &GlobalTransform| {
        let mesh = sink.world.get::<Mesh>(instance.mesh)?;
        let bounds = mesh.0.positions.iter().filter(|p| p.is_finite()).map(|p| p.abs()).reduce(Vec3::max)?;
        let columns = [transform.0.matrix3.x_axis, transform.0.matrix3.y_axis, transform.0.matrix3.z_axis];
        let [x, y, z] = bounds.as_dvec3().to_array();
        let reach = columns[0].abs() * x
            + columns[1].abs() * y
            + columns[2].abs() * z
            + transform.0.translation.abs();
        Some(!reach.is_finite() || reach.max_element() > FAR)
    };
    let far: Vec<Entity> = query
        .iter_manual(sink.world)
        .filter(|(_, i, t)| is_far(i, t) == Some(true))
        .map(|(entity, ..)| entity)
        .collect();
    for &entity in &far {
        sink.world.entity_mut(entity).remove::<Instance>();
    }
    if !far.is_empty() {
        let what = "instances left out: their transform takes them beyond the range of 1e18";
        sink.remark(Kind::Ignored, file, "", what.to_owned(), far.len());
    }
}

/// A camera that shows the whole box, from the front, above and right; straight from the open side
/// of a room or the face of a flat thing.
fn frame(file: &str, survey: &Survey, bounds: &Box3, ball: SceneBounds, sink: &mut Sink<'_>) -> Entity {
    let flat = DVec3::new(survey.facing.x, 0.0, survey.facing.z);
    let one_sided = flat.length() > ONE_SIDED;
    let back = if one_sided { flat.normalize() } else { DVec3::new(0.45, 0.4, 1.0).normalize() };
    let view = Transform::looking_at(back, DVec3::ZERO, DVec3::Y).0.matrix3;
    let vertical_fov = 40.0_f64.to_radians();
    let slope = 0.95 * (0.5 * vertical_fov).tan();
    // Narrow pictures show less across.
    let size = sink.options.resolution.or(sink.report.render.resolution);
    let across = slope * size.map_or(1.0, |[w, h]| f64::from(w.max(1)) / f64::from(h.max(1))).min(1.0);
    let half = 0.5 * (bounds.max - bounds.min);
    let corners = (0..8).map(|i| half * DVec3::new(sign(i, 1), sign(i, 2), sign(i, 4)));
    let distance = corners
        .map(|corner| {
            let seen = view.transpose() * corner;
            seen.z + (seen.x.abs() / across).max(seen.y.abs() / slope)
        })
        .fold(ball.radius * 1e-3, f64::max);
    let transform = Transform::looking_at(ball.center + back * distance, ball.center, DVec3::Y);
    let projection = Projection::Perspective { vertical_fov: vertical_fov as f32 };
    let name = "framing camera";
    let camera = sink.spawn((Name::new(name), transform, Camera { projection }));
    sink.report.cameras.push((name.to_owned(), camera));
    let side = if one_sided { "the side its surfaces face" } else { "the front, above and right" };
    let rest =
        if survey.trimmed { "; a few triangles far outside of the rest are left out of account" } else { "" };
    sink.decide(file, format!("no camera in it; looks at the whole scene from {side}{rest}"));
    camera
}

fn sign(i: u32, bit: u32) -> f64 {
    if i & bit == 0 { -1.0 } else { 1.0 }
}

/// Whether anything shines: a light that is not out, or an emissive material on an instance.
fn has_light(world: &mut World) -> bool {
    if world.query::<&Light>().iter(world).any(|light| !is_out(light)) {
        return true;
    }
    let instances = world.query::<&Instance>();
    let shines =
        |&material: &Entity| world.get::<Material>(material).is_some_and(|m| m.emission != Vec3::ZERO);
    instances.iter_manual(world).any(|instance| instance.materials.iter().any(shines))
}

/// Whether a lamp gives no light; who writes a black environment wants it dark.
fn is_out(light: &Light) -> bool {
    match light {
        Light::Point { intensity } | Light::Spot { intensity, .. } => *intensity == Vec3::ZERO,
        Light::Directional { irradiance, .. } => *irradiance == Vec3::ZERO,
        Light::Segment { strength, .. } => *strength == [Vec3::ZERO; 2],
        Light::Parallelogram { radiance, .. } => *radiance == [Vec3::ZERO; 4],
        Light::Disk { radiance, .. } | Light::Sphere { radiance, .. } => *radiance == Vec3::ZERO,
        Light::Environment { .. } | Light::Sky { .. } => false,
    }
}

/// How decisions name what [`light_for`] adds.
pub(crate) const ADDED_LIGHT: &str =
    "a soft key light shines from up left behind the camera, with a dim environment";

/// Adds the light of a scene that has none: for a scene whose own light turns out to reach hardly anything.
pub(crate) fn light_for(world: &mut World) {
    let camera = world.get_resource::<ActiveCamera>().map(|active| active.0);
    let ball = world.get_resource::<SceneBounds>().copied();
    if let Some((camera, ball)) = camera.zip(ball) {
        add_light(world, camera, ball);
        propagate(world);
    }
}

/// A key light up-left behind the camera, large enough for soft shadows, and a dim environment.
fn add_light(world: &mut World, camera: Entity, ball: SceneBounds) -> [Entity; 2] {
    propagate(world);
    let view = world.get::<GlobalTransform>(camera).map_or_else(Default::default, |t| t.0);
    let back = view.matrix3.z_axis.try_normalize().unwrap_or(DVec3::Z);
    let right = view.matrix3.x_axis.try_normalize().unwrap_or(DVec3::X);
    let towards = (back - 0.7 * right + DVec3::Y).try_normalize().unwrap_or(DVec3::Y);
    let distance = 3.0 * ball.radius;
    let edge = 1.2 * ball.radius;
    // A white surface at the centre that faces the light shows radiance * area / (π distance²).
    let radiance = KEY_RADIANCE * std::f64::consts::PI * distance * distance / (edge * edge);
    let transform = Transform::looking_at(ball.center + towards * distance, ball.center, DVec3::Y);
    let key = Light::Parallelogram {
        // Shines towards -Z, where the transform looks.
        edge_u: Vec3::Y * edge as f32,
        edge_v: Vec3::X * edge as f32,
        radiance: [Vec3::splat(radiance as f32); 4],
        two_sided: false,
    };
    let environment = studio::environment(world, FILL_RADIANCE);
    [
        world.spawn((Name::new("key light"), transform, key, Visible(false))).id(),
        world.spawn((Name::new("environment"), Transform::default(), environment)).id(),
    ]
}
