//! Pixels → rays.

use super::block::{LANES, Row, Rows};
use super::sampler::SamplerRow;
use super::warp::disk;
use crate::bvh::Ray;
use crate::bvh::simd::{Job, Simd};
use crate::scene::{Lens, Projection};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat3, DVec3, Mat3, UVec2, Vec2, Vec3};

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
    /// `None`: a pinhole, all is sharp.
    lens: Option<Lens>,
}

/// A view as linear functions of the place in its picture, in pixels from the top left.
#[derive(Clone, Copy, Debug)]
pub struct Sheet {
    /// Of the origin of the ray there: its value at (0, 0), and what each pixel across and down adds.
    pub origin: [Vec3; 3],
    /// The same of its direction, which is of depth 1.
    pub direction: [Vec3; 3],
    /// Origin of the camera's own space, ...
    pub eye: Vec3,
    /// ... and its axes as rows: picture right, picture up, ahead.
    pub axes: Mat3,
    middle: Vec2,
    scale: f32,
    /// Whether what is farther away looks smaller.
    pub perspective: bool,
}

impl Sheet {
    /// Where a point of the camera's own space is in the picture.
    #[inline(always)]
    #[must_use]
    pub fn place(&self, point: Vec3) -> Vec2 {
        let scale = if self.perspective { self.scale / point.z } else { self.scale };
        self.middle + Vec2::new(point.x, -point.y) * scale
    }

    /// A point of render space in the camera's own.
    #[inline(always)]
    #[must_use]
    pub fn own(&self, point: Vec3) -> Vec3 {
        self.axes * (point - self.eye)
    }

    /// How much of the scene a pixel shows at `depth`, scene units.
    #[inline(always)]
    #[must_use]
    pub fn pixel(&self, depth: f32) -> f32 {
        if self.perspective { depth / self.scale } else { 1.0 / self.scale }
    }
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
            lens: None,
        }
    }

    /// The same behind `lens`; one without an extent or a distance is none.
    #[must_use]
    pub fn with_lens(self, lens: Option<Lens>) -> Self {
        let lens = lens.filter(|lens| {
            let [radius, focus] = [lens.radius, lens.focus];
            radius > 0.0 && focus > 0.0 && radius.is_finite() && focus.is_finite()
        });
        Self { lens, ..self }
    }

    /// Whether rays through one point of the picture begin at several.
    #[must_use]
    pub fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    /// In words, every bit of it, at its place in the world: `origin` is that of render space.
    #[must_use]
    pub fn description(&self, origin: DVec3) -> String {
        let Self { origin: eye, right, up, back, half_height, perspective, lens } = self;
        let kind = if *perspective { "perspective" } else { "orthographic" };
        let eye = eye.as_dvec3() + origin;
        let [eye, ahead] = [eye.to_array(), (-back.as_dvec3()).to_array()];
        let [up, right] = [up, right].map(Vec3::to_array);
        let lens = lens.map_or(String::new(), |l| format!(" lens {:?} focus {:?}", l.radius, l.focus));
        format!("{kind} {half_height:?} at {eye:?} toward {ahead:?} up {up:?} right {right:?}{lens}")
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

    /// A [`Viewpoint::ray`] from the point of the lens that `random` in [0, 1)² chooses, if there is a lens.
    #[must_use]
    pub fn through_lens(&self, ray: Ray, random: Vec2) -> Ray {
        let Some(lens) = self.lens else { return ray };
        let on_lens = disk(random) * lens.radius;
        let sharp = ray.at(lens.focus / -ray.direction.dot(self.back));
        let origin = ray.origin + self.right * on_lens.x + self.up * on_lens.y;
        Ray::new(origin, (sharp - origin).normalize())
    }

    /// Where `point` of render space is in a picture of `size`, in pixels from the top left, and how deep:
    /// its distance along the line of sight, which is 0 or less behind the eye.
    #[must_use]
    pub fn project(&self, point: Vec3, size: UVec2) -> Vec3 {
        let offset = point - self.origin;
        let depth = -self.back.dot(offset);
        let size = size.as_vec2();
        let scale = 0.5 * size.y / (self.half_height * if self.perspective { depth } else { 1.0 });
        let (x, y) = (self.right.dot(offset) * scale, self.up.dot(offset) * scale);
        Vec3::new(0.5 * size.x + x, 0.5 * size.y - y, depth)
    }

    /// All rays through a picture of `size` at once, and how to find a point of another view in this one.
    #[must_use]
    pub fn sheet(&self, size: UVec2) -> Sheet {
        let size = size.as_vec2();
        let across = self.right * (2.0 * self.half_height / size.y);
        let down = self.up * (-2.0 * self.half_height / size.y);
        let corner = (self.up - self.right * (size.x / size.y)) * self.half_height;
        let (still, ahead) = ([self.origin, Vec3::ZERO, Vec3::ZERO], -self.back);
        let (origin, direction) = if self.perspective {
            (still, [corner + ahead, across, down])
        } else {
            ([self.origin + corner, across, down], [ahead, Vec3::ZERO, Vec3::ZERO])
        };
        Sheet {
            origin,
            direction,
            eye: self.origin,
            axes: Mat3::from_cols(self.right, self.up, ahead).transpose(),
            middle: size * 0.5,
            scale: 0.5 * size.y / self.half_height,
            perspective: self.perspective,
        }
    }

    /// How deep a point of `ray` at `t` is, as [`Viewpoint::project`] measures it.
    #[must_use]
    pub fn depth(&self, ray: &Ray, t: f32) -> f32 {
        -self.back.dot(ray.at(t) - self.origin)
    }
}

