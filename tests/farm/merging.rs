//! Films added up: the film of a single run, or a refusal.

use super::{encode, fails, fresh, made_up, penumbra, succeeds};
use glam::UVec2;
use penumbra::farm::{FilmFile, Ranges, merge};
use proptest::prelude::*;
use std::path::{Path, PathBuf};

const SMALL: [&str; 6] = ["render", "bust", "--resolution", "53x37", "--integrator", "path"];

fn render(folder: &Path, more: &[&str]) {
    succeeds(folder, &[&SMALL, more].concat());
}

fn same_bytes(folder: &Path, a: &str, b: &str) {
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(read(a) == read(b), "{a} and {b} differ");
}

#[test]
fn merged_parts_are_the_single_run_bit_for_bit() {
    let folder = fresh("merge");
    render(&folder, &["--spp", "24", "-o", "one.film", "-o", "one.exr", "-o", "one.png"]);
    for (range, name, threads) in [
        ("0..5", "a.film", "1"),
        ("5..6", "b.film", "2"),
        ("6..20", "c.film", "3"),
        ("20..24", "d.film", "0"),
    ] {
        render(&folder, &["--sample-range", range, "-o", name, "--threads", threads]);
    }
    // In any order, at once or by and by.
    succeeds(
        &folder,
        &[
            "merge", "d.film", "b.film", "a.film", "c.film", "-o", "all.film", "-o", "all.exr", "-o",
            "all.png",
        ],
    );
    succeeds(&folder, &["merge", "a.film", "b.film", "-o", "ab.film"]);
    succeeds(&folder, &["merge", "d.film", "c.film", "-o", "cd.film", "--sample-range", "6..24"]);
    succeeds(&folder, &["merge", "cd.film", "ab.film", "-o", "by.film", "--sample-range", "0..24"]);
    for (name, one) in
        [("all.film", "one.film"), ("all.exr", "one.exr"), ("all.png", "one.png"), ("by.film", "one.film")]
    {
        same_bytes(&folder, name, one);
    }
    // And it would be seen if they were not.
    let other: Vec<u8> = std::fs::read(folder.join("ab.film")).unwrap();
    assert!(other != std::fs::read(folder.join("one.film")).unwrap());
}

