//! G8: slivers, triangles without area, mixed scales, denormal numbers.

use super::alone::Alone;
use super::leave::mesh;
use super::meshes::{Triangles, soup};
use super::stage::{Stage, WIDE, bad_pixels, ball, cube, means};
use crate::bvh::{Isa, Ray};
use crate::scene::{Light, Material, TriangleMesh};
use crate::torture::light::meter::larger;
use crate::torture::oracle::Rng;
use crate::torture::{Case, Check, Place, Trial};
use crate::trace::surface::Interaction;
use glam::{DAffine3, DVec3, Vec3};

pub(super) const CASE: Case = Case {
    id: "G8",
    title: "slivers, triangles without area, 40 orders of magnitude, denormal numbers",
    limit: "the normal of a sliver is within 1e-6; no pixel is no number or below 0",
    run: |trial| {
        let mut checks = normals(|at, _| [at.geometric_normal, at.normal]);
        checks.extend(pictures(trial, &scenes()));
        checks
    },
};

/// A million long, a millionth wide, at the three scales: for whatever makes both normals of a place and the corners.
#[must_use]
pub fn normals(normals: impl Fn(&Interaction, [Vec3; 3]) -> [Vec3; 2]) -> Vec<Check> {
    let mut checks = Vec::new();
    for place in Place::ALL.into_iter().filter(|place| place.shift == 0.0) {
        let corners = [Vec3::ZERO, Vec3::new(1e6, 0.0, 0.0), Vec3::new(5e5, 1e-6, 0.0)];
        let corners = corners.map(|p| place.point(p));
        let Some(alone) = Alone::new(mesh(&[corners]), DAffine3::IDENTITY) else { return Vec::new() };
        for (name, tracer) in alone.tracers() {
            let off = [1.0f32, -1.0].map(|side| {
                let from = place.point(Vec3::new(5e5, 2.5e-7, side));
                let ray = Ray::new(from, Vec3::new(0.0, 0.0, -side));
                let Some(hit) = tracer.closest_hit(&ray) else { return f64::NAN };
                let at = alone.at(&hit, &ray);
                let off = normals(&at, corners).map(|n| f64::from((n - Vec3::Z * side).length()));
                larger(off[0], off[1])
            });
            let worst = larger(off[0], off[1]);
            let what = format!("off in the normal of a sliver, {}, {name}", place.name());
            checks.push(Check::new(what, 2, "rays", worst, 1e-6));
        }
    }
    checks
}

/// Something bad, as it is placed.
pub struct Degenerate {
    /// What a table calls it.
    pub name: &'static str,
    /// Its triangles.
    pub mesh: TriangleMesh,
    /// What it wears.
    pub material: Material,
    /// Where it is.
    pub place: DAffine3,
}

/// What files have been seen to hold.
#[must_use]
pub fn scenes() -> Vec<Degenerate> {
    let here = |name, triangles: Triangles| Degenerate {
        name,
        mesh: mesh(&triangles),
        material: Material::default(),
        place: DAffine3::IDENTITY,
    };
    let scaled = |name, x, y, z| Degenerate {
        name,
        mesh: cube(),
        material: Material::default(),
        place: DAffine3::from_scale(DVec3::new(x, y, z)),
    };
    let mut repeated = cube();
    repeated.triangles.extend([[0, 0, 1], [3, 3, 3], [5, 6, 5]]);
    let mut rng = Rng(8);
    let slivers = (0..1000).map(|_| {
        let (a, along) = (rng.vec(), rng.direction());
        [a, a + along, a + along * rng.unit() + rng.vec() * 1e-7]
    });
    let slivers: Triangles = slivers.collect();
    let points = soup(300, 0.5, 9).into_iter().map(|[a, b, _]| [a, b, a.lerp(b, 0.5)]).collect();
    let times = |factor: f32| soup(300, 0.5, 9).into_iter().map(|t| t.map(|p| p * factor)).collect();
    let mut mixed: Triangles = times(1.0);
    mixed.extend(soup(100, 0.5, 3).into_iter().map(|t| t.map(|p| p * 1e-12)));
    mixed.extend(soup(100, 0.5, 4).into_iter().map(|t| t.map(|p| p * 1e12)));
    vec![
        Degenerate { mesh: repeated, ..scaled("an index twice", 1.0, 1.0, 1.0) },
        here("slivers", slivers),
        here("no area", points),
        here("denormal positions", times(1e-40)),
        here("positions of 1e30", times(1e30)),
        here("24 orders of magnitude", mixed),
        scaled("flattened", 1.0, 0.0, 1.0),
        scaled("scaled by 1e-20", 1e-20, 1e-20, 1e-20),
        scaled("scaled by 1e-6, 1 and 1e6", 1e-6, 1.0, 1e6),
    ]
}

/// Pictures of these beside a ball.
#[must_use]
pub fn pictures(trial: &Trial<'_>, scenes: &[Degenerate]) -> Vec<Check> {
    let samples = trial.pick(1, 4, 256) as u32;
    let mut checks = Vec::new();
    let sets: Vec<_> = scenes.iter().flat_map(|scene| Place::ALL.map(|place| (scene, place))).collect();
    for (number, &(scene, place)) in sets.iter().enumerate() {
        trial.tell(CASE.id, scene.name, number as f64 / sets.len() as f64);
        for isa in Isa::available() {
            if trial.interrupted() {
                return checks;
            }
            let mut stage = Stage::new(32, 24, place.transform()).with_isa(isa);
            stage.add_mesh(scene.mesh.clone(), scene.material.clone(), scene.place);
            stage.add_mesh(
                ball(8),
                Material::default(),
                DAffine3::from_translation(DVec3::new(2.0, 0.0, 0.0)),
            );
            stage.add(Light::Environment { radiance: Vec3::ONE }, DAffine3::IDENTITY);
            stage.look(DVec3::new(1.0, 2.0, 5.0), DVec3::new(1.0, 0.0, 0.0), DVec3::Y, WIDE);
            let film = stage.picture(samples);
            // A picture that shows nothing shows nothing wrong.
            let lit = means(&film).iter().any(|mean| mean.max_element() > 0.0);
            let what = format!("{}, {}, {}", scene.name, place.name(), isa.name());
            let pixels = if lit { u64::from(film.size().element_product()) } else { 0 };
            checks.push(Check::none(what, pixels, "pixels", bad_pixels(&film)));
        }
    }
    checks
}
