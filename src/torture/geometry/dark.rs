//! G5 and G6: light that must not come through, seen in pictures.

use super::leave::mesh;
use super::meshes;
use super::stage::{Stage, WIDE, cube, means, quad};
use crate::bvh::Isa;
use crate::scene::{Light, Material, Projection, TriangleMesh};
use crate::torture::oracle::is_closed;
use crate::torture::{Case, Check, Place, Trial};
use glam::{DAffine3, DVec3, Vec3};
use std::f64::consts::PI;

pub(super) const ROOM: Case = Case {
    id: "G5-room",
    title: "closed rooms lit from outside only, by all lights at once",
    limit: "every pixel inside is exactly 0",
    run: |trial| rooms(trial, &closed_rooms()),
};

pub(super) const SHADOW: Case = Case {
    id: "G6",
    title: "an occluder 0.01 before and 0.01 behind a light at height 1000",
    limit: "exactly dark before it; within 4.5 σ of the closed form behind it",
    run: |trial| ends(trial, 0.01),
};

/// Rooms by name.
type Rooms = Vec<(&'static str, TriangleMesh)>;

/// A cube, and a bumpy sphere.
#[must_use]
pub fn closed_rooms() -> Rooms {
    vec![("cube", cube()), ("bumpy sphere", mesh(&meshes::bumpy_sphere()))]
}

/// The case for any rooms.
#[must_use]
pub fn rooms(trial: &Trial<'_>, rooms: &Rooms) -> Vec<Check> {
    let samples = trial.pick(2, 16, 1024) as u32;
    let mut checks = Vec::new();
    for (number, place) in Place::ALL.into_iter().enumerate() {
        for (name, room) in rooms {
            for isa in Isa::available() {
                if trial.interrupted() {
                    return checks;
                }
                let what = format!("{name}, {}, {}", place.name(), isa.name());
                trial.tell(ROOM.id, what.clone(), number as f64 / Place::ALL.len() as f64);
                let film = room_picture(room, place.transform(), isa, samples);
                let lit = means(&film).iter().filter(|mean| **mean != DVec3::ZERO).count() as u64;
                let pixels = u64::from(film.size().element_product());
                checks.push(Check::none(what, pixels * u64::from(samples), "samples", lit + film.dropped()));
            }
        }
    }
    checks
}

/// From inside.
fn room_picture(room: &TriangleMesh, place: DAffine3, isa: Isa, samples: u32) -> crate::trace::Film {
    let mut stage = Stage::new(48, 32, place).with_isa(isa);
    stage.add_mesh(room.clone(), Material::default(), DAffine3::IDENTITY);
    let at = |x: f64, y: f64, z: f64| DAffine3::from_translation(DVec3::new(x, y, z));
    stage.add(Light::Point { intensity: Vec3::splat(100.0) }, at(3.0, 4.0, 2.0));
    stage.add(Light::Sphere { radius: 0.5, radiance: Vec3::splat(50.0) }, at(-4.0, 1.0, 2.0));
    let lamp = Light::Parallelogram {
        edge_u: Vec3::X * 3.0,
        edge_v: Vec3::Z * 3.0,
        radiance: [Vec3::splat(20.0); 4],
        two_sided: true,
    };
    stage.add(lamp, at(0.0, 3.0, 0.0));
    stage.add(Light::Environment { radiance: Vec3::ONE }, DAffine3::IDENTITY);
    stage.look(DVec3::new(0.3, -0.2, 0.4), DVec3::new(-1.0, 0.5, -1.2), DVec3::Y, WIDE);
    stage.picture(samples)
}

/// Lambert's closed form for the unit square at height 1000, divided by the light's radiance.
const IRRADIANCE: f64 = 9.999_996_666_67e-7;
const ALBEDO: f32 = 0.8;

/// The case for an occluder at this distance from the light.
#[must_use]
pub fn ends(trial: &Trial<'_>, gap: f32) -> Vec<Check> {
    let samples = trial.pick(64, 1024, 16_384) as u32;
    let mut checks = Vec::new();
    for (number, place) in Place::ALL.into_iter().enumerate() {
        if trial.interrupted() {
            break;
        }
        trial.tell(SHADOW.id, place.name(), number as f64 / Place::ALL.len() as f64);
        for isa in Isa::available() {
            let what = format!("{}, {}", place.name(), isa.name());
            // Of 64 pixels, all of the same point.
            let before = lit(-gap, Vec3::splat(0.8), place.transform(), isa, samples);
            let wrong = before.iter().filter(|x| **x != 0.0).count() as u64;
            let tried = before.len() as u64 * u64::from(samples);
            checks.push(Check::none(format!("before: {what}"), tried, "samples", wrong));
            // Black: of a million samples one bounces to its back side, which the light is near, and brings more than all
            // others.
            let behind = lit(gap, Vec3::ZERO, place.transform(), isa, samples);
            let n = behind.len() as f64;
            let mean = behind.iter().sum::<f64>() / n;
            let variance = behind.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
            let exact = IRRADIANCE * f64::from(ALBEDO) / PI;
            // 3e-6: what single precision may add up to in one sample.
            let allowed = 4.5 * (variance / n).sqrt() + 3e-6 * exact;
            let off = (mean - exact).abs();
            checks.push(Check::new(
                format!("off behind, of 4.5 σ: {what}"),
                tried,
                "samples",
                off / allowed,
                1.0,
            ));
            // A test that accepts everything is no test.
            checks.push(Check::new(
                format!("4.5 σ, relative: {what}"),
                tried,
                "samples",
                allowed / exact,
                1e-3,
            ));
        }
    }
    checks
}

/// With an occluder of this colour so far behind the light.
fn lit(gap: f32, occluder: Vec3, place: DAffine3, isa: Isa, samples: u32) -> Vec<f64> {
    let mut stage = Stage::new(8, 8, place).with_isa(isa);
    let (x, y) = (Vec3::X, Vec3::Y);
    stage.add_mesh(
        quad(-(x + y), x * 2.0, y * 2.0),
        Material::lambert(Vec3::splat(ALBEDO)),
        DAffine3::IDENTITY,
    );
    stage.add_mesh(
        quad(Vec3::new(-1.0, -1.0, 1000.0 + gap), x * 2.0, y * 2.0),
        Material::lambert(occluder),
        DAffine3::IDENTITY,
    );
    let light = Light::Parallelogram { edge_u: x, edge_v: y, radiance: [Vec3::ONE; 4], two_sided: true };
    stage.add(light, DAffine3::from_translation(DVec3::Z * 1000.0));
    let scale = place.matrix3.x_axis.length() as f32;
    let projection = Projection::Orthographic { height: 1e-4 * scale };
    stage.look(DVec3::Z * 0.25, DVec3::ZERO, DVec3::Y, projection);
    means(&stage.picture(samples)).iter().map(|mean| mean.x).collect()
}

/// Whether a room is one.
#[must_use]
pub fn is_room(mesh: &TriangleMesh) -> bool {
    let corners: Vec<_> = (0..mesh.triangles.len()).map(|i| mesh.corners(i)).collect();
    is_closed(&corners)
}
