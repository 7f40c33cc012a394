//! G5: rays that start on a surface.

use super::alone::Alone;
use super::meshes::{Triangles, with_surface};
use super::stage::ball;
use crate::bvh::{Hit, Ray};
use crate::scene::TriangleMesh;
use crate::torture::oracle::{Rng, ask};
use crate::torture::{Case, Check, Place, Trial};
use crate::trace::surface::Interaction;
use glam::{DAffine3, DVec3, Vec3, Vec3Swizzles};
use rayon::prelude::*;

/// Where a ray toward a direction starts from a surface.
pub type Leave = fn(&Interaction, Vec3) -> Vec3;

pub(super) const SELF: Case = Case {
    id: "G5",
    title: "rays from triangles of coordinates 1e-8 to 1e8, also placed by transforms of 8 decades",
    limit: "no ray hits the triangle that it leaves",
    run: |trial| own_hits(trial, Interaction::origin_toward),
};

pub(super) const GAP: Case = Case {
    id: "G5-gap",
    title: "rays into gaps between parallel squares and between spheres of radii 1 and 1.00004",
    limit: "blocked from 2^-14 on near 1, and from 64 ulp on at 1e3 and 1e5; none leaps over",
    run: |trial| gaps(trial, Interaction::origin_toward),
};

/// A mesh of these triangles alone.
#[must_use]
pub fn mesh(triangles: &[[Vec3; 3]]) -> TriangleMesh {
    let triples = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    TriangleMesh { positions: triangles.concat(), triangles: triples.collect(), ..TriangleMesh::default() }
}

/// A point of triangle `number`, seen from where a ray toward `direction` leaves it.
fn start(alone: &Alone, rng: &mut Rng, number: u32, direction: impl Fn(Vec3) -> Vec3) -> (Interaction, Vec3) {
    let s = rng.unit().sqrt();
    let v = s * rng.unit();
    let hit = Hit { t: 1.0, u: 1.0 - s, v, triangle: number, instance: 0 };
    let position = alone.at(&hit, &Ray::new(Vec3::ZERO, Vec3::X)).position;
    let direction = direction(position);
    (alone.at(&hit, &Ray::new(Vec3::ZERO, -direction)), direction)
}

/// Rays from points of one triangle: half without an end, half to points of any size with `t_max` 1 (pbrt's tests
/// `Triangle.Reintersect`), but none to the triangle's plane. Also how many of these had to be left out.
#[must_use]
pub fn rays_off(alone: &Alone, rng: &mut Rng, count: usize, leave: Leave) -> (Vec<Ray>, u64) {
    let (mut rays, mut left_out) = (Vec::with_capacity(count), 0);
    let placed = *alone.geometry.tlas.placements()[0].world_from_local();
    let corners = alone.geometry.instances[0].mesh.corners(0).map(|p| placed.transform_point3(p.as_dvec3()));
    for number in 0..count {
        let endless = number < count / 2;
        let target = Vec3::ZERO.map(|_| rng.decades(-8.0, 8.0));
        let toward = rng.direction();
        let (at, direction) = start(alone, rng, 0, |from| if endless { toward } else { target - from });
        let origin = leave(&at, direction);
        let ray = if endless {
            Ray::new(origin, direction)
        } else {
            Ray { origin, direction: target - origin, t_max: 1.0 }
        };
        let apart = endless || is_apart(&corners, target, &spread(&placed, target, origin));
        if apart && ray.direction != Vec3::ZERO && ray.direction.is_finite() {
            rays.push(ray);
        } else {
            left_out += 1;
        }
    }
    (rays, left_out)
}

/// What the end of a ray is rounded in proportion to, along each axis: coordinates of both ends; and where they are
/// turned on their way into the space of a mesh, their distances from its origin too.
fn spread(placed: &DAffine3, target: Vec3, origin: Vec3) -> DVec3 {
    let (target, origin) = (target.as_dvec3(), origin.as_dvec3());
    if *placed == DAffine3::IDENTITY {
        return target.abs() + origin.abs();
    }
    DVec3::splat(target.length() + origin.length() + 2.0 * placed.translation.length())
}

/// Whether the end of a ray is not in the plane of a triangle, as far as floats can tell: its floats and those of its
/// origin and direction are rounded, so it ends somewhere within some ε of them. A ray that ends on the triangle may
/// hit it.
fn is_apart(corners: &[DVec3; 3], target: Vec3, spread: &DVec3) -> bool {
    const EPSILON: f64 = 0.5 * f32::EPSILON as f64;
    // From the corner opposite the longest edge: the two others of a needle are parallel but for what they have lost.
    let opposite = |i: usize| corners[(i + 1) % 3].distance(corners[(i + 2) % 3]);
    let tip = (0..3).max_by(|&i, &k| opposite(i).total_cmp(&opposite(k))).unwrap_or(0);
    let [a, b, c] = [0, 1, 2].map(|i| corners[(tip + i) % 3]);
    let (ab, ac) = (b - a, c - a);
    let ways = corners.map(|corner| target.as_dvec3() - corner);
    let at = ways.into_iter().min_by(|p, q| p.length().total_cmp(&q.length())).unwrap_or(ways[0]);
    let normal = ab.cross(ac);
    let products = ab.abs().yzx() * ac.abs().zxy() + ab.abs().zxy() * ac.abs().yzx();
    let rounded = 8.0 * EPSILON * normal.abs().dot(*spread);
    normal.dot(at).abs() > rounded + 8.0 * f64::EPSILON * products.dot(at.abs())
}

