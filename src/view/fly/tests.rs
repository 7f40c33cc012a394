//! Flying, and what other keys do to the camera.

use super::super::bookmarks::{Bookmarks, recall, remember};
use super::super::cameras::{FileCameras, change_lens, change_projection, choose_camera, choose_side};
use super::super::input::{Command, Press};
use super::super::keymap::Side;
use super::super::orbit::{focus, orbit_camera};
use super::*;
use crate::app::FrameSystems;
use crate::load::{LoadOptions, SceneSource};
use crate::open::{Wishes, open};
use crate::scene::SceneBounds;
use crate::trace::RenderSettings;
use glam::UVec2;
use std::time::{Duration, Instant};

fn world() -> (World, Schedule) {
    let mut world = World::new();
    let pose = Transform::looking_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.0, 2.0, -5.0), DVec3::Y);
    let camera = world.spawn((Camera::default(), pose, GlobalTransform(pose.0), Name::new("a"))).id();
    world.insert_resource(ActiveCamera(camera));
    world.insert_resource(FileCameras { home: camera, last: camera });
    world.insert_resource(FlySpeed(2.0));
    world.insert_resource(Navigation { orbiting: false, pivot: DVec3::ZERO, vertical_fov: 1.0 });
    world.insert_resource(SceneBounds { center: DVec3::ONE, radius: 2.0 });
    world.init_resource::<Bookmarks>();
    world.init_resource::<Notices>();
    world.init_resource::<RenderSettings>();
    let mut schedule = Schedule::default();
    schedule.add_systems(
        (
            choose_camera,
            take_off,
            recall,
            choose_side,
            change_projection,
            change_lens,
            look_around,
            change_speed,
            fly_camera,
            orbit_camera,
            crate::scene::propagate_transforms,
            remember,
        )
            .chain(),
    );
    (world, schedule)
}

fn down(keys: &[Hold]) -> [bool; Hold::COUNT] {
    let mut held = [false; Hold::COUNT];
    for &key in keys {
        held[key as usize] = true;
    }
    held
}

/// Holds `keys` for `duration`, in frames of `frame`. Returns where the active camera is then.
fn fly(keys: &[Hold], duration: Duration, frame: Duration) -> GlobalTransform {
    let (mut world, mut schedule) = world();
    let start = Instant::now();
    let mut input = Input::new(start);
    input.apply(&Command::Held { held: down(keys), at: start });
    world.insert_resource(input);
    let mut now = start;
    while now < start + duration {
        now += frame;
        world.resource_mut::<Input>().hold_until(now);
        schedule.run(&mut world);
        world.resource_mut::<Input>().end_frame();
    }
    *world.get(world.resource::<ActiveCamera>().0).unwrap()
}

#[test]
fn motion_does_not_depend_on_the_frame_rate() {
    let second = Duration::from_secs(1);
    for keys in [&[Hold::Forward][..], &[Hold::Left, Hold::Up, Hold::Fast], &[Hold::LookLeft, Hold::LookUp]] {
        let coarse = fly(keys, second, Duration::from_millis(100));
        let fine = fly(keys, second, Duration::from_millis(1));
        assert!(coarse.0.abs_diff_eq(fine.0, 1e-9), "{keys:?}: {coarse:?} {fine:?}");
    }
}

#[test]
fn forward_goes_where_the_camera_looks_at_the_base_speed() {
    let pose = fly(&[Hold::Forward], Duration::from_secs(1), Duration::from_millis(50));
    let direction = DVec3::new(-1.0, 0.0, -8.0).normalize();
    assert!((pose.0.translation - (DVec3::new(1.0, 2.0, 3.0) + 2.0 * direction)).length() < 1e-9);
    let up = fly(&[Hold::Up, Hold::Slow], Duration::from_secs(1), Duration::from_millis(50));
    assert!((up.0.translation - DVec3::new(1.0, 2.5, 3.0)).length() < 1e-9);
}

#[test]
fn silence_changes_nothing() {
    let (mut world, mut schedule) = world();
    let start = Instant::now();
    let mut input = Input::new(start);
    input.apply(&Command::Held { held: down(&[Hold::Forward]), at: start });
    world.insert_resource(input);
    let mut frame = |world: &mut World, ms: u64| {
        world.clear_trackers();
        world.resource_mut::<Input>().hold_until(start + Duration::from_millis(ms));
        schedule.run(world);
        let mut changed = world.query_filtered::<(), Or<(Changed<Transform>, Changed<GlobalTransform>)>>();
        let any = changed.iter(world).next().is_some();
        let resources =
            world.is_resource_changed::<ActiveCamera>() || world.is_resource_changed::<FlySpeed>();
        world.resource_mut::<Input>().end_frame();
        any || resources
    };
    assert!(frame(&mut world, 20));
    let input = &mut *world.resource_mut::<Input>();
    input.apply(&Command::Held { held: down(&[]), at: start + Duration::from_millis(20) });
    for ms in [40, 60, 80] {
        assert!(!frame(&mut world, ms), "changed at {ms} ms");
    }
}

