//! Cases to look at: what leaks shines.

use super::leaks;
use super::leave::mesh;
use super::meshes::{self, Triangles, bumpy_sphere};
use super::stage::{WIDE, ball, cube, quad};
use super::zero::Grid;
use crate::bvh::{Blas, Ray};
use crate::load::Made;
use crate::scene::{ActiveCamera, Camera, Instance, Light, Material, Mesh, Transform, TriangleMesh};
use crate::torture::oracle::{Rng, inside};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// All of them; `-open`: as it looks when it breaks.
pub(super) const SHOWS: &[Made] = &[
    Made { name: "torture:G1", make: |world| sphere(world, false) },
    Made { name: "torture:G1-open", make: |world| sphere(world, true) },
    Made { name: "torture:G3", make: grid },
    Made { name: "torture:G5-gap", make: gap },
    Made { name: "torture:G5-room", make: |world| room(world, false) },
    Made { name: "torture:G5-room-open", make: |world| room(world, true) },
    Made { name: "torture:G9", make: floors },
    Made { name: "torture:G11", make: machine },
];

fn add(world: &mut World, mesh: TriangleMesh, material: Material, place: DAffine3) {
    let mesh = world.spawn(Mesh(Arc::new(mesh))).id();
    let material = world.spawn(material).id();
    world.spawn((Instance { mesh, materials: vec![material] }, Transform(place)));
}

fn look(world: &mut World, eye: Vec3, target: Vec3) {
    let place = Transform::looking_at(eye.as_dvec3(), target.as_dvec3(), DVec3::Y);
    let camera = world.spawn((Camera { projection: WIDE }, place)).id();
    world.insert_resource(ActiveCamera(camera));
}

fn shine(world: &mut World, at: Vec3, radius: f32, radiance: f32) {
    let light = Light::Sphere { radius, radiance: Vec3::splat(radiance) };
    world.spawn((light, Transform::from_translation(at.as_dvec3())));
}

fn outside(world: &mut World, radiance: f32) {
    world.spawn((Light::Environment { radiance: Vec3::splat(radiance) }, Transform::default()));
}

/// The triangles with the one that is seen in the middle made a little smaller.
fn opened(mut triangles: Triangles, eye: Vec3, target: Vec3) -> Triangles {
    if let Some(hit) = Blas::build(&triangles).closest_hit(&Ray::new(eye, target - eye)) {
        let corners = &mut triangles[hit.triangle as usize];
        let center = corners.iter().sum::<Vec3>() / 3.0;
        *corners = corners.map(|p| p.lerp(center, 0.02));
    }
    triangles
}

/// A red octahedron at each of the points.
fn marks(points: &[Vec3], size: f32) -> TriangleMesh {
    let corners = |&p: &Vec3| {
        let [x, y, z] = Vec3::AXES.map(|axis| axis * size);
        let sides = [[x, y], [y, -x], [-x, -y], [-y, x]];
        sides.into_iter().flat_map(move |[a, b]| [[p + a, p + b, p + z], [p + b, p + a, p - z]])
    };
    mesh(&points.iter().flat_map(corners).collect::<Triangles>())
}

/// G1 from inside, with very bright light outside, and a red mark where rays leak.
fn sphere(world: &mut World, open: bool) -> Vec<String> {
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
    let shown: Vec<Vec3> = leaks.iter().step_by(leaks.len() / 500 + 1).map(|p| *p * 0.995).collect();
    add(world, marks(&shown, 0.012), Material::emissive(Vec3::new(4.0, 0.05, 0.05)), DAffine3::IDENTITY);
    add(world, mesh(&triangles), Material::lambert(Vec3::new(0.55, 0.6, 0.7)), DAffine3::IDENTITY);
    shine(world, Vec3::new(-0.2, 1.1, 0.4), 0.2, 12.0);
    outside(world, 400.0);
    look(world, eye, target);
    vec![format!("{} of {} rays aimed at edges and corners leak", leaks.len(), rays.len())]
}

/// G3: cubes of whole numbers.
fn grid(world: &mut World) -> Vec<String> {
    let triangles = Grid::cubes(|cube| cube.element_sum() % 3 == 1).triangles();
    add(world, mesh(&triangles), Material::default(), DAffine3::IDENTITY);
    shine(world, Vec3::new(14.0, 18.0, 4.0), 2.0, 60.0);
    outside(world, 0.3);
    look(world, Vec3::new(17.0, 13.0, 15.0), Vec3::splat(3.5));
    vec!["cubes whose faces rays along axes and diagonals pass in their planes".to_owned()]
}