#[test]
fn what_does_not_belong_together_is_named() {
    let folder = fresh("refusals");
    render(&folder, &["--sample-range", "0..4", "-o", "a.film"]);
    render(&folder, &["--sample-range", "4..8", "-o", "b.film"]);
    render(&folder, &["--sample-range", "6..8", "-o", "late.film"]);
    let merge = |films: &[&str], words: &[&str]| {
        fails(&folder, &[&["merge", "-o", "x.exr"], films].concat(), words);
        assert!(!folder.join("x.exr").exists());
    };
    merge(&["a.film", "a.film"], &["a.film and a.film", "0..4"]);
    merge(&["a.film", "b.film", "late.film"], &["b.film and late.film", "6..8", "leave one out"]);
    merge(&["a.film", "late.film"], &["4..6", "missing", "--allow-gaps"]);
    // Also at the beginning.
    merge(&["b.film"], &["0..4", "missing", "--allow-gaps", "--sample-range 4..8"]);
    merge(&["b.film", "--sample-range", "0..8"], &["0..4", "missing"]);
    succeeds(&folder, &["merge", "b.film", "-o", "b.exr", "--sample-range", "4..8"]);
    succeeds(&folder, &["merge", "b.film", "-o", "b.film", "-o", "b.exr", "--allow-gaps"]);
    merge(&["a.film", "b.film", "--sample-range", "0..16"], &["8..16", "missing"]);
    merge(&["a.film", "b.film", "--sample-range", "0..6"], &["b.film", "4..8", "not within 0..6"]);
    let others: [(&[&str], &str); 8] = [
        (&["--seed", "7"], "seed 7, not 0"),
        (&["--max-depth", "3"], "max depth 3, not 8"),
        (&["--resolution", "53x36"], "size 53x36, not 53x37"),
        (&["--integrator", "direct"], "integrator direct, not path"),
        (&["--filter", "nearest"], "texture filter nearest, not file"),
        (&["--camera-position", "0,1,4"], "camera perspective"),
        (&["--camera-view-angle", "20.001"], "camera perspective"),
        (&[], "scene \"cornell\""),
    ];
    for (more, words) in others {
        let scene = if more.is_empty() { "cornell" } else { "bust" };
        let mut arguments = vec!["render", scene, "--sample-range", "4..8", "-o", "other.film"];
        for pair in
            ["--resolution", "53x37", "--integrator", "path"].chunks(2).filter(|p| !more.contains(&p[0]))
        {
            arguments.extend(pair);
        }
        arguments.extend(more);
        succeeds(&folder, &arguments);
        merge(&["a.film", "other.film"], &["other.film", "not of the same picture as a.film", words]);
        // To go on with it is refused for the same reason, the other way round.
        let mut resume = vec!["--resume", "other.film", "-o", "x.exr"];
        resume.splice(0..0, SMALL);
        fails(&folder, &resume, &["other.film", "not of the same picture", words]);
    }
    // Told so, samples may be missing, and come later.
    succeeds(
        &folder,
        &["merge", "a.film", "late.film", "-o", "holes.film", "-o", "holes.exr", "--allow-gaps"],
    );
    merge(&["holes.film"], &["4..6", "missing"]);
    fails(&folder, &[&SMALL[..], &["--resume", "holes.film"]].concat(), &["holes.film", "0..4, 6..8"]);
    render(&folder, &["--sample-range", "4..6", "-o", "between.film"]);
    succeeds(&folder, &["merge", "holes.film", "between.film", "-o", "mended.film"]);
    render(&folder, &["--spp", "8", "-o", "one.film"]);
    same_bytes(&folder, "mended.film", "one.film");
    let (code, said) = penumbra(&folder, &["merge", "a.film", "-o", "x.jpg"]);
    assert!(code == Some(2) && said.contains(".film"), "{said}");
}

/// A setting of the scene that nobody sees in its name: the light is a little brighter.
#[test]
fn another_scene_under_the_same_name_is_foreign() {
    let folder = fresh("hash");
    let scene = |light: &str| {
        let text = format!(
            "[[light]]\nkind = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\nradiance = [{light}, 1, 1]\n\
             [camera]\nposition = [0, 0, 5]\ntarget = [0, 0, 0]\n"
        );
        std::fs::write(folder.join("scene.toml"), text).unwrap();
    };
    let film = |name: &str, range: &str| {
        succeeds(
            &folder,
            &["render", "scene.toml", "--resolution", "8x8", "--sample-range", range, "-o", name],
        );
    };
    scene("1");
    film("a.film", "0..1");
    scene("1.0000001");
    film("b.film", "1..2");
    fails(&folder, &["merge", "a.film", "b.film", "-o", "x.png"], &["b.film", "scene \"scene\""]);
    scene("1.0");
    std::fs::rename(folder.join("scene.toml"), folder.join("renamed.toml")).unwrap();
    let renamed = ["render", "renamed.toml", "--resolution", "8x8", "--sample-range", "1..2", "-o", "c.film"];
    succeeds(&folder, &renamed);
    succeeds(&folder, &["merge", "a.film", "c.film", "-o", "x.png"]);
}

#[test]
fn a_film_gone_on_with_is_the_single_run() {
    let folder = fresh("resume");
    render(&folder, &["--spp", "24", "-o", "one.film", "-o", "one.png"]);
    render(&folder, &["--spp", "7", "-o", "part.film"]);
    render(&folder, &["--spp", "24", "--resume", "part.film", "-o", "part.film", "-o", "part.png"]);
    same_bytes(&folder, "part.film", "one.film");
    same_bytes(&folder, "part.png", "one.png");
    // All there already: nothing is traced, and nothing changed.
    render(&folder, &["--resume", "part.film", "-o", "again.film"]);
    same_bytes(&folder, "again.film", "one.film");
    // A range goes on within itself.
    render(&folder, &["--sample-range", "8..12", "-o", "range.film"]);
    render(&folder, &["--sample-range", "8..20", "--resume", "range.film", "-o", "range.film"]);
    render(&folder, &["--sample-range", "8..20", "-o", "whole.film"]);
    same_bytes(&folder, "range.film", "whole.film");
    let other = [&SMALL[..], &["--sample-range", "4..20", "--resume", "range.film"]].concat();
    fails(&folder, &other, &["range.film", "begins at sample 8, not 4"]);
}

