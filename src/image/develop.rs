//! Linear radiance → bytes on a screen: exposure, tone map, sRGB, dither. Never touches the film.

use super::compare::LinearImage;
use super::tone_map::ToneMap;
use crate::scene::color::{luminance, srgb_from_linear};
use crate::trace::Film;
use crate::trace::sampler::{hash, unit_float};
use bevy_ecs::prelude::*;
use glam::{UVec2, Vec3, Vec4};
use rayon::prelude::*;
use std::sync::LazyLock;

/// How the film is shown. Changing it restarts nothing.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// Exposure in stops: radiance is multiplied by 2^exposure.
    pub exposure: f32,
    /// What happens above white.
    pub tone_map: ToneMap,
}

/// A developed picture.
#[derive(Resource, Clone, Debug, Default)]
pub struct Picture {
    /// Width and height.
    pub size: UVec2,
    /// sRGB bytes, alpha 255, rows from the top.
    pub rgba: Vec<u8>,
    /// Counts up with each new picture.
    pub version: u64,
}

/// An exposure for a picture that is much too dark or too bright at 0 EV; `None` if it is all black.
///
/// As [`exposure_for`], if what that goes by lies outside of 0.03 to 3: a picture that is roughly right stays
/// as its author made it.
#[must_use]
pub fn suggest_exposure(film: &Film) -> Option<f32> {
    let bright = bright(film)?;
    Some(if (0.03..=3.0).contains(&bright) { 0.0 } else { exposing(bright) })
}

/// The exposure that brings the 90th percentile of the luminance of what is not black to 0.7, in thirds of
/// a stop; `None` if all is black.
#[must_use]
pub fn exposure_for(film: &Film) -> Option<f32> {
    bright(film).map(exposing)
}

fn exposing(bright: f32) -> f32 {
    ((0.7 / bright).log2() * 3.0).round() / 3.0
}

fn bright(film: &Film) -> Option<f32> {
    let mut lit: Vec<f32> = (0..film.size().y)
        .flat_map(|y| film.row(y))
        .map(|pixel| luminance(pixel.mean().as_vec3()))
        .filter(|&l| l > 0.0)
        .collect();
    if lit.is_empty() {
        return None;
    }
    let rank = (lit.len() - 1) * 9 / 10;
    Some(*lit.select_nth_unstable_by(rank, f32::total_cmp).1)
}

/// The film as sRGB bytes, RGBA, rows from the top.
///
/// Where a pixel has no sample yet, `coarse` (a smaller film of the same view) shows through.
/// Rounding to bytes is dithered by a fixed pattern of up to half a step, so that slow gradients don't
/// show bands and the same film always gives the same bytes.
#[must_use]
pub fn develop(film: &Film, coarse: Option<&Film>, display: &Display) -> Vec<u8> {
    let size = film.size();
    let gain = display.exposure.exp2();
    // The coarse picture is developed as it is, then its bytes are repeated.
    let coarse =
        coarse.filter(|_| film.complete_samples() == 0).map(|c| (c.size(), develop(c, None, display)));
    let mut bytes = vec![255; size.element_product() as usize * 4];
    bytes.par_chunks_exact_mut(size.x as usize * 4).zip(0..size.y).for_each(|(row, y)| {
        for ((x, pixel), rgba) in (0..size.x).zip(film.row(y)).zip(row.chunks_exact_mut(4)) {
            if let (0, Some((small, shown))) = (pixel.count(), &coarse) {
                let from = y * small.y / size.y * small.x + x * small.x / size.x;
                rgba.copy_from_slice(&shown[from as usize * 4..][..4]);
                continue;
            }
            write(pixel.mean().as_vec3(), [x, y], gain, display, rgba);
        }
    });
    bytes
}

/// Linear pixels of `size` as bytes, in the same way, into `bytes`; what is beside a colour is left out.
pub fn develop_linear(pixels: &[Vec4], size: UVec2, display: &Display, bytes: &mut [u8]) {
    let gain = display.exposure.exp2();
    let width = size.x as usize;
    bytes.par_chunks_exact_mut(width * 4).zip(pixels.par_chunks_exact(width)).zip(0..size.y).for_each(
        |((row, pixels), y)| {
            for ((x, pixel), rgba) in (0..size.x).zip(pixels).zip(row.chunks_exact_mut(4)) {
                write(pixel.truncate(), [x, y], gain, display, rgba);
            }
        },
    );
}

