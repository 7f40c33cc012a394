//! The program in a real X server, driven as a user drives it.
//!
//! Needs `Xvfb`, `xdotool` and `import` of `ImageMagick`; with `openbox` and `wmctrl` also what only a
//! window manager can do. Without them the tests say that they were skipped, unless `CI` is set or
//! `PENUMBRA_WINDOW_TESTS=required`: then that is a failure.
#![cfg(all(feature = "view", target_os = "linux"))]

#[path = "support/desktop.rs"]
mod desktop;

use desktop::{colors, desktop, difference, pause, wait_for};
use image::RgbImage;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

const SMALL: &[&str] = &["--resolution", "320x240", "--spp", "4"];

#[test]
fn it_starts_shows_a_picture_and_control_q_ends_it() {
    let Some(desktop) = desktop("start") else {
        return;
    };
    let mut program = desktop.start(SMALL);
    desktop.wait_until_done(&mut program);
    assert_eq!(desktop.size(&program), (320, 240));
    assert!(colors(&desktop.shot(&program)) > 50, "the window shows next to nothing");
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
}

#[test]
fn closing_the_window_ends_it_also_while_it_works() {
    let Some(desktop) = desktop("close") else {
        return;
    };
    if desktop.manager.is_none() {
        println!("SKIPPED closing the window: no window manager is installed");
        return;
    }
    let mut program = desktop.start(&["--resolution", "640x480", "--spp", "100000"]);
    pause(1000);
    let start = Instant::now();
    desktop.command("wmctrl").args(["-i", "-c", &program.window]).status().unwrap();
    assert_eq!(program.wait().code(), Some(0));
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
}

#[test]
fn w_moves_the_picture_and_silence_leaves_it() {
    let Some(desktop) = desktop("fly") else {
        return;
    };
    let mut program = desktop.start(SMALL);
    desktop.hide_status(&mut program);
    let before = desktop.shot(&program);
    pause(500);
    assert_eq!(difference(&before, &desktop.shot(&program)), 0.0, "the picture moves by itself");
    desktop.xdotool(["keydown", "w"]);
    pause(400);
    desktop.xdotool(["keyup", "w"]);
    pause(100);
    desktop.wait_until_done(&mut program);
    let after = desktop.shot(&program);
    assert!(difference(&before, &after) > 0.05, "{}", difference(&before, &after));
    // And back again.
    desktop.xdotool(["key", "Return"]);
    pause(100);
    desktop.wait_until_done(&mut program);
    assert_eq!(difference(&before, &desktop.shot(&program)), 0.0, "Enter does not bring the camera back");
}

#[test]
fn a_key_that_is_down_when_the_focus_goes_is_let_go() {
    let Some(desktop) = desktop("focus") else {
        return;
    };
    if desktop.manager.is_none() {
        println!("SKIPPED losing the focus: no window manager is installed");
        return;
    }
    let mut program = desktop.start(SMALL);
    desktop.wait_until_done(&mut program);
    desktop.xdotool(["keydown", "w"]);
    pause(200);
    desktop.xdotool(["windowminimize", &program.window]);
    pause(300);
    desktop.xdotool(["keyup", "w"]);
    desktop.focus(&program);
    // If it still flew, it would never be done.
    desktop.wait_until_done(&mut program);
}

#[test]
fn it_survives_storms_of_resizes() {
    let Some(desktop) = desktop("resize") else {
        return;
    };
    let mut program = desktop.start(&["--resolution", "320x240", "--spp", "16"]);
    for (count, interval, smallest) in [(400, "0.005", 40), (200, "0.020", 200), (100, "0.005", 1)] {
        let mut steps = Vec::new();
        for i in 0..count {
            let (width, height) = (smallest + i * 37 % 800, smallest + i * 53 % 500);
            steps.extend([
                "windowsize".to_owned(),
                program.window.clone(),
                width.to_string(),
                height.to_string(),
            ]);
            steps.extend(["sleep".to_owned(), interval.to_owned()]);
        }
        desktop.xdotool(steps.iter().map(String::as_str));
        assert!(program.is_alive(), "after {count} resizes, {interval} s apart");
    }
    desktop.xdotool(["windowsize", "--sync", &program.window, "333", "222"]);
    pause(1000);
    desktop.hide_status(&mut program);
    let after = desktop.shot(&program);
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
    // The picture has followed, to its last row and column.
    let mut fresh = desktop.start(&["--resolution", "333x222", "--spp", "16"]);
    desktop.hide_status(&mut fresh);
    assert_eq!(difference(&after, &desktop.shot(&fresh)), 0.0);
}

