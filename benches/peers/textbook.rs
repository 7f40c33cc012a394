//! What textbooks print, for the peers' harness: obvhs's hierarchy with Möller and Trumbore's triangle test.

use crate::engine::{Engine, Ray, Tri};
use glam::Vec3;
use obvhs::{
    BvhBuildParams, bvh2::Bvh2, bvh2::builder::build_bvh2_from_tris, ray::RayHit, triangle::Triangle,
};
use penumbra::bvh;
use penumbra::torture::oracle::moller_trumbore;
use std::time::Duration;

pub struct Textbook {
    bvh: Bvh2,
    tris: Vec<[Vec3; 3]>,
}

#[inline(always)]
fn meets(ray: &obvhs::ray::Ray, corners: &[Vec3; 3]) -> f32 {
    let ray = bvh::Ray {
        origin: Vec3::from_array(ray.origin.to_array()),
        direction: Vec3::from_array(ray.direction.to_array()),
        t_max: ray.tmax,
    };
    moller_trumbore(&ray, corners, ray.t_max).map_or(f32::INFINITY, |(t, ..)| t)
}

#[inline(always)]
fn ray(r: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(r.o.into(), r.d.into(), r.tmin, r.tmax)
}

impl Engine for Textbook {
    fn build(tris: &[Tri], _threads: usize) -> Self {
        let source: Vec<Triangle> =
            tris.iter().map(|t| Triangle { v0: t[0].into(), v1: t[1].into(), v2: t[2].into() }).collect();
        let bvh = build_bvh2_from_tris(&source, BvhBuildParams::medium_build(), &mut Duration::default());
        let corners = |&i: &u32| tris[i as usize].map(Vec3::from_array);
        let tris = bvh.primitive_indices.iter().map(corners).collect();
        Self { bvh, tris }
    }

    #[inline(always)]
    fn closest(&self, r: &Ray) -> Option<(f32, u32)> {
        let mut hit = RayHit::none();
        self.bvh.ray_traverse(ray(r), &mut hit, |r, i| meets(r, &self.tris[i]));
        (hit.primitive_id != u32::MAX).then(|| (hit.t, self.bvh.primitive_indices[hit.primitive_id as usize]))
    }

    #[inline(always)]
    fn occluded(&self, r: &Ray) -> bool {
        !self.bvh.ray_traverse_miss(ray(r), |r, i| meets(r, &self.tris[i]))
    }
}
