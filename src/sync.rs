//! Entities → flat arrays: the smallest redo for each change, and the one place that resets the film.
//!
//! | changed | redone |
//! |---|---|
//! | a mesh | its own BLAS, then the TLAS |
//! | an instance, its transform; one added or removed | the TLAS |
//! | a material or texture | the surface list (and the lights, for its emission) |
//! | a light or its transform | the light list |
//! | the camera, a setting | nothing |
//!
//! Below this file there are no entities: [`crate::trace`] sees indices only.

use crate::bvh::{Blas, Placement, Tlas};
use crate::scene::color::luminance;
use crate::scene::{
    ActiveCamera, Camera, GlobalTransform, Instance, Light, Material, Mesh, Texture, TextureUse, TriangleMesh, Visible,
};
use crate::trace::light::{FlatLight, MeshLight, Shape, ShapeLight, triangle_area};
use crate::trace::scene::{InstanceData, Surface, TextureIndex};
use crate::trace::{Film, Geometry, Lights, RenderSettings, Surfaces, Viewpoint};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// The bottom-level hierarchy of a [`Mesh`], on its entity; derived by [`build_blas`].
#[derive(Component, Clone, Debug)]
pub struct MeshBlas(pub Arc<Blas>);

/// Where render space has its origin in the world, chosen once per scene.
///
/// Coordinates are subtracted in double precision and only then rounded to f32, so a scene far from the
/// world's origin loses nothing. Moving things later does not move the origin.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderOrigin(pub Option<DVec3>);

/// How often each thing was redone: for the HUD and for the tests that hold the table above.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Redone {
    /// Bottom-level hierarchies built.
    pub blas: u64,
    /// Top-level hierarchies built.
    pub tlas: u64,
    /// Surface lists made.
    pub surfaces: u64,
    /// Light lists made.
    pub lights: u64,
    /// Film resets.
    pub resets: u64,
}

/// Stable numbers of material and texture entities in [`Surfaces`]; a freed number is used again.
#[derive(Resource, Debug, Default)]
pub struct SurfaceNumbers {
    materials: HashMap<Entity, u32>,
    textures: HashMap<Entity, u32>,
}

impl RenderOrigin {
    /// `render_from_local` for something placed by `global`.
    #[must_use]
    pub fn render_from(&self, global: &GlobalTransform) -> DAffine3 {
        let mut placed = global.0;
        placed.translation -= self.0.unwrap_or_default();
        placed
    }
}

/// Picks [`RenderOrigin`] when the first geometry is there: the scene's middle, rounded to a multiple of a
/// power of two not below its extent, so that a scene around the origin stays where it is.
pub fn choose_origin(
    mut origin: ResMut<RenderOrigin>,
    instances: Query<(&Instance, &GlobalTransform)>,
    meshes: Query<&MeshBlas>,
) {
    if origin.0.is_some() || instances.is_empty() {
        return;
    }
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (instance, global) in &instances {
        let Ok(MeshBlas(blas)) = meshes.get(instance.mesh) else { continue };
        let bounds = blas.bounds();
        if bounds.is_empty() {
            continue;
        }
        for corner in [bounds.min, bounds.max] {
            let p = global.0.transform_point3(corner.as_dvec3());
            (low, high) = (low.min(p), high.max(p));
        }
    }
    if low == DVec3::INFINITY {
        return;
    }
    let extent = (high - low).max_element();
    let finite = low.is_finite() && high.is_finite();
    let grid = if extent > 0.0 { extent.log2().ceil().exp2() } else { 1.0 };
    origin.0 = Some(if finite { ((low + high) * (0.5 / grid)).round() * grid } else { DVec3::ZERO });
}

/// Builds the BLAS of each new or changed mesh.
pub fn build_blas(
    mut commands: Commands,
    mut redone: ResMut<Redone>,
    changed: Query<(Entity, &Mesh), Changed<Mesh>>,
    mut removed: RemovedComponents<Mesh>,
) {
    for (entity, mesh) in &changed {
        let triangles: Vec<[Vec3; 3]> = (0..mesh.0.triangles.len()).map(|i| mesh.0.corners(i)).collect();
        commands.entity(entity).insert(MeshBlas(Arc::new(Blas::build(&triangles))));
        redone.blas += 1;
    }
    for entity in removed.read() {
        if let Ok(mut entity) = commands.get_entity(entity) {
            entity.remove::<MeshBlas>();
        }
    }
}

