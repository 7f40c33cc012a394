//! Linear radiance → bytes on a screen: exposure, tone map, sRGB, dither. Never touches the film.

use super::compare::LinearImage;
use super::tone_map::ToneMap;
use crate::bvh::Isa;
use crate::bvh::simd::{Job, Simd};
use crate::scene::color::luminance;
use crate::trace::Film;
use crate::trace::sampler::{hash, unit_float};
use bevy_ecs::prelude::*;
use glam::{UVec2, Vec3, Vec4};
use rayon::prelude::*;

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
    let coarse = coarse.filter(|_| film.complete_samples() == 0);
    let mut bytes = vec![255; size.element_product() as usize * 4];
    bytes.par_chunks_exact_mut(size.x as usize * 4).zip(0..size.y).for_each(|(bytes, y)| {
        let row: Vec<Vec4> = (0..size.x)
            .zip(film.row(y))
            .map(|(x, pixel)| match coarse {
                Some(coarse) if pixel.count() == 0 => {
                    let small = coarse.size();
                    coarse.pixel(x * small.x / size.x, y * small.y / size.y)
                }
                _ => pixel,
            })
            .map(|pixel| pixel.mean().as_vec3().extend(0.0))
            .collect();
        develop_row(&row, y, display, bytes);
    });
    bytes
}

/// Linear pixels of `size` as bytes, in the same way, into `bytes`; what is beside a colour is left out.
pub fn develop_linear(pixels: &[Vec4], size: UVec2, display: &Display, bytes: &mut [u8]) {
    let width = size.x as usize;
    bytes
        .par_chunks_exact_mut(width * 4)
        .zip(pixels.par_chunks_exact(width))
        .zip(0..size.y)
        .for_each(|((bytes, row), y)| develop_row(row, y, display, bytes));
}

/// Row `y`.
fn develop_row(row: &[Vec4], y: u32, display: &Display, bytes: &mut [u8]) {
    let gain = display.exposure.exp2();
    match display.tone_map {
        // A function of its own, without curves.
        ToneMap::Clip => Isa::detect().run(Developed { row, y, gain, map: |color| color, bytes }),
        map => Isa::detect().run(Developed { row, y, gain, map: |color| map.apply(color), bytes }),
    }
}

/// A row, and what is to be done with its colours.
struct Developed<'a, F> {
    row: &'a [Vec4],
    y: u32,
    gain: f32,
    map: F,
    bytes: &'a mut [u8],
}

impl<F: Fn(Vec3) -> Vec3> Job for Developed<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        develop_with(self.row, self.y, self.gain, self.map, self.bytes);
    }
}

/// Pixels that are developed side by side: plain loops over so many are vectors to the compiler.
const ABREAST: usize = 16;

#[inline(always)]
fn develop_with(row: &[Vec4], y: u32, gain: f32, map: impl Fn(Vec3) -> Vec3, bytes: &mut [u8]) {
    let salt = hash(y);
    for (first, (pixels, bytes)) in row.chunks(ABREAST).zip(bytes.chunks_mut(4 * ABREAST)).enumerate() {
        let mut colors = [[0.0; ABREAST]; 3];
        for (i, pixel) in pixels.iter().enumerate() {
            // After exposure, before the curve: even an infinity is white, not NaN.
            let shown = map((pixel.truncate() * gain).clamp(Vec3::ZERO, Vec3::splat(1e6)));
            [colors[0][i], colors[1][i], colors[2][i]] = shown.to_array();
        }
        let mut words = [0xff00_0000_u32; ABREAST];
        for (channel, linear) in colors.iter().enumerate() {
            for i in 0..ABREAST {
                let dither = unit_float(hash((first * ABREAST + i) as u32 ^ salt)) - 0.5;
                // Black and white stay what they are.
                let dither = if linear[i] > 0.0 && linear[i] < 1.0 { dither } else { 0.0 };
                // NaN is black. What is added has no digits behind the point, so that they are rounded off.
                let level = (srgb_level(linear[i]) + dither).max(0.0) + (1 << 23) as f32;
                words[i] |= (level.to_bits() & 0xff) << (8 * channel);
            }
        }
        for (rgba, word) in bytes.chunks_exact_mut(4).zip(words) {
            rgba.copy_from_slice(&word.to_le_bytes());
        }
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

/// [`srgb_from_linear`](crate::scene::color::srgb_from_linear) times 255, off by less than 0.0003 levels: above its
/// straight part a polynomial of the fourth root, in which it is nearly a power of 5/3 (fitted at Chebyshev's nodes).
#[inline(always)]
fn srgb_level(linear: f32) -> f32 {
    const CURVE: [f32; 8] =
        [-18.351_29, 95.965_385, -220.674_4, 300.220_73, -290.243_07, 371.246_55, 31.756_943, -14.920_92];
    let linear = linear.clamp(0.0, 1.0);
    let root = linear.sqrt().sqrt();
    let mut curve = CURVE[0];
    for coefficient in &CURVE[1..] {
        curve = curve * root + coefficient;
    }
    if linear <= 0.003_130_8 { 255.0 * 12.92 * linear } else { curve }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::color::srgb_from_linear;

    #[test]
    fn the_polynomial_is_the_curve() {
        for i in 0..=100_000 {
            let linear = i as f32 / 100_000.0;
            let error = (srgb_level(linear) - 255.0 * srgb_from_linear(linear)).abs();
            assert!(error < 3e-4, "{error} levels at {linear}");
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
    fn what_is_not_a_number_is_black_and_alpha_is_full() {
        // More than are developed side by side, and not a multiple of them.
        let mut bytes = [1; 4 * 21];
        let pixels: Vec<Vec4> =
            (0..21).map(|i| if i % 2 == 0 { Vec4::NAN } else { Vec4::splat(f32::INFINITY) }).collect();
        develop_linear(&pixels, UVec2::new(21, 1), &Display::default(), &mut bytes);
        for (i, rgba) in bytes.chunks_exact(4).enumerate() {
            assert_eq!(rgba, if i % 2 == 0 { [0, 0, 0, 255] } else { [255; 4] }, "pixel {i}");
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