#[cfg(unix)]
#[test]
fn an_interrupted_film_goes_on_to_its_plan() {
    let folder = fresh("interrupt");
    let size = ["render", "cornell", "--resolution", "320x240", "-q"];
    // Long enough to be in the middle of it after some time, whatever the machine does.
    let child = std::process::Command::new(env!("CARGO_BIN_EXE_penumbra"))
        .args(size)
        .args(["--sample-range", "10..400", "-o", "part.film"])
        .current_dir(&folder)
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(700));
    let kill = std::process::Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let code = child.wait_with_output().unwrap().status.code();
    assert_eq!(code, Some(130), "interrupted, unless the machine is very fast");
    let film = FilmFile::read(&folder.join("part.film")).unwrap();
    let (fewest, _) = film.samples();
    assert!(fewest < 390 && film.header.planned == Some(10..400), "{fewest}");
    // Merged as it is, somebody would miss samples.
    let missing = ["part.film", "missing", "part.film holds", "of its 10..400", "--resume"];
    fails(&folder, &["merge", "part.film", "-o", "x.png"], &missing);
    succeeds(&folder, &["merge", "part.film", "-o", "x.png", "--allow-gaps"]);
    // Without another word it goes on to where it was to go.
    succeeds(&folder, &[&size[..], &["--resume", "part.film", "-o", "part.film"]].concat());
    succeeds(&folder, &[&size[..], &["--sample-range", "10..400", "-o", "one.film"]].concat());
    same_bytes(&folder, "part.film", "one.film");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Samples dealt to films tile by tile, as interruptions would: the sum doesn't care.
    #[test]
    fn any_dealing_of_samples_adds_up(cuts in proptest::collection::vec(0u32..40, 8), order: bool) {
        let folder = super::support::folder("farm-dealing");
        let size = UVec2::new(15, 10);
        // Tile i is cut in two places.
        let cut = |i: usize| {
            let mut cut = [cuts[i % 8], cuts[(i * 3 + 1) % 8]];
            cut.sort_unstable();
            cut
        };
        let parts = [
            made_up(size, None, |i| Ranges::from(0..cut(i)[0])),
            made_up(size, None, |i| Ranges::from(cut(i)[0]..cut(i)[1])),
            made_up(size, Some(0..40), |i| Ranges::from(cut(i)[1]..40)),
        ];
        let mut paths: Vec<PathBuf> = Vec::new();
        for (i, part) in parts.iter().enumerate() {
            paths.push(folder.join(format!("{i}.film")));
            std::fs::write(&paths[i], encode(part)).unwrap();
        }
        if order {
            paths.reverse();
        }
        let whole = made_up(size, Some(0..40), |_| Ranges::from(0..40));
        let sum = merge(&paths, None, false).unwrap().unwrap();
        prop_assert!(sum.film == whole.film && sum.held == whole.held);
        // One sample of one tile twice, or missing, is found.
        let twice = folder.join("twice.film");
        let last = |i: usize| if i == 3 { Ranges::from(39..40) } else { Ranges::default() };
        std::fs::write(&twice, encode(&made_up(size, None, last))).unwrap();
        let line = merge(&[paths.clone(), vec![twice]].concat(), None, false).unwrap_err().to_string();
        prop_assert!(line.contains("39..40") && line.contains("pixel 8,8"), "{}", line);
        // The part that is left out may hold nothing.
        let nothing = (0..4).all(|i| if order { cut(i)[0] == 0 } else { cut(i)[1] == 40 });
        match merge(&paths[..2], Some(0..40), false) {
            Ok(_) => prop_assert!(nothing),
            Err(error) => prop_assert!(!nothing && error.to_string().contains("missing"), "{}", error),
        }
    }
}
