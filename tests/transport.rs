//! Energy on its way from surface to surface: two estimators of one thing, lights of no use.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test shows its figures, and fails at the first wrong one"
)]

#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DVec3, Vec2, Vec3};
use penumbra::bvh::Ray;
use penumbra::scene::{Glossy, Light, Material, TriangleMesh};
use penumbra::trace::bsdf::Lobes;
use penumbra::trace::emitter::Receiver;
use penumbra::trace::light::FlatLight;
use penumbra::trace::surface::Interaction;
use penumbra::trace::{Integrator, Lights};
use stage::{Estimate, Frames as _, Rng, Stage, ball, cube, quad, reds, settings};

const HERE: DAffine3 = DAffine3::IDENTITY;

/// What a plane sends back toward `angle` from its normal when the whole sky has radiance 1.
fn plane_under_a_white_sky(material: Material, angle: f64, samples: u32) -> Estimate {
    let mut stage = Stage::new(settings(16, 16, Integrator::Path, 1));
    stage.add(Light::Environment { radiance: Vec3::ONE }, HERE);
    stage.add_mesh(quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0), material, HERE);
    let toward = DVec3::new(angle.sin(), 0.0, angle.cos());
    stage.look(toward * 0.5, DVec3::ZERO, DVec3::Y, 1e-5);
    Estimate::of(&reds(stage.trace(samples)))
}

const ANGLES: [f64; 5] = [0.0, 0.5, 1.0, 1.4, 1.553];

#[test]
fn glossy_surfaces_never_send_back_more_than_they_get() {
    let white = Material::lambert(Vec3::ONE);
    let black = Material::lambert(Vec3::ZERO);
    let mut cases = Vec::new();
    for roughness in [0.0, 0.05, 0.1, 0.3, 0.5, 0.7, 1.0] {
        let glossy = Glossy::Ggx { metallic: 1.0, roughness, texture: None };
        cases.push((format!("metal of roughness {roughness}"), Material { glossy, ..white.clone() }));
    }
    for exponent in [0.0, 1.0, 10.0, 50.0, 1000.0] {
        let glossy = Glossy::BlinnPhong { specular: Vec3::ONE, exponent, texture: None };
        cases.push((format!("Blinn-Phong of exponent {exponent}"), Material { glossy, ..black.clone() }));
    }
    for (name, material) in cases {
        let mut line = String::new();
        for angle in ANGLES {
            let e = plane_under_a_white_sky(material.clone(), angle, 256);
            assert!(e.sigma < 5e-3, "{name}: {e:?}");
            assert!(e.mean <= 1.0 + 4.5 * e.sigma + 1e-5, "{name} at {angle}: {e:?}");
            assert!(e.mean > 0.0);
            line += &format!(" {:.4}", 1.0 - e.mean);
        }
        println!("{name}: lost at {ANGLES:?} rad:{line}");
    }
}

/// Base and interface together: what the interface does not send back, the white base does.
#[test]
fn a_gltf_dielectric_never_sends_back_more_than_it_gets() {
    for roughness in [0.1, 0.5, 1.0] {
        let glossy = Glossy::Ggx { metallic: 0.0, roughness, texture: None };
        let material = Material { glossy, ..Material::lambert(Vec3::ONE) };
        let sums = ANGLES.map(|angle| plane_under_a_white_sky(material.clone(), angle, 256));
        let means = sums.map(|s| s.mean);
        println!("white dielectric of roughness {roughness}: {means:.3?}");
        assert!(sums.iter().all(|s| s.mean <= 1.0 + 4.5 * s.sigma), "{means:?}");
        assert!(means[..4].iter().all(|m| *m > 0.995), "{means:?}");
    }
}

fn glossy_scene(integrator: Integrator) -> Stage {
    let mut stage = Stage::new(settings(16, 16, integrator, 1));
    let glossy = Glossy::Ggx { metallic: 0.5, roughness: 0.4, texture: None };
    let floor = Material { glossy, ..Material::lambert(Vec3::splat(0.6)) };
    stage.add_mesh(quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0), floor, HERE);
    let light =
        Light::Parallelogram { edge_u: Vec3::X, edge_v: Vec3::Y, radiance: [Vec3::ONE; 4], two_sided: true };
    stage.add(light, DAffine3::from_translation(DVec3::new(-1.0, 0.0, 1.2)));
    stage.look(DVec3::new(0.3, 0.0, 0.4), DVec3::ZERO, DVec3::Y, 1e-5);
    stage
}