#[test]
fn it_survives_full_screen_and_minimising() {
    let Some(desktop) = desktop("full-screen") else {
        return;
    };
    if desktop.manager.is_none() {
        println!("SKIPPED full screen and minimising: no window manager is installed");
        return;
    }
    let mut program = desktop.start(SMALL);
    desktop.wait_until_done(&mut program);
    let before = desktop.shot(&program);
    for _ in 0..3 {
        desktop.xdotool(["key", "F11"]);
        wait_for("full screen", || (desktop.size(&program) == (1280, 800)).then_some(()));
        desktop.xdotool(["key", "F11"]);
        wait_for("the window", || (desktop.size(&program) == (320, 240)).then_some(()));
    }
    for _ in 0..3 {
        desktop.xdotool(["windowminimize", &program.window]);
        pause(300);
        desktop.focus(&program);
        pause(300);
    }
    desktop.xdotool(["key", "r"]);
    pause(100);
    desktop.wait_until_done(&mut program);
    let after = desktop.shot(&program);
    // The status lines tell other numbers.
    assert!(difference(&before, &after) < 0.1, "{}", difference(&before, &after));
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
}

#[test]
fn a_finished_picture_costs_no_cpu_time() {
    let Some(desktop) = desktop("idle") else {
        return;
    };
    let mut program = desktop.start(SMALL);
    desktop.wait_until_done(&mut program);
    pause(500);
    let before = program.ticks();
    pause(2000);
    let ticks = program.ticks() - before;
    assert!(ticks < 4, "{} % CPU at rest", ticks as f64 * 10.0 / 2000.0 * 100.0);
}

#[test]
fn screenshots_are_what_the_window_shows() {
    let Some(desktop) = desktop("screenshot") else {
        return;
    };
    let mut program = desktop.start(SMALL);
    desktop.wait_until_done(&mut program);
    let with_text = desktop.shot(&program);
    let saved = |key: &str, count: usize| {
        desktop.xdotool(["key", key]);
        wait_for("the file", || {
            let files = pictures_in(&desktop.directory);
            (files.len() == count).then(|| files.last().cloned()).flatten()
        })
    };
    let first = saved("F12", 1);
    // The notice that it was saved must go.
    pause(7000);
    desktop.hide_status(&mut program);
    let without_text = desktop.shot(&program);
    let second = saved("ctrl+F12", 2);
    desktop.xdotool(["key", "ctrl+q"]);
    // Files are complete when the program has ended.
    assert_eq!(program.wait().code(), Some(0));
    assert_eq!(image::open(first).unwrap().to_rgb8(), with_text);
    assert_eq!(image::open(second).unwrap().to_rgb8(), without_text);
    assert!(difference(&with_text, &without_text) > 0.01);
    // Headless, the same scene gives the same picture, bit for bit.
    let rendered = desktop.directory.join("headless.png");
    let status = desktop
        .command(env!("CARGO_BIN_EXE_penumbra"))
        .arg("render")
        .args(SMALL)
        .arg("-o")
        .arg(&rendered)
        .status();
    assert!(status.unwrap().success());
    assert_eq!(image::open(rendered).unwrap().to_rgb8(), without_text);
}

/// In the order of their numbers (up to nine).
fn pictures_in(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        entries.filter(|path| path.extension().is_some_and(|e| e == "png")).collect();
    files.sort();
    files
}

#[test]
fn keys_that_change_nothing_of_the_light_keep_the_samples() {
    let Some(desktop) = desktop("display") else {
        return;
    };
    let mut program = desktop.start(SMALL);
    desktop.hide_status(&mut program);
    let before = desktop.shot(&program);
    desktop.xdotool(["key", "shift+period"]);
    pause(500);
    assert!(desktop.title(&program).ends_with("- done"), "exposure restarts the accumulation");
    assert!(difference(&before, &desktop.shot(&program)) > 0.05, "exposure does nothing");
    desktop.xdotool(["key", "shift+comma"]);
    pause(500);
    assert_eq!(difference(&before, &desktop.shot(&program)), 0.0, "a stop up and down again is nothing");
}

