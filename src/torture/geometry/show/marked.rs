//! What rays do wrong, marked red.

use super::super::brute::aimed_ray;
use super::super::exact::{FAMILIES, Shown, judge};
use super::super::leave::{Leave, mesh, rays_off};
use super::super::meshes::{Triangles, bumpy_sphere, knot, needle_tube, soup};
use super::super::{alone::Alone, leaks};
use super::{add, look, marks, opened, outside, shine};
use crate::bvh::{Aabb, Blas, Hit, Ray};
use crate::scene::Material;
use crate::torture::oracle::{Balls, Brute, Maker, Rng, inside, moller_trumbore, truth};
use crate::trace::surface::Interaction;
use bevy_ecs::prelude::*;
use glam::{DAffine3, Vec3};

const HERE: DAffine3 = DAffine3::IDENTITY;

/// Marks at so many of them as can be told apart.
fn mark(world: &mut World, points: &[Vec3], size: f32) {
    let shown: Vec<Vec3> = points.iter().step_by(points.len() / 500 + 1).copied().collect();
    add(world, marks(&shown, size), Material::emissive(Vec3::new(4.0, 0.05, 0.05)), HERE);
}

/// G1 from inside, with very bright light outside, and a red mark where rays leak.
pub(super) fn sphere(world: &mut World, open: bool) -> Vec<String> {
    const RAYS: usize = 400_000;
    let (eye, target) = (Vec3::new(0.4, -0.3, 0.9), Vec3::new(-0.4, 0.2, -1.5));
    let closed = bumpy_sphere();
    let triangles = if open { opened(closed.clone(), eye, target) } else { closed.clone() };
    let blas = Blas::build(&triangles);
    let mut rng = Rng(1);
    let origins = inside(&mut rng, &closed, 61);
    // Of the closed one's edges and corners, turns 1 and 2 of three: they end where they are aimed.
    let rays: Vec<Ray> = (0..RAYS)
        .filter_map(|i| {
            let origin = origins.get(i % origins.len().max(1))?;
            Some(leaks::aimed_out(&mut rng, &closed, *origin, 1 + i % 2))
        })
        .collect();
    let mut hits = vec![None; rays.len()];
    blas.closest_hits(&rays, &mut hits);
    let leaks: Vec<Vec3> =
        rays.iter().zip(&hits).filter(|(_, hit)| hit.is_none()).map(|(ray, _)| ray.at(1.0)).collect();
    let inward: Vec<Vec3> = leaks.iter().map(|p| *p * 0.995).collect();
    mark(world, &inward, 0.012);
    add(world, mesh(&triangles), Material::lambert(Vec3::new(0.55, 0.6, 0.7)), HERE);
    shine(world, Vec3::new(-0.2, 1.1, 0.4), 0.2, 12.0);
    outside(world, 400.0);
    look(world, eye, target);
    vec![format!("{} of {} rays aimed at edges and corners leak", leaks.len(), rays.len())]
}

/// G2: unit triangles, slivers, and rays near edges; marked where exact arithmetic says something else. Open: by the test of
/// textbooks.
pub(super) fn triangles(world: &mut World, open: bool) -> Vec<String> {
    const RAYS: usize = 20_000;
    let maker = if open {
        Maker::new("textbook", |triangles| Brute::new(triangles, moller_trumbore))
    } else {
        Maker::new("ours", Blas::build)
    };
    let mut rng = Rng(2);
    let (mut shown, mut seen, mut wrong) = (Triangles::new(), Shown::default(), Vec::new());
    for i in 0..RAYS {
        let family = FAMILIES[[0, 2, 4][i % 3]];
        let pair = family.pair(&mut rng, crate::torture::Place::ORIGIN);
        let before = seen.wrong;
        judge(&maker, &pair, &mut seen);
        let (ray, corners) = pair;
        let is_wrong = seen.wrong > before;
        if is_wrong {
            let t = truth(&ray, &corners).t;
            wrong.push(ray.at(if t.is_finite() { t as f32 } else { 0.0 }).clamp(-Vec3::ONE, Vec3::ONE));
        }
        if i < 60 || is_wrong && shown.len() < 200 {
            shown.push(corners);
        }
    }
    mark(world, &wrong, 0.012);
    add(world, mesh(&shown), Material::lambert(Vec3::new(0.55, 0.6, 0.7)), HERE);
    shine(world, Vec3::new(2.0, 4.0, 3.0), 0.6, 40.0);
    outside(world, 0.4);
    look(world, Vec3::new(1.2, 1.4, 2.6), Vec3::ZERO);
    vec![format!("{} of {RAYS} rays hit or miss against exact arithmetic", wrong.len())]
}

