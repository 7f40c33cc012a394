//! Pictures of the sky: `.hdr`, `.exr` and whatever else is decoded.

use super::error::{LoadError, ReadError};
use super::report::Sink;
use super::source::{self, SCENE_LIMIT};
use crate::scene::Sky;
use crate::scene::color::linear_from_srgb;
use glam::Vec3;
use image::{ColorType, ImageDecoder, ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;

/// Most pixels: 8192 × 4096 twice over.
const MOST_PIXELS: u64 = 1 << 26;

/// Reads a picture of all directions, linear where its format is.
pub(super) fn read(path: &Path, sink: &Sink<'_>) -> Result<Sky, LoadError> {
    let file = path.to_string_lossy().into_owned();
    let bytes = source::read_file(path, SCENE_LIMIT, &sink.options.files)
        .map_err(|source: ReadError| LoadError::Read { file: file.clone(), source })?;
    let broken = |why: &str| LoadError::broken(&file, "the picture of the sky", why);
    let reader = || ImageReader::new(Cursor::new(&*bytes)).with_guessed_format();
    let size = reader().ok().and_then(|reader| reader.into_dimensions().ok());
    let (width, height) = size.ok_or_else(|| broken("is not a picture that can be read"))?;
    let count = u64::from(width) * u64::from(height);
    if count == 0 || count > MOST_PIXELS {
        return Err(broken("has no pixels, or too many"));
    }
    // Decoded, converted, and the table of chances.
    sink.budget.take(count * 40, &file, "the picture of the sky")?;
    let decoder = reader().ok().and_then(|mut reader| {
        let mut limits = Limits::default();
        limits.max_alloc = Some(count * 32 + (1 << 24));
        reader.limits(limits);
        reader.into_decoder().ok()
    });
    let decoder = decoder.ok_or_else(|| broken("cannot be decoded"))?;
    let is_linear = matches!(decoder.color_type(), ColorType::Rgb32F | ColorType::Rgba32F);
    let image = image::DynamicImage::from_decoder(decoder).map_err(|error| broken(&error.to_string()))?;
    let decode = |c: f32| if is_linear { c } else { linear_from_srgb(c) };
    let pixels = image.into_rgb32f().pixels().map(|p| Vec3::from_array(p.0.map(decode))).collect();
    Sky::new(width as usize, pixels).ok_or_else(|| broken("has no pixels"))
}