#[test]
fn a_wrong_wayland_display_falls_back_to_x11() {
    let Some(desktop) = desktop("wayland") else {
        return;
    };
    let mut program = desktop.start_with(SMALL, &[("WAYLAND_DISPLAY", "wayland-nowhere")]);
    desktop.wait_until_done(&mut program);
}

#[test]
fn keys_of_the_users_own_fly_and_a_bad_file_is_one_line() {
    let Some(desktop) = desktop("keys") else {
        return;
    };
    let file = desktop.directory.join("keys.toml");
    std::fs::write(&file, "forward = 'J'\nquit = ['Ctrl+J']\n").unwrap();
    let keys = ["--keys", file.to_str().unwrap()];
    let mut program = desktop.start(&[SMALL, &keys].concat());
    desktop.hide_status(&mut program);
    let before = desktop.shot(&program);
    for (key, moves) in [("w", false), ("j", true)] {
        desktop.xdotool(["keydown", key]);
        pause(300);
        desktop.xdotool(["keyup", key]);
        pause(100);
        desktop.wait_until_done(&mut program);
        assert_eq!(difference(&before, &desktop.shot(&program)) > 0.05, moves, "{key}");
    }
    desktop.xdotool(["key", "ctrl+j"]);
    assert_eq!(program.wait().code(), Some(0));

    std::fs::write(&file, "forwrd = 'J'\n").unwrap();
    let output = desktop.command(env!("CARGO_BIN_EXE_penumbra")).args(keys).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(
        said.contains("keys.toml: line 1: nothing is called \"forwrd\"; did you mean \"forward\"?"),
        "{said}"
    );
}

#[test]
fn the_camera_that_is_copied_renders_what_the_window_shows() {
    let Some(desktop) = desktop("flags") else {
        return;
    };
    let said = desktop.directory.join("said.txt");
    let mut program = desktop.start_saying(SMALL, &said);
    desktop.hide_status(&mut program);
    // Whole scene, a quarter to the right, parallel, a wide lens, a bit nearer by keys alone.
    for key in ["Home", "3", "5", "0", "0", "0", "0"] {
        desktop.xdotool(["key", key]);
        pause(100);
    }
    desktop.xdotool(["keydown", "Left"]);
    pause(200);
    desktop.xdotool(["keyup", "Left"]);
    pause(100);
    desktop.xdotool(["key", "c"]);
    // The notice goes.
    pause(7000);
    desktop.wait_until_done(&mut program);
    let shown = desktop.shot(&program);
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
    let flags = std::fs::read_to_string(&said).unwrap();
    assert!(flags.contains("--camera-orthographic") && flags.contains("--lens-radius"), "{flags}");
    let rendered = desktop.directory.join("headless.png");
    let status = desktop
        .command(env!("CARGO_BIN_EXE_penumbra"))
        .arg("render")
        .args(SMALL)
        .args(flags.split_whitespace())
        .arg("-o")
        .arg(&rendered)
        .status();
    assert!(status.unwrap().success());
    let rendered = image::open(rendered).unwrap().to_rgb8();
    assert!(colors(&rendered) > 50, "nothing is seen");
    assert_eq!(difference(&rendered, &shown), 0.0);
}

