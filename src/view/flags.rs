//! What is seen, as command line flags of `render`.

use crate::image::Display;
use crate::load::LoadOptions;
use crate::open::SceneOrigin;
use crate::scene::{ActiveCamera, Camera, Filter, GlobalTransform, Lens, Playing, Projection};
use crate::trace::{RenderSettings, Sampling};
use bevy_ecs::prelude::*;
use glam::DVec3;
use std::path::Path;

/// All flags of what is seen but for the scene's files, its edits and the number of samples.
#[must_use]
pub fn look_flags(world: &World) -> Vec<String> {
    let mut flags = part_flags(world);
    let mut add = |flag: &str, value: String| flags.extend([flag.to_owned(), value]);
    let settings = world.resource::<RenderSettings>();
    add("--resolution", format!("{}x{}", settings.size.x, settings.size.y));
    add("--seed", settings.seed.to_string());
    add("--integrator", settings.integrator.name().to_owned());
    add("--max-depth", settings.max_depth.to_string());
    let sampling = match settings.sampling {
        Sampling::Independent => "independent",
        Sampling::Stratified => "stratified",
        Sampling::Shifted => "shifted",
        Sampling::Sobol => "sobol",
    };
    add("--sampling", sampling.to_owned());
    if let Some(filter) = settings.filter {
        let filter = match filter {
            Filter::Nearest => "nearest",
            Filter::Bilinear => "bilinear",
        };
        add("--filter", filter.to_owned());
    }
    let display = world.resource::<Display>();
    add("--exposure", display.exposure.to_string());
    add("--tone-map", display.tone_map.name().to_owned());
    let active = world.get_resource::<ActiveCamera>().map(|active| active.0);
    if let Some(active) = active
        && let (Some(camera), Some(pose)) =
            (world.get::<Camera>(active), world.get::<GlobalTransform>(active))
    {
        flags.extend(camera_flags(*camera, *pose, world.get::<Lens>(active).copied()));
    }
    flags
}

/// The flags that look through `camera` at `pose`.
#[must_use]
pub fn camera_flags(camera: Camera, pose: GlobalTransform, lens: Option<Lens>) -> Vec<String> {
    let eye = pose.0.translation;
    let axes = pose.0.matrix3;
    let mut flags = Vec::new();
    let mut add = |flag: &str, value: String| flags.extend([flag.to_owned(), value]);
    add("--camera-position", list(eye));
    add("--camera-focal-point", list(eye - axes.z_axis.normalize_or(DVec3::Z)));
    add("--camera-view-up", list(axes.y_axis.normalize_or(DVec3::Y)));
    match camera.projection {
        Projection::Perspective { vertical_fov } => {
            let degrees = vertical_fov.to_degrees();
            let is_exact = degrees.to_radians() == vertical_fov;
            let exact = || f64::from(vertical_fov).to_degrees().to_string();
            add("--camera-view-angle", if is_exact { degrees.to_string() } else { exact() });
        }
        Projection::Orthographic { height } => add("--camera-orthographic", height.to_string()),
    }
    if let Some(Lens { radius, focus }) = lens {
        add("--lens-radius", radius.to_string());
        add("--focus-distance", focus.to_string());
    }
    flags
}

/// The flags that choose the sky, and the scene, variant, animation, time and units of lamps of a file.
fn part_flags(world: &World) -> Vec<String> {
    let Some(origin) = world.get_resource::<SceneOrigin>() else { return Vec::new() };
    let LoadOptions { scene, variant, animation, time, sky, light_units, .. } = &origin.options;
    let playing = world.get_resource::<Playing>().and_then(|playing| playing.time);
    let time = playing.or(*time).map(|time| time.to_string());
    let sky = sky.as_deref().map(absolute);
    let units = light_units.map(|units| units.name().to_owned());
    let flags = [
        ("--hdri", &sky),
        ("--gltf-scene", scene),
        ("--variant", variant),
        ("--animation", animation),
        ("--time", &time),
        ("--light-units", &units),
    ];
    let given = flags.into_iter().filter_map(|(flag, value)| Some([flag.to_owned(), value.clone()?]));
    given.flatten().collect()
}

/// A path that means the same everywhere.
pub(super) fn absolute(path: &Path) -> String {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()).display().to_string()
}

/// As a shell takes them, whatever files and their things are called.
#[must_use]
pub fn shell_line(arguments: &[String]) -> String {
    let quoted = |argument: &String| {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-+,:/@%=".contains(c);
        if !argument.is_empty() && argument.chars().all(is_plain) {
            argument.clone()
        } else {
            format!("'{}'", argument.replace('\'', r"'\''"))
        }
    };
    arguments.iter().map(quoted).collect::<Vec<_>>().join(" ")
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
        let line = |camera, lens| shell_line(&camera_flags(camera, pose, lens));
        assert_eq!(line(Camera::default(), None), format!("{place} --camera-view-angle 45"));
        let parallel = Camera { projection: Projection::Orthographic { height: 2.5 } };
        assert_eq!(
            line(parallel, Some(Lens { radius: 0.1, focus: 3.0 })),
            format!("{place} --camera-orthographic 2.5 --lens-radius 0.1 --focus-distance 3")
        );
    }

    #[test]
    fn a_shell_reads_every_argument_as_it_was() {
        let arguments = ["--variant", "red car", "it's", "", "$HOME", "a.glb"].map(str::to_owned);
        assert_eq!(shell_line(&arguments), r"--variant 'red car' 'it'\''s' '' '$HOME' a.glb");
    }
}
