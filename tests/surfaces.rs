//! What a hit is made into: normals of slivers and of placed spheres, narrow gaps, pictures without a NaN.
#![allow(clippy::duplicate_mod, reason = "two of the modules below use the same random numbers")]

#[path = "support/alone.rs"]
mod alone;
#[path = "support/geometry.rs"]
mod geometry;
#[path = "support/stage.rs"]
mod stage;

use alone::Alone;
use geometry::{Rng, shared};
use glam::{DAffine3, DVec3, UVec2, Vec3};
use penumbra::app::{FrameBudget, FrameStats};
use penumbra::bvh::{Hit, Isa, Ray};
use penumbra::load::{LoadOptions, SceneSource};
use penumbra::open::{Wishes, open};
use penumbra::scene::TriangleMesh;
use penumbra::trace::Film;
use stage::ball;

/// A million long, a millionth wide.
#[test]
fn a_sliver_has_its_normal() {
    let corners = [Vec3::ZERO, Vec3::new(1e6, 0.0, 0.0), Vec3::new(5e5, 1e-6, 0.0)];
    let mesh = TriangleMesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Default::default() };
    let alone = Alone::new(mesh, DAffine3::IDENTITY).unwrap();
    for (from, normal) in [(1.0, Vec3::Z), (-1.0, Vec3::NEG_Z)] {
        let ray = Ray::new(Vec3::new(5e5, 2.5e-7, from), Vec3::new(0.0, 0.0, -from));
        for isa in Isa::available() {
            let hit = alone.geometry.tlas.clone().with_isa(isa).closest_hit(&ray).expect("its middle");
            let at = alone.at(&hit, &ray);
            assert!((at.geometric_normal - normal).length() < 1e-6, "{at:?}");
            assert!((at.normal - normal).length() < 1e-6, "{at:?}");
        }
    }
}

/// The ellipsoid's own normal at the point that the sphere's parameters give, also where it is turned inside out.
#[test]
fn a_stretched_sphere_has_the_normals_of_its_ellipsoid() {
    let mut mesh = ball(24);
    mesh.normals = mesh.positions.iter().map(|p| p.normalize()).collect();
    let mut rng = Rng(5);
    let mut worst = 0.0f64;
    for scale in [DVec3::new(3.0, 1.0, 0.2), DVec3::new(-3.0, 1.0, 0.2), DVec3::new(3.0, -1.0, -0.2)] {
        let alone = Alone::new(mesh.clone(), DAffine3::from_scale(scale)).unwrap();
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
                assert!(at.front, "{scale}: {triangle}");
                worst = worst.max((at.normal.as_dvec3() - expected).length());
                let behind = alone.at(&hit, &Ray::new(Vec3::ZERO, expected.as_vec3()));
                assert!(!behind.front);
                worst = worst.max((behind.normal.as_dvec3() + expected).length());
            }
        }
    }
    println!("normals are off by at most {worst:.1e}");
    assert!(worst < 1e-5);
}

/// Spheres of radii 1 and 1 + 4e-5, at the origin and at 1: whatever leaves the inner one meets the outer one.
#[test]
fn no_ray_leaps_over_the_gap_between_spheres() {
    for shift in [Vec3::ZERO, Vec3::ONE] {
        let mut mesh = ball(32);
        let count = mesh.triangles.len();
        let vertices = mesh.positions.len() as u32;
        let outer: Vec<Vec3> = mesh.positions.iter().map(|&p| p * (1.0 + 4e-5) + shift).collect();
        mesh.positions.iter_mut().for_each(|p| *p += shift);
        mesh.positions.extend(outer);
        mesh.triangles.extend(mesh.triangles.clone().iter().map(|t| t.map(|i| i + vertices)));
        let mut alone = Alone::new(mesh, DAffine3::IDENTITY).unwrap();
        let mut rng = Rng(6);
        let mut rays = Vec::new();
        for _ in 0..200_000 {
            let s = rng.unit().sqrt();
            let v = s * rng.unit();
            let hit = Hit { t: 1.0, u: 1.0 - s, v, triangle: rng.below(count) as u32, instance: 0 };
            let mut direction = rng.direction();
            let inward = alone.at(&hit, &Ray::new(Vec3::ZERO, direction));
            if inward.front {
                direction = -direction;
            }
            let at = alone.at(&hit, &Ray::new(Vec3::ZERO, -direction));
            rays.push(Ray::new(at.origin_toward(direction), direction));
        }
        for isa in Isa::available() {
            alone.geometry.tlas = alone.geometry.tlas.with_isa(isa);
            let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
            let all = None::<&fn(usize, &Hit) -> bool>;
            alone.geometry.tlas.closest_hits(&rays, &mut hits, all);
            alone.geometry.tlas.any_hits(&rays, &mut blocked, all);
            let leapt = blocked.iter().filter(|&&blocked| !blocked).count();
            let back = hits.iter().filter(|h| h.is_none_or(|h| (h.triangle as usize) < count)).count();
            assert_eq!((leapt, back), (0, 0), "at {shift}, {}", isa.name());
        }
    }
}

fn picture(path: std::path::PathBuf) -> Result<Film, String> {
    let wishes = Wishes { size: Some(UVec2::new(32, 24)), ..Wishes::default() };
    let mut opened = open(&SceneSource::File(path), &LoadOptions::default(), &wishes)
        .map_err(|error| error.to_string())?;
    opened.app.world.resource_mut::<FrameBudget>().sample_target = 4;
    loop {
        opened.app.frame();
        if opened.app.world.resource::<FrameStats>().done {
            break;
        }
    }
    Ok(opened.app.world.resource::<Film>().clone())
}

/// Slivers, triangles without area, 12 orders of magnitude in one object: no pixel that is no number. Areas are
/// compared with the table in `shared_scenes.rs`.
#[test]
fn no_pixel_of_a_degenerate_scene_is_no_number() {
    let Some(shared) = shared("no_pixel_of_a_degenerate_scene_is_no_number") else {
        return;
    };
    let mut seen = 0;
    for file in [
        "bad-input/own/index_degenerate.gltf",
        "bad-input/own/position_denormal.gltf",
        "bad-input/own/scale_zero_axis.gltf",
        "bad-input/own/scale_1e-20.gltf",
        "bad-input/own/scale_mixed.gltf",
        "bad-input/own/position_1e30.gltf",
        "scenes/obj/legocar/legocar.obj",
        "scenes/obj/kitchen/kitchen.obj",
        "scenes/obj/capsule/capsule.obj",
    ] {
        let film = match picture(shared.join(file)) {
            Ok(film) => film,
            Err(refused) => {
                println!("{file}: refused: {refused}");
                assert!(file.contains("position_"), "only these may be refused");
                continue;
            }
        };
        let size = film.size();
        let means = (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y)));
        let means: Vec<DVec3> = means.map(|(x, y)| film.pixel(x, y).mean()).collect();
        assert_eq!(film.dropped(), 0, "{file}: samples that are not finite");
        assert!(means.iter().all(|mean| mean.is_finite() && mean.min_element() >= 0.0), "{file}");
        let lit = means.iter().filter(|mean| mean.max_element() > 0.0).count();
        println!("{file}: {lit} of {} pixels are lit", means.len());
        seen += usize::from(lit > 0);
    }
    assert!(seen >= 5, "{seen} pictures are not black");
}