#[test]
fn views_of_pixels_and_cards_show_at_one_press_also_when_the_picture_rests() {
    let Some(desktop) = desktop("views") else {
        return;
    };
    let truth = desktop.directory.join("truth.exr");
    let size = &SMALL[..2];
    let mut render = desktop.command(env!("CARGO_BIN_EXE_penumbra"));
    let render = render.args(["render", "cornell", "--spp", "64", "-q"]).args(size).arg("-o").arg(&truth);
    assert!(render.status().unwrap().success());
    let reference = ["--reference", truth.to_str().unwrap()];
    let mut program = desktop.start(&[SMALL, &reference].concat());
    desktop.hide_status(&mut program);
    let beauty = desktop.shot(&program);
    let mut seen = vec![beauty.clone()];
    // Noise, error, samples, boxes, triangles, normals, base colour, depth, not finite.
    for view in 1..=9 {
        desktop.xdotool(["key", "v"]);
        pause(900);
        // The notice stays for a while at the bottom.
        let shown = image::imageops::crop_imm(&desktop.shot(&program), 0, 0, 320, 190).to_image();
        let others = seen.iter().map(|s| image::imageops::crop_imm(s, 0, 0, 320, 190).to_image());
        // Samples are as many everywhere, and boxes on the walls.
        assert!(view == 3 || colors(&shown) > 1, "view {view} shows next to nothing");
        assert!(others.into_iter().all(|other| difference(&shown, &other) > 0.05), "view {view} is another");
        seen.push(desktop.shot(&program));
    }
    desktop.xdotool(["key", "v"]);
    pause(7000);
    assert_eq!(difference(&beauty, &desktop.shot(&program)), 0.0, "the picture is back");
    for key in ["h", "g", "z"] {
        desktop.xdotool(["key", key]);
        pause(400);
        assert!(difference(&beauty, &desktop.shot(&program)) > 0.05, "{key} shows nothing");
        desktop.xdotool(["key", key]);
        pause(400);
    }
}

/// Pixels in which green is far above red and blue, and those in which red is above both.
fn green_and_red(picture: &RgbImage) -> (usize, usize) {
    let above = |a: u8, b: u8, c: u8| i32::from(a) > i32::from(b.max(c)) + 60;
    let green = picture.pixels().filter(|p| above(p[1], p[0], p[2])).count();
    let red = picture.pixels().filter(|p| above(p[0], p[1], p[2])).count();
    (green, red)
}

#[test]
fn a_pinned_pixel_shows_its_rays_and_boxes_show_the_hierarchy() {
    let Some(desktop) = desktop("debug") else {
        return;
    };
    let white = "[[model]]\nfile = 'floor.obj'\n[[light]]\nkind = 'parallelogram'\ncorner = [-1, 3, -1]\n\
                 edge_u = [2, 0, 0]\nedge_v = [0, 0, 2]\nradiance = [1, 1, 1]\n[camera]\nposition = [0, 2, 6]\n\
                 target = [0, 0.5, 0]\n";
    let floor = "v -3 0 -3\nv 3 0 -3\nv 3 0 3\nv -3 0 3\nv -1 1 -1\nv 1 1 -1\nv 1 1 1\nv -1 1 1\n\
                 f 1 4 3 2\nf 5 8 7 6\n";
    std::fs::write(desktop.directory.join("scene.toml"), white).unwrap();
    std::fs::write(desktop.directory.join("floor.obj"), floor).unwrap();
    let mut program = desktop.start(&["scene.toml", "--resolution", "320x240", "--spp", "4"]);
    desktop.hide_status(&mut program);
    let plain = desktop.shot(&program);
    assert!(green_and_red(&plain).0 < 10, "a grey scene");
    // Without a mouse it is the pixel in the middle: on the roof, in full light.
    desktop.xdotool(["key", "p"]);
    pause(700);
    let (green, red) = green_and_red(&desktop.shot(&program));
    assert!(green > 30 && red < green / 4, "{green} green, {red} red");
    // Below the roof all of the lamp is hidden.
    desktop.xdotool(["mousemove", "--window", &program.window, "160", "165", "click", "1"]);
    pause(700);
    let (green, red) = green_and_red(&desktop.shot(&program));
    assert!(red > 30 && green < red, "{green} green, {red} red");
    // And all is gone again, but for the notice.
    desktop.xdotool(["key", "p"]);
    pause(7000);
    assert_eq!(difference(&plain, &desktop.shot(&program)), 0.0);
    desktop.xdotool(["key", "b"]);
    pause(500);
    assert!(difference(&plain, &desktop.shot(&program)) > 0.01, "a box around everything");
}

#[test]
fn a_screenshot_is_made_again_from_what_it_says() {
    let Some(desktop) = desktop("recipe") else {
        return;
    };
    let mut program = desktop.start(SMALL);
    desktop.hide_status(&mut program);
    for key in ["Home", "t", "t", "period"] {
        desktop.xdotool(["key", key]);
        pause(100);
    }
    desktop.wait_until_done(&mut program);
    desktop.xdotool(["key", "ctrl+F12"]);
    let shot = wait_for("the file", || pictures_in(&desktop.directory).first().cloned());
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
    let again = desktop.directory.join("again.png");
    let mut render = desktop.command(env!("CARGO_BIN_EXE_penumbra"));
    let render = render.args(["render", "-q", "--from"]).arg(&shot).arg("-o").arg(&again);
    assert!(render.status().unwrap().success());
    let [shot, again] = [shot, again].map(|path| image::open(path).unwrap().to_rgb8());
    assert!(colors(&shot) > 50);
    assert_eq!(difference(&shot, &again), 0.0);
}

