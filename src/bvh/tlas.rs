//! Top level: placed instances of bottom levels.

use super::{Aabb, Blas, Bvh, Hit, Probe, Ray};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::ops::ControlFlow;
use std::sync::Arc;

/// One placed [`Blas`].
#[derive(Clone, Debug)]
pub struct Placement {
    blas: Arc<Blas>,
    world_from_local: DAffine3,
    local_from_world: DAffine3,
    /// Nothing to transform, hence nothing to round.
    identity: bool,
}

/// A hierarchy over placed instances.
#[derive(Clone, Debug, Default)]
pub struct Tlas {
    bvh: Bvh,
    placements: Vec<Placement>,
    /// How many times more than the world's own rounding a ray may stray when transformed.
    slack: f32,
}

impl Placement {
    /// `None` if the transform is singular or not finite: such an instance has no surface to hit.
    #[must_use]
    pub fn new(blas: Arc<Blas>, world_from_local: DAffine3) -> Option<Self> {
        let local_from_world = world_from_local.inverse();
        let usable = world_from_local.is_finite() && local_from_world.is_finite();
        let identity = world_from_local == DAffine3::IDENTITY;
        usable.then_some(Self { blas, world_from_local, local_from_world, identity })
    }

    /// The bottom level.
    #[must_use]
    pub fn blas(&self) -> &Arc<Blas> {
        &self.blas
    }

    /// The placement.
    #[must_use]
    pub fn world_from_local(&self) -> &DAffine3 {
        &self.world_from_local
    }

    /// Its inverse.
    #[must_use]
    pub fn local_from_world(&self) -> &DAffine3 {
        &self.local_from_world
    }

    /// The same ray made ready in local space; `None` if that is no other than the world's. The
    /// direction is not normalised, so t stays what it is.
    #[inline]
    fn local(&self, ray: &Ray) -> Option<Probe> {
        let local = |ray: &Ray| Ray {
            origin: self.local_from_world.transform_point3(ray.origin.as_dvec3()).as_vec3(),
            direction: self.local_from_world.transform_vector3(ray.direction.as_dvec3()).as_vec3(),
            t_max: ray.t_max,
        };
        (!self.identity).then(|| Probe::new(&local(ray), &self.blas.bounds()))
    }

    /// The box of the placed corners, rounded outward.
    fn world_bounds(&self) -> Aabb {
        let local = self.blas.bounds();
        if self.identity || local.is_empty() {
            return local;
        }
        (0..8).fold(Aabb::EMPTY, |aabb, corner| {
            let pick = |axis: usize| {
                f64::from(if corner >> axis & 1 == 0 { local.min[axis] } else { local.max[axis] })
            };
            let p = self.world_from_local.transform_point3(DVec3::new(pick(0), pick(1), pick(2)));
            let p = p.clamp(DVec3::splat(f64::from(f32::MIN)), DVec3::splat(f64::from(f32::MAX))).as_vec3();
            aabb.union(Aabb { min: p.map(f32::next_down), max: p.map(f32::next_up) })
        })
    }

    /// Bound on how a rounding error in local space grows in world space, relative to coordinates.
    fn condition(&self) -> f32 {
        if self.identity {
            return 1.0;
        }
        let norm = |m: DMat3| m.to_cols_array_2d().iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        (norm(self.world_from_local.matrix3) * norm(self.local_from_world.matrix3)) as f32
    }
}

impl Tlas {
    /// Builds over `placements`; `Hit::instance` will index them.
    #[must_use]
    pub fn build(placements: Vec<Placement>) -> Self {
        // An empty mesh gets a point that is never entered with a hit.
        let boxes: Vec<Aabb> = placements
            .iter()
            .map(Placement::world_bounds)
            .map(|b| if b.is_empty() { Aabb { min: Vec3::ZERO, max: Vec3::ZERO } } else { b })
            .collect();
        let slack = placements.iter().map(Placement::condition).fold(1.0, f32::max);
        Self { bvh: Bvh::build(&boxes), placements, slack }
    }

    /// What it was built over.
    #[must_use]
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// The hierarchy, to draw or measure.
    #[must_use]
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// The box around everything; empty if there is nothing.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bvh.bounds()
    }

    /// The nearest hit; of equally near ones that of the lowest instance, then triangle.
    #[must_use]
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.closest_accepted(ray, |_| true)
    }

    /// Whether there is any hit.
    #[must_use]
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.any_accepted(ray, |_| true)
    }

    /// As [`Tlas::closest_hit`], among the hits that `accept` takes.
    #[inline]
    #[must_use]
    pub fn closest_accepted(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        let mut best = None;
        let probe = self.probe(ray);
        let _ = self.bvh.traverse::<()>(&probe, ray.t_max, |leaf, t_max| {
            for &i in &self.bvh.prims[leaf] {
                let placement = &self.placements[i as usize];
                let local = placement.local(ray);
                let probe = local.as_ref().unwrap_or(&probe);
                best = placement.blas.closest_accepted(probe, ray.t_max, i, best, &accept);
            }
            ControlFlow::Continue(best.map_or(t_max, |b: Hit| b.t))
        });
        best
    }

    /// As [`Tlas::any_hit`], among the hits that `accept` takes.
    #[inline]
    #[must_use]
    pub fn any_accepted(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        let probe = self.probe(ray);
        self.bvh
            .traverse(&probe, ray.t_max, |leaf, t_max| {
                for &i in &self.bvh.prims[leaf] {
                    let placement = &self.placements[i as usize];
                    let local = placement.local(ray);
                    let probe = local.as_ref().unwrap_or(&probe);
                    if placement.blas.any_accepted(probe, ray.t_max, i, &accept) {
                        return ControlFlow::Break(());
                    }
                }
                ControlFlow::Continue(t_max)
            })
            .is_break()
    }

    fn probe(&self, ray: &Ray) -> Probe {
        Probe::with_slack(ray, &self.bvh.bounds(), self.slack)
    }
}
