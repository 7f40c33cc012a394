//! C: cameras at their ends.

use super::stage::{Stage, WIDE, bad_pixels, cube, means};
use crate::bvh::{Isa, Ray};
use crate::scene::{Light, Material, Projection, Transform};
use crate::torture::oracle::Rng;
use crate::torture::{Case, Check, Place, Trial};
use crate::trace::Viewpoint;
use glam::{DAffine3, DVec3, UVec2, Vec2};

pub(super) const RAYS: Case = Case {
    id: "C1",
    title: "fields of view of 1e-6 and 179.9 degrees, parallel rays, 1 x 1 and 7 x 3 pixels, up along the view",
    limit: "directions finite, unit within 2 ulp, and within 4 ε of f64",
    run: |trial| rays(trial, Viewpoint::ray),
};

pub(super) const PLACES: Case = Case {
    id: "C2",
    title: "eyes inside of a wall, on a face, on an edge, on a corner, up along the view",
    limit: "no pixel is no number or below 0; as much sky is seen as there is",
    run: |trial| places(trial, |eye, target, up| Transform::looking_at(eye, target, up).0),
};

const EPSILON: f64 = 0.5 * f32::EPSILON as f64;

const PROJECTIONS: [(&str, Projection); 5] = [
    ("1e-6 degrees", Projection::Perspective { vertical_fov: 1e-6 * std::f32::consts::PI / 180.0 }),
    ("45 degrees", Projection::Perspective { vertical_fov: std::f32::consts::FRAC_PI_4 }),
    ("179.9 degrees", Projection::Perspective { vertical_fov: 179.9 * std::f32::consts::PI / 180.0 }),
    ("parallel, 2 high", Projection::Orthographic { height: 2.0 }),
    ("parallel, 1e-6 high", Projection::Orthographic { height: 1e-6 }),
];

const SIZES: [UVec2; 5] =
    [UVec2::new(1, 1), UVec2::new(7, 3), UVec2::new(1920, 1080), UVec2::new(1, 4096), UVec2::new(16_384, 1)];

/// Poses: any, along the axes, and with up along the view.
fn poses(rng: &mut Rng, count: usize) -> Vec<DAffine3> {
    let mut poses = Vec::new();
    for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z] {
        for up in [DVec3::X, DVec3::Y, DVec3::Z] {
            poses.push(Transform::looking_at(DVec3::ZERO, axis, up).0);
        }
    }
    poses.extend((0..count).map(|_| {
        let eye = rng.vec().as_dvec3();
        Transform::looking_at(eye, eye + rng.vec().as_dvec3(), rng.vec().as_dvec3()).0
    }));
    poses
}

/// The case for whatever makes rays of pixels.
#[must_use]
pub fn rays(trial: &Trial<'_>, make: impl Fn(&Viewpoint, Vec2, UVec2) -> Ray) -> Vec<Check> {
    let count = trial.pick(20, 1000, 100_000) as usize;
    let mut checks = Vec::new();
    for (number, place) in Place::ALL.into_iter().enumerate() {
        if trial.interrupted() {
            break;
        }
        trial.tell(RAYS.id, place.name(), number as f64 / Place::ALL.len() as f64);
        let poses = poses(&mut Rng::numbered(trial.seed, 1), count);
        for (name, projection) in PROJECTIONS {
            let (mut off, mut length, mut tried) = (0.0f64, 0.0f64, 0);
            for pose in &poses {
                let pose =
                    DAffine3::from_translation(DVec3::splat(place.shift) + pose.translation * place.scale)
                        * DAffine3::from_mat3(pose.matrix3);
                let viewpoint = Viewpoint::new(&pose, projection);
                for (size, corner) in SIZES.iter().flat_map(|size| (0..5).map(move |corner| (size, corner))) {
                    let point = match corner {
                        4 => size.as_vec2() * 0.5,
                        corner => Vec2::new((corner & 1) as f32, (corner >> 1) as f32) * size.as_vec2(),
                    };
                    let ray = make(&viewpoint, point, *size);
                    let d = ray.direction.as_dvec3();
                    let exact = direction(&pose, projection, point, *size);
                    let this = (d - exact).abs().max_element() / EPSILON;
                    off = if this >= off || this.is_nan() { this } else { off };
                    let this = (d.length() - 1.0).abs() / f64::from(f32::EPSILON);
                    length = if this >= length || this.is_nan() { this } else { length };
                    tried += 1;
                }
            }
            let what = format!("{name}, {}", place.name());
            checks.push(Check::new(format!("ulp off in length: {what}"), tried, "rays", length, 2.0));
            checks.push(Check::new(format!("ε off in direction: {what}"), tried, "rays", off, 4.0));
        }
    }
    checks
}

