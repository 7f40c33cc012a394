//! How hard a case is tried, and how it tells how far it is.

use std::sync::atomic::{AtomicBool, Ordering};

/// How much of the machine's time the cases may take together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// Seconds: for tests.
    Quick,
    /// Below three minutes on two cores.
    #[default]
    Normal,
    /// Hours: 10⁹ rays, 10⁸ samples.
    Long,
}

/// How far a case is.
#[derive(Clone, Debug)]
pub struct Step {
    /// Which case.
    pub id: &'static str,
    /// What it is at: mesh, place, kernel.
    pub what: String,
    /// How much of it is done, 0 to 1.
    pub part: f64,
}

/// What a case is given.
#[derive(Clone, Copy)]
pub struct Trial<'a> {
    /// How hard to try.
    pub effort: Effort,
    /// Another seed, other rays.
    pub seed: u64,
    /// Told now and then.
    pub progress: &'a (dyn Fn(Step) + Sync),
    /// Set when the user has had enough: what was measured till then is returned.
    pub interrupt: &'a AtomicBool,
}

impl Trial<'_> {
    /// One of three numbers, by effort.
    #[must_use]
    pub fn pick(&self, quick: u64, normal: u64, long: u64) -> u64 {
        match self.effort {
            Effort::Quick => quick,
            Effort::Normal => normal,
            Effort::Long => long,
        }
    }

    /// Whether to stop.
    #[must_use]
    pub fn interrupted(&self) -> bool {
        self.interrupt.load(Ordering::Relaxed)
    }

    /// Tells how far it is.
    pub fn tell(&self, id: &'static str, what: impl Into<String>, part: f64) {
        (self.progress)(Step { id, what: what.into(), part });
    }
}
