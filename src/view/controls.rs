//! Keys that change how the picture is made or shown, and what they answer.

use super::flags::{camera_flags, shell_line};
use super::input::Input;
use super::keymap::{Hold, Tap};
use super::recipe::recipe;
use super::sides::Sides;
use crate::image::develop::exposure_for;
use crate::image::files::save_with_recipe;
use crate::image::{Display, ToneMap, save};
use crate::open::SceneOrigin;
use crate::scene::{ActiveCamera, Camera, Filter, GlobalTransform, Lens};
use crate::shown::Shown;
use crate::trace::{Film, Integrator, RenderSettings};
use bevy_ecs::prelude::*;
use std::fs::File;
use std::io::ErrorKind;
use std::path::PathBuf;

/// Whether refinement rests. The view still follows the camera.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Paused(pub bool);

/// What the program says to the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Notice {
    /// In the window.
    Text(String),
    /// In the window and on standard output, to be pasted elsewhere.
    Print(String),
    /// The same, with something to say before it in the window.
    Saved(String, String),
}

/// Notices that nobody has seen yet.
#[derive(Resource, Clone, Debug, Default)]
pub struct Notices(pub Vec<Notice>);

/// Size, filter and integrator; all of them restart the accumulation, and so does R.
pub fn change_settings(
    input: Res<Input>,
    mut settings: ResMut<RenderSettings>,
    mut notices: ResMut<Notices>,
) {
    let mut wanted = *settings;
    if let Some(size) = input.resize {
        wanted.size = size;
    }
    for press in &input.taps {
        let said = match press.tap {
            Tap::Filter => {
                wanted.filter = match wanted.filter {
                    None => Some(Filter::Nearest),
                    Some(Filter::Nearest) => Some(Filter::Bilinear),
                    Some(Filter::Bilinear) => None,
                };
                format!("texture filter: {}", filter_name(wanted.filter))
            }
            Tap::Integrator => {
                wanted.integrator = match wanted.integrator {
                    Integrator::Direct => Integrator::Path,
                    Integrator::Path => Integrator::Direct,
                };
                format!("integrator: {}", integrator_name(wanted.integrator))
            }
            _ => continue,
        };
        notices.0.push(Notice::Text(said));
    }
    settings.set_if_neq(wanted);
    if input.count(Tap::Restart) > 0 {
        settings.set_changed();
    }
}

/// Exposure and tone map, which leave the film alone.
pub fn change_display(
    input: Res<Input>,
    film: Res<Film>,
    mut display: ResMut<Display>,
    mut notices: ResMut<Notices>,
) {
    let mut wanted = *display;
    for press in &input.taps {
        let thirds = if press.shift { 3.0 } else { 1.0 };
        match press.tap {
            Tap::AutoExposure => match exposure_for(&film) {
                Some(stops) => {
                    wanted.exposure = stops;
                    notices.0.push(told_exposure(stops));
                }
                None => notices.0.push(Notice::Text("nothing bright to expose for".to_owned())),
            },
            Tap::Brighter | Tap::Darker => {
                let thirds = if press.tap == Tap::Brighter { thirds } else { -thirds };
                wanted.exposure = step_exposure(wanted.exposure, thirds);
                notices.0.push(told_exposure(wanted.exposure));
            }
            Tap::ToneMap => {
                wanted.tone_map = wanted.tone_map.stepped(press.shift);
                notices.0.push(Notice::Text(format!("tone map: {}", tone_map_name(wanted.tone_map))));
            }
            _ => {}
        }
    }
    display.set_if_neq(wanted);
}

fn told_exposure(stops: f32) -> Notice {
    Notice::Text(format!("exposure: {stops:+.2} EV"))
}

/// `exposure` moved by `thirds` of a stop, on the grid of thirds: three steps are one stop exactly.
fn step_exposure(exposure: f32, thirds: f32) -> f32 {
    ((exposure * 3.0).round() + thirds).clamp(-90.0, 90.0) / 3.0
}

/// Whether old samples are kept while moving, and whether the first second is smoothed.
pub fn change_shown(
    input: Res<Input>,
    sides: Res<Sides>,
    mut shown: ResMut<Shown>,
    mut display: ResMut<Display>,
    mut notices: ResMut<Notices>,
) {
    let compares = input.is_held(Hold::Compare) || sides.are_split();
    if shown.hold_smoothing != compares {
        shown.hold_smoothing = compares;
    }
    let mut said = Vec::new();
    if input.count(Tap::KeepSamples) % 2 == 1 {
        shown.only_film = !shown.only_film;
        said.push(if shown.only_film { "old samples: left alone" } else { "old samples: kept while moving" });
    }
    if input.count(Tap::Smooth) % 2 == 1 {
        shown.never_smooth = !shown.never_smooth;
        said.push(if shown.never_smooth { "not smoothed" } else { "smoothed in the first second" });
    }
    if !said.is_empty() {
        // To be developed again.
        display.set_changed();
    }
    notices.0.extend(said.into_iter().map(|text| Notice::Text(text.to_owned())));
}

