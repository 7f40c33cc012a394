//! Flights with old samples kept and without, and how far each picture is from the truth.

use glam::{DMat3, DVec3, UVec2, Vec3};
use penumbra::app::{App, FrameBudget, FrameStats};
use penumbra::image::compare::LinearImage;
use penumbra::load::{LoadOptions, SceneSource};
use penumbra::open::{Wishes, open};
use penumbra::preview::Preview;
use penumbra::scene::{ActiveCamera, Camera, GlobalTransform, Transform};
use penumbra::shown::Shown;
use penumbra::trace::Integrator;
use std::path::Path;
use std::time::{Duration, Instant};

/// A window's world without a window.
pub fn watched(scene: &str, integrator: Integrator, size: UVec2) -> App {
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
    // What is kept may not depend on what else the machine does.
    world.insert_resource(Preview::at_scale(8));
    // A camera of our own where that of the file is.
    let from = world.resource::<ActiveCamera>().0;
    let camera = *world.get::<Camera>(from).unwrap();
    let pose = *world.get::<GlobalTransform>(from).unwrap();
    let flown = world.spawn((camera, Transform(pose.0))).id();
    world.insert_resource(ActiveCamera(flown));
    app
}

/// Frames of one sample until each pixel has `samples`.
pub fn rest(app: &mut App, samples: u32) {
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
pub fn step(app: &mut App, way: f64, angle: f64) {
    let camera = app.world.resource::<ActiveCamera>().0;
    let radius = app.world.resource::<penumbra::scene::SceneBounds>().radius;
    let mut pose = app.world.get_mut::<Transform>(camera).unwrap();
    let axes = pose.0.matrix3;
    pose.0.translation += (axes.x_axis * 0.5 - axes.z_axis) * way * radius;
    pose.0.matrix3 = DMat3::from_axis_angle(DVec3::Y, angle) * axes;
}

/// One frame for a view that changes, with so much time for more than the preview.
pub fn moving(app: &mut App, time: Duration) -> Duration {
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

pub struct Flight {
    pub plain: f64,
    pub kept: f64,
    pub share: f64,
    pub milliseconds: f64,
}

/// Flies the same way twice, old samples kept or not. The picture without gets `more` time for new samples, of what
/// keeping took.
pub fn fly(
    scene: &str,
    integrator: Integrator,
    size: UVec2,
    preview: fn() -> Preview,
    more: fn(Duration) -> Duration,
) -> Flight {
    const STEPS: usize = 6;
    /// Samples of the reference.
    const TRUTH: u32 = 32;
    let mut plain = watched(scene, integrator, size);
    plain.world.resource_mut::<Shown>().only_film = true;
    let mut kept = watched(scene, integrator, size);
    for app in [&mut plain, &mut kept] {
        app.world.insert_resource(preview());
        rest(app, 32);
    }
    let mut sums = Flight { plain: 0.0, kept: 0.0, share: 0.0, milliseconds: 0.0 };
    let mut bare = Duration::ZERO;
    for i in 0..STEPS {
        for app in [&mut plain, &mut kept] {
            step(app, 0.012, 0.01);
        }
        let time = moving(&mut kept, Duration::ZERO);
        let start = Instant::now();
        moving(&mut plain, more(time.saturating_sub(bare)));
        if i == 0 {
            bare = start.elapsed().min(time);
        }
        let reference = LinearImage::of(&kept.probe(size, TRUTH));
        sums.plain += rmse(&plain.world.resource::<Shown>().image(), &reference).powi(2);
        sums.kept += rmse(&kept.world.resource::<Shown>().image(), &reference).powi(2);
        sums.share += kept.world.resource::<Shown>().kept_share(0, false);
        sums.milliseconds += time.as_secs_f64() * 1e3;
    }
    let n = STEPS as f64;
    Flight {
        plain: (sums.plain / n).sqrt(),
        kept: (sums.kept / n).sqrt(),
        share: sums.share / n,
        milliseconds: sums.milliseconds / n,
    }
}

/// What is flown through, with how much of the error of a whole new picture of one sample may be left at equal samples: 0.88,
/// 0.82, 0.55 and 0.70 were measured. (Neighbours share paths: a new picture of `path` is not much worse than old samples. Of the
/// kitchen it was 0.59 when its materials were read as Blinn-Phong and mirrors instead of what Blender meant.)
pub fn flights() -> Vec<(String, Integrator, f64)> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    let kitchen = shared.join("obj/kitchen/kitchen.obj");
    let mut flights = vec![
        ("cornell".into(), Integrator::Direct, 0.95),
        ("cornell".into(), Integrator::Path, 0.9),
        ("gallery".into(), Integrator::Direct, 0.7),
    ];
    if kitchen.is_file() {
        flights.push((kitchen.display().to_string(), Integrator::Direct, 0.8));
    } else {
        println!("SKIPPED the kitchen: the shared scenes are not here");
    }
    flights
}

/// The head of the table whose rows are [`row`]s.
pub const HEAD: &str =
    "| scene | light | RMSE as it was | with old samples | kept | ms a step |\n|---|---|---|---|---|---|";

pub fn row(scene: &str, integrator: Integrator, flight: &Flight) -> String {
    format!(
        "| {} | {} | {:.4} | {:.4} | {:.0} % | {:.1} |",
        Path::new(scene).file_stem().unwrap_or_default().to_string_lossy(),
        integrator.name(),
        flight.plain,
        flight.kept,
        flight.share * 100.0,
        flight.milliseconds
    )
}
