//! Ten thousand lights are little worse than ten.
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

#[path = "support/lamps.rs"]
mod lamps;
#[path = "support/stage.rs"]
mod stage;

use lamps::measure;

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
        let sigma = one.error.hypot(many.error);
        let (a, b) = (one.mean, many.mean);
        println!("depth {depth}: {a:.5} and {b:.5}, ± {sigma:.5}");
        assert!((a - b).abs() < 4.5 * sigma && sigma < 0.01 * a, "depth {depth}: {a} {b} ± {sigma}");
    }
}
