//! Keys and the mouse move the camera where they say, and as fast.

use super::desktop::{pause, wait_for};
use super::watched::{Camera, SIZE, Watched, near};
use glam::{DVec2, DVec3};
use std::time::Instant;

/// A direction, as a camera sees it.
type Way = fn(&Camera) -> DVec3;

#[test]
fn keys_fly_along_the_axes_and_arrows_turn() {
    let Some(watched) = Watched::room("axes") else {
        return;
    };
    let mut before = watched.camera();
    let flights: [(&str, Way); 8] = [
        ("w", |camera| camera.ahead),
        ("s", |camera| -camera.ahead),
        ("a", |camera| -camera.right()),
        ("d", Camera::right),
        ("e", |_| DVec3::Y),
        ("q", |_| DVec3::NEG_Y),
        ("Prior", |_| DVec3::Y),
        ("Next", |_| DVec3::NEG_Y),
    ];
    for (key, way) in flights {
        watched.hold(key);
        let after = watched.camera();
        let moved = after.eye - before.eye;
        assert!(moved.length() > 1e-3 && near(moved, way(&before) * moved.length()), "{key}: {moved}");
        assert!(near(after.ahead, before.ahead), "{key} turns");
        before = after;
    }
    let turns: [(&str, Way); 4] = [
        ("Left", |camera| -camera.right()),
        ("Right", Camera::right),
        ("Up", |camera| camera.up),
        ("Down", |camera| -camera.up),
    ];
    for (key, way) in turns {
        watched.hold(key);
        let after = watched.camera();
        assert_eq!(after.eye, before.eye, "{key} moves");
        assert!(after.ahead.dot(way(&before)) > 1e-3, "{key}: {} to {}", before.ahead, after.ahead);
        before = after;
    }
    watched.seen("the last view");
}

/// Scene units a second to the right, with this key held as well.
fn speed(watched: &Watched, modifier: Option<&str>) -> f64 {
    let before = watched.camera();
    let all = |verb: &str, keys: &mut dyn Iterator<Item = &str>| {
        keys.for_each(|key| drop(watched.desktop.xdotool([verb, key])));
    };
    all("keydown", &mut modifier.into_iter());
    let start = Instant::now();
    all("keydown", &mut ["d"].into_iter());
    pause(200);
    all("keyup", &mut ["d"].into_iter());
    let seconds = start.elapsed().as_secs_f64();
    all("keyup", &mut modifier.into_iter());
    (watched.camera().eye - before.eye).length() / seconds
}

#[test]
fn plus_minus_and_the_wheel_change_the_speed_and_shift_and_alt_for_as_long_as_they_are_held() {
    let Some(watched) = Watched::room("speed") else {
        return;
    };
    let mut measured: Vec<f64> = (0..5).map(|_| speed(&watched, None)).collect();
    measured.sort_by(f64::total_cmp);
    let base = measured[2];
    // On a busy machine one key press may last longer than one thinks, but not all of them.
    let becomes = |what: &str, modifier: Option<&str>, factor: f64| {
        wait_for(&format!("{what}: {factor:.2} times as fast"), || {
            let ratio = speed(&watched, modifier) / (base * factor);
            (0.7..1.4).contains(&ratio).then_some(())
        });
    };
    becomes("Shift", Some("shift"), 4.0);
    becomes("Alt", Some("alt"), 0.25);
    becomes("let go", None, 1.0);
    watched.keys(&["equal"; 4]);
    becomes("+", None, 1.5f64.powi(4));
    watched.keys(&["minus"; 8]);
    becomes("-", None, 1.5f64.powi(-4));
    // A notch may count twice where the wheel is only two more buttons; as many back are as many.
    watched.cursor(100, 100);
    let wheel = |button: &str| watched.desktop.xdotool(["click", "--repeat", "20", "--delay", "5", button]);
    let before = 1.5f64.powi(-4);
    wheel("4");
    wait_for("the wheel away: faster", || {
        (speed(&watched, None) > 0.7 * base * before * 1.1f64.powi(20)).then_some(())
    });
    wheel("5");
    becomes("the wheel back", None, before);
}

/// The point that views from two sides look at.
fn pivot(watched: &Watched) -> DVec3 {
    watched.keys(&["1"]);
    let front = watched.camera().eye;
    watched.keys(&["3"]);
    DVec3::new(front.x, front.y, watched.camera().eye.z)
}

