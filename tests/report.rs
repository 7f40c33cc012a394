//! `penumbra report` as a user runs it: files, figures, references.

mod support;

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn report(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_penumbra"))
        .arg("report")
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn fresh(test: &str) -> PathBuf {
    let folder = support::folder(test);
    std::fs::remove_dir_all(&folder).unwrap();
    support::folder(test)
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn json(folder: &Path) -> Value {
    serde_json::from_str(&read(&folder.join("report.json"))).unwrap()
}

/// Addresses that a browser would fetch.
fn fetched(html: &str) -> Vec<&str> {
    ["src=\"", "href=\"", "url("]
        .iter()
        .flat_map(|attribute| html.match_indices(attribute).map(|(at, found)| &html[at + found.len()..]))
        .filter(|target| !target.starts_with("data:"))
        .map(|target| &target[..target.len().min(40)])
        .collect()
}

#[test]
fn the_checker_of_addresses_finds_them() {
    assert_eq!(fetched("<img src=\"https://a.b/c\"> <img src=\"data:image/png;base64,AA\">").len(), 1);
}

#[test]
fn a_quick_report_has_all_files_and_its_figures_make_sense() {
    let folder = fresh("report-quick");
    let arguments = ["cornell", "--quick", "--resolution", "40x40", "--time", "24", "--out", "out"];
    let output = report(&folder, &arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(output.stdout.is_empty() && said.contains("index.html"), "{said}");
    let out = folder.join("out");
    let svgs = ["cornell-seconds.svg", "cornell-samples.svg", "cornell-samples-surfaces.svg"];
    for name in ["index.html", "report.md", "report.csv", "report.json"].iter().chain(&svgs) {
        assert!(read(&out.join(name)).len() > 500, "{name}");
    }
    for name in ["ours", "reference", "error-ours", "error-random", "worst"] {
        image::open(out.join(format!("cornell-{name}.png"))).unwrap();
    }
    let parts = std::fs::read_dir(&out).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap());
    assert!(!parts.into_iter().any(|name| name.ends_with(".part")), "no half-written files");

    let html = read(&out.join("index.html"));
    assert_eq!(fetched(&html), Vec::<&str>::new());
    for needed in ["<svg", "data:image/png;base64,", "prefers-color-scheme", "slope −1/2", "Worst pixels"] {
        assert!(html.contains(needed), "{needed}");
    }

    let findings = json(&out);
    let scene = &findings["scenes"][0];
    assert_eq!((&scene["width"], &scene["name"]), (&40.into(), &"cornell".into()));
    assert_eq!(scene["facts"]["triangles"], 34);
    for (key, low, high) in [
        ("/facts/build_ms", 0.0, 1e3),
        ("/facts/mesh_levels", 1.0, 10.0),
        ("/facts/largest_leaf", 1.0, 8.0),
        ("/facts/seconds_to_first_picture", 0.0, 10.0),
        ("/performance/samples_per_second", 10.0, 1e6),
        ("/performance/shadow_rays_per_second", 1e3, 1e10),
        ("/reference/made/standard_error", 1e-7, 1e-2),
    ] {
        let value = scene.pointer(key).and_then(Value::as_f64).unwrap_or(f64::NAN);
        assert!((low..=high).contains(&value), "{key} is {value}");
    }
    let methods = scene["methods"].as_array().unwrap();
    let method = |name: &str| methods.iter().find(|m| m["name"] == name).unwrap();
    let at = |samples: u32, name: &str, of: &str| {
        let points = method(name)[of]["curve"].as_array().unwrap();
        points.iter().find(|p| p["samples"] == samples).unwrap()["rmse"].as_f64().unwrap()
    };
    // Between two counts that every machine has time for: a fit's depends on how many more there are.
    let slope_of = |name: &str, of: &str| (at(16, name, of) / at(1, name, of)).log2() / 4.0;
    let slope = |name: &str| slope_of(name, "surfaces");
    assert!(methods.len() >= 7 && methods.iter().all(|m| m["runs"].as_array().unwrap().len() == 4));
    println!(
        "slopes: random {:.3}, even {:.3}; all: ours {:.3}, even {:.3}",
        slope("random"),
        slope("even"),
        slope_of("ours", "all"),
        slope_of("even", "all")
    );
    let fitted = method("random")["surfaces"]["slope"]["slope"].as_f64().unwrap();
    // Over as many samples as there was time for; each mean of four runs is some hundredths off.
    assert!((fitted + 0.5).abs() < 0.05, "{fitted}");
    assert!((slope("random") + 0.5).abs() < 0.03, "{}", slope("random"));
    // What is left to sample are edges, above all that of the lamp.
    assert!(slope("even") < -0.55, "{}", slope("even"));
    let (ours, even) = (slope_of("ours", "all"), slope_of("even", "all"));
    assert!(ours < -0.7 && even < -0.7, "{ours} {even}");
    // Each thing switched off costs something, at equal samples.
    let at_16 = |name: &str, of: &str| at(16, name, of);
    assert!(at_16("ours", "all") < at_16("even", "all"));
    for worse in ["random", "stratified", "random-pixel"] {
        assert!(at_16("even", "surfaces") < at_16(worse, "surfaces"), "{worse}");
    }
    // Where all light is computed, how it would be sampled makes no difference.
    assert!(at_16("ours", "surfaces") < at_16("no-shafts", "surfaces"));
    let check = &scene["noise_check"];
    assert_eq!(check["runs"], 100);
    assert!((check["unweighted"].as_f64().unwrap() - 1.0).abs() < 0.1, "{check}");
    let rows = read(&out.join("report.csv")).lines().count();
    let points: usize = methods
        .iter()
        .flat_map(|m| m["runs"].as_array().unwrap())
        .map(|run| run["points"].as_array().unwrap().len())
        .sum();
    assert_eq!(rows, points + 1, "the CSV holds every measurement");
}

#[test]
fn a_reference_is_made_once_and_a_given_one_must_fit() {
    let folder = fresh("report-references");
    let run = |more: &[&str]| {
        let mut arguments =
            vec!["cornell-point", "--resolution", "16x16", "--time", "3", "--out", "out", "-q"];
        arguments.extend(more);
        report(&folder, &arguments)
    };
    let origin = |folder: &Path| json(folder)["scenes"][0]["reference"]["origin"].clone();
    let out = folder.join("out");
    assert_eq!(run(&[]).status.code(), Some(0));
    assert_eq!(origin(&out), "made");
    assert_eq!(run(&[]).status.code(), Some(0));
    assert_eq!(origin(&out), "cached");
    assert_eq!(run(&["--max-depth", "3"]).status.code(), Some(0));
    assert_eq!(origin(&out), "made", "other settings, other reference");
    let references = || {
        let files = std::fs::read_dir(out.join("references")).unwrap().map(|f| f.unwrap().path());
        files.filter(|path| path.extension().is_some_and(|e| e == "exr")).collect::<Vec<_>>()
    };
    let exr = references().pop().unwrap().display().to_string();
    assert_eq!(run(&["--reference", &exr]).status.code(), Some(0));
    assert_eq!(origin(&out), "given");
    let output = run(&["--reference", &format!("cornell-point={exr}"), "--resolution", "24x16"]);
    // clap takes an argument once: the size is given in a run of its own.
    assert_eq!(output.status.code(), Some(2));
    let output =
        report(&folder, &["cornell-point", "--resolution", "24x16", "--time", "3", "--reference", &exr]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    for word in [exr.as_str(), "16x16", "24x16", "cornell-point"] {
        assert!(said.contains(word), "{word} in {said}");
    }
    let output = run(&["--reference", &format!("nobody={exr}")]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && said.contains("nobody"), "{said}");
}

#[test]
fn what_cannot_be_written_or_read_is_one_line() {
    let folder = fresh("report-refused");
    std::fs::write(folder.join("file"), "in the way").unwrap();
    for (arguments, code, word) in [
        (vec!["cornell", "--out", "file"], 1, "file"),
        (vec!["cornel", "--out", "out"], 3, "did you mean"),
        (vec!["nothing.glb", "--time", "1", "--out", "out"], 3, "nothing.glb"),
        (vec!["cornell", "--seeds", "0"], 2, "--seeds"),
    ] {
        let output = report(&folder, &arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(word) && !said.contains("panicked"), "{said}");
        assert_eq!(said.lines().filter(|line| line.starts_with("error")).count(), 1, "{said}");
    }
}

#[cfg(unix)]
#[test]
fn an_interruption_writes_what_there_is() {
    let folder = fresh("report-interrupt");
    let mut child = Command::new(env!("CARGO_BIN_EXE_penumbra"))
        .args(["report", "cornell", "--resolution", "32x32", "--time", "60", "--out", "out", "-q"])
        .current_dir(&folder)
        .spawn()
        .unwrap();
    // The reference takes nine seconds of the twenty; then come the methods.
    std::thread::sleep(std::time::Duration::from_secs(14));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let findings = json(&folder.join("out"));
    assert_eq!(findings["interrupted"], true);
    assert!(read(&folder.join("out/index.html")).contains("Interrupted"));
}
