//! Turning about a point, and choosing it.

use super::controls::{Notice, Notices};
use super::fly::{FlyCamera, FlyCameraState, FlySpeed};
use super::input::{Drag, Input};
use super::keymap::{Hold, Tap};
use crate::bvh::Ray;
use crate::scene::{Camera, Lens, Projection, Transform};
use crate::sync::{RenderOrigin, Traceable};
use crate::trace::{RenderSettings, TraceScene, Viewpoint};
use bevy_ecs::prelude::*;
use glam::{DVec2, DVec3};

/// How the keys move the camera.
#[derive(Resource, Clone, Copy, Debug, PartialEq)]
pub struct Navigation {
    /// About the pivot; else freely.
    pub orbiting: bool,
    /// What the camera turns about, world space.
    pub pivot: DVec3,
    /// Vertical field of view to return to from a parallel projection, radians.
    pub vertical_fov: f32,
}

/// The camera comes this much nearer to the pivot for each notch of the wheel.
const NEARER: f64 = 0.9;

/// Distance of `pivot` from a camera at `transform` along its line of sight; never 0.
#[must_use]
pub fn pivot_depth(transform: &Transform, pivot: DVec3) -> f64 {
    let forward = -transform.0.matrix3.z_axis.normalize_or(DVec3::Z);
    let along = (pivot - transform.0.translation).dot(forward);
    // A pivot behind the camera is as good as one as far in front.
    if along == 0.0 { 1e-6 } else { along.abs() }
}

/// The ray through `place` of the picture, from (0, 0) at its upper left to (1, 1).
#[must_use]
pub fn ray_through(viewpoint: &Viewpoint, settings: &RenderSettings, place: DVec2) -> Ray {
    viewpoint.ray((place * settings.size.as_dvec2()).as_vec2(), settings.size)
}

/// Where the eye first sees something along `ray`, in its parameter; solid lights too.
#[must_use]
pub fn first_surface(scene: &TraceScene, ray: &Ray) -> Option<f32> {
    let surface = scene.first_seen(ray).map(|hit| hit.t);
    let lamp = scene.lights.closest(&Ray { t_max: surface.unwrap_or(f32::INFINITY), ..*ray });
    lamp.map(|found| found.hit.t).or(surface)
}

/// Tab: fly or orbit.
pub fn change_navigation(
    input: Res<Input>,
    mut navigation: ResMut<Navigation>,
    mut notices: ResMut<Notices>,
) {
    if input.count(Tap::Navigation) % 2 == 1 {
        navigation.orbiting = !navigation.orbiting;
        let text = if navigation.orbiting { "orbit: keys turn about the pivot" } else { "fly" };
        notices.0.push(Notice::Text(text.to_owned()));
    }
}

/// F: pivot and focal plane to what is under the cursor.
pub fn focus(
    input: Res<Input>,
    scene: Traceable,
    viewpoint: Res<Viewpoint>,
    settings: Res<RenderSettings>,
    origin: Res<RenderOrigin>,
    mut navigation: ResMut<Navigation>,
    mut lenses: Query<&mut Lens, With<FlyCamera>>,
    mut notices: ResMut<Notices>,
) {
    for press in input.taps.iter().filter(|press| press.tap == Tap::Focus) {
        let ray = ray_through(&viewpoint, &settings, press.cursor);
        let Some(t) = first_surface(&scene.scene(), &ray) else {
            notices.0.push(Notice::Text("nothing there to focus on".to_owned()));
            continue;
        };
        navigation.pivot = ray.at(t).as_dvec3() + origin.0.unwrap_or_default();
        let focus = viewpoint.depth(&ray, t);
        for mut lens in &mut lenses {
            let radius = lens.radius;
            lens.set_if_neq(Lens { radius, focus });
        }
        notices.0.push(Notice::Text(format!("focus and pivot {focus:.3} away")));
    }
}

/// Orbits, pans and nears with the mouse, and in orbit mode with the keys.
pub fn orbit_camera(
    input: Res<Input>,
    speed: Res<FlySpeed>,
    settings: Res<RenderSettings>,
    mut navigation: ResMut<Navigation>,
    mut cameras: Query<(&FlyCamera, &mut FlyCameraState, &mut Transform, &mut Camera)>,
) {
    for (fly, mut state, mut transform, mut camera) in &mut cameras {
        let mut moved = *transform;
        let mut angles = input.dragged(Drag::Orbit) * fly.mouse_turn * 2.0;
        let mut nearer = NEARER.powf(input.dolly);
        if navigation.orbiting {
            let right = input.axis(Hold::LookRight, Hold::LookLeft) + input.axis(Hold::Right, Hold::Left);
            let down = input.axis(Hold::LookDown, Hold::LookUp) + input.axis(Hold::Down, Hold::Up);
            // The scene's point that is seen moves the other way than the camera.
            angles -= DVec2::new(right, down) * fly.turn_speed;
            let seconds = input.axis(Hold::Back, Hold::Forward) * fly.boost(&input);
            nearer *= (seconds * speed.0 / pivot_depth(&moved, navigation.pivot).max(speed.0)).exp();
        }
        if angles != DVec2::ZERO {
            let turned = state.turned(angles);
            let (before, after) = (moved.0.matrix3, turned.world_from_camera());
            let around = after * before.inverse();
            moved.0.translation = navigation.pivot + around * (moved.0.translation - navigation.pivot);
            moved.0.matrix3 = after;
            state.set_if_neq(turned);
        }
        if nearer != 1.0 {
            match camera.projection {
                Projection::Perspective { .. } => {
                    moved.0.translation =
                        navigation.pivot + (moved.0.translation - navigation.pivot) * nearer;
                }
                Projection::Orthographic { height } => {
                    camera.projection = Projection::Orthographic { height: height * nearer as f32 };
                }
            }
        }
        let pan = input.dragged(Drag::Pan);
        if pan != DVec2::ZERO {
            let height = match camera.projection {
                Projection::Perspective { vertical_fov } => {
                    2.0 * pivot_depth(&moved, navigation.pivot) * (0.5 * f64::from(vertical_fov)).tan()
                }
                Projection::Orthographic { height } => f64::from(height),
            };
            let axes = moved.0.matrix3;
            let units = pan * height / f64::from(settings.size.y);
            let shift = axes.y_axis * units.y - axes.x_axis * units.x;
            moved.0.translation += shift;
            navigation.pivot += shift;
        }
        transform.set_if_neq(moved);
    }
}
