//! Valid files, changed at random: the outcome is a scene that keeps its promises or an error of one line, never a
//! panic, in bounded time and memory.
//!
//! 2,000 cases a format; `PENUMBRA_FUZZ=100000 cargo test --release --test fuzz` for the long mode. A failing case is
//! shrunk, and its file kept.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]
#![expect(clippy::print_stderr, reason = "how many cases of each outcome there were")]

#[path = "../loading/builder.rs"]
mod builder;
mod mutation;
#[path = "../support/promises.rs"]
mod promises;
mod samples;

use bevy_ecs::prelude::*;
use cap::Cap;
use mutation::{Mutation, apply, mutations};
use penumbra::load::{LoadOptions, SceneSource, load};
use penumbra::open::{Wishes, open};
use proptest::test_runner::{Config, TestCaseError, TestRunner};
use samples::Sample;
use std::alloc::System;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Memory that all tests of this file together may ever have; asking for more ends them.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, 3 << 30);
/// Memory that one file may take.
const MOST_MEMORY: u64 = 256 << 20;
/// Time that one file may take.
const MOST_TIME: Duration = Duration::from_secs(5);
/// Each such case is built and traced too.
const TRACED: u32 = 50;

fn cases() -> u32 {
    std::env::var("PENUMBRA_FUZZ").ok().and_then(|text| text.parse().ok()).unwrap_or(2000)
}

fn base64(bytes: &[u8]) -> String {
    samples::base64(bytes)
}

/// Outcomes so far.
#[derive(Default)]
struct Count {
    cases: Cell<u32>,
    scenes: Cell<u32>,
}

/// Loads `sample` with `mutations`, and judges.
fn judge(folder: &Path, sample: &Sample, mutations: &[Mutation], count: &Count) -> Result<(), String> {
    for (name, bytes) in &sample.others {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
    let changed = apply(&sample.bytes, mutations);
    let path = if sample.mutated.is_empty() {
        folder.join(sample.name)
    } else {
        std::fs::write(folder.join(sample.name), &sample.main).unwrap();
        folder.join(sample.mutated)
    };
    std::fs::write(&path, &changed).unwrap();
    let source = SceneSource::File(folder.join(sample.name));
    let options = LoadOptions { max_memory: Some(MOST_MEMORY), time: Some(0.3), ..LoadOptions::default() };
    count.cases.set(count.cases.get() + 1);
    let start = Instant::now();
    let outcome = catch_unwind(AssertUnwindSafe(|| {
        let mut world = World::new();
        match load(&mut world, &source, &options) {
            Err(error) => {
                let message = error.to_string();
                (message.contains('\n') || !message.contains(sample.name))
                    .then(|| format!("message is not one line with the file's name: {message}"))
            }
            Ok(_) => {
                count.scenes.set(count.scenes.get() + 1);
                promises::broken_promise(&mut world)
            }
        }
    }));
    let took = start.elapsed();
    if count.cases.get().is_multiple_of(TRACED) {
        let traced = catch_unwind(AssertUnwindSafe(|| open(&source, &options, &Wishes::default()).is_ok()));
        traced.map_err(|_| "tracing it panics".to_owned())?;
    }
    match outcome {
        Err(_) => Err("loading it panics".to_owned()),
        Ok(Some(broken)) => Err(broken),
        Ok(None) if took > MOST_TIME => Err(format!("took {took:?}")),
        Ok(None) => Ok(()),
    }
}

/// Changes samples of one format at random.
fn fuzz(format: &str, samples: &[Sample]) {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz-{format}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    for sample in samples {
        let unchanged = Count::default();
        judge(&folder, sample, &[], &unchanged).unwrap_or_else(|why| panic!("{}: {why}", sample.name));
        assert_eq!(
            unchanged.scenes.get(),
            1,
            "{}: refused unchanged; kept in {}",
            sample.name,
            folder.display()
        );
    }
    let count = Count::default();
    let config =
        Config { cases: cases(), max_shrink_iters: 500, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(
        config,
        proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
    );
    let start = Instant::now();
    let result = runner.run(&mutations(samples.len()), |(which, mutations)| {
        judge(&folder, &samples[which], &mutations, &count).map_err(TestCaseError::fail)
    });
    eprintln!(
        "{format}: {} cases, {} scenes, {} errors, {:.1} s",
        count.cases.get(),
        count.scenes.get(),
        count.cases.get() - count.scenes.get(),
        start.elapsed().as_secs_f64()
    );
    if let Err(why) = result {
        panic!("{format}: the file is kept in {}: {why}", folder.display());
    }
    assert!(count.scenes.get() > cases() / 20, "hardly anything loads: the changes are too coarse");
    let refused = count.cases.get() - count.scenes.get();
    assert!(refused > 0 || samples.iter().all(|s| !s.mutated.is_empty()), "nothing is refused: too fine");
    let _ = std::fs::remove_dir_all(&folder);
}

#[test]
fn changed_gltf_files_load_or_are_refused() {
    fuzz("gltf", &samples::gltf());
}

#[test]
fn changed_glb_files_load_or_are_refused() {
    fuzz("glb", &samples::glb());
}

#[test]
fn changed_compressed_files_load_or_are_refused() {
    fuzz("compressed", &samples::compressed());
}

#[test]
fn changed_obj_files_load_or_are_refused() {
    fuzz("obj", &samples::obj());
}

#[test]
fn changed_mtl_files_load_or_are_refused() {
    fuzz("mtl", &samples::mtl());
}

#[test]
fn changed_settings_load_or_are_refused() {
    fuzz("toml", &samples::toml());
}

#[test]
fn changed_images_load_or_are_replaced() {
    fuzz("images", &samples::images());
}
