//! The program as a user runs it: exit codes, messages, files.

mod support;

use image::GenericImageView;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn penumbra(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_penumbra"))
        .args(arguments)
        .current_dir(folder)
        // No display, whatever the machine has.
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn run(test: &str, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = penumbra(&support::folder(test), arguments);
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

fn fresh(test: &str) -> PathBuf {
    let folder = support::folder(test);
    std::fs::remove_dir_all(&folder).unwrap();
    support::folder(test)
}

#[test]
fn instructions_are_those_that_are_asked_for() {
    for isa in ["scalar", "sse2"] {
        let arguments =
            ["render", "cornell", "--spp", "1", "--resolution", "16x12", "--json", "-q", "--isa", isa];
        let (code, json, errors) = run("isa", &arguments);
        assert_eq!(code, Some(0), "{errors}");
        let summary: Value = serde_json::from_str(&json).unwrap();
        let native = if cfg!(target_arch = "x86_64") { isa } else { "neon" };
        assert_eq!(summary["isa"], if isa == "scalar" { isa } else { native });
    }
    let (code, _, errors) = run("isa", &["render", "cornell", "--isa", "mmx"]);
    assert_eq!(code, Some(2));
    assert!(errors.contains("mmx"), "{errors}");
}

#[test]
fn a_render_writes_what_is_asked_for_and_says_what_it_did() {
    let folder = fresh("render");
    let arguments =
        ["render", "cornell", "-o", "a.png", "-o", "a.exr", "--spp", "4", "--resolution", "48x32", "--json"];
    let output = penumbra(&folder, &arguments);
    assert_eq!(output.status.code(), Some(0));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&json["samples"], &json["width"], &json["height"]), (&4.0.into(), &48.into(), &32.into()));
    assert_eq!(json["rays"]["camera"], 48 * 32 * 4);
    // Of what the scene has not got it says that nothing was done for it.
    for feature in ["mirror_rays", "texture_lookups", "alpha_tests", "light_choices"] {
        assert_eq!(json["rays"]["features"][feature], 0, "{feature} in {json}");
    }
    for key in ["load_seconds", "build_seconds", "render_seconds", "first_picture_seconds", "noise"] {
        assert!(json[key].as_f64().is_some_and(|x| x > 0.0), "{key} in {json}");
    }
    if cfg!(target_os = "linux") {
        assert!(json["peak_memory_bytes"].as_u64().unwrap() > 1 << 20);
    }
    assert_eq!(image::open(folder.join("a.png")).unwrap().dimensions(), (48, 32));
    let exr = image::open(folder.join("a.exr")).unwrap();
    assert!(
        matches!(exr, image::DynamicImage::ImageRgb32F(_))
            || matches!(exr, image::DynamicImage::ImageRgba32F(_))
    );
    let left: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|f| f.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "no half-written files: {left:?}");
}

