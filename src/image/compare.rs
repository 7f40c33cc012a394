//! How much two pictures differ.

use super::files::{ImageError, linear_pixels};
use crate::scene::color::{linear_from_srgb, luminance};
use crate::trace::Film;
use glam::{UVec2, Vec3};
use std::path::Path;

/// A picture in linear light.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Width and height.
    pub size: UVec2,
    /// Rows from the top; values of an 8 or 16 bit file are decoded from sRGB.
    pub pixels: Vec<Vec3>,
}

/// Difference of a picture A to a reference B, over all pixels and the three linear channels.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Root of the mean of (A − B)².
    pub rmse: f64,
    /// Mean of (A − B)² / (B² + 0.01).
    pub relative_mse: f64,
    /// Largest |A − B|.
    pub max_error: f64,
    /// Where that is, from the top left.
    pub max_at: [u32; 2],
    /// Mean of A − B.
    pub bias: f64,
    /// Values that are not finite in either; left out of the others.
    pub not_finite: u64,
}

/// Why two pictures could not be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// One could not be read.
    #[error(transparent)]
    Read(#[from] ImageError),
    /// They are not of one size.
    #[error("the pictures differ in size: {a} is {}x{}, {b} is {}x{}", size_a.x, size_a.y, size_b.x, size_b.y)]
    Size {
        /// File A.
        a: String,
        /// Its size.
        size_a: UVec2,
        /// File B.
        b: String,
        /// Its size.
        size_b: UVec2,
    },
}

impl LinearImage {
    /// A film's means.
    #[must_use]
    pub fn of(film: &Film) -> Self {
        Self { size: film.size(), pixels: linear_pixels(film) }
    }

    /// Of each pixel.
    #[must_use]
    pub fn luminances(&self) -> Vec<f64> {
        self.pixels.iter().map(|&p| f64::from(luminance(p))).collect()
    }

    /// Reads any format that the `image` crate knows.
    ///
    /// # Errors
    /// If it cannot be read or decoded.
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        let bytes =
            std::fs::read(path).map_err(|source| ImageError::Io { path: path.to_path_buf(), source })?;
        if image::guess_format(&bytes).is_err() {
            return Err(ImageError::NotAPicture { path: path.to_path_buf() });
        }
        let image = image::load_from_memory(&bytes)
            .map_err(|source| ImageError::Codec { path: path.to_path_buf(), source })?;
        let linear =
            matches!(image, image::DynamicImage::ImageRgb32F(_) | image::DynamicImage::ImageRgba32F(_));
        let decode = |c: f32| if linear { c } else { linear_from_srgb(c) };
        let image = image.into_rgb32f();
        let pixels = image.pixels().map(|p| Vec3::from_array(p.0.map(decode))).collect();
        Ok(Self { size: UVec2::new(image.width(), image.height()), pixels })
    }
}

impl Difference {
    /// Of `a` to the reference `b`, of the same size.
    #[must_use]
    pub fn between(a: &LinearImage, b: &LinearImage) -> Self {
        let (mut square, mut relative, mut sum, mut count) = (0.0, 0.0, 0.0, 0u64);
        let (mut max_error, mut worst, mut not_finite) = (0.0, 0, 0);
        for (i, (a, b)) in a.pixels.iter().zip(&b.pixels).enumerate() {
            for (a, b) in a.to_array().into_iter().zip(b.to_array()) {
                let (a, b) = (f64::from(a), f64::from(b));
                let d = a - b;
                if !d.is_finite() {
                    not_finite += 1;
                    continue;
                }
                square += d * d;
                relative += d * d / (b * b + 0.01);
                sum += d;
                count += 1;
                if d.abs() > max_error {
                    max_error = d.abs();
                    worst = i;
                }
            }
        }
        let width = a.size.x.max(1) as usize;
        let count = count.max(1) as f64;
        Self {
            rmse: (square / count).sqrt(),
            relative_mse: relative / count,
            max_error,
            max_at: [(worst % width) as u32, (worst / width) as u32],
            bias: sum / count,
            not_finite,
        }
    }
}

/// Reads and compares two pictures of equal size.
///
/// # Errors
/// If one cannot be read, or they differ in size.
pub fn compare_files(a: &Path, b: &Path) -> Result<Difference, CompareError> {
    let (image_a, image_b) = (LinearImage::open(a)?, LinearImage::open(b)?);
    if image_a.size != image_b.size {
        return Err(CompareError::Size {
            a: a.display().to_string(),
            size_a: image_a.size,
            b: b.display().to_string(),
            size_b: image_b.size,
        });
    }
    Ok(Difference::between(&image_a, &image_b))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(value: f32) -> LinearImage {
        LinearImage { size: UVec2::new(4, 2), pixels: vec![Vec3::splat(value); 8] }
    }

    #[test]
    fn a_uniform_difference_is_found_in_every_measure() {
        let difference = Difference::between(&flat(0.75), &flat(0.5));
        assert_eq!((difference.rmse, difference.max_error, difference.bias), (0.25, 0.25, 0.25));
        assert!((difference.relative_mse - 0.0625 / 0.26).abs() < 1e-12);
    }

    #[test]
    fn the_worst_pixel_is_named_and_nan_is_counted() {
        let mut a = flat(0.5);
        a.pixels[6].y = 3.0;
        a.pixels[1].x = f32::NAN;
        let difference = Difference::between(&a, &flat(0.5));
        assert_eq!((difference.max_at, difference.not_finite), ([2, 1], 1));
    }
}
