//! The window for a long time: flown, edited, resized and reloaded at random, it grows no larger, never stops to
//! answer, and in the end shows what a fresh render shows.
//!
//! `PENUMBRA_ENDURANCE` is for how many seconds: 20 if not said, 600 in the long job, 3600 before a release.
#![cfg(all(feature = "view", target_os = "linux"))]

#[path = "support/desktop.rs"]
mod desktop;

use desktop::{Desktop, Program, colors, desktop, difference, pause, wait_for};
use penumbra::torture::oracle::Rng;
use std::time::{Duration, Instant};

/// Between an action and the first look whether the program answers.
const ANSWER: Duration = Duration::from_secs(10);
/// What memory may grow by from the first tenth of the time to the end, MiB: more than what buffers of the largest size
/// that was tried and a second scene while one is loaded take, and less than one leaked picture for each action.
const GROWTH: f64 = 48.0;
/// What memory may ever be above that of the first picture, MiB. Letters, cards and screenshots stay once they are
/// there: 60. The film of the largest window, 560 × 440 of 112 bytes a pixel, takes 26, and what is shown and kept
/// beside it no more than twice that; all of it is there twice while another size or scene takes its place: 160. The
/// most in an hour was 370 MiB, 160 above.
const PEAK: f64 = 60.0 + 160.0;

const SCENE: &str = "[[model]]\nfile = 'room.obj'\n[[light]]\nkind = 'parallelogram'\n\
    corner = [-1, 3.5, -1]\nedge_u = [2, 0, 0]\nedge_v = [0, 0, 2]\nradiance = [6, 6, 5]\n\
    [camera]\nposition = [0, 2, 6]\ntarget = [0, 1, 0]\n";

/// A floor with some boxes on it, the last one so many tenths high.
fn room(height: i32) -> String {
    let mut text =
        "mtllib room.mtl\nusemtl a\nv -4 0 -4\nv 4 0 -4\nv 4 0 4\nv -4 0 4\nf 1 4 3 2\n".to_owned();
    for i in 0..4 {
        let (x, z, h) = (f64::from(i) * 1.5 - 2.2, f64::from(i % 2) - 0.5, if i == 3 { height } else { 8 });
        text += if i % 2 == 0 { "usemtl b\n" } else { "usemtl a\n" };
        for (dy, (dx, dz)) in
            [0, h].into_iter().flat_map(|y| [(0, 0), (1, 0), (1, 1), (0, 1)].map(|p| (y, p)))
        {
            text += &format!(
                "v {} {} {}\n",
                x + f64::from(dx) * 0.8,
                f64::from(dy) * 0.1,
                z + f64::from(dz) * 0.8
            );
        }
        let at = |k: i32| k - 9;
        for face in [[1, 2, 3, 4], [5, 8, 7, 6], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 8, 4], [4, 8, 5, 1]] {
            text += &format!("f {} {} {} {}\n", at(face[0]), at(face[1]), at(face[2]), at(face[3]));
        }
    }
    text
}

/// The program's memory that is really there, MiB.
fn resident(program: &Program) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", program.child.id())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<f64>().unwrap() / 1024.0
}

/// Keys that only change how it is flown or edited: what `Ctrl+E` writes down says all of it. (What is drawn over the
/// picture would be in the last screenshot, and has tests of its own.)
const TAPS: &[&str] = &[
    "Home",
    "Return",
    "1",
    "3",
    "7",
    "5",
    "9",
    "0",
    "0",
    "comma",
    "period",
    "r",
    "g",
    "h",
    "Tab",
    "f",
    "m",
    "m",
    "ctrl+Up",
    "ctrl+Down",
    "ctrl+Left",
    "ctrl+Right",
    "ctrl+Right",
    "shift+ctrl+Right",
    "ctrl+d",
    "Delete",
    "BackSpace",
    "ctrl+z",
    "F5",
    "k",
    "ctrl+k",
    "space",
    "Escape",
    "x",
];
const HOLDS: &[&str] = &["w", "a", "s", "d", "q", "e", "Left", "Right", "Up", "Down", "shift+w"];

