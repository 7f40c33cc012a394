//! Pictures that are to be kept or looked at closely are of the film alone: no old samples, nothing smoothed. And they know how
//! they were made, and their noise, which only the engine can say of this very moment.

use super::input::Input;
use super::keymap::Tap;
use super::recipe::recipe;
use crate::app::FrameBudget;
use crate::image::develop::develop;
use crate::image::recipe::Recipe;
use crate::image::{Display, Picture};
use crate::preview::Preview;
use crate::trace::Film;
use bevy_ecs::prelude::*;

/// A picture that the window has asked for.
#[derive(Clone, Debug)]
pub struct Shot {
    /// What for.
    pub tap: Tap,
    /// The picture.
    pub picture: Picture,
    /// How it is made again; empty if it shows anything but light.
    pub recipe: Recipe,
}

/// Those that the window has not got yet.
#[derive(Resource, Clone, Debug, Default)]
pub struct Plain(pub Vec<Shot>);

/// Develops what was asked for. Nothing of the frame may have changed before: it is what was shown last.
pub fn develop_plain(world: &mut World) {
    let is_shot = |tap: &Tap| matches!(tap, Tap::Screenshot | Tap::ScreenshotWithHud);
    let taps: Vec<Tap> =
        world.resource::<Input>().taps.iter().map(|press| press.tap).filter(is_shot).collect();
    for tap in taps {
        let picture = world.resource::<Picture>();
        let (picture, recipe) = if world.resource::<FrameBudget>().develop {
            let film = world.resource::<Film>();
            let rgba = develop(film, world.resource::<Preview>().film(), world.resource::<Display>());
            let picture = Picture { size: film.size(), rgba, version: picture.version };
            (picture, recipe(world))
        } else {
            (picture.clone(), Recipe::default())
        };
        world.resource_mut::<Plain>().0.push(Shot { tap, picture, recipe });
    }
}
