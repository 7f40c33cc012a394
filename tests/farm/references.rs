//! Films to measure errors by, and to compare.

use super::{fails, fresh, penumbra, succeeds};

const SMALL: [&str; 4] = ["render", "cornell", "--resolution", "32x24"];

#[test]
fn a_film_of_the_same_samples_is_no_reference() {
    let folder = fresh("reference");
    let render = |more: &[&str]| succeeds(&folder, &[&SMALL, more].concat());
    render(&["--spp", "64", "-o", "same.film"]);
    render(&["--spp", "64", "--seed", "3", "-o", "other.film"]);
    render(&["--sample-range", "1000..1064", "-o", "later.film"]);
    let log = |reference: &'static str, more: &[&'static str]| {
        [&SMALL[..], &["-o", "x.exr", "--error-log", "log.csv", "--reference", reference], more].concat()
    };
    let words = ["same.film", "0..", "seed 0", "--seed 1"];
    fails(&folder, &log("same.film", &["--spp", "8"]), &words);
    // With other settings some of it is still the same.
    fails(&folder, &log("same.film", &["--spp", "8", "--max-depth", "1"]), &words);
    fails(&folder, &log("same.film", &["--time-limit", "0.2"]), &words);
    assert!(!folder.join("x.exr").exists() && !folder.join("log.csv").exists(), "before any work");
    for (reference, more) in [
        ("other.film", ["--spp", "8"]),
        ("later.film", ["--spp", "8"]),
        ("same.film", ["--seed", "1"]),
        ("same.film", ["--sample-range", "64..72"]),
    ] {
        succeeds(&folder, &log(reference, &more));
    }
    // What cannot be told to be apart is not.
    fails(&folder, &log("later.film", &["--time-limit", "0.2"]), &["later.film", "1000..1064"]);
}

#[test]
fn a_report_takes_a_film_of_another_seed() {
    let folder = fresh("report-reference");
    let render = |seed: &str, name: &str| {
        let arguments =
            ["render", "cornell", "--resolution", "16x16", "--spp", "64", "--seed", seed, "-o", name];
        succeeds(&folder, &arguments);
    };
    render("0", "same.film");
    render("12345", "other.film");
    let report = |reference: &'static str| {
        let to = ["--time", "2", "--out", "out", "-q", "--reference", reference];
        [&["report", "cornell", "--resolution", "16x16"][..], &to].concat()
    };
    fails(&folder, &report("same.film"), &["same.film", "seed 0", "--seed 12345"]);
    succeeds(&folder, &report("other.film"));
}

#[test]
fn films_are_compared_as_pictures_are() {
    let folder = fresh("compare");
    let render = |more: &[&str]| succeeds(&folder, &[&SMALL, more].concat());
    render(&["--spp", "16", "-o", "a.film", "-o", "a.exr"]);
    render(&["--spp", "16", "--seed", "1", "-o", "b.film"]);
    let (code, said) = penumbra(&folder, &["compare", "a.film", "a.exr", "--fail-above", "0"]);
    assert!(code == Some(0) && said.is_empty(), "{said}");
    let (code, said) = penumbra(&folder, &["compare", "a.film", "b.film", "--fail-above", "1e-9"]);
    assert!(code == Some(5) && said.is_empty(), "{said}");
    let (code, said) = penumbra(&folder, &["compare", "a.film", "a.film"]);
    assert!(code == Some(0) && said.starts_with("warning: ") && said.contains("0..16"), "{said}");
    std::fs::write(folder.join("y"), "no picture").unwrap();
    fails(&folder, &["compare", "a.film", "y"], &["y: is no picture", ".png", ".exr", ".film"]);
    fails(&folder, &["compare", "a.film", "gone.film"], &["gone.film", "check the name"]);
    std::fs::write(folder.join("no.film"), "no film").unwrap();
    fails(&folder, &["compare", "no.film", "a.exr"], &["no.film", "is not a film"]);
}
