//! Places to look from: the file's cameras and the sides of the scene; and kinds of projection.

use super::controls::{Notice, Notices};
use super::edit::Editor;
use super::fly::{FlyCamera, FlyCameraState};
use super::input::Input;
use super::keymap::{Side, Tap};
use super::orbit::{Navigation, pivot_depth};
use crate::load::bounds_now;
use crate::scene::{ActiveCamera, Camera, Lens, Projection, SceneBounds, Transform};
use crate::trace::RenderSettings;
use bevy_ecs::prelude::*;
use glam::{DVec2, UVec2};
use std::f64::consts::{FRAC_PI_2, PI};

/// Which cameras of the file were looked through.
#[derive(Resource, Clone, Copy, Debug, PartialEq)]
pub struct FileCameras {
    /// The one that the window opened with.
    pub home: Entity,
    /// The last one.
    pub last: Entity,
}

/// The file's cameras, in its order.
fn file_cameras(world: &World) -> Vec<Entity> {
    let is_of_file =
        |e: &EntityRef<'_>| e.contains::<Camera>() && e.contains::<Name>() && !e.contains::<FlyCamera>();
    let mut cameras: Vec<Entity> = world.iter_entities().filter(is_of_file).map(|e| e.id()).collect();
    cameras.sort_by_key(|camera| camera.index_u32());
    cameras
}

/// The camera of `to`, the same scene loaded again, that `camera` is in `from`: by name, and of several by their order.
#[must_use]
pub fn same_camera(from: &World, camera: Entity, to: &World) -> Option<Entity> {
    let name = from.get::<Name>(camera)?;
    let named =
        |world| file_cameras(world).into_iter().filter(move |&other| world.get::<Name>(other) == Some(name));
    let index = named(from).position(|other| other == camera)?;
    named(to).nth(index)
}