/// Makes the surface list anew when a material or texture changed.
pub fn sync_surfaces(
    mut surfaces: ResMut<Surfaces>,
    mut numbers: ResMut<SurfaceNumbers>,
    mut redone: ResMut<Redone>,
    materials: Query<(Entity, &Material)>,
    textures: Query<(Entity, &Texture)>,
    changed: Query<(), Or<(Changed<Material>, Changed<Texture>)>>,
    mut removed_materials: RemovedComponents<Material>,
    mut removed_textures: RemovedComponents<Texture>,
) {
    let removed = removed_materials.read().count() + removed_textures.read().count();
    if changed.is_empty() && removed == 0 {
        return;
    }
    let SurfaceNumbers { materials: material_numbers, textures: texture_numbers } = &mut *numbers;
    renumber(material_numbers, materials.iter().map(|(e, _)| e).collect(), 1);
    renumber(texture_numbers, textures.iter().map(|(e, _)| e).collect(), 0);
    let resolve = |texture: Option<TextureUse>| {
        let TextureUse { texture, uv_transform } = texture?;
        texture_numbers.get(&texture).map(|&index| TextureIndex { index, uv_transform })
    };
    let room = |numbers: &HashMap<Entity, u32>| numbers.values().max().map_or(0, |&n| n as usize + 1);
    let mut list = vec![Surface::from(Material::default()); room(material_numbers).max(1)];
    for (entity, material) in &materials {
        list[material_numbers[&entity] as usize] = Surface {
            material: material.clone(),
            base_color_texture: resolve(material.base_color_texture),
            glossy_texture: resolve(match material.glossy {
                crate::scene::Glossy::Ggx { texture, .. } => texture,
                _ => None,
            }),
            emission_texture: resolve(material.emission_texture),
        };
    }
    // Numbers that are free for the moment show nothing.
    let mut images: Vec<Option<Texture>> = vec![None; room(texture_numbers)];
    for (entity, texture) in &textures {
        images[texture_numbers[&entity] as usize] = Some(texture.clone());
    }
    *surfaces = Surfaces {
        has_alpha: materials.iter().any(|(_, m)| m.alpha != crate::scene::Alpha::Opaque),
        materials: list,
        textures: images.into_iter().map(|t| t.unwrap_or_else(white)).collect(),
    };
    redone.surfaces += 1;
}

fn white() -> Texture {
    Texture {
        texels: Arc::new(crate::scene::Texels { width: 1, height: 1, texels: vec![[255; 4]] }),
        encoding: crate::scene::Encoding::Linear,
        wrap: [crate::scene::Wrap::Clamp; 2],
        filter: crate::scene::Filter::Nearest,
    }
}

/// Keeps the numbers of those that stay, gives the lowest free ones from `first` on to those that are new.
fn renumber(numbers: &mut HashMap<Entity, u32>, mut present: Vec<Entity>, first: u32) {
    present.sort_unstable();
    numbers.retain(|entity, _| present.binary_search(entity).is_ok());
    let mut taken: Vec<u32> = numbers.values().copied().collect();
    taken.sort_unstable();
    let mut free = (first..).filter(|n| taken.binary_search(n).is_err());
    for entity in present {
        if let std::collections::hash_map::Entry::Vacant(vacant) = numbers.entry(entity) {
            vacant.insert(free.next().unwrap_or(first));
        }
    }
}

