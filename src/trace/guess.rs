//! Pixels that there was no time to look at, guessed from those beside them.
//!
//! Light spreads from what is known, ring by ring, first along surfaces, without their base colours; what no neighbour is
//! a part of takes that of any.

use super::camera::Sheet;
use super::film::Pixel;
use super::place::{Place, places};
use super::{Film, TraceScene};
use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;

/// Planes go on if they are no farther off than so many pixels.
const NEAR: f32 = 2.0;

/// Mean radiances, rows from the top; those of pixels without samples guessed by what they show of `scene`. (Those of which all
/// samples were dropped stay black.)
#[must_use]
pub fn guessed(film: &Film, scene: &TraceScene) -> Vec<Vec3> {
    let size = film.size();
    let width = size.x as usize;
    let mut shown = vec![Place::unknown(); width * size.y as usize];
    shown.par_chunks_exact_mut(width).zip(0..size.y).for_each(|(row, y)| {
        let middles: Vec<Vec2> = (0..size.x).map(|x| Vec2::new(x as f32, y as f32) + 0.5).collect();
        places(scene, &middles, row);
    });
    let sheet = scene.viewpoint.sheet(size);
    let means = means(film);
    let mut light: Vec<Vec3> = means.iter().zip(&shown).map(|(mean, place)| mean / place.base()).collect();
    let looked_at = looked_at(film);
    let mut known = looked_at.clone();
    fill(&mut light, &mut known, size, |at, there| is_one(&shown[at], &shown[there], &sheet));
    fill(&mut light, &mut known, size, |_, _| true);
    let all = means.iter().zip(&light).zip(shown.iter().zip(looked_at));
    all.map(|((mean, light), (place, known))| if known { *mean } else { light * place.base() }).collect()
}

/// The same where nobody knows what they show.
#[must_use]
pub fn guessed_blindly(film: &Film) -> Vec<Vec3> {
    let (mut means, mut known) = (means(film), looked_at(film));
    fill(&mut means, &mut known, film.size(), |_, _| true);
    means
}

fn pixels(film: &Film) -> impl Iterator<Item = &Pixel> {
    (0..film.size().y).flat_map(|y| film.row(y))
}

/// Of the samples that there are; black where there is none.
pub(crate) fn means(film: &Film) -> Vec<Vec3> {
    pixels(film).map(|pixel| pixel.mean().as_vec3()).collect()
}

fn looked_at(film: &Film) -> Vec<bool> {
    pixels(film).map(|pixel| pixel.count() > 0).collect()
}

fn is_one(here: &Place, there: &Place, sheet: &Sheet) -> bool {
    here.continues(there, NEAR * sheet.pixel(sheet.own(here.position).z.max(0.0)))
}

/// Gives each pixel that is not `known` the mean of those beside it that are and are alike, one ring after the other. Then it is
/// known too.
fn fill(pixels: &mut [Vec3], known: &mut [bool], size: UVec2, alike: impl Fn(usize, usize) -> bool) {
    let alike = &alike;
    let beside = |at: usize| {
        let (at, across) = (at as u32, size.x);
        let (x, y) = (at % across, at / across);
        let there = [
            (x > 0).then(|| at - 1),
            (x + 1 < across).then(|| at + 1),
            (y > 0).then(|| at - across),
            (y + 1 < size.y).then(|| at + across),
        ];
        there.into_iter().flatten().map(|at| at as usize)
    };
    let mut waits: Vec<bool> = known.iter().map(|known| !known).collect();
    let is_next = |at: usize| beside(at).any(|there| known[there] && alike(at, there));
    let mut ring: Vec<usize> = (0..pixels.len()).filter(|&at| waits[at] && is_next(at)).collect();
    while !ring.is_empty() {
        ring.iter().for_each(|&at| waits[at] = false);
        for &at in &ring {
            let around = beside(at).filter(|&there| known[there] && alike(at, there));
            let (sum, count) =
                around.fold((Vec3::ZERO, 0.0), |(sum, count), there| (sum + pixels[there], count + 1.0));
            pixels[at] = sum / count;
        }
        ring.iter().for_each(|&at| known[at] = true);
        let after = |&at: &usize| beside(at).filter(move |&next| alike(next, at));
        let mut next: Vec<usize> = ring.iter().flat_map(after).filter(|&at| waits[at]).collect();
        next.sort_unstable();
        next.dedup();
        ring = next;
    }
}