/// Shows the file's next or previous camera, or the first one again.
pub fn choose_camera(
    input: Res<Input>,
    cameras: Query<Entity, (With<Camera>, With<Name>, Without<FlyCamera>)>,
    mut seen: ResMut<FileCameras>,
    mut active: ResMut<ActiveCamera>,
    mut notices: ResMut<Notices>,
) {
    let mut camera = input.count(Tap::ResetCamera).gt(&0).then_some(seen.home);
    let steps = input.count(Tap::NextCamera) as i64 - input.count(Tap::PreviousCamera) as i64;
    if steps != 0 {
        let mut cameras: Vec<Entity> = cameras.iter().collect();
        cameras.sort_by_key(|camera| camera.index_u32());
        if cameras.len() < 2 {
            notices.0.push(Notice::Text("the file has no other camera".to_owned()));
        }
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

/// Around the scene as it has been edited.
#[derive(Resource, Clone, Copy, Debug)]
pub struct EditedBounds(SceneBounds);

/// Finds them when they are asked for.
pub fn survey_edited(world: &mut World) {
    let is_edited = world.get_resource::<Editor>().is_some_and(Editor::has_edits);
    if !world.resource::<Input>().taps.iter().any(|press| press.tap == Tap::FrameAll) {
        return;
    }
    match bounds_now(world).filter(|_| is_edited) {
        Some(bounds) => world.insert_resource(EditedBounds(bounds)),
        None => drop(world.remove_resource::<EditedBounds>()),
    }
}

/// Looks from a side at the pivot, or at the whole scene.
pub fn choose_side(
    input: Res<Input>,
    loaded: Option<Res<SceneBounds>>,
    edited: Option<Res<EditedBounds>>,
    settings: Res<RenderSettings>,
    mut navigation: ResMut<Navigation>,
    mut cameras: Query<(&mut FlyCameraState, &mut Transform, &mut Camera), With<FlyCamera>>,
) {
    for (mut state, mut transform, mut camera) in &mut cameras {
        for press in &input.taps {
            let mut moved = *transform;
            let mut distance = (moved.0.translation - navigation.pivot).length();
            match press.tap {
                Tap::View(side) => state.set_if_neq(looking_from(side)),
                Tap::FrameAll => {
                    let Some(bounds) = edited.as_ref().map(|edited| edited.0).or(loaded.as_deref().copied())
                    else {
                        continue;
                    };
                    navigation.pivot = bounds.center;
                    distance = frame(&mut camera, bounds.radius, settings.size);
                    true
                }
                _ => continue,
            };
            moved.0.matrix3 = state.world_from_camera();
            moved.0.translation = navigation.pivot + moved.0.matrix3.z_axis * distance;
            transform.set_if_neq(moved);
        }
    }
}

/// How far a camera must be from a ball of this radius to see it whole in a picture of this size; a parallel projection is
/// made fit.
fn frame(camera: &mut Mut<Camera>, radius: f64, size: UVec2) -> f64 {
    let size = size.as_dvec2().max(DVec2::ONE);
    // Of the picture's height: what a narrow one shows across.
    let least = (size.x / size.y).min(1.0);
    match camera.projection {
        Projection::Perspective { vertical_fov } => {
            radius / (least * (0.5 * f64::from(vertical_fov)).tan()).atan().sin()
        }
        Projection::Orthographic { .. } => {
            let height = (2.0 * radius / least) as f32;
            camera.projection = Projection::Orthographic { height };
            2.0 * radius
        }
    }
}

fn looking_from(side: Side) -> FlyCameraState {
    let (yaw, pitch) = match side {
        Side::Front => (0.0, 0.0),
        Side::Back => (PI, 0.0),
        Side::Right => (FRAC_PI_2, 0.0),
        Side::Left => (-FRAC_PI_2, 0.0),
        Side::Top => (0.0, -FRAC_PI_2),
        Side::Bottom => (0.0, FRAC_PI_2),
    };
    // The same angle as turning there would give.
    FlyCameraState { yaw, pitch }.turned(DVec2::ZERO)
}

/// Perspective or parallel, so that what is as far as the pivot stays as large.
pub fn change_projection(
    input: Res<Input>,
    mut navigation: ResMut<Navigation>,
    mut cameras: Query<(&mut Camera, &mut Transform), With<FlyCamera>>,
) {
    if input.count(Tap::Orthographic).is_multiple_of(2) {
        return;
    }
    for (mut camera, mut transform) in &mut cameras {
        let depth = pivot_depth(&transform, navigation.pivot);
        match camera.projection {
            Projection::Perspective { vertical_fov } => {
                navigation.vertical_fov = vertical_fov;
                let height = 2.0 * depth * (0.5 * f64::from(vertical_fov)).tan();
                camera.projection = Projection::Orthographic { height: height as f32 };
            }
            Projection::Orthographic { height } => {
                let vertical_fov = navigation.vertical_fov;
                camera.projection = Projection::Perspective { vertical_fov };
                let wanted = 0.5 * f64::from(height) / (0.5 * f64::from(vertical_fov)).tan();
                let back = transform.0.matrix3.z_axis;
                transform.0.translation += back * (wanted - depth);
            }
        }
    }
}

/// A larger or smaller lens, in steps of √2. It is sharp at the pivot when it first opens.
pub fn change_lens(
    input: Res<Input>,
    navigation: Res<Navigation>,
    cameras: Query<(Entity, &Transform, Option<&Lens>), With<FlyCamera>>,
    mut commands: Commands,
    mut notices: ResMut<Notices>,
) {
    let steps = input.count(Tap::OpenLens) as i32 - input.count(Tap::CloseLens) as i32;
    if steps == 0 {
        return;
    }
    for (entity, transform, lens) in &cameras {
        let focus = lens.map_or_else(|| pivot_depth(transform, navigation.pivot) as f32, |lens| lens.focus);
        // The smallest lens blurs by a pixel or so.
        let smallest = focus / 512.0;
        let old = lens.map_or(smallest / 2f32.sqrt(), |lens| lens.radius);
        let radius = old * 2f32.powf(0.5 * steps as f32);
        let said = if radius < smallest * 0.99 {
            commands.entity(entity).remove::<Lens>();
            "lens closed: all is sharp".to_owned()
        } else {
            let radius = radius.min(focus);
            commands.entity(entity).insert(Lens { radius, focus });
            format!("lens radius {radius:.4}, sharp at {focus:.3} (F: at the cursor)")
        };
        notices.0.push(Notice::Text(said));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_framed_ball_is_within_the_picture_whatever_its_shape() {
        let mut world = World::new();
        let vertical_fov = 0.7;
        let camera = world.spawn(Camera { projection: Projection::Perspective { vertical_fov } }).id();
        for size in [UVec2::new(1600, 900), UVec2::splat(500), UVec2::new(300, 900)] {
            let mut camera = world.get_mut::<Camera>(camera).unwrap();
            let distance = frame(&mut camera, 2.0, size);
            // Where a line of sight touches the ball, its tangent is seen under this.
            let reach = (2.0 / distance).asin().tan();
            let half = (0.5 * f64::from(vertical_fov)).tan();
            let across = half * f64::from(size.x) / f64::from(size.y);
            assert!((reach - half.min(across)).abs() < 1e-9, "{size}: {reach}");
        }
        let mut camera = world.get_mut::<Camera>(camera).unwrap();
        camera.projection = Projection::Orthographic { height: 1.0 };
        frame(&mut camera, 2.0, UVec2::new(300, 900));
        assert_eq!(camera.projection, Projection::Orthographic { height: 12.0 });
    }
}