/// The colour of one pixel.
#[inline]
fn write(radiance: Vec3, [x, y]: [u32; 2], gain: f32, display: &Display, rgba: &mut [u8]) {
    // After exposure, before the curve: even an infinity is white, not NaN.
    let exposed = (radiance * gain).clamp(Vec3::ZERO, Vec3::splat(1e6));
    let shown = display.tone_map.apply(exposed);
    let dither = unit_float(hash(x ^ hash(y))) - 0.5;
    for (byte, linear) in rgba.iter_mut().zip(shown.to_array()) {
        // Black and white stay what they are.
        let dither = if linear > 0.0 && linear < 1.0 { dither } else { 0.0 };
        // The cast saturates.
        *byte = (SRGB_LEVELS.at(linear) + dither + 0.5) as u8;
    }
}

/// A linear picture as bytes, in the same way.
#[must_use]
pub fn develop_image(image: &LinearImage, display: &Display) -> Vec<u8> {
    let mut film = Film::new(image.size, 0);
    let width = image.size.x;
    for tile in film.tiles_mut() {
        let (origin, across) = (tile.origin, tile.size.x);
        for (i, pixel) in (0..).zip(tile.pixels_mut()) {
            let place = origin + UVec2::new(i % across, i / across);
            // What is no light stays black.
            pixel.add(0, image.pixels.get((place.y * width + place.x) as usize).copied().unwrap_or_default());
        }
    }
    develop(&film, None, display)
}

/// [`srgb_from_linear`] times 255 as a table over the square root, in which it is nearly straight: linear
/// between 4,097 entries it is off by less than 0.001 levels, at a tenth of the cost.
struct SrgbLevels([f32; 4098]);

static SRGB_LEVELS: LazyLock<SrgbLevels> = LazyLock::new(|| {
    SrgbLevels(std::array::from_fn(|i| 255.0 * srgb_from_linear((i as f32 / 4096.0).powi(2))))
});

impl SrgbLevels {
    fn at(&self, linear: f32) -> f32 {
        let place = linear.clamp(0.0, 1.0).sqrt() * 4096.0;
        let index = place as usize;
        self.0[index] + (self.0[index + 1] - self.0[index]) * (place - index as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_curve() {
        for i in 0..=100_000 {
            let linear = i as f32 / 100_000.0;
            let error = (SRGB_LEVELS.at(linear) - 255.0 * srgb_from_linear(linear)).abs();
            assert!(error < 1e-3, "{error} levels at {linear}");
        }
    }

    #[test]
    fn odd_radiance_is_black_or_white() {
        for (radiance, byte) in [(0.0, 0), (1e30, 255), (f32::MAX, 255), (-1.0, 0)] {
            let mut film = Film::new(UVec2::ONE, 0);
            film.tiles_mut()[0].pixels_mut()[0].add(0, Vec3::splat(radiance.min(1e10)));
            for tone_map in ToneMap::ALL {
                let bytes = develop(&film, None, &Display { exposure: 20.0, tone_map });
                // The curves only near white; dither may take the last level.
                assert!(
                    bytes[0].abs_diff(byte) <= u8::from(tone_map != ToneMap::Clip),
                    "{radiance} {tone_map:?}: {bytes:?}"
                );
            }
        }
    }

    #[test]
    fn half_the_light_is_level_188() {
        let mut film = Film::new(UVec2::new(64, 64), 0);
        for tile in film.tiles_mut() {
            for pixel in tile.pixels_mut() {
                pixel.add(0, Vec3::splat(0.5));
            }
        }
        let bytes = develop(&film, None, &Display::default());
        let mean = bytes.chunks_exact(4).map(|p| f64::from(p[0])).sum::<f64>() / 4096.0;
        assert!((mean - 187.516).abs() < 0.05, "dither keeps the mean: {mean}");
    }
}
