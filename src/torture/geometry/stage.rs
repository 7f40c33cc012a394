//! Small worlds to make pictures of.

use crate::app::{App, FrameBudget, FrameStats};
use crate::bvh::Isa;
use crate::scene::{ActiveCamera, Camera, Instance, Material, Mesh, Projection, Transform, TriangleMesh};
use crate::sync::Instructions;
use crate::trace::{Film, Integrator, RenderSettings};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, UVec2, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

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
        let entity = self.add(Camera { projection }, Transform::looking_at(eye, target, up).0);
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

/// A parallelogram; its front is the side of `u` × `v`.
#[must_use]
pub fn quad(corner: Vec3, u: Vec3, v: Vec3) -> TriangleMesh {
    TriangleMesh {
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }
}

/// The cube from −1 to 1, its front outside.
#[must_use]
pub fn cube() -> TriangleMesh {
    let positions =
        (0..8).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0);
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    TriangleMesh {
        positions: positions.collect(),
        triangles: faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
        ..TriangleMesh::default()
    }
}

/// A closed convex ball of radius 1 with flat facets, its front outside.
#[must_use]
pub fn ball(rings: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let around = 2 * rings;
    for (i, j) in (0..=rings).flat_map(|i| (0..around).map(move |j| (i, j))) {
        let (theta, phi) =
            (PI * f64::from(i) / f64::from(rings), 2.0 * PI * f64::from(j) / f64::from(around));
        let p = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        mesh.positions.push(match i {
            0 => Vec3::Z,
            i if i == rings => -Vec3::Z,
            _ => p.as_vec3(),
        });
    }
    for (i, j) in (0..rings).flat_map(|i| (0..around).map(move |j| (i, j))) {
        let at = |i: u32, j: u32| i * around + j % around;
        if i > 0 {
            mesh.triangles.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
        }
        if i + 1 < rings {
            mesh.triangles.push([at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]);
        }
    }
    mesh
}
