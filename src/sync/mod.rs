//! Entities → flat arrays: the smallest redo for each change, and the one place that resets the film.
//!
//! | changed | redone |
//! |---|---|
//! | a mesh | its own BLAS (found, if there is one of the same triangles; refitted, where that is good enough), then the TLAS |
//! | an instance, its transform; one added or removed | the TLAS |
//! | a material or texture | the surface list (and the lights, for its emission) |
//! | a light or its transform | the light list |
//! | the camera, a setting | nothing |
//!
//! Below this file there are no entities: [`crate::trace`] sees indices only.

mod geometry;
mod lights;
mod meshes;
mod surfaces;

pub use geometry::{choose_origin, sync_geometry};
pub use lights::sync_lights;
pub use meshes::{BlasCache, MeshBlas, build_blas};
pub use surfaces::{MaterialNumbers, sync_coverage, sync_surfaces};

use crate::bvh::Isa;
use crate::scene::{ActiveCamera, Camera, GlobalTransform, Lens};
use crate::trace::{Coverage, Film, Geometry, Lights, RenderSettings, Surfaces, TraceScene, Viewpoint};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3};

/// All that the picture depends on, as rays see it.
#[must_use]
pub fn traceable(world: &World) -> TraceScene<'_> {
    TraceScene {
        geometry: world.resource::<Geometry>(),
        surfaces: world.resource::<Surfaces>(),
        coverage: world.resource::<Coverage>(),
        lights: world.resource::<Lights>(),
        viewpoint: world.resource::<Viewpoint>(),
        settings: world.resource::<RenderSettings>(),
    }
}

/// Where render space has its origin in the world, chosen once per scene.
///
/// Coordinates are subtracted in double precision and only then rounded to f32, so a scene far from the
/// world's origin loses nothing. Moving things later does not move the origin.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub struct RenderOrigin(pub Option<DVec3>);

impl RenderOrigin {
    /// `render_from_local` for something placed by `global`.
    #[must_use]
    pub fn render_from(&self, global: &GlobalTransform) -> DAffine3 {
        let mut placed = global.0;
        placed.translation -= self.0.unwrap_or_default();
        placed
    }
}

/// Which entities the flat arrays come from.
#[derive(Resource, Clone, Debug, Default)]
pub struct Entities {
    /// Of each instance.
    pub instances: Vec<Entity>,
    /// Of each light that is not an emissive instance: those come first.
    pub lights: Vec<Entity>,
}

/// What rays are traced with: the machine's widest, unless somebody wants another.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub struct Instructions(pub Isa);

/// How often each thing was redone: for the HUD and for the tests that hold the table above.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Redone {
    /// Bottom-level hierarchies built or refitted.
    pub blas: u64,
    /// Those refitted.
    pub refits: u64,
    /// Top-level hierarchies built.
    pub tlas: u64,
    /// Surface lists made.
    pub surfaces: u64,
    /// Light lists made.
    pub lights: u64,
    /// Film resets.
    pub resets: u64,
}

/// Follows the active camera.
pub fn sync_viewpoint(
    mut viewpoint: ResMut<Viewpoint>,
    origin: Res<RenderOrigin>,
    active: Option<Res<ActiveCamera>>,
    cameras: Query<(&Camera, &GlobalTransform, Option<&Lens>)>,
) {
    if let Some((camera, global, lens)) = active.and_then(|a| cameras.get(a.0).ok()) {
        let pinhole = Viewpoint::new(&origin.render_from(global), camera.projection);
        viewpoint.set_if_neq(pinhole.with_lens(lens.copied()));
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
