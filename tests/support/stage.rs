//! The stage of the torture chamber, with assertions.
#![allow(dead_code, unused_imports, reason = "each test file uses its part")]
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

pub use penumbra::torture::oracle::Rng;
pub use penumbra::torture::stage::*;

use penumbra::app::{FrameBudget, FrameStats};
use penumbra::trace::Film;

/// Frames as they are made for anybody.
pub trait Frames {
    /// Runs frames until every pixel has `samples`.
    fn trace(&mut self, samples: u32) -> &Film;
    fn film(&self) -> &Film;
}

impl Frames for Stage {
    fn trace(&mut self, samples: u32) -> &Film {
        {
            let mut budget = self.app.world.resource_mut::<FrameBudget>();
            budget.sample_target = samples;
            budget.pass_samples = 16;
        }
        loop {
            self.app.frame();
            if self.app.world.resource::<FrameStats>().done {
                break;
            }
        }
        let film = self.film();
        assert_eq!(film.complete_samples(), samples);
        assert_eq!(film.dropped(), 0, "samples that are not finite");
        film
    }

    fn film(&self) -> &Film {
        self.app.world.resource::<Film>()
    }
}

/// What an estimate must be.
pub trait Exact {
    /// Panics unless `exact` lies within 4.5 standard errors (two-sided p = 7e-6), and unless those are
    /// at most `accuracy` of it: a test that accepts everything is no test.
    fn assert_is(&self, name: &str, exact: f64, accuracy: f64);
}

impl Exact for Estimate {
    fn assert_is(&self, name: &str, exact: f64, accuracy: f64) {
        let bound = 4.5 * self.sigma + ROUNDING * exact.abs();
        let off = self.mean - exact;
        let relative = if exact == 0.0 { bound } else { bound / exact.abs() };
        println!("{name}: {:.9} exact {exact:.9}, off {:+.1e}, bound {relative:.1e}", self.mean, off / exact);
        assert!(relative <= accuracy, "{name}: bound {relative:.1e} would accept too much");
        assert!(off.abs() <= bound, "{name}: {} is not {exact}; bound {bound:.1e}", self.mean);
    }
}

/// What single precision may add up to in one sample, relative.
const ROUNDING: f64 = 3e-6;
