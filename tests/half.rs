//! Half of the first samples, when there is no time for all.

#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DVec3, UVec2, Vec3};
use penumbra::image::files::linear_pixels;
use penumbra::scene::{Light, Material};
use penumbra::trace::film::Tile;
use penumbra::trace::guess::{guessed, guessed_blindly};
use penumbra::trace::{Film, Integrator, RenderSettings, trace_half, trace_pass};
use stage::{Stage, quad, settings};
use std::sync::atomic::{AtomicU32, Ordering};

/// A lit floor that fills a picture whose tiles are cut off at two borders; the last is one pixel.
fn floor(integrator: Integrator) -> Stage {
    let mut stage = Stage::new(RenderSettings { seed: 3, ..settings(33, 17, integrator, 3) });
    let grey = Material { double_sided: true, ..Material::lambert(Vec3::splat(0.6)) };
    stage.add_mesh(quad(Vec3::splat(-3.0), Vec3::X * 6.0, Vec3::Y * 6.0), grey, DAffine3::IDENTITY);
    let light = Light::Point { intensity: Vec3::splat(9.0) };
    stage.add(light, DAffine3::from_translation(DVec3::new(0.5, 0.2, 1.0)));
    stage.look(DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0);
    stage.app.build();
    stage
}

#[test]
fn two_halves_are_the_whole() {
    for integrator in [Integrator::Direct, Integrator::Path] {
        let stage = floor(integrator);
        let (scene, new) = (stage.scene(), || Film::new(stage.scene().settings.size, 0));
        let mut whole = new();
        trace_pass(&scene, &mut whole, 3, 3, || true);
        // Broken off again and again.
        let mut halves = new();
        while !halves.tiles().iter().all(|tile| tile.is_half() || tile.size.element_product() < 2) {
            let asked = AtomicU32::new(0);
            trace_half(&scene, &mut halves, || asked.fetch_add(1, Ordering::Relaxed) % 3 != 2);
            assert_eq!(halves.complete_samples(), 0);
        }
        assert!((halves.mean_samples() - 0.5).abs() < 0.02, "{}", halves.mean_samples());
        while halves.complete_samples() < 3 {
            let asked = AtomicU32::new(0);
            trace_pass(&scene, &mut halves, 3, 1, || asked.fetch_add(1, Ordering::Relaxed) % 5 != 4);
        }
        assert_eq!(halves.mean_samples(), 3.0);
        assert!(halves == whole, "{integrator:?}");
    }
}

#[test]
fn a_half_picture_has_no_holes() {
    let stage = floor(Integrator::Direct);
    let scene = stage.scene();
    let picture = |film: &Film| linear_pixels(film);
    let mut film = Film::new(scene.settings.size, 0);
    trace_half(&scene, &mut film, || true);
    let half = picture(&film);
    let looked_at =
        |film: &Film| (0..film.size().y).flat_map(|y| film.row(y)).filter(|pixel| pixel.count() > 0).count();
    assert_eq!(looked_at(&film), half.len().div_ceil(2));
    assert!((film.looked_at() - 0.5).abs() < 1e-3);
    trace_pass(&scene, &mut film, 1, 1, || true);
    for (guess, truth) in half.iter().zip(picture(&film)) {
        assert!(truth.x > 0.0 && (guess.x / truth.x - 1.0).abs() < 0.15, "{guess} for {truth}");
    }
    film.reset();
    assert!(!film.tiles().iter().any(Tile::is_half));
}

#[test]
fn a_picture_that_was_hardly_begun_has_no_holes() {
    let stage = floor(Integrator::Direct);
    let scene = stage.scene();
    let whole = {
        let mut film = Film::new(scene.settings.size, 0);
        trace_pass(&scene, &mut film, 1, 1, || true);
        linear_pixels(&film)
    };
    // Four of fifteen tiles, one after the other.
    let asked = AtomicU32::new(0);
    let mut film = Film::new(scene.settings.size, 0);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    one.install(|| trace_pass(&scene, &mut film, 1, 1, || asked.fetch_add(1, Ordering::Relaxed) < 4));
    assert!((0.1..0.5).contains(&film.looked_at()), "{}", film.looked_at());
    for (guess, truth) in linear_pixels(&film).iter().zip(whole) {
        assert!((0.3..3.0).contains(&(guess.x / truth.x)), "{guess} for {truth}");
    }
    // Black where nobody has looked, if the rest is to be: of a part of the picture that is refined alone, and of dropped samples.
    film.confine(Some([UVec2::ZERO, UVec2::splat(8)]));
    assert!(linear_pixels(&film).contains(&Vec3::ZERO));
    assert!(linear_pixels(&Film::new(UVec2::splat(9), 0)).iter().all(|pixel| *pixel == Vec3::ZERO));
}

/// Dark and bright steps of a stair, each a few pixels high, of which every other tile is known.
#[test]
fn what_is_guessed_goes_along_surfaces() {
    let mut stage = Stage::new(RenderSettings { seed: 3, ..settings(64, 64, Integrator::Direct, 1) });
    for i in 0..12 {
        let (y, z) = (f64::from(i) * 0.1 - 0.6, f64::from(i % 2) * -0.05);
        let grey = Material::lambert(Vec3::splat(if i % 2 == 0 { 0.8 } else { 0.1 }));
        let step = quad(Vec3::new(-1.0, 0.0, 0.0), Vec3::X * 2.0, Vec3::Y * 0.1);
        stage.add_mesh(step, grey, DAffine3::from_translation(DVec3::new(0.0, y, z)));
    }
    let light = Light::Point { intensity: Vec3::splat(9.0) };
    stage.add(light, DAffine3::from_translation(DVec3::new(0.5, 0.2, 3.0)));
    stage.look(DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0);
    stage.app.build();
    let scene = stage.scene();
    let mut film = Film::new(scene.settings.size, 0);
    trace_pass(&scene, &mut film, 64, 64, || true);
    let truth = linear_pixels(&film);
    let empty = Film::new(film.size(), 0);
    for (i, tile) in film.tiles_mut().iter_mut().enumerate().filter(|(i, _)| (i % 8 + i / 8) % 2 == 0) {
        *tile = empty.tiles()[i].clone();
    }
    assert!(film.has_gaps());
    let error = |guess: Vec<Vec3>| {
        let squares = guess.iter().zip(&truth).map(|(guess, truth)| (*guess - *truth).length_squared());
        squares.sum::<f32>() / truth.len() as f32
    };
    let (with, without) = (error(guessed(&film, &scene)), error(guessed_blindly(&film)));
    println!("squared error {with:.2e}, {without:.2e} without surfaces");
    assert!(with < 0.1 * without, "{with} is not far below {without}");
    // What is known is as it is, to the bit.
    let known = guessed(&film, &scene);
    assert_eq!(known[8], truth[8]);
}
