//! The arguments with which `render` makes the picture that the window shows.

use super::edit::Editor;
use super::edit::save::edits;
use super::flags::{camera_flags, part_flags};
use super::status::percent;
use crate::app::FrameStats;
use crate::image::Display;
use crate::image::recipe::Recipe;
use crate::load::SceneSource;
use crate::open::SceneOrigin;
use crate::scene::{ActiveCamera, Camera, Filter, GlobalTransform, Lens};
use crate::trace::{RenderSettings, Sampling};
use bevy_ecs::prelude::*;

/// All that was edited since the scene was loaded, and what was then, as `[[edit]]` tables.
fn unsaved(world: &World, origin: &SceneOrigin) -> Option<String> {
    let editor = world.get_resource::<Editor>().filter(|editor| !editor.edited().0.is_empty());
    let now = editor.and_then(|editor| edits(world, editor).ok());
    match (origin.options.edits.clone(), now) {
        (Some(before), Some(now)) => Some(format!("{before}\n{now}")),
        (before, now) => before.or(now),
    }
}

/// The scene, the camera, and how they look; with all edits, saved or not.
#[must_use]
pub fn recipe(world: &World) -> Recipe {
    let Some(origin) = world.get_resource::<SceneOrigin>() else { return Recipe::default() };
    let settings = world.resource::<RenderSettings>();
    let display = world.resource::<Display>();
    let stats = world.resource::<FrameStats>();
    let scene = match &origin.source {
        // Wherever it is read from again.
        SceneSource::File(path) => {
            std::path::absolute(path).unwrap_or_else(|_| path.clone()).display().to_string()
        }
        SceneSource::BuiltIn(name) => (*name).to_owned(),
        SceneSource::Made(made) => made.name.to_owned(),
    };
    let mut arguments = vec![scene];
    let mut add = |flag: &str, value: String| arguments.extend([flag.to_owned(), value]);
    if let Some(path) = &origin.options.scene_settings {
        add(
            "--scene-settings",
            std::path::absolute(path).unwrap_or_else(|_| path.clone()).display().to_string(),
        );
    }
    if let Some(path) = &origin.options.sky {
        add("--hdri", std::path::absolute(path).unwrap_or_else(|_| path.clone()).display().to_string());
    }
    for (flag, value) in part_flags(world) {
        add(flag, value);
    }
    if let Some(edits) = unsaved(world, origin) {
        add("--edits", edits);
    }
    add("--resolution", format!("{}x{}", settings.size.x, settings.size.y));
    add("--spp", format!("{}", stats.samples_per_pixel.round().max(1.0)));
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
    add("--exposure", display.exposure.to_string());
    add("--tone-map", display.tone_map.name().to_owned());
    let active = world.get_resource::<ActiveCamera>().map(|active| active.0);
    if let Some(active) = active
        && let (Some(camera), Some(pose)) =
            (world.get::<Camera>(active), world.get::<GlobalTransform>(active))
    {
        let flags = camera_flags(*camera, *pose, world.get::<Lens>(active).copied());
        arguments.extend(flags.split_whitespace().map(str::to_owned));
    }
    let noise = stats.noise.map_or("unknown".to_owned(), percent);
    let description = format!("{:.1} samples per pixel, noise {noise}", stats.samples_per_pixel);
    Recipe { arguments, description }
}