/// Whether `camera` is as far from `pivot` as this, and sees it in the middle.
fn looks_at(camera: &Camera, pivot: DVec3, distance: f64) -> bool {
    near(camera.eye + camera.ahead * distance, pivot)
}

#[test]
fn after_tab_the_same_keys_turn_about_the_pivot() {
    let Some(watched) = Watched::room("orbit") else {
        return;
    };
    watched.keys(&["Home"]);
    let pivot = pivot(&watched);
    watched.keys(&["Home", "Tab"]);
    let mut before = watched.camera();
    let mut distance = before.eye.distance(pivot);
    let turns: [(&str, Way); 8] = [
        ("e", |camera| camera.up),
        ("Up", |camera| camera.up),
        ("d", Camera::right),
        ("Right", Camera::right),
        ("a", |camera| -camera.right()),
        ("Left", |camera| -camera.right()),
        ("q", |camera| -camera.up),
        ("Down", |camera| -camera.up),
    ];
    for (key, way) in turns {
        watched.hold(key);
        let after = watched.camera();
        assert!(looks_at(&after, pivot, distance), "{key}: {after:?}, {distance} from {pivot}");
        assert!((after.eye - before.eye).dot(way(&before)) > 1e-3, "{key}");
        before = after;
    }
    for (key, nearer) in [("w", true), ("s", false)] {
        watched.hold(key);
        let after = watched.camera();
        let now = after.eye.distance(pivot);
        assert!(looks_at(&after, pivot, now) && near(after.ahead, before.ahead), "{key}: {after:?}");
        assert_eq!(now < distance, nearer, "{key}: {distance} to {now}");
        (before, distance) = (after, now);
    }
    watched.keys(&["Tab"]);
    watched.hold("a");
    let after = watched.camera();
    assert!(near(after.ahead, before.ahead) && !looks_at(&after, pivot, distance), "it still orbits");
    watched.seen("the last view");
}

#[test]
fn the_mouse_orbits_pans_looks_and_nears() {
    let Some(watched) = Watched::room("mouse") else {
        return;
    };
    watched.keys(&["Home"]);
    let pivot = pivot(&watched);
    let before = watched.camera();
    let distance = before.eye.distance(pivot);
    // Two hundredth of a degree or so for each pixel; the left button turns the scene with it.
    watched.drag("1", DVec2::new(60.0, 20.0));
    let orbited = watched.seen("an orbit");
    assert!(looks_at(&orbited, pivot, distance), "{orbited:?}, {distance} from {pivot}");
    let moved = orbited.eye - before.eye;
    assert!(moved.dot(before.right()) < -0.1 && moved.dot(before.up) > 0.1, "{moved}");
    // What is as far as the pivot follows the cursor to the pixel.
    watched.drag("2", DVec2::new(30.0, -20.0));
    let panned = watched.seen("a pan");
    let pixel = 2.0 * distance * (0.5 * before.angle.unwrap().to_radians()).tan() / f64::from(SIZE[1]);
    let expected = (orbited.right() * -30.0 - orbited.up * 20.0) * pixel;
    assert!(panned.eye.distance(orbited.eye + expected) < 0.1 * pixel, "{}", panned.eye - orbited.eye);
    assert!(near(panned.ahead, orbited.ahead));
    let pivot = pivot + expected;
    // Ctrl and the wheel: nine tenths of the way for each notch. (One may count twice where the wheel is only two more
    // buttons.)
    watched.desktop.xdotool([
        "keydown", "ctrl", "click", "4", "click", "4", "click", "4", "click", "5", "keyup", "ctrl",
    ]);
    let nearer = watched.seen("nearer");
    let part = nearer.eye.distance(pivot) / panned.eye.distance(pivot);
    assert!(near(nearer.eye, pivot + (panned.eye - pivot) * part), "{}", nearer.eye);
    assert!([2, 4].into_iter().any(|notches| (part - 0.9f64.powi(notches)).abs() < 1e-6), "{part}");
    // The right button looks to where the mouse goes.
    watched.drag("3", DVec2::new(40.0, 30.0));
    let looked = watched.seen("another direction");
    assert_eq!(looked.eye, nearer.eye);
    let turned = looked.ahead - nearer.ahead;
    assert!(turned.dot(nearer.right()) > 0.02 && turned.dot(nearer.up) < -0.02, "{turned}");
}
