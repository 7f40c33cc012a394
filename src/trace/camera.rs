//! Pixels → rays.

use super::block::{LANES, Row, Rows};
use super::sampler::SamplerRow;
use crate::bvh::Ray;
use crate::bvh::simd::{Job, Simd};
use crate::scene::Projection;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat3, DVec3, UVec2, Vec2, Vec3};

/// The camera as rays need it, in render space.
#[derive(Resource, Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    origin: Vec3,
    /// Unit and orthogonal: picture right, picture up, and backward.
    right: Vec3,
    up: Vec3,
    back: Vec3,
    /// Half the picture's height: at unit distance if in perspective, else in scene units.
    half_height: f32,
    perspective: bool,
}

impl Default for Viewpoint {
    fn default() -> Self {
        let projection = Projection::Perspective { vertical_fov: std::f32::consts::FRAC_PI_4 };
        Self::new(&DAffine3::IDENTITY, projection)
    }
}

impl Viewpoint {
    /// A camera at this pose, looking along −Z. Scale and shear of the pose are ignored.
    #[must_use]
    pub fn new(render_from_camera: &DAffine3, projection: Projection) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = render_from_camera.matrix3;
        let back = z_axis.try_normalize().unwrap_or(DVec3::Z);
        let up = (y_axis - back * back.dot(y_axis))
            .try_normalize()
            .unwrap_or_else(|| back.any_orthonormal_vector());
        // A mirrored pose mirrors the picture.
        let right = up.cross(back) * if up.cross(back).dot(x_axis) < 0.0 { -1.0 } else { 1.0 };
        Self {
            origin: render_from_camera.translation.as_vec3(),
            right: right.as_vec3(),
            up: up.as_vec3(),
            back: back.as_vec3(),
            half_height: match projection {
                Projection::Perspective { vertical_fov } => (0.5 * vertical_fov).tan(),
                Projection::Orthographic { height } => 0.5 * height,
            },
            perspective: matches!(projection, Projection::Perspective { .. }),
        }
    }

    /// In words, every bit of it, at its place in the world: `origin` is that of render space.
    #[must_use]
    pub fn description(&self, origin: DVec3) -> String {
        let Self { origin: eye, right, up, back, half_height, perspective } = self;
        let kind = if *perspective { "perspective" } else { "orthographic" };
        let eye = eye.as_dvec3() + origin;
        let [eye, ahead] = [eye.to_array(), (-back.as_dvec3()).to_array()];
        let [up, right] = [up, right].map(Vec3::to_array);
        format!("{kind} {half_height:?} at {eye:?} toward {ahead:?} up {up:?} right {right:?}")
    }

    /// The ray through `point`, in pixels from the top left of a picture of `size`; unit direction.
    #[inline(always)]
    #[must_use]
    pub fn ray(&self, point: Vec2, size: UVec2) -> Ray {
        let size = size.as_vec2();
        // In units of half the picture's height, up positive.
        let x = (2.0 * point.x - size.x) / size.y;
        let y = 1.0 - 2.0 * point.y / size.y;
        let offset = (self.right * x + self.up * y) * self.half_height;
        if self.perspective {
            let along = offset - self.back;
            Ray::new(self.origin, along * (1.0 / along.length()))
        } else {
            Ray::new(self.origin + offset, -self.back)
        }
    }
}

/// Rays through the pixels with these top left `corners`, each at a place of its own in the pixel.
pub(super) struct Look<'a> {
    pub viewpoint: &'a Viewpoint,
    pub size: UVec2,
    pub samplers: &'a SamplerRow<LANES>,
    pub corners: [&'a Row; 2],
    /// What comes out; no more than a row.
    pub rays: &'a mut [Ray],
}

impl Job for Look<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        self.samplers.pairs(0, &mut x, &mut y);
        let (mut origins, mut directions) = (Rows::blank(), Rows::blank());
        for i in 0..LANES {
            let point = Vec2::new(self.corners[0][i] + x[i], self.corners[1][i] + y[i]);
            let ray = self.viewpoint.ray(point, self.size);
            origins.set(i, ray.origin);
            directions.set(i, ray.direction);
        }
        for (i, ray) in self.rays.iter_mut().enumerate() {
            *ray = Ray::new(origins.get(i), directions.get(i));
        }
    }
}