/// What hits are left by a box that is too small for the first half of the triangles.
fn cut(triangles: &[[Vec3; 3]], ray: &Ray, hit: Option<Hit>) -> Option<Hit> {
    let half = &triangles[..triangles.len() / 2];
    let aabb = half.iter().fold(Aabb::EMPTY, |all, t| all.union(Aabb::around(t)));
    let end = aabb.max.y - 0.05 * (aabb.max.y - aabb.min.y);
    hit.filter(|hit| hit.triangle as usize >= half.len() || ray.at(hit.t).y < end)
}

/// G4: a knot and needles; marked where a hierarchy finds something else than trying every triangle. Open: with a box
/// that is too small.
pub(super) fn boxes(world: &mut World, open: bool) -> Vec<String> {
    const RAYS: usize = 5000;
    let mut triangles = knot(12, 150);
    triangles.extend(needle_tube().into_iter().map(|t| t.map(|p| p * 0.06)));
    let blas = Blas::build(&triangles);
    let balls = Balls::new(&triangles, 10.0);
    let mut rng = Rng(4);
    let mut wrong = Vec::new();
    for _ in 0..RAYS {
        let ray = aimed_ray(&mut rng, &triangles, 4.0, Vec3::ZERO);
        let expected = balls.brute_force(&blas.bounds(), &triangles, &ray);
        let found = blas.closest_hit(&ray);
        let found = if open { cut(&triangles, &ray, found) } else { found };
        if found != expected {
            wrong.extend(expected.or(found).map(|hit| ray.at(hit.t * 0.999)));
        }
    }
    mark(world, &wrong, 0.04);
    add(world, mesh(&triangles), Material::lambert(Vec3::new(0.7, 0.6, 0.4)), HERE);
    shine(world, Vec3::new(5.0, 9.0, 6.0), 1.5, 40.0);
    outside(world, 0.4);
    look(world, Vec3::new(3.0, 4.5, 7.0), Vec3::ZERO);
    vec![format!(
        "{} of {RAYS} rays aimed at corners and edges hit what trying every triangle does not",
        wrong.len()
    )]
}

/// As many do.
fn fixed_epsilon(at: &Interaction, direction: Vec3) -> Vec3 {
    at.position + at.geometric_normal * (1e-4f32).copysign(at.geometric_normal.dot(direction))
}

/// G5: large triangles; marked where a ray hits the one that it leaves. Open: by a fixed epsilon of 1e-4.
pub(super) fn left(world: &mut World, open: bool) -> Vec<String> {
    const SIZE: f32 = 1e4;
    let triangles: Triangles = soup(60, 0.6, 5).into_iter().map(|t| t.map(|p| p * SIZE)).collect();
    let leave: Leave = if open { fixed_epsilon } else { Interaction::origin_toward };
    let mut rng = Rng(5);
    let (mut tried, mut wrong) = (0, Vec::new());
    for corners in &triangles {
        let Some(alone) = Alone::new(mesh(&[*corners]), HERE) else { continue };
        let (rays, _) = rays_off(&alone, &mut rng, 200, leave);
        tried += rays.len();
        let again = rays.iter().filter(|ray| alone.geometry.tlas.closest_hit(ray).is_some());
        wrong.extend(again.map(|ray| ray.origin));
    }
    mark(world, &wrong, 0.012 * SIZE);
    add(world, mesh(&triangles), Material::lambert(Vec3::new(0.55, 0.6, 0.7)), HERE);
    shine(world, Vec3::new(2.0, 4.0, 3.0) * SIZE, 0.6 * SIZE, 40.0);
    outside(world, 0.4);
    look(world, Vec3::new(1.2, 1.4, 2.6) * SIZE, Vec3::ZERO);
    vec![format!("{} of {tried} rays hit the triangle that they leave", wrong.len())]
}
