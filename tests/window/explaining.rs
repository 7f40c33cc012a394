//! Boxes, steps of a ray, parts of the picture, cards: what keys put over the picture, they also take away.

use super::desktop::{difference, pause, wait_for};
use super::watched::Watched;
use image::RgbImage;
use image::imageops::crop_imm;

/// The room in a window that has space for cards.
fn large(test: &str) -> Option<Watched> {
    Watched::room_of(test, &["scene.toml", "--resolution", "640x480", "--spp", "4"])
}

#[test]
fn boxes_of_levels_and_leaves_come_and_go() {
    let Some(watched) = large("boxes") else {
        return;
    };
    let plain = watched.upper();
    let mut seen = vec![plain.clone()];
    // A picture that has not been shown yet.
    let mut shows_new = |key: &str| {
        watched.keys(&[key]);
        let shown = wait_for(&format!("other boxes after {key}"), || {
            let now = watched.settled();
            seen.iter().all(|old| difference(old, &now) > 1e-3).then_some(now)
        });
        seen.push(shown.clone());
        shown
    };
    let is = |key: &str, wanted: &RgbImage| {
        watched.keys(&[key]);
        watched.shows_upper(&format!("what was shown before, after {key}"), wanted);
    };
    let all = shows_new("b");
    let first = shows_new("ctrl+bracketright");
    is("ctrl+bracketleft", &all);
    // There is none above.
    is("ctrl+bracketleft", &all);
    is("ctrl+bracketright", &first);
    shows_new("b");
    is("b", &plain);
    // The level is remembered.
    is("b", &first);
    is("Escape", &plain);
}

#[test]
fn a_ray_goes_through_the_boxes_step_by_step_in_either_order() {
    let Some(watched) = large("steps") else {
        return;
    };
    watched.cursor(320, 200);
    let plain = watched.upper();
    // The box where the ray is.
    let yellow = |picture: &RgbImage| {
        let is = |p: &&image::Rgb<u8>| p[0] > 230 && p[1] > 230 && (90..160).contains(&p[2]);
        picture.pixels().filter(is).count()
    };
    let after = |key: &str, what: &str, is: &dyn Fn(&RgbImage) -> bool| {
        watched.keys(&[key]);
        wait_for(&format!("{what} after {key}"), || Some(watched.settled()).filter(is))
    };
    let none = yellow(&plain);
    let pinned = after("p", "rays", &|now| difference(now, &plain) > 1e-3);
    let first = after("apostrophe", "a box", &|now| yellow(now) > none + 100);
    let second = after("apostrophe", "another box", &|now| difference(now, &first) > 1e-3);
    after("semicolon", "the first box", &|now| difference(now, &first) == 0.0);
    after("semicolon", "no box", &|now| difference(now, &pinned) == 0.0);
    let steps = |count: usize| watched.keys(&vec!["apostrophe"; count]);
    steps(2);
    wait_for("the second box", || (difference(&watched.upper(), &second) == 0.0).then_some(()));
    // What the card tells at the lower left, where no notice lies: another line is bright.
    let card = || crop_imm(&watched.desktop.shot(&watched.program), 0, 260, 200, 220).to_image();
    let near_first = card();
    let differs = |wanted: bool, what: &str| {
        watched.keys(&["o"]);
        wait_for(what, || ((difference(&near_first, &card()) > 1e-3) == wanted).then_some(()));
    };
    differs(true, "the other order");
    differs(false, "the first order");
    watched.keys(&["p"]);
    watched.shows_upper("nothing more", &plain);
}

#[test]
fn the_key_of_the_region_goes_through_three_sizes() {
    let Some(watched) = large("sizes-of-region") else {
        return;
    };
    let plain = watched.upper();
    watched.cursor(320, 240);
    // With the status one also sees the outline; the middle of the window is beside it.
    let middle = |picture: &RgbImage| crop_imm(picture, 0, 210, 640, 40).to_image();
    watched.keys(&["z"]);
    for (key, width) in [("j", 0.33), ("shift+j", 0.5), ("shift+j", 0.16), ("shift+j", 0.33)] {
        watched.keys(&[key]);
        let [left, right] = [-0.5, 0.5].map(|side| (640.0 * (0.5 + side * width)) as u32);
        wait_for(&format!("a region of {width}"), || {
            let (before, now) = (middle(&plain), middle(&watched.upper()));
            let changed = |x: u32| (0..40).filter(|&y| now.get_pixel(x, y) != before.get_pixel(x, y)).count();
            let lines: Vec<u32> = (0..640).filter(|&x| changed(x) == 40).collect();
            let is_here = |x: u32, wanted: u32| x.abs_diff(wanted) <= 1;
            matches!(lines[..], [a, b] if is_here(a, left) && is_here(b, right)).then_some(())
        });
    }
    watched.keys(&["j", "z", "z", "z"]);
    watched.shows_upper("the picture alone", &plain);
}

