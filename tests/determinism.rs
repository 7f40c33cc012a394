//! The picture is a function of the scene and the sample range: not of threads, time or the order of work.

#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DVec3, UVec2, Vec3};
use penumbra::app::{FrameBudget, FrameStats};
use penumbra::bvh::Isa;
use penumbra::scene::{Alpha, Glass, Glossy, Light, Material};
use penumbra::sync::Instructions;
use penumbra::trace::allot::RIPE;
use penumbra::trace::{Film, Integrator};
use stage::{Frames as _, Stage, ball, quad, settings};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A bit of everything: glossy, glass, half-transparent, many lights; a size that is no multiple of a tile.
fn stage() -> Stage {
    let mut stage = Stage::new(settings(53, 37, Integrator::Path, 5));
    let place = |x: f64, y: f64, z: f64| DAffine3::from_translation(DVec3::new(x, y, z));
    let glossy = Glossy::Ggx { metallic: 0.3, roughness: 0.4, texture: None };
    let floor = Material { glossy, ..Material::default() };
    stage.add_mesh(
        quad(Vec3::new(-3.0, -1.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0),
        floor,
        DAffine3::IDENTITY,
    );
    let glass = Some(Glass { ior: 1.5, tint: Vec3::ONE });
    stage.add_mesh(ball(8), Material { glass, ..Material::lambert(Vec3::ZERO) }, place(1.2, 0.0, 0.0));
    let veil = Material { alpha: Alpha::Blend, opacity: 0.5, ..Material::default() };
    stage.add_mesh(ball(8), veil, place(-1.2, 0.0, 0.0));
    for i in 0..12 {
        stage.add(
            Light::Sphere { radius: 0.1, radiance: Vec3::splat(5.0) },
            place(f64::from(i) * 0.4 - 2.0, 2.0, 1.0),
        );
    }
    stage.look_wide(DVec3::new(0.0, 1.5, 4.0), DVec3::ZERO);
    stage
}

/// Lambert's surfaces under lamps that are computed, cut, sampled and shared: what whole blocks and vectors do.
fn diffuse(integrator: Integrator) -> Stage {
    let mut stage = Stage::new(settings(53, 37, integrator, 4));
    let place = |x: f64, y: f64, z: f64| DAffine3::from_translation(DVec3::new(x, y, z));
    let floor = quad(Vec3::new(-3.0, -1.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0);
    stage.add_mesh(floor, Material::lambert(Vec3::splat(0.7)), DAffine3::IDENTITY);
    stage.add_mesh(ball(8), Material::lambert(Vec3::new(0.7, 0.3, 0.2)), place(-1.0, 0.0, 0.0));
    let turned =
        place(1.2, -0.2, 0.3) * DAffine3::from_rotation_y(0.7) * DAffine3::from_scale(DVec3::splat(0.6));
    stage.add_mesh(ball(4), Material::lambert(Vec3::new(0.2, 0.3, 0.7)), turned);
    for i in 0..2 {
        let radiance = [Vec3::splat(3.0 + i as f32); 4];
        let (edge_u, edge_v) = (Vec3::X * 0.7, Vec3::Z * 0.5);
        let lamp = Light::Parallelogram { edge_u, edge_v, radiance, two_sided: false };
        stage.add(lamp, place(f64::from(i) * 2.0 - 1.5, 2.0, 0.5));
    }
    stage.look_wide(DVec3::new(0.0, 1.5, 4.0), DVec3::ZERO);
    stage
}

fn budget(stage: &mut Stage, edit: impl FnOnce(&mut FrameBudget)) {
    edit(&mut stage.app.world.resource_mut::<FrameBudget>());
}

fn until_done(stage: &mut Stage, samples: u32) -> Film {
    budget(stage, |b| b.sample_target = samples);
    // By time: frames that are interrupted at once are over in no time, and the machine may be busy elsewhere.
    let start = std::time::Instant::now();
    while start.elapsed() < Duration::from_secs(60) {
        stage.app.frame();
        if stage.app.world.resource::<FrameStats>().done {
            return stage.film().clone();
        }
    }
    panic!("{} samples are never reached: {}", samples, stage.film().mean_samples());
}

fn reference() -> Film {
    stage().trace(64).clone()
}

#[test]
fn any_number_of_threads_makes_the_same_film() {
    let films = [1, 2, 8].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(reference)
    });
    assert!(films[0] == films[1] && films[0] == films[2]);
    assert!(films[0] == reference(), "and so does the next run");
}

