//! Old samples that are kept while one moves: nearer to the truth than what can be traced in the same time, never
//! in the picture at rest, and gone when light changes.

use bevy_ecs::prelude::*;
use glam::{DMat3, DVec3, UVec2, Vec3};
use penumbra::app::{App, FrameBudget, FrameStats};
use penumbra::image::Picture;
use penumbra::image::compare::LinearImage;
use penumbra::load::{LoadOptions, SceneSource};
use penumbra::open::{Wishes, open};
use penumbra::scene::{
    ActiveCamera, Camera, Glass, GlobalTransform, Glossy, Lens, Light, Material, Transform,
};
use penumbra::shown::{FADE, Shown};
use penumbra::trace::{Integrator, RenderSettings};
use std::path::Path;
use std::time::{Duration, Instant};

/// A window's world without a window.
fn watched(scene: &str, integrator: Integrator, size: UVec2) -> App {
    let wishes = Wishes { size: Some(size), integrator: Some(integrator), ..Wishes::default() };
    let source = SceneSource::parse(scene).unwrap();
    let mut app = open(&source, &LoadOptions::default(), &wishes).unwrap().app;
    let world = &mut app.world;
    world.insert_resource(FrameBudget {
        preview: true,
        develop: true,
        sample_target: 1024,
        ..FrameBudget::default()
    });
    // A camera of our own where that of the file is.
    let from = world.resource::<ActiveCamera>().0;
    let camera = *world.get::<Camera>(from).unwrap();
    let pose = *world.get::<GlobalTransform>(from).unwrap();
    let flown = world.spawn((camera, Transform(pose.0))).id();
    world.insert_resource(ActiveCamera(flown));
    app
}

/// Frames of one sample until each pixel has `samples`.
fn rest(app: &mut App, samples: u32) {
    app.world.resource_mut::<FrameBudget>().time = None;
    while app.world.resource::<FrameStats>().samples_per_pixel < f64::from(samples) {
        app.frame();
    }
    // What is behind the pixels is found out a bit at a time.
    app.world.resource_mut::<FrameBudget>().time = Some(Duration::ZERO);
    for _ in 0..20 {
        app.frame();
    }
}

/// Forward and to the right, turning to the left: by so many radii of what is seen, and radians.
fn step(app: &mut App, way: f64, angle: f64) {
    let camera = app.world.resource::<ActiveCamera>().0;
    let radius = app.world.resource::<penumbra::scene::SceneBounds>().radius;
    let mut pose = app.world.get_mut::<Transform>(camera).unwrap();
    let axes = pose.0.matrix3;
    pose.0.translation += (axes.x_axis * 0.5 - axes.z_axis) * way * radius;
    pose.0.matrix3 = DMat3::from_axis_angle(DVec3::Y, angle) * axes;
}

/// One frame for a view that changes, with so much time for more than the preview.
fn moving(app: &mut App, time: Duration) -> Duration {
    app.world.resource_mut::<FrameBudget>().time = Some(time);
    let start = Instant::now();
    app.frame();
    start.elapsed()
}

/// As far as a screen can show it.
fn rmse(a: &LinearImage, b: &LinearImage) -> f64 {
    let seen = |v: Vec3| v.clamp(Vec3::ZERO, Vec3::ONE);
    let squares =
        a.pixels.iter().zip(&b.pixels).map(|(&a, &b)| f64::from((seen(a) - seen(b)).length_squared()));
    (squares.sum::<f64>() / 3.0 / a.pixels.len() as f64).sqrt()
}

struct Flight {
    plain: f64,
    kept: f64,
    share: f64,
    milliseconds: f64,
}

/// Flies the same way twice, old samples kept or not, in the same time.
fn fly(scene: &str, integrator: Integrator, size: UVec2, steps: usize, truth: u32) -> Flight {
    let mut plain = watched(scene, integrator, size);
    plain.world.resource_mut::<Shown>().only_film = true;
    let mut kept = watched(scene, integrator, size);
    rest(&mut plain, 32);
    rest(&mut kept, 32);
    let mut sums = Flight { plain: 0.0, kept: 0.0, share: 0.0, milliseconds: 0.0 };
    let mut bare = Duration::ZERO;
    for i in 0..steps {
        for app in [&mut plain, &mut kept] {
            step(app, 0.012, 0.01);
        }
        let time = moving(&mut kept, Duration::ZERO);
        // What keeping takes is given to the other one for more samples.
        let start = Instant::now();
        moving(&mut plain, time.saturating_sub(bare));
        if i == 0 {
            bare = start.elapsed().min(time);
        }
        let reference = LinearImage::of(&kept.probe(size, truth));
        sums.plain += rmse(&plain.world.resource::<Shown>().image(), &reference).powi(2);
        sums.kept += rmse(&kept.world.resource::<Shown>().image(), &reference).powi(2);
        sums.share += kept.world.resource::<Shown>().kept_share(0, false);
        sums.milliseconds += time.as_secs_f64() * 1e3;
    }
    let n = steps as f64;
    Flight {
        plain: (sums.plain / n).sqrt(),
        kept: (sums.kept / n).sqrt(),
        share: sums.share / n,
        milliseconds: sums.milliseconds / n,
    }
}

