//! Old samples that are kept while one moves: nearer to the truth than new ones alone, never in the picture at rest,
//! and gone when light changes.

mod flight;

use bevy_ecs::prelude::*;
use flight::{HEAD, flights, fly, moving, rest, row, step, watched};
use glam::{UVec2, Vec3};
use penumbra::app::App;
use penumbra::image::Picture;
use penumbra::image::compare::LinearImage;
use penumbra::preview::Preview;
use penumbra::scene::{ActiveCamera, Glass, Glossy, Lens, Light, Material, SceneBounds, Transform};
use penumbra::shown::{FADE, Shown};
use penumbra::trace::{Integrator, RenderSettings};
use std::time::Duration;

#[test]
fn a_moving_picture_is_nearer_to_the_truth_with_old_samples() {
    println!("{HEAD}");
    for (scene, integrator, most) in flights() {
        // A slow machine would compare with coarse previews.
        let whole = || Preview::at_scale(1);
        let flight = fly(&scene, integrator, UVec2::new(480, 270), whole, |_| Duration::ZERO);
        println!("{}", row(&scene, integrator, &flight));
        assert!(flight.kept < most * flight.plain, "{scene}: {} is not below {}", flight.kept, flight.plain);
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
fn what_comes_into_view_gets_samples_of_its_own() {
    let mut app = watched("cornell", Integrator::Direct, SMALL);
    app.world.insert_resource(Preview::at_scale(16));
    // Between the walls.
    step(&mut app, 0.4, 0.0);
    rest(&mut app, 8);
    step(&mut app, 0.0, 0.1);
    moving(&mut app, Duration::ZERO);
    let truth = LinearImage::of(&app.probe(SMALL, 64));
    let shown = app.world.resource::<Shown>().image();
    let coarse = app.world.resource::<Preview>().film().unwrap();
    let (mut of_shown, mut of_preview) = (0.0, 0.0);
    // What was beyond the left border.
    for (x, y) in (0..SMALL.y).flat_map(|y| (0..6).map(move |x| (x, y))) {
        let at = (y * SMALL.x + x) as usize;
        let preview = coarse.pixel(x / 16, y / 16).mean().as_vec3();
        of_shown += (shown.pixels[at] - truth.pixels[at]).length_squared();
        of_preview += (preview - truth.pixels[at]).length_squared();
    }
    println!("squared error {of_shown:.2e}, of the preview alone {of_preview:.2e}");
    assert!(of_shown < 0.5 * of_preview);
}

/// To the right, by so many radii of what is seen.
fn step_aside(app: &mut App, way: f64) {
    let camera = app.world.resource::<ActiveCamera>().0;
    let radius = app.world.resource::<SceneBounds>().radius;
    let mut pose = app.world.get_mut::<Transform>(camera).unwrap();
    let aside = pose.0.matrix3.x_axis;
    pose.0.translation += aside * way * radius;
}

/// What shows two surfaces is of neither: carried along with one of them it would leave a trail of the other's colour.
#[test]
fn outlines_leave_no_trail() {
    let size = UVec2::new(480, 270);
    // As bright as it looks.
    let seen = |image: &LinearImage, x: u32, y: u32| {
        let color = image.pixels[(y * size.x + x) as usize];
        color.clamp(Vec3::ZERO, Vec3::ONE).map(f32::sqrt)
    };
    let plain = |image: &LinearImage, x: u32, y: u32| {
        let color = |x: u32, y: u32| seen(image, x, y);
        let here = color(x, y);
        let mut around = (y - 3..=y + 3).flat_map(|y| (x - 3..=x + 3).map(move |x| (x, y)));
        around.all(|(x, y)| (color(x, y) - here).abs().max_element() < 0.03)
    };
    for scale in [8, 1] {
        let mut app = watched("cornell", Integrator::Direct, size);
        app.world.resource_mut::<Shown>().never_smooth = true;
        app.world.insert_resource(Preview::at_scale(scale));
        rest(&mut app, 32);
        for _ in 0..8 {
            step_aside(&mut app, 0.02);
            moving(&mut app, Duration::ZERO);
        }
        let truth = LinearImage::of(&app.probe(size, 32));
        let shown = app.world.resource::<Shown>().image();
        let inside = (3..size.y - 3).flat_map(|y| (3..size.x - 3).map(move |x| (x, y)));
        let clear: Vec<(u32, u32)> = inside.filter(|&(x, y)| plain(&truth, x, y)).collect();
        let off = |x: u32, y: u32| (seen(&shown, x, y) - seen(&truth, x, y)).abs().max_element();
        let wrong = clear.iter().filter(|&&(x, y)| off(x, y) > 0.1);
        let share = wrong.count() as f64 / clear.len() as f64;
        println!(
            "previews of 1/{scale}: {:.3} % of {} pixels are of something else",
            100.0 * share,
            clear.len()
        );
        assert!(share < 1e-4, "{share}");
    }
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
