//! Places to look from: sides of the scene, the file's cameras, bookmarks; and lenses.

use super::desktop::{Desktop, difference};
use super::watched::{Camera, SIZE, Watched, near, upper};
use glam::DVec3;

/// The direction in which `camera` sees this pixel; ahead it is 1 long.
fn through(camera: &Camera, [x, y]: [u32; 2]) -> DVec3 {
    let half = (0.5 * camera.angle.unwrap().to_radians()).tan();
    let [width, height] = SIZE.map(f64::from);
    let across = (2.0 * f64::from(x) - width) / height * half;
    camera.ahead + camera.right() * across + camera.up * (1.0 - 2.0 * f64::from(y) / height) * half
}

#[test]
fn the_whole_scene_is_seen_from_all_sides_and_enter_comes_back() {
    let Some(watched) = Watched::room("sides") else {
        return;
    };
    let first = watched.rendered(&[]);
    watched.keys(&["Home"]);
    let whole = watched.seen("the whole scene");
    for corner in 0..8 {
        let at = |axis: i32, low: f64, high: f64| if corner >> axis & 1 == 0 { low } else { high };
        let seen = DVec3::new(at(0, -4.0, 4.0), at(1, 0.0, 1.0), at(2, -4.0, 4.0)) - whole.eye;
        let edge = through(&whole, [SIZE[0], 0]);
        let [x, y] = [whole.right(), whole.up].map(|axis| seen.dot(axis).abs() / seen.dot(whole.ahead));
        assert!(x < edge.dot(whole.right()) && y < edge.dot(whole.up), "corner {corner} at {x}, {y}");
    }
    let sides = [
        ("1", DVec3::Z, DVec3::Y),
        ("3", DVec3::X, DVec3::Y),
        ("7", DVec3::Y, DVec3::NEG_Z),
        ("ctrl+1", DVec3::NEG_Z, DVec3::Y),
        ("ctrl+3", DVec3::NEG_X, DVec3::Y),
        ("ctrl+7", DVec3::NEG_Y, DVec3::Z),
    ];
    let cameras = sides.map(|(key, side, up)| {
        watched.keys(&[key]);
        let camera = watched.camera();
        assert!(near(camera.ahead, -side) && near(camera.up, up), "{key}: {camera:?}");
        camera
    });
    let pivot = cameras[0].eye.with_z(cameras[1].eye.z);
    let distance = cameras[0].eye.distance(pivot);
    for (camera, (key, side, _)) in cameras.iter().zip(sides) {
        assert!(near(camera.eye, pivot + side * distance), "{key}: {} of {pivot}", camera.eye);
    }
    watched.keys(&["7"]);
    watched.seen("from above");
    watched.keys(&["Return"]);
    watched.shows_picture("the first camera", &first);
    watched.keys(&["Home"]);
    watched.seen("the whole scene again");
    watched.keys(&["KP_Enter"]);
    watched.shows_picture("the first camera by the other Enter", &first);
}

#[test]
fn a_parallel_view_shows_the_pivot_as_large_and_returns() {
    let Some(watched) = Watched::room("parallel") else {
        return;
    };
    watched.keys(&["Home", "1"]);
    let before = watched.seen("from the front");
    watched.keys(&["3"]);
    let distance = before.eye.z - watched.camera().eye.z;
    watched.keys(&["1", "5"]);
    let parallel = watched.seen("in parallel");
    assert!(near(parallel.eye, before.eye) && parallel.angle.is_none(), "{parallel:?}");
    let wanted = 2.0 * distance * (0.5 * before.angle.unwrap().to_radians()).tan();
    assert!((parallel.height.unwrap() - wanted).abs() < 1e-5 * wanted, "{parallel:?}: {wanted}");
    // Forward is narrower.
    watched.hold("w");
    let narrower = watched.seen("narrower");
    assert!(narrower.height < parallel.height && narrower.eye == parallel.eye, "{narrower:?}");
    watched.keys(&["5"]);
    let back = watched.seen("in perspective");
    assert!(back.angle == before.angle && back.eye.z < before.eye.z, "{back:?}");
}

