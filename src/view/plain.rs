//! Pictures that are to be looked at closely are of the film alone: no old samples, nothing smoothed.

use super::input::Input;
use super::keymap::Tap;
use crate::app::FrameBudget;
use crate::image::develop::develop;
use crate::image::{Display, Picture};
use crate::preview::Preview;
use crate::trace::Film;
use bevy_ecs::prelude::*;

/// Pictures that the window has asked for, and what for.
#[derive(Resource, Clone, Debug, Default)]
pub struct Plain(pub Vec<(Tap, Picture)>);

/// Develops what was asked for.
pub fn develop_plain(
    input: Res<Input>,
    budget: Res<FrameBudget>,
    film: Res<Film>,
    preview: Res<Preview>,
    display: Res<Display>,
    picture: Res<Picture>,
    mut plain: ResMut<Plain>,
) {
    for press in &input.taps {
        if !matches!(press.tap, Tap::Screenshot | Tap::ScreenshotWithHud) {
            continue;
        }
        let made = if budget.develop {
            let rgba = develop(&film, preview.film(), &display);
            Picture { size: film.size(), rgba, version: picture.version }
        } else {
            picture.clone()
        };
        plain.0.push((press.tap, made));
    }
}
