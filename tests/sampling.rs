//! What the film says about its own noise.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test shows its figures, and fails at the first wrong one"
)]

#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DVec3, UVec2, Vec3};
use penumbra::app::{FrameBudget, FrameStats};
use penumbra::scene::{Light, Material};
use penumbra::trace::noise::relative_error;
use penumbra::trace::{Integrator, RenderSettings};
use stage::{Estimate, Frames as _, Stage, quad, reds, settings};

/// A place in the middle of a penumbra, so small that every pixel shows the same.
fn flat_penumbra(width: u32, height: u32, strip: f64, seed: u32) -> Stage {
    let mut stage =
        Stage::new(RenderSettings { seed, shafts: false, ..settings(width, height, Integrator::Direct, 1) });
    let here = DAffine3::IDENTITY;
    stage.add_mesh(quad(Vec3::new(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0), Material::default(), here);
    stage.add_mesh(
        quad(Vec3::new(-100.0, -100.0, 1.0), Vec3::X * 100.0, Vec3::Y * 200.0),
        Material::default(),
        here,
    );
    let light =
        Light::Parallelogram { edge_u: Vec3::X, edge_v: Vec3::Y, radiance: [Vec3::ONE; 4], two_sided: true };
    stage.add(light, DAffine3::from_translation(DVec3::Z * 4.0));
    stage.look(DVec3::Z * 0.5, DVec3::ZERO, DVec3::Y, strip);
    stage
}

#[test]
fn the_noise_estimate_is_the_true_error() {
    let size = 24;
    let scene = |seed, samples| {
        let mut stage = flat_penumbra(size, size, 0.5, seed);
        stage.app.world.resource_mut::<FrameBudget>().pass_samples = 16;
        stage.trace(samples);
        let noise = stage.app.world.resource::<FrameStats>().noise;
        (reds(stage.film()), noise)
    };
    let (truth, _) = scene(12_345, 16_384);
    let (mut estimated, mut actual) = (Vec::new(), Vec::new());
    for seed in 0..100 {
        let (picture, noise) = scene(seed, 16);
        actual.push(relative_error(&picture, &truth, UVec2::splat(size)).unwrap());
        estimated.push(noise.expect("an estimate"));
    }
    let ratios: Vec<f64> = estimated.iter().zip(&actual).map(|(e, a)| e / a).collect();
    let (ratio, error) = (Estimate::of(&ratios), Estimate::of(&actual));
    let spread = ratio.sigma * 10.0;
    println!(
        "true relative error {:.4}, estimate over it {:.3} ± {spread:.3} in one run",
        error.mean, ratio.mean
    );
    assert!((ratio.mean - 1.0).abs() < 0.1, "{ratio:?}");
}