/// The case for any way of leaving a surface.
#[must_use]
pub fn own_hits(trial: &Trial<'_>, leave: Leave) -> Vec<Check> {
    let (triangles, rays) = (trial.pick(60, 300, 1000), trial.pick(256, 512, 2000) as usize);
    let mut checks = Vec::new();
    let sets: Vec<(Option<Place>, String)> = Place::ALL
        .iter()
        .map(|&place| (Some(place), place.name()))
        .chain([(None, "placed by a transform".to_owned())])
        .collect();
    for (number, (place, what)) in sets.iter().enumerate() {
        if trial.interrupted() {
            break;
        }
        trial.tell(SELF.id, what.clone(), number as f64 / sets.len() as f64);
        let counted: Vec<(u64, u64, Vec<u64>)> = (0..triangles)
            .into_par_iter()
            .map(|number| one_triangle(&mut Rng::numbered(trial.seed, number), *place, rays, leave))
            .collect();
        let tried = counted.iter().map(|(rays, ..)| rays).sum();
        let left_out: u64 = counted.iter().map(|(_, left_out, _)| left_out).sum();
        for (i, isa) in crate::bvh::Isa::available().into_iter().enumerate() {
            let hits = counted.iter().filter_map(|(.., hits)| hits.get(i)).sum();
            checks.push(Check::none(format!("{what}, {}", isa.name()), tried, "rays", hits));
        }
        let share = left_out as f64 / (tried + left_out).max(1) as f64;
        let what = format!("left out as they end on it, as far as floats can tell, {what}");
        checks.push(Check::new(what, tried + left_out, "rays", share, MOST_LEFT_OUT));
    }
    checks
}

/// Of all rays; more would be a case that tries nothing.
const MOST_LEFT_OUT: f64 = 0.1;

/// Rays, how many were left out, and those that hit the triangle that they come from, with each set of instructions.
fn one_triangle(rng: &mut Rng, place: Option<Place>, count: usize, leave: Leave) -> (u64, u64, Vec<u64>) {
    let alone = std::iter::repeat_with(|| {
        let corners = [(); 3].map(|()| Vec3::ZERO.map(|_| rng.decades(-8.0, 8.0)));
        let corners = corners.map(|p| place.map_or(p, |place| place.point(p)));
        let placement = place.map_or_else(|| any_placement(rng), |_| DAffine3::IDENTITY);
        let triangles: Triangles = with_surface([corners].into_iter());
        (!triangles.is_empty()).then(|| Alone::new(mesh(&triangles), placement)).flatten()
    });
    let Some(alone) = alone.flatten().next() else { return (0, 0, Vec::new()) };
    let (rays, left_out) = rays_off(&alone, rng, count, leave);
    let hits = |(_, tracer): (&str, crate::bvh::Tlas)| {
        let answers = ask(&tracer, &rays);
        answers.wrong(&vec![None; rays.len()])
    };
    (rays.len() as u64, left_out, alone.tracers().into_iter().map(hits).collect())
}

/// Turned, scaled by 10⁻⁴ to 10⁴ along each axis, moved by as much.
fn any_placement(rng: &mut Rng) -> DAffine3 {
    let mut decades = || f64::from(rng.decades(-4.0, 4.0));
    let (scale, at) = ([(); 3].map(|()| decades()), [(); 3].map(|()| decades()));
    DAffine3::from_scale_rotation_translation(scale.into(), rng.rotation(), at.into())
}

/// The case for any way of leaving a surface.
#[must_use]
pub fn gaps(trial: &Trial<'_>, leave: Leave) -> Vec<Check> {
    let count = trial.pick(2000, 10_000, 1_000_000) as usize;
    let mut checks = Vec::new();
    for (number, place) in Place::ALL.into_iter().enumerate() {
        trial.tell(GAP.id, place.name(), number as f64 / 10.0);
        checks.extend(smallest_gap(trial, place, count, leave));
    }
    for (number, (scale, shift)) in [(1.0, 0.0), (1.0, 1.0), (1e-3, 0.0), (1e3, 0.0)].into_iter().enumerate()
    {
        trial.tell(GAP.id, "spheres", 0.5 + number as f64 / 8.0);
        checks.extend(spheres(trial, Place { scale, shift }, count, leave));
    }
    checks
}

