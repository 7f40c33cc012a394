//! More samples where there is more noise: no less right, and better.
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DVec3, UVec2, Vec3};
use penumbra::app::FrameBudget;
use penumbra::scene::{Light, Material};
use penumbra::trace::allot::{AGAIN, EVEN, RIPE, shares};
use penumbra::trace::{Film, Integrator, RenderSettings, TraceScene, hurry, trace_adaptive, trace_pass};
use stage::{Frames as _, Stage, quad, reds, settings};
use std::sync::atomic::{AtomicU32, Ordering};

const HERE: DAffine3 = DAffine3::IDENTITY;

/// The shadow of an edge on a floor, from above: dark, a narrow penumbra, light.
fn edge(size: u32) -> Stage {
    // Sampled: in closed form the penumbra has no noise.
    let sampled = RenderSettings { shafts: false, ..settings(size, size, Integrator::Direct, 1) };
    let mut stage = Stage::new(sampled);
    let white = Material { base_color: Vec3::ONE, ..Material::default() };
    stage.add_mesh(quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), white.clone(), HERE);
    stage.add_mesh(quad(Vec3::new(-9.0, 1.0, -9.0), Vec3::Z * 18.0, Vec3::X * 9.0), white, HERE);
    let lamp = Light::Parallelogram {
        edge_u: Vec3::X * 0.5,
        edge_v: Vec3::Z * 0.5,
        radiance: [Vec3::splat(9.0); 4],
        two_sided: true,
    };
    stage.add(lamp, DAffine3::from_translation(DVec3::Y * 3.0));
    // Between the floor and the edge.
    stage.look(DVec3::new(0.0, 0.9, 0.0), DVec3::ZERO, DVec3::Z, 4.0);
    stage.trace(1);
    stage
}

/// A film of its own from the stage's scene.
fn film(stage: &Stage, seed: u32, samples: u32, adaptive: bool) -> Film {
    let settings = RenderSettings { seed, ..*stage.scene().settings };
    let scene = TraceScene { settings: &settings, ..stage.scene() };
    let mut film = Film::new(settings.size, 0);
    while film.complete_samples() < samples {
        if adaptive {
            trace_adaptive(&scene, &mut film, samples, samples, || true);
        } else {
            trace_pass(&scene, &mut film, samples, samples, || true);
        }
    }
    assert_eq!(film.complete_samples(), samples);
    film
}

/// Mean and variance of the mean over several pictures, by pixel.
#[derive(Default)]
struct Moments(Vec<[f64; 2]>, f64);

impl Moments {
    fn add(&mut self, values: &[f64]) {
        self.0.resize(values.len(), [0.0; 2]);
        for (sums, v) in self.0.iter_mut().zip(values) {
            sums[0] += v;
            sums[1] += v * v;
        }
        self.1 += 1.0;
    }
    fn mean_square_from(&self, truth: &[f64]) -> f64 {
        let n = self.1;
        let squares = self.0.iter().zip(truth).map(|(s, t)| s[1] / n - 2.0 * t * s[0] / n + t * t);
        squares.sum::<f64>() / truth.len() as f64
    }
}

#[test]
fn samples_go_to_the_penumbra() {
    let stage = edge(96);
    let film = film(&stage, 1, 24, true);
    let shares = shares(&film);
    let mean: f32 = shares.iter().sum::<f32>() / shares.len() as f32;
    assert!((mean - 1.0).abs() < 1e-3, "{mean}");
    let count = |x: u32| film.pixel(x, 48).count();
    assert!(
        count(48) > 3 * count(4) && count(48) > 3 * count(91),
        "{} {} {}",
        count(4),
        count(48),
        count(91)
    );
    assert!((film.mean_samples() - 24.0).abs() < 1.0, "{}", film.mean_samples());
}

#[test]
fn the_error_is_smaller_for_the_same_samples() {
    let stage = edge(96);
    let truth = reds(&film(&stage, 99, 8192, false));
    let [mut adaptive, mut even] = [Moments::default(), Moments::default()];
    for seed in 0..20 {
        adaptive.add(&reds(&film(&stage, seed, 64, true)));
        even.add(&reds(&film(&stage, seed, 64, false)));
    }
    let gain = (even.mean_square_from(&truth) / adaptive.mean_square_from(&truth)).sqrt();
    println!("error of even samples over adaptive ones: {gain:.2}");
    assert!(gain > 1.3, "{gain}");
}

/// A pixel all of whose samples were dropped must not hold up the others.
#[test]
fn a_pixel_without_samples_says_nothing() {
    let mut film = Film::new(UVec2::splat(20), 0);
    for tile in film.tiles_mut() {
        for pixel in tile.pixels_mut() {
            pixel.add(0, Vec3::ONE);
            pixel.add(1, Vec3::ONE);
        }
        tile.next_sample = EVEN;
    }
    let empty = Film::new(UVec2::splat(20), 0);
    film.tiles_mut()[1].pixels_mut()[5] = *empty.pixel(0, 0);
    film.tiles_mut()[2].pixels_mut()[5].add(1, Vec3::splat(9.0));
    let shares = shares(&film);
    assert!(shares.iter().all(|share| share.is_finite() && *share > 0.0), "{shares:?}");
}

