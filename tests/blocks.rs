//! What is done for whole blocks of points is what would be done for each.
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec2, Vec3};
use penumbra::bvh::{Isa, Ray};
use penumbra::scene::{Body, Glossy, Layers, Light, Material, Transmission, Visible};
use penumbra::trace::block::{Block, LANES, Placed};
use penumbra::trace::sampler::{Sampler, SamplerRow};
use penumbra::trace::surface::Interaction;
use penumbra::trace::{Integrator, RenderSettings};
use stage::{Estimate, Frames as _, Stage, cube, quad, reds, settings};

#[test]
fn points_of_a_block_are_those_of_single_hits() {
    let turned = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(0.4);
    let sheared = DMat3::from_cols(DVec3::new(1.0, 0.2, 0.0), DVec3::new(-0.4, 0.9, 0.1), DVec3::Z);
    let mirrored = DMat3::from_diagonal(DVec3::new(-1.0, 0.5, 2.0));
    let mut seen = 0;
    for (matrix, shift) in [
        (DMat3::IDENTITY, DVec3::ZERO),
        (DMat3::IDENTITY, DVec3::new(1e3, -7.0, 0.3)),
        (turned * sheared, DVec3::new(0.1, 0.2, -0.3)),
        (turned * mirrored, DVec3::ONE),
        (turned * sheared * 1e-6, DVec3::ZERO),
        (mirrored * 1e6, DVec3::ZERO),
    ] {
        let size = matrix.col(0).length();
        let mut stage = Stage::new(settings(LANES as u32, 1, Integrator::Direct, 1));
        stage.add_mesh(cube(), Material::default(), DAffine3::from_mat3_translation(matrix, shift));
        stage.look(shift + DVec3::new(3.0, 4.0, 5.0) * size, shift, DVec3::Y, 2.0 * size);
        stage.app.build();
        let scene = stage.scene();
        let places = (0..LANES).map(|i| Vec2::new(i as f32 + 0.3, 0.6));
        let rays: Vec<Ray> = places.map(|place| scene.viewpoint.ray(place, scene.settings.size)).collect();
        let mut hits = vec![None; LANES];
        scene.closest_hits(&rays, &mut hits, |_| true, |_, _| 0.5);
        let is_there = scene.geometry.tlas.placements()[0].is_identity();
        let placed = (!is_there).then(|| Placed {
            world_from_local: *scene.geometry.tlas.placements()[0].world_from_local(),
            normal_matrix: scene.geometry.instances[0].normal_matrix,
        });
        for isa in Isa::available() {
            let mut block = Block::new(Sampler::halves(glam::UVec2::ZERO, scene.settings)[0]);
            for (i, (hit, ray)) in hits.iter().zip(&rays).enumerate() {
                let Some(hit) = hit else { continue };
                let corners = scene.surface_at(hit).0.mesh.corners(hit.triangle as usize);
                for (rows, corner) in block.corners.iter_mut().zip(corners) {
                    rows.set(i, corner);
                }
                block.weights.set(i, Vec3::new(hit.u, hit.v, 0.0));
                block.direction.set(i, ray.direction);
            }
            // In two parts that are no whole vectors.
            for lanes in [0..13, 13..LANES] {
                block.find_points(isa, lanes, placed.as_ref());
            }
            for (i, (hit, ray)) in hits.iter().zip(&rays).enumerate() {
                let Some(hit) = hit else { continue };
                let at = Interaction::new(&scene, scene.surface_at(hit).0, hit, ray);
                let expected = [at.position, at.geometric_normal, at.lit_origin_toward(at.geometric_normal)];
                let found = [&block.position, &block.geometric_normal, &block.origin].map(|rows| rows.get(i));
                assert_eq!(found, expected, "{} {matrix} {shift}", isa.name());
                seen += 1;
            }
        }
    }
    println!("{seen} points");
    assert!(seen > 500, "{seen}");
}

#[test]
fn a_row_of_samplers_splits_as_each_does() {
    let settings = RenderSettings::default();
    let halves = Sampler::halves(glam::UVec2::new(3, 4), &settings);
    let mut row = SamplerRow::<4>::new(halves[0]);
    for i in 0..4 {
        row.set(i, &halves[i & 1].at(7 * i as u32));
    }
    for member in [[0, 1], [0, 3], [2, 3]] {
        for i in 0..4 {
            assert_eq!(row.members(member).get(i), row.get(i).member(member));
        }
    }
}

