//! Ten thousand lights are little worse than ten.
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

#[path = "support/lamps.rs"]
mod lamps;
#[path = "support/stage.rs"]
mod stage;

use lamps::{SIZE, beside_a_ball, measure};
use penumbra::trace::Integrator;
use stage::{Estimate, Frames as _};

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
