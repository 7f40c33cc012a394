//! A logarithmic axis. Values on it are logarithms to base ten.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use std::ops::Range;

/// From one logarithm to another.
pub struct LogAxis(pub f64, pub f64);

impl LogAxis {
    /// Digits that are labelled: only powers of ten where there are many.
    fn labelled(&self) -> &[i32] {
        if self.1 - self.0 < 2.5 { &[1, 2, 5] } else { &[1] }
    }
}

impl Ranged for LogAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let part = (value - self.0) / (self.1 - self.0);
        limit.0 + (part * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let digits: &[i32] =
            if hint.weight().allow_light_points() { &[1, 2, 3, 4, 5, 6, 7, 8, 9] } else { self.labelled() };
        let decades = self.0.floor() as i32..=self.1.ceil() as i32;
        let places = decades
            .flat_map(|decade| digits.iter().map(move |&digit| f64::from(decade) + f64::from(digit).log10()));
        places.filter(|place| (self.0 - 1e-9..=self.1 + 1e-9).contains(place)).collect()
    }

    fn range(&self) -> Range<f64> {
        self.0..self.1
    }
}
