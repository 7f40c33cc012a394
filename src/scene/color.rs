//! The transfer function at the edges of linear light, and brightness.

use glam::Vec3;

/// The sRGB transfer function (IEC 61966-2-1) of a linear value; outside 0..=1 is clamped, NaN is 0.
#[must_use]
pub fn srgb_from_linear(linear: f32) -> f32 {
    let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_from_linear`] on 0..=1.
#[must_use]
pub fn linear_from_srgb(srgb: f32) -> f32 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// Relative luminance of linear Rec. 709 RGB.
#[must_use]
pub fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}
