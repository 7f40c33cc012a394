//! Slopes, percentiles and values between measured points.

use serde::Serialize;

/// A straight line through points in log-log: y = e^intercept · x^slope.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fit {
    /// The exponent.
    pub slope: f64,
    /// Its standard error, from how far the points are off the line.
    pub standard_error: f64,
    /// Logarithm of y at x = 1.
    pub intercept: f64,
    /// Points that it went through.
    pub points: usize,
}

/// Least squares in log-log. `None` for fewer than three points, one that is not positive, or equal x.
#[must_use]
pub fn fit_power(points: &[(f64, f64)]) -> Option<Fit> {
    let n = points.len();
    if n < 3 || !points.iter().all(|&(x, y)| x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite()) {
        return None;
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|&(x, y)| (x.ln(), y.ln())).collect();
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / n as f64;
    let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
    let sxx: f64 = logs.iter().map(|p| (p.0 - mx).powi(2)).sum();
    if sxx <= 0.0 {
        return None;
    }
    let slope = logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>() / sxx;
    let intercept = my - slope * mx;
    let residual: f64 = logs.iter().map(|p| (p.1 - intercept - slope * p.0).powi(2)).sum();
    let standard_error = (residual / (n - 2) as f64 / sxx).sqrt();
    Some(Fit { slope, standard_error, intercept, points: n })
}

/// The value below which `part` (0 to 1) of `values` lie, linear between neighbours; `None` without any.
#[must_use]
pub fn percentile(values: &[f64], part: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let place = part.clamp(0.0, 1.0) * sorted.len().checked_sub(1)? as f64;
    let (low, high) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    Some(low + (high - low) * place.fract())
}

/// Mean and standard deviation of a single value (n − 1); the latter 0 for fewer than two.
#[must_use]
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n.max(1.0);
    let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, (square / (n - 1.0).max(1.0)).sqrt())
}

/// y of a curve, ascending in x, at `x`: a power law between neighbours. `None` outside, or where a
/// neighbour is not positive.
#[must_use]
pub fn value_at(curve: &[(f64, f64)], x: f64) -> Option<f64> {
    let next = curve.partition_point(|p| p.0 < x);
    let &(x1, y1) = curve.get(next)?;
    if x1 == x {
        return Some(y1);
    }
    let &(x0, y0) = curve.get(next.checked_sub(1)?)?;
    between((x0, x1), (y0, y1), x)
}

/// The first x at which a curve, ascending in x, is at or below `level`: a power law between neighbours.
/// `None` if it never is.
#[must_use]
pub fn first_below(curve: &[(f64, f64)], level: f64) -> Option<f64> {
    let next = curve.iter().position(|p| p.1 <= level)?;
    let (x1, y1) = curve[next];
    let Some(&(x0, y0)) = next.checked_sub(1).map(|before| &curve[before]) else { return Some(x1) };
    // Seen along y, which falls here.
    Some(between((y0, y1), (x0, x1), level).unwrap_or(x1))
}

fn between((x0, x1): (f64, f64), (y0, y1): (f64, f64), x: f64) -> Option<f64> {
    let positive = x0 > 0.0 && x1 > 0.0 && x > 0.0 && y0 > 0.0 && y1 > 0.0;
    let part = (x / x0).ln() / (x1 / x0).ln();
    (positive && part.is_finite()).then(|| y0 * (y1 / y0).powf(part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_found_exactly_and_noise_is_owned_up_to() {
        let exact: Vec<_> = (1..=8).map(|i| (f64::from(i), 3.0 * f64::from(i).powf(-0.75))).collect();
        let fit = fit_power(&exact).unwrap();
        assert!((fit.slope + 0.75).abs() < 1e-12 && fit.standard_error < 1e-12);
        assert!((fit.intercept - 3f64.ln()).abs() < 1e-12);
        // Four points at ln x = 0 to 3 with residuals +d, −d, −d, +d: the slope stays, its error is
        // √(4 d² / 2 / 5).
        let d = 0.1;
        let noisy: Vec<_> = [d, -d, -d, d]
            .iter()
            .enumerate()
            .map(|(i, r)| ((i as f64).exp(), (r - 0.5 * i as f64).exp()))
            .collect();
        let fit = fit_power(&noisy).unwrap();
        assert!((fit.slope + 0.5).abs() < 1e-12);
        assert!((fit.standard_error - d * 0.4f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_curve_has_no_slope() {
        assert_eq!(fit_power(&[(1.0, 1.0), (2.0, 0.5)]), None, "two points have no error");
        assert_eq!(fit_power(&[(1.0, 1.0), (2.0, 0.5), (4.0, 0.0)]), None, "zero has no logarithm");
        assert_eq!(fit_power(&[(2.0, 1.0), (2.0, 0.5), (2.0, 0.1)]), None, "a vertical line");
        assert_eq!(fit_power(&[(1.0, 1.0), (2.0, f64::NAN), (4.0, 1.0)]), None);
    }

    #[test]
    fn percentiles_are_those_of_the_sorted_values() {
        let values = [5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!(percentile(&values, 0.0), Some(1.0));
        assert_eq!(percentile(&values, 0.5), Some(3.0));
        assert_eq!(percentile(&values, 0.875), Some(4.5));
        assert_eq!(percentile(&[], 0.5), None);
        let (mean, deviation) = mean_and_deviation(&values);
        assert!((mean - 3.0).abs() < 1e-12 && (deviation - 2.5f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn between_points_a_curve_is_a_power_law() {
        let curve = [(1.0, 1.0), (4.0, 0.5), (16.0, 0.25)];
        assert!((value_at(&curve, 2.0).unwrap() - 0.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(value_at(&curve, 4.0), Some(0.5));
        assert_eq!((value_at(&curve, 0.5), value_at(&curve, 17.0)), (None, None), "nothing is guessed");
        assert!((first_below(&curve, 0.5f64.sqrt()).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(first_below(&curve, 2.0), Some(1.0));
        assert_eq!(first_below(&curve, 0.1), None);
    }
}
