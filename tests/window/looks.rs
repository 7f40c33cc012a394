//! Keys that change how the picture is made or shown.

use super::desktop::{Desktop, difference, pause, wait_for};
use super::watched::{Watched, upper};
use image::RgbImage;
use image::imageops::crop_imm;

const CORNELL: &[&str] = &["cornell", "--resolution", "320x240", "--spp", "4"];

/// The exposure that brings nine tenths of what is not black in this file to 0.7 or below, in thirds of a stop.
fn exposure_of(file: &std::path::Path) -> f32 {
    let picture = image::open(file).unwrap().to_rgb32f();
    let luminance = |p: &image::Rgb<f32>| 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
    let mut lit: Vec<f32> = picture.pixels().map(luminance).filter(|&l| l > 0.0).collect();
    lit.sort_by(f32::total_cmp);
    ((0.7 / lit[(lit.len() - 1) * 9 / 10]).log2() * 3.0).round() / 3.0
}

#[test]
fn exposure_and_tone_map_are_those_of_the_flags_and_s_saves_them() {
    let Some(watched) = Watched::of("exposure", CORNELL, &["--exposure", "-6"], |_| {}) else {
        return;
    };
    let linear = watched.desktop.directory.join("linear.exr");
    let mut render = watched.desktop.command(env!("CARGO_BIN_EXE_penumbra"));
    let render = render.arg("render").args(CORNELL).args(["-q", "-o"]).arg(&linear);
    assert!(render.status().unwrap().success());
    let auto = exposure_of(&linear);
    assert!(auto > -5.0, "{auto}");
    let third = 1.0 / 3.0f32;
    let mut exposure = -6.0;
    let mut tone_map = 0;
    let mut last = watched.rendered(&["--exposure", "-6"]);
    for (key, brighter, maps) in [
        ("x", auto + 6.0, 0),
        ("t", 0.0, 1),
        ("t", 0.0, 1),
        ("t", 0.0, 1),
        ("t", 0.0, 1),
        ("shift+t", 0.0, 3),
        ("shift+t", 0.0, 3),
        ("period", third, 0),
        ("comma", -third, 0),
        ("comma", -third, 0),
        ("shift+period", 1.0, 0),
        ("shift+comma", -1.0, 0),
        ("x", third, 0),
    ] {
        exposure += brighter;
        tone_map = (tone_map + maps) % 4;
        // On the grid of thirds.
        let stops = ((exposure * 3.0).round() / 3.0).to_string();
        let map = ["clip", "neutral", "agx", "aces"][tone_map];
        watched.keys(&[key]);
        let what = format!("{stops} EV, {map}, after {key}");
        let now = watched.shows(&what, &["--exposure", &stops, "--tone-map", map]);
        assert!(difference(&upper(&now), &upper(&last)) > 0.1, "{what} looks like before");
        last = now;
    }
    // Both of what is saved, whole.
    watched.keys(&["ctrl+s"]);
    let [exr, png] = ["cornell_1.exr", "cornell_1.png"].map(|name| watched.desktop.directory.join(name));
    let saved = wait_for("a saved picture", || Some(image::open(&png).ok()?.to_rgb8()));
    assert_eq!(difference(&saved, &last), 0.0);
    let [saved, linear] = [exr, linear].map(|file| image::open(file).unwrap().to_rgb32f());
    assert!(saved == linear, "the linear one is another");
}

/// A square with a texture of four by four texels.
fn texture(desktop: &Desktop) {
    let texel = |x: u32, y: u32| image::Rgb([(x * 80) as u8, (y * 80) as u8, ((x ^ y) % 2 * 250) as u8]);
    RgbImage::from_fn(4, 4, texel).save(desktop.directory.join("texels.png")).unwrap();
    let square =
        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    desktop.write("square.obj", square);
    desktop.write(
        "scene.toml",
        "[[model]]\nfile = 'square.obj'\nmaterial = 'a'\n[material.a]\nbase_color = [1, 1, 1]\n\
         base_color_texture = 'texels.png'\nfilter = 'nearest'\n[[light]]\nkind = 'environment'\n\
         radiance = [0.8, 0.8, 0.8]\n[camera]\nposition = [0, 0, 2]\ntarget = [0, 0, 0]\n[render]\nexposure = 0\n",
    );
}

#[test]
fn filter_and_integrator_are_those_of_the_flags() {
    let Some(watched) = Watched::scene("filter", &[], texture) else {
        return;
    };
    let pictures = ["nearest", "bilinear"].map(|filter| watched.rendered(&["--filter", filter]));
    assert!(difference(&upper(&pictures[0]), &upper(&pictures[1])) > 0.1);
    // As the file says, which is nearest, then nearest, bilinear, and so on.
    watched.shows_picture("as the file says", &pictures[0]);
    for (presses, number) in [(2, 1), (1, 0), (1, 0), (1, 1)] {
        watched.keys(&vec!["n"; presses]);
        watched.shows_picture(&format!("filter {number}"), &pictures[number]);
    }
    drop(watched);
    let Some(watched) = Watched::of("integrator", CORNELL, &[], |_| {}) else {
        return;
    };
    let [direct, path] = ["direct", "path"].map(|name| watched.rendered(&["--integrator", name]));
    assert!(difference(&upper(&direct), &upper(&path)) > 0.1);
    for picture in [&path, &direct] {
        watched.keys(&["i"]);
        watched.shows_picture("the other integrator", picture);
    }
}

