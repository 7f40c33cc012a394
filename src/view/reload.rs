//! Another scene in the running window, or the same one again from its files.

use super::bookmarks::Bookmarks;
use super::cameras::{FileCameras, same_camera};
use super::controls::Paused;
use super::debug::Debug;
use super::edit::carry::carry;
use super::fly::{FlyCamera, FlyCameraState, FlySpeed};
use super::input::Input;
use super::instrument::Instrument;
use super::orbit::Navigation;
use super::pixel_view::PixelView;
use super::playing::Clock;
use crate::app::{App, FrameBudget};
use crate::image::Display;
use crate::load::{LoadOptions, SceneFiles, SceneSource, Watcher};
use crate::open::{LoadCard, OpenError, SceneOrigin, Wishes, open};
use crate::scene::{ActiveCamera, Camera, GlobalTransform, Lens, Playing, Transform};
use crate::shown::Shown;
use crate::sync::{BlasCache, Instructions, RenderOrigin};
use crate::trace::{Film, RenderSettings};
use bevy_ecs::prelude::*;
use std::path::{Path, PathBuf};

/// Loads `path` in place of what `app` shows, with the same settings.
///
/// # Errors
/// Why it cannot be shown; `app` is as it was then.
pub fn open_other(app: &App, path: &Path, watcher: Watcher) -> Result<App, String> {
    let source = match path.to_str() {
        Some(argument) => SceneSource::parse(argument).map_err(|error| error.to_string())?,
        None => SceneSource::File(path.to_path_buf()),
    };
    let settings = app.world.resource::<RenderSettings>();
    let wishes = Wishes {
        size: Some(settings.size),
        integrator: Some(settings.integrator),
        max_depth: Some(settings.max_depth),
        seed: Some(settings.seed),
        sampling: Some(settings.sampling),
        filter: settings.filter,
        tone_map: Some(app.world.resource::<Display>().tone_map),
        isa: Some(app.world.resource::<Instructions>().0),
        ..Wishes::default()
    };
    let mut other = open(&source, &LoadOptions { watcher, ..LoadOptions::default() }, &wishes)
        .map_err(|error| error.to_string())?
        .app;
    let budget = app.world.resource::<FrameBudget>().clone();
    other.world.insert_resource(FrameBudget { region: None, ..budget });
    keep_switches(app, &mut other);
    // Those of the scene that is left are there when it comes back.
    keep::<Bookmarks>(app, &mut other);
    other.world.insert_resource(Instrument::default().moved());
    Ok(other)
}

/// Whether `path` is a picture of all directions, not a scene.
#[must_use]
pub fn is_sky(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    matches!(ending.as_deref(), Some("hdr" | "exr"))
}

/// Loads the scene again under this sky.
///
/// # Errors
/// Why it cannot be shown; `app` is as it was then.
pub fn set_sky(app: &mut App, sky: PathBuf, watcher: Watcher) -> Result<App, String> {
    let mut origin = app.world.get_resource::<SceneOrigin>().cloned().ok_or("the scene is of no file")?;
    let before = origin.clone();
    origin.options.sky = Some(sky);
    // Those of a sky that cannot be shown are none of the scene's.
    origin.options.files = SceneFiles::default();
    app.world.insert_resource(origin);
    let loaded = load_again(app, watcher);
    if loaded.is_err() {
        app.world.insert_resource(before);
    }
    loaded
}

