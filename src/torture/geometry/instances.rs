//! G11: placed meshes.

use super::alone::Alone;
use super::meshes::{self, Triangles, bumpy_sphere, knot, soup};
use super::stage::ball;
use crate::bvh::{Aabb, Blas, Hit, Isa, Placement, Ray, Tlas};
use crate::torture::oracle::{Answers, Rng, Tracer, ask};
use crate::torture::{Case, Check, Place, Trial};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

pub(super) const CASE: Case = Case {
    id: "G11",
    title: "instances turned, stretched and mirrored; against each alone, their flat mesh and their mirror image",
    limit: "mirrored and alone bit for bit; no leak; normals within 1e-5; depth within 4 ulp + 1e-6 of the size",
    run: |trial| {
        let mut checks = run(trial, &ours());
        checks.extend(normals(trial, |matrix| matrix.inverse().transpose()));
        checks
    },
};

/// A way to make a [`Tracer`] of placed meshes, and what a table calls it.
pub type Placer = (String, Box<dyn Fn(Vec<Placement>) -> Box<dyn Tracer> + Sync>);

/// Ours, with each set of instructions.
#[must_use]
pub fn ours() -> Vec<Placer> {
    let placer = |isa: Isa| -> Placer {
        let make = move |placements| -> Box<dyn Tracer> { Box::new(Tlas::build(placements).with_isa(isa)) };
        (isa.name().to_owned(), Box::new(make))
    };
    Isa::available().into_iter().map(placer).collect()
}

/// The case for whatever answers rays.
#[must_use]
pub fn run(trial: &Trial<'_>, placers: &[Placer]) -> Vec<Check> {
    let count = trial.pick(500, 8000, 1_000_000) as usize;
    let mut checks = Vec::new();
    for (number, place) in Place::ALL.into_iter().enumerate() {
        let tell = |what: &str| {
            trial.tell(CASE.id, format!("{what}, {}", place.name()), number as f64 / Place::ALL.len() as f64);
        };
        let mut rng = Rng::numbered(trial.seed, 11);
        let machine = Machine::new(&mut rng, place.transform());
        tell("alone");
        checks.extend(machine.alone(&mut rng, count / 4, place, placers));
        tell("mirrored");
        checks.extend(machine.mirrored(&mut rng, count, place, placers));
        tell("flat");
        checks.extend(machine.flat(&mut rng, count, place, placers));
        tell("leaks");
        checks.extend(leaks(&mut rng, count / 10, place, placers));

        if trial.interrupted() {
            break;
        }
    }
    checks
}

/// Placed meshes.
#[derive(Clone)]
struct Machine(Vec<(Arc<Triangles>, DAffine3)>);

impl Machine {
    fn new(rng: &mut Rng, place: DAffine3) -> Self {
        let meshes = [knot(6, 40), bumpy_sphere(), meshes::squared_cube(), soup(200, 0.4, 100)].map(Arc::new);
        let placed = |i: usize| {
            let scale = DVec3::new(1.0, 0.3, if i.is_multiple_of(3) { -2.0 } else { 1.5 });
            let at = rng.vec().as_dvec3() * 8.0;
            let turned = DAffine3::from_scale_rotation_translation(scale, rng.rotation(), at);
            (Arc::clone(&meshes[i % 4]), place * turned)
        };
        Self((0..40).map(placed).collect())
    }

    fn placements(&self, also: DAffine3) -> Vec<Placement> {
        let placement = |(mesh, place): &(Arc<Triangles>, DAffine3)| {
            Placement::new(Arc::new(Blas::build(mesh)), also * *place)
        };
        self.0.iter().filter_map(placement).collect()
    }

    /// All in one mesh, where they are placed.
    fn triangles(&self) -> Triangles {
        let placed = |(mesh, place): &(Arc<Triangles>, DAffine3)| {
            let there = |p: Vec3| place.transform_point3(p.as_dvec3()).as_vec3();
            mesh.iter().map(|t| t.map(there)).collect::<Triangles>()
        };
        self.0.iter().flat_map(placed).collect()
    }

    /// As each instance alone says, the nearest of all.
    fn alone(&self, rng: &mut Rng, count: usize, place: Place, placers: &[Placer]) -> Vec<Check> {
        let placements = self.placements(DAffine3::IDENTITY);
        let rays = rays_into(rng, &Tlas::build(placements.clone()).bounds(), count);
        let each: Vec<Tlas> = placements.iter().map(|p| Tlas::build(vec![p.clone()])).collect();
        let nearest = |ray: &Ray| {
            let hits = each
                .iter()
                .zip(0..)
                .filter_map(|(t, instance)| Some(Hit { instance, ..t.closest_hit(ray)? }));
            hits.reduce(|a, b| if b.beats(&a) { b } else { a })
        };
        let expected: Vec<Option<Hit>> = rays.par_iter().map(nearest).collect();
        with_each(placers, &placements, "each alone", place, &rays, |answers| answers.wrong(&expected))
    }

