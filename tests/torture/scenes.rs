//! G and C: pictures, cameras, indices and hierarchies that are a little wrong.

use crate::geometry::{finds, quick, sabotaged};
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use penumbra::bvh::wide::{WIDTH, WideNode};
use penumbra::bvh::{Blas, Hit, Isa, Ray, WideBvh};
use penumbra::scene::{Light, Material, Transform, TriangleMesh};
use penumbra::torture::geometry::degenerate::Degenerate;
use penumbra::torture::geometry::stage::{Stage, WIDE};
use penumbra::torture::geometry::{camera, counts, degenerate, exact, leave, ties, worst};
use penumbra::torture::{Check, Place};
use std::collections::HashMap;

#[test]
fn a_pixel_that_is_no_number_is_found() {
    let mut scenes = degenerate::scenes();
    scenes.truncate(1);
    scenes[0].material = Material::emissive(Vec3::NAN);
    finds(
        &quick(|trial| degenerate::pictures(trial, &scenes, degenerate::picture)),
        "an index twice, origin",
    );
}

#[test]
fn things_that_are_not_drawn_are_found() {
    let nothing = |scene: &Degenerate, place: Place, isa: Isa, samples: u32| {
        let (mesh, material) = (TriangleMesh::default(), Material::default());
        degenerate::picture(
            &Degenerate { mesh, material, name: scene.name, place: scene.place },
            place,
            isa,
            samples,
        )
    };
    let checks = quick(|trial| degenerate::pictures(trial, &degenerate::scenes(), nothing));
    for what in ["an index twice", "positions of 1e30", "24 orders", "flattened", "scaled by 1e-6"] {
        finds(&checks, &format!("Thing seen: {what}"));
    }
    // Of no area there is nothing to see.
    assert!(!checks.iter().any(|check| check.what.contains("Thing seen: no area")));
    let blind = |_: &Degenerate, place: Place, isa: Isa, samples: u32| {
        let mut stage = Stage::new(32, 24, place.transform()).with_isa(isa);
        stage.add(Light::Environment { radiance: Vec3::ONE }, DAffine3::IDENTITY);
        stage.look(DVec3::Z, DVec3::ZERO, DVec3::Y, WIDE);
        stage.picture(samples)
    };
    finds(&quick(|trial| degenerate::pictures(trial, &degenerate::scenes(), blind)), "Ball seen: slivers");
}

/// Of a triangle by its corners; one that is smaller than a fixed epsilon has none of its own.
#[test]
fn a_fixed_epsilon_for_areas_is_found() {
    let checks = degenerate::normals(|at, [a, b, c]| {
        let across = (b - a).cross(c - a);
        let normal = if across.length() < 1e-5 { Vec3::Y } else { across.normalize() };
        [at.geometric_normal, normal * normal.dot(at.wo).signum()]
    });
    finds(&checks, "times 1e-3");
    assert!(checks.iter().filter(|check| check.what.contains("origin")).all(Check::holds));
    finds(&degenerate::normals(|at, _| [Vec3::NAN, at.normal]), "normal of a sliver");
}

#[test]
fn floors_of_which_another_is_seen_are_found() {
    let last = |meshes: &[&[Vec3]], threads: usize, place: Place, samples: u32| {
        let turned = |colors: &&[Vec3]| colors.iter().rev().copied().collect();
        let turned: Vec<Vec<Vec3>> = meshes.iter().map(turned).collect();
        let turned: Vec<&[Vec3]> = turned.iter().map(Vec::as_slice).collect();
        ties::floor(&turned, threads, place, samples)
    };
    finds(&quick(|trial| ties::floors(trial, last)), "doubled floor");
    let by_threads = |meshes: &[&[Vec3]], threads: usize, place: Place, samples: u32| match threads {
        8 => last(meshes, threads, place, samples),
        _ => ties::floor(meshes, threads, place, samples),
    };
    finds(&quick(|trial| ties::floors(trial, by_threads)), "doubled floor");
}

#[test]
fn builds_that_compare_all_of_one_centroid_are_found() {
    let pairs = |triangles: &[[Vec3; 3]]| {
        let (mut centers, mut equal) = (HashMap::<[u32; 3], Vec<usize>>::new(), 0);
        for (i, triangle) in triangles.iter().enumerate() {
            let center = triangle.iter().sum::<Vec3>().to_array().map(f32::to_bits);
            let others = centers.entry(center).or_default();
            equal += others.iter().filter(|other| triangles[**other] == *triangle).count();
            others.push(i);
        }
        (Blas::build(triangles), equal)
    };
    finds(&quick(|trial| worst::times(trial, &worst::kinds(8000), pairs)), "random: equal");
}

