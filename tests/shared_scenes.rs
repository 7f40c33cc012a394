//! The collections of valid and of broken files beside the project, if they are there.
//!
//! `cargo test --release --test shared_scenes -- --nocapture` prints the table: file, expected, got.

#![expect(clippy::print_stderr, reason = "a test that did not run must say so")]

#[path = "support/promises.rs"]
mod promises;
mod support;

use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::UVec2;
use penumbra::app::FrameBudget;
use penumbra::image::Display;
use penumbra::image::develop::develop;
use penumbra::load::{Card, LoadError, LoadOptions, LoadReport, Remark, SceneSource, Verdict, load};
use penumbra::open::{Wishes, open};
use penumbra::scene::{GlobalTransform, Instance, Mesh};
use penumbra::trace::Film;
use promises::broken_promise;
use std::path::Path;
use support::shared;

fn load_file(path: &Path) -> (World, Result<LoadReport, LoadError>) {
    let mut world = World::new();
    let result = load(&mut world, &SceneSource::File(path.to_path_buf()), &LoadOptions::default());
    (world, result)
}

/// One row of the table: what was to happen and what did.
fn row(
    file: &str,
    expected: &str,
    result: &Result<LoadReport, LoadError>,
    failed: Option<&String>,
) -> String {
    let card = Card::new(file, result);
    let got = match (&card.error, card.verdict) {
        (Some(error), _) => format!("refused: {}", error.replace('|', "/")),
        (None, Verdict::Valid) => format!("valid, {} triangles", card.triangles),
        (None, _) => {
            let parts = [
                (&card.repaired, "repaired"),
                (&card.ignored, "ignored"),
                (&card.approximated, "approximated"),
            ];
            let count = |remarks: &[Remark]| remarks.iter().map(|remark| remark.count).sum::<usize>();
            let parts: Vec<String> = parts
                .iter()
                .filter(|(remarks, _)| !remarks.is_empty())
                .map(|(remarks, what)| format!("{what} {}", count(remarks)))
                .collect();
            format!("{} triangles; {}", card.triangles, parts.join(", "))
        }
    };
    let verdict = failed.map_or("as expected".to_owned(), |why| format!("**{why}**"));
    format!("| {file} | {expected} | {got} | {verdict} |")
}

/// Prints a table; without `--nocapture` only a failing test shows it.
fn print_table(rows: &[String]) {
    eprintln!("| file | expected | got | |\n|---|---|---|---|\n{}", rows.join("\n"));
}

/// Area of all triangles after transforms.
fn area(world: &mut World) -> f64 {
    let mut query = world.query::<(&Instance, &GlobalTransform)>();
    let mut sum = 0.0;
    for (instance, transform) in query.iter(world) {
        let Some(mesh) = world.get::<Mesh>(instance.mesh) else {
            continue;
        };
        for i in 0..mesh.0.triangles.len() {
            let [a, b, c] = mesh.0.corners(i).map(|p| transform.0.transform_point3(p.as_dvec3()));
            sum += 0.5 * (b - a).cross(c - a).length();
        }
    }
    sum
}

#[test]
fn every_shared_scene_loads_with_its_triangles() {
    let Some(root) = shared("every_shared_scene_loads_with_its_triangles") else {
        return;
    };
    let expectations = std::fs::read_to_string(root.join("scenes/README.md")).unwrap();
    let mut failures = Vec::new();
    let mut table = Vec::new();
    for line in expectations.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [_, file, triangles, ..] = cells[..] else {
            continue;
        };
        let Ok(expected) = triangles.parse::<usize>() else {
            continue;
        };
        let (mut world, result) = load_file(&root.join("scenes").join(file));
        let failure = match &result {
            Err(error) => Some(format!("refused: {error}")),
            Ok(report) if report.triangles != expected => {
                Some(format!("{} triangles, expected {expected}", report.triangles))
            }
            Ok(_) => broken_promise(&mut world),
        };
        table.push(row(file, &format!("{expected} triangles"), &result, failure.as_ref()));
        failures.extend(failure.map(|why| format!("{file}: {why}")));
    }
    print_table(&table);
    let rows = table.len();
    assert!(rows >= 60, "only {rows} rows in the table");
    assert!(failures.is_empty(), "{} of {rows} failed:\n{}", failures.len(), failures.join("\n"));
}

/// Extensions that the tables want named "if not supported", and that are.
const SUPPORTED: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu"];

/// One row of an expectation table.
struct Expected<'a> {
    file: &'a str,
    outcome: &'a str,
    triangles: &'a str,
    area: &'a str,
    words: &'a str,
}

impl std::fmt::Display for Expected<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { outcome, triangles, words, .. } = self;
        match *outcome {
            "refuse" => write!(f, "refuse"),
            _ if *triangles == "-" => write!(f, "{outcome}"),
            _ => write!(f, "{outcome}, {triangles} triangles"),
        }?;
        if words.is_empty() || *words == "." {
            Ok(())
        } else {
            write!(f, ", say {}", words.replace('|', " / "))
        }
    }
}