    /// The mirror image is hit by the mirror images of rays at the same t: floats have a sign, and nothing else
    /// changes.
    fn mirrored(&self, rng: &mut Rng, count: usize, place: Place, placers: &[Placer]) -> Vec<Check> {
        let tlas = Tlas::build(self.placements(DAffine3::IDENTITY));
        let rays = rays_into(rng, &tlas.bounds(), count);
        let expected = ask(&tlas, &rays).hits;
        let check = |axis: usize| {
            let mut mirror = Vec3::ONE;
            mirror[axis] = -1.0;
            let image =
                |ray: &Ray| Ray { origin: ray.origin * mirror, direction: ray.direction * mirror, ..*ray };
            let images: Vec<Ray> = rays.iter().map(image).collect();
            let mirrored = self.placements(DAffine3::from_scale(mirror.as_dvec3()));
            let what = format!("mirrored along {}", ["x", "y", "z"][axis]);
            with_each(placers, &mirrored, &what, place, &images, |answers| answers.wrong(&expected))
        };
        (0..3).flat_map(check).collect()
    }

    /// Depths of instances and of the flat mesh, measured across the surface: rounding moves the corners of the
    /// flat mesh, and along a ray that grazes a triangle that is farther. Where one shows another part than the
    /// other, or nothing, the ray passes a silhouette: one that is moved by as much as corners are rounded shows the
    /// same.
    fn flat(&self, rng: &mut Rng, count: usize, place: Place, placers: &[Placer]) -> Vec<Check> {
        let placements = self.placements(DAffine3::IDENTITY);
        let triangles = self.triangles();
        let flat = Blas::build(&triangles);
        let bounds = flat.bounds();
        // What coordinates are rounded by is in proportion to the largest of them.
        let size = (bounds.max - bounds.min).max_element();
        let reach = bounds.max.abs().max(bounds.min.abs()).max_element();
        let rounding = 1e-6 * size.max(0.25 * reach);
        let rays = rays_into(rng, &bounds, count);
        let same = |ray: &Ray, a: Option<Hit>, b: Option<Hit>| match (a, b) {
            (Some(a), Some(b)) => {
                let length = ray.direction.length();
                let [p, q, r] = triangles[b.triangle as usize].map(Vec3::as_dvec3);
                let normal = (q - p).cross(r - p).normalize_or_zero().as_vec3();
                let slope = normal.dot(ray.direction).abs() / length;
                let step = (a.t.next_up() - a.t) * length;
                (a.t - b.t).abs() * length * slope <= 4.0 * step + rounding
            }
            (a, b) => a.is_none() && b.is_none(),
        };
        let flat_hits = ask(&flat, &rays).hits;
        let check = |(kernel, make): &Placer| {
            let tlas = make(placements.clone());
            let hits = ask(tlas.as_ref(), &rays).hits;
            let explained = |i: usize| {
                let ray = rays[i];
                same(&ray, hits[i], flat_hits[i])
                    || (0..27).any(|k| {
                        let by = Vec3::new((k % 3) as f32, (k / 3 % 3) as f32, (k / 9) as f32) - 1.0;
                        let moved = Ray { origin: ray.origin + by * rounding, ..ray };
                        same(&ray, hits[i], flat.closest_hit(&moved))
                            || same(&ray, tlas.closest_hit(&moved), flat_hits[i])
                    })
            };
            let wrong = (0..rays.len()).into_par_iter().filter(|&i| !explained(i)).count() as u64;
            let tried = if hits.iter().flatten().count() * 8 > rays.len() { rays.len() as u64 } else { 0 };
            Check::none(format!("flat mesh, {}, {kernel}", place.name()), tried, "rays", wrong)
        };
        placers.iter().map(check).collect()
    }
}

/// Rays from around `bounds` to points inside.
fn rays_into(rng: &mut Rng, bounds: &Aabb, count: usize) -> Vec<Ray> {
    let half = bounds.max * 0.5 - bounds.min * 0.5;
    let mut ray = || {
        let target = bounds.center() + rng.vec() * half;
        let origin = bounds.center() + rng.direction() * half.length() * 2.0;
        Ray::new(origin, target - origin)
    };
    (0..count).map(|_| ray()).collect()
}

fn with_each(
    placers: &[Placer],
    placements: &[Placement],
    what: &str,
    place: Place,
    rays: &[Ray],
    wrong: impl Fn(&Answers) -> u64,
) -> Vec<Check> {
    let check = |(kernel, make): &Placer| {
        let answers = ask(make(placements.to_vec()).as_ref(), rays);
        // Rays that all miss show nothing.
        let tried =
            if answers.hits.iter().flatten().count() * 8 > rays.len() { rays.len() as u64 } else { 0 };
        Check::none(format!("{what}, {}, {kernel}", place.name()), tried, "rays", wrong(&answers))
    };
    placers.iter().map(check).collect()
}

