//! What many lights cost: error and time of a room lit by ten to ten thousand lamps of the same power together.
//!
//! `cargo bench --bench many_lights`. Efficiency is 1 / (variance × time), beside that of ten.
#![allow(clippy::print_stdout, reason = "that is what it is for")]

#[path = "../tests/support/lamps.rs"]
mod lamps;
#[path = "../tests/support/stage.rs"]
mod stage;

use lamps::measure;

fn main() {
    println!("| lamps | as | relative variance | ms | efficiency |\n|--:|---|--:|--:|--:|");
    for apart in [false, true] {
        let mut ten = None;
        for count in [10, 100, 1000, 10_000] {
            let measured = measure(count, apart, 1, 64);
            let cost = measured.variance * measured.time.as_secs_f64();
            let efficiency = *ten.get_or_insert(cost) / cost;
            let kind = if apart { "lights" } else { "one mesh" };
            let ms = measured.time.as_secs_f64() * 1e3;
            println!("| {count} | {kind} | {:.5} | {ms:.1} | {efficiency:.2} |", measured.variance);
        }
    }
}
