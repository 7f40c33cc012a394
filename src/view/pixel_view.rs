//! What a pixel's colour stands for: light, or something about how it was found.

use super::controls::{Notice, Notices};
use super::edit::Editor;
use super::engine::Pending;
use super::input::Input;
use super::instrument::{Instrument, Seen};
use super::keymap::Tap;
use super::status::{percent, significant};
use crate::app::FrameBudget;
use crate::image::compare::LinearImage;
use crate::image::{Display, Picture};
use crate::open::SceneOrigin;
use crate::report::false_color::{DECADES, ErrorScale};
use crate::scene::color::{luminance, srgb_from_linear};
use crate::scene::{Playing, SceneBounds};
use crate::sync::{Redone, Traceable};
use crate::trace::first::{Cost, FirstSurface, Grid, costs, first_surfaces};
use crate::trace::{Film, RenderSettings, Viewpoint, noise};
use bevy_ecs::prelude::*;
use glam::{UVec2, Vec3};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// What is shown.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "the titles say it")]
pub enum PixelView {
    #[default]
    Beauty,
    Noise,
    Error,
    Samples,
    Boxes,
    Triangles,
    Normals,
    Albedo,
    Depth,
    NotFinite,
}

/// In the order of the key.
const ALL: [PixelView; 10] = [
    PixelView::Beauty,
    PixelView::Noise,
    PixelView::Error,
    PixelView::Samples,
    PixelView::Boxes,
    PixelView::Triangles,
    PixelView::Normals,
    PixelView::Albedo,
    PixelView::Depth,
    PixelView::NotFinite,
];

impl PixelView {
    /// What it is called.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Beauty => "picture",
            Self::Noise => "noise",
            Self::Error => "error against the reference",
            Self::Samples => "samples per pixel",
            Self::Boxes => "boxes per camera ray",
            Self::Triangles => "triangles per camera ray",
            Self::Normals => "normals",
            Self::Albedo => "base colour",
            Self::Depth => "depth",
            Self::NotFinite => "samples that are not finite",
        }
    }

    fn stepped(self, by: isize) -> Self {
        let here = ALL.iter().position(|&view| view == self).unwrap_or(0) as isize;
        ALL[(here + by).rem_euclid(ALL.len() as isize) as usize]
    }
}

/// What the colours stand for, if it is not light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Legend {
    /// What is shown.
    pub title: &'static str,
    /// The values at both ends of the colours, if it is a scale.
    pub range: Option<[String; 2]>,
    /// How many there are, if that is the question.
    pub count: Option<String>,
}

/// The legend of the picture that is shown; `None` if that is light.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub struct CurrentLegend(pub Option<Legend>);

/// First surfaces and costs, as far as somebody wanted to see them.
#[derive(Resource, Debug, Default)]
pub struct FirstHits {
    resets: u64,
    /// First surfaces behind the pixels.
    pub surfaces: Option<Grid<FirstSurface>>,
    costs: Option<Grid<Cost>>,
}

/// Time for refining grids in a frame.
const GRID_TIME: Duration = Duration::from_millis(25);

/// V: the next view, with Shift the one before.
pub fn choose_pixel_view(
    input: Res<Input>,
    instrument: Res<Instrument>,
    mut view: ResMut<PixelView>,
    mut notices: ResMut<Notices>,
) {
    let mut wanted = *view;
    for press in input.taps.iter().filter(|press| press.tap == Tap::PixelView) {
        let step = if press.shift { -1 } else { 1 };
        wanted = wanted.stepped(step);
        if wanted == PixelView::Error && instrument.reference.is_none() {
            wanted = wanted.stepped(step);
        }
        notices.0.push(Notice::Text(format!("view: {}", wanted.title())));
    }
    view.set_if_neq(wanted);
}

/// Why nobody knows the error of what is seen, if that is wanted.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unknown(Option<&'static str>);

/// Light is developed if it is wanted, or if nobody knows the error of what is seen.
pub fn choose_developed(
    (view, instrument): (Res<PixelView>, Res<Instrument>),
    (viewpoint, settings): (Res<Viewpoint>, Res<RenderSettings>),
    (editor, playing, origin): (Option<Res<Editor>>, Option<Res<Playing>>, Option<Res<SceneOrigin>>),
    film: Res<Film>,
    mut unknown: ResMut<Unknown>,
    mut budget: ResMut<FrameBudget>,
    mut display: ResMut<Display>,
) {
    *unknown = Unknown(None);
    if *view == PixelView::Error {
        let seen = Seen::now(editor.as_deref(), &settings, playing.as_deref(), origin.as_deref());
        unknown.0 = match &instrument.reference {
            Some(reference) => reference.differs(&viewpoint, &seen, film.size()),
            None => Some("there is no reference: the picture"),
        };
    }
    let develop = *view == PixelView::Beauty || unknown.0.is_some();
    if budget.develop != develop {
        budget.develop = develop;
        // The picture is to be developed again.
        display.set_changed();
    }
}