#[test]
fn the_first_motion_leaves_the_camera_of_the_file_alone_and_enter_returns_to_it() {
    let (mut world, mut schedule) = world();
    let home = world.resource::<ActiveCamera>().0;
    let pose = *world.get::<Transform>(home).unwrap();
    let mut input = Input::new(Instant::now());
    input.dragged[Drag::Look as usize] = DVec2::new(10.0, 0.0);
    world.insert_resource(input);
    schedule.run(&mut world);
    assert_ne!(world.resource::<ActiveCamera>().0, home);
    assert_eq!(*world.get::<Transform>(home).unwrap(), pose);
    world.resource_mut::<Input>().end_frame();
    world.resource_mut::<Input>().taps.push(Tap::ResetCamera.into());
    schedule.run(&mut world);
    assert_eq!(world.resource::<ActiveCamera>().0, home);
}

#[test]
fn brackets_go_round_the_cameras_of_the_file_in_their_order() {
    let (mut world, mut schedule) = world();
    let first = world.resource::<ActiveCamera>().0;
    let second = world.spawn((Camera::default(), Name::new("b"))).id();
    let third = world.spawn((Camera::default(), Name::new("c"))).id();
    let mut step = |tap: Tap| {
        let mut input = Input::new(Instant::now());
        input.taps.push(tap.into());
        world.insert_resource(input);
        schedule.run(&mut world);
        world.resource::<ActiveCamera>().0
    };
    let next = [first; 3].map(|_| step(Tap::NextCamera));
    assert_eq!(next, [second, third, first]);
    assert_eq!(step(Tap::PreviousCamera), third);
}

#[test]
fn yaw_and_pitch_give_the_orientation_back_even_straight_down() {
    for (yaw, pitch) in [(0.3, -0.2), (3.0, 1.5), (5.0, -FRAC_PI_2), (1.0, FRAC_PI_2)] {
        let axes = FlyCameraState { yaw, pitch }.world_from_camera();
        let again = FlyCameraState::of(axes).world_from_camera();
        assert!(axes.abs_diff_eq(again, 1e-6), "{yaw} {pitch}");
    }
}

/// The active camera after these presses, one frame each.
fn press(world: &mut World, schedule: &mut Schedule, taps: &[Tap]) -> (Camera, GlobalTransform) {
    for &tap in taps {
        world.resource_mut::<Input>().taps.push(Press::from(tap));
        schedule.run(world);
        world.resource_mut::<Input>().end_frame();
    }
    let active = world.resource::<ActiveCamera>().0;
    (*world.get(active).unwrap(), *world.get(active).unwrap())
}

fn at_rest() -> (World, Schedule) {
    let (mut world, schedule) = world();
    world.insert_resource(Input::new(Instant::now()));
    (world, schedule)
}

#[test]
fn sides_look_at_the_pivot_from_as_far_as_before() {
    let (mut world, mut schedule) = at_rest();
    let distance = DVec3::new(1.0, 2.0, 3.0).length();
    for (side, from) in [
        (Side::Front, DVec3::Z),
        (Side::Back, DVec3::NEG_Z),
        (Side::Right, DVec3::X),
        (Side::Left, DVec3::NEG_X),
        (Side::Top, DVec3::Y),
        (Side::Bottom, DVec3::NEG_Y),
    ] {
        let (_, pose) = press(&mut world, &mut schedule, &[Tap::View(side)]);
        assert!(pose.0.translation.abs_diff_eq(from * distance, 1e-9), "{side:?} {pose:?}");
        assert!(pose.0.matrix3.z_axis.abs_diff_eq(from, 1e-9), "{side:?} {pose:?}");
    }
}