/// Does one thing that a user might do.
fn act(desktop: &Desktop, program: &Program, rng: &mut Rng, step: u64) {
    let window = program.window.as_str();
    let write = |name: &str, text: &str| std::fs::write(desktop.directory.join(name), text).unwrap();
    match rng.below(20) {
        0..8 => {
            let key = HOLDS[rng.below(HOLDS.len())];
            desktop.xdotool(["keydown", key]);
            pause(20 + u64::from(rng.bits() % 200));
            desktop.xdotool(["keyup", key]);
        }
        8..15 => {
            desktop.xdotool(["key", TAPS[rng.below(TAPS.len())]]);
        }
        15 => {
            // Inside: the frame around it has buttons of its own.
            let (width, height) = desktop.size(program);
            let (x, y) = (rng.below(width as usize), rng.below(height as usize));
            let (x, y) = (x.to_string(), y.to_string());
            let button = ["1", "3", "4", "5"][rng.below(4)];
            desktop.xdotool(["mousemove", "--window", window, &x, &y, "click", button]);
        }
        16 | 17 => {
            let (width, height) = (60 + rng.below(500), 40 + rng.below(400));
            let (width, height) = (width.to_string(), height.to_string());
            desktop.xdotool(["windowsize", window, &width, &height]);
        }
        18 => write("room.obj", &room(5 + (step % 8) as i32)),
        _ => {
            // Broken now and then: it says so, and goes on.
            let broken = rng.below(3) == 0;
            write(
                "room.mtl",
                &format!("newmtl a\nKd 0.8 0.7 0.{}\nnewmtl b\nKd 0.{} 0.5 0.8\n", step % 9, step % 7),
            );
            if broken {
                write("scene.toml", "[[model]]\nfile = 3\n");
                pause(400);
            }
            write("scene.toml", SCENE);
        }
    }
}

/// Waits until the help is seen, and until it is gone again: the program still answers, and paints.
fn answers(desktop: &Desktop, program: &mut Program) {
    desktop.xdotool(["windowsize", &program.window, "320", "240"]);
    desktop.xdotool(["key", "Escape"]);
    pause(500);
    for _ in 0..2 {
        let before = desktop.shot(program);
        desktop.xdotool(["key", "h"]);
        let start = Instant::now();
        loop {
            pause(50);
            let after = desktop.shot(program);
            if after.dimensions() != before.dimensions() || difference(&before, &after) > 0.1 {
                break;
            }
            assert!(program.is_alive(), "it ended");
            assert!(start.elapsed() < ANSWER, "no answer for {:?}", start.elapsed());
        }
    }
}