#[test]
fn a_frame_budget_asks_for_it() {
    let mut stage = edge(32);
    stage.app.world.resource_mut::<FrameBudget>().adaptive = true;
    let film = stage.trace(40);
    assert!(film.is_allotted());
}

/// A film in a hurry, broken off whenever it has asked so often whether to go on.
fn hurried(stage: &Stage, samples: u32, patience: u32) -> Film {
    let scene = stage.scene();
    let mut film = Film::new(scene.settings.size, 0);
    trace_pass(&scene, &mut film, 1, 1, || true);
    hurry(&scene, &mut film);
    go_on(&scene, &mut film, samples, patience);
    film
}

/// Until each pixel has `samples` on average, broken off again and again.
fn go_on(scene: &TraceScene, film: &mut Film, samples: u32, patience: u32) {
    for turn in 0.. {
        if film.complete_samples() >= samples {
            break;
        }
        assert!(turn < 100_000, "never ends");
        let asked = AtomicU32::new(0);
        trace_adaptive(scene, film, samples, 1, || asked.fetch_add(1, Ordering::Relaxed) < patience);
    }
}

#[test]
fn in_a_hurry_the_second_sample_goes_to_the_edge_and_nobody_loses_the_third() {
    let stage = edge(96);
    let film = hurried(&stage, 2, u32::MAX);
    let across = |film: &Film, x: [u32; 2]| {
        let counts =
            (x[0]..x[1]).flat_map(|x| (0..96).map(move |y| (x, y))).map(|(x, y)| film.pixel(x, y).count());
        counts.sum::<u64>() as f64 / f64::from(96 * (x[1] - x[0]))
    };
    assert!((1.5..2.2).contains(&film.mean_samples()), "{}", film.mean_samples());
    let [light, penumbra, dark] = [[0, 20], [40, 56], [76, 96]].map(|x| across(&film, x));
    println!("samples in the light, the penumbra, the dark: {light:.2} {penumbra:.2} {dark:.2}");
    assert!(dark == 1.0 && light < 2.5 && penumbra > 2.0 * light, "{light} {penumbra} {dark}");
    let film = hurried(&stage, EVEN, u32::MAX);
    assert!((0..96 * 96).all(|i| film.pixel(i % 96, i / 96).count() >= u64::from(EVEN)));
    assert!(film.is_allotted() && !film.has_first_shares());
    // Those who had more are waited for.
    let film = hurried(&stage, 24, u32::MAX);
    assert!((film.mean_samples() - 24.0).abs() < 1.0, "{}", film.mean_samples());
}

#[test]
fn a_hurry_that_is_broken_off_comes_to_the_same() {
    let stage = edge(40);
    assert!(hurried(&stage, 9, 3) == hurried(&stage, 9, u32::MAX));
}

#[test]
fn a_hurry_ends_also_where_only_a_part_is_refined() {
    let stage = edge(40);
    let scene = stage.scene();
    let mut film = Film::new(scene.settings.size, 0);
    trace_pass(&scene, &mut film, 1, 1, || true);
    hurry(&scene, &mut film);
    film.confine(Some([UVec2::splat(8), UVec2::splat(16)]));
    for _ in 0..20 {
        trace_adaptive(&scene, &mut film, 6, 1, || true);
    }
    assert_eq!(film.complete_samples(), 6);
    film.confine(None);
    assert_eq!(film.complete_samples(), EVEN);
    film.reset();
    assert!(!film.has_first_shares() && !film.is_allotted());
}

/// A film whose shares are found anew, broken off whenever it has asked so often whether to go on.
fn ripened(stage: &Stage, samples: u32, patience: u32) -> Film {
    let scene = stage.scene();
    let mut film = Film::new(scene.settings.size, 0);
    go_on(&scene, &mut film, samples, patience);
    film
}

