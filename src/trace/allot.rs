//! Where samples are needed: shares from the error that the first few show.
//!
//! Pixels are coloured as a chess board, and those of one colour get as many samples as the noise of the
//! other colour around them asks for. So how many a pixel gets does not depend on its own samples, and its mean
//! stays unbiased; a mean that ends when it looks good is not.

use super::Film;
use super::film::TILE;
use crate::scene::color::luminance;

/// Even samples per pixel before shares are given out.
pub const EVEN: u32 = 8;
/// Nobody gets less than this share, or more than that many: what the first samples have missed must have its
/// chance.
const LEAST: f64 = 0.05;
const MOST: f64 = 24.0;
/// What is so many times as bright as half of the picture may have larger errors: they are seen no better, and a
/// lamp's edge would get all samples.
const BRIGHT: f64 = 10.0;

/// Shares for [`Film::allot`]: where n samples leave an error of σ/n^a, with a = 0.75 for scrambled nets on
/// penumbrae, the mean squared error is least with n in proportion to σ^(1/(a + ½)).
///
/// Half the difference of the two halves stands for the error. A pixel that lacks one (all its samples may have
/// been dropped) says nothing.
#[must_use]
pub fn shares(film: &Film) -> Vec<[f32; 2]> {
    by_color(film, 1).into_iter().zip(by_color(film, 0)).map(|(a, b)| [a, b]).collect()
}

/// A share for each tile, from its pixels of one colour.
fn by_color(film: &Film, color: usize) -> Vec<f32> {
    let (mut variances, mut brightness) = (Vec::new(), Vec::new());
    for tile in film.tiles() {
        let (mut sum, mut light, mut count) = (0.0, 0.0, 0.0);
        for (i, pixel) in (0..).zip(tile.pixels()) {
            if tile.color(i) == color
                && let Some((a, b)) = pixel.half_mean(0).zip(pixel.half_mean(1))
            {
                sum += (a - b).length_squared();
                light += f64::from(luminance(pixel.mean().as_vec3()));
                count += 1.0;
            }
        }
        // A tile of one pixel has no other colour.
        variances.push(sum / f64::max(count, 1.0));
        brightness.push(light / f64::max(count, 1.0));
    }
    let mut sorted = brightness.clone();
    let middle = sorted.len() / 2;
    let bright = BRIGHT * *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    if bright > 0.0 {
        for (variance, light) in variances.iter_mut().zip(&brightness) {
            *variance /= (light / bright).powi(2) + 1.0;
        }
    }
    let across = film.size().x.div_ceil(TILE) as usize;
    let rows = variances.len() / across;
    let near = |i: usize, end: usize| i.saturating_sub(1)..(i + 2).min(end);
    let wanted = |i: usize| {
        let (x, y) = (i % across, i / across);
        let around = near(y, rows).flat_map(|y| near(x, across).map(move |x| y * across + x));
        // Neighbours count little: they are there for what few samples have missed.
        around.map(|k| variances[k] * if k == i { 1.0 } else { 0.02 }).sum::<f64>().powf(0.4)
    };
    let wanted: Vec<f64> = (0..variances.len()).map(wanted).collect();
    let mean = mean(film, &wanted);
    if !(mean > 0.0 && mean.is_finite()) {
        return vec![1.0; wanted.len()];
    }
    let clamped: Vec<f64> = wanted.iter().map(|w| (w / mean).clamp(LEAST, MOST)).collect();
    let mean = self::mean(film, &clamped);
    clamped.iter().map(|w| (w / mean) as f32).collect()
}

/// Over all pixels, of what each tile has.
fn mean(film: &Film, values: &[f64]) -> f64 {
    let weighted = film.tiles().iter().zip(values);
    let sum: f64 = weighted.map(|(t, v)| v * f64::from(t.size.element_product())).sum();
    sum / f64::from(film.size().element_product())
}
