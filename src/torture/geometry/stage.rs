//! Small worlds to make pictures of.

use crate::app::{App, FrameBudget, FrameStats};
use crate::bvh::Isa;
use crate::scene::{ActiveCamera, Camera, Instance, Material, Mesh, Projection, Transform, TriangleMesh};
use crate::sync::Instructions;
use crate::trace::{Film, Integrator, RenderSettings};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, UVec2};
use std::sync::Arc;

pub use crate::torture::stage::{ball, cube, quad};

/// A world whose entities all hang under one root.
pub struct Stage {
    /// The world.
    pub app: App,
    root: Entity,
}

impl Stage {
    /// With nothing in it yet; a small picture by the path integrator.
    #[must_use]
    pub fn new(width: u32, height: u32, root: DAffine3) -> Self {
        let size = UVec2::new(width, height);
        let settings =
            RenderSettings { size, integrator: Integrator::Path, max_depth: 3, ..RenderSettings::default() };
        let mut app = App::new(settings);
        let root = app.world.spawn(Transform(root)).id();
        Self { app, root }
    }

    /// Traced with these instructions.
    #[must_use]
    pub fn with_isa(mut self, isa: Isa) -> Self {
        self.app.world.insert_resource(Instructions(isa));
        self
    }

    /// Adds something.
    pub fn add(&mut self, thing: impl Bundle, place: DAffine3) -> Entity {
        self.app.world.spawn((thing, Transform(place), ChildOf(self.root))).id()
    }

    /// Adds a mesh that wears `material`.
    pub fn add_mesh(&mut self, mesh: TriangleMesh, material: Material, place: DAffine3) -> Entity {
        self.add_painted(mesh, vec![material], place)
    }

    /// Adds a mesh that wears several.
    pub fn add_painted(&mut self, mesh: TriangleMesh, materials: Vec<Material>, place: DAffine3) -> Entity {
        let mesh = self.app.world.spawn(Mesh(Arc::new(mesh))).id();
        let materials = materials.into_iter().map(|m| self.app.world.spawn(m).id()).collect();
        self.add(Instance { mesh, materials }, place)
    }

    /// A camera.
    pub fn look(&mut self, eye: DVec3, target: DVec3, up: DVec3, projection: Projection) {
        self.look_from(Transform::looking_at(eye, target, up).0, projection);
    }

    /// A camera at a place, toward its −Z.
    pub fn look_from(&mut self, place: DAffine3, projection: Projection) {
        let entity = self.add(Camera { projection }, place);
        self.app.world.insert_resource(ActiveCamera(entity));
    }

    /// Runs frames until every pixel has `samples`.
    pub fn picture(&mut self, samples: u32) -> Film {
        self.app.world.resource_mut::<FrameBudget>().sample_target = samples;
        loop {
            self.app.frame();
            if self.app.world.resource::<FrameStats>().done {
                return self.app.world.resource::<Film>().clone();
            }
        }
    }
}

/// 60 degrees.
pub const WIDE: Projection = Projection::Perspective { vertical_fov: std::f32::consts::FRAC_PI_3 };

/// The means of all pixels.
#[must_use]
pub fn means(film: &Film) -> Vec<DVec3> {
    let size = film.size();
    (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y))).map(|(x, y)| film.pixel(x, y).mean()).collect()
}

/// Pixels that are no numbers or below 0, and samples that were dropped for that.
#[must_use]
pub fn bad_pixels(film: &Film) -> u64 {
    let bad = |mean: &&DVec3| !(mean.is_finite() && mean.min_element() >= 0.0);
    means(film).iter().filter(bad).count() as u64 + film.dropped()
}
