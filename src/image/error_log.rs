//! The true error against seconds and samples, as a table.

use super::compare::{Difference, LinearImage};
use super::files::{ImageError, linear_pixels};
use crate::scene::color::luminance;
use crate::trace::Film;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// First line of the table.
pub const COLUMNS: &str = "seconds,samples,rmse,relative_mse,relative_error,noise";

/// Compares a growing film with a reference, a row each time. The file can be read while it grows.
#[derive(Debug)]
pub struct ErrorLog {
    path: PathBuf,
    file: File,
    reference: LinearImage,
    /// Square of a tenth of the median luminance, as in [`crate::trace::noise::relative_noise`].
    floor: f64,
}

impl ErrorLog {
    /// Begins the table in `path`. The reference must have the film's size.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn create(path: &Path, reference: LinearImage) -> Result<Self, ImageError> {
        let io = |source| ImageError::Io { path: path.to_path_buf(), source };
        let mut file = File::create(path).map_err(io)?;
        writeln!(file, "{COLUMNS}").map_err(io)?;
        let mut lit: Vec<f64> =
            reference.pixels.iter().map(|&p| f64::from(luminance(p))).filter(|&l| l > 0.0).collect();
        let middle = lit.len() / 2;
        let median = if lit.is_empty() { 0.0 } else { *lit.select_nth_unstable_by(middle, f64::total_cmp).1 };
        Ok(Self { path: path.to_path_buf(), file, reference, floor: (0.1 * median).powi(2) })
    }

    /// Adds a row: error of `film` after `seconds`, and the noise that was estimated then.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn note(&mut self, film: &Film, seconds: f64, noise: Option<f64>) -> Result<(), ImageError> {
        let picture = LinearImage { size: film.size(), pixels: linear_pixels(film) };
        let Difference { rmse, relative_mse, .. } = Difference::between(&picture, &self.reference);
        let relative = self.relative_error(&picture);
        let noise = noise.map_or_else(String::new, |noise| format!("{noise:e}"));
        let samples = film.mean_samples();
        writeln!(self.file, "{seconds:.6},{samples},{rmse:e},{relative_mse:e},{relative:e},{noise}")
            .and_then(|()| self.file.flush())
            .map_err(|source| ImageError::Io { path: self.path.clone(), source })
    }

    /// What the noise number estimates, measured: the root of the mean over all pixels of the squared error of
    /// luminance over its square in the reference plus that of a tenth of the median.
    fn relative_error(&self, picture: &LinearImage) -> f64 {
        let brightness = |image: &LinearImage, i: usize| f64::from(luminance(image.pixels[i]));
        let count = self.reference.pixels.len();
        let sum: f64 = (0..count)
            .map(|i| (brightness(picture, i), brightness(&self.reference, i)))
            .filter(|(a, b)| a != b)
            .map(|(a, b)| (a - b).powi(2) / (b * b + self.floor))
            .sum();
        (sum / count.max(1) as f64).sqrt()
    }
}