/// Brings the grids that are needed nearer to completion.
pub fn refine_first_hits(
    inputs: Traceable,
    budget: Res<FrameBudget>,
    redone: Res<Redone>,
    view: Res<PixelView>,
    depth_wanted: Res<DepthWanted>,
    mut first: ResMut<FirstHits>,
    mut pending: ResMut<Pending>,
) {
    use PixelView::{Albedo, Boxes, Depth, Normals, Triangles};
    let scene = inputs.scene();
    let needs_surfaces = matches!(*view, Normals | Albedo | Depth) || depth_wanted.0;
    let needs_costs = matches!(*view, Boxes | Triangles);
    if first.resets != redone.resets {
        *first = FirstHits { resets: redone.resets, ..FirstHits::default() };
    } else if !(needs_surfaces || needs_costs) {
        return;
    }
    let start = Instant::now();
    let keep_going = || start.elapsed() < GRID_TIME && !budget.interrupt.load(Ordering::Relaxed);
    let size = scene.settings.size.max(UVec2::ONE);
    if needs_surfaces && first.surfaces.as_ref().is_none_or(|grid| !grid.is_complete()) {
        let grid = first.surfaces.get_or_insert_with(|| Grid::new(size));
        grid.refine(keep_going, |places, values| first_surfaces(&scene, places, values));
        pending.0 |= !grid.is_complete();
    }
    if needs_costs && first.costs.as_ref().is_none_or(|grid| !grid.is_complete()) {
        let grid = first.costs.get_or_insert_with(|| Grid::new(size));
        grid.refine(keep_going, |places, values| costs(&scene, places, values));
        pending.0 |= !grid.is_complete();
    }
}

/// Whether something is drawn into the scene, behind its surfaces.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DepthWanted(pub bool);

/// Makes the picture of anything but light.
pub fn develop_pixel_view(
    (view, budget, unknown): (Res<PixelView>, Res<FrameBudget>, Res<Unknown>),
    film: Res<Film>,
    first: Res<FirstHits>,
    bounds: Option<Res<SceneBounds>>,
    instrument: Res<Instrument>,
    mut legend: ResMut<CurrentLegend>,
    mut picture: ResMut<Picture>,
) {
    if budget.develop {
        legend.set_if_neq(CurrentLegend(unknown.0.map(|title| Legend { title, ..Legend::default() })));
        return;
    }
    if !(view.is_changed() || film.is_changed() || first.is_changed()) {
        return;
    }
    let size = film.size();
    let radius = bounds.map_or(1.0, |bounds| bounds.radius as f32);
    let Some((colors, range)) = colors(*view, &film, &first, &instrument, radius) else { return };
    let count = (*view == PixelView::NotFinite).then(|| match film.dropped() {
        0 => "none".to_owned(),
        count => format!("{count}, in the red pixels"),
    });
    legend.set_if_neq(CurrentLegend(Some(Legend { title: view.title(), range, count })));
    picture.size = size;
    picture.rgba.resize(colors.len() * 4, 255);
    for (rgba, color) in picture.rgba.chunks_exact_mut(4).zip(colors) {
        rgba[..3].copy_from_slice(&color);
        rgba[3] = 255;
    }
    picture.version += 1;
}

type Colors = (Vec<[u8; 3]>, Option<[String; 2]>);

