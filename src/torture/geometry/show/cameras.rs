//! Places far away, cameras at their ends, and what hardly has an extent.

use super::super::leave::mesh;
use super::super::meshes::knot;
use super::super::stage::{cube, quad};
use super::super::zero::Grid;
use super::{add, look, outside, shine};
use crate::scene::{ActiveCamera, Camera, Instance, Light, Material, Mesh, Projection, Transform};
use crate::sync::RenderOrigin;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

const HERE: DAffine3 = DAffine3::IDENTITY;

/// G7: a knot in a room at 1e6. Open: seen from the world's origin, as who keeps its coordinates sees it.
pub(super) fn far(world: &mut World, open: bool) -> Vec<String> {
    const AT: DVec3 = DVec3::splat(1e6);
    if open {
        world.insert_resource(RenderOrigin(Some(DVec3::ZERO)));
    }
    let there = DAffine3::from_translation(AT);
    let room = there * DAffine3::from_scale(DVec3::splat(4.0));
    add(world, cube(), Material { double_sided: true, ..Material::default() }, room);
    add(world, mesh(&knot(12, 150)), Material::lambert(Vec3::new(0.7, 0.6, 0.4)), there);
    let light = Light::Sphere { radius: 0.5, radiance: Vec3::splat(20.0) };
    world.spawn((light, Transform::from_translation(AT + DVec3::new(1.0, 3.2, 2.0))));
    let place = Transform::looking_at(AT + DVec3::new(2.0, 1.5, 3.7), AT, DVec3::Y);
    let camera = world.spawn((Camera { projection: super::WIDE }, place)).id();
    world.insert_resource(ActiveCamera(camera));
    vec![format!(
        "a knot in a room at 1e6{}",
        if open { ", where floats have steps of a sixteenth" } else { ": as at the origin" }
    )]
}

/// C1: cubes by a camera of 179.9 degrees.
pub(super) fn wide(world: &mut World) -> Vec<String> {
    let triangles = Grid::cubes(|cube| cube.element_sum() % 3 == 1).triangles();
    add(world, mesh(&triangles), Material::default(), HERE);
    shine(world, Vec3::new(14.0, 18.0, 4.0), 2.0, 60.0);
    outside(world, 0.3);
    let projection = Projection::Perspective { vertical_fov: 179.9 * std::f32::consts::PI / 180.0 };
    let place = Transform::looking_at(DVec3::new(4.1, 4.2, 8.01), DVec3::splat(3.5), DVec3::Y);
    let camera = world.spawn((Camera { projection }, place)).id();
    world.insert_resource(ActiveCamera(camera));
    vec!["a field of view of 179.9 degrees; one of 1e-6 would show one colour".to_owned()]
}

/// C2: an eye on a face of a cube, looking along it.
pub(super) fn on_a_face(world: &mut World) -> Vec<String> {
    add(world, cube(), Material { emission: Vec3::splat(0.1), ..Material::default() }, HERE);
    outside(world, 1.0);
    look(world, Vec3::new(1.0, 0.2, 0.3), Vec3::new(1.0, 0.2, -0.7));
    vec!["an eye exactly on a face, looking along it: half of the picture is sky".to_owned()]
}

/// C3: one lamp that is on among 10,000 that are off.
pub(super) fn lamps(world: &mut World) -> Vec<String> {
    const OFF: u32 = 10_000;
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    add(world, floor, Material::default(), HERE);
    for i in 0..=OFF {
        let angle = 0.001 * f64::from(i);
        let at = DVec3::new(angle.cos(), 1.0 + 1e-5 * f64::from(i), angle.sin());
        let intensity = Vec3::splat(if i == OFF / 2 { 3.0 } else { 0.0 });
        world.spawn((Light::Point { intensity }, Transform::from_translation(at)));
    }
    look(world, Vec3::new(0.3, 1.5, 2.2), Vec3::ZERO);
    vec![format!("one lamp that is on among {OFF} that are off; indices beyond 2^24 have no picture")]
}

/// C4: a flat square; a hundred triangles in a point and on a line are there too, and cannot be seen.
pub(super) fn flat(world: &mut World) -> Vec<String> {
    let square = quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0);
    let point = vec![[Vec3::new(1.5, 0.25, 0.0); 3]; 100];
    let line: Vec<_> =
        (0..100).map(|i| [0, 1, 2].map(|k| Vec3::new(-1.5 + (i + k) as f32 * 0.03, 1.5, 0.0))).collect();
    let material = world.spawn(Material { double_sided: true, ..Material::default() }).id();
    for mesh in [square, mesh(&point), mesh(&line)] {
        let mesh = world.spawn(Mesh(Arc::new(mesh))).id();
        world.spawn((Instance { mesh, materials: vec![material] }, Transform(HERE)));
    }
    outside(world, 1.0);
    shine(world, Vec3::new(1.0, 2.0, 2.0), 0.3, 20.0);
    look(world, Vec3::new(0.6, 0.8, 3.4), Vec3::new(0.2, 0.2, 0.0));
    vec!["a flat square is seen; triangles in a point to the right and on a line above it are not".to_owned()]
}