#[test]
fn hours_of_use_leave_no_trace() {
    let Some(desktop) = desktop("endurance") else {
        return;
    };
    let seconds = std::env::var("PENUMBRA_ENDURANCE").ok().and_then(|s| s.parse().ok()).unwrap_or(20);
    let time = Duration::from_secs(seconds);
    let write = |name: &str, text: &str| std::fs::write(desktop.directory.join(name), text).unwrap();
    write("scene.toml", SCENE);
    write("room.obj", &room(8));
    write("room.mtl", "newmtl a\nKd 0.8 0.7 0.6\nnewmtl b\nKd 0.4 0.5 0.8\n");
    let said = desktop.directory.join("said.txt");
    let arguments = ["scene.toml", "--resolution", "320x240", "--spp", "16"];
    let mut program = desktop.start_saying(&arguments, &said);
    pause(500);
    let first = resident(&program);
    let mut rng = Rng(seconds);
    let (start, mut step, mut early, mut most) = (Instant::now(), 0, 0.0f64, 0.0f64);
    let mut told = Instant::now();
    while start.elapsed() < time {
        act(&desktop, &program, &mut rng, step);
        assert!(program.is_alive(), "it ended after {step} actions");
        let now = resident(&program);
        // In the first tenth everything has been there once.
        if start.elapsed() < time.mul_f64(0.1).max(Duration::from_secs(5)) {
            early = early.max(now);
        }
        most = most.max(now);
        if told.elapsed() > Duration::from_secs(30) {
            println!("{:.0} s: {step} actions, {now:.0} MiB", start.elapsed().as_secs_f64());
            told = Instant::now();
        }
        if step % 25 == 24 {
            // What is paused or closed off is not frozen.
            desktop.xdotool(["key", "Escape"]);
            desktop.focus(&program);
            answers(&desktop, &mut program);
        }
        step += 1;
    }
    // Back to plain pictures of a known size, unpaused, with something edited; from the front, for `Home` alone leaves
    // a camera below the floor where it looks at nothing but dark.
    write("scene.toml", SCENE);
    desktop.xdotool(["windowsize", "--sync", &program.window, "320", "240"]);
    desktop.xdotool(["key", "Escape", "key", "1", "key", "Home"]);
    pause(2500);
    if desktop.title(&program).ends_with("- paused") {
        desktop.xdotool(["key", "space"]);
    }
    let last = resident(&program);
    println!(
        "{step} actions in {seconds} s: {first:.0} MiB, {early:.0} soon, at most {most:.0}, {last:.0} at the end"
    );
    assert!(step > seconds, "too slow to say anything");
    assert!(most < first + PEAK, "too much memory: {first} MiB at first, {most} MiB");
    assert!(last < early + GROWTH, "memory has grown: {early} MiB, {last} MiB");
    equal_to_a_fresh_render(&desktop, program, &said);
}

/// Edits something, saves the edits, and compares with what `render` makes of them.
fn equal_to_a_fresh_render(desktop: &Desktop, mut program: Program, said: &std::path::Path) {
    desktop.xdotool(["mousemove", "--window", &program.window, "160", "122", "key", "m"]);
    pause(300);
    desktop.xdotool(["key", "ctrl+Right"]);
    pause(300);
    let lines = || std::fs::read_to_string(said).unwrap().lines().count();
    let before = lines();
    desktop.xdotool(["key", "ctrl+e"]);
    wait_for("the saved edits", || (lines() > before).then_some(()));
    desktop.xdotool(["key", "Escape"]);
    // Text over the picture is none of the picture: a screenshot without it.
    pause(500);
    desktop.wait_until_done(&mut program);
    let shot = || {
        let mut pictures: Vec<_> =
            std::fs::read_dir(&desktop.directory).unwrap().flatten().map(|e| e.path()).collect();
        pictures
            .retain(|p| p.extension().is_some_and(|e| e == "png") && p.to_string_lossy().contains("scene_"));
        pictures.sort();
        pictures.pop()
    };
    desktop.xdotool(["key", "ctrl+F12"]);
    let shot = wait_for("the screenshot", shot);
    pause(500);
    let shown = image::open(shot).unwrap().to_rgb8();
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
    let text = std::fs::read_to_string(said).unwrap();
    let line = text.lines().rfind(|line| line.contains("--scene-settings")).expect("how to render the edits");
    let rendered = desktop.directory.join("fresh.png");
    let mut render = desktop.command(env!("CARGO_BIN_EXE_penumbra"));
    let render = render
        // After "penumbra".
        .args(line.split_whitespace().skip(1))
        .args(["--spp", "16", "-q", "-o"])
        .arg(&rendered);
    assert!(render.status().unwrap().success(), "{line}");
    let rendered = image::open(rendered).unwrap().to_rgb8();
    assert!(colors(&rendered) > 20, "nothing is seen: {line}");
    assert_eq!(difference(&shown, &rendered), 0.0, "{line}");
}