/// Builds the TLAS anew when an instance came, went, moved or changed its mesh or materials.
#[expect(clippy::too_many_arguments, reason = "what it reads, what it writes, and what makes it run")]
pub fn sync_geometry(
    mut geometry: ResMut<Geometry>,
    mut redone: ResMut<Redone>,
    mut known_materials: Local<Vec<(Entity, u32)>>,
    origin: Res<RenderOrigin>,
    numbers: Res<SurfaceNumbers>,
    instances: Query<(Entity, &Instance, &GlobalTransform)>,
    meshes: Query<(&Mesh, &MeshBlas)>,
    changed: Query<(), (With<Instance>, Or<(Changed<Instance>, Changed<GlobalTransform>)>)>,
    changed_blas: Query<(), Changed<MeshBlas>>,
    mut removed: (RemovedComponents<Instance>, RemovedComponents<MeshBlas>),
) {
    // Values of materials don't matter here, only which numbers they have.
    let mut materials: Vec<(Entity, u32)> = numbers.materials.iter().map(|(&e, &n)| (e, n)).collect();
    materials.sort_unstable();
    let removed = removed.0.read().count() + removed.1.read().count();
    if changed.is_empty() && changed_blas.is_empty() && removed == 0 && *known_materials == materials {
        return;
    }
    *known_materials = materials;
    let mut placed: Vec<_> = instances.iter().collect();
    placed.sort_unstable_by_key(|(entity, ..)| *entity);
    let (mut placements, mut data) = (Vec::new(), Vec::new());
    for (_, instance, global) in placed {
        let Ok((mesh, MeshBlas(blas))) = meshes.get(instance.mesh) else { continue };
        let render_from_local = origin.render_from(global);
        let Some(placement) = Placement::new(Arc::clone(blas), render_from_local) else { continue };
        placements.push(placement);
        data.push(InstanceData {
            mesh: Arc::clone(&mesh.0),
            materials: instance.materials.iter().map(|m| numbers.materials.get(m).copied().unwrap_or(0)).collect(),
            normal_matrix: render_from_local.matrix3.inverse().transpose(),
        });
    }
    *geometry = Geometry { tlas: Tlas::build(placements), instances: data };
    redone.tlas += 1;
}

/// Makes the light list anew when a light changed, or something that emits may have.
pub fn sync_lights(
    mut lights: ResMut<Lights>,
    mut redone: ResMut<Redone>,
    origin: Res<RenderOrigin>,
    geometry: Res<Geometry>,
    surfaces: Res<Surfaces>,
    all: Query<(Entity, &Light, &GlobalTransform, Option<&Visible>)>,
    changed: Query<(), (With<Light>, Or<(Changed<Light>, Changed<GlobalTransform>, Changed<Visible>)>)>,
    mut removed: (RemovedComponents<Light>, RemovedComponents<Visible>),
) {
    let removed = removed.0.read().count() + removed.1.read().count();
    if changed.is_empty() && removed == 0 && !geometry.is_changed() && !surfaces.is_changed() {
        return;
    }
    let mut placed: Vec<_> = all.iter().collect();
    placed.sort_unstable_by_key(|(entity, ..)| *entity);
    let mut flat: Vec<FlatLight> = placed
        .into_iter()
        .filter_map(|(_, light, global, visible)| flatten(light, &origin.render_from(global), visible))
        .collect();
    let mut meshes = Vec::new();
    for (instance, data) in (0..).zip(&geometry.instances) {
        let placement = geometry.tlas.placements()[instance as usize].world_from_local();
        for (slot, light) in mesh_lights(instance, data, placement, &surfaces) {
            meshes.push(((instance, slot), flat.len() as u32));
            flat.push(FlatLight::Mesh(light));
        }
    }
    let bounds = geometry.tlas.bounds();
    let radius = if bounds.is_empty() { 1.0 } else { 0.5 * (bounds.max - bounds.min).length() };
    *lights = Lights::new(flat, meshes, radius);
    redone.lights += 1;
}