#[test]
fn a_name_without_ending_means_both_files() {
    let folder = fresh("both");
    let output = penumbra(&folder, &["cornell", "-o", "picture", "--spp", "1", "--resolution", "8x8", "-q"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stderr.is_empty(), "quiet");
    assert!(folder.join("picture.png").is_file() && folder.join("picture.exr").is_file());
}

#[test]
fn without_a_display_the_picture_goes_to_a_file() {
    let folder = fresh("display");
    let output = penumbra(&folder, &["cornell-point", "--spp", "1", "--resolution", "16x16"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(folder.join("cornell-point.png").is_file(), "{said}");
    if cfg!(all(feature = "view", target_os = "linux")) {
        assert!(said.contains("no window") && said.contains("DISPLAY"), "{said}");
    }
}

#[test]
fn exit_codes_are_those_of_the_documentation() {
    let folder = fresh("codes");
    std::fs::write(folder.join("broken.glb"), b"glTF but not really").unwrap();
    std::fs::write(folder.join("wrong.toml"), "[[light]]\nkind = \"sphere\"\nradius = -1\n").unwrap();
    let needs = r#"{"asset":{"version":"2.0"},"extensionsRequired":["MSFT_texture_dds"],
        "extensionsUsed":["MSFT_texture_dds"]}"#;
    std::fs::write(folder.join("needs.gltf"), needs).unwrap();
    let small = ["--spp", "1", "--resolution", "4x4"];
    for (arguments, code, words) in [
        (vec!["render", "nothing.glb", "-o", "a.png"], 3, vec!["nothing.glb"]),
        (vec!["render", "broken.glb", "-o", "a.png"], 3, vec!["broken.glb"]),
        (vec!["render", "needs.gltf", "-o", "a.png"], 3, vec!["needs.gltf", "MSFT_texture_dds"]),
        (vec!["render", "cornel", "-o", "a.png"], 3, vec!["cornel", "did you mean", "cornell"]),
        (vec!["nothing.glb"], 3, vec!["nothing.glb"]),
        (
            vec!["render", "cornell", "--scene-settings", "wrong.toml", "-o", "a.png"],
            3,
            vec!["wrong.toml", "line"],
        ),
        (vec!["render", "cornell", "-o", "a.jpg"], 2, vec!["a.jpg", ".png", ".exr"]),
        (vec!["render", "cornell", "--camera", "nobody", "-o", "a.png"], 2, vec!["nobody"]),
        (vec!["render", "cornell", "--resolution", "0x0"], 2, vec!["0x0"]),
        (vec!["render", "cornell", "--time-limit", "0"], 2, vec!["--time-limit", "0.001 or more"]),
        (vec!["render", "cornell", "--time-limit=-1"], 2, vec!["--time-limit", "0.001 or more"]),
        (vec!["render", "cornell", "--time-limit", "nan"], 2, vec!["--time-limit", "0.001 or more"]),
        (vec!["report", "cornell", "--time", "0"], 2, vec!["--time", "0.001 or more"]),
        (vec!["render", "--sppp", "1"], 2, vec!["--spp"]),
        (
            vec!["render", "cornell", "--resolution", "9x9", "--crop", "3,3,7,2"],
            2,
            vec!["--crop 3,3,7,2", "9x9"],
        ),
        (vec!["render", "cornell", "--crop", "3,3,7"], 2, vec!["X,Y,W,H"]),
        (vec!["render", "cornell", "--crop", "0,0,7,7", "-o", "a.film"], 2, vec!["--crop", "film"]),
        (vec!["render", "cornell", "-o", "no/such/folder/a.png"], 1, vec!["no/such/folder/a.png"]),
        (vec!["compare", "no.png", "no.exr"], 1, vec!["no.png"]),
    ] {
        let mut all = arguments.clone();
        if code != 2 && arguments[0] == "render" {
            all.extend(small);
        }
        let output = penumbra(&folder, &all);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{all:?}: {said}");
        for word in words {
            assert!(said.contains(word), "{all:?} should say {word}: {said}");
        }
        assert!(!said.contains("panicked"), "{said}");
        let errors = said.lines().filter(|line| line.starts_with("error")).count();
        assert_eq!(errors, 1, "one line: {said}");
    }
}

#[test]
fn sample_ranges_are_the_samples_of_the_whole() {
    let folder = fresh("ranges");
    let picture = |name: &str, range: &[&str]| {
        let mut arguments = vec!["render", "cornell", "--resolution", "24x16", "-q", "-o", name];
        arguments.extend(range);
        assert_eq!(penumbra(&folder, &arguments).status.code(), Some(0));
        image::open(folder.join(name)).unwrap().into_rgb32f().into_raw()
    };
    let whole = picture("whole.exr", &["--spp", "12"]);
    let first = picture("first.exr", &["--sample-range", "0..4"]);
    let rest = picture("rest.exr", &["--sample-range", "4..12", "-t", "1"]);
    assert_ne!(first, rest);
    for ((whole, first), rest) in whole.iter().zip(&first).zip(&rest) {
        let merged = (f64::from(*first) * 4.0 + f64::from(*rest) * 8.0) / 12.0;
        assert!((merged - f64::from(*whole)).abs() <= 1e-6 * merged.max(1e-3), "{merged} {whole}");
    }
}

#[test]
fn a_crop_is_that_part_of_the_whole_picture() {
    let folder = fresh("crop");
    let picture = |name: &str, flags: &[&str]| {
        let arguments = ["render", "cornell", "--resolution", "64x48", "--spp", "4", "-q", "--json", "-o"];
        let output = penumbra(&folder, &[&arguments, &[name][..], flags].concat());
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        let json: Value = serde_json::from_slice(&output.stdout).unwrap();
        (image::open(folder.join(name)).unwrap().into_rgb32f(), json)
    };
    for integrator in ["direct", "path"] {
        for ending in ["png", "exr"] {
            let flags = ["--integrator", integrator];
            let (whole, json) = picture(&format!("whole.{ending}"), &flags);
            assert_eq!(json["crop"], Value::Null);
            // Neither begins nor ends where tiles do.
            let (part, json) =
                picture(&format!("part.{ending}"), &[&flags[..], &["--crop", "19,7,22,30"]].concat());
            assert_eq!(json["crop"], serde_json::json!([19, 7, 22, 30]));
            assert_eq!(part.dimensions(), (22, 30));
            assert!(
                part == image::imageops::crop_imm(&whole, 19, 7, 22, 30).to_image(),
                "{integrator} {ending}"
            );
            assert!(part.pixels().any(|pixel| pixel[0] > 0.1), "something is seen");
        }
    }
}

#[test]
fn a_time_limit_ends_the_render_with_a_picture() {
    let folder = fresh("limit");
    let arguments = ["render", "cornell", "-o", "a.exr", "--time-limit", "0.3", "--json", "-q"];
    let output = penumbra(&folder, &arguments);
    assert_eq!(output.status.code(), Some(0), "no target was set, so none was missed");
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(
        json["render_seconds"].as_f64().unwrap() < 3.0 && json["samples"].as_f64().unwrap() > 0.0,
        "{json}"
    );
    let output =
        penumbra(&folder, &["render", "cornell", "-o", "b.png", "--time-limit", "0.2", "--spp", "100000"]);
    assert_eq!(output.status.code(), Some(4), "stopped before the target");
    assert!(folder.join("b.png").is_file());
}

#[cfg(unix)]
#[test]
fn an_interruption_saves_what_there_is() {
    let folder = fresh("interrupt");
    let mut child = Command::new(env!("CARGO_BIN_EXE_penumbra"))
        .args(["render", "cornell", "-o", "half.png", "--spp", "1000000", "--json", "-q"])
        .current_dir(&folder)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_secs(1));
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let status = child.wait().unwrap();
    assert_eq!(status.code(), Some(130));
    let json: Value = serde_json::from_reader(child.stdout.take().unwrap()).unwrap();
    assert_eq!(json["interrupted"], true);
    assert!(image::open(folder.join("half.png")).is_ok());
}

#[test]
fn compare_measures_and_judges() {
    let folder = fresh("compare");
    for (name, spp) in [("rough.png", "2"), ("fine.exr", "32")] {
        let arguments =
            ["render", "cornell", "--resolution", "32x32", "--exposure", "0", "-q", "-o", name, "--spp", spp];
        assert_eq!(penumbra(&folder, &arguments).status.code(), Some(0));
    }
    let (code, out, _) = run("compare", &["compare", "fine.exr", "fine.exr", "--json"]);
    let json: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, json["rmse"].as_f64()), (Some(0), Some(0.0)));
    let (code, out, _) = run("compare", &["compare", "rough.png", "fine.exr"]);
    assert_eq!(code, Some(0));
    for word in ["RMSE", "relMSE", "max error"] {
        assert!(out.contains(word), "{out}");
    }
    assert_eq!(run("compare", &["compare", "rough.png", "fine.exr", "--fail-above", "1e-9"]).0, Some(5));
    assert_eq!(run("compare", &["compare", "rough.png", "fine.exr", "--fail-above", "100"]).0, Some(0));
    let small = ["render", "cornell", "--resolution", "8x8", "-q", "-o", "small.png", "--spp", "1"];
    assert_eq!(penumbra(&folder, &small).status.code(), Some(0));
    let (code, _, said) = run("compare", &["compare", "small.png", "fine.exr"]);
    assert!(code == Some(1) && said.contains("8x8") && said.contains("32x32"), "{said}");
}

