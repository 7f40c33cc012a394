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
    let noise = stats.noise.map_or("unknown".to_owned(), percent);
    let description = format!("{:.1} samples per pixel, noise {noise}", stats.samples_per_pixel);
    Recipe { arguments, description }
}