/// The light in render space; `None` if it emits nothing, has no place, or its placement left it no extent.
fn flatten(light: &Light, placed: &DAffine3, visible: Option<&Visible>) -> Option<FlatLight> {
    if !placed.is_finite() {
        return None;
    }
    let position = placed.translation.as_vec3();
    let vector = |v: Vec3| placed.transform_vector3(v.as_dvec3()).as_vec3();
    let axis = || vector(Vec3::NEG_Z).try_normalize();
    let solid = |shape: Shape, radiance: [Vec3; 4], two_sided: bool| {
        let visible = visible.is_none_or(|v| v.0);
        let area = shape.area();
        let emits = radiance != [Vec3::ZERO; 4];
        let light = ShapeLight { shape, radiance, two_sided, visible };
        (area > 0.0 && area.is_finite() && emits).then_some(FlatLight::Shape(light))
    };
    match *light {
        Light::Point { intensity } => Some(FlatLight::Point { position, intensity }),
        Light::Spot { intensity, inner_angle, outer_angle } => Some(FlatLight::Spot {
            position,
            axis: axis()?,
            intensity,
            cos_inner: inner_angle.cos(),
            cos_outer: outer_angle.cos(),
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
            solid(Shape::Parallelogram { corner, u: vector(edge_u), v: vector(edge_v) }, radiance, two_sided)
        }
        Light::Disk { radius, radiance, two_sided } => {
            let scale = vector(Vec3::X).length();
            solid(Shape::Disk { center: position, normal: axis()?, radius: radius * scale }, [radiance; 4], two_sided)
        }
        Light::Sphere { radius, radiance } => {
            let scale = Vec3::AXES.map(|a| vector(a).length()).iter().sum::<f32>() / 3.0;
            solid(Shape::Sphere { center: position, radius: radius * scale }, [radiance; 4], true)
        }
        Light::Environment { radiance } => (radiance != Vec3::ZERO).then_some(FlatLight::Environment { radiance }),
    }
}

/// The emissive slots of an instance, each as a light.
fn mesh_lights(instance: u32, data: &InstanceData, placed: &DAffine3, surfaces: &Surfaces) -> Vec<(u16, MeshLight)> {
    let surface = |slot: u16| {
        let number = data.materials.get(usize::from(slot)).copied().unwrap_or(0);
        &surfaces.materials[number as usize].material
    };
    let slots = 0..data.materials.len().max(1) as u16;
    let emissive = slots.filter(|&slot| surface(slot).emission != Vec3::ZERO);
    emissive.filter_map(|slot| Some((slot, mesh_light(instance, &data.mesh, slot, placed, surface(slot))?))).collect()
}

fn mesh_light(
    instance: u32,
    mesh: &TriangleMesh,
    slot: u16,
    placed: &DAffine3,
    material: &Material,
) -> Option<MeshLight> {
    let mirrored = placed.matrix3.determinant() < 0.0;
    let mut light = MeshLight { instance, two_sided: material.double_sided, mirrored, ..MeshLight::default() };
    let mut areas = Vec::new();
    for triangle in 0..mesh.triangles.len() {
        if mesh.slot(triangle) != usize::from(slot) {
            continue;
        }
        let corners = mesh.corners(triangle).map(|p| placed.transform_point3(p.as_dvec3()).as_vec3());
        let area = triangle_area(&corners);
        if area > 0.0 && area.is_finite() {
            light.triangles.push(triangle as u32);
            light.corners.push(corners);
            areas.push(f64::from(area));
        }
    }
    let total: f64 = areas.iter().sum();
    let mut sum = 0.0;
    light.cumulative = areas
        .iter()
        .map(|area| {
            sum += area;
            (sum / total) as f32
        })
        .collect();
    *light.cumulative.last_mut()? = 1.0;
    let sides = if light.two_sided { 2.0 } else { 1.0 };
    light.power = std::f32::consts::PI * sides * luminance(material.emission) * total as f32;
    Some(light)
}

/// Follows the active camera.
pub fn sync_viewpoint(
    mut viewpoint: ResMut<Viewpoint>,
    origin: Res<RenderOrigin>,
    active: Option<Res<ActiveCamera>>,
    cameras: Query<(&Camera, &GlobalTransform)>,
) {
    if let Some((camera, global)) = active.and_then(|a| cameras.get(a.0).ok()) {
        viewpoint.set_if_neq(Viewpoint::new(&origin.render_from(global), camera.projection));
    }
}

/// Starts the picture anew when one of its inputs changed. Nothing else ever does.
pub fn reset_film(
    geometry: Res<Geometry>,
    surfaces: Res<Surfaces>,
    lights: Res<Lights>,
    viewpoint: Res<Viewpoint>,
    settings: Res<RenderSettings>,
    mut film: ResMut<Film>,
    mut redone: ResMut<Redone>,
) {
    let changed = geometry.is_changed()
        || surfaces.is_changed()
        || lights.is_changed()
        || viewpoint.is_changed()
        || settings.is_changed();
    if !changed {
        return;
    }
    if film.size() == settings.size.max(glam::UVec2::ONE) {
        film.reset();
    } else {
        *film = Film::new(settings.size, film.first_sample());
    }
    redone.resets += 1;
}