#[test]
fn built_in_scenes_are_listed_and_open() {
    let (code, out, _) = run("list", &["--list-scenes"]);
    assert_eq!(code, Some(0));
    let names: Vec<&str> = out.lines().filter_map(|line| line.split_whitespace().next()).collect();
    for name in ["cornell", "cornell-point", "gallery", "checker", "mirrors", "bust"] {
        assert!(names.contains(&name), "{name} in {out}");
    }
    for name in names {
        let (code, out, said) =
            run("list", &["render", name, "--spp", "1", "--resolution", "32x18", "--json", "-q"]);
        assert_eq!(code, Some(0), "{name}: {said}");
        let json: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(json["dropped_samples"], 0, "{name}");
        assert_eq!(json["warnings"].as_array().unwrap().len(), 0, "{name}: {json}");
    }
}

#[test]
fn camera_flags_move_the_camera() {
    let (_, one, _) = run(
        "camera",
        &["render", "bust", "--resolution", "24x24", "--spp", "2", "-q", "-o", "a.exr", "--json"],
    );
    assert!(!one.is_empty());
    let away =
        ["--camera-position", "0,1,-9", "--camera-focal-point", "0,1,-20", "--camera-view-angle", "30"];
    let mut arguments = vec!["render", "bust", "--resolution", "24x24", "--spp", "2", "-q", "-o", "b.exr"];
    arguments.extend(away);
    assert_eq!(run("camera", &arguments).0, Some(0));
    let folder = support::folder("camera");
    let pixels = |name| image::open(folder.join(name)).unwrap().into_rgb32f().into_raw();
    assert_ne!(pixels("a.exr"), pixels("b.exr"));
}

