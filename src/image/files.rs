//! Pictures on disk.

use super::compare::LinearImage;
use super::develop::Display;
use super::develop::{develop, develop_image};
use crate::trace::Film;
use glam::{UVec2, Vec3};
use image::{ImageFormat, Rgb32FImage, RgbaImage};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Why a picture could not be written or read. The message names the file.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The name's ending is neither `.png` nor `.exr`.
    #[error("{}: written are pictures, .png (developed, 8 bit) or .exr (linear, 32 bit float), and .film (to go on \
             with or to merge); give it one of these endings", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// Not a picture, or a broken one.
    #[error("{}: {source}", path.display())]
    Codec {
        /// The file.
        path: PathBuf,
        /// The codec's reason.
        source: image::ImageError,
    },
}

/// What a file name asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// Developed, sRGB, 8 bit.
    Png,
    /// Linear Rec. 709 radiance, 32 bit float.
    Exr,
}

impl PictureFormat {
    /// By the ending of `path`.
    ///
    /// # Errors
    /// If it is neither `.png` nor `.exr`.
    pub fn of(path: &Path) -> Result<Self, ImageError> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            _ => Err(ImageError::UnknownFormat { path: path.to_path_buf() }),
        }
    }
}

/// Writes the film to `path`, developed or linear by its ending. The file appears whole or not at all.
///
/// # Errors
/// If the ending is unknown or the file cannot be written.
pub fn save(path: &Path, film: &Film, display: &Display) -> Result<(), ImageError> {
    let format = PictureFormat::of(path)?;
    let size = film.size();
    let mut bytes = Cursor::new(Vec::new());
    let codec = |source| ImageError::Codec { path: path.to_path_buf(), source };
    match format {
        PictureFormat::Png => {
            let developed = if is_guessed(film) {
                develop_image(&LinearImage::of(film), display)
            } else {
                develop(film, None, display)
            };
            let image = RgbaImage::from_raw(size.x, size.y, developed).unwrap_or_default();
            let image = image::DynamicImage::from(image).into_rgb8();
            image.write_to(&mut bytes, ImageFormat::Png).map_err(codec)?;
        }
        PictureFormat::Exr => {
            let linear = linear_pixels(film).into_iter().flat_map(|p| p.to_array()).collect();
            let image = Rgb32FImage::from_raw(size.x, size.y, linear).unwrap_or_default();
            image.write_to(&mut bytes, ImageFormat::OpenExr).map_err(codec)?;
        }
    }
    write_whole(path, bytes.get_ref())
}

/// Mean radiances, rows from the top. Where there was not even time for a sample of each pixel, the others are guessed.
#[must_use]
pub fn linear_pixels(film: &Film) -> Vec<Vec3> {
    let pixels = || (0..film.size().y).flat_map(|y| film.row(y));
    let mut means: Vec<Vec3> = pixels().map(|pixel| pixel.mean().as_vec3()).collect();
    if is_guessed(film) {
        let known = pixels().map(|pixel| pixel.count() > 0).collect();
        fill(&mut means, known, film.size());
    }
    means
}

/// Whether it has pixels that nobody has looked at yet. (Those of which all samples were dropped stay black.)
fn is_guessed(film: &Film) -> bool {
    film.complete_samples() == 0 && film.region().is_none()
}

/// Gives each pixel that is not `known` the mean of those beside it that are, one ring after the other.
fn fill(pixels: &mut [Vec3], mut known: Vec<bool>, size: UVec2) {
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
    let mut ring: Vec<usize> =
        (0..pixels.len()).filter(|&at| waits[at] && beside(at).any(|there| known[there])).collect();
    while !ring.is_empty() {
        ring.iter().for_each(|&at| waits[at] = false);
        for &at in &ring {
            let around = beside(at).filter(|&there| known[there]);
            let (sum, count) =
                around.fold((Vec3::ZERO, 0.0), |(sum, count), there| (sum + pixels[there], count + 1.0));
            pixels[at] = sum / count;
        }
        ring.iter().for_each(|&at| known[at] = true);
        let mut next: Vec<usize> = ring.iter().flat_map(|&at| beside(at)).filter(|&at| waits[at]).collect();
        next.sort_unstable();
        next.dedup();
        ring = next;
    }
}

/// Writes beside `path` and renames, so that nobody ever sees half a file.
///
/// # Errors
/// If the file system refuses.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let io = |source| ImageError::Io { path: path.to_path_buf(), source };
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, path)).map_err(|source| {
        // The reason for the failure matters more than what is left over.
        let _ = std::fs::remove_file(&part);
        io(source)
    })
}
