//! Our engine for the peers' harness: copied beside its other engines by `run.sh`.

use crate::engine::{Engine, Hit, MISS, Ray, Tri};
use glam::Vec3;
use penumbra::bvh::{self, Blas, Quality};

/// `QUALITY` 0: the interactive builder; 1: the one that replaces it while the picture rests.
pub struct Penumbra<const QUALITY: u8>(Blas);

#[inline(always)]
fn ray(ray: &Ray) -> bvh::Ray {
    bvh::Ray { origin: Vec3::from_array(ray.o), direction: Vec3::from_array(ray.d), t_max: ray.tmax }
}

impl<const QUALITY: u8> Engine for Penumbra<QUALITY> {
    fn build(tris: &[Tri], _threads: usize) -> Self {
        let quality = if QUALITY == 0 { Quality::Interactive } else { Quality::Rested };
        Self(Blas::build_with(bytemuck::cast_slice(tris), quality))
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