#[test]
fn every_way_of_sampling_finds_the_same_light() {
    let direct = Estimate::of(&reds(glossy_scene(Integrator::Direct).trace(1024)));
    let path = Estimate::of(&reds(glossy_scene(Integrator::Path).trace(1024)));
    // By light samples alone, and by bounces alone, without any weights between them.
    let mut stage = glossy_scene(Integrator::Path);
    stage.trace(1);
    let scene = stage.scene();
    let ray = scene.viewpoint.ray(Vec2::splat(8.0), scene.settings.size);
    let mut hit = [None];
    scene.closest_hits(&[ray], &mut hit, |_| true, |_, _| 0.0);
    let hit = hit[0].expect("the floor");
    let (instance, surface) = scene.surface_at(&hit);
    let at = Interaction::new(&scene, instance, &hit, &ray);
    let bsdf = at.bsdf(&scene, surface);
    let mut rng = Rng(1);
    let (mut by_light, mut by_bounce) = (Vec::new(), Vec::new());
    for _ in 0..256 {
        let (mut light_sum, mut bounce_sum) = (0.0, 0.0);
        for _ in 0..8192 {
            if let Some(sample) = scene.lights.get(0).sample(at.position, bsdf.normal(), rng.pair()) {
                let [diffuse, glossy] = bsdf.eval(sample.wi);
                light_sum += f64::from(((diffuse + glossy) * sample.radiance).x / sample.pdf.unwrap());
            }
            if let Some(sample) = bsdf.sample(rng.unit(), rng.pair(), Lobes::ALL) {
                let ray = Ray::new(at.origin_toward(sample.wi), sample.wi);
                if let Some(found) = scene.lights.closest(&ray) {
                    bounce_sum += f64::from((sample.weight * found.shape.emitted(&ray, &found.hit)).x);
                }
            }
        }
        by_light.push(light_sum / 8192.0);
        by_bounce.push(bounce_sum / 8192.0);
    }
    let (by_light, by_bounce) = (Estimate::of(&by_light), Estimate::of(&by_bounce));
    for (name, e) in [("direct", direct), ("path", path), ("light samples", by_light), ("bounces", by_bounce)]
    {
        println!("{name}: {:.6} ± {:.1e}", e.mean, e.sigma);
        for (other_name, other) in [("direct", direct), ("light samples", by_light)] {
            let sigma = e.sigma.hypot(other.sigma);
            assert!(sigma < 1.5e-3 * direct.mean, "{name}: too noisy to tell");
            assert!(
                (e.mean - other.mean).abs() <= 4.5 * sigma,
                "{name} is not {other_name}: {e:?} {other:?}"
            );
        }
    }
}

#[test]
fn direct_light_is_the_path_tracers_first_bounce_with_every_kind_of_light() {
    let picture = |integrator| {
        let mut stage = Stage::new(settings(64, 64, integrator, 1));
        let floor = |glossy, albedo: f32| Material { glossy, ..Material::lambert(Vec3::splat(albedo)) };
        let ggx = Glossy::Ggx { metallic: 0.2, roughness: 0.3, texture: None };
        let phong = Glossy::BlinnPhong { specular: Vec3::splat(0.4), exponent: 20.0, texture: None };
        stage.add_mesh(quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0), floor(ggx, 0.7), HERE);
        let place = |x: f64, y: f64, z: f64| DAffine3::from_translation(DVec3::new(x, y, z));
        stage.add_mesh(ball(12), floor(phong, 0.4), place(0.0, 1.0, 0.0));
        stage.add_mesh(
            ball(8),
            Material::emissive(Vec3::splat(4.0)),
            place(2.0, 2.5, 1.0) * DAffine3::from_scale(DVec3::splat(0.4)),
        );
        stage.add(Light::Environment { radiance: Vec3::splat(0.1) }, HERE);
        let sun = DAffine3::from_axis_angle(DVec3::X, -0.9);
        stage.add(Light::Directional { irradiance: Vec3::splat(1.0), angle: 0.1 }, sun);
        stage.add(Light::Sphere { radius: 0.3, radiance: Vec3::splat(6.0) }, place(-1.5, 2.0, 0.8));
        stage.add(Light::Point { intensity: Vec3::ONE }, place(0.0, 3.0, -2.0));
        stage.look_wide(DVec3::new(2.0, 2.5, 4.0), DVec3::new(0.0, 0.8, 0.0));
        stage.trace(256).clone()
    };
    let (direct, path) = (picture(Integrator::Direct), picture(Integrator::Path));
    // 8×8 pixels together; the halves of both films tell the noise of their difference.
    let mut tiles = Vec::new();
    for (x, y) in (0..64).step_by(8).flat_map(|x| (0..64).step_by(8).map(move |y| (x, y))) {
        let (mut off, mut noise) = (0.0, 0.0);
        for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
            let (a, b) = (direct.pixel(x + i, y + j), path.pixel(x + i, y + j));
            off += a.mean().x - b.mean().x;
            for p in [a, b] {
                noise += (0.5 * (p.half_mean(0).unwrap().x - p.half_mean(1).unwrap().x)).powi(2);
            }
        }
        tiles.push(off / noise.sqrt().max(1e-9));
    }
    let worst = tiles.iter().fold(0.0f64, |w, t| w.max(t.abs()));
    println!("direct against path: worst of 64 tiles {worst:.2} sigma");
    assert!(worst < 4.5);
}

