//! Views of pixels, cards, and what explains the picture.

use super::desktop::{SMALL, colors, desktop, difference, green_and_red, pause, pictures_in, wait_for};

/// Where no short notice lies.
fn top(picture: &image::RgbImage) -> image::RgbImage {
    image::imageops::crop_imm(picture, 0, 0, 320, 190).to_image()
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
        let shown = top(&desktop.shot(&program));
        let others = seen.iter().map(top);
        // Samples are as many everywhere, and boxes on the walls.
        assert!(view == 3 || colors(&shown) > 1, "view {view} shows next to nothing");
        assert!(others.into_iter().all(|other| difference(&shown, &other) > 0.05), "view {view} is another");
        seen.push(desktop.shot(&program));
    }
    desktop.xdotool(["key", "v"]);
    wait_for("the picture", || {
        (difference(&top(&beauty), &top(&desktop.shot(&program))) == 0.0).then_some(())
    });
    for key in ["h", "g", "z"] {
        desktop.xdotool(["key", key]);
        pause(400);
        assert!(difference(&beauty, &desktop.shot(&program)) > 0.05, "{key} shows nothing");
        desktop.xdotool(["key", key]);
        pause(400);
    }
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
    let differs = || difference(&top(&plain), &top(&desktop.shot(&program)));
    wait_for("no rays", || (differs() == 0.0).then_some(()));
    desktop.xdotool(["key", "b"]);
    wait_for("a box around everything", || (differs() > 0.01).then_some(()));
}

#[test]
fn old_samples_and_smoothing_are_told_and_switched_off_and_the_report_opens() {
    let Some(desktop) = desktop("shown") else {
        return;
    };
    let size = ["--resolution", "640x360", "--integrator", "path", "--spp", "100000"];
    let status = |program: &_| image::imageops::crop_imm(&desktop.shot(program), 0, 0, 420, 110).to_image();
    // Samples of the old view are shown for a while after a step: the status has a line more.
    let mut program = desktop.start(&size);
    pause(2500);
    desktop.xdotool(["keydown", "a"]);
    pause(300);
    let moving = red_letters(&status(&program));
    desktop.xdotool(["keyup", "a"]);
    assert!(moving > 20, "nothing is said while old samples are shown: {moving}");
    wait_for("the picture of its own samples", || (red_letters(&status(&program)) == 0).then_some(()));
    let before = desktop.shot(&program);
    desktop.xdotool(["key", "l"]);
    pause(500);
    assert!(difference(&before, &desktop.shot(&program)) > 0.1, "the report of loading");
    desktop.xdotool(["key", "Escape"]);
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
    // Without both nothing is to be told, but for the preview.
    let off = [&size[..], &["--no-kept-samples", "--no-smoothing"]].concat();
    let program = desktop.start(&off);
    pause(2500);
    desktop.xdotool(["key", "r"]);
    wait_for("no word but that of the preview", || (red_letters(&status(&program)) == 0).then_some(()));
}

/// Pixels of the colour in which cautions are written.
fn red_letters(picture: &image::RgbImage) -> usize {
    picture.pixels().filter(|p| p[0] > 200 && p[1] < 150 && p[2] < 130).count()
}

/// A white triangle that moves to the right, over and over.
fn moving_triangle(directory: &std::path::Path) {
    let floats = [
        [-0.5f32, -0.5, 0.0, 0.5, -0.5, 0.0, 0.0, 0.5, 0.0].as_slice(),
        &[0.0, 2.0],
        &[-1.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    ];
    let binary: Vec<u8> = floats.concat().iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(directory.join("a.bin"), &binary).unwrap();
    let gltf = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"uri":"a.bin","byteLength":68}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},
        {"buffer":0,"byteOffset":44,"byteLength":24}],"accessors":[
        {"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[-1,-1,0],"max":[1,1,0]},
        {"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR","min":[0],"max":[2]},
        {"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"}],
        "animations":[{"samplers":[{"input":1,"output":2}],
        "channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]}]}"#;
    std::fs::write(directory.join("a.gltf"), gltf).unwrap();
    let scene = "[[model]]\nfile = 'a.gltf'\n[[light]]\nkind = 'environment'\nradiance = [1, 1, 1]\n\
                 [camera]\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\n";
    std::fs::write(directory.join("scene.toml"), scene).unwrap();
}

#[test]
fn animations_play_stop_and_step_and_a_screenshot_knows_the_time() {
    let Some(desktop) = desktop("animation") else {
        return;
    };
    moving_triangle(&desktop.directory);
    let mut program = desktop.start(&["scene.toml", "--resolution", "320x240", "--spp", "4"]);
    desktop.hide_status(&mut program);
    let rest = desktop.shot(&program);
    desktop.xdotool(["key", "ctrl+space"]);
    let moved = wait_for("the triangle moves", || {
        let shot = desktop.shot(&program);
        (difference(&rest, &shot) > 0.05).then_some(shot)
    });
    wait_for("it goes on", || (difference(&moved, &desktop.shot(&program)) > 0.01).then_some(()));
    desktop.xdotool(["key", "ctrl+space"]);
    let still = || {
        wait_for("it stands still", || {
            let shot = top(&desktop.shot(&program));
            pause(300);
            (shot == top(&desktop.shot(&program))).then_some(shot)
        })
    };
    let stopped = still();
    for (key, moves) in [("ctrl+period", true), ("ctrl+comma", false), ("ctrl+period", true)] {
        for _ in 0..6 {
            desktop.xdotool(["key", key]);
        }
        // A quarter of a second later, as when it stopped, and later again.
        wait_for(&format!("the picture of another time after {key}"), || {
            let shot = top(&desktop.shot(&program));
            (if moves { difference(&stopped, &shot) > 0.01 } else { difference(&stopped, &shot) < 0.002 })
                .then_some(())
        });
    }
    still();
    desktop.xdotool(["key", "ctrl+F12"]);
    let shot = wait_for("a screenshot", || pictures_in(&desktop.directory).pop());
    pause(500);
    let mut again = desktop.command(env!("CARGO_BIN_EXE_penumbra"));
    let again = again.args(["render", "--from"]).arg(&shot).args(["-q", "-o", "again.png"]);
    assert!(again.status().unwrap().success());
    let [a, b] = [shot, desktop.directory.join("again.png")].map(|path| image::open(path).unwrap().to_rgb8());
    assert!(difference(&a, &b) < 0.002, "{}", difference(&a, &b));
}