/// The direction in double precision.
fn direction(pose: &DAffine3, projection: Projection, point: Vec2, size: UVec2) -> DVec3 {
    let m = pose.matrix3;
    let Projection::Perspective { vertical_fov } = projection else { return -m.z_axis };
    let (point, size) = (point.as_dvec2(), size.as_dvec2());
    let half = (0.5 * f64::from(vertical_fov)).tan();
    let (x, y) = ((2.0 * point.x - size.x) / size.y, 1.0 - 2.0 * point.y / size.y);
    (m.x_axis * (x * half) + m.y_axis * (y * half) - m.z_axis).normalize()
}

/// Where an eye should not be, what it looks at, and how much of its picture is sky: there may be less where rounding
/// moves the eye into the cube.
const EYES: [(&str, DVec3, DVec3, [f64; 2]); 7] = [
    ("inside", DVec3::new(0.1, 0.2, 0.3), DVec3::X, [0.0, 0.0]),
    ("on a face", DVec3::new(1.0, 0.2, 0.3), DVec3::NEG_X, [0.0, 0.0]),
    ("on a face, along it", DVec3::new(1.0, 0.2, 0.3), DVec3::Y, [0.0, 0.6]),
    ("on an edge", DVec3::new(1.0, 1.0, 0.3), DVec3::Z, [0.0, 0.85]),
    ("on a corner", DVec3::new(1.0, 1.0, 1.0), DVec3::NEG_ONE, [0.0, 0.3]),
    ("on a diagonal", DVec3::new(1.0, 0.25, 0.25), DVec3::NEG_X, [0.0, 0.0]),
    ("up along the view", DVec3::new(0.5, 3.0, 0.5), DVec3::NEG_Y, [0.4, 0.7]),
];

/// The case for whatever makes the place of a camera of its eye, its target and what is up.
#[must_use]
pub fn places(trial: &Trial<'_>, look: impl Fn(DVec3, DVec3, DVec3) -> DAffine3) -> Vec<Check> {
    let samples = trial.pick(1, 8, 256) as u32;
    let mut checks = Vec::new();
    for (number, place) in Place::ALL.into_iter().enumerate() {
        for (name, eye, toward, [least, most]) in EYES {
            trial.tell(PLACES.id, name, number as f64 / Place::ALL.len() as f64);
            for isa in Isa::available() {
                if trial.interrupted() {
                    return checks;
                }
                let mut stage = Stage::new(32, 24, place.transform()).with_isa(isa);
                let material = Material { emission: glam::Vec3::splat(0.1), ..Material::default() };
                stage.add_mesh(cube(), material, DAffine3::IDENTITY);
                stage.add(Light::Environment { radiance: glam::Vec3::ONE }, DAffine3::IDENTITY);
                stage.look_from(look(eye, eye + toward, DVec3::Y), WIDE);
                let film = stage.picture(samples);
                let what = format!("{name}, {}, {}", place.name(), isa.name());
                let pixels = u64::from(film.size().element_product());
                let sky = means(&film).iter().filter(|mean| **mean == DVec3::ONE).count();
                let is_there = (least..=most).contains(&(sky as f64 / pixels as f64));
                let bad = bad_pixels(&film) + u64::from(!is_there);
                checks.push(Check::none(what, pixels, "pixels", bad));
            }
        }
    }
    checks
}
