//! Things are selected, pictures compared.

use super::desktop::{SMALL, desktop, difference, pause, wait_for};
use image::RgbImage;

/// Pixels of the colour that what is selected is marked with.
fn marked(picture: &RgbImage) -> usize {
    picture.pixels().filter(|p| p[0] > 240 && p[1].abs_diff(190) < 12 && p[2].abs_diff(92) < 20).count()
}

fn left(picture: &RgbImage, width: u32) -> RgbImage {
    image::imageops::crop_imm(picture, 0, 0, width, picture.height()).to_image()
}

#[test]
fn a_point_light_is_selected_by_a_key_and_a_drag_ends_over_its_card() {
    let Some(desktop) = desktop("editing") else {
        return;
    };
    let mut program = desktop.start(&["cornell-point", "--resolution", "640x480", "--spp", "4"]);
    desktop.hide_status(&mut program);
    let before = desktop.shot(&program);
    desktop.xdotool(["key", "ctrl+Next"]);
    let selected = wait_for("the lamp's mark and card", || {
        let shot = desktop.shot(&program);
        (marked(&left(&shot, 400)) > 5).then_some(shot)
    });
    assert!(difference(&before, &selected) > 0.05, "the card");
    // Brighter, by keys alone: the seventh row is the power.
    for _ in 0..6 {
        desktop.xdotool(["key", "ctrl+Down"]);
    }
    desktop.xdotool(["key", "ctrl+shift+Right"]);
    wait_for("more light", || {
        (difference(&left(&before, 400), &left(&desktop.shot(&program), 400)) > 0.3).then_some(())
    });
    // The button goes down in the picture and up over the card.
    let window = program.window.clone();
    let at = |x: &str, y: &str| {
        desktop.xdotool(["mousemove", "--window", &window, x, y]);
        pause(50);
    };
    at("150", "200");
    desktop.xdotool(["mousedown", "1"]);
    at("220", "210");
    at("570", "240");
    desktop.xdotool(["mouseup", "1"]);
    pause(500);
    desktop.wait_until_done(&mut program);
    let turned = desktop.shot(&program);
    assert!(difference(&left(&selected, 400), &left(&turned, 400)) > 0.05, "it has turned");
    at("300", "300");
    pause(500);
    desktop.wait_until_done(&mut program);
    assert_eq!(difference(&left(&turned, 400), &left(&desktop.shot(&program), 400)), 0.0, "it goes on");
    desktop.xdotool(["key", "Escape"]);
    wait_for("no mark", || (marked(&desktop.shot(&program)) == 0).then_some(()));
    // Nothing is open any more: this one only says something.
    desktop.xdotool(["key", "Escape"]);
    pause(500);
    assert!(program.is_alive());
}

#[test]
fn the_kept_picture_is_left_of_the_cursor_and_this_one_right_of_it() {
    let Some(desktop) = desktop("compare") else {
        return;
    };
    let mut program = desktop.start(SMALL);
    desktop.hide_status(&mut program);
    // Without a mouse it is parted in the middle.
    desktop.xdotool(["mousemove", "1279", "799"]);
    let before = desktop.shot(&program);
    desktop.xdotool(["key", "ctrl+k"]);
    pause(300);
    desktop.xdotool(["key", "Home"]);
    pause(300);
    desktop.wait_until_done(&mut program);
    pause(6500);
    let after = desktop.shot(&program);
    assert!(difference(&before, &after) > 0.05, "another view");
    desktop.xdotool(["key", "shift+k"]);
    // The card says which is which: below it.
    let below = |picture: &RgbImage, x: u32, width: u32| {
        image::imageops::crop_imm(picture, x, 120, width, 120).to_image()
    };
    let parted = |x: u32| {
        wait_for("both pictures", || {
            let shot = desktop.shot(&program);
            let there = difference(&below(&shot, 0, x), &below(&before, 0, x));
            let here = difference(&below(&shot, x + 1, 319 - x), &below(&after, x + 1, 319 - x));
            (there == 0.0 && here == 0.0).then_some(())
        });
    };
    parted(160);
    desktop.xdotool(["mousemove", "--window", &program.window, "80", "100"]);
    parted(80);
    desktop.xdotool(["key", "Escape"]);
    wait_for("this picture alone", || (difference(&after, &desktop.shot(&program)) == 0.0).then_some(()));
}
