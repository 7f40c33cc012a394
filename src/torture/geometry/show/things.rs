//! Things that are hard to get right.

use super::super::degenerate::scenes;
use super::super::meshes::{self, Triangles, bumpy_sphere};
use super::super::stage::{ball, cube, quad};
use super::super::worst::kinds;
use super::super::{leave::mesh, zero::Grid};
use super::{add, look, opened, outside, shine};
use crate::bvh::Aabb;
use crate::scene::{Instance, Light, Material, Mesh, Transform};
use crate::torture::oracle::Rng;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, Vec3};
use std::sync::Arc;

const HERE: DAffine3 = DAffine3::IDENTITY;

/// G3: cubes of whole numbers.
pub(super) fn grid(world: &mut World) -> Vec<String> {
    let triangles = Grid::cubes(|cube| cube.element_sum() % 3 == 1).triangles();
    add(world, mesh(&triangles), Material::default(), HERE);
    shine(world, Vec3::new(14.0, 18.0, 4.0), 2.0, 60.0);
    outside(world, 0.3);
    look(world, Vec3::new(17.0, 13.0, 15.0), Vec3::splat(3.5));
    vec!["cubes whose faces rays along axes and diagonals pass in their planes".to_owned()]
}

/// G5: a square as near above another as 2⁻¹⁴, and what stands on a floor.
pub(super) fn gap(world: &mut World) -> Vec<String> {
    let square = |size: f32, height: f32| {
        quad(Vec3::new(-size, height, -size), Vec3::Z * 2.0 * size, Vec3::X * 2.0 * size)
    };
    add(world, square(2.0, 0.0), Material::default(), HERE);
    add(world, square(0.5, 2f32.powi(-14)), Material::lambert(Vec3::new(0.7, 0.3, 0.2)), HERE);
    let beside =
        DAffine3::from_translation(DVec3::new(-1.0, 0.4, -0.6)) * DAffine3::from_scale(DVec3::splat(0.4));
    add(world, ball(24), Material::default(), beside);
    shine(world, Vec3::new(1.0, 2.0, 1.0), 0.3, 25.0);
    look(world, Vec3::new(0.6, 1.4, 2.6), Vec3::new(-0.1, 0.0, 0.0));
    vec!["a square 2^-14 above the floor: no light gets below it, and none of it is lost".to_owned()]
}

/// G5: all is black inside, however bright it is outside.
pub(super) fn room(world: &mut World, open: bool) -> Vec<String> {
    let (eye, target) = (Vec3::new(0.3, -0.2, 0.4), Vec3::new(-1.0, 0.5, -1.2));
    let room = cube();
    let walls: Triangles = (0..room.triangles.len()).map(|i| room.corners(i)).collect();
    let walls = if open { opened(walls, eye, target) } else { walls };
    add(world, mesh(&walls), Material::default(), HERE);
    shine(world, Vec3::new(-4.0, 1.0, 2.0), 0.5, 1000.0);
    outside(world, 100.0);
    look(world, eye, target);
    vec!["a closed room lit from outside only: black".to_owned()]
}

