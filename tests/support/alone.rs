//! A mesh with nothing around it.
#![allow(dead_code, reason = "each test file uses its part")]

use glam::DAffine3;
use penumbra::bvh::{Blas, Hit, Placement, Ray, Tlas};
use penumbra::scene::TriangleMesh;
use penumbra::trace::scene::InstanceData;
use penumbra::trace::surface::Interaction;
use penumbra::trace::{Coverage, Geometry, Lights, RenderSettings, Surfaces, TraceScene, Viewpoint};
use std::sync::Arc;

/// One placed mesh as a scene.
pub struct Alone {
    pub geometry: Geometry,
    pub surfaces: Surfaces,
    coverage: Coverage,
    lights: Lights,
    viewpoint: Viewpoint,
    settings: RenderSettings,
}

impl Alone {
    pub fn new(mesh: TriangleMesh, place: DAffine3) -> Option<Self> {
        let triangles: Vec<_> = (0..mesh.triangles.len()).map(|i| mesh.corners(i)).collect();
        let placement = Placement::new(Arc::new(Blas::build(&triangles)), place)?;
        let normal_matrix = place.matrix3.inverse().transpose();
        let data = InstanceData { mesh: Arc::new(mesh), materials: Vec::new(), normal_matrix };
        Some(Self {
            geometry: Geometry { tlas: Tlas::build(vec![placement]), instances: vec![data] },
            surfaces: Surfaces::default(),
            coverage: Coverage::default(),
            lights: Lights::default(),
            viewpoint: Viewpoint::default(),
            settings: RenderSettings::default(),
        })
    }

    pub fn scene(&self) -> TraceScene<'_> {
        let Self { geometry, surfaces, coverage, lights, viewpoint, settings } = self;
        TraceScene { geometry, surfaces, coverage, lights, viewpoint, settings }
    }

    pub fn at(&self, hit: &Hit, ray: &Ray) -> Interaction {
        Interaction::new(&self.scene(), &self.geometry.instances[0], hit, ray)
    }
}