#[test]
fn the_whole_scene_fits_and_parallel_rays_show_the_pivot_as_large() {
    let (mut world, mut schedule) = at_rest();
    let (camera, pose) = press(&mut world, &mut schedule, &[Tap::FrameAll]);
    let Projection::Perspective { vertical_fov } = camera.projection else { panic!() };
    let distance = (pose.0.translation - DVec3::ONE).length();
    assert!((distance * (0.5 * f64::from(vertical_fov)).sin() - 2.0).abs() < 1e-6);
    let (camera, _) = press(&mut world, &mut schedule, &[Tap::Orthographic]);
    let Projection::Orthographic { height } = camera.projection else { panic!() };
    let wanted = 2.0 * distance * (0.5 * f64::from(vertical_fov)).tan();
    assert!((f64::from(height) / wanted - 1.0).abs() < 1e-6);
    let (camera, again) = press(&mut world, &mut schedule, &[Tap::Orthographic]);
    assert_eq!(camera.projection, Projection::Perspective { vertical_fov });
    assert!(pose.0.abs_diff_eq(again.0, 1e-5), "{pose:?} {again:?}");
}

#[test]
fn bookmarks_bring_camera_lens_and_pivot_back() {
    let (mut world, mut schedule) = at_rest();
    let before = press(&mut world, &mut schedule, &[Tap::FrameAll, Tap::OpenLens, Tap::Remember(3)]);
    let lens = |world: &World| world.get::<Lens>(world.resource::<ActiveCamera>().0).copied();
    let sharp = lens(&world).unwrap();
    let pivot = world.resource::<Navigation>().pivot;
    let away = [Tap::CloseLens, Tap::View(Side::Top), Tap::Orthographic];
    assert_ne!(press(&mut world, &mut schedule, &away), before);
    assert_eq!(lens(&world), None);
    world.resource_mut::<Navigation>().pivot = DVec3::ZERO;
    let after = press(&mut world, &mut schedule, &[Tap::Recall(3)]);
    assert_eq!((after, lens(&world)), (before, Some(sharp)));
    assert_eq!(world.resource::<Navigation>().pivot, pivot);
}

#[test]
fn orbiting_keeps_the_distance_and_a_whole_turn_drifts_nowhere() {
    let (mut world, mut schedule) = at_rest();
    let start = press(&mut world, &mut schedule, &[Tap::View(Side::Front)]).1;
    let pixels = std::f64::consts::TAU / (2.0 * FlyCamera::default().mouse_turn) / 1000.0;
    for _ in 0..1000 {
        world.resource_mut::<Input>().dragged[Drag::Orbit as usize] = DVec2::new(pixels, 0.0);
        let pose = press(&mut world, &mut schedule, &[Tap::Navigation]).1;
        let distance = pose.0.translation.length();
        assert!((distance - start.0.translation.length()).abs() < 1e-9, "{distance}");
    }
    let end = press(&mut world, &mut schedule, &[]).1;
    assert!(end.0.abs_diff_eq(start.0, 1e-9), "{start:?} {end:?}");
}

#[test]
fn focusing_makes_the_file_s_own_lens_sharp_there_and_without_a_lens_nobody_takes_off() {
    for lens in [None, Some(Lens { radius: 0.1, focus: 50.0 })] {
        let source = SceneSource::parse("cornell").unwrap();
        let wishes = Wishes { size: Some(UVec2::new(32, 24)), ..Wishes::default() };
        let mut app = open(&source, &LoadOptions::default(), &wishes).unwrap().app;
        let home = app.world.resource::<ActiveCamera>().0;
        if let Some(lens) = lens {
            app.world.entity_mut(home).insert(lens);
        }
        app.world.insert_resource(Navigation { orbiting: false, pivot: DVec3::ZERO, vertical_fov: 1.0 });
        app.world.init_resource::<Notices>();
        app.world.insert_resource(Input::new(Instant::now()));
        app.add_systems((take_off, focus).chain().in_set(FrameSystems::Input));
        app.frame();
        app.world.resource_mut::<Input>().taps.push(Tap::Focus.into());
        app.frame();
        let active = app.world.resource::<ActiveCamera>().0;
        let focus = app.world.get::<Lens>(active).map(|lens| lens.focus);
        assert_eq!(active == home, lens.is_none());
        assert_eq!(focus.is_some_and(|focus| focus != 50.0), lens.is_some(), "{focus:?}");
        assert_eq!(app.world.get::<Lens>(home).copied(), lens, "the file's camera is left alone");
    }
}

#[test]
fn a_change_of_the_speed_is_told() {
    let (mut world, mut schedule) = at_rest();
    press(&mut world, &mut schedule, &[Tap::Faster, Tap::OpenLens]);
    let notices = &world.resource::<Notices>().0;
    assert_eq!(notices.first(), Some(&Notice::Text("speed: 3.00 / s".to_owned())));
    assert_eq!(notices.len(), 2, "and silence where it stays: {notices:?}");
}
