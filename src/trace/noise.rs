//! How wrong the picture still is, without a reference.
//!
//! Errors are relative to the brightness around: over all pixels, the root of the mean of
//! error² / (L² + (m / 10)²), where L is the mean luminance of the 7 x 7 pixels around and m the median
//! luminance of those that are not black. The constant keeps dark places from ruling it, and makes it
//! independent of exposure. The luminance of the pixel alone would not do for L: where few samples are bright,
//! as at the edge of a lamp, error and brightness are found by the same samples, and their ratio is too small
//! (by 0.6 at 16 samples in the Cornell box).

use super::Film;
use crate::scene::color::luminance;
use glam::{DVec3, UVec2};

/// How far from a pixel its surroundings reach.
const AROUND: usize = 3;

/// Estimated relative error of the picture's luminance, 0.02 for 2 %.
///
/// The film's halves A and B are independent, so (A − B) / 2 has the variance of their mean: it stands for the
/// error. Pixels that are dark in every sample count as exact.
///
/// `None` before both halves have a sample, or when all is black. It knows nothing of light that no
/// sample has seen yet.
#[must_use]
pub fn relative_noise(film: &Film) -> Option<f64> {
    let brightness = |c: DVec3| f64::from(luminance(c.as_vec3()));
    let size = film.size();
    let count = size.element_product() as usize;
    let (mut picture, mut errors) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for y in 0..size.y {
        for pixel in film.row(y) {
            let (a, b) = (brightness(pixel.half_mean(0)?), brightness(pixel.half_mean(1)?));
            picture.push(brightness(pixel.mean()));
            errors.push(0.5 * (a - b));
        }
    }
    relative(&errors, &picture, size)
}

/// What [`relative_noise`] estimates: the error of a picture against the truth, both as luminances in rows
/// from the top. `None` if the truth is black.
#[must_use]
pub fn relative_error(picture: &[f64], truth: &[f64], size: UVec2) -> Option<f64> {
    let errors: Vec<f64> = picture.iter().zip(truth).map(|(p, t)| p - t).collect();
    relative(&errors, truth, size)
}

fn relative(errors: &[f64], brightness: &[f64], size: UVec2) -> Option<f64> {
    let mut lit: Vec<f64> = brightness.iter().copied().filter(|&i| i > 0.0).collect();
    if lit.is_empty() {
        return None;
    }
    let middle = lit.len() / 2;
    let median = *lit.select_nth_unstable_by(middle, f64::total_cmp).1;
    let floor = (0.1 * median).powi(2);
    let around = means_around(brightness, size);
    let sum: f64 = errors.iter().zip(around).map(|(e, l)| e * e / (l * l + floor)).sum();
    Some((sum / errors.len() as f64).sqrt())
}

/// Means over squares around each pixel, as far as they lie in the picture: first along rows, then columns.
fn means_around(values: &[f64], size: UVec2) -> Vec<f64> {
    let (width, height) = (size.x as usize, size.y as usize);
    let reach = |at: usize, end: usize| at.saturating_sub(AROUND)..(at + AROUND + 1).min(end);
    let mut along = Vec::with_capacity(values.len());
    for row in values.chunks_exact(width) {
        for x in 0..width {
            let near = &row[reach(x, width)];
            along.push(near.iter().sum::<f64>() / near.len() as f64);
        }
    }
    let mut means = Vec::with_capacity(values.len());
    for y in 0..height {
        let rows = reach(y, height);
        let share = 1.0 / rows.len() as f64;
        means.resize((y + 1) * width, 0.0);
        for near in rows {
            let row = &along[near * width..][..width];
            for (mean, value) in means[y * width..].iter_mut().zip(row) {
                *mean += value * share;
            }
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_the_pixels_around() {
        for (width, height) in [(1, 1), (2, 9), (9, 2), (13, 11), (4, 4)] {
            let values: Vec<f64> = (0..width * height).map(|i| f64::from(i * i % 17)).collect();
            let means = means_around(&values, UVec2::new(width, height));
            for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
                let near: Vec<f64> = (0..width * height)
                    .filter(|i| (i % width).abs_diff(x) <= 3 && (i / width).abs_diff(y) <= 3)
                    .map(|i| values[i as usize])
                    .collect();
                let mean = near.iter().sum::<f64>() / near.len() as f64;
                assert!((means[(y * width + x) as usize] - mean).abs() < 1e-9, "{x} {y} of {width} {height}");
            }
        }
    }

    #[test]
    fn an_even_error_on_an_even_picture_is_what_it_is() {
        let (truth, picture) = (vec![2.0; 100], vec![2.2; 100]);
        let error = relative_error(&picture, &truth, UVec2::new(20, 5)).unwrap();
        assert!((error - 0.1 / 1.01f64.sqrt()).abs() < 1e-9, "{error}");
        assert_eq!(relative_error(&picture, &vec![0.0; 100], UVec2::new(20, 5)), None);
    }
}