/// Out of a closed mesh turned, scaled by 10⁻² to 10² along each axis and moved by 10⁻⁴ to 10⁴, at its corners.
fn leaks(rng: &mut Rng, count: usize, place: Place, placers: &[Placer]) -> Vec<Check> {
    let triangles = bumpy_sphere();
    let blas = Arc::new(Blas::build(&triangles));
    let (mut leaks, mut tried) = (vec![0; placers.len()], 0);
    const PLACEMENTS: usize = 100;
    for _ in 0..PLACEMENTS {
        let scale = DVec3::from_array([(); 3].map(|()| 10f64.powf(f64::from(rng.unit()) * 4.0 - 2.0)));
        let at = rng.vec().as_dvec3() * 10f64.powf(f64::from(rng.unit()) * 8.0 - 4.0);
        let placed = place.transform() * DAffine3::from_scale_rotation_translation(scale, rng.rotation(), at);
        let Some(placement) = Placement::new(Arc::clone(&blas), placed) else { continue };
        let rays: Vec<Ray> = (0..count / PLACEMENTS + 8)
            .map(|_| {
                let origin = placed.transform_point3(rng.vec().as_dvec3() * 0.5).as_vec3();
                let corner = triangles[rng.below(triangles.len())][0];
                let target = placed.transform_point3(corner.as_dvec3()).as_vec3();
                Ray::new(origin, target - origin)
            })
            .filter(|ray| ray.direction != Vec3::ZERO)
            .collect();
        // Where floats are coarser than it is thick, nothing is inside of it any more.
        let thinnest = scale.min_element() * place.scale * 0.5;
        if f64::from(f32::EPSILON) * placed.translation.abs().max_element() > 0.01 * thinnest {
            continue;
        }
        tried += rays.len() as u64;
        for (leaks, (_, make)) in leaks.iter_mut().zip(placers) {
            *leaks += ask(make(vec![placement.clone()]).as_ref(), &rays).leaks();
        }
    }
    let check = |((kernel, _), leaks): (&Placer, u64)| {
        Check::none(format!("leaks, {}, {kernel}", place.name()), tried, "rays", leaks)
    };
    placers.iter().zip(leaks).map(check).collect()
}

/// The case for any matrix for normals, made of that for points.
#[must_use]
pub fn normals(trial: &Trial<'_>, normal_matrix: fn(DMat3) -> DMat3) -> Vec<Check> {
    let mut rng = Rng::numbered(trial.seed, 12);
    Place::ALL.map(|place| ellipsoid(&mut rng, place, normal_matrix)).to_vec()
}

/// The ellipsoid's own normal at the point that the sphere's parameters give, also where it is turned inside out.
fn ellipsoid(rng: &mut Rng, place: Place, normal_matrix: fn(DMat3) -> DMat3) -> Check {
    let what = format!("off in normals of an ellipsoid, {}", place.name());
    let mut mesh = ball(24);
    mesh.normals = mesh.positions.iter().map(|p| p.normalize()).collect();
    let (mut worst, mut tried) = (0.0f64, 0);
    for scale in [DVec3::new(3.0, 1.0, 0.2), DVec3::new(-3.0, 1.0, 0.2), DVec3::new(3.0, -1.0, -0.2)] {
        let placed = place.transform() * DAffine3::from_scale(scale);
        let Some(alone) = Alone::with_normals(mesh.clone(), placed, normal_matrix) else {
            return Check::new(what, 0, "points", f64::NAN, 1e-5);
        };
        for triangle in 0..mesh.triangles.len() {
            let s = rng.unit().sqrt();
            let v = s * rng.unit();
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0 - s, v)] {
                let hit = Hit { t: 1.0, u, v, triangle: triangle as u32, instance: 0 };
                let [a, b, c] = mesh.triangles[triangle].map(|i| mesh.normals[i as usize].as_dvec3());
                let (u, v) = (f64::from(u), f64::from(v));
                let on_sphere = (a * (1.0 - u - v) + b * u + c * v).normalize();
                let expected = (on_sphere / scale).normalize();
                let at = alone.at(&hit, &Ray::new(Vec3::ZERO, -expected.as_vec3()));
                let behind = alone.at(&hit, &Ray::new(Vec3::ZERO, expected.as_vec3()));
                let off = (at.normal.as_dvec3() - expected).length();
                let off = off.max((behind.normal.as_dvec3() + expected).length());
                worst =
                    if at.front && !behind.front && off <= f64::MAX { worst.max(off) } else { f64::INFINITY };
                tried += 1;
            }
        }
    }
    Check::new(what, tried, "points", worst, 1e-5)
}