/// Whether a message has one of the words of a pattern like `a|b|no .*c|v1\.0`, whatever the case.
fn says(message: &str, pattern: &str) -> bool {
    let message = message.to_lowercase();
    let one = |words: &str| {
        let mut rest = message.as_str();
        words.to_lowercase().replace("\\.", "\u{1}").replace("e?", "").split(".*").all(|part| {
            let part = part.replace('\u{1}', ".");
            let found = rest.find(&part);
            rest = found.map_or("", |at| &rest[at + part.len()..]);
            found.is_some()
        })
    };
    pattern.is_empty() || pattern == "." || pattern.split('|').any(one)
}

/// What is wrong with an outcome, if anything.
fn judge(row: &Expected<'_>, world: &mut World, result: &Result<LoadReport, LoadError>) -> Option<String> {
    let report = match result {
        Err(error) => {
            let message = error.to_string();
            let name = row.file.rsplit('/').next().unwrap_or_default();
            return match row.outcome {
                "load" | "warn" => Some(format!("refused: {message}")),
                _ if message.contains('\n') => Some(format!("message of several lines: {message}")),
                _ if !message.contains(name) => Some(format!("message does not name the file: {message}")),
                _ if !says(&message, row.words) => {
                    Some(format!("message does not say {}: {message}", row.words))
                }
                _ if world.query::<&Name>().iter(world).next().is_some() => {
                    Some("left entities behind".to_owned())
                }
                _ => None,
            };
        }
        Ok(report) => report,
    };
    let said = report.warnings().join("\n");
    let area = area(world);
    match row.outcome {
        "refuse" => Some("accepted".to_owned()),
        "warn" if !says(&said, row.words) => Some(format!("no warning that says {}: {said}", row.words)),
        _ if row.triangles != "-" && row.triangles != report.triangles.to_string() => {
            Some(format!("{} triangles, expected {}", report.triangles, row.triangles))
        }
        _ if row
            .area
            .parse::<f64>()
            .is_ok_and(|expected| !area.is_finite() || (area - expected).abs() > 1e-4 * expected) =>
        {
            Some(format!("area {area}, expected {}", row.area))
        }
        _ => broken_promise(world),
    }
}

#[test]
fn every_broken_file_has_an_allowed_outcome() {
    let Some(root) = shared("every_broken_file_has_an_allowed_outcome") else {
        return;
    };
    let mut failures = Vec::new();
    let mut table = Vec::new();
    for expectations in ["EXPECT.own.tsv", "EXPECT.public.tsv"] {
        let expectations = std::fs::read_to_string(root.join("bad-input").join(expectations)).unwrap();
        for line in expectations.lines().skip(1) {
            let cells: Vec<&str> = line.split('\t').collect();
            let [file, outcome, triangles, area, words, ..] = cells[..] else {
                continue;
            };
            let path = root.join("bad-input").join(file);
            if !path.is_file() {
                continue;
            }
            let start = std::time::Instant::now();
            let (mut world, result) = load_file(&path);
            let seconds = start.elapsed().as_secs_f64();
            let is_supported = SUPPORTED.iter().any(|name| words.split('|').any(|word| word == *name));
            let outcome = if outcome == "refuse" && is_supported { "load" } else { outcome };
            let expected = Expected { file, outcome, triangles, area, words };
            let slow = (seconds >= 10.0).then(|| format!("took {seconds:.1} s"));
            let failure = judge(&expected, &mut world, &result).or(slow);
            table.push(row(file, &expected.to_string(), &result, failure.as_ref()));
            failures.extend(failure.map(|why| format!("{file} [{outcome}]: {why}")));
        }
    }
    print_table(&table);
    let rows = table.len();
    assert!(rows >= 400, "only {rows} rows in the tables");
    assert!(failures.is_empty(), "{} of {rows} failed:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn patterns_of_the_tables_are_understood() {
    assert!(says("No Face here", "empty|no .*face"));
    assert!(!says("face no", "no .*face"));
    assert!(says("version 1.0", "x|1\\.0"));
    assert!(says("a jpg", "jpe?g"));
}

/// Radiance 1e30 is more than a sum of samples can hold, and white all the same; and nobody ran out of time.
#[test]
fn a_blinding_lamp_is_white() {
    let Some(shared) = shared("a_blinding_lamp_is_white") else { return };
    let file = shared.join("bad-input/own/emissive_1e30.gltf");
    let wishes = Wishes { size: Some(UVec2::new(16, 12)), ..Wishes::default() };
    let opened = open(&SceneSource::File(file), &LoadOptions::default(), &wishes);
    let mut app = opened.unwrap_or_else(|error| panic!("{error}")).app;
    app.world.resource_mut::<FrameBudget>().sample_target = 4;
    app.frame();
    let film = app.world.resource::<Film>();
    assert_eq!((film.dropped(), film.looked_at()), (0, 1.0));
    let shown = develop(film, None, app.world.resource::<Display>());
    let middle = &shown[4 * (6 * 16 + 8)..][..3];
    assert!(middle.iter().all(|c| *c >= 254), "{middle:?}");
}
