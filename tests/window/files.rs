//! Scenes that are opened, dropped, changed while they are seen.

use super::desktop::{SMALL, desktop, difference, green_and_red, pause, wait_for};

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
fn a_typed_name_opens_a_scene_and_a_sky_and_a_wrong_one_says_so() {
    let Some(desktop) = desktop("open") else {
        return;
    };
    let write = |name: &str, text: &str| std::fs::write(desktop.directory.join(name), text).unwrap();
    write("floor.obj", "v -3 0 -3\nv 3 0 -3\nv 3 0 3\nv -3 0 3\nf 1 4 3 2\n");
    write(
        "green.toml",
        "[[model]]\nfile = 'floor.obj'\nmaterial = 'a'\n[material.a]\nbase_color = [0.1, 0.8, 0.1]\n\
         [[light]]\nkind = 'environment'\nradiance = [1, 1, 1]\n[camera]\nposition = [0, 2, 6]\ntarget = [0, 0, 0]\n",
    );
    let red: Vec<f32> = (0..8 * 4).flat_map(|_| [1.0, 0.05, 0.05]).collect();
    let bytes: Vec<u8> = red.iter().flat_map(|c| c.to_ne_bytes()).collect();
    let sky = desktop.directory.join("red.exr");
    image::save_buffer(&sky, &bytes, 8, 4, image::ColorType::Rgb32F).unwrap();
    let mut program = desktop.start(SMALL);
    desktop.wait_until_done(&mut program);
    let typed = |name: &str| {
        desktop.xdotool(["key", "ctrl+o"]);
        pause(200);
        desktop.xdotool(["type", "--delay", "30", name]);
        // Completed, then opened.
        desktop.xdotool(["key", "Tab"]);
        pause(100);
        desktop.xdotool(["key", "Return"]);
    };
    typed("gre");
    wait_for("the green floor", || (green_and_red(&desktop.shot(&program)).0 > 1000).then_some(()));
    typed("red");
    wait_for("the red sky", || (green_and_red(&desktop.shot(&program)).1 > 1000).then_some(()));
    typed("nothing.glb");
    pause(1500);
    assert!(program.is_alive());
    assert!(green_and_red(&desktop.shot(&program)).1 > 1000, "the old scene stays");
    // The line is still there, to be mended: an absolute path takes the place of what was typed.
    desktop.xdotool([
        "type",
        "--delay",
        "30",
        &format!("/{}", desktop.directory.join("green.toml").display()),
    ]);
    desktop.xdotool(["key", "Return"]);
    wait_for("the green floor again", || {
        let (green, red) = green_and_red(&desktop.shot(&program));
        (green > 1000 && red < 1000).then_some(())
    });
    desktop.xdotool(["key", "ctrl+q"]);
    assert_eq!(program.wait().code(), Some(0));
}
