//! Our engine for the peers' harness: copied beside its other engines by `run.sh`.

use crate::engine::{Engine, Hit, MISS, Ray, Tri};
use glam::Vec3;
use penumbra::bvh::{self, Blas};

pub struct Penumbra(Blas);

#[inline(always)]
fn ray(ray: &Ray) -> bvh::Ray {
    bvh::Ray { origin: Vec3::from_array(ray.o), direction: Vec3::from_array(ray.d), t_max: ray.tmax }
}

impl Engine for Penumbra {
    fn build(tris: &[Tri], _threads: usize) -> Self {
        Self(Blas::build(bytemuck::cast_slice(tris)))
    }

    fn closest(&self, r: &Ray) -> Option<(f32, u32)> {
        self.0.closest_hit(&ray(r)).map(|hit| (hit.t, hit.triangle))
    }

    fn occluded(&self, r: &Ray) -> bool {
        self.0.any_hit(&ray(r))
    }

    fn bytes(&self) -> Option<u64> {
        Some(self.0.bytes() as u64)
    }

    fn closest_batch(&self, rays: &[Ray], out: &mut [Hit]) {
        self.0.closest_hits_by(
            rays.len(),
            |i| ray(&rays[i]),
            |i, hit| out[i] = hit.map_or(MISS, |hit| Hit { t: hit.t, prim: hit.triangle }),
        );
    }

    fn occluded_batch(&self, rays: &[Ray], out: &mut [Hit]) {
        self.0.any_hits_by(
            rays.len(),
            |i| ray(&rays[i]),
            |i, blocked| out[i] = if blocked { Hit { t: 0.0, prim: 0 } } else { MISS },
        );
    }
}