#[test]
fn a_check_says_how_files_fare_and_ends_with_the_worst() {
    let folder = fresh("check");
    std::fs::write(folder.join("good.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    std::fs::write(folder.join("odd.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\nl 2 3\n").unwrap();
    std::fs::write(folder.join("bad.obj"), "v 0 0 0\nf 1 2 3\n").unwrap();
    let check = |arguments: &[&str]| {
        let output = penumbra(&folder, &[&["check"], arguments].concat());
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let (code, said, errors) = check(&["good.obj", "cornell"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("good.obj: valid\n") && said.contains("1 triangles") && errors.is_empty(),
        "{said}"
    );
    let (code, said, _) = check(&["good.obj", "odd.obj"]);
    assert_eq!(code, Some(6), "{said}");
    assert!(said.contains("ignored       lines (`l`) have no surface: 2 (line 5)"), "{said}");
    let (code, said, _) = check(&["--json", "good.obj", "bad.obj", "odd.obj", "gone.obj"]);
    assert_eq!(code, Some(3));
    let cards: Vec<Value> = said.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let verdicts: Vec<&str> = cards.iter().map(|card| card["verdict"].as_str().unwrap()).collect();
    assert_eq!(verdicts, ["valid", "refused", "repaired", "refused"]);
    assert_eq!(
        (&cards[0]["triangles"], &cards[0]["found"]["meshes"], &cards[2]["ignored"][0]["count"]),
        (&1.into(), &1.into(), &2.into())
    );
    assert!(cards[1]["error"].as_str().unwrap().contains("bad.obj: line 2: index out of range"));
}

#[test]
fn a_folder_is_checked_whole_and_rendered_if_it_has_one_scene() {
    let folder = fresh("folders");
    std::fs::create_dir_all(folder.join("all/deep")).unwrap();
    let scene = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    std::fs::write(folder.join("all/deep/one.obj"), scene).unwrap();
    let render = ["render", "all", "--spp", "1", "--resolution", "8x6", "-q"];
    assert_eq!(penumbra(&folder, &render).status.code(), Some(0));
    assert!(folder.join("one.png").is_file());
    std::fs::write(folder.join("all/two.obj"), format!("{scene}l 1 2\n")).unwrap();
    std::fs::write(folder.join("all/three.obj"), scene).unwrap();
    let output = penumbra(&folder, &render);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("all: is a folder; name one of its scenes"), "{said}");
    for name in ["all", "all/"] {
        let output = penumbra(&folder, &["check", "--json", name]);
        let cards = String::from_utf8(output.stdout).unwrap();
        assert_eq!((output.status.code(), cards.lines().count()), (Some(6), 3), "{cards}");
    }
    std::fs::create_dir_all(folder.join("empty")).unwrap();
    let output = penumbra(&folder, &["check", "empty"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8(output.stdout).unwrap().contains("no .gltf, .glb or .obj file is in it"));
}

#[test]
#[cfg(target_os = "linux")]
fn names_that_are_no_text_are_opened_and_go_into_names_of_pictures() {
    use std::os::unix::ffi::OsStrExt;
    let folder = fresh("no-text");
    let name = |ending: &[u8]| std::ffi::OsStr::from_bytes(&[b"caf\xe9", ending].concat()).to_os_string();
    std::fs::write(folder.join(name(b".obj")), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_penumbra"));
        command.args(arguments).arg(name(b".obj")).current_dir(&folder).stdin(Stdio::null());
        command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        command.output().unwrap().status.code()
    };
    assert_eq!(run(&["check"]), Some(0));
    let small = ["--spp", "1", "--resolution", "8x6", "-q"];
    assert_eq!(run(&[&["render"], &small[..]].concat()), Some(0));
    assert!(folder.join(name(b".png")).is_file());
    std::fs::remove_file(folder.join(name(b".png"))).unwrap();
    // The window, where there is no display.
    assert_eq!(run(&small), Some(0));
    assert!(folder.join(name(b".png")).is_file());
}

#[test]
fn the_manual_has_a_page_for_each_command_with_all_its_flags() {
    let folder = fresh("man");
    let (code, page, _) = run("man", &["man"]);
    assert!(code == Some(0) && page.contains("penumbra\\-render"), "{page}");
    assert_eq!(run("man", &["man", "share/man1"]).0, Some(0));
    for (name, flags) in [
        ("penumbra", vec!["resolution", "replay"]),
        ("penumbra-render", vec!["from", "hdri", "noise"]),
        ("penumbra-merge", vec!["allow-gaps"]),
        ("penumbra-report", vec!["quick"]),
        ("penumbra-torture", vec!["open-edge"]),
        ("penumbra-check", vec!["gltf-scene"]),
    ] {
        let page = std::fs::read_to_string(folder.join(format!("share/man1/{name}.1"))).unwrap();
        for flag in flags {
            let written = format!("\\-\\-{}", flag.replace('-', "\\-"));
            assert!(page.contains(&written), "{name}: {written} in {page}");
        }
    }
    std::fs::write(folder.join("file"), "").unwrap();
    let (code, _, said) = run("man", &["man", "file"]);
    assert!(code == Some(1) && said.contains("file"), "{said}");
}

#[test]
fn who_does_not_read_on_breaks_nothing() {
    let listed = |out: Stdio| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_penumbra"));
        program.args(["torture", "--list"]).stdin(Stdio::null()).stdout(out).stderr(Stdio::piped());
        let output = program.output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    // As `| head` does: nobody reads any more.
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    assert_eq!(listed(writer.into()), (Some(0), String::new()));
    // Where there is no room, what was printed is not there.
    if let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") {
        let (code, said) = listed(full.into());
        assert_eq!(code, Some(1));
        assert!(said.contains("standard output"), "{said}");
    }
}
