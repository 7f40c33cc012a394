//! The rules of change: what is redone, what resets the film, and what does not; and what a frame comes to.

mod redone;
mod stage;

use bevy_ecs::schedule::{LogLevel, ScheduleBuildSettings};
use glam::{DVec3, UVec2, Vec3};
use penumbra::app::{App, Frame, FrameBudget, FrameStats};
use penumbra::image::Picture;
use penumbra::scene::{Light, Material, Transform};
use penumbra::trace::explain::{Kind, explain};
use penumbra::trace::{Film, RenderSettings};
use stage::{SIZE, Stage, stage};

#[test]
fn a_despawned_entity_disappears_from_the_picture() {
    let mut stage = Stage::settled();
    let group = stage.group;
    // With its children.
    assert!(stage.app.world.despawn(group));
    stage.app.frame();
    let mut fresh = self::stage();
    let group = fresh.group;
    assert!(fresh.app.world.despawn(group));
    fresh.app.frame();
    assert_eq!(stage.film(), fresh.film());
    assert_ne!(stage.film(), { self::stage() }.one_frame().film());
}

#[test]
fn a_picture_after_edits_equals_that_of_a_fresh_world() {
    let mut edited = Stage::settled();
    let (lamp, floor, material, floating) = (edited.lamp, edited.floor, edited.material, edited.floating);
    let edit = |s: &mut Stage| {
        s.get_mut::<Transform>(lamp).0.translation = DVec3::new(0.5, 2.0, 0.1);
        s.get_mut::<Transform>(floor).0.translation.y = -0.25;
        s.get_mut::<Material>(material).base_color = Vec3::new(0.2, 0.5, 0.7);
        assert!(s.app.world.despawn(floating));
    };
    edit(&mut edited);
    edited.app.frame();
    let mut fresh = stage();
    edit(&mut fresh);
    assert_eq!(edited.film(), fresh.one_frame().film());
}

#[test]
fn no_two_systems_race() {
    let mut stage = stage();
    stage.app.world.schedule_scope(Frame, |world, schedule| {
        schedule.set_build_settings(ScheduleBuildSettings {
            ambiguity_detection: LogLevel::Error,
            ..ScheduleBuildSettings::default()
        });
        schedule.initialize(world).unwrap();
    });
}

#[test]
fn the_target_ends_the_work_and_a_higher_one_continues_it() {
    let mut stage = stage();
    stage.app.world.resource_mut::<FrameBudget>().sample_target = 3;
    for _ in 0..5 {
        stage.app.frame();
    }
    assert_eq!(stage.film().complete_samples(), 3);
    assert!(stage.app.world.resource::<FrameStats>().done);
    stage.app.world.resource_mut::<FrameBudget>().sample_target = 4;
    stage.app.frame();
    assert_eq!(stage.film().complete_samples(), 4);
}

#[test]
fn a_watched_frame_shows_a_whole_picture_even_if_interrupted_at_once() {
    let mut stage = stage();
    {
        let mut budget = stage.app.world.resource_mut::<FrameBudget>();
        budget.preview = true;
        budget.develop = true;
        budget.time = Some(std::time::Duration::ZERO);
        budget.interrupt.store(true, std::sync::atomic::Ordering::Relaxed);
    }
    stage.app.frame();
    let picture = stage.app.world.resource::<Picture>();
    assert_eq!((picture.size, picture.version), (SIZE, 1));
    let lit = picture.rgba.chunks_exact(4).filter(|p| p[0] > 30).count();
    assert!(lit > 200, "the floor is in the picture: {lit} lit pixels");
    stage.app.frame();
    assert_eq!(stage.app.world.resource::<Picture>().version, 1, "nothing new, nothing developed");
}

#[test]
fn empty_worlds_and_dark_scenes_are_pictures_too() {
    let mut empty = App::new(RenderSettings { size: UVec2::ONE, ..RenderSettings::default() });
    empty.frame();
    assert_eq!(empty.world.resource::<Film>().pixel(0, 0).mean(), DVec3::ZERO);
    let mut stage = stage();
    let lamp = stage.lamp;
    assert!(stage.app.world.despawn(lamp));
    stage.app.frame();
    assert_eq!(stage.film().pixel(20, 15).mean(), DVec3::ZERO);
}

#[test]
fn an_explanation_adds_up_to_the_picture() {
    let mut stage = stage();
    stage
        .app
        .world
        .spawn((Light::Point { intensity: Vec3::ONE }, Transform::from_translation(DVec3::Y * 2.0)));
    {
        let mut budget = stage.app.world.resource_mut::<FrameBudget>();
        (budget.sample_target, budget.pass_samples) = (64, 64);
    }
    stage.app.frame();
    let scene = penumbra::sync::traceable(&stage.app.world);
    let (mut lit, mut blocked) = (0, 0);
    let (mut told_sum, mut film_sum, mut variance) = (0.0, 0.0, 0.0);
    for (x, y) in (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| (x, y))) {
        let told = explain(&scene, UVec2::new(x, y), 0..64, 10.0);
        assert_eq!(told.radiance.len(), 64);
        let reds: Vec<f64> = told.radiance.iter().map(|r| f64::from(r.x)).collect();
        let mean = reds.iter().sum::<f64>() / 64.0;
        variance += reds.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / 64.0 / 63.0;
        told_sum += mean;
        film_sum += stage.film().pixel(x, y).mean().x;
        let brought: f32 = told.lights.iter().map(|row| row.contribution).sum();
        let all = told.radiance.iter().map(|&r| penumbra::scene::color::luminance(r)).sum::<f32>() / 64.0;
        assert!((brought - all).abs() <= 1e-4 * all, "{x} {y}: {brought} of {all}");
        for row in &told.lights {
            assert!(row.lit + row.dark <= row.samples, "{row:?}");
            assert!(row.lit == 0 || row.contribution > 0.0, "{row:?}");
        }
        let count = |kind| told.segments.iter().filter(|s| s.kind == kind).count();
        assert_eq!(count(Kind::Camera), 64);
        assert_eq!(count(Kind::Lit), told.lights.iter().map(|row| row.lit as usize).sum::<usize>());
        (lit, blocked) = (lit + count(Kind::Lit), blocked + count(Kind::Shadow));
    }
    assert!(lit > 1000 && blocked > 30, "the quad throws a shadow: {lit} {blocked}");
    // No lamp is in view, so all light is that of the samples. The film's share of the noise is smaller still.
    let off = (told_sum - film_sum).abs() / (2.0 * variance).sqrt();
    assert!(off < 4.0, "{told_sum} told, {film_sum} in the film: {off} standard errors");
}
