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
use bevy_ecs::system::SystemParam;
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

/// [`traceable`] for a system.
#[derive(SystemParam)]
pub struct Traceable<'w> {
    geometry: Res<'w, Geometry>,
    surfaces: Res<'w, Surfaces>,
    coverage: Res<'w, Coverage>,
    lights: Res<'w, Lights>,
    viewpoint: Res<'w, Viewpoint>,
    settings: Res<'w, RenderSettings>,
}

impl Traceable<'_> {
    /// All that the picture depends on, as rays see it.
    #[must_use]
    pub fn scene(&self) -> TraceScene<'_> {
        TraceScene {
            geometry: &self.geometry,
            surfaces: &self.surfaces,
            coverage: &self.coverage,
            lights: &self.lights,
            viewpoint: &self.viewpoint,
            settings: &self.settings,
        }
    }

    /// Whether one of the things that the picture depends on is another than when this system ran last.
    #[must_use]
    pub fn is_changed(&self) -> bool {
        self.scene_is_changed() || self.viewpoint.is_changed()
    }

    /// The same, without from where it is seen.
    #[must_use]
    pub fn scene_is_changed(&self) -> bool {
        self.geometry.is_changed()
            || self.surfaces.is_changed()
            || self.lights.is_changed()
            || self.settings.is_changed()
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
pub fn reset_film(inputs: Traceable, mut film: ResMut<Film>, mut redone: ResMut<Redone>) {
    if !inputs.is_changed() {
        return;
    }
    if film.size() == inputs.settings.size.max(glam::UVec2::ONE) {
        film.reset();
    } else {
        *film = Film::new(inputs.settings.size, film.first_sample());
    }
    redone.resets += 1;
}
