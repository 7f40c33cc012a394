//! Bottom level: the triangles of one mesh.

use super::batch::{Batch, Inside, Scratch, Target, Triangles};
use super::build::{build_triangles, has_surface};
use super::filter::{All, Filter};
use super::leaves::Leaves;
use super::simd::{Isa, Simd};
use super::wide::{WideBvh, WideNode};
use super::{Aabb, Hit, Probe, Ray};
use glam::Vec3;

/// A hierarchy over triangles, of which it keeps copies.
#[derive(Clone, Debug, Default)]
pub struct Blas {
    pub(super) wide: WideBvh,
    pub(super) leaves: Leaves,
    isa: Isa,
    /// [`Blas::cost`] when it was built, once it has been refitted.
    pub(super) built_cost: Option<f32>,
}

impl Blas {
    /// Builds over `triangles`, which `Hit::triangle` will index. Those without an area or with a corner
    /// that is not finite have no surface and are never hit.
    ///
    /// # Panics
    /// With more than [`MOST_TRIANGLES`](super::MOST_TRIANGLES).
    #[must_use]
    pub fn build(triangles: &[[Vec3; 3]]) -> Self {
        let (wide, leaves) = build_triangles(triangles);
        Self { wide, leaves, isa: Isa::detect(), built_cost: None }
    }

    /// The same, traced with the given instructions.
    #[must_use]
    pub fn with_isa(self, isa: Isa) -> Self {
        Self { isa, ..self }
    }

    /// The hierarchy, to draw or measure.
    #[must_use]
    pub fn hierarchy(&self) -> &WideBvh {
        &self.wide
    }

    /// Whether it is what [`Blas::build`] would make of `triangles`, or hits the same in any case.
    #[must_use]
    pub fn is_over(&self, triangles: &[[Vec3; 3]]) -> bool {
        let mut there = vec![false; triangles.len()];
        self.wide.nodes.iter().flat_map(WideNode::leaves).all(|(first, count)| {
            for &id in &self.wide.prims[first..first + count] {
                if let Some(there) = there.get_mut(id as usize) {
                    *there = true;
                }
            }
            self.leaves.same((first, count), triangles)
        }) && triangles.iter().zip(there).all(|(corners, there)| there || !has_surface(corners))
    }

    /// The box around all triangles; empty without any.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.wide.bounds
    }

    /// Bytes of nodes and triangles.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.wide.bytes() + self.leaves.bytes()
    }

    /// The nearest hit; of equally near ones that of the lowest triangle index.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let mut found = [None];
        self.closest_hits(std::slice::from_ref(ray), &mut found);
        found[0]
    }

    /// Whether there is any hit.
    #[must_use]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        let mut found = [false];
        self.any_hits(std::slice::from_ref(ray), &mut found);
        found[0]
    }

    /// [`Blas::closest_hit`] for each ray, faster for that, above all where neighbours go similar ways.
    ///
    /// # Panics
    /// Unless there are as many `hits` as `rays`.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len());
        self.batch::<_, false>(rays, |i, hit| hits[i] = hit);
    }

    /// [`Blas::any_hit`] for each ray, faster for that, above all where neighbours go similar ways.
    ///
    /// # Panics
    /// Unless there are as many `blocked` as `rays`.
    pub fn any_hits(&self, rays: &[Ray], blocked: &mut [bool]) {
        assert_eq!(rays.len(), blocked.len());
        self.batch::<_, true>(rays, |i, hit| blocked[i] = hit.is_some());
    }

    /// [`Blas::closest_hits`] for rays that are made when they are needed: `count` of them, by number, each
    /// reported once, in any order.
    pub fn closest_hits_by(
        &self,
        count: usize,
        ray: impl Fn(usize) -> Ray,
        report: impl FnMut(usize, Option<Hit>),
    ) {
        self.isa.run(Batch::<_, _, _, _, false> { target: self, count, ray, filter: All, report });
    }

    /// [`Blas::any_hits`] likewise.
    pub fn any_hits_by(&self, count: usize, ray: impl Fn(usize) -> Ray, mut report: impl FnMut(usize, bool)) {
        let report = |i: usize, hit: Option<Hit>| report(i, hit.is_some());
        self.isa.run(Batch::<_, _, _, _, true> { target: self, count, ray, filter: All, report });
    }

    fn batch<R: FnMut(usize, Option<Hit>), const ANY: bool>(&self, rays: &[Ray], report: R) {
        let ray = |i: usize| rays[i];
        self.isa.run(Batch::<_, _, _, _, ANY> { target: self, count: rays.len(), ray, filter: All, report });
    }
}

impl Target for Blas {
    const ONE_LEVEL: bool = true;

    #[inline(always)]
    fn nodes(&self) -> &[WideNode] {
        &self.wide.nodes
    }

    #[inline(always)]
    fn only(&self) -> Option<Inside<'_>> {
        Some(Inside { blas: self, instance: 0, moved: false })
    }

    #[inline(always)]
    fn probe(&self, ray: &Ray) -> Probe {
        Probe::new(ray, &self.wide.bounds)
    }

    #[inline(always)]
    fn bounds(&self) -> (Aabb, f32) {
        (self.wide.bounds, 1.0)
    }

    #[inline(always)]
    fn enter(&self, _: usize, _: &Ray) -> (Inside<'_>, u32, Option<Probe>) {
        (Inside { blas: self, instance: 0, moved: false }, 0, None)
    }

    #[inline(always)]
    fn traverse_packet<S: Simd, F: Filter, const ANY: bool>(
        &self,
        simd: S,
        scratch: &mut Scratch,
        rays: u64,
        filter: F,
    ) -> u64 {
        let Scratch { packet, found, waiting, numbers, .. } = scratch;
        let mut visitor = Triangles::<F, ANY> { blas: self, instance: 0, found, numbers, filter };
        self.wide.traverse_packet::<S, ANY>(simd, packet, 0, rays, waiting, &mut visitor)
    }
}