/// Machines are shared: what takes too long is timed again, up to ten times.
#[test]
fn the_worst_triangles_are_built_in_time() {
    let kinds = worst::kinds(20_000);
    let in_time = |_| {
        let checks = quick(|trial| worst::times(trial, &kinds, Blas::build));
        let late: Vec<_> = checks.iter().filter(|check| !check.holds()).collect();
        println!("{late:#?}");
        late.is_empty()
    };
    assert!((0..10).any(in_time));
}

#[test]
fn a_hierarchy_that_is_a_list_is_found() {
    let node = |child: u32| {
        let mut bounds = [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3];
        bounds.iter_mut().for_each(|[low, high]| (low[0], high[0]) = (0.0, 1.0));
        let mut children = [0; WIDTH];
        children[0] = child;
        WideNode { bounds, children, orders: [0; 8] }
    };
    let list = |n: u32| {
        // The last holds a leaf.
        let nodes = (1..n).chain([1 << 31]).map(node).collect();
        WideBvh { nodes, ..WideBvh::default() }
    };
    assert!(worst::shallow("44 nodes", 4, &list(44)).holds());
    assert!(!worst::shallow("45 nodes", 4, &list(45)).holds());
}

#[test]
fn directions_that_are_not_unit_are_found() {
    let long = |viewpoint: &penumbra::trace::Viewpoint, point, size| {
        let ray = viewpoint.ray(point, size);
        Ray { direction: ray.direction * (1.0 + 8.0 * f32::EPSILON), ..ray }
    };
    let checks = quick(|trial| camera::rays(trial, long));
    finds(&checks, "ulp off in length: 45 degrees");
    finds(&checks, "ε off in direction: 45 degrees");
}

/// As textbooks have it, and turned: nothing is across where up is along the view.
fn textbook(eye: DVec3, target: DVec3, up: DVec3) -> DAffine3 {
    let forward = (target - eye).normalize();
    let right = forward.cross(up).normalize();
    let turn = DQuat::from_mat3(&DMat3::from_cols(right, right.cross(forward), -forward));
    DAffine3::from_rotation_translation(turn, eye)
}

#[test]
fn eyes_that_look_elsewhere_are_found() {
    finds(&quick(|trial| camera::places(trial, textbook)), "up along the view");
    // Who has a near plane looks through what is before it.
    let near_plane = |eye: DVec3, target: DVec3, up: DVec3| {
        let forward = 1.5 * (target - eye).normalize();
        Transform::looking_at(eye + forward, target + forward, up).0
    };
    finds(&quick(|trial| camera::places(trial, near_plane)), "inside");
    // Who has a camera that is no number sees one colour.
    let nowhere = |_, _, _| DAffine3::from_translation(DVec3::NAN);
    finds(&quick(|trial| camera::places(trial, nowhere)), "inside");
}

#[test]
fn a_triangle_too_few_or_too_many_is_found() {
    let few = |mut mesh: TriangleMesh, place: Place, isa: Isa, samples: u32| {
        mesh.triangles.pop();
        counts::picture(mesh, place, isa, samples)
    };
    finds(&quick(|trial| counts::few(trial, few)), "one triangle");
    let many = |mesh: TriangleMesh, place: Place, isa: Isa, samples: u32| {
        let ghost = leave::mesh(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
        counts::picture(if mesh.triangles.is_empty() { ghost } else { mesh }, place, isa, samples)
    };
    finds(&quick(|trial| counts::few(trial, many)), "no triangle");
}

#[test]
fn lights_that_are_never_quite_off_are_found() {
    finds(&quick(|trial| counts::lights(trial, |intensity| intensity.max(1e-6))), "lights that are off");
}

#[test]
fn indices_kept_in_floats_are_found() {
    let checks = quick(|trial| {
        counts::many(
            trial,
            &sabotaged(|_, _, hit| hit.map(|hit| Hit { triangle: hit.triangle as f32 as u32, ..hit })),
        )
    });
    finds(&checks, "2^24 + 3 triangles");
    finds(&quick(|trial| counts::extents(trial, &sabotaged(|_, _, _| None))), "a plane");
    let whatever =
        |_: &[[Vec3; 3]], _: &Ray, _| Some(Hit { t: 1.0, u: 0.5, v: 0.25, triangle: 0, instance: 0 });
    let checks = quick(|trial| counts::extents(trial, &sabotaged(whatever)));
    finds(&checks, "a point");
    finds(&checks, "a line");
    finds(&quick(|trial| exact::run(trial, &sabotaged(whatever))), "pbrt's triangle");
}
