//! Linear radiance → bytes on a screen: exposure, tone map, sRGB, dither. Never touches the film.

use bevy_ecs::prelude::*;
use glam::{UVec2, Vec3};

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

/// The sRGB transfer function (IEC 61966-2-1) of a linear value; outside 0..=1 is clamped, NaN is 0.
#[must_use]
pub fn srgb_from_linear(linear: f32) -> f32 {
    let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_from_linear`].
#[must_use]
pub fn linear_from_srgb(srgb: f32) -> f32 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
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
