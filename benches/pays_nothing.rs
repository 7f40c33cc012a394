//! What a scene pays for mirrors, textures and alpha that it has but does not show: `cargo bench --bench pays_nothing`.
//!
//! The same picture of the Cornell box, as it is and with a square of each kind behind its back wall, in turn; the median of the
//! ratios of their times, with the quartiles. The first row is the box beside itself: what the machine's noise comes to.
#![allow(clippy::print_stdout, reason = "that is what it is for")]

#[path = "../tests/support/features.rs"]
mod features;

use features::{NEEDS, cornell, cornell_with};
use penumbra::app::App;
use penumbra::sync::traceable;
use penumbra::trace::{FeatureCounts, Film, Integrator, trace_pass};
use std::time::Instant;

const SIZE: u32 = 256;
const SAMPLES: u32 = 16;
const ROUNDS: usize = 31;

/// Seconds of one picture.
fn seconds(app: &App) -> f64 {
    let scene = traceable(&app.world);
    let mut film = Film::new(scene.settings.size, 0);
    let start = Instant::now();
    let rays = trace_pass(&scene, &mut film, SAMPLES, SAMPLES, || true);
    let taken = start.elapsed().as_secs_f64();
    assert_eq!(rays.features, FeatureCounts::default(), "it is not seen");
    taken
}

/// Quartiles of how many times as long the second takes.
fn ratios(plain: &App, other: &App) -> [f64; 3] {
    let mut ratios: Vec<f64> = (0..ROUNDS)
        .map(|round| {
            // Each goes first as often.
            if round % 2 == 0 {
                let first = seconds(plain);
                seconds(other) / first
            } else {
                let first = seconds(other);
                first / seconds(plain)
            }
        })
        .collect();
    ratios.sort_unstable_by(f64::total_cmp);
    [ROUNDS / 4, ROUNDS / 2, 3 * ROUNDS / 4].map(|i| ratios[i])
}

fn main() {
    println!("| unseen | integrator | time, ratio to the box alone | quartiles |\n|---|---|--:|--:|");
    for integrator in [Integrator::Direct, Integrator::Path] {
        let plain = cornell(SIZE, integrator);
        let row = |name: &str, other: &App| {
            seconds(other);
            let [low, middle, high] = ratios(&plain, other);
            println!("| {name} | {} | {middle:.3} | {low:.3} to {high:.3} |", integrator.name());
        };
        row("nothing", &cornell(SIZE, integrator));
        for needs in NEEDS {
            row(&format!("{needs:?}").to_lowercase(), &cornell_with(needs, false, SIZE, integrator));
        }
    }
}
