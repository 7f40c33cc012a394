//! Starting, flying, ending.

use super::desktop::{SMALL, colors, desktop, difference, pause};
use std::process::Command;
use std::time::{Duration, Instant};

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
fn keys_of_the_users_own_fly_and_a_bad_file_is_one_line() {
    let Some(desktop) = desktop("keys") else {
        return;
    };
    let file = desktop.directory.join("keys.toml");
    std::fs::write(&file, "forward = 'Backslash'\nquit = ['Ctrl+Backslash']\n").unwrap();
    let keys = ["--keys", file.to_str().unwrap()];
    let mut program = desktop.start(&[SMALL, &keys].concat());
    desktop.hide_status(&mut program);
    let before = desktop.shot(&program);
    for (key, moves) in [("w", false), ("backslash", true)] {
        desktop.xdotool(["keydown", key]);
        pause(300);
        desktop.xdotool(["keyup", key]);
        pause(100);
        desktop.wait_until_done(&mut program);
        assert_eq!(difference(&before, &desktop.shot(&program)) > 0.05, moves, "{key}");
    }
    desktop.xdotool(["key", "ctrl+backslash"]);
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
fn a_wrong_wayland_display_falls_back_to_x11() {
    let Some(desktop) = desktop("wayland") else {
        return;
    };
    let mut program = desktop.start_with(SMALL, &[("WAYLAND_DISPLAY", "wayland-nowhere")]);
    desktop.wait_until_done(&mut program);
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
