//! A coarse whole picture, first of all, whenever the view has changed.

use crate::trace::{Film, RayCounts, TraceScene, trace_pass};
use bevy_ecs::prelude::*;
use std::time::{Duration, Instant};

/// The coarse picture, and how coarse it has to be.
#[derive(Resource, Debug)]
pub struct Preview {
    film: Option<Film>,
    scale: u32,
    seconds_per_pixel: Option<f64>,
    /// Seconds of a first picture that others need.
    reserved: f64,
    /// Seconds that an answer takes beside all that.
    others: f64,
    /// Whether `scale` stays as it is.
    fixed: bool,
}

/// Seconds that a preview may take, with what is carried over from the picture before, ...
const TARGET: f64 = 0.014;
/// ... less if an answer would take longer than this otherwise, ...
const ANSWER: f64 = 0.029;
/// ... but this in any case.
const LEAST: f64 = 0.006;
/// Of [`Preview::target`], what is left to the preview in any case.
const OWN: f64 = 0.2;
/// A finer step is taken only if it is expected to need less than this part of [`Preview::target`]: without the
/// gap two steps would alternate.
const HEADROOM: f64 = 0.7;
/// Pixels of the picture along a pixel of the preview.
const SCALES: [u32; 8] = [1, 2, 3, 4, 6, 8, 12, 16];

impl Default for Preview {
    fn default() -> Self {
        Self { film: None, scale: 8, seconds_per_pixel: None, reserved: 0.0, others: 0.0, fixed: false }
    }
}

impl Preview {
    /// As coarse as this, and with all the time that it takes, however fast the machine is: for pictures that are to
    /// be compared.
    #[must_use]
    pub fn at_scale(scale: u32) -> Self {
        Self { scale: scale.max(1), fixed: true, ..Self::default() }
    }

    /// Traces the whole picture once at the coarseness that fits the time, to the end, and returns its
    /// rays. At scale 1 it leaves that to the film itself and returns `None`.
    pub fn trace(&mut self, scene: &TraceScene) -> Option<RayCounts> {
        self.choose_scale(f64::from(scene.settings.size.element_product()));
        if self.scale == 1 {
            self.film = None;
            return None;
        }
        let size = (scene.settings.size / self.scale).max(glam::UVec2::ONE);
        let film = match &mut self.film {
            Some(film) if film.size() == size => film,
            other => other.insert(Film::new(size, 0)),
        };
        film.reset();
        let start = Instant::now();
        let settings = scene.settings.for_single_samples();
        let scene = TraceScene { settings: &settings, ..*scene };
        let rays = trace_pass(&scene, film, 1, 1, || true);
        self.note(start.elapsed(), f64::from(size.element_product()));
        Some(rays)
    }

    /// Learns what `pixels` pixels cost.
    pub fn note(&mut self, time: Duration, pixels: f64) {
        let measured = time.as_secs_f64() / pixels;
        // Half the old value: one hiccup of the machine does not coarsen the picture by much.
        self.seconds_per_pixel = Some(self.seconds_per_pixel.map_or(measured, |old| 0.5 * (old + measured)));
    }

    /// Leaves this much of the time to others.
    pub fn reserve(&mut self, time: Duration) {
        self.reserved = 0.5 * (self.reserved + time.as_secs_f64());
    }

    /// Learns how long an answer took from the key to the screen, apart from preview and carrying over. One that was late is
    /// no rule.
    pub fn answered(&mut self, others: f64) {
        self.others = 0.75 * self.others + 0.25 * others.clamp(0.0, ANSWER);
    }

    /// Seconds for it and for what is carried over; unlimited if its coarseness is given.
    #[must_use]
    pub fn target(&self) -> f64 {
        if self.fixed {
            return f64::INFINITY;
        }
        (ANSWER - self.others).clamp(LEAST, TARGET)
    }

    /// The coarse film, if the last preview needed one.
    #[must_use]
    pub fn film(&self) -> Option<&Film> {
        self.film.as_ref()
    }

    /// Side of a preview pixel in pixels of the picture.
    #[must_use]
    pub fn scale(&self) -> u32 {
        self.scale
    }

    fn choose_scale(&mut self, pixels: f64) {
        let Some(seconds_per_pixel) = self.seconds_per_pixel.filter(|_| !self.fixed) else { return };
        let target = (self.target() - self.reserved).max(OWN * self.target());
        let cost = |scale: u32| seconds_per_pixel * pixels / f64::from(scale * scale) / target;
        let fits = |limit: f64| SCALES.into_iter().find(|&s| cost(s) <= limit).unwrap_or(16);
        if cost(self.scale) > 1.0 {
            self.scale = fits(1.0);
        } else {
            self.scale = fits(HEADROOM).min(self.scale);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(scale: u32, ms_at_full: f64) -> u32 {
        let mut preview = Preview { scale, seconds_per_pixel: Some(ms_at_full * 1e-3), ..Preview::default() };
        preview.choose_scale(1.0);
        preview.scale
    }

    #[test]
    fn scale_follows_the_measured_time_with_hysteresis() {
        assert_eq!(at(8, 9.0), 1, "cheap pictures need no preview");
        assert_eq!(at(1, 100.0), 3, "100 ms at full size is 11 ms at a third");
        assert_eq!(at(3, 50.0), 3, "12.5 ms at half size would fit, but not with headroom");
        assert_eq!(at(2, 50.0), 2, "and so it stays from below");
        assert_eq!(at(2, 1e9), 16, "never coarser than 16");
        let mut slow = Preview { scale: 3, seconds_per_pixel: Some(0.1), ..Preview::default() };
        (0..20).for_each(|_| slow.answered(0.02));
        slow.choose_scale(1.0);
        assert_eq!(slow.scale, 4, "where the rest of an answer takes 20 ms, 9 are left");
        let mut fixed = Preview { seconds_per_pixel: Some(1e9), ..Preview::at_scale(2) };
        fixed.choose_scale(1.0);
        assert_eq!(fixed.scale, 2, "unless told");
        assert_eq!(fixed.target(), f64::INFINITY, "and then nobody counts the time");
    }
}