/// `None` while it cannot be told.
fn colors(
    view: PixelView,
    film: &Film,
    first: &FirstHits,
    instrument: &Instrument,
    radius: f32,
) -> Option<Colors> {
    let surfaces = || first.surfaces.as_ref().filter(|grid| grid.size() == film.size()).map(Grid::cells);
    let costs = || first.costs.as_ref().filter(|grid| grid.size() == film.size()).map(Grid::cells);
    let count = film.size().element_product() as usize;
    Some(match view {
        PixelView::Beauty => return None,
        PixelView::Noise => {
            let mut map = noise::map(film);
            map.resize(count, 1.0);
            errors(&map)
        }
        PixelView::Error => {
            let truth = &instrument.reference.as_ref().filter(|r| r.image.size == film.size())?.image;
            let picture = LinearImage::of(film);
            let relative = |(a, b): (&Vec3, &Vec3)| {
                let error = ((*a - *b).length_squared() / 3.0).sqrt();
                error / (luminance(*b) + 1e-3)
            };
            errors(&picture.pixels.iter().zip(&truth.pixels).map(relative).collect::<Vec<f32>>())
        }
        PixelView::Samples => {
            let counts: Vec<f32> =
                (0..film.size().y).flat_map(|y| film.row(y)).map(|pixel| pixel.count() as f32).collect();
            linear(&counts)
        }
        PixelView::Boxes => linear(&costs()?.iter().map(|cost| cost.boxes as f32).collect::<Vec<_>>()),
        PixelView::Triangles => {
            linear(&costs()?.iter().map(|cost| cost.triangles as f32).collect::<Vec<_>>())
        }
        PixelView::Normals => {
            let color = |normal: Vec3| {
                if normal == Vec3::ZERO {
                    [0; 3]
                } else {
                    ((normal * 0.5 + 0.5) * 255.0).to_array().map(|c| c as u8)
                }
            };
            (surfaces()?.iter().map(|s| color(s.normal)).collect(), None)
        }
        PixelView::Albedo => {
            let color = |albedo: Vec3| albedo.to_array().map(|c| (srgb_from_linear(c) * 255.0 + 0.5) as u8);
            (surfaces()?.iter().map(|s| color(s.albedo)).collect(), None)
        }
        PixelView::Depth => {
            let depths: Vec<f32> = surfaces()?.iter().map(|s| s.depth).collect();
            near_bright(&depths, radius)
        }
        PixelView::NotFinite => (not_finite(film), None),
    })
}

/// Relative errors, logarithmic over three decades up to the one that hardly any exceeds, at most 100 %.
fn errors(values: &[f32]) -> Colors {
    let all: Vec<f64> = values.iter().map(|&value| f64::from(value)).collect();
    let most = ErrorScale::of(&[all]).most.min(1.0);
    let scale = ErrorScale { most };
    let range = Some([most / 10f64.powi(DECADES), most].map(percent));
    (values.iter().map(|&value| scale.color(f64::from(value))).collect(), range)
}

/// Counts, from none to the 99.9th percentile, so that a few cannot darken all others.
fn linear(values: &[f32]) -> Colors {
    let mut sorted = values.to_vec();
    let rank = (sorted.len().saturating_sub(1) * 999).div_ceil(1000);
    let most = if sorted.is_empty() { 1.0 } else { *sorted.select_nth_unstable_by(rank, f32::total_cmp).1 };
    let most = most.max(1.0);
    // The scale of errors has three decades; along it counts are to be even.
    let scale = ErrorScale { most: 1.0 };
    let even = |value: f32| 10f64.powf(3.0 * (f64::from(value / most).min(1.0) - 1.0));
    let range = Some(["0".to_owned(), format!("{most:.0}")]);
    (values.iter().map(|&value| scale.color(even(value))).collect(), range)
}

/// Near is bright, what is farther than the scene is wide is dark, and nothing is black.
fn near_bright(depths: &[f32], radius: f32) -> Colors {
    let nearest = depths.iter().copied().fold(f32::INFINITY, f32::min);
    let farthest = depths.iter().copied().filter(|d| d.is_finite()).fold(nearest, f32::max);
    let span = (farthest - nearest).max(1e-3 * radius).max(f32::MIN_POSITIVE);
    let grey = |depth: f32| {
        if depth.is_finite() { 255 - ((depth - nearest) / span * 220.0) as u8 } else { 0 }
    };
    // Nothing is told that both have in common: as many digits as tell them apart.
    let digits = (farthest / span.max(f32::MIN_POSITIVE)).log10().ceil().clamp(0.0, 4.0) as u32 + 2;
    let range = nearest
        .is_finite()
        .then(|| [nearest, farthest].map(|depth| significant(f64::from(depth), digits.min(6))));
    (depths.iter().map(|&depth| [grey(depth); 3]).collect(), range)
}

/// A dim picture with red where samples were dropped.
fn not_finite(film: &Film) -> Vec<[u8; 3]> {
    let size = film.size();
    let mut colors = vec![[0; 3]; size.element_product() as usize];
    for tile in film.tiles() {
        for (i, pixel) in (0..).zip(tile.pixels()) {
            let wanted = u64::from(tile.next_of(i as usize) - film.first_sample());
            let place = tile.origin + UVec2::new(i % tile.size.x, i / tile.size.x);
            let dim = (srgb_from_linear(luminance(pixel.mean().as_vec3())) * 90.0) as u8;
            let dropped = pixel.count() < wanted;
            colors[(place.y * size.x + place.x) as usize] = if dropped { [255, 40, 30] } else { [dim; 3] };
        }
    }
    colors
}

#[cfg(test)]
mod tests;
