//! The arguments with which `render` makes the picture that the window shows.

use super::edit::Editor;
use super::flags::{absolute, look_flags};
use super::status::percent;
use crate::app::FrameStats;
use crate::image::recipe::Recipe;
use crate::load::SceneSource;
use crate::open::SceneOrigin;
use bevy_ecs::prelude::*;

/// All that was edited since the scene was loaded, and what was then, as `[[edit]]` tables.
fn unsaved(world: &World, origin: &SceneOrigin) -> Option<String> {
    let now = world.get_resource::<Editor>().map_or("", Editor::written);
    match (&origin.options.edits, now) {
        (before, "") => before.clone(),
        (None, now) => Some(now.to_owned()),
        (Some(before), now) => Some(format!("{before}\n{now}")),
    }
}

/// The scene, the camera, and how they look; with all edits, saved or not.
#[must_use]
pub fn recipe(world: &World) -> Recipe {
    let Some(origin) = world.get_resource::<SceneOrigin>() else { return Recipe::default() };
    let stats = world.resource::<FrameStats>();
    let mut arguments = vec![match &origin.source {
        // Wherever it is read from again.
        SceneSource::File(path) => absolute(path),
        other => other.to_string(),
    }];
    let mut add = |flag: &str, value: String| arguments.extend([flag.to_owned(), value]);
    if let Some(path) = &origin.options.scene_settings {
        add("--scene-settings", absolute(path));
    }
    if let Some(edits) = unsaved(world, origin) {
        add("--edits", edits);
    }
    add("--spp", format!("{}", stats.samples_per_pixel.round().max(1.0)));
    arguments.extend(look_flags(world));
    Recipe { arguments, description: described(stats) }
}

/// How far the picture is. The noise is estimated now and then: of fewer samples it is told of how many.
fn described(stats: &FrameStats) -> String {
    let noise = match stats.noise {
        None => "unknown".to_owned(),
        Some(noise) if f64::from(stats.noise_samples) == stats.samples_per_pixel.floor() => percent(noise),
        Some(noise) => format!("{} at {}", percent(noise), stats.noise_samples),
    };
    format!("{:.1} samples per pixel, noise {noise}", stats.samples_per_pixel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_noise_of_fewer_samples_is_told_as_that() {
        let stats = |noise_samples| FrameStats {
            samples_per_pixel: 20.5,
            noise: Some(0.02),
            noise_samples,
            ..FrameStats::default()
        };
        assert_eq!(described(&stats(20)), "20.5 samples per pixel, noise 2 %");
        assert_eq!(described(&stats(16)), "20.5 samples per pixel, noise 2 % at 16");
        assert_eq!(described(&FrameStats::default()), "0.0 samples per pixel, noise unknown");
    }
}