/// G9: floors of three colours in one place.
pub(super) fn floors(world: &mut World) -> Vec<String> {
    add(world, cube(), Material::lambert(Vec3::splat(0.7)), DAffine3::from_translation(DVec3::Y));
    for color in [Vec3::new(0.8, 0.1, 0.1), Vec3::new(0.1, 0.8, 0.1), Vec3::new(0.1, 0.1, 0.8)] {
        let floor = quad(Vec3::new(-1.0, 0.125, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
        add(world, floor, Material::lambert(color), HERE);
    }
    shine(world, Vec3::new(0.0, 1.7, 0.0), 0.1, 40.0);
    look(world, Vec3::new(0.2, 1.4, 0.9), Vec3::new(0.0, 0.2, 0.0));
    vec!["floors of three colours in one place: one of them is seen, everywhere".to_owned()]
}

/// G11: instances turned, stretched and mirrored.
pub(super) fn machine(world: &mut World) -> Vec<String> {
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

/// G6: two lamps at height 4; one has an occluder 4e-5 before it, the other as much behind it.
pub(super) fn occluders(world: &mut World) -> Vec<String> {
    let level = |size: f32, at: Vec3| {
        quad(at - Vec3::new(size, 0.0, size), Vec3::Z * 2.0 * size, Vec3::X * 2.0 * size)
    };
    add(world, level(4.0, Vec3::ZERO), Material::default(), HERE);
    let wall = quad(Vec3::new(0.0, 0.0, -4.0), Vec3::Y * 9.0, Vec3::Z * 8.0);
    add(world, wall, Material::lambert(Vec3::ZERO), HERE);
    for (x, gap) in [(-2.0, -4e-5), (2.0, 4e-5)] {
        let black = Material { double_sided: true, ..Material::lambert(Vec3::ZERO) };
        add(world, level(1.0, Vec3::new(x, 4.0 + gap, 0.0)), black, HERE);
        let radiance = [Vec3::splat(8.0); 4];
        let lamp = Light::Parallelogram { edge_u: Vec3::X, edge_v: Vec3::Z, radiance, two_sided: true };
        world.spawn((lamp, Transform::from_translation(DVec3::new(f64::from(x), 4.0, 0.0))));
    }
    look(world, Vec3::new(0.0, 2.5, 8.0), Vec3::new(0.0, 0.8, 0.0));
    vec![
        "black on the left, where an occluder is 4e-5 before the lamp; lit on the right, where it is behind"
            .to_owned(),
    ]
}

/// G8: what files have been seen to hold, as far as it can be seen, each beside a ball.
pub(super) fn degenerate(world: &mut World) -> Vec<String> {
    let mut names = Vec::new();
    let seen = ["an index twice", "slivers", "no area", "flattened"];
    for scene in scenes().into_iter().filter(|scene| seen.contains(&scene.name)) {
        let at = DAffine3::from_translation(DVec3::X * (4.0 * names.len() as f64 - 6.0));
        add(world, scene.mesh, scene.material, at * scene.place);
        let beside = DVec3::new(0.0, -1.6, 1.2);
        add(
            world,
            ball(8),
            Material::default(),
            at * DAffine3::from_scale_rotation_translation(DVec3::splat(0.5), Default::default(), beside),
        );
        names.push(scene.name);
    }
    shine(world, Vec3::new(4.0, 12.0, 10.0), 2.0, 40.0);
    outside(world, 0.4);
    look(world, Vec3::new(0.0, 4.0, 18.0), Vec3::ZERO);
    vec![format!("from left to right: {}", names.join(", "))]
}

/// G10: triangles that hierarchies are bad at, a thousand of each kind.
pub(super) fn worst(world: &mut World) -> Vec<String> {
    let mut names = Vec::new();
    for (name, triangles) in kinds(1000).into_iter().filter(|(name, _)| *name != "far corner") {
        let around = triangles.iter().fold(Aabb::EMPTY, |all, t| all.union(Aabb::around(t)));
        let size = (around.max - around.min).max_element();
        let i = names.len() as f32;
        let at = Vec3::new((i % 4.0) * 2.5 - 3.75, 1.25 - 2.5 * (i / 4.0).floor(), 0.0);
        let there: Triangles =
            triangles.iter().map(|t| t.map(|p| (p - around.center()) * (2.0 / size) + at)).collect();
        let color = Vec3::new(0.4 + 0.05 * i, 0.6, 0.8 - 0.05 * i);
        add(world, mesh(&there), Material { double_sided: true, ..Material::lambert(color) }, HERE);
        names.push(name);
    }
    shine(world, Vec3::new(3.0, 6.0, 10.0), 1.5, 40.0);
    outside(world, 0.5);
    look(world, Vec3::new(0.0, 1.0, 9.0), Vec3::ZERO);
    vec![format!("in two rows: {}; the kind with a corner at 3e38 has no picture", names.join(", "))]
}
