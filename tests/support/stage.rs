//! A stage to measure light on: a world, something that receives, a camera that sees nothing else.
#![allow(dead_code, unused_imports, reason = "each test file uses its part")]
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

pub use penumbra::torture::oracle::Rng;

use bevy_ecs::prelude::*;
use glam::{DAffine3, DQuat, DVec3, UVec2, Vec3};
use penumbra::app::{App, FrameBudget, FrameStats};
use penumbra::scene::{ActiveCamera, Camera, Instance, Material, Mesh, Projection, Transform, TriangleMesh};
use penumbra::trace::{
    Coverage, Film, Geometry, Integrator, Lights, RenderSettings, Surfaces, TraceScene, Viewpoint,
};
use std::f64::consts::PI;
use std::sync::Arc;

/// Settings of a small picture.
pub fn settings(width: u32, height: u32, integrator: Integrator, max_depth: u32) -> RenderSettings {
    RenderSettings { size: UVec2::new(width, height), integrator, max_depth, ..RenderSettings::default() }
}

/// A world whose entities all hang under one root, so that the whole can be scaled and shifted.
pub struct Stage {
    pub app: App,
    root: Entity,
    scale: f64,
}

impl Stage {
    pub fn new(settings: RenderSettings) -> Self {
        Self::placed(settings, 1.0, DVec3::ZERO)
    }

    /// The stage `scale` times as large, its origin at `shift`.
    pub fn placed(settings: RenderSettings, scale: f64, shift: DVec3) -> Self {
        let mut app = App::new(settings);
        let place = Transform::from_parts(shift, DQuat::IDENTITY, DVec3::splat(scale));
        let root = app.world.spawn(place).id();
        Self { app, root, scale }
    }

    pub fn add(&mut self, thing: impl Bundle, place: DAffine3) -> Entity {
        self.app.world.spawn((thing, Transform(place), ChildOf(self.root))).id()
    }

    pub fn add_mesh(&mut self, mesh: TriangleMesh, material: Material, place: DAffine3) -> Entity {
        let mesh = self.app.world.spawn(Mesh(Arc::new(mesh))).id();
        let material = self.app.world.spawn(material).id();
        self.add(Instance { mesh, materials: vec![material] }, place)
    }

    /// An orthographic camera at `eye` whose picture of `target` is `width` wide and has its up side
    /// toward `up`.
    pub fn look(&mut self, eye: DVec3, target: DVec3, up: DVec3, width: f64) {
        let size = self.app.world.resource::<RenderSettings>().size.as_dvec2();
        let height = (width * size.y / size.x * self.scale) as f32;
        let camera = Camera { projection: Projection::Orthographic { height } };
        let entity = self.add(camera, Transform::looking_at(eye, target, up).0);
        self.app.world.insert_resource(ActiveCamera(entity));
    }

    /// A perspective camera of 60 degrees.
    pub fn look_wide(&mut self, eye: DVec3, target: DVec3) {
        let camera = Camera { projection: Projection::Perspective { vertical_fov: 60f32.to_radians() } };
        let entity = self.add(camera, Transform::looking_at(eye, target, DVec3::new(0.1, 1.0, 0.2)).0);
        self.app.world.insert_resource(ActiveCamera(entity));
    }

    /// Runs frames until every pixel has `samples`.
    pub fn trace(&mut self, samples: u32) -> &Film {
        {
            let mut budget = self.app.world.resource_mut::<FrameBudget>();
            budget.sample_target = samples;
            budget.pass_samples = 16;
        }
        loop {
            self.app.frame();
            if self.app.world.resource::<FrameStats>().done {
                break;
            }
        }
        let film = self.film();
        assert_eq!(film.complete_samples(), samples);
        assert_eq!(film.dropped(), 0, "samples that are not finite");
        film
    }

    pub fn film(&self) -> &Film {
        self.app.world.resource::<Film>()
    }

    /// All that the picture depends on, as rays see it (after the first frame).
    pub fn scene(&self) -> TraceScene<'_> {
        penumbra::sync::traceable(&self.app.world)
    }
}

/// The red channel of every pixel, in rows from the top.
pub fn reds(film: &Film) -> Vec<f64> {
    let size = film.size();
    (0..size.y).flat_map(|y| (0..size.x).map(move |x| film.pixel(x, y).mean().x)).collect()
}

/// A mean and its standard error.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: f64,
    pub sigma: f64,
}

impl Estimate {
    /// From independent estimates of the same: the pixels' noise is independent, and measured between
    /// them it knows how well the samples inside a pixel are stratified.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Self { mean, sigma: (variance / n).sqrt() }
    }

    pub fn times(self, factor: f64) -> Self {
        Self { mean: self.mean * factor, sigma: self.sigma * factor.abs() }
    }

    /// Panics unless `exact` lies within 4.5 standard errors (two-sided p = 7e-6), and unless those are
    /// at most `accuracy` of it: a test that accepts everything is no test.
    pub fn assert_is(&self, name: &str, exact: f64, accuracy: f64) {
        let bound = 4.5 * self.sigma + ROUNDING * exact.abs();
        let off = self.mean - exact;
        let relative = if exact == 0.0 { bound } else { bound / exact.abs() };
        println!("{name}: {:.9} exact {exact:.9}, off {:+.1e}, bound {relative:.1e}", self.mean, off / exact);
        assert!(relative <= accuracy, "{name}: bound {relative:.1e} would accept too much");
        assert!(off.abs() <= bound, "{name}: {} is not {exact}; bound {bound:.1e}", self.mean);
    }
}

/// What single precision may add up to in one sample, relative.
const ROUNDING: f64 = 3e-6;

/// A parallelogram as two triangles; its front is the side of `u` × `v`.
pub fn quad(corner: Vec3, u: Vec3, v: Vec3) -> TriangleMesh {
    TriangleMesh {
        positions: vec![corner, corner + u, corner + u + v, corner + v],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }
}

/// The same cut into `n` × `n`.
pub fn grid(corner: Vec3, u: Vec3, v: Vec3, n: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for j in 0..=n {
        for i in 0..=n {
            mesh.positions.push(corner + u * (i as f32 / n as f32) + v * (j as f32 / n as f32));
        }
    }
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let a = j * (n + 1) + i;
        mesh.triangles.extend([[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]);
    }
    mesh
}

/// The cube from −1 to 1, its front outside.
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
pub fn ball(rings: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let around = 2 * rings;
    for i in 0..=rings {
        for j in 0..around {
            let (theta, phi) =
                (PI * f64::from(i) / f64::from(rings), 2.0 * PI * f64::from(j) / f64::from(around));
            let p = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
            mesh.positions.push(if i == 0 {
                Vec3::Z
            } else if i == rings {
                -Vec3::Z
            } else {
                p.as_vec3()
            });
        }
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
