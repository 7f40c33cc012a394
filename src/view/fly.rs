//! The camera that flies, and the choice among the file's cameras.
//!
//! Cameras of the file are never touched: the first motion spawns a free camera where the active one
//! is. So a camera may hang anywhere in a hierarchy, and Enter finds it as the file has it.

use super::input::Input;
use super::keymap::{Hold, Tap};
use crate::scene::{ActiveCamera, Camera, GlobalTransform, Projection, Transform};
use bevy_ecs::prelude::*;
use glam::{DMat3, DQuat, DVec2, DVec3, EulerRot};
use std::f64::consts::FRAC_PI_2;

/// Settings of a camera that the user flies. Its state is [`FlyCameraState`].
#[derive(Component, Clone, Copy, Debug, PartialEq)]
#[require(Transform, FlyCameraState)]
pub struct FlyCamera {
    /// Turning by keys, rad/s.
    pub turn_speed: f64,
    /// Turning by the mouse, rad/pixel.
    pub mouse_turn: f64,
    /// Factor of the speed while [`Hold::Fast`].
    pub fast: f64,
    /// Factor of the speed while [`Hold::Slow`].
    pub slow: f64,
}

impl Default for FlyCamera {
    fn default() -> Self {
        Self { turn_speed: 1.2, mouse_turn: 0.0025, fast: 4.0, slow: 0.25 }
    }
}

/// Where a [`FlyCamera`] looks.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
pub struct FlyCameraState {
    /// Turn to the left about the world's +Y, radians; 0 looks along −Z.
    pub yaw: f64,
    /// Turn upwards, radians in −π/2..=π/2.
    pub pitch: f64,
}

/// Speed of flying without Shift and Alt, scene units per second.
#[derive(Resource, Clone, Copy, Debug, PartialEq)]
pub struct FlySpeed(pub f64);

/// Which cameras of the file were looked through.
#[derive(Resource, Clone, Copy, Debug, PartialEq)]
pub struct FileCameras {
    /// The one that the window opened with.
    pub home: Entity,
    /// The last one.
    pub last: Entity,
}

impl FlyCameraState {
    /// The yaw and pitch of an orientation; its roll is left out.
    #[must_use]
    pub fn of(world_from_camera: DMat3) -> Self {
        let forward = -world_from_camera.z_axis.normalize_or(DVec3::Z);
        let pitch = forward.y.clamp(-1.0, 1.0).asin();
        // Straight up or down the line of sight has no heading, but the top of the picture has.
        let heading = if forward.y.abs() < 0.999_999 {
            forward
        } else {
            -forward.y.signum() * world_from_camera.y_axis
        };
        Self { yaw: (-heading.x).atan2(-heading.z), pitch }
    }

    /// The orientation, without roll.
    #[must_use]
    pub fn world_from_camera(self) -> DMat3 {
        DMat3::from_quat(DQuat::from_euler(EulerRot::YXZ, self.yaw, self.pitch, 0.0))
    }

    /// Turned to the right by `angles.x` and down by `angles.y`, radians.
    #[must_use]
    pub fn turned(self, angles: DVec2) -> Self {
        let yaw = (self.yaw - angles.x).rem_euclid(std::f64::consts::TAU);
        Self { yaw, pitch: (self.pitch - angles.y).clamp(-FRAC_PI_2, FRAC_PI_2) }
    }
}

/// Shows the file's next or previous camera, or the first one again.
pub fn choose_camera(
    input: Res<Input>,
    cameras: Query<Entity, (With<Camera>, With<Name>, Without<FlyCamera>)>,
    mut seen: ResMut<FileCameras>,
    mut active: ResMut<ActiveCamera>,
) {
    let mut camera = input.count(Tap::ResetCamera).gt(&0).then_some(seen.home);
    let steps = input.count(Tap::NextCamera) as i64 - input.count(Tap::PreviousCamera) as i64;
    if steps != 0 {
        let mut cameras: Vec<Entity> = cameras.iter().collect();
        cameras.sort_by_key(|camera| camera.index_u32());
        let here =
            cameras.iter().position(|&c| c == seen.last).map_or(if steps > 0 { -1 } else { 0 }, |i| i as i64);
        let there = (here + steps).checked_rem_euclid(cameras.len() as i64);
        camera = there.and_then(|there| cameras.get(there as usize).copied()).or(camera);
    }
    if let Some(camera) = camera {
        seen.last = camera;
        active.set_if_neq(ActiveCamera(camera));
    }
}

/// Before the first motion: puts the free camera where the active one is, and looks through it.
pub fn take_off(
    input: Res<Input>,
    mut active: ResMut<ActiveCamera>,
    cameras: Query<(&Camera, &GlobalTransform)>,
    free: Query<Entity, With<FlyCamera>>,
    mut commands: Commands,
) {
    if !input.has_motion() || free.contains(active.0) {
        return;
    }
    let Ok((camera, pose)) = cameras.get(active.0) else {
        return;
    };
    let state = FlyCameraState::of(pose.0.matrix3);
    let bundle = (*camera, Transform(pose.0), *pose, state);
    let entity = match free.iter().next() {
        Some(entity) => commands.entity(entity).insert(bundle).id(),
        None => commands.spawn((FlyCamera::default(), bundle)).id(),
    };
    active.0 = entity;
}

