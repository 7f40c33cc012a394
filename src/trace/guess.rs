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
/// Base colours below that are taken for it: at the border of a dark texel there are samples of a bright one.
const DARK: f32 = 0.1;

/// Mean radiances, rows from the top; those of pixels without samples guessed by what they show of `scene`.
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
    let bases: Vec<Vec3> = shown.iter().map(|place| place.base().max(Vec3::splat(DARK))).collect();
    let (mut means, mut known) = (means(film), looked_at(film));
    let is_one = |at: usize, there: usize| is_one(&shown[at], &shown[there], &sheet);
    fill(&mut means, &bases, &mut known, size, is_one);
    fill(&mut means, &bases, &mut known, size, |_, _| true);
    means
}

/// The same where nobody knows what they show.
#[must_use]
pub fn guessed_blindly(film: &Film) -> Vec<Vec3> {
    let (mut means, mut known) = (means(film), looked_at(film));
    let bases = vec![Vec3::ONE; means.len()];
    fill(&mut means, &bases, &mut known, film.size(), |_, _| true);
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

/// Gives each pixel that is not `known` the light of those beside it that are and are alike, on its own base colour, one ring
/// after the other. Then it is known too.
fn fill(
    pixels: &mut [Vec3],
    bases: &[Vec3],
    known: &mut [bool],
    size: UVec2,
    alike: impl Fn(usize, usize) -> bool,
) {
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
            // Together: the dark ones say little of the light.
            let (sum, base) = around.fold((Vec3::ZERO, Vec3::ZERO), |(sum, base), there| {
                (sum + pixels[there], base + bases[there])
            });
            pixels[at] = bases[at] * (sum / base);
        }
        ring.iter().for_each(|&at| known[at] = true);
        let after = |&at: &usize| beside(at).filter(move |&next| alike(next, at));
        let mut next: Vec<usize> = ring.iter().flat_map(after).filter(|&at| waits[at]).collect();
        next.sort_unstable();
        next.dedup();
        ring = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bright_sample_of_a_dark_texel_does_not_dazzle_its_neighbours() {
        // Dark with a sample of what is beside it, white without one, white.
        let bases = [DARK, 0.8, 0.8].map(Vec3::splat);
        let mut pixels = [0.64, 0.0, 0.64].map(Vec3::splat);
        fill(&mut pixels, &bases, &mut [true, false, true], UVec2::new(3, 1), |_, _| true);
        assert!((pixels[1].x / 0.64 - 1.78).abs() < 0.01, "{}: means of ratios make 2.3 of it", pixels[1]);
    }
}
