//! Several runs of one method → one curve with a band.

use super::measure::{Run, checkpoints};
use super::statistics::{Fit, first_below, fit_power};
use serde::Serialize;
use std::collections::BTreeMap;

/// Which pixels an error is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// All of them.
    All,
    /// Those that see no light directly: a lamp's bright outline has so much contrast that it hides what
    /// happens in its penumbra.
    Surfaces,
}

/// A method by one measure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Findings {
    /// All seeds together.
    pub curve: Vec<CurvePoint>,
    /// The slope of log error over log samples.
    pub slope: Option<Fit>,
    /// Seconds until the error that plain random sampling has at the end of its own curve.
    pub seconds_to_random_error: Option<f64>,
}

/// All runs at one sample count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Samples per pixel.
    pub samples: u32,
    /// Seconds of tracing, the mean of the runs.
    pub seconds: f64,
    /// Root of the mean squared error of the runs.
    pub rmse: f64,
    /// The best run.
    pub least: f64,
    /// The worst run.
    pub most: f64,
    /// How many runs came so far.
    pub runs: usize,
}

impl Findings {
    /// Notes when the error is at `level` for the first time.
    pub fn race_to(&mut self, level: Option<f64>) {
        let points: Vec<(f64, f64)> = self.curve.iter().map(|p| (p.seconds, p.rmse)).collect();
        self.seconds_to_random_error = level.and_then(|level| first_below(&points, level));
    }
}

/// Where a fit begins: before, the error still depends on where the samples happen to lie.
pub const FIT_FROM: u32 = 8;
/// An error is taken as measured if it is so many times the reference's own.
pub const TRUSTED: f64 = 4.0;

/// One point for each sample count that several runs have; where just one goes on, also those.
#[must_use]
pub fn curve(runs: &[Run], measure: Measure) -> Vec<CurvePoint> {
    let mut by_samples: BTreeMap<u32, Vec<(f64, f64)>> = BTreeMap::new();
    for point in runs.iter().flat_map(|run| &run.points) {
        if let Some(error) = point.error(measure) {
            by_samples.entry(point.samples).or_default().push((point.seconds, error));
        }
    }
    // Runs that end by time end anywhere: such a point of one run would stand out among means of all.
    let last = by_samples.keys().last().copied();
    let grid: Vec<u32> = checkpoints().collect();
    by_samples
        .into_iter()
        .filter(|(samples, _)| Some(*samples) == last || grid.binary_search(samples).is_ok())
        .map(|(samples, points)| {
            let n = points.len() as f64;
            let errors = || points.iter().map(|p| p.1);
            CurvePoint {
                samples,
                seconds: points.iter().map(|p| p.0).sum::<f64>() / n,
                rmse: (errors().map(|e| e * e).sum::<f64>() / n).sqrt(),
                least: errors().fold(f64::INFINITY, f64::min),
                most: errors().fold(0.0, f64::max),
                runs: points.len(),
            }
        })
        .collect()
}

/// The slope over samples, of the points that all runs have reached and that the reference is good enough for: one run
/// alone may be a seventh off.
#[must_use]
pub fn slope(curve: &[CurvePoint], reference_error: Option<f64>) -> Option<Fit> {
    let trusted = |rmse: f64| reference_error.is_none_or(|error| rmse >= TRUSTED * error);
    let all = curve.iter().map(|point| point.runs).max().unwrap_or(0);
    let points: Vec<(f64, f64)> = curve
        .iter()
        .filter(|point| point.samples >= FIT_FROM && point.runs == all && trusted(point.rmse))
        .map(|point| (f64::from(point.samples), point.rmse))
        .collect();
    fit_power(&points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::measure::Point;

    fn run(points: &[(u32, f64)]) -> Run {
        let points = points.iter().map(|&(samples, rmse)| Point {
            samples,
            seconds: f64::from(samples),
            rmse,
            rmse_surfaces: None,
            noise: None,
        });
        Run { points: points.collect(), ..Run::default() }
    }

    #[test]
    fn a_run_that_ends_between_does_not_dent_the_curve() {
        let runs = [run(&[(1, 3.0), (2, 2.0), (7, 1.0)]), run(&[(1, 4.0), (2, 2.0), (5, 9.0)])];
        assert!(curve(&runs, Measure::Surfaces).is_empty());
        let curve = curve(&runs, Measure::All);
        assert_eq!(curve.iter().map(|p| p.samples).collect::<Vec<_>>(), [1, 2, 7]);
        assert!((curve[0].rmse - 12.5f64.sqrt()).abs() < 1e-12);
        assert_eq!((curve[0].least, curve[0].most, curve[0].runs), (3.0, 4.0, 2));
    }

    #[test]
    fn errors_as_small_as_the_reference_s_are_not_fitted() {
        let all: Vec<(u32, f64)> = (1..9).map(|i| (1 << i, 0.5f64.powi(i))).collect();
        let curve = curve(&[run(&all)], Measure::All);
        assert_eq!(slope(&curve, None).unwrap().points, 6);
        assert_eq!(slope(&curve, Some(0.5f64.powi(8))).unwrap().points, 4);
        assert_eq!(slope(&curve, Some(0.1)), None);
    }

    #[test]
    fn what_only_some_runs_have_reached_is_not_fitted() {
        let at = |i: i32, by: f64| (1 << i, by * 0.5f64.powi(i));
        let short: Vec<_> = (1..7).map(|i| at(i, 1.5)).collect();
        let long: Vec<_> = (1..10).map(|i| at(i, 1.0)).collect();
        let fit = slope(&curve(&[run(&short), run(&long)], Measure::All), None).unwrap();
        assert!(fit.points == 4 && (fit.slope + 1.0).abs() < 1e-9, "{fit:?}");
    }
}
