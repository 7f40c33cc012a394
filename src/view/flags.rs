//! A camera as command line flags.

use crate::load::LoadOptions;
use crate::open::SceneOrigin;
use crate::scene::{Camera, GlobalTransform, Lens, Playing, Projection};
use bevy_ecs::prelude::*;
use glam::DVec3;

/// The command line flags that look through `camera` at `pose`.
#[must_use]
pub fn camera_flags(camera: Camera, pose: GlobalTransform, lens: Option<Lens>) -> String {
    let eye = pose.0.translation;
    let axes = pose.0.matrix3;
    let mut flags = format!(
        "--camera-position {} --camera-focal-point {} --camera-view-up {}",
        list(eye),
        list(eye - axes.z_axis.normalize_or(DVec3::Z)),
        list(axes.y_axis.normalize_or(DVec3::Y)),
    );
    flags += &match camera.projection {
        Projection::Perspective { vertical_fov } => {
            let degrees = vertical_fov.to_degrees();
            if degrees.to_radians() == vertical_fov {
                format!(" --camera-view-angle {degrees}")
            } else {
                format!(" --camera-view-angle {}", f64::from(vertical_fov).to_degrees())
            }
        }
        Projection::Orthographic { height } => format!(" --camera-orthographic {height}"),
    };
    if let Some(Lens { radius, focus }) = lens {
        flags += &format!(" --lens-radius {radius} --focus-distance {focus}");
    }
    flags
}

/// The flags that choose the scene, variant, animation and time of a file, each with its value.
#[must_use]
pub fn part_flags(world: &World) -> Vec<(&'static str, String)> {
    let Some(origin) = world.get_resource::<SceneOrigin>() else { return Vec::new() };
    let LoadOptions { scene, variant, animation, time, .. } = &origin.options;
    let playing = world.get_resource::<Playing>().and_then(|playing| playing.time);
    let time = playing.or(*time).map(|time| time.to_string());
    let flags =
        [("--gltf-scene", scene), ("--variant", variant), ("--animation", animation), ("--time", &time)];
    flags.into_iter().filter_map(|(flag, value)| Some((flag, value.clone()?))).collect()
}

/// Exact: the shortest text that gives the same numbers again.
fn list(v: DVec3) -> String {
    // Adding 0 turns −0 into 0.
    let v = v + DVec3::ZERO;
    format!("{},{},{}", v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Transform;

    #[test]
    fn flags_are_exact_and_short_where_the_numbers_are() {
        let pose = Transform::looking_at(DVec3::new(0.1, -2.0, 3.0), DVec3::new(0.1, -2.0, 0.0), DVec3::Y);
        let place = "--camera-position 0.1,-2,3 --camera-focal-point 0.1,-2,2 --camera-view-up 0,1,0";
        let pose = GlobalTransform(pose.0);
        assert_eq!(camera_flags(Camera::default(), pose, None), format!("{place} --camera-view-angle 45"));
        let parallel = Camera { projection: Projection::Orthographic { height: 2.5 } };
        assert_eq!(
            camera_flags(parallel, pose, Some(Lens { radius: 0.1, focus: 3.0 })),
            format!("{place} --camera-orthographic 2.5 --lens-radius 0.1 --focus-distance 3")
        );
    }
}