#[test]
fn any_way_of_parting_the_samples_makes_the_same_film() {
    let reference = reference();
    for pass_samples in [1, 3, 32, 1000, u32::MAX] {
        let mut stage = stage();
        budget(&mut stage, |b| b.pass_samples = pass_samples);
        assert!(until_done(&mut stage, 64) == reference, "{pass_samples} at once");
    }
    let mut stage = stage();
    budget(&mut stage, |b| b.pass_samples = 16);
    until_done(&mut stage, 16);
    assert!(until_done(&mut stage, 64) == reference, "16, then 48 more");
}

#[test]
fn another_seed_and_another_sample_make_other_films() {
    let reference = reference();
    let mut stage = stage();
    stage.app.world.resource_mut::<penumbra::trace::RenderSettings>().seed = 1;
    assert!(until_done(&mut stage, 64) != reference);
    assert!(until_done(&mut stage, 33) != reference);
}

#[test]
fn passes_broken_off_anywhere_and_resumed_make_the_same_film() {
    let reference = reference();
    let mut stage = stage();
    // As short as a tile or two, so that frames end in the middle of passes.
    budget(&mut stage, |b| b.time = Some(Duration::from_micros(300)));
    let mut broken_off = 0;
    budget(&mut stage, |b| b.sample_target = 64);
    for i in 0..100_000 {
        // Now and then somebody has pressed a key: nothing at all is traced.
        let pressed = i % 7 == 3;
        stage.app.world.resource::<FrameBudget>().interrupt.store(pressed, Ordering::Relaxed);
        let before = stage.film().mean_samples();
        stage.app.frame();
        let film = stage.film();
        assert!(!pressed || film.mean_samples() == before);
        broken_off += u32::from(film.mean_samples() > f64::from(film.complete_samples()));
        if stage.app.world.resource::<FrameStats>().done {
            break;
        }
    }
    assert!(broken_off > 0, "no pass was broken off");
    assert!(*stage.film() == reference);
}

/// Tile by tile, for `interrupt` may be raised while a pass runs.
#[test]
fn a_key_pressed_in_the_middle_of_a_pass_changes_nothing() {
    let reference = reference();
    let mut stage = stage();
    let interrupt = stage.app.world.resource::<FrameBudget>().interrupt.clone();
    let stop = std::sync::atomic::AtomicBool::new(false);
    /// Ends the other thread also if this one fails: a scope waits for it.
    struct Stop<'a>(&'a std::sync::atomic::AtomicBool);
    impl Drop for Stop<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
        }
    }
    let film = std::thread::scope(|scope| {
        let _stop = Stop(&stop);
        scope.spawn(|| {
            while !stop.load(Ordering::Relaxed) {
                interrupt.fetch_xor(true, Ordering::Relaxed);
                std::thread::sleep(Duration::from_micros(50));
            }
            interrupt.store(false, Ordering::Relaxed);
        });
        until_done(&mut stage, 64)
    });
    assert!(film == reference);
}

#[test]
fn the_last_sample_indices_there_are_come_to_an_end() {
    let mut stage = stage();
    stage.app.world.insert_resource(Film::new(UVec2::new(53, 37), u32::MAX - 4));
    let film = until_done(&mut stage, 64);
    assert_eq!(film.complete_samples(), 4);
}

/// Which instructions a machine has is no part of the picture.
#[test]
fn all_instructions_make_the_same_picture() {
    let scenes: [(&str, fn() -> Stage); 3] = [
        ("everything", stage),
        ("direct", || diffuse(Integrator::Direct)),
        ("shared paths", || diffuse(Integrator::Path)),
    ];
    for (name, make) in scenes {
        let films = Isa::available().into_iter().map(|isa| {
            let mut stage = make();
            stage.app.world.insert_resource(Instructions(isa));
            budget(&mut stage, |b| b.adaptive = true);
            // Shares of samples have been found anew.
            (isa, until_done(&mut stage, RIPE + 4))
        });
        let films: Vec<_> = films.collect();
        for (isa, film) in &films[1..] {
            assert!(*film == films[0].1, "{name}: {} and {} differ", isa.name(), films[0].0.name());
        }
    }
}
