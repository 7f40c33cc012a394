//! A noisy picture made easier to look at: means over neighbours that show the same smooth surface, as wide as
//! the noise is large.
//!
//! À-trous passes, first along rows, then along columns; a neighbour counts by its plane, its normal and
//! its light, the last in units of the noise. Base colours are divided out before, so textures stay sharp. Pixels
//! at edges are left alone. After H. Dammertz et al., "Edge-Avoiding À-Trous Wavelet Transform for fast Global
//! Illumination Filtering", HPG 2010, and C. Schied et al., "Spatiotemporal Variance-Guided Filtering", HPG 2017.

use crate::scene::color::luminance;
use crate::trace::Film;
use crate::trace::camera::Sheet;
use crate::trace::place::Place;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Distances of the neighbours in each pass.
const STEPS: [isize; 4] = [1, 2, 4, 8];
/// Light may differ by so many standard deviations.
const DEVIATIONS: f32 = 4.0;
/// Noise below this share of a pixel's light is none: it is left as it is.
const FAINT: f32 = 0.003;
/// How far around a pixel its noise is looked for.
const AROUND: isize = 2;

/// What decides whether two pixels show the same surface.
#[derive(Clone, Copy)]
struct Guide {
    position: Vec3,
    facet: Vec3,
    normal: Vec3,
    /// 0: not to be mixed with others.
    thing: u32,
    pixel: f32,
}

impl Guide {
    fn new(place: &Place, sheet: &Sheet) -> Self {
        // Lamps and what is beyond the scene have no noise.
        let mixes = !place.edge && place.is_instance();
        Self {
            position: place.position,
            facet: place.facet,
            normal: Vec3::from_array(place.normal.map(f32::from)) / 127.0,
            thing: if mixes { place.thing + 1 } else { 0 },
            pixel: sheet.pixel(sheet.own(place.position).z),
        }
    }

    /// How much a neighbour at `step` pixels is of the same surface, in 0..=1.
    #[inline(always)]
    fn alike(&self, other: &Self, step: f32) -> f32 {
        if self.thing != other.thing {
            return 0.0;
        }
        let away = self.facet.dot(other.position - self.position).abs() / (2.0 * step * self.pixel);
        let along = self.normal.dot(other.normal).max(0.0);
        let along = along * along * along * along;
        (1.0 - away).max(0.0) * along * along * along
    }
}

/// The picture of `cells`, smoothed; `None` if there was no time for it.
pub fn smooth(
    film: &Film,
    cells: &[Vec4],
    places: &[Place],
    sheet: &Sheet,
    keep_going: impl Fn() -> bool + Sync,
) -> Option<Vec<Vec4>> {
    let [width, height] = film.size().to_array().map(|n| n as usize);
    let guides: Vec<Guide> = places.par_iter().map(|place| Guide::new(place, sheet)).collect();
    // Light without the base colour, and the variance of its luminance.
    let mut light: Vec<Vec4> = cells
        .par_iter()
        .zip(places)
        .map(|(cell, place)| (cell.truncate() / place.base()).extend(0.0))
        .collect();
    let variances = variances(film, cells, places, &guides, &light, &keep_going)?;
    light.iter_mut().zip(variances).for_each(|(light, variance)| light.w = variance);
    let mut spare = light.clone();
    for step in STEPS {
        for stride in [1, width] {
            let (from, guides) = (&light, &guides);
            spare.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
                // A key was pressed: nobody will see this.
                if !keep_going() {
                    return;
                }
                for (x, out) in row.iter_mut().enumerate() {
                    let (at, end) = if stride == 1 { (x, width) } else { (y, height) };
                    *out = mean(from, guides, y * width + x, stride, (at, end), step);
                }
            });
            std::mem::swap(&mut spare, &mut light);
        }
    }
    if !keep_going() {
        return None;
    }
    let mut smoothed = light;
    smoothed.par_iter_mut().zip(cells).zip(places).for_each(|((out, cell), place)| {
        *out = (out.truncate() * place.base()).extend(cell.w);
    });
    Some(smoothed)
}

/// A pixel's mean with its two neighbours at `step` along a row (`stride` 1) or a column.
#[inline(always)]
fn mean(
    light: &[Vec4],
    guides: &[Guide],
    index: usize,
    stride: usize,
    (at, end): (usize, usize),
    step: isize,
) -> Vec4 {
    let (here, guide) = (light[index], &guides[index]);
    let brightness = luminance(here.truncate());
    if guide.thing == 0 || here.w <= (FAINT * brightness).powi(2) {
        return here;
    }
    let (mut sum, mut weights) = (here * 0.5, 0.5);
    sum.w = here.w * 0.25;
    let reach = 1.0 / (DEVIATIONS * here.w.sqrt());
    for side in [-step, step] {
        let Some(other) = at.checked_add_signed(side).filter(|&other| other < end) else { continue };
        let other = (index + other * stride) - at * stride;
        let there = light[other];
        let off = (luminance(there.truncate()) - brightness).abs() * reach;
        let weight = 0.25 * guide.alike(&guides[other], step.unsigned_abs() as f32) * (1.0 - off).max(0.0);
        sum += (there.truncate() * weight).extend(there.w * weight * weight);
        weights += weight;
    }
    (sum.truncate() / weights).extend(sum.w / (weights * weights))
}

/// Of the luminance of each pixel's light: by the film's two halves where both have samples, else by its
/// neighbours; meant over those of the same surface. `None` if there was no time.
fn variances(
    film: &Film,
    cells: &[Vec4],
    places: &[Place],
    guides: &[Guide],
    light: &[Vec4],
    keep_going: &(impl Fn() -> bool + Sync),
) -> Option<Vec<f32>> {
    let [width, height] = film.size().to_array().map(|n| n as usize);
    let has_halves = film.complete_samples() >= 2 && !film.has_first_shares();
    let mut own = vec![0.0; cells.len()];
    if has_halves {
        own.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            for ((x, own), pixel) in row.iter_mut().enumerate().zip(film.row(y as u32)) {
                let Some((a, b)) = pixel.half_mean(0).zip(pixel.half_mean(1)) else { continue };
                let index = y * width + x;
                // Old samples have no noise that we would know of.
                let share = pixel.count() as f32 / cells[index].w.max(1.0);
                let half = luminance((a - b).as_vec3() / places[index].base()) * 0.5 * share;
                *own = half * half;
            }
        });
    }
    let mut variances = vec![0.0; cells.len()];
    variances.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
        if !keep_going() {
            return;
        }
        let reach =
            |at: usize, end: usize| at.saturating_sub(AROUND as usize)..(at + AROUND as usize + 1).min(end);
        for (x, variance) in row.iter_mut().enumerate() {
            let guide = &guides[y * width + x];
            if guide.thing == 0 {
                continue;
            }
            let (mut count, mut sum, mut squares, mut halves) = (0.0, 0.0, 0.0, 0.0);
            for v in reach(y, height) {
                for other in reach(x, width).map(|u| v * width + u) {
                    if guides[other].thing == guide.thing {
                        let l = luminance(light[other].truncate());
                        (count, sum, squares, halves) =
                            (count + 1.0, sum + l, squares + l * l, halves + own[other]);
                    }
                }
            }
            let mean = sum / count;
            *variance = if has_halves { halves / count } else { (squares / count - mean * mean).max(0.0) };
        }
    });
    keep_going().then_some(variances)
}