/// The pair of random numbers that chooses the place on the lens; that of the place in the pixel is 0.
pub(super) const LENS: u32 = 1;

/// Rays through the pixels with these top left `corners`, each at a place of its own in the pixel.
pub(super) struct LookOut<'a> {
    pub viewpoint: &'a Viewpoint,
    pub size: UVec2,
    pub samplers: &'a SamplerRow<LANES>,
    pub corners: [&'a Row; 2],
    /// Through the middles of the pixels, not anywhere in them.
    pub middles: bool,
    /// What comes out; no more than a row.
    pub rays: &'a mut [Ray],
}

impl Job for LookOut<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
        if self.middles {
            (x, y) = ([0.5; LANES], [0.5; LANES]);
        } else {
            self.samplers.pairs(0, &mut x, &mut y);
        }
        let (mut lens_x, mut lens_y) = ([0.0; LANES], [0.0; LANES]);
        let has_lens = self.viewpoint.has_lens();
        if has_lens {
            self.samplers.pairs(LENS, &mut lens_x, &mut lens_y);
        }
        let (mut origins, mut directions) = (Rows::blank(), Rows::blank());
        for i in 0..LANES {
            let point = Vec2::new(self.corners[0][i] + x[i], self.corners[1][i] + y[i]);
            let mut ray = self.viewpoint.ray(point, self.size);
            if has_lens {
                ray = self.viewpoint.through_lens(ray, Vec2::new(lens_x[i], lens_y[i]));
            }
            origins.set(i, ray.origin);
            directions.set(i, ray.direction);
        }
        for (i, ray) in self.rays.iter_mut().enumerate() {
            *ray = Ray::new(origins.get(i), directions.get(i));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn viewpoint(projection: Projection) -> Viewpoint {
        let pose = crate::scene::Transform::looking_at(DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO, DVec3::Y);
        Viewpoint::new(&pose.0, projection)
    }

    const BOTH: [Projection; 2] =
        [Projection::Perspective { vertical_fov: 0.9 }, Projection::Orthographic { height: 3.0 }];

    #[test]
    fn a_point_on_a_ray_is_projected_to_where_the_ray_began() {
        let size = UVec2::new(640, 360);
        for viewpoint in BOTH.map(viewpoint) {
            for (x, y, t) in [(0.0, 0.0, 1.0), (320.0, 180.0, 4.0), (639.5, 12.25, 0.3)] {
                let ray = viewpoint.ray(Vec2::new(x, y), size);
                let there = viewpoint.project(ray.at(t), size);
                assert!(there.abs_diff_eq(Vec3::new(x, y, viewpoint.depth(&ray, t)), 2e-3), "{there}");
            }
        }
    }

    #[test]
    fn a_sheet_is_all_rays_and_projections() {
        let size = UVec2::new(640, 360);
        for viewpoint in BOTH.map(viewpoint) {
            let sheet = viewpoint.sheet(size);
            for (x, y) in [(0.0, 0.0), (320.0, 180.0), (639.5, 12.25)] {
                let at = |[a, b, c]: [Vec3; 3]| a + b * x + c * y;
                let ray = viewpoint.ray(Vec2::new(x, y), size);
                assert!(at(sheet.origin).abs_diff_eq(ray.origin, 1e-5));
                assert!(at(sheet.direction).normalize().abs_diff_eq(ray.direction, 1e-5));
                let point = at(sheet.origin) + at(sheet.direction) * 2.5;
                let own = sheet.own(point);
                assert!((own.z - 2.5).abs() < 1e-5);
                assert!(sheet.place(own).abs_diff_eq(Vec2::new(x, y), 2e-3));
                let next = viewpoint.project(point + viewpoint.right * sheet.pixel(own.z), size);
                assert!((next.x - x - 1.0).abs() < 2e-3, "a pixel to the right");
            }
        }
    }

    #[test]
    fn all_rays_of_a_lens_meet_where_it_is_sharp_and_nowhere_else() {
        let size = UVec2::new(64, 64);
        for pinhole in BOTH.map(viewpoint) {
            let lens = Lens { radius: 0.25, focus: 2.0 };
            let viewpoint = pinhole.with_lens(Some(lens));
            let place = Vec2::new(10.0, 50.0);
            let sharp = pinhole.ray(place, size);
            let t = 2.0 / pinhole.depth(&sharp, 1.0);
            let (mut widest, mut seen) = (0f32, 0);
            for i in 0..256u32 {
                let random = Vec2::new((i % 16) as f32 + 0.5, (i / 16) as f32 + 0.5) / 16.0;
                let ray = viewpoint.through_lens(viewpoint.ray(place, size), random);
                let near = (sharp.at(t) - ray.origin).reject_from(ray.direction).length();
                assert!(near < 1e-5, "{near}");
                assert!((ray.direction.length() - 1.0).abs() < 1e-6);
                let off = (ray.origin - sharp.origin).length();
                assert!(off <= 0.25 * 1.0001, "{off}");
                (widest, seen) = (widest.max(off), seen + u32::from(off < 0.125));
            }
            assert!(widest > 0.24 && (56..=72).contains(&seen), "even by area: {widest} {seen}");
        }
    }

    #[test]
    fn a_lens_without_extent_is_none() {
        for (radius, focus) in [(0.0, 1.0), (1.0, 0.0), (f32::NAN, 1.0), (1.0, f32::INFINITY)] {
            let pinhole = viewpoint(BOTH[0]);
            assert_eq!(pinhole.with_lens(Some(Lens { radius, focus })), pinhole);
        }
    }
}