/// Turns the free camera.
pub fn look_around(input: Res<Input>, mut cameras: Query<(&FlyCamera, &mut FlyCameraState, &mut Transform)>) {
    let keys =
        DVec2::new(input.axis(Hold::LookRight, Hold::LookLeft), input.axis(Hold::LookDown, Hold::LookUp));
    for (settings, mut state, mut transform) in &mut cameras {
        let angles = keys * settings.turn_speed + input.look * settings.mouse_turn;
        // The roll of a file's camera is kept until the user looks around.
        if angles != DVec2::ZERO && state.set_if_neq(state.turned(angles)) {
            let mut turned = *transform;
            turned.0.matrix3 = state.world_from_camera();
            transform.set_if_neq(turned);
        }
    }
}

/// Moves the free camera: along its line of sight and to its sides, up and down along the world's axis.
pub fn fly_camera(input: Res<Input>, speed: Res<FlySpeed>, mut cameras: Query<(&FlyCamera, &mut Transform)>) {
    let right = input.axis(Hold::Right, Hold::Left);
    let up = input.axis(Hold::Up, Hold::Down);
    let back = input.axis(Hold::Back, Hold::Forward);
    for (settings, mut transform) in &mut cameras {
        let axes = transform.0.matrix3;
        let seconds =
            axes.x_axis.normalize_or_zero() * right + DVec3::Y * up + axes.z_axis.normalize_or_zero() * back;
        let fast = if input.is_held(Hold::Fast) { settings.fast } else { 1.0 };
        let slow = if input.is_held(Hold::Slow) { settings.slow } else { 1.0 };
        let mut moved = *transform;
        moved.0.translation += seconds * speed.0 * fast * slow;
        transform.set_if_neq(moved);
    }
}

/// Changes the base speed: ×1.1 per notch of the wheel, ×1.5 per key press.
pub fn change_speed(input: Res<Input>, mut speed: ResMut<FlySpeed>) {
    let presses = input.count(Tap::Faster) as f64 - input.count(Tap::Slower) as f64;
    let factor = 1.1_f64.powf(input.wheel) * 1.5_f64.powf(presses);
    speed.set_if_neq(FlySpeed((speed.0 * factor).clamp(1e-12, 1e12)));
}

/// The command line flags that look through `camera` at `pose`.
#[must_use]
pub fn camera_flags(camera: Camera, pose: GlobalTransform) -> String {
    let eye = pose.0.translation;
    let axes = pose.0.matrix3;
    let flags = format!(
        "--camera-position {} --camera-focal-point {} --camera-view-up {}",
        list(eye),
        list(eye - axes.z_axis.normalize_or(DVec3::Z)),
        list(axes.y_axis.normalize_or(DVec3::Y)),
    );
    match camera.projection {
        Projection::Perspective { vertical_fov } => {
            let degrees = vertical_fov.to_degrees();
            if degrees.to_radians() == vertical_fov {
                format!("{flags} --camera-view-angle {degrees}")
            } else {
                format!("{flags} --camera-view-angle {}", f64::from(vertical_fov).to_degrees())
            }
        }
        Projection::Orthographic { .. } => flags,
    }
}

/// Exact: the shortest text that gives the same numbers again.
fn list(v: DVec3) -> String {
    // Adding 0 turns −0 into 0.
    let v = v + DVec3::ZERO;
    format!("{},{},{}", v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::super::input::Command;
    use super::*;
    use std::time::{Duration, Instant};

    fn world() -> (World, Schedule) {
        let mut world = World::new();
        let pose = Transform::looking_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.0, 2.0, -5.0), DVec3::Y);
        let camera = world.spawn((Camera::default(), pose, GlobalTransform(pose.0), Name::new("a"))).id();
        world.insert_resource(ActiveCamera(camera));
        world.insert_resource(FileCameras { home: camera, last: camera });
        world.insert_resource(FlySpeed(2.0));
        let mut schedule = Schedule::default();
        schedule.add_systems(
            (
                choose_camera,
                take_off,
                look_around,
                change_speed,
                fly_camera,
                crate::scene::propagate_transforms,
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
        for keys in
            [&[Hold::Forward][..], &[Hold::Left, Hold::Up, Hold::Fast], &[Hold::LookLeft, Hold::LookUp]]
        {
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
            let mut changed =
                world.query_filtered::<(), Or<(Changed<Transform>, Changed<GlobalTransform>)>>();
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
        input.look = DVec2::new(10.0, 0.0);
        world.insert_resource(input);
        schedule.run(&mut world);
        assert_ne!(world.resource::<ActiveCamera>().0, home);
        assert_eq!(*world.get::<Transform>(home).unwrap(), pose);
        world.resource_mut::<Input>().end_frame();
        world.resource_mut::<Input>().taps.push((Tap::ResetCamera, false));
        schedule.run(&mut world);
        assert_eq!(world.resource::<ActiveCamera>().0, home);
    }

    #[test]
    fn brackets_go_round_the_cameras_of_the_file_in_their_order() {
        let (mut world, mut schedule) = world();
        let first = world.resource::<ActiveCamera>().0;
        let second = world.spawn((Camera::default(), Name::new("b"))).id();
        let third = world.spawn((Camera::default(), Name::new("c"))).id();
        let mut step = |tap| {
            let mut input = Input::new(Instant::now());
            input.taps.push((tap, false));
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

    #[test]
    fn flags_are_exact_and_short_where_the_numbers_are() {
        let pose = Transform::looking_at(DVec3::new(0.1, -2.0, 3.0), DVec3::new(0.1, -2.0, 0.0), DVec3::Y);
        assert_eq!(
            camera_flags(Camera::default(), GlobalTransform(pose.0)),
            "--camera-position 0.1,-2,3 --camera-focal-point 0.1,-2,2 --camera-view-up 0,1,0 --camera-view-angle 45"
        );
    }
}