/// Bars that are seen through between others, a twentieth of a pixel wide: few of the first samples meet one.
#[test]
fn shares_are_found_anew_when_more_is_known() {
    let mut stage = edge(48);
    let bright = Material { emission: Vec3::splat(2.0), ..Material::lambert(Vec3::ZERO) };
    for i in 0..6 {
        let x = f64::from(i) * 0.2 - 0.5;
        let bar = quad(Vec3::new(0.0, 0.5, -9.0), Vec3::Z * 18.0, Vec3::X * 0.002);
        stage.add_mesh(bar, bright.clone(), DAffine3::from_translation(DVec3::X * x));
    }
    stage.trace(1);
    let truth = reds(&film(&stage, 99, 2048, false));
    let error = |samples: u32, again: bool| {
        let mut moments = Moments::default();
        for seed in 0..10 {
            let settings = RenderSettings { seed, ..*stage.scene().settings };
            let scene = TraceScene { settings: &settings, ..stage.scene() };
            let mut film = Film::new(settings.size, 0);
            while film.mean_samples() < f64::from(samples) - 0.5 {
                match again || !film.is_allotted() {
                    true => trace_adaptive(&scene, &mut film, samples, 1, || true),
                    false => trace_pass(&scene, &mut film, samples, 1, || true),
                };
            }
            moments.add(&reds(&film));
        }
        moments.mean_square_from(&truth).sqrt()
    };
    let (once, again) = (error(64, false), error(64, true));
    println!("error with shares found once: {once:.5}, anew: {again:.5}");
    assert!(once > 1.1 * again, "{once} {again}");
}

#[test]
fn shares_found_anew_come_to_the_same_however_often_it_is_broken_off() {
    let stage = edge(40);
    let whole = ripened(&stage, RIPE + 8, u32::MAX);
    assert!(whole.is_allotted() && !whole.can_allot_again());
    assert_eq!(whole.even_samples(), AGAIN);
    assert!((0..40 * 40).all(|i| whole.pixel(i % 40, i / 40).count() >= u64::from(AGAIN)));
    assert!(whole == ripened(&stage, RIPE + 8, 3));
    // One whose second sample went to the edge knows nothing apart by then.
    assert!(!hurried(&stage, RIPE, u32::MAX).can_allot_again());
}

/// A part that was refined before the rest has more samples than shares go by: they are not found anew then.
#[test]
fn a_part_that_is_ahead_holds_up_nobody() {
    let stage = edge(40);
    let scene = stage.scene();
    for ahead in [5, 20, 300] {
        let mut film = Film::new(scene.settings.size, 0);
        film.confine(Some([UVec2::splat(8), UVec2::splat(16)]));
        trace_pass(&scene, &mut film, ahead, ahead, || true);
        film.confine(None);
        for turn in 0.. {
            if film.complete_samples() >= 24 {
                break;
            }
            assert!(turn < 100, "{ahead}: never ends");
            trace_adaptive(&scene, &mut film, 24, 1, || true);
        }
    }
}

#[test]
fn a_second_pass_that_has_begun_is_no_time_for_a_hurry() {
    let stage = edge(40);
    let scene = stage.scene();
    let mut film = Film::new(scene.settings.size, 0);
    trace_pass(&scene, &mut film, 1, 1, || true);
    let asked = AtomicU32::new(0);
    trace_pass(&scene, &mut film, 2, 1, || asked.fetch_add(1, Ordering::Relaxed) < 7);
    assert_eq!(film.complete_samples(), 1);
    hurry(&scene, &mut film);
    assert!(!film.has_first_shares());
    // Nor is one in which only a part is refined.
    let mut film = Film::new(scene.settings.size, 0);
    film.confine(Some([UVec2::splat(8), UVec2::splat(16)]));
    trace_pass(&scene, &mut film, 1, 1, || true);
    hurry(&scene, &mut film);
    assert!(!film.has_first_shares());
}

/// Hard shadows have noise at their edges only; the floor beside them just gets darker with the distance from the lamp.
#[test]
fn edges_keep_their_samples_when_shares_are_found_anew() {
    let mut stage = Stage::new(settings(96, 96, Integrator::Direct, 1));
    let white = Material { base_color: Vec3::ONE, ..Material::default() };
    stage.add_mesh(quad(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0), white.clone(), HERE);
    stage.add_mesh(quad(Vec3::new(-0.2, 1.0, -0.3), Vec3::new(0.2, 0.0, 0.5), Vec3::X * 0.5), white, HERE);
    let lamp = Light::Point { intensity: Vec3::splat(9.0) };
    stage.add(lamp, DAffine3::from_translation(DVec3::new(0.3, 2.0, 0.4)));
    stage.look(DVec3::new(0.0, 0.9, 0.0), DVec3::ZERO, DVec3::Z, 2.0);
    stage.trace(1);
    let truth = reds(&film(&stage, 99, 16_384, false));
    let [mut adaptive, mut even] = [Moments::default(), Moments::default()];
    for seed in 0..4 {
        adaptive.add(&reds(&film(&stage, seed, 96, true)));
        even.add(&reds(&film(&stage, seed, 96, false)));
    }
    let gain = even.mean_square_from(&truth) / adaptive.mean_square_from(&truth);
    println!("squared error of even samples over adaptive ones: {gain:.2}");
    // 39 by what the first eight samples say alone, with steps however small; 45 with the one mended, 38 with the other.
    assert!(gain > 48.0, "{gain}");
}
