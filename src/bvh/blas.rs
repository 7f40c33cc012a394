//! Bottom level: the triangles of one mesh.

use super::batch::trace_batch;
use super::leaves::Leaves;
use super::simd::{Isa, Job, Simd};
use super::single::Waiting;
use super::wide::WideBvh;
use super::{Aabb, Bvh, Hit, Probe, Ray};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// A hierarchy over triangles, which it keeps in the order of its leaves.
#[derive(Clone, Debug, Default)]
pub struct Blas {
    pub(super) wide: WideBvh,
    pub(super) leaves: Leaves,
    isa: Isa,
}

impl Blas {
    /// Builds over `triangles`, which `Hit::triangle` will index. Those without an area or with a corner
    /// that is not finite have no surface and are never hit.
    #[must_use]
    pub fn build(triangles: &[[Vec3; 3]]) -> Self {
        let kept: Vec<u32> = (0..triangles.len() as u32)
            .into_par_iter()
            .filter(|&i| has_surface(&triangles[i as usize]))
            .collect();
        let boxes: Vec<Aabb> = kept.par_iter().map(|&i| Aabb::around(&triangles[i as usize])).collect();
        let mut bvh = Bvh::build(&boxes);
        for prim in &mut bvh.prims {
            *prim = kept[*prim as usize];
        }
        let wide = WideBvh::new(&bvh);
        let leaves = Leaves::new(&wide, triangles);
        Self { wide, leaves, isa: Isa::detect() }
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
        self.isa.run(Single::<false> { blas: self, ray })
    }

    /// Whether there is any hit.
    #[must_use]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.isa.run(Single::<true> { blas: self, ray }).is_some()
    }

    /// [`Blas::closest_hit`] for each ray, faster where neighbours go similar ways.
    ///
    /// # Panics
    /// Unless there are as many `hits` as `rays`.
    pub fn closest_hits(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len());
        self.isa.run(Many::<false, _> { blas: self, rays, report: |i: usize, hit| hits[i] = hit });
    }

    /// [`Blas::any_hit`] for each ray, faster where neighbours go similar ways.
    ///
    /// # Panics
    /// Unless there are as many `blocked` as `rays`.
    pub fn any_hits(&self, rays: &[Ray], blocked: &mut [bool]) {
        assert_eq!(rays.len(), blocked.len());
        let report = |i: usize, hit: Option<Hit>| blocked[i] = hit.is_some();
        self.isa.run(Many::<true, _> { blas: self, rays, report });
    }
}

impl Blas {
    #[inline(always)]
    pub(super) fn trace_one<S: Simd, const ANY: bool>(
        &self,
        simd: S,
        ray: &Ray,
        waiting: &mut Waiting,
    ) -> Option<Hit> {
        let probe = Probe::new(ray, &self.bounds());
        let mut best: Option<Hit> = None;
        // Broken off or not, what was found is in `best`.
        let _ = self.wide.traverse(simd, &probe, 0, ray.t_max, waiting, |first, count, t_max| {
            self.leaves.test_one::<S, ANY>(simd, &probe, (first, count), 0, t_max, |hit| {
                let better = best.is_none_or(|known| hit.beats(&known));
                if better {
                    best = Some(hit);
                }
                better
            })
        });
        best
    }
}

impl Blas {
    pub(super) fn closest_accepted(&self, probe: &Probe, t_max: f32, instance: u32, best: Option<Hit>, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        self.isa.run(Interim::<false, _> { blas: self, probe, t_max, instance, best, accept })
    }
    pub(super) fn any_accepted(&self, probe: &Probe, t_max: f32, instance: u32, accept: impl Fn(&Hit) -> bool) -> bool {
        self.isa.run(Interim::<true, _> { blas: self, probe, t_max, instance, best: None, accept }).is_some()
    }
}
struct Interim<'a, const ANY: bool, A> { blas: &'a Blas, probe: &'a Probe, t_max: f32, instance: u32, best: Option<Hit>, accept: A }
impl<const ANY: bool, A: Fn(&Hit) -> bool> Job for Interim<'_, ANY, A> {
    type Output = Option<Hit>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let mut best = self.best;
        let t_max = best.map_or(self.t_max, |b| b.t);
        let _ = self.blas.wide.traverse(simd, self.probe, 0, t_max, &mut Waiting::default(), |first, count, t_max| {
            self.blas.leaves.test_one::<S, ANY>(simd, self.probe, (first, count), self.instance, t_max, |hit| {
                let better = best.is_none_or(|known| hit.beats(&known)) && (self.accept)(&hit);
                if better {
                    best = Some(hit);
                }
                better
            })
        });
        best
    }
}

struct Single<'a, const ANY: bool> {
    blas: &'a Blas,
    ray: &'a Ray,
}

impl<const ANY: bool> Job for Single<'_, ANY> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        self.blas.trace_one::<S, ANY>(simd, self.ray, &mut Waiting::default())
    }
}

struct Many<'a, const ANY: bool, R> {
    blas: &'a Blas,
    rays: &'a [Ray],
    report: R,
}

impl<const ANY: bool, R: FnMut(usize, Option<Hit>)> Job for Many<'_, ANY, R> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self, simd: S) {
        trace_batch::<S, ANY>(simd, self.blas, self.rays, &mut self.report);
    }
}

/// Judged in double precision, where differences and products of f32 are exact or nearly so.
fn has_surface(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    normal.is_finite() && normal != DVec3::ZERO
}
