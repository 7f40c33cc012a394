//! A placed mesh with nothing around it, and points on it.

use crate::bvh::{Blas, Hit, Isa, Placement, Ray, Tlas};
use crate::scene::TriangleMesh;
use crate::trace::scene::InstanceData;
use crate::trace::surface::Interaction;
use crate::trace::{Coverage, Geometry, Lights, RenderSettings, Surfaces, TraceScene, Viewpoint};
use glam::{DAffine3, DMat3};
use std::sync::Arc;

/// One placed mesh as a scene.
pub struct Alone {
    /// What rays hit.
    pub geometry: Geometry,
    /// The default material.
    pub surfaces: Surfaces,
    coverage: Coverage,
    lights: Lights,
    viewpoint: Viewpoint,
    settings: RenderSettings,
}

impl Alone {
    /// `None` if the placement is singular.
    #[must_use]
    pub fn new(mesh: TriangleMesh, place: DAffine3) -> Option<Self> {
        Self::with_normals(mesh, place, |matrix| matrix.inverse().transpose())
    }

    /// The same with another matrix for normals.
    #[must_use]
    pub fn with_normals(
        mesh: TriangleMesh,
        place: DAffine3,
        normal_matrix: impl Fn(DMat3) -> DMat3,
    ) -> Option<Self> {
        let triangles: Vec<_> = (0..mesh.triangles.len()).map(|i| mesh.corners(i)).collect();
        let placement = Placement::new(Arc::new(Blas::build(&triangles)), place)?;
        let normal_matrix = normal_matrix(place.matrix3);
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

    /// As rays see it.
    #[must_use]
    pub fn scene(&self) -> TraceScene<'_> {
        let Self { geometry, surfaces, coverage, lights, viewpoint, settings } = self;
        TraceScene { geometry, surfaces, coverage, lights, viewpoint, settings }
    }

    /// The place of a hit.
    #[must_use]
    pub fn at(&self, hit: &Hit, ray: &Ray) -> Interaction {
        Interaction::new(&self.scene(), &self.geometry.instances[0], hit, ray)
    }

    /// Its hierarchy, traced with each set of instructions that this machine has.
    #[must_use]
    pub fn tracers(&self) -> Vec<(&'static str, Tlas)> {
        Isa::available()
            .into_iter()
            .map(|isa| (isa.name(), self.geometry.tlas.clone().with_isa(isa)))
            .collect()
    }
}