#[test]
fn a_file_that_changes_is_loaded_again_with_the_camera_kept() {
    let Some(desktop) = desktop("reload") else {
        return;
    };
    let scene = "[[model]]\nfile = 'floor.obj'\n[[light]]\nkind = 'point'\nposition = [0, 3, 1]\n\
                 intensity = [9, 9, 9]\n[camera]\nposition = [0, 2, 6]\ntarget = [0, 0, 0]\n";
    let floor = "mtllib floor.mtl\nusemtl a\nv -3 0 -3\nv 3 0 -3\nv 3 0 3\nv -3 0 3\nf 1 4 3 2\n";
    let write = |name: &str, text: &str| std::fs::write(desktop.directory.join(name), text).unwrap();
    write("scene.toml", scene);
    write("floor.obj", floor);
    write("floor.mtl", "newmtl a\nKd 0.8 0.8 0.8\n");
    let mut program = desktop.start(&["scene.toml", "--resolution", "320x240", "--spp", "4"]);
    desktop.hide_status(&mut program);
    let home = desktop.shot(&program);
    desktop.xdotool(["key", "Home"]);
    pause(300);
    desktop.wait_until_done(&mut program);
    let grey = desktop.shot(&program);
    assert!(difference(&home, &grey) > 0.05, "the camera moves");
    write("floor.mtl", "newmtl a\nKd 0.1 0.8 0.1\n");
    wait_for("a green floor", || (green_and_red(&desktop.shot(&program)).0 > 1000).then_some(()));
    // A broken file says so and changes nothing.
    write("scene.toml", "[[model]]\nfile = 3\n");
    pause(1500);
    assert!(program.is_alive());
    assert!(green_and_red(&desktop.shot(&program)).0 > 1000);
    write("floor.mtl", "newmtl a\nKd 0.8 0.8 0.8\n");
    write("scene.toml", scene);
    pause(8000);
    desktop.wait_until_done(&mut program);
    assert_eq!(difference(&grey, &desktop.shot(&program)), 0.0, "the camera is where it was");
}

#[test]
fn a_recording_is_done_again_and_the_times_are_told() {
    let Some(desktop) = desktop("replay") else {
        return;
    };
    let file = desktop.directory.join("taps.txt");
    let mut script = String::new();
    for i in 0..40 {
        let (key, at) = (["W", "ArrowLeft", "S", "ArrowRight"][i % 4], 0.5 + 0.2 * i as f64);
        script += &format!("{at:.2} down {key}\n{:.2} up {key}\n", at + 0.05);
    }
    script += "9 quit\n";
    std::fs::write(&file, script).unwrap();
    let mut program = desktop.command(env!("CARGO_BIN_EXE_penumbra"));
    let program = program.args(["cornell", "--resolution", "960x540", "--replay"]).arg(&file);
    let output = program.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8_lossy(&output.stdout);
    println!("{}", said.trim());
    let told: serde_json::Value = serde_json::from_str(said.lines().last().unwrap()).unwrap();
    assert_eq!(told["events"], 40, "each key press is answered by a picture of its own");
    let number = |key: &str| told[key].as_f64().unwrap();
    assert!(number("median_ms") > 0.0 && number("median_ms") <= number("p99_ms"), "{said}");
    assert!(number("moving_pictures_per_second") > 1.0, "{said}");
}

#[test]
fn completions_and_the_manual_page_know_the_flags() {
    for arguments in [&["completions", "bash"][..], &["completions", "fish"], &["man"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_penumbra")).args(arguments).output().unwrap();
        assert!(output.status.success());
        let said = String::from_utf8_lossy(&output.stdout);
        let plain = said.replace("\\-", "-");
        for flag in ["resolution", "replay", "lens-radius"] {
            assert!(plain.contains(flag), "{arguments:?} says nothing of {flag}");
        }
    }
}
