//! Linear radiance → bytes on a screen: exposure, tone map, sRGB, dither. Never touches the film.

use bevy_ecs::prelude::*;
use crate::scene::color::{luminance, srgb_from_linear};
use crate::trace::Film;
use crate::trace::sampler::{hash, unit_float};
use glam::{UVec2, Vec3};
use rayon::prelude::*;

/// How the film is shown. Changing it restarts nothing.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// Exposure in stops: radiance is multiplied by 2^exposure.
    pub exposure: f32,
    /// What happens above white.
    pub tone_map: ToneMap,
}

/// What happens above white.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToneMap {
    /// Cut off, each channel for itself.
    #[default]
    Clip,
    /// Khronos PBR Neutral: colours stay, highlights roll off.
    Neutral,
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

impl ToneMap {
    /// Maps exposed linear radiance to linear display values; what is still outside 0..=1 clips.
    ///
    /// Neutral: Khronos PBR Neutral tone mapper specification, 2024.
    #[must_use]
    pub fn apply(self, color: Vec3) -> Vec3 {
        match self {
            Self::Clip => color,
            Self::Neutral => neutral(color),
        }
    }
}

/// An exposure for a picture that is much too dark or too bright at 0 EV; `None` if it is all black.
///
/// The 90th percentile of the luminance of what is not black goes to 0.7, in thirds of a stop, if it
/// lies outside of 0.15 to 2: a picture that is roughly right stays as its author made it.
#[must_use]
pub fn suggest_exposure(film: &Film) -> Option<f32> {
    let size = film.size();
    let mut lit: Vec<f32> = (0..size.y)
        .flat_map(|y| (0..size.x).map(move |x| luminance(film.pixel(x, y).mean().as_vec3())))
        .filter(|&l| l > 0.0)
        .collect();
    if lit.is_empty() {
        return None;
    }
    let rank = (lit.len() - 1) * 9 / 10;
    let bright = *lit.select_nth_unstable_by(rank, f32::total_cmp).1;
    let stops = (0.7 / bright).log2();
    Some(if (0.15..=2.0).contains(&bright) { 0.0 } else { (stops * 3.0).round() / 3.0 })
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
    let mut bytes = vec![255; size.element_product() as usize * 4];
    bytes.par_chunks_exact_mut(size.x as usize * 4).zip(0..size.y).for_each(|(row, y)| {
        for (x, rgba) in (0..size.x).zip(row.chunks_exact_mut(4)) {
            let mut pixel = film.pixel(x, y);
            if let (0, Some(coarse)) = (pixel.count(), coarse) {
                let small = coarse.size();
                pixel = coarse.pixel(x * small.x / size.x, y * small.y / size.y);
            }
            // After exposure, before the curve: even an infinity is white, not NaN.
            let exposed = (pixel.mean().as_vec3() * gain).clamp(Vec3::ZERO, Vec3::splat(1e6));
            let shown = display.tone_map.apply(exposed);
            let dither = unit_float(hash(x ^ hash(y))) - 0.5;
            for (byte, linear) in rgba.iter_mut().zip(shown.to_array()) {
                let level = srgb_from_linear(linear) * 255.0;
                // Black and white stay what they are.
                let dithered = if level > 0.0 && level < 255.0 { level + dither } else { level };
                *byte = dithered.round().clamp(0.0, 255.0) as u8;
            }
        }
    });
    bytes
}

fn neutral(color: Vec3) -> Vec3 {
    const START: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    let low = color.min_element();
    let offset = if low < 0.08 { low - 6.25 * low * low } else { 0.04 };
    let color = color - offset;
    let peak = color.max_element();
    if peak < START {
        return color;
    }
    let d = 1.0 - START;
    let new_peak = 1.0 - d * d / (peak + d - START);
    let color = color * (new_peak / peak);
    let g = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    color.lerp(Vec3::splat(new_peak), g)
}