/// Saves the film, linear and as it is shown.
pub fn save_picture(world: &mut World) {
    if world.resource::<Input>().count(Tap::SavePicture) == 0 {
        return;
    }
    let recipe = recipe(world);
    let (film, display) = (world.resource::<Film>(), world.resource::<Display>());
    let origin = world.get_resource::<SceneOrigin>();
    let stem = origin.map_or_else(|| "scene".to_owned(), |origin| origin.source.name());
    let name = |n: u32, ending: &str| PathBuf::from(format!("{stem}_{n}.{ending}"));
    // Looked for and taken in one: two windows cannot get the same number.
    let take = |n: &u32| {
        !name(*n, "png").exists()
            && File::create_new(name(*n, "exr"))
                .map_or_else(|e| e.kind() != ErrorKind::AlreadyExists, |_| true)
    };
    let n = (1..u32::MAX).find(take).unwrap_or(u32::MAX);
    let saved =
        [save(&name(n, "exr"), film, display), save_with_recipe(&name(n, "png"), film, display, &recipe)];
    let said = match saved.into_iter().find_map(Result::err) {
        None => format!("saved {stem}_{n}.exr and .png where the program was started"),
        Some(error) => {
            // What took the number.
            let empty = std::fs::metadata(name(n, "exr")).is_ok_and(|file| file.len() == 0);
            drop(empty.then(|| std::fs::remove_file(name(n, "exr"))));
            format!("not saved: {error}")
        }
    };
    world.resource_mut::<Notices>().0.push(Notice::Text(said));
}

/// Pause and resume.
pub fn change_pause(input: Res<Input>, mut paused: ResMut<Paused>) {
    let flipped = paused.0 ^ (input.count(Tap::Pause) % 2 == 1);
    paused.set_if_neq(Paused(flipped));
}

/// Says the active camera as command line flags.
pub fn print_camera(
    input: Res<Input>,
    active: Res<ActiveCamera>,
    cameras: Query<(&Camera, &GlobalTransform, Option<&Lens>)>,
    mut notices: ResMut<Notices>,
) {
    if input.count(Tap::PrintCamera) > 0
        && let Ok((camera, pose, lens)) = cameras.get(active.0)
    {
        notices.0.push(Notice::Print(shell_line(&camera_flags(*camera, *pose, lens.copied()))));
    }
}

/// What the user calls it.
#[must_use]
pub fn filter_name(filter: Option<Filter>) -> &'static str {
    match filter {
        None => "as the file says",
        Some(Filter::Nearest) => "nearest",
        Some(Filter::Bilinear) => "bilinear",
    }
}

/// What the user calls it.
#[must_use]
pub fn integrator_name(integrator: Integrator) -> &'static str {
    match integrator {
        Integrator::Direct => "direct",
        Integrator::Path => "path",
    }
}

/// What the user calls it.
#[must_use]
pub fn tone_map_name(tone_map: ToneMap) -> &'static str {
    match tone_map {
        ToneMap::Clip => "clip",
        ToneMap::Neutral => "Khronos neutral",
        ToneMap::AgX => "AgX",
        ToneMap::Aces => "ACES",
    }
}

#[cfg(test)]
mod tests {
    use super::super::input::Press;
    use super::*;
    use glam::UVec2;
    use std::time::Instant;

    fn run(taps: &[(Tap, bool)], resize: Option<UVec2>) -> World {
        let press = |&(tap, shift): &(Tap, bool)| Press { shift, ..Press::from(tap) };
        let mut world = World::new();
        world.init_resource::<RenderSettings>();
        world.init_resource::<Display>();
        world.init_resource::<Notices>();
        world.init_resource::<Paused>();
        world.insert_resource(Film::new(UVec2::ONE, 0));
        world.clear_trackers();
        let mut input = Input::new(Instant::now());
        input.taps = taps.iter().map(press).collect();
        input.resize = resize;
        world.insert_resource(input);
        let mut schedule = Schedule::default();
        schedule.add_systems((change_settings, change_display, change_pause).chain());
        schedule.run(&mut world);
        world
    }

    #[test]
    fn three_thirds_are_a_stop() {
        let world = run(&[(Tap::Brighter, false), (Tap::Brighter, false), (Tap::Brighter, false)], None);
        assert_eq!(world.resource::<Display>().exposure, 1.0);
        let world = run(&[(Tap::Darker, true), (Tap::Brighter, false)], None);
        assert_eq!(world.resource::<Display>().exposure, -2.0 / 3.0);
    }

    #[test]
    fn exposure_and_tone_map_do_not_touch_the_settings_that_reset_the_film() {
        let world = run(&[(Tap::Brighter, true), (Tap::ToneMap, false), (Tap::Pause, false)], None);
        assert!(world.is_resource_changed::<Display>());
        assert!(!world.is_resource_changed::<RenderSettings>());
    }

    #[test]
    fn restart_marks_the_settings_although_they_stay_the_same() {
        let world = run(&[(Tap::Restart, false)], None);
        assert!(world.is_resource_changed::<RenderSettings>());
        assert_eq!(*world.resource::<RenderSettings>(), RenderSettings::default());
    }

    #[test]
    fn the_same_size_again_is_no_change() {
        let size = RenderSettings::default().size;
        assert!(!run(&[], Some(size)).is_resource_changed::<RenderSettings>());
        assert!(run(&[], Some(size + 1)).is_resource_changed::<RenderSettings>());
    }

    #[test]
    fn three_presses_bring_the_filter_back() {
        let press = (Tap::Filter, false);
        let filter = |taps: &[_]| run(taps, None).resource::<RenderSettings>().filter;
        assert_eq!(filter(&[press]), Some(Filter::Nearest));
        assert_eq!(filter(&[press, press]), Some(Filter::Bilinear));
        assert_eq!(filter(&[press, press, press]), None);
    }
}
