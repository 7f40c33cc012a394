//! How wrong the picture still is, without a reference.

use super::Film;
use crate::scene::color::luminance;
use glam::DVec3;

/// Estimated relative error of the picture's luminance, 0.02 for 2 %.
///
/// The film's halves A and B are independent, so (A − B) / 2 has the variance of their mean. The
/// estimate is the root over all pixels of the mean of ((A − B) / 2)² / (I² + (m / 10)²), where I is the
/// pixel's luminance and m the median of those that are not black: the constant keeps dark pixels from
/// ruling it, and makes it independent of exposure. Pixels that are dark in every sample count as exact.
///
/// `None` before both halves have a sample, or when all is black. It knows nothing of light that no
/// sample has seen yet.
#[must_use]
pub fn relative_noise(film: &Film) -> Option<f64> {
    let brightness = |c: DVec3| f64::from(luminance(c.as_vec3()));
    let size = film.size();
    let mut pixels = Vec::with_capacity(size.element_product() as usize);
    for y in 0..size.y {
        for pixel in film.row(y) {
            let (a, b) = (brightness(pixel.half_mean(0)?), brightness(pixel.half_mean(1)?));
            pixels.push((brightness(pixel.mean()), 0.5 * (a - b)));
        }
    }
    let mut lit: Vec<f64> = pixels.iter().map(|p| p.0).filter(|&i| i > 0.0).collect();
    if lit.is_empty() {
        return None;
    }
    let middle = lit.len() / 2;
    let median = *lit.select_nth_unstable_by(middle, f64::total_cmp).1;
    let floor = (0.1 * median).powi(2);
    let sum: f64 = pixels.iter().map(|(i, d)| d * d / (i * i + floor)).sum();
    Some((sum / pixels.len() as f64).sqrt())
}
