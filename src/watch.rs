//! What a headless render looks at between passes: whether the noise is down to its goal, and the true error.

use crate::image::compare::LinearImage;
use crate::image::{ErrorLog, ImageError};
use crate::trace::Film;
use crate::trace::convergence::{Convergence, DARK_ENOUGH, FEWEST_TO_STOP, first_look, next_look};
use std::time::{Duration, Instant};

/// Looks at a growing film at counts that depend on nothing but where it began.
#[derive(Debug)]
pub struct Watch {
    goal: Option<f64>,
    log: Option<ErrorLog>,
    convergence: Convergence,
    next: u32,
    /// Samples per pixel of the last row of the log.
    logged: Option<f64>,
    /// Time that looking took, which is no tracing.
    pub spent: Duration,
    /// Why the log ended early: no reason to throw the picture away.
    pub trouble: Option<ImageError>,
}

/// What was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// Nothing to stop for.
    Noisy,
    /// The noise is down to its goal.
    QuietEnough,
    /// There is a goal, but no light after many samples.
    Dark,
}

impl Watch {
    /// For a film that has `samples` already.
    #[must_use]
    pub fn new(goal: Option<f64>, log: Option<ErrorLog>, samples: u32) -> Self {
        let (convergence, next) = (Convergence::default(), first_look(samples));
        Self { goal, log, convergence, next, logged: None, spent: Duration::ZERO, trouble: None }
    }

    /// Samples per pixel to trace before it wants to look again, at most `target`.
    #[must_use]
    pub fn until(&self, target: u32) -> u32 {
        if self.goal.is_some() || self.log.is_some() { target.min(self.next) } else { target }
    }

    /// Looks at `film`, traced for `seconds`, whose noise is estimated to be `noise`.
    pub fn look(&mut self, film: &Film, seconds: f64, noise: Option<f64>) -> Seen {
        let began = Instant::now();
        let samples = film.complete_samples();
        if let Some(noise) = noise {
            self.convergence.note(f64::from(samples), noise);
        }
        self.log(film, None, seconds, noise);
        self.next = next_look(samples);
        self.spent += began.elapsed();
        match (self.goal, noise) {
            (Some(goal), Some(noise)) if noise <= goal && samples >= FEWEST_TO_STOP => Seen::QuietEnough,
            (Some(_), None) if samples >= DARK_ENOUGH => Seen::Dark,
            _ => Seen::Noisy,
        }
    }

    /// Adds a row to the log, if there is one that doesn't have it yet: of the film, or of what was guessed of it.
    pub fn log(&mut self, film: &Film, guess: Option<&LinearImage>, seconds: f64, noise: Option<f64>) {
        let samples = film.mean_samples();
        let Some(log) = &mut self.log else { return };
        if self.logged.replace(samples) != Some(samples)
            && let Err(error) = log.note(guess.unwrap_or(&LinearImage::of(film)), samples, seconds, noise)
        {
            self.log = None;
            self.trouble = Some(error);
        }
    }

    /// Samples per pixel at which the goal will be reached, as soon as that can be told.
    #[must_use]
    pub fn samples_to_goal(&self) -> Option<f64> {
        self.convergence.samples_to(self.goal?)
    }
}