#[test]
fn views_go_backwards_with_shift_and_show_what_they_say() {
    let Some(watched) = Watched::room("backwards") else {
        return;
    };
    let plain = watched.rendered(&[]);
    // On the floor at the left.
    let spot = |picture: &RgbImage| picture.get_pixel(20, 120).0;
    let view = |what: &str, is: &dyn Fn(&RgbImage) -> bool| {
        watched.keys(&["shift+v"]);
        wait_for(what, || is(&watched.upper()).then_some(()));
    };
    let grey = |p: &image::Rgb<u8>| p[0] == p[1] && p[1] == p[2];
    view("a dim picture", &|picture| picture.pixels().all(|p| grey(p) && p[0] <= 90));
    view("depth", &|picture| {
        picture.pixels().all(|p| grey(p) && (p[0] == 0 || p[0] >= 35))
            && (36..255).contains(&spot(picture)[0])
    });
    // 0.8 as sRGB.
    view("base colours", &|picture| spot(picture) == [231; 3]);
    view("normals", &|picture| spot(picture) == [127, 255, 127]);
    watched.keys(&["v"; 4]);
    watched.shows_picture("the picture", &plain);
}

#[test]
fn the_kept_picture_is_shown_while_k_is_held_and_the_reference_when_it_is_asked_for() {
    let red = |desktop: &Desktop| {
        let bytes: Vec<u8> =
            (0..320 * 240).flat_map(|_| [0.5f32, 0.0, 0.0]).flat_map(f32::to_ne_bytes).collect();
        let file = desktop.directory.join("red.exr");
        image::save_buffer(file, &bytes, 320, 240, image::ColorType::Rgb32F).unwrap();
    };
    let Some(watched) = Watched::of("held", CORNELL, &["--reference", "red.exr"], red) else {
        return;
    };
    // The card says which one it is: below it.
    let below = |picture: &RgbImage| crop_imm(picture, 0, 80, 320, 50).to_image();
    let before = watched.rendered(&[]);
    let holds = |what: &str, is: &dyn Fn(&RgbImage) -> bool| {
        let now = watched.upper();
        watched.desktop.xdotool(["keydown", "k"]);
        wait_for(what, || is(&below(&watched.upper())).then_some(()));
        watched.desktop.xdotool(["keyup", "k"]);
        wait_for("the picture again", || (difference(&watched.upper(), &now) == 0.0).then_some(()));
    };
    let is_red = |picture: &RgbImage| picture.pixels().all(|p| p[0] > 150 && p[1] < 3 && p[2] < 3);
    let is_kept = |picture: &RgbImage| difference(picture, &below(&before)) == 0.0;
    holds("the reference", &is_red);
    watched.keys(&["ctrl+k", "Home"]);
    watched.seen("another view");
    holds("the kept picture", &is_kept);
    watched.keys(&["ctrl+shift+k"]);
    // A notice is no part of it.
    holds("the reference again", &is_red);
    watched.keys(&["ctrl+shift+k"]);
    holds("the kept picture again", &is_kept);
}

/// How many samples the title tells.
fn samples(watched: &Watched) -> Option<u32> {
    let title = watched.desktop.title(&watched.program);
    let (told, _) = title.rsplit_once(" of ")?;
    told.rsplit(' ').next()?.parse().ok()
}

#[test]
fn space_rests_and_goes_on_and_r_begins_again() {
    let endless = &["cornell", "--resolution", "320x240", "--integrator", "path", "--spp", "1000000"];
    let Some(watched) = Watched::endless("rest", endless) else {
        return;
    };
    wait_for("some samples", || samples(&watched).filter(|&samples| samples >= 20));
    watched.keys(&["space"]);
    let title = || watched.desktop.title(&watched.program);
    wait_for("a rest", || title().ends_with("- paused").then_some(()));
    let ticks = wait_for("the last of the work", || {
        let ticks = watched.program.ticks();
        pause(300);
        (watched.program.ticks() == ticks).then_some(ticks)
    });
    let still = watched.upper();
    pause(500);
    assert!(
        watched.program.ticks() - ticks < 4 && difference(&still, &watched.upper()) == 0.0,
        "it works on"
    );
    watched.keys(&["space"]);
    let many = wait_for("more samples", || samples(&watched).filter(|&samples| samples >= 30));
    assert!(difference(&still, &watched.upper()) > 0.05);
    watched.keys(&["r"]);
    wait_for("samples from the first one on", || samples(&watched).filter(|&samples| samples < many));
}
