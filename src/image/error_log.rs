//! The true error against seconds and samples, as a table.

use super::compare::{Difference, LinearImage};
use super::files::ImageError;
use crate::trace::noise::relative_error;
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
    /// Its luminances.
    truth: Vec<f64>,
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
        let truth = reference.luminances();
        Ok(Self { path: path.to_path_buf(), file, reference, truth })
    }

    /// Adds a row: error of a picture of so many samples per pixel after `seconds`, and the noise that was estimated then.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn note(
        &mut self,
        picture: &LinearImage,
        samples: f64,
        seconds: f64,
        noise: Option<f64>,
    ) -> Result<(), ImageError> {
        let Difference { rmse, relative_mse, .. } = Difference::between(picture, &self.reference);
        // What the noise number estimates, measured.
        let relative = relative_error(&picture.luminances(), &self.truth, picture.size);
        let cell = |number: Option<f64>| number.map_or_else(String::new, |number| format!("{number:e}"));
        let (relative, noise) = (cell(relative), cell(noise));
        writeln!(self.file, "{seconds:.6},{samples},{rmse:e},{relative_mse:e},{relative},{noise}")
            .and_then(|()| self.file.flush())
            .map_err(|source| ImageError::Io { path: self.path.clone(), source })
    }
}
