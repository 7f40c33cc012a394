//! Errors as colours: black, violet, red, yellow, white, ever lighter, over three decades.

use crate::image::compare::LinearImage;
use crate::report::statistics::percentile;
use glam::{UVec2, Vec3};

/// Which errors the ends of the colours stand for. Between them the scale is logarithmic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorScale {
    /// White: this and more.
    pub most: f64,
}

/// Decades from black to white.
pub const DECADES: i32 = 3;
/// Evenly spaced along the scale; each is lighter than the one before, so grey print keeps the order.
pub const COLORS: [[u8; 3]; 5] = [[0, 0, 0], [62, 22, 112], [188, 48, 84], [250, 152, 42], [255, 255, 228]];

impl ErrorScale {
    /// A power of ten that hardly any error of these maps exceeds.
    #[must_use]
    pub fn of(maps: &[Vec<f64>]) -> Self {
        let all = maps.concat();
        let high = percentile(&all, 0.999).filter(|&e| e > 0.0).unwrap_or(1.0);
        Self { most: 10f64.powi(high.log10().ceil() as i32) }
    }

    /// The colour of an error.
    #[must_use]
    pub fn color(&self, error: f64) -> [u8; 3] {
        // Zero goes to minus infinity, which the clamp makes black.
        let place = 1.0 + (error / self.most).log10() / f64::from(DECADES);
        let place = place.clamp(0.0, 1.0) * (COLORS.len() - 1) as f64;
        let below = (place as usize).min(COLORS.len() - 2);
        let part = place - below as f64;
        let mix = |c: usize| {
            let (a, b) = (f64::from(COLORS[below][c]), f64::from(COLORS[below + 1][c]));
            (a + (b - a) * part).round() as u8
        };
        [mix(0), mix(1), mix(2)]
    }
}

/// For each pixel the root of the mean over the channels of the squared difference.
#[must_use]
pub fn errors(picture: &LinearImage, reference: &LinearImage) -> Vec<f64> {
    let error = |(&a, &b): (&Vec3, &Vec3)| f64::from((a - b).length_squared() / 3.0).sqrt();
    picture.pixels.iter().zip(&reference.pixels).map(error).collect()
}

/// The pixels with the largest errors, each at least `apart` from the others.
#[must_use]
pub fn worst(errors: &[f64], size: UVec2, count: usize, apart: u32) -> Vec<UVec2> {
    let mut order: Vec<usize> = (0..errors.len()).filter(|&i| errors[i] > 0.0).collect();
    order.sort_unstable_by(|&a, &b| errors[b].total_cmp(&errors[a]).then(a.cmp(&b)));
    let mut found: Vec<UVec2> = Vec::new();
    for index in order {
        let pixel = UVec2::new(index as u32 % size.x, index as u32 / size.x);
        let far = |other: &UVec2| other.x.abs_diff(pixel.x).max(other.y.abs_diff(pixel.y)) >= apart;
        if found.iter().all(far) {
            found.push(pixel);
            if found.len() == count {
                break;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_is_logarithmic_and_ends_in_black_and_white() {
        let scale = ErrorScale::of(&[vec![0.0, 0.03], vec![0.04]]);
        assert!((scale.most - 0.1).abs() < 1e-12);
        assert_eq!((scale.color(0.0), scale.color(1e-9)), (COLORS[0], COLORS[0]));
        assert_eq!((scale.color(0.1), scale.color(7.0)), (COLORS[4], COLORS[4]));
        assert_eq!(scale.color(0.1 / 10f64.powf(1.5)), COLORS[2]);
        let light = |c: [u8; 3]| 0.3 * f64::from(c[0]) + 0.59 * f64::from(c[1]) + 0.11 * f64::from(c[2]);
        let steps: Vec<f64> =
            (0..=90).map(|i| light(scale.color(1e-4 * 10f64.powf(f64::from(i) / 30.0)))).collect();
        assert!(steps.windows(2).all(|w| w[0] < w[1]), "each step is lighter");
    }

    #[test]
    fn the_worst_pixels_keep_their_distance() {
        let mut errors = vec![0.0; 64];
        (errors[9], errors[10], errors[63]) = (3.0, 2.0, 1.0);
        let size = UVec2::new(8, 8);
        assert_eq!(worst(&errors, size, 3, 2), [UVec2::new(1, 1), UVec2::new(7, 7)]);
        assert_eq!(worst(&errors, size, 2, 1), [UVec2::new(1, 1), UVec2::new(2, 1)]);
    }
}