/// Loads the scene again and gives it the camera, the edits and all settings of `app`.
///
/// # Errors
/// Why it cannot be shown; `app` is as it was then, but knows which files were looked for.
pub fn load_again(app: &mut App, watcher: Watcher) -> Result<App, String> {
    let origin = app.world.get_resource::<SceneOrigin>().cloned().ok_or("the scene is of no file")?;
    let settings = *app.world.resource::<RenderSettings>();
    let mut wishes = Wishes {
        size: Some(settings.size),
        exposure: Some(0.0),
        isa: Some(app.world.resource::<Instructions>().0),
        camera: origin.camera.clone(),
        pose: origin.pose,
        ..Wishes::default()
    };
    let time = app.world.get_resource::<Playing>().and_then(|playing| playing.time);
    let files = SceneFiles::default();
    let options = LoadOptions {
        watcher,
        time: time.or(origin.options.time),
        files: files.clone(),
        ..origin.options.clone()
    };
    let mut opened = open(&origin.source, &options, &wishes);
    if let Err(OpenError::Camera { .. }) = opened {
        // The camera that was asked for at first may be gone.
        wishes.camera = None;
        opened = open(&origin.source, &options, &wishes);
    }
    let mut again = match opened {
        Ok(opened) => opened.app,
        Err(error) => {
            // What it did not come to has changed as well perhaps, and would ask for it again and again.
            origin.options.files.refresh();
            origin.options.files.extend(&files);
            let why = error.to_string();
            if let Some(mut card) = app.world.get_resource_mut::<LoadCard>() {
                card.outdate(&why);
            }
            return Err(why);
        }
    };
    again.world.resource_mut::<SceneOrigin>().camera = origin.camera;
    again.world.insert_resource(settings);
    again.world.insert_resource(Film::new(settings.size, app.world.resource::<Film>().first_sample()));
    keep::<Display>(app, &mut again);
    keep::<FrameBudget>(app, &mut again);
    keep_switches(app, &mut again);
    // Meshes that are the same are not built again.
    keep::<BlasCache>(app, &mut again);
    keep::<Bookmarks>(app, &mut again);
    keep::<Input>(app, &mut again);
    if let Some(instrument) = app.world.get_resource::<Instrument>() {
        again.world.insert_resource(instrument.clone().moved());
    }
    keep::<Navigation>(app, &mut again);
    keep::<FlySpeed>(app, &mut again);
    keep::<Paused>(app, &mut again);
    if let Some(clock) = app.world.get_resource::<Clock>() {
        again.world.insert_resource(clock.restarted());
    }
    keep::<PixelView>(app, &mut again);
    // Pixels are pinned in coordinates that count from there.
    if app.world.resource::<RenderOrigin>() == again.world.resource::<RenderOrigin>() {
        keep::<Debug>(app, &mut again);
    }
    carry(&app.world, &mut again.world);
    keep_camera(app, &mut again);
    Ok(again)
}

/// What is shown beside the film, or not.
fn keep_switches(from: &App, to: &mut App) {
    let shown = from.world.resource::<Shown>();
    let switches = (shown.only_film, shown.never_smooth);
    let mut shown = to.world.resource_mut::<Shown>();
    (shown.only_film, shown.never_smooth) = switches;
}

fn keep<T: Resource + Clone>(from: &App, to: &mut App) {
    if let Some(resource) = from.world.get_resource::<T>() {
        to.world.insert_resource(resource.clone());
    }
}

/// The camera that is looked through stays: one that the user has flown where it is, one of the file as that has it now.
fn keep_camera(from: &App, to: &mut App) {
    let home = to.world.resource::<ActiveCamera>().0;
    let same = |camera| same_camera(&from.world, camera, &to.world).unwrap_or(home);
    let active = from.world.resource::<ActiveCamera>().0;
    let last = from.world.get_resource::<FileCameras>().map_or(home, |seen| same(seen.last));
    let same = same(active);
    let active = flown(&from.world, active, &mut to.world).unwrap_or(same);
    to.world.insert_resource(FileCameras { home, last });
    to.world.insert_resource(ActiveCamera(active));
}

/// A camera in `to` like `camera`, if that is one that the user flies.
fn flown(from: &World, camera: Entity, to: &mut World) -> Option<Entity> {
    let entity = from.entity(camera);
    let (&fly, &state) = (entity.get::<FlyCamera>()?, entity.get::<FlyCameraState>()?);
    let (&camera, &pose) = (entity.get::<Camera>()?, entity.get::<GlobalTransform>()?);
    let mut copy = to.spawn((fly, state, camera, pose, Transform(pose.0)));
    if let Some(&lens) = entity.get::<Lens>() {
        copy.insert(lens);
    }
    Some(copy.id())
}

#[cfg(test)]
mod tests;
