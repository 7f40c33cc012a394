//! Light from a picture of the sky: pixels are chosen by what they bring, and the direction evenly within one.
//!
//! Reference: M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", 4th ed., 12.5.

use super::light::LightSample;
use crate::scene::Sky;
use crate::scene::color::luminance;
use glam::{DVec3, Mat3, Vec2, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

/// A [`Sky`] in render space.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyLight {
    sky: Sky,
    /// Multiplies its radiance.
    scale: Vec3,
    render_from_sky: Mat3,
    table: Arc<Table>,
}

/// Which pixel a random number means: a row by its share, then a column in it.
#[derive(Debug, PartialEq)]
struct Table {
    /// Cumulative shares of the rows; the last is 1.
    rows: Vec<f32>,
    /// Those of the columns in each row.
    columns: Vec<f32>,
    /// Mean radiance over all directions, before the scale.
    mean: Vec3,
}

impl SkyLight {
    /// `None` if it is black. One of the same picture, if there was one, lends its table.
    #[must_use]
    pub fn new(sky: &Sky, scale: Vec3, render_from_sky: Mat3, before: Option<&Self>) -> Option<Self> {
        if scale == Vec3::ZERO {
            return None;
        }
        let table = match before.filter(|before| before.sky == *sky) {
            Some(before) => Arc::clone(&before.table),
            None => Arc::new(Table::new(sky)?),
        };
        Some(Self { sky: sky.clone(), scale, render_from_sky, table })
    }

    /// Mean luminance over all directions.
    #[must_use]
    pub fn mean_luminance(&self) -> f32 {
        luminance(self.table.mean * self.scale)
    }

    /// Radiance from the unit direction `wi`, and the density of [`SkyLight::sample`] there.
    #[must_use]
    pub fn toward(&self, wi: Vec3) -> (Vec3, f32) {
        let [x, y] = self.sky.pixel_toward(self.render_from_sky.transpose() * wi);
        let [width, _] = self.sky.size();
        (self.sky.radiance()[y * width + x] * self.scale, self.pdf(x, y))
    }

    /// A direction toward the sky.
    #[must_use]
    pub fn sample(&self, u: Vec2) -> Option<LightSample> {
        let [width, height] = self.sky.size();
        let (y, v) = choose(&self.table.rows, u.y);
        let (x, h) = choose(&self.table.columns[y * width..(y + 1) * width], u.x);
        let [top, bottom] = [y, y + 1].map(|y| (PI * y as f32 / height as f32).cos());
        let cos = top + (bottom - top) * v;
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let turn = 2.0 * PI * ((x as f32 + h) / width as f32 - 0.5);
        let wi = self.render_from_sky * Vec3::new(sin * turn.sin(), cos, -sin * turn.cos());
        let radiance = self.sky.radiance()[y * width + x] * self.scale;
        let pdf = self.pdf(x, y);
        (pdf > 0.0).then(|| LightSample::new(wi.normalize(), None, radiance, Some(pdf)))
    }

    /// Density in solid angle within a pixel.
    fn pdf(&self, x: usize, y: usize) -> f32 {
        let [width, height] = self.sky.size();
        let share =
            |cumulative: &[f32], i: usize| cumulative[i] - if i > 0 { cumulative[i - 1] } else { 0.0 };
        let row = share(&self.table.rows, y);
        let column = share(&self.table.columns[y * width..(y + 1) * width], x);
        row * column / solid_angle(y, width, height) as f32
    }
}

/// Of a pixel of row `y`.
fn solid_angle(y: usize, width: usize, height: usize) -> f64 {
    let cos = |y: usize| (std::f64::consts::PI * y as f64 / height as f64).cos();
    std::f64::consts::TAU / width as f64 * (cos(y) - cos(y + 1))
}

/// The entry that `u` in [0, 1) means, and how far it is within it, in [0, 1).
fn choose(cumulative: &[f32], u: f32) -> (usize, f32) {
    let i = cumulative.partition_point(|&c| c <= u).min(cumulative.len() - 1);
    let before = if i > 0 { cumulative[i - 1] } else { 0.0 };
    let within = (u - before) / (cumulative[i] - before).max(f32::MIN_POSITIVE);
    (i, within.clamp(0.0, 1.0 - f32::EPSILON / 2.0))
}

impl Table {
    fn new(sky: &Sky) -> Option<Self> {
        let [width, height] = sky.size();
        let mut sums = Vec::with_capacity(height);
        let mut mean = DVec3::ZERO;
        let mut columns = Vec::with_capacity(width * height);
        for (y, row) in sky.radiance().chunks_exact(width).enumerate() {
            let weights: Vec<f64> = row.iter().map(|&pixel| f64::from(luminance(pixel))).collect();
            let weights = with_floor(weights);
            let sum = accumulate(&weights, &mut columns);
            sums.push(sum * solid_angle(y, width, height));
            mean += row.iter().map(|pixel| pixel.as_dvec3()).sum::<DVec3>() * solid_angle(y, width, height);
        }
        let mut rows = Vec::with_capacity(height);
        let total = accumulate(&with_floor(sums), &mut rows);
        let mean = (mean / (4.0 * std::f64::consts::PI)).as_vec3();
        (total > 0.0 && total.is_finite()).then_some(Self { rows, columns, mean })
    }
}

/// Adds a thousandth of their mean to those that are not zero: beside a sun the share of the blue sky would be lost
/// in the rounding of the sum, and what is never chosen is missing from the picture.
fn with_floor(mut weights: Vec<f64>) -> Vec<f64> {
    let floor = 1e-3 * weights.iter().sum::<f64>() / weights.len() as f64;
    weights.iter_mut().filter(|weight| **weight > 0.0).for_each(|weight| *weight += floor);
    weights
}

/// Appends the cumulative shares of `weights`; returns their sum. What has no weight has no share; without
/// any weight all have the same.
fn accumulate(weights: &[f64], cumulative: &mut Vec<f32>) -> f64 {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    for (i, weight) in weights.iter().enumerate() {
        sum += weight;
        let share = if total > 0.0 { sum / total } else { (i + 1) as f64 / weights.len() as f64 };
        cumulative.push(share as f32);
    }
    // Rounding may have left it below.
    let last = cumulative.len() - weights.len()..cumulative.len();
    let full = weights.iter().rposition(|&weight| weight > 0.0).unwrap_or(weights.len() - 1);
    cumulative[last][full..].fill(1.0);
    total
}
