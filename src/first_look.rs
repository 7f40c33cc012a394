//! What a small picture of a fresh scene says about it: too dark, too bright, or lit by hardly anything.

use crate::app::App;
use crate::image::Display;
use crate::image::develop::suggest_exposure;
use crate::load::{ADDED_LIGHT, Kind, LoadReport, light_for};
use crate::scene::Light;
use crate::scene::color::luminance;
use crate::sync;
use crate::trace::Film;
use glam::{UVec2, Vec2, Vec3};

/// Size of that picture: always the same, so that the window and `render` agree.
const PROBE: UVec2 = UVec2::new(96, 64);
const PROBE_SAMPLES: u32 = 4;
/// A surface is dark below this share of what the bright ones show ...
const DARK: f32 = 0.01;
/// ... and a scene if this share of its surfaces is.
const MOSTLY: f32 = 0.7;
/// What glows by less than this share of its colour would show as much of itself in ordinary light: it is no lamp.
const FAINT: f32 = 0.25;
/// Stops that a picture is darkened at most: full sunlight takes 17. What is brighter than so much is meant to be blinding.
const MOST: f32 = 24.0;
/// Share of the seen surfaces that may be dark because their pixels are at an edge, or black parts of what shines; ...
const OUTLINE: f32 = 0.1;
/// ... and that may be dark though they neither shine nor are beside a lit one.
const SPECKS: f32 = 0.01;

/// Lights the scene if nothing but its emissive surfaces shines and these hardly reach any other, and chooses
/// the exposure if nobody has. Each decision goes into the report.
pub(crate) fn settle(app: &mut App, report: &mut LoadReport, file: &str, choose_exposure: bool) {
    let mut picture = app.probe(PROBE, PROBE_SAMPLES);
    if app.world.query::<&Light>().iter(&app.world).next().is_none() && is_mostly_dark(app, &picture) {
        light_for(&mut app.world);
        app.build();
        picture = app.probe(PROBE, PROBE_SAMPLES);
        report.add(
            Kind::Decided,
            file,
            format!("its emissive surfaces light hardly anything; {ADDED_LIGHT}"),
        );
    }
    if !choose_exposure {
        return;
    }
    match suggest_exposure(&picture).map(|stops| stops.max(-MOST)) {
        Some(0.0) => {}
        Some(stops) => {
            app.world.resource_mut::<Display>().exposure = stops;
            let what = format!("the picture would be far off: exposed by {stops:+.2} EV");
            report.add(Kind::Decided, file, what);
        }
        None => report.add(Kind::Decided, file, "no light reaches the camera: the picture is black"),
    }
}

/// Whether most of the surfaces that the camera sees, and that do not shine themselves, are black beside the
/// bright ones.
fn is_mostly_dark(app: &App, picture: &Film) -> bool {
    let scene = sync::traceable(&app.world);
    let size = picture.size();
    let width = size.x as usize;
    let mut seen: Vec<Option<(f32, bool)>> = Vec::new();
    let mut faint = 0.0;
    for y in 0..size.y {
        for (x, pixel) in (0..size.x).zip(picture.row(y)) {
            let ray = scene.viewpoint.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5), size);
            seen.push(scene.first_seen(&ray).map(|hit| {
                let (material, shown) =
                    (&scene.surface_at(&hit).1.material, luminance(pixel.mean().as_vec3()));
                let shines = material.emission != Vec3::ZERO;
                // A picture of the glow was painted by somebody.
                let is_plain = !material.unlit && material.emission_texture.is_none();
                faint += f32::from(shines && is_plain && shown < FAINT * luminance(material.base_color));
                (shown, shines)
            }));
        }
    }
    let surfaces = || seen.iter().flatten();
    let all = surfaces().count() as f32;
    // Programs for modelling write down a faint glow that never was to be the only light.
    if faint > (1.0 - OUTLINE) * all {
        return true;
    }
    let mut lit: Vec<f32> = surfaces().map(|&(l, _)| l).filter(|&l| l > 0.0).collect();
    if lit.is_empty() {
        return surfaces().next().is_some();
    }
    // Not the very brightest: a lamp in the picture outshines all that it lights.
    let rank = (lit.len() - 1) * 9 / 10;
    let least = DARK * *lit.select_nth_unstable_by(rank, f32::total_cmp).1;
    // Where the texture of an emissive surface is black it is a surface like others.
    let others = surfaces().filter(|&&(l, shines)| !shines || l <= least).count() as f32;
    let is_dark = |i: usize| seen.get(i).copied().flatten().is_some_and(|(l, _)| l <= least);
    let dark = (0..seen.len()).filter(|&i| is_dark(i)).count() as f32;
    // The outline of a glowing thing alone is no scene that wants light.
    let within = |&i: &usize| {
        let is_plain = seen[i].is_some_and(|(_, shines)| !shines);
        let inside = i >= width && (1..width - 1).contains(&(i % width));
        is_plain && inside && [i, i + 1, i - 1, i + width, i - width].into_iter().all(is_dark)
    };
    let inner = (0..seen.len()).filter(within).count() as f32;
    (inner > SPECKS * all || dark > OUTLINE * all) && dark > MOSTLY * others
}
