//! Bottom level: the triangles of one mesh.

use super::{Aabb, Bvh, Hit, Probe, Ray};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// A hierarchy over triangles, which it keeps in the order of its leaves.
#[derive(Clone, Debug, Default)]
pub struct Blas {
    bvh: Bvh,
    triangles: Vec<[Vec3; 3]>,
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
        let triangles = bvh.prims.iter().map(|&i| triangles[i as usize]).collect();
        Self { bvh, triangles }
    }

    /// The hierarchy, to draw or measure.
    #[must_use]
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// The box around all triangles; empty without any.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bvh.bounds()
    }

    /// Bytes of nodes and triangles.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.bvh.nodes) + size_of_val(&*self.bvh.prims) + size_of_val(&*self.triangles)
    }

    /// The nearest hit; of equally near ones that of the lowest triangle index.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.closest_accepted(&Probe::new(ray, &self.bounds()), ray.t_max, 0, None, |_| true)
    }

    /// Whether there is any hit.
    #[must_use]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.any_accepted(&Probe::new(ray, &self.bounds()), ray.t_max, 0, |_| true)
    }

    /// The better of `best` and the nearest hit that `accept` takes, reported as of `instance`.
    #[inline]
    pub(super) fn closest_accepted(
        &self,
        probe: &Probe,
        t_max: f32,
        instance: u32,
        mut best: Option<Hit>,
        accept: impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        let t_max = best.map_or(t_max, |b| b.t);
        // Never broken off, so the control flow tells nothing.
        let _ = self.bvh.traverse::<()>(probe, t_max, |leaf, mut t_max| {
            for i in leaf {
                if let Some(hit) = probe.triangle(&self.triangles[i], t_max) {
                    let hit = Hit { t: hit.t, u: hit.u, v: hit.v, triangle: self.bvh.prims[i], instance };
                    if best.is_none_or(|b| hit.beats(&b)) && accept(&hit) {
                        best = Some(hit);
                        t_max = hit.t;
                    }
                }
            }
            ControlFlow::Continue(t_max)
        });
        best
    }

    /// Whether there is a hit that `accept` takes.
    #[inline]
    pub(super) fn any_accepted(
        &self,
        probe: &Probe,
        t_max: f32,
        instance: u32,
        accept: impl Fn(&Hit) -> bool,
    ) -> bool {
        self.bvh
            .traverse(probe, t_max, |leaf, t_max| {
                for i in leaf {
                    if let Some(hit) = probe.triangle(&self.triangles[i], t_max) {
                        let hit = Hit { t: hit.t, u: hit.u, v: hit.v, triangle: self.bvh.prims[i], instance };
                        if accept(&hit) {
                            return ControlFlow::Break(());
                        }
                    }
                }
                ControlFlow::Continue(t_max)
            })
            .is_break()
    }
}

/// Judged in double precision, where differences and products of f32 are exact or nearly so.
fn has_surface(corners: &[Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a);
    normal.is_finite() && normal != DVec3::ZERO
}
