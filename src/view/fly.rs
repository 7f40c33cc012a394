//! The camera that flies.
//!
//! Cameras of the file are never touched: the first motion spawns a free camera where the active one
//! is. So a camera may hang anywhere in a hierarchy, and Enter finds it as the file has it.

use super::controls::{Notice, Notices};
use super::input::{Drag, Input};
use super::keymap::{Hold, Tap};
use super::orbit::{Navigation, pivot_depth};
use super::status::significant;
use crate::scene::{ActiveCamera, Camera, GlobalTransform, Lens, Projection, Transform};
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

/// Before the first motion: puts the free camera where the active one is, and looks through it.
pub fn take_off(
    input: Res<Input>,
    mut active: ResMut<ActiveCamera>,
    cameras: Query<(&Camera, &GlobalTransform, Option<&Lens>)>,
    free: Query<Entity, With<FlyCamera>>,
    mut commands: Commands,
) {
    if free.contains(active.0) {
        return;
    }
    let Ok((camera, pose, lens)) = cameras.get(active.0) else {
        return;
    };
    // Focusing changes a lens, and without one nothing that is seen.
    let focuses = lens.is_some() && input.count(Tap::Focus) > 0;
    let changes = input.taps.iter().any(|press| press.tap.changes_free_camera());
    if !(input.has_motion() || changes || focuses) {
        return;
    }
    let state = FlyCameraState::of(pose.0.matrix3);
    let bundle = (*camera, Transform(pose.0), *pose, state);
    let entity = match free.iter().next() {
        Some(entity) => commands.entity(entity).insert(bundle).id(),
        None => commands.spawn((FlyCamera::default(), bundle)).id(),
    };
    match lens {
        Some(&lens) => commands.entity(entity).insert(lens),
        None => commands.entity(entity).remove::<Lens>(),
    };
    active.0 = entity;
}

/// Turns the free camera.
pub fn look_around(
    input: Res<Input>,
    navigation: Res<Navigation>,
    mut cameras: Query<(&FlyCamera, &mut FlyCameraState, &mut Transform)>,
) {
    let keys =
        DVec2::new(input.axis(Hold::LookRight, Hold::LookLeft), input.axis(Hold::LookDown, Hold::LookUp));
    let keys = if navigation.orbiting { DVec2::ZERO } else { keys };
    for (settings, mut state, mut transform) in &mut cameras {
        let angles = keys * settings.turn_speed + input.dragged(Drag::Look) * settings.mouse_turn;
        // The roll of a file's camera is kept until the user looks around.
        if angles != DVec2::ZERO && state.set_if_neq(state.turned(angles)) {
            let mut turned = *transform;
            turned.0.matrix3 = state.world_from_camera();
            transform.set_if_neq(turned);
        }
    }
}

impl FlyCamera {
    /// Factor of the speed by Shift and Alt.
    #[must_use]
    pub fn boost(&self, input: &Input) -> f64 {
        let fast = if input.is_held(Hold::Fast) { self.fast } else { 1.0 };
        let slow = if input.is_held(Hold::Slow) { self.slow } else { 1.0 };
        fast * slow
    }
}

/// Moves the free camera: along its line of sight and to its sides, up and down along the world's axis.
///
/// A parallel projection looks the same from wherever along the line of sight: it gets narrower instead.
pub fn fly_camera(
    input: Res<Input>,
    speed: Res<FlySpeed>,
    navigation: Res<Navigation>,
    mut cameras: Query<(&FlyCamera, &mut Transform, &mut Camera)>,
) {
    if navigation.orbiting {
        return;
    }
    let right = input.axis(Hold::Right, Hold::Left);
    let up = input.axis(Hold::Up, Hold::Down);
    let back = input.axis(Hold::Back, Hold::Forward);
    for (settings, mut transform, mut camera) in &mut cameras {
        let axes = transform.0.matrix3;
        let mut seconds = axes.x_axis.normalize_or_zero() * right + DVec3::Y * up;
        let speed = speed.0 * settings.boost(&input);
        match camera.projection {
            Projection::Perspective { .. } => seconds += axes.z_axis.normalize_or_zero() * back,
            Projection::Orthographic { height } if back != 0.0 => {
                let wider = (back * speed / pivot_depth(&transform, navigation.pivot)).exp();
                camera.projection = Projection::Orthographic { height: height * wider as f32 };
            }
            Projection::Orthographic { .. } => {}
        }
        let mut moved = *transform;
        moved.0.translation += seconds * speed;
        transform.set_if_neq(moved);
    }
}

/// Changes the base speed: ×1.1 per notch of the wheel, ×1.5 per key press.
pub fn change_speed(input: Res<Input>, mut speed: ResMut<FlySpeed>, mut notices: ResMut<Notices>) {
    let presses = input.count(Tap::Faster) as f64 - input.count(Tap::Slower) as f64;
    let factor = 1.1_f64.powf(input.wheel) * 1.5_f64.powf(presses);
    if speed.set_if_neq(FlySpeed((speed.0 * factor).clamp(1e-12, 1e12))) {
        notices.0.push(Notice::Text(format!("speed: {} / s", significant(speed.0, 3))));
    }
}

#[cfg(test)]
mod tests;
