//! Where samples are needed: shares from the error that the first few show.
//!
//! Pixels are coloured as a chess board, and those of one colour get as many samples as the noise of the
//! other colour around them asks for. So how many a pixel gets does not depend on its own samples, and its mean
//! stays unbiased; a mean that ends when it looks good is not.

use super::Film;
use crate::scene::color::luminance;
use glam::DVec3;

/// Even samples per pixel before shares are given out.
pub const EVEN: u32 = 3;
/// Nobody gets less than this share, or more than that many: what the first samples have missed must have its
/// chance.
const LEAST: f64 = 0.05;
const MOST: f64 = 200.0;
/// What is so many times as bright as half of the picture may have larger errors: they are seen no better, and a
/// lamp's edge would get all samples.
const BRIGHT: f64 = 10.0;

/// Shares for [`Film::allot`]: where n samples leave an error of σ/n^a, with a = 0.75 for scrambled nets on
/// penumbrae and edges, the mean squared error is least with n in proportion to σ^(1/(a + ½)).
///
/// Half the difference of the two halves stands for the error. A pixel that lacks one (all its samples may have
/// been dropped) says nothing.
#[must_use]
pub fn shares(film: &Film) -> Vec<f32> {
    let [width, height] = film.size().to_array().map(|n| n as usize);
    let mut variances = vec![0.0; width * height];
    let mut means = vec![DVec3::ZERO; width * height];
    for y in 0..height {
        for (x, pixel) in film.row(y as u32).enumerate() {
            if let Some((a, b)) = pixel.half_mean(0).zip(pixel.half_mean(1)) {
                variances[y * width + x] = (a - b).length_squared();
                means[y * width + x] = pixel.mean();
            }
        }
    }
    let brightness: Vec<f64> = means.iter().map(|mean| f64::from(luminance(mean.as_vec3()))).collect();
    let mut sorted = brightness.clone();
    let middle = sorted.len() / 2;
    let bright = BRIGHT * *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    if bright > 0.0 {
        for ((variance, mean), light) in variances.iter_mut().zip(&mut means).zip(&brightness) {
            let dimmed = (light / bright).powi(2) + 1.0;
            *variance /= dimmed;
            *mean /= dimmed.sqrt();
        }
    }
    let wanted: Vec<f64> = (0..width * height)
        .map(|i| {
            let (x, y) = ((i % width) as i64, (i / width) as i64);
            let (mut sum, mut weights) = (0.0, 0.0);
            let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for (dx, dy, weight) in AROUND {
                let (x, y) = (x + dx, y + dy);
                if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
                    let other = y as usize * width + x as usize;
                    sum += weight * variances[other];
                    weights += weight;
                    if weight == 1.0 {
                        (low, high) = (low.min(means[other]), high.max(means[other]));
                    }
                }
            }
            // A picture of one pixel has no others.
            if weights == 0.0 {
                return 1.0;
            }
            (sum / weights + EDGE * (high - low).length_squared()).powf(0.4)
        })
        .collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let average = mean(&wanted);
    if !(average > 0.0 && average.is_finite()) {
        return vec![1.0; wanted.len()];
    }
    let clamped: Vec<f64> = wanted.iter().map(|w| (w / average).clamp(LEAST, MOST)).collect();
    let average = mean(&clamped);
    clamped.iter().map(|w| (w / average) as f32).collect()
}

/// Pixels of the other colour, near ones and, for what few samples have missed, some farther ones; and what each counts.
const AROUND: [(i64, i64, f64); 16] = [
    (-1, 0, 1.0),
    (1, 0, 1.0),
    (0, -1, 1.0),
    (0, 1, 1.0),
    (-3, 0, FAR),
    (3, 0, FAR),
    (0, -3, FAR),
    (0, 3, FAR),
    (-2, -1, FAR),
    (-2, 1, FAR),
    (2, -1, FAR),
    (2, 1, FAR),
    (-1, -2, FAR),
    (-1, 2, FAR),
    (1, -2, FAR),
    (1, 2, FAR),
];
const FAR: f64 = 0.1;
/// What a step between two neighbours counts, squared: an edge goes through the pixel, perhaps just so that both halves
/// agree. As measured, like the two above.
const EDGE: f64 = 0.06;