#[test]
fn f_takes_what_is_under_the_cursor_for_pivot_and_focus_of_the_lens() {
    let Some(watched) = Watched::room("focus") else {
        return;
    };
    let camera = watched.camera();
    // Two places of the floor.
    let [first, second] = [[60, 200], [300, 150]].map(|[x, y]| {
        let way = through(&camera, [x, y]);
        (x, y, -camera.eye.y / way.y, camera.eye + way * (-camera.eye.y / way.y))
    });
    watched.cursor(first.0, first.1);
    watched.keys(&["f", "0"]);
    let close = |a: f64, b: f64| (a - b).abs() < 1e-4 * b;
    // The smallest lens, then larger by the root of two with each press.
    for radius in [1.0, 2f64.sqrt(), 2.0] {
        let [told, focus] = watched.camera().lens.unwrap();
        assert!(close(focus, first.2), "sharp at {focus}, not {}", first.2);
        assert!(close(told, radius * focus / 512.0), "{told} of {focus}");
        watched.keys(&["0"]);
    }
    watched.keys(&["0"; 5]);
    watched.seen("through a lens");
    watched.cursor(second.0, second.1);
    watched.keys(&["f"]);
    let [radius, focus] = watched.seen("sharp elsewhere").lens.unwrap();
    assert!(close(focus, second.2), "sharp at {focus}, not {}", second.2);
    watched.keys(&["9"]);
    assert!(close(watched.camera().lens.unwrap()[0], radius / 2f64.sqrt()));
    watched.keys(&["9"; 8]);
    assert_eq!(watched.seen("without a lens").lens, None);
    // The pivot is there, too.
    watched.keys(&["3"]);
    let side = watched.camera();
    assert!((side.eye - second.3).with_x(0.0).length() < 1e-4, "{} beside {}", side.eye, second.3);
    watched.keys(&["1"]);
    let front = watched.camera();
    assert!((front.eye - second.3).with_z(0.0).length() < 1e-4, "{} before {}", front.eye, second.3);
}

#[test]
fn bookmarks_bring_back_place_lens_and_projection() {
    let Some(watched) = Watched::room("bookmarks") else {
        return;
    };
    watched.keys(&["Home", "ctrl+shift+1"]);
    let first = watched.seen("a place");
    watched.keys(&["3", "5", "0", "0", "0", "0", "ctrl+shift+9"]);
    let ninth = watched.seen("another place");
    watched.keys(&["Return"]);
    watched.hold("a");
    let elsewhere = watched.seen("elsewhere");
    assert!(first != ninth && first != elsewhere && ninth != elsewhere);
    watched.keys(&["shift+5"]);
    assert_eq!(watched.camera(), elsewhere, "an empty one goes nowhere");
    for (key, place) in [("shift+9", &ninth), ("shift+1", &first), ("shift+9", &ninth)] {
        watched.keys(&[key]);
        assert_eq!(watched.seen(key), *place, "{key}");
    }
    // One that is set again is another.
    watched.keys(&["Return", "ctrl+shift+9", "Home", "shift+9"]);
    watched.shows("where the ninth is now", &[]);
    // They outlive the window.
    let watched = watched.again();
    watched.keys(&["shift+1"]);
    assert_eq!(watched.seen("the first, in another window"), first);
}

/// A triangle, and three cameras before it.
fn three_cameras(desktop: &Desktop) {
    let floats = [-1.0f32, -1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0];
    let binary: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(desktop.directory.join("a.bin"), binary).unwrap();
    let gltf = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1,2,3]}],"nodes":[{"mesh":0},
        {"name":"left","camera":0,"translation":[-1,0,4]},{"name":"middle","camera":0,"translation":[0,0,3]},
        {"name":"right","camera":0,"translation":[1,0.5,5]}],
        "cameras":[{"type":"perspective","perspective":{"yfov":0.8,"znear":0.1}}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"uri":"a.bin","byteLength":36}],
        "bufferViews":[{"buffer":0,"byteLength":36}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,
        "type":"VEC3","min":[-1,-1,0],"max":[1,1,0]}]}"#;
    desktop.write("a.gltf", gltf);
    desktop.write(
        "scene.toml",
        "[[model]]\nfile = 'a.gltf'\n[[light]]\nkind = 'environment'\nradiance = [0.5, 0.5, 0.5]\n",
    );
}

#[test]
fn brackets_go_through_the_cameras_of_the_file() {
    let Some(watched) = Watched::scene("cameras", &[], three_cameras) else {
        return;
    };
    let pictures = ["0", "1", "2"].map(|number| watched.rendered(&["--camera", number]));
    assert!((0..3).all(|i| difference(&upper(&pictures[i]), &upper(&pictures[(i + 1) % 3])) > 0.01));
    let shows = |key: &str, number: usize| {
        watched.keys(&[key]);
        watched.shows_picture(&format!("{key}: camera {number}"), &pictures[number]);
    };
    watched.shows_picture("the first camera", &pictures[0]);
    for (key, number) in [
        ("bracketright", 1),
        ("bracketright", 2),
        ("bracketright", 0),
        ("bracketleft", 2),
        ("bracketleft", 1),
        ("Return", 0),
    ] {
        shows(key, number);
    }
    // Also from anywhere between.
    watched.hold("a");
    shows("bracketright", 1);
}
