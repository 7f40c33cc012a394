//! Whether the noise number is right: many runs, each time beside the true error in the same measure.

use super::measure::{Tracing, traceable};
use super::statistics::{mean_and_deviation, percentile};
use crate::app::App;
use crate::image::compare::LinearImage;
use crate::scene::color::luminance;
use crate::trace::noise::{relative_error, relative_noise};
use crate::trace::{Film, RenderSettings};
use glam::DVec3;
use serde::Serialize;
use std::sync::atomic::AtomicBool;

/// The noise number over the true error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NoiseCheck {
    /// How many runs.
    pub runs: usize,
    /// Samples per pixel of each.
    pub samples: u32,
    /// Mean of the ratios.
    pub mean: f64,
    /// Standard error of that mean.
    pub mean_error: f64,
    /// Standard deviation of a single run.
    pub deviation: f64,
    /// 5th, 50th and 95th percentile.
    pub percentiles: [f64; 3],
    /// Half the difference of the halves over the true error, root mean squares over all pixels and runs,
    /// without any weights: what theory says is 1.
    pub unweighted: f64,
    /// Root mean square of the true relative errors.
    pub true_error: f64,
    /// Each run's ratio.
    pub ratios: Vec<f64>,
}

/// Runs to make.
pub const RUNS: u32 = 100;
/// Seeds from here on, so that no run is one of those whose curves are drawn.
const FIRST_SEED: u32 = 1000;
/// Samples per pixel of a run, at least and at most.
const SAMPLES: (f64, f64) = (2.0, 64.0);

/// Makes the runs, so that they take `seconds` in all; fewer if interrupted, `None` if hardly any.
pub fn check(
    app: &App,
    settings: &RenderSettings,
    reference: &LinearImage,
    (seconds, samples_per_second): (f64, f64),
    interrupt: &AtomicBool,
    mut progress: impl FnMut(f64),
) -> Option<NoiseCheck> {
    let affordable = seconds * samples_per_second / f64::from(RUNS);
    // A power of two, as the sequences are made for; NaN becomes the least.
    let samples = affordable.clamp(SAMPLES.0, SAMPLES.1).log2().floor().exp2().max(SAMPLES.0) as u32;
    let truth = reference.luminances();
    let (mut found, mut spent) = (Found::default(), 0.0);
    for run in 0..RUNS {
        let settings = RenderSettings { seed: FIRST_SEED + run, ..*settings };
        let mut tracing = Tracing::new(traceable(app, &settings), interrupt);
        while tracing.samples() < samples {
            if !tracing.pass(samples) {
                return NoiseCheck::of(samples, found);
            }
        }
        spent += tracing.seconds;
        progress(spent);
        let error = relative_error(&LinearImage::of(&tracing.film).luminances(), &truth, settings.size)
            .filter(|&error| error > 0.0);
        if let (Some(noise), Some(error)) = (relative_noise(&tracing.film), error) {
            found.ratios.push(noise / error);
            found.errors.push(error);
            found.add_squares(&tracing.film, &truth);
        }
    }
    NoiseCheck::of(samples, found)
}

/// What the runs gave.
#[derive(Default)]
struct Found {
    ratios: Vec<f64>,
    errors: Vec<f64>,
    /// Of half the difference of the halves, and of the true error.
    squares: [f64; 2],
}

impl Found {
    fn add_squares(&mut self, film: &Film, truth: &[f64]) {
        let brightness = |c: DVec3| f64::from(luminance(c.as_vec3()));
        let pixels = (0..film.size().y).flat_map(|y| film.row(y));
        for (pixel, truth) in pixels.zip(truth) {
            if let Some((a, b)) = pixel.half_mean(0).zip(pixel.half_mean(1)) {
                self.squares[0] += (0.5 * (brightness(a) - brightness(b))).powi(2);
                self.squares[1] += (brightness(pixel.mean()) - truth).powi(2);
            }
        }
    }
}

impl NoiseCheck {
    fn of(samples: u32, found: Found) -> Option<Self> {
        let Found { ratios, errors, squares: [estimated, true_square] } = found;
        if ratios.len() < 2 {
            return None;
        }
        let (mean, deviation) = mean_and_deviation(&ratios);
        let square: f64 = errors.iter().map(|e| e * e).sum();
        Some(Self {
            runs: ratios.len(),
            samples,
            mean,
            mean_error: deviation / (ratios.len() as f64).sqrt(),
            deviation,
            percentiles: [0.05, 0.5, 0.95].map(|part| percentile(&ratios, part).unwrap_or(f64::NAN)),
            true_error: (square / errors.len() as f64).sqrt(),
            unweighted: (estimated / true_square).sqrt(),
            ratios,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_those_of_the_halves_and_of_the_error() {
        let mut film = Film::new(glam::UVec2::ONE, 0);
        let pixel = &mut film.tiles_mut()[0].pixels_mut()[0];
        pixel.add(0, glam::Vec3::splat(1.0));
        pixel.add(1, glam::Vec3::splat(2.0));
        let mut found = Found::default();
        found.add_squares(&film, &[1.0]);
        assert!((found.squares[0] - 0.25).abs() < 1e-6 && (found.squares[1] - 0.25).abs() < 1e-6);
        assert_eq!(NoiseCheck::of(2, found), None, "no ratio, no check");
    }
}