/// A floor close under a large lamp (bounces find it as often as light samples do), a ball that shines and some shining triangles, with something in their way.
fn lit(seed: u32, light_samples: u32, integrator: Integrator) -> Stage {
    let mut stage = Stage::new(RenderSettings { seed, light_samples, ..settings(16, 16, integrator, 2) });
    let here = DAffine3::IDENTITY;
    let grey = Material { double_sided: true, ..Material::lambert(Vec3::splat(0.6)) };
    stage.add_mesh(quad(Vec3::new(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0), grey.clone(), here);
    stage.add_mesh(quad(Vec3::new(-2.0, -2.0, 1.0), Vec3::X * 2.0, Vec3::Y * 4.0), grey, here);
    let shining = Material { double_sided: true, ..Material::emissive(Vec3::splat(3.0)) };
    let mut strips = quad(Vec3::new(0.5, 0.5, 1.2), Vec3::X * 0.3, Vec3::Y * 0.3);
    for k in 1..12 {
        let more = quad(Vec3::new(0.5, 0.5 - 0.1 * k as f32, 1.2), Vec3::X * 0.05, Vec3::Y * 0.05);
        let first = strips.positions.len() as u32;
        strips.positions.extend(more.positions);
        strips.triangles.extend(more.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    strips.normals.clear();
    strips.uvs.clear();
    stage.add_mesh(strips, shining, here);
    let colours = [Vec3::ONE, Vec3::ZERO, Vec3::splat(2.0), Vec3::ONE];
    let lamp = Light::Parallelogram {
        edge_u: Vec3::X * 4.0,
        edge_v: Vec3::Y * 4.0,
        radiance: colours,
        two_sided: true,
    };
    stage.add(lamp, DAffine3::from_translation(DVec3::new(-2.0, -2.0, 1.6)));
    let ball = Light::Sphere { radius: 0.2, radiance: Vec3::splat(5.0) };
    stage.add(ball, DAffine3::from_translation(DVec3::new(0.2, -0.8, 1.25)));
    stage.look(DVec3::Z * 0.9, DVec3::ZERO, DVec3::Y, 1.5);
    stage
}

#[test]
fn however_often_the_eye_looks_it_is_the_same_light() {
    for integrator in [Integrator::Direct, Integrator::Path] {
        let [one, two, three] = [1, 2, 3].map(|light_samples| {
            let mean = |seed| {
                let values = reds(lit(seed, light_samples, integrator).trace(64));
                values.iter().sum::<f64>() / values.len() as f64
            };
            Estimate::of(&(0..24).map(mean).collect::<Vec<_>>())
        });
        for more in [two, three] {
            let sigma = one.sigma.hypot(more.sigma);
            let off = (more.mean - one.mean) / sigma;
            println!(
                "{integrator:?}: {:.5} and {:.5}: {off:+.2} σ of {:.1e}",
                one.mean,
                more.mean,
                sigma / one.mean
            );
            assert!(off.abs() < 4.5 && sigma < 2e-3 * one.mean, "{integrator:?}: {one:?} {more:?}");
        }
    }
}

/// A floor, even or with a coat, under a lamp that the eye does not see.
fn under_a_lamp(light: Light, glossy: Glossy, integrator: Integrator, light_samples: u32) -> Stage {
    let mut stage = Stage::new(RenderSettings { light_samples, ..settings(16, 16, integrator, 1) });
    let floor = Material { glossy, double_sided: true, ..Material::lambert(Vec3::splat(0.5)) };
    let corner = Vec3::new(-2.0, -2.0, 0.0);
    stage.add_mesh(quad(corner, Vec3::X * 4.0, Vec3::Y * 4.0), floor, DAffine3::IDENTITY);
    let turned = DAffine3::from_rotation_translation(DQuat::from_rotation_x(std::f64::consts::PI), DVec3::Z);
    let lamp = stage.add(light, turned);
    stage.app.world.entity_mut(lamp).insert(Visible(false));
    stage.look(DVec3::new(0.0, -1.5, 0.9), DVec3::ZERO, DVec3::Z, 0.5);
    stage
}

#[test]
fn a_lamp_that_only_shines_brings_all_its_light() {
    let radiance = Vec3::splat(2.0);
    let quad = Light::Parallelogram {
        edge_u: Vec3::X * 3.0,
        edge_v: Vec3::Y * 3.0,
        radiance: [radiance; 4],
        two_sided: true,
    };
    let disk = Light::Disk { radius: 1.5, radiance, two_sided: true };
    let ball = Light::Sphere { radius: 0.7, radiance };
    let coat = Glossy::BlinnPhong { specular: Vec3::splat(0.5), exponent: 30.0, texture: None };
    let none = Material::default().glossy;
    for (name, light) in [("parallelogram", quad), ("disk", disk), ("ball", ball)] {
        // All light there is comes straight from the lamp: both integrators see the same.
        for (glossy, what) in [(none.clone(), "even"), (coat.clone(), "coated")] {
            let seen = |integrator, looks| {
                let mut stage = under_a_lamp(light.clone(), glossy.clone(), integrator, looks);
                Estimate::of(&reds(&stage.expose(256, || true).0))
            };
            let first = seen(Integrator::Direct, 1);
            for (integrator, looks) in [(Integrator::Direct, 3), (Integrator::Path, 1), (Integrator::Path, 2)]
            {
                let other = seen(integrator, looks);
                let off = (other.mean / first.mean - 1.0).abs();
                println!("{name}, {what}, {} {looks}: {} {}", integrator.name(), first.mean, other.mean);
                assert!(off < 1.5e-3, "{name}, {what}: {} is not {} ({off:.1e})", other.mean, first.mean);
            }
        }
    }
}

#[test]
fn highlights_of_a_lamp_that_only_shines_are_found_by_bounces() {
    let lamp = Light::Parallelogram {
        edge_u: Vec3::X * 3.0,
        edge_v: Vec3::Y * 3.0,
        radiance: [Vec3::splat(2.0); 4],
        two_sided: true,
    };
    let coat = Glossy::BlinnPhong { specular: Vec3::splat(0.5), exponent: 3000.0, texture: None };
    for integrator in [Integrator::Direct, Integrator::Path] {
        let [one, other] = [1, 2].map(|seed| {
            let mut stage = under_a_lamp(lamp.clone(), coat.clone(), integrator, 1);
            stage.app.world.resource_mut::<RenderSettings>().seed = seed;
            reds(&stage.expose(256, || true).0)
        });
        let squares = one.iter().zip(&other).map(|(a, b)| (a - b).powi(2) / 2.0);
        let noise = (squares.sum::<f64>() / one.len() as f64).sqrt();
        println!("{}: {noise:.1e}", integrator.name());
        // By light samples alone it was 0.06 at least.
        assert!(noise < 0.03, "{noise}");
    }
}

/// A lamp that only shines, above a floor and below the surface of a body that absorbs: all is seen from above.
#[test]
fn a_lamp_in_a_body_that_absorbs_is_as_bright_by_bounces_as_by_light_samples() {
    // Below a smooth surface of no other index the floor is lit, by light samples alone or with bounces; below a rough one the
    // lamp is met by what goes through.
    for (roughness, ior, ways) in [
        (0.0, 1.0, [(Integrator::Direct, 1), (Integrator::Path, 1)]),
        (0.6, 1.3, [(Integrator::Path, 1), (Integrator::Path, 6)]),
    ] {
        let body =
            Transmission { factor: 1.0, texture: None, body: Some(Body { absorption: Vec3::splat(0.7) }) };
        let layers = Layers { ior, transmission: Some(body), ..Layers::default() };
        let glossy = Glossy::Ggx { metallic: 0.0, roughness, texture: None };
        let surface = Material { glossy, layers: Some(Box::new(layers)), ..Material::lambert(Vec3::ONE) };
        let [few, many] = ways.map(|(integrator, light_samples)| {
            let settings = RenderSettings { light_samples, ..settings(16, 16, integrator, 2) };
            let mut stage = Stage::new(settings);
            let corner = Vec3::new(-4.0, -4.0, 0.0);
            let floor = Material { double_sided: true, ..Material::lambert(Vec3::splat(0.5)) };
            stage.add_mesh(quad(corner, Vec3::X * 8.0, Vec3::Y * 8.0), floor, DAffine3::IDENTITY);
            let above = quad(corner + Vec3::Z * 3.0, Vec3::X * 8.0, Vec3::Y * 8.0);
            stage.add_mesh(above, surface.clone(), DAffine3::IDENTITY);
            let lamp = Light::Disk { radius: 1.0, radiance: Vec3::splat(9.0), two_sided: true };
            let lamp = stage.add(lamp, DAffine3::from_translation(DVec3::Z));
            stage.app.world.entity_mut(lamp).insert(Visible(false));
            stage.look(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 1.0);
            Estimate::of(&reds(&stage.expose(1024, || true).0))
        });
        println!("roughness {roughness}: {few:?} {many:?}");
        let off = (few.mean / many.mean - 1.0).abs();
        assert!(few.mean > 0.05 && off < 5e-3, "roughness {roughness}: {few:?} {many:?}");
    }
}