/// G5: a square as near above another as 2⁻¹⁴, and what stands on a floor.
fn gap(world: &mut World) -> Vec<String> {
    let square = |size: f32, height: f32| {
        quad(Vec3::new(-size, height, -size), Vec3::Z * 2.0 * size, Vec3::X * 2.0 * size)
    };
    add(world, square(2.0, 0.0), Material::default(), DAffine3::IDENTITY);
    add(world, square(0.5, 2f32.powi(-14)), Material::lambert(Vec3::new(0.7, 0.3, 0.2)), DAffine3::IDENTITY);
    let beside =
        DAffine3::from_translation(DVec3::new(-1.0, 0.4, -0.6)) * DAffine3::from_scale(DVec3::splat(0.4));
    add(world, ball(24), Material::default(), beside);
    shine(world, Vec3::new(1.0, 2.0, 1.0), 0.3, 25.0);
    look(world, Vec3::new(0.6, 1.4, 2.6), Vec3::new(-0.1, 0.0, 0.0));
    vec!["a square 2^-14 above the floor: no light gets below it, and none of it is lost".to_owned()]
}

/// G5: all is black inside, however bright it is outside.
fn room(world: &mut World, open: bool) -> Vec<String> {
    let (eye, target) = (Vec3::new(0.3, -0.2, 0.4), Vec3::new(-1.0, 0.5, -1.2));
    let room = cube();
    let walls: Triangles = (0..room.triangles.len()).map(|i| room.corners(i)).collect();
    let walls = if open { opened(walls, eye, target) } else { walls };
    add(world, mesh(&walls), Material::default(), DAffine3::IDENTITY);
    shine(world, Vec3::new(-4.0, 1.0, 2.0), 0.5, 1000.0);
    outside(world, 100.0);
    look(world, eye, target);
    vec!["a closed room lit from outside only: black".to_owned()]
}

/// G9: floors of three colours in one place.
fn floors(world: &mut World) -> Vec<String> {
    add(world, cube(), Material::lambert(Vec3::splat(0.7)), DAffine3::from_translation(DVec3::Y));
    for color in [Vec3::new(0.8, 0.1, 0.1), Vec3::new(0.1, 0.8, 0.1), Vec3::new(0.1, 0.1, 0.8)] {
        let floor = quad(Vec3::new(-1.0, 0.125, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
        add(world, floor, Material::lambert(color), DAffine3::IDENTITY);
    }
    shine(world, Vec3::new(0.0, 1.7, 0.0), 0.1, 40.0);
    look(world, Vec3::new(0.2, 1.4, 0.9), Vec3::new(0.0, 0.2, 0.0));
    vec!["floors of three colours in one place: one of them is seen, everywhere".to_owned()]
}

/// G11: instances turned, stretched and mirrored.
fn machine(world: &mut World) -> Vec<String> {
    let parts = [meshes::knot(12, 150), bumpy_sphere(), meshes::squared_cube()].map(|t| Arc::new(mesh(&t)));
    let parts = parts.map(|part| world.spawn(Mesh(part)).id());
    let materials = [Vec3::new(0.7, 0.6, 0.4), Vec3::new(0.4, 0.5, 0.7), Vec3::splat(0.7)]
        .map(|color| world.spawn(Material::lambert(color)).id());
    let mut rng = Rng(11);
    for i in 0..40 {
        let scale = DVec3::new(1.0, 0.3, if i % 3 == 0 { -2.0 } else { 1.5 }) * 0.7;
        let at = rng.vec().as_dvec3() * 8.0;
        let place = DAffine3::from_scale_rotation_translation(scale, rng.rotation(), at);
        world.spawn((Instance { mesh: parts[i % 3], materials: vec![materials[i % 3]] }, Transform(place)));
    }
    shine(world, Vec3::new(8.0, 16.0, 10.0), 3.0, 40.0);
    outside(world, 0.4);
    look(world, Vec3::new(14.0, 9.0, 16.0), Vec3::ZERO);
    vec!["instances turned, stretched and mirrored".to_owned()]
}
