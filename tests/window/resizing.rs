//! Windows of any size, and what window managers do to them.

use super::desktop::{SMALL, colors, desktop, difference, pause, wait_for};

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
fn a_window_of_one_pixel_and_one_larger_than_the_screen_work() {
    let Some(desktop) = desktop("sizes") else {
        return;
    };
    let mut program = desktop.start(&["--resolution", "320x240", "--spp", "2"]);
    desktop.wait_until_done(&mut program);
    for (width, height) in [("1", "1"), ("3000", "40"), ("40", "2500"), ("3200", "1900"), ("1", "1")] {
        desktop.xdotool(["windowsize", &program.window, width, height]);
        pause(700);
        // Keys of all kinds go on working.
        for key in ["h", "l", "g", "j", "z", "w", "h", "l", "g", "j"] {
            desktop.xdotool(["key", key]);
        }
        assert!(program.is_alive(), "{width} x {height}");
    }
    desktop.xdotool(["windowsize", "--sync", &program.window, "320", "240"]);
    pause(1000);
    desktop.wait_until_done(&mut program);
    assert!(colors(&desktop.shot(&program)) > 50);
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
}