/// Of two parallel unit squares the smallest distance from which on all rays from the lower one through the upper
/// one are blocked: in floats' steps of the coordinates.
fn smallest_gap(trial: &Trial<'_>, place: Place, count: usize, leave: Leave) -> Vec<Check> {
    let corner = |x: f32, y: f32| place.point(Vec3::new(x, y, 1.0));
    let square = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
    let height = square[0].z;
    let ulp = height.next_up() - height;
    let blocked = |steps: u32| -> Vec<bool> {
        let up = Vec3::Z * (ulp * steps as f32);
        let [a, b, c, d] = square;
        // So large that no ray passes beside it.
        let wide = (b.x - a.x) + 64.0 * up.z;
        let out = |p: Vec3, x: f32, y: f32| p + up + Vec3::new(x * wide, y * wide, 0.0);
        let (e, f, g, h) = (out(a, -1.0, -1.0), out(b, 1.0, -1.0), out(c, 1.0, 1.0), out(d, -1.0, 1.0));
        let triangles = [[a, b, c], [a, c, d], [e, f, g], [e, g, h]];
        let Some(alone) = Alone::new(mesh(&triangles), DAffine3::IDENTITY) else { return Vec::new() };
        let mut rng = Rng::numbered(trial.seed, u64::from(steps));
        let rays: Vec<Ray> = (0..count)
            .map(|i| {
                let (s, t) = (0.25 + 0.25 * rng.unit(), 0.25 + 0.25 * rng.unit());
                let number = (i % 2) as u32;
                let hit = Hit { t: 1.0, u: s, v: t, triangle: number, instance: 0 };
                let mut direction = rng.direction();
                direction.z = direction.z.abs().max(0.02);
                let at = alone.at(&hit, &Ray::new(Vec3::ZERO, -direction));
                Ray::new(leave(&at, direction), direction)
            })
            .collect();
        let upper = |hit: &Hit| hit.triangle >= 2;
        let all = |(_, tracer): (&str, crate::bvh::Tlas)| {
            ask(&tracer, &rays).wrong_by(|_, hit| hit.is_some_and(upper), |_| true) == 0
        };
        alone.tracers().into_iter().map(all).collect()
    };
    // 2⁻¹⁴ of coordinates near 1 are 512 steps of their floats.
    let limit = if place.shift == 0.0 { 512.0 } else { 64.0 };
    let steps = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 128, 256, 512, 1024];
    let all: Vec<Vec<bool>> = steps.iter().map(|&steps| blocked(steps)).collect();
    let check = |(i, isa): (usize, crate::bvh::Isa)| {
        let open = all.iter().rposition(|blocked| !blocked.get(i).copied().unwrap_or(false));
        let least = open.map_or(steps.first(), |open| steps.get(open + 1));
        let ours = least.map_or(f64::INFINITY, |&steps| f64::from(steps));
        let what = format!("smallest gap in ulp, {}, {}", place.name(), isa.name());
        Check::new(what, (steps.len() * count) as u64, "rays", ours, limit)
    };
    crate::bvh::Isa::available().into_iter().enumerate().map(check).collect()
}

/// Spheres of radii 1 and 1 + 4e-5 (Mitsuba's pull request 1871): whatever leaves the inner one meets the outer one.
fn spheres(trial: &Trial<'_>, place: Place, count: usize, leave: Leave) -> Vec<Check> {
    let inner = ball(32);
    let number = inner.triangles.len();
    let mut both = inner.clone();
    both.positions.iter_mut().for_each(|p| *p = place.point(*p));
    both.positions.extend(inner.positions.iter().map(|&p| place.point(p * (1.0 + 4e-5))));
    let vertices = inner.positions.len() as u32;
    both.triangles.extend(inner.triangles.iter().map(|t| t.map(|i| i + vertices)));
    let Some(alone) = Alone::new(both, DAffine3::IDENTITY) else { return Vec::new() };
    let mut rng = Rng::numbered(trial.seed, 6);
    let mut rays = Vec::new();
    while rays.len() < count {
        let triangle = rng.below(number) as u32;
        let toward = rng.direction();
        let (at, direction) = start(&alone, &mut rng, triangle, |_| toward);
        // `front` is seen by who comes against the direction: it leaves to the outside.
        if at.front {
            rays.push(Ray::new(leave(&at, direction), direction));
        }
    }
    let outer = |hit: &Hit| hit.triangle as usize >= number;
    let check = |(name, tracer): (&str, crate::bvh::Tlas)| {
        let leapt = ask(&tracer, &rays).wrong_by(|_, hit| hit.is_some_and(outer), |_| true);
        let place = if place.shift == 1.0 { "at 1".to_owned() } else { place.name() };
        Check::none(format!("spheres, {place}, {name}"), rays.len() as u64, "rays", leapt)
    };
    alone.tracers().into_iter().map(check).collect()
}
