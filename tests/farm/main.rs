//! Films in files, on many machines, to a noise level, and gone on with.

mod films;
mod lost;
mod merging;
mod noise;
mod references;
#[path = "../support/stage.rs"]
mod stage;
#[path = "../support/mod.rs"]
mod support;

use glam::{UVec2, Vec3};
use penumbra::farm::{FilmFile, Header, Identity, Ranges};
use penumbra::image::Display;
use penumbra::trace::Film;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Runs the program and returns its exit code and what it said.
fn penumbra(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_penumbra"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

fn succeeds(folder: &Path, arguments: &[&str]) {
    let (code, said) = penumbra(folder, arguments);
    assert_eq!(code, Some(0), "{arguments:?}: {said}");
}

/// That the program says one line with all of `words`, and ends with 1.
fn fails(folder: &Path, arguments: &[&str], words: &[&str]) {
    let (code, said) = penumbra(folder, arguments);
    assert_eq!(code, Some(1), "{arguments:?}: {said}");
    let errors: Vec<&str> = said.lines().filter(|line| !line.starts_with("note: ")).collect();
    assert!(errors.len() == 1 && errors[0].starts_with("error: "), "one line: {said}");
    for word in words {
        assert!(said.contains(word), "{arguments:?} should say {word}: {said}");
    }
}

fn fresh(test: &str) -> PathBuf {
    let folder = support::folder(&format!("farm-{test}"));
    std::fs::remove_dir_all(&folder).unwrap();
    support::folder(&format!("farm-{test}"))
}

fn header(size: UVec2, planned: Option<Range<u32>>) -> Header {
    let identity = Identity {
        program: env!("CARGO_PKG_VERSION").to_owned(),
        scene: "test".to_owned(),
        scene_hash: "0123456789abcdef0123456789abcdef".to_owned(),
        camera: "somewhere".to_owned(),
        width: size.x,
        height: size.y,
        integrator: "path".to_owned(),
        max_depth: 8,
        filter: "file".to_owned(),
        sampling: "sobol, sobol".into(),
        seed: 0,
    };
    Header::new(identity, planned, &Display::default())
}

/// A film whose tile number i holds the samples `ranges(i)` of a made-up picture.
fn made_up(size: UVec2, planned: Option<Range<u32>>, ranges: impl Fn(usize) -> Ranges) -> FilmFile {
    let mut film = Film::new(size, 0);
    let mut held = Vec::new();
    for (i, tile) in film.tiles_mut().iter_mut().enumerate() {
        let ranges = ranges(i);
        let mut dropped = 0;
        for (p, pixel) in tile.pixels_mut().iter_mut().enumerate() {
            for sample in ranges.as_slice().iter().cloned().flatten() {
                let mut rng = stage::Rng((i as u64) << 48 | (p as u64) << 32 | u64::from(sample));
                rng.bits();
                let radiance = Vec3::new(rng.unit(), rng.decades(-8.0, 8.0), 1.0 / (1.0 + sample as f32));
                // Now and then a sample is no number.
                let radiance = if rng.bits().is_multiple_of(64) { radiance * f32::NAN } else { radiance };
                dropped += u64::from(!pixel.add(sample, radiance));
            }
        }
        (tile.dropped, tile.next_sample) = (dropped, ranges.count());
        held.push(ranges);
    }
    let starts = held.iter().filter_map(Ranges::hull).map(|hull| hull.start);
    film.begin_at(starts.chain(planned.as_ref().map(|p| p.start)).min().unwrap_or(0));
    FilmFile { header: header(size, planned), film, held }
}

fn encode(file: &FilmFile) -> Vec<u8> {
    penumbra::farm::format::encode(&file.header, &file.film, &file.held)
}