#[test]
fn cards_are_where_they_belong_and_their_keys_and_escape_close_them() {
    let Some(watched) = large("cards") else {
        return;
    };
    let plain = watched.desktop.shot(&watched.program);
    // Pixels that a card covers, in a ninth of the window.
    let ninths = |now: &RgbImage| {
        let mut changed = [0; 9];
        for (x, y, p) in now.enumerate_pixels().filter(|&(x, y, p)| plain.get_pixel(x, y) != p) {
            changed[(y * 3 / 480 * 3 + x * 3 / 640) as usize] += usize::from(p != plain.get_pixel(x, y));
        }
        changed.map(|count| count as f64 / (640.0 * 480.0 / 9.0))
    };
    let shot = || watched.desktop.shot(&watched.program);
    let is_plain = |what: &str| wait_for(what, || (shot() == plain).then_some(()));
    // The ninth that is covered most, and one that stays free.
    for (key, covered, free) in [("h", 4, None), ("slash", 4, None), ("l", 4, Some(0)), ("g", 8, Some(0))] {
        for close in [key, "Escape"] {
            watched.keys(&[key]);
            wait_for(&format!("the card of {key}"), || {
                let ninths = ninths(&shot());
                (ninths[covered] > 0.5 && free.is_none_or(|free| ninths[free] == 0.0)).then_some(())
            });
            watched.keys(&[close]);
            // In a small window the help has pages, which its key turns.
            for _ in 0..if covered == 4 && close == key && key != "l" { 6 } else { 0 } {
                pause(500);
                if shot() != plain {
                    watched.keys(&[close]);
                }
            }
            is_plain(&format!("no card after {key} and {close}"));
        }
    }
    // Each level tells more than the one before, the last nothing.
    let mut before = 0.0;
    for level in ["short", "long", "all"] {
        watched.keys(&["z"]);
        wait_for(&format!("a status that is {level}"), || {
            let covered: f64 = ninths(&shot()).iter().sum();
            let grows = covered > before + 0.02;
            before = if grows { covered } else { before };
            grows.then_some(())
        });
    }
    watched.keys(&["z"]);
    is_plain("no status");
}

/// Whether the window says, where no status is, that it shows more than the film: in red.
fn warns(shown: &RgbImage) -> bool {
    let is_red = |p: &&image::Rgb<u8>| p[0] > 200 && p[1] < 150 && p[2] < 130;
    crop_imm(shown, 0, 0, 150, 40).to_image().pixels().filter(is_red).count() > 10
}

#[test]
fn keys_switch_old_samples_and_smoothing_off_and_on() {
    // Noisy for more than a moment.
    let flags = ["gallery", "--resolution", "640x480", "--spp", "100000", "--no-smoothing"];
    let moving = |watched: &Watched, wanted: bool| {
        // To and fro, so that there is always something to see.
        let mut keys = ["a", "d"].into_iter().cycle();
        let mut moved = || {
            let key = keys.next().unwrap_or_default();
            watched.desktop.xdotool(["keydown", key]);
            let shown = watched.upper();
            watched.desktop.xdotool(["keyup", key]);
            shown
        };
        if wanted {
            wait_for("a word about old samples", || {
                // There must be some first.
                pause(300);
                warns(&moved()).then_some(())
            });
        } else {
            let shown: Vec<RgbImage> = (0..8).map(|_| moved()).collect();
            assert!(difference(&shown[0], &shown[7]) > 0.01, "it does not move");
            assert!(!shown.iter().any(warns), "old samples, or a word about them");
        }
    };
    let Some(watched) = Watched::endless("old-samples", &flags) else {
        return;
    };
    moving(&watched, true);
    watched.keys(&["y"]);
    wait_for("the picture of its own samples", || (!warns(&watched.upper())).then_some(()));
    moving(&watched, false);
    watched.keys(&["y"]);
    moving(&watched, true);
    drop(watched);

    let beginning = |watched: &Watched| {
        watched.keys(&["r"]);
        (0..6).any(|_| warns(&watched.upper()))
    };
    // Old samples are none where nothing moves. A smaller picture: all its surfaces must be known within the first second, also
    // on a slow machine.
    let small = ["gallery", "--resolution", "400x300", "--spp", "100000"];
    let Some(watched) = Watched::endless("smoothing", &small) else {
        return;
    };
    wait_for("a word about smoothing", || beginning(&watched).then_some(()));
    watched.keys(&["u"]);
    wait_for("nothing smoothed", || (0..3).all(|_| !beginning(&watched)).then_some(()));
    watched.keys(&["u"]);
    wait_for("a word about smoothing again", || beginning(&watched).then_some(()));
}
