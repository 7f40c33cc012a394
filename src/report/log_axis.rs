//! A logarithmic axis whose grid is where people look for it. Values on it are logarithms to base ten.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use std::ops::Range;

/// From one logarithm to another.
#[derive(Clone, Debug, PartialEq)]
pub struct LogAxis {
    from: f64,
    to: f64,
    /// With a label.
    bold: Vec<f64>,
    /// All digits.
    light: Vec<f64>,
}

impl LogAxis {
    /// Labels at 1, 2 and 5; where there are many decades at powers of ten alone.
    #[must_use]
    pub fn new(from: f64, to: f64) -> Self {
        let labelled: &[i32] = if to - from < 2.2 { &[1, 2, 5] } else { &[1] };
        let (mut bold, mut light) = (Vec::new(), Vec::new());
        for decade in from.floor() as i32..=to.ceil() as i32 {
            for digit in 1..10 {
                let place = f64::from(decade) + f64::from(digit).log10();
                if (from..=to).contains(&place) {
                    light.push(place);
                    if labelled.contains(&digit) {
                        bold.push(place);
                    }
                }
            }
        }
        Self { from, to, bold, light }
    }

    /// How many labels there are.
    #[must_use]
    pub fn labels(&self) -> usize {
        self.bold.len()
    }
}

impl Ranged for LogAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let part = (value - self.from) / (self.to - self.from);
        limit.0 + (part * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { self.light.clone() } else { self.bold.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.from..self.to
    }
}

/// The number at the logarithm `v`, as people write it.
#[must_use]
pub fn tick(v: f64) -> String {
    let number = 10f64.powf(v);
    // A hair more: the logarithm of 1000 may be just below 3.
    let exponent = (v + 1e-9).floor() as i32;
    match exponent {
        0..=4 => format!("{number:.0}"),
        -3..0 => format!("{number:.*}", exponent.unsigned_abs() as usize),
        _ => format!("{number:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_round_numbers() {
        let axis = LogAxis::new(-2.1, -0.6);
        let labels: Vec<String> = axis.bold.iter().map(|&v| tick(v)).collect();
        assert_eq!(labels, ["0.01", "0.02", "0.05", "0.1", "0.2"]);
        assert!(axis.light.len() > 2 * axis.labels());
        assert_eq!(
            (tick(3.0), tick(-5.0), tick(2e-4_f64.log10())),
            ("1000".into(), "1e-5".into(), "2e-4".into())
        );
    }

    #[test]
    fn the_ends_are_the_ends() {
        let axis = LogAxis::new(1.0, 3.0);
        assert_eq!([1.0, 2.0, 3.0].map(|v| axis.map(&v, (100, 0))), [100, 50, 0]);
    }
}
