//! What is saved is what is shown.

use super::desktop::{SMALL, colors, desktop, difference, pause, pictures_in, wait_for};

#[test]
fn screenshots_are_what_the_window_shows() {
    let Some(desktop) = desktop("screenshot") else {
        return;
    };
    let mut program = desktop.start(SMALL);
    desktop.wait_until_done(&mut program);
    // The hint for who has not pressed a key yet is gone then.
    desktop.xdotool(["key", "Shift_L"]);
    pause(500);
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
    // What it says lies over the picture for a while.
    wait_for("a stop up and down again to be nothing", || {
        (difference(&before, &desktop.shot(&program)) == 0.0).then_some(())
    });
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
fn only_the_region_is_refined_and_all_again_afterwards() {
    let Some(desktop) = desktop("region") else {
        return;
    };
    let size = [
        "--resolution",
        "320x240",
        "--spp",
        "64",
        "--integrator",
        "path",
        "--no-kept-samples",
        "--no-smoothing",
    ];
    let mut program = desktop.start(&size);
    desktop.hide_status(&mut program);
    let whole = desktop.shot(&program);
    desktop.xdotool(["key", "j"]);
    pause(200);
    desktop.xdotool(["key", "r"]);
    let inside = |picture: &image::RgbImage| image::imageops::crop_imm(picture, 120, 90, 80, 60).to_image();
    // The notice stays for a while at the bottom.
    let top = |picture: &image::RgbImage| image::imageops::crop_imm(picture, 0, 0, 320, 190).to_image();
    let outside = |picture: &image::RgbImage| image::imageops::crop_imm(picture, 0, 0, 320, 80).to_image();
    wait_for("a part as finished as before, and no more", || {
        let part = desktop.shot(&program);
        let is_there = difference(&inside(&whole), &inside(&part)) == 0.0;
        (is_there && difference(&outside(&whole), &outside(&part)) > 0.1).then_some(())
    });
    desktop.xdotool(["key", "j"]);
    wait_for("all of it", || (difference(&top(&whole), &top(&desktop.shot(&program))) == 0.0).then_some(()));
    // Drawn with the mouse: the left upper quarter.
    desktop.xdotool([
        "keydown",
        "ctrl",
        "mousemove",
        "--window",
        &program.window,
        "10",
        "10",
        "mousedown",
        "1",
    ]);
    desktop.xdotool([
        "mousemove",
        "--window",
        &program.window,
        "100",
        "80",
        "mousemove",
        "--window",
        &program.window,
        "150",
        "110",
    ]);
    desktop.xdotool(["mouseup", "1", "keyup", "ctrl"]);
    pause(200);
    desktop.xdotool(["key", "r"]);
    let quarter = |picture: &image::RgbImage| image::imageops::crop_imm(picture, 20, 20, 110, 80).to_image();
    let beside = |picture: &image::RgbImage| image::imageops::crop_imm(picture, 160, 0, 160, 190).to_image();
    wait_for("the quarter alone", || {
        let part = desktop.shot(&program);
        let is_there = difference(&quarter(&whole), &quarter(&part)) == 0.0;
        (is_there && difference(&beside(&whole), &beside(&part)) > 0.1).then_some(())
    });
}

#[test]
fn edits_that_were_not_saved_travel_with_the_screenshot() {
    let Some(desktop) = desktop("edited") else {
        return;
    };
    let mut program = desktop.start(SMALL);
    desktop.hide_status(&mut program);
    let before = desktop.shot(&program);
    // Whatever is in the middle of the picture is made otherwise, then let go.
    desktop.xdotool(["key", "m"]);
    pause(300);
    for _ in 0..4 {
        desktop.xdotool(["key", "ctrl+shift+Right"]);
        pause(100);
    }
    desktop.xdotool(["key", "Escape"]);
    pause(300);
    desktop.wait_until_done(&mut program);
    desktop.xdotool(["key", "ctrl+F12"]);
    let shot = wait_for("the file", || pictures_in(&desktop.directory).first().cloned());
    assert!(desktop.title(&program).contains("* - "), "nothing says that edits are not saved");
    desktop.xdotool(["key", "ctrl+q"]);
    pause(1000);
    assert!(program.is_alive(), "edits are lost without a word");
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
    let again = desktop.directory.join("again.png");
    let mut render = desktop.command(env!("CARGO_BIN_EXE_penumbra"));
    let render = render.args(["render", "-q", "--from"]).arg(&shot).arg("-o").arg(&again);
    assert!(render.status().unwrap().success());
    let [shot, again] = [shot, again].map(|path| image::open(path).unwrap().to_rgb8());
    assert!(difference(&before, &shot) > 0.01, "nothing was edited");
    assert_eq!(difference(&shot, &again), 0.0);
}