#[test]
fn a_moving_picture_is_nearer_to_the_truth_with_old_samples() {
    let size = UVec2::new(960, 540);
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    let kitchen = shared.join("obj/kitchen/kitchen.obj").display().to_string();
    let mut flights = vec![
        ("cornell", Integrator::Direct, 0.95),
        ("cornell", Integrator::Path, 0.7),
        ("gallery", Integrator::Direct, 0.7),
    ];
    if Path::new(&kitchen).is_file() {
        flights.push((kitchen.as_str(), Integrator::Direct, 0.7));
    } else {
        println!("SKIPPED the kitchen: the shared scenes are not here");
    }
    println!(
        "| scene | light | RMSE as it was | with old samples | kept | ms a step |\n|---|---|---|---|---|---|"
    );
    for (scene, integrator, most) in flights {
        let flight = fly(scene, integrator, size, 6, 32);
        let name = Path::new(scene).file_stem().unwrap().to_string_lossy();
        println!(
            "| {name} | {} | {:.4} | {:.4} | {:.0} % | {:.1} |",
            integrator.name(),
            flight.plain,
            flight.kept,
            flight.share * 100.0,
            flight.milliseconds
        );
        assert!(flight.kept < most * flight.plain, "{name}: {} is not below {}", flight.kept, flight.plain);
    }
}

const SMALL: UVec2 = UVec2::new(96, 64);

fn share(app: &App) -> f64 {
    app.world.resource::<Shown>().kept_share(0, false)
}

/// At rest, then a small step.
fn stepped() -> App {
    let mut app = watched("cornell", Integrator::Direct, SMALL);
    rest(&mut app, 8);
    step(&mut app, 0.01, 0.01);
    moving(&mut app, Duration::ZERO);
    app
}

#[test]
fn a_small_step_keeps_most_and_a_change_of_light_keeps_nothing() {
    let mut app = stepped();
    assert!(share(&app) > 0.8, "{}", share(&app));
    let mut changed = 0;
    for mut light in app.world.query::<&mut Light>().iter_mut(&mut app.world) {
        if let Light::Parallelogram { radiance, .. } = &mut *light {
            *radiance = radiance.map(|r| r * 0.5);
            changed += 1;
        }
    }
    assert!(changed > 0);
    moving(&mut app, Duration::ZERO);
    assert_eq!(share(&app), 0.0, "old light is shown");
    // Also when the camera moves in the same frame.
    let mut app = stepped();
    for mut light in app.world.query::<&mut Light>().iter_mut(&mut app.world) {
        light.set_changed();
    }
    step(&mut app, 0.01, 0.01);
    moving(&mut app, Duration::ZERO);
    assert_eq!(share(&app), 0.0);
    // And the next step has the new light.
    rest(&mut app, 8);
    step(&mut app, 0.01, 0.01);
    moving(&mut app, Duration::ZERO);
    assert!(share(&app) > 0.8);
}

#[test]
fn settings_a_lens_and_another_size_keep_nothing() {
    let mut app = stepped();
    app.world.resource_mut::<RenderSettings>().integrator = Integrator::Path;
    moving(&mut app, Duration::ZERO);
    assert_eq!(share(&app), 0.0);
    let mut app = stepped();
    app.world.resource_mut::<RenderSettings>().size = SMALL + 8;
    moving(&mut app, Duration::ZERO);
    assert_eq!(share(&app), 0.0);
    let mut app = stepped();
    let camera = app.world.resource::<ActiveCamera>().0;
    app.world.entity_mut(camera).insert(Lens { radius: 0.1, focus: 3.0 });
    moving(&mut app, Duration::ZERO);
    assert_eq!(share(&app), 0.0);
}

#[test]
fn at_rest_the_picture_is_the_films_to_the_bit() {
    let mut kept = stepped();
    let mut plain = watched("cornell", Integrator::Direct, SMALL);
    plain.world.resource_mut::<Shown>().only_film = true;
    // A fast machine is done in the first second, while pictures are smoothed.
    kept.world.resource_mut::<Shown>().never_smooth = true;
    plain.world.resource_mut::<Shown>().never_smooth = true;
    step(&mut plain, 0.01, 0.01);
    moving(&mut plain, Duration::ZERO);
    rest(&mut kept, 4);
    rest(&mut plain, 4);
    let bytes = |app: &App| app.world.resource::<Picture>().rgba.clone();
    assert!(bytes(&kept) != bytes(&plain), "few samples: the old ones are seen");
    rest(&mut kept, FADE);
    rest(&mut plain, FADE);
    assert!(bytes(&kept) == bytes(&plain));
    // And the film never knew of them.
    let film = |app: &App| app.world.resource::<penumbra::trace::Film>().clone();
    assert!(LinearImage::of(&film(&kept)) == LinearImage::of(&film(&plain)));
}

#[test]
fn mirrors_keep_nothing_of_what_they_reflect() {
    let kept = |material: Material| {
        let mut app = watched("cornell", Integrator::Direct, SMALL);
        for mut old in app.world.query::<&mut Material>().iter_mut(&mut app.world) {
            *old = material.clone();
        }
        rest(&mut app, 4);
        step(&mut app, 0.01, 0.01);
        moving(&mut app, Duration::ZERO);
        share(&app)
    };
    let matt = kept(Material::lambert(Vec3::splat(0.7)));
    let rough = Glossy::Ggx { metallic: 1.0, roughness: 0.8, texture: None };
    let shiny = Glossy::Ggx { metallic: 0.0, roughness: 0.1, texture: None };
    // The lamp and what is beyond the box look the same from everywhere.
    let rest = kept(Material::perfect_mirror(Vec3::splat(0.9)));
    assert!(rest < matt - 0.4, "{rest} {matt}");
    assert!((kept(Material { glossy: shiny, ..Material::default() }) - rest).abs() < 0.05);
    let glass = Some(Glass { ior: 1.5, tint: Vec3::ONE });
    assert!((kept(Material { glass, ..Material::default() }) - rest).abs() < 0.05);
    assert!((kept(Material { glossy: rough, ..Material::default() }) - matt).abs() < 0.05);
}
