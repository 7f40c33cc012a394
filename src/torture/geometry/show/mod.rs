//! Cases to look at: what leaks shines, and what is wrong is marked red.

mod cameras;
mod marked;
mod things;

use super::leave::mesh;
use super::meshes::Triangles;
use super::stage::WIDE;
use crate::bvh::{Blas, Ray};
use crate::load::Made;
use crate::scene::{ActiveCamera, Camera, Instance, Light, Material, Mesh, Transform, TriangleMesh};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

/// All of them; `-open`: as it looks when it breaks.
pub(in crate::torture) const SHOWS: &[Made] = &[
    Made { name: "torture:G1", make: |world| marked::sphere(world, false) },
    Made { name: "torture:G1-open", make: |world| marked::sphere(world, true) },
    Made { name: "torture:G2", make: |world| marked::triangles(world, false) },
    Made { name: "torture:G2-open", make: |world| marked::triangles(world, true) },
    Made { name: "torture:G3", make: things::grid },
    Made { name: "torture:G4", make: |world| marked::boxes(world, false) },
    Made { name: "torture:G4-open", make: |world| marked::boxes(world, true) },
    Made { name: "torture:G5", make: |world| marked::left(world, false) },
    Made { name: "torture:G5-open", make: |world| marked::left(world, true) },
    Made { name: "torture:G5-gap", make: things::gap },
    Made { name: "torture:G5-room", make: |world| things::room(world, false) },
    Made { name: "torture:G5-room-open", make: |world| things::room(world, true) },
    Made { name: "torture:G6", make: things::occluders },
    Made { name: "torture:G7", make: |world| cameras::far(world, false) },
    Made { name: "torture:G7-open", make: |world| cameras::far(world, true) },
    Made { name: "torture:G8", make: things::degenerate },
    Made { name: "torture:G9", make: things::floors },
    Made { name: "torture:G10", make: things::worst },
    Made { name: "torture:G11", make: things::machine },
    Made { name: "torture:C1", make: cameras::wide },
    Made { name: "torture:C2", make: cameras::on_a_face },
    Made { name: "torture:C3", make: cameras::lamps },
    Made { name: "torture:C4", make: cameras::flat },
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
