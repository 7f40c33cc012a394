//! Ten thousand lights are little worse than ten.
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

#[path = "support/lamps.rs"]
mod lamps;
#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DVec3, Vec3};
use lamps::{SIZE, beside_a_ball, measure};
use penumbra::scene::{Light, Material};
use penumbra::trace::{Integrator, RenderSettings};
use stage::{Estimate, Frames as _, Stage, quad, reds, settings};

/// The floor that was set: with ten thousand, an error of at most that of ten after three times as many samples. What
/// they cost in time `cargo bench --bench many_lights` measures.
#[test]
fn ten_thousand_are_as_good_as_ten() {
    for apart in [false, true] {
        let [few, many] = [10, 10_000].map(|count| measure(count, apart, 1, 16).variance);
        println!(
            "apart {apart}: relative variance of ten {few:.4}, of ten thousand {many:.4}: {:.2}",
            many / few
        );
        assert!(many < 3.0 * few, "apart {apart}: {many} {few}");
    }
}

/// One mesh or as many lights, direct or over several bounces: the same picture, whatever is chosen how.
#[test]
fn however_they_are_chosen_it_is_the_same_light() {
    for depth in [1, 3] {
        let [one, many] = [false, true].map(|apart| measure(300, apart, depth, 16));
        let sigma = one.picture.sigma.hypot(many.picture.sigma);
        let (a, b) = (one.picture.mean, many.picture.mean);
        println!("depth {depth}: {a:.5} and {b:.5}, ± {sigma:.5}");
        assert!((a - b).abs() < 4.5 * sigma && sigma < 0.01 * a, "depth {depth}: {a} {b} ± {sigma}");
    }
}

/// Paths weigh what a bounce runs into against the chance of having chosen it there. (Shaded smoothly the two differ
/// by a hundredth where lamps are as near as a facet is off the ball: rays start on the ball, light is computed on the facet.)
#[test]
fn bounces_and_light_samples_find_the_same() {
    let [light_samples, both] = [Integrator::Direct, Integrator::Path].map(|integrator| {
        let sum = |seed| {
            let mut stage = beside_a_ball(seed, integrator);
            let film = stage.trace(64);
            let row = |y| film.row(y).map(|p| p.mean().y).sum::<f64>();
            (0..SIZE).map(row).sum::<f64>()
        };
        Estimate::of(&(0..32).map(sum).collect::<Vec<f64>>())
    });
    let sigma = light_samples.sigma.hypot(both.sigma);
    let off = (both.mean - light_samples.mean) / sigma;
    println!("{:.4} and {:.4}: {off:+.2} σ of {:.1e}", light_samples.mean, both.mean, sigma / both.mean);
    assert!(off.abs() < 4.5 && sigma < 3e-3 * both.mean, "{off} σ");
}

/// Twelve panels under a ceiling: of some it is known what is in their way, one of the others is chosen by chance. It is the light of
/// twelve that are chosen from by chance alone, and less noise.
#[test]
fn what_is_known_of_some_lights_is_not_left_to_chance() {
    for (integrator, depth) in [(Integrator::Direct, 1), (Integrator::Path, 3)] {
        let [chance, known] = [false, true].map(|shafts| {
            let picture = |seed| {
                let settings = RenderSettings { seed, shafts, ..settings(24, 24, integrator, depth) };
                reds(panels(settings).trace(4))
            };
            let pictures: Vec<Vec<f64>> = (0..400).map(picture).collect();
            let means: Vec<f64> =
                pictures.iter().map(|reds| reds.iter().sum::<f64>() / reds.len() as f64).collect();
            let apart = |[a, b]: [&Vec<f64>; 2]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            let noise: f64 = pictures.windows(2).map(|pair| apart([&pair[0], &pair[1]])).sum();
            (Estimate::of(&means), noise)
        });
        let sigma = chance.0.sigma.hypot(known.0.sigma);
        let (a, b, less) = (chance.0.mean, known.0.mean, chance.1 / known.1);
        println!("{integrator:?}: {a:.5} and {b:.5} ± {sigma:.5}; the noise squared is {less:.2} times less");
        assert!((a - b).abs() < 4.5 * sigma && sigma < 3e-3 * a, "{integrator:?}");
        assert!(less > if integrator == Integrator::Direct { 2.0 } else { 1.0 }, "{integrator:?}");
    }
}

/// Three tables, and twelve lamps above.
fn panels(settings: RenderSettings) -> Stage {
    let mut stage = Stage::new(settings);
    let floor = quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0);
    stage.add_mesh(floor, Material::lambert(Vec3::splat(0.7)), DAffine3::IDENTITY);
    for i in 0..3 {
        let table = quad(Vec3::new(i as f32 - 1.2, 0.4, -0.2), Vec3::Z * 0.4, Vec3::X * 0.4);
        stage.add_mesh(table, Material::lambert(Vec3::splat(0.5)), DAffine3::IDENTITY);
    }
    for i in 0..12 {
        let corner = DVec3::new(f64::from(i % 4) * 1.4 - 2.5, 2.0, f64::from(i / 4) * 1.8 - 2.2);
        let radiance = [Vec3::splat(2.0 + (i % 5) as f32); 4];
        let lamp =
            Light::Parallelogram { edge_u: Vec3::X * 0.6, edge_v: Vec3::Z * 0.3, radiance, two_sided: false };
        stage.add(lamp, DAffine3::from_translation(corner));
    }
    stage.look(DVec3::new(0.3, 1.9, 0.2), DVec3::ZERO, DVec3::Z, 3.5);
    stage
}
