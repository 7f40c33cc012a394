//! The arguments with which `render` makes the picture that the window shows.

use super::edit::Editor;
use super::flags::{absolute, look_flags};
use super::status::percent;
use crate::app::FrameBudget;
use crate::image::recipe::Recipe;
use crate::load::SceneSource;
use crate::open::SceneOrigin;
use crate::trace::Film;
use crate::trace::noise::relative_noise;
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

/// The scene, the camera, and how they look; with all edits, saved or not, and of a part that alone is refined only that.
/// The noise is estimated, which takes as long as a few samples: for pictures that are kept, not for each that is shown.
#[must_use]
pub fn recipe(world: &World) -> Recipe {
    let Some(origin) = world.get_resource::<SceneOrigin>() else { return Recipe::default() };
    let film = world.resource::<Film>();
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
    if let Some([min, max]) = world.resource::<FrameBudget>().region {
        let size = max - min;
        add("--crop", format!("{},{},{},{}", min.x, min.y, size.x, size.y));
    }
    add("--spp", format!("{}", film.mean_samples().round().max(1.0)));
    arguments.extend(look_flags(world));
    Recipe { arguments, description: described(film) }
}

/// How far the picture is, or the part of it that is refined.
fn described(film: &Film) -> String {
    let noise = relative_noise(film).map_or_else(|| "unknown".to_owned(), percent);
    format!("{:.1} samples per pixel, noise {noise}", film.mean_samples())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::{App, FrameStats};
    use crate::load::{LightUnits, LoadOptions};
    use crate::open::{Wishes, open};
    use glam::UVec2;

    fn framed(app: &mut App, samples: u32) -> Recipe {
        app.world.resource_mut::<FrameBudget>().sample_target = samples;
        while app.world.resource::<Film>().complete_samples() < samples {
            app.frame();
        }
        recipe(&app.world)
    }

    #[test]
    fn samples_noise_and_part_are_those_of_this_moment() {
        let wishes = Wishes { size: Some(UVec2::new(48, 32)), ..Wishes::default() };
        let source = SceneSource::parse("cornell").unwrap();
        let options = LoadOptions { light_units: Some(LightUnits::Raw), ..LoadOptions::default() };
        let mut app = open(&source, &options, &wishes).unwrap().app;
        assert!(recipe(&app.world).arguments.join(" ").contains("--light-units raw"));
        assert!(recipe(&app.world).description.ends_with("noise unknown"));
        framed(&mut app, 16);
        let stale = app.world.resource::<FrameStats>().noise;
        // Not yet a quarter more: the status goes on showing what it knows.
        app.world.resource_mut::<FrameBudget>().sample_target = 100;
        app.frame();
        assert_eq!(app.world.resource::<FrameStats>().noise, stale);
        let film = app.world.resource::<Film>();
        let now = percent(relative_noise(film).unwrap());
        assert_ne!(percent(stale.unwrap()), now, "nothing is shown by this");
        let made = recipe(&app.world);
        assert_eq!(made.description, format!("17.0 samples per pixel, noise {now}"));
        assert!(!made.arguments.iter().any(|argument| argument == "--crop"));
        app.world.resource_mut::<FrameBudget>().region = Some([UVec2::new(8, 3), UVec2::new(20, 32)]);
        let made = framed(&mut app, 20).arguments.join(" ");
        assert!(made.contains("--crop 8,3,12,29") && made.contains("--spp 20"), "{made}");
    }
}