#[test]
fn a_closed_room_is_exactly_dark_whatever_shines_outside() {
    for (scale, shift) in
        [(1.0, DVec3::ZERO), (1e-3, DVec3::ZERO), (1e3, DVec3::ZERO), (1.0, DVec3::splat(1e5))]
    {
        for integrator in [Integrator::Direct, Integrator::Path] {
            let mut stage = Stage::placed(settings(48, 48, integrator, 6), scale, shift);
            let turn = DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
            stage.add_mesh(cube(), Material::lambert(Vec3::splat(0.9)), turn);
            stage.add(Light::Environment { radiance: Vec3::ONE }, HERE);
            stage.add(Light::Directional { irradiance: Vec3::ONE, angle: 0.0 }, HERE);
            stage.add(
                Light::Directional { irradiance: Vec3::ONE, angle: 0.1 },
                DAffine3::from_rotation_x(1.0),
            );
            stage.add(
                Light::Sphere { radius: 1.0, radiance: Vec3::ONE },
                DAffine3::from_translation(DVec3::X * 3.5),
            );
            stage.add(Light::Point { intensity: Vec3::ONE }, DAffine3::from_translation(DVec3::Y * 2.5));
            stage.look_wide(turn.transform_point3(DVec3::new(0.9, 0.8, 0.7)), DVec3::new(-0.5, -0.6, -0.4));
            let film = stage.trace(32);
            assert!(reds(film).iter().all(|&r| r == 0.0), "scale {scale}, shift {shift}, {integrator:?}");
        }
    }
}

#[test]
fn a_light_of_no_use_is_no_harm() {
    // Nothing to see, nothing that shines, a picture of one pixel; and lights that cannot be placed.
    let mut stage = Stage::new(settings(1, 1, Integrator::Path, 4));
    assert_eq!(stage.trace(3).pixel(0, 0).mean(), DVec3::ZERO);
    let mut stage = Stage::new(settings(1, 1, Integrator::Path, 4));
    stage.add_mesh(TriangleMesh::default(), Material::emissive(Vec3::ONE), HERE);
    stage.add_mesh(quad(-Vec3::ONE, Vec3::X, Vec3::Y), Material::default(), HERE);
    let nowhere = DAffine3::from_translation(DVec3::splat(f64::NAN));
    for light in [
        Light::Point { intensity: Vec3::ONE },
        Light::Sphere { radius: 1.0, radiance: Vec3::ONE },
        Light::Segment { half_length: 1.0, strength: [Vec3::ONE; 2], emission: Default::default() },
        Light::Disk { radius: 1.0, radiance: Vec3::ONE, two_sided: true },
    ] {
        stage.add(light.clone(), nowhere);
        stage.add(light, DAffine3::from_scale(DVec3::splat(f64::INFINITY)));
    }
    assert_eq!(stage.trace(3).pixel(0, 0).mean(), DVec3::ZERO);
    assert!(stage.scene().lights.is_empty(), "{:?}", stage.scene().lights);
}

#[test]
fn lights_beyond_all_measure_are_still_chosen() {
    let lamp = |i: f32| FlatLight::Point { position: Vec3::ZERO, intensity: Vec3::splat(i) };
    let lights = Lights::new(vec![lamp(3e38), lamp(3e38), lamp(1.0)], Vec::new(), None);
    let to = Receiver { point: Vec3::ZERO, normal: Vec3::Z };
    let chances: Vec<f32> = (0..3).map(|i| lights.chance(1, i, &to)).collect();
    assert!(chances.iter().all(|&c| c > 0.0), "{chances:?}");
    assert!((chances.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{chances:?}");
}

#[test]
fn an_empty_mesh_does_not_spoil_the_origin() {
    let far = DAffine3::from_translation(DVec3::splat(1e7));
    let picture = |place: DAffine3, empty: bool| {
        let mut stage = Stage::new(settings(16, 16, Integrator::Direct, 1));
        if empty {
            stage.add_mesh(TriangleMesh::default(), Material::default(), place);
        }
        stage.add_mesh(ball(8), Material::default(), place);
        stage.add(
            Light::Point { intensity: Vec3::ONE },
            place * DAffine3::from_translation(DVec3::splat(2.0)),
        );
        let p = |x, y, z| place.transform_point3(DVec3::new(x, y, z));
        stage.look(p(0.0, 0.0, 3.0), p(0.0, 0.0, 0.0), DVec3::Y, 2.0);
        stage.trace(4).clone()
    };
    let here = picture(HERE, false);
    assert!(here == picture(HERE, true));
    assert!(here == picture(far, false), "1e7 is a multiple of the ball's size: equal bit for bit");
    assert!(here == picture(far, true), "with an empty mesh beside it");
}
