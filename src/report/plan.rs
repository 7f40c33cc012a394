//! How the time of a scene is spent.

use serde::Serialize;
use std::time::Duration;

/// Seconds for the parts of one scene, and how often. A part that is done early gives nothing to others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Making the reference.
    pub reference: f64,
    /// Runs of our own method.
    pub ours: Runs,
    /// Runs of each other way to render.
    pub other: Runs,
    /// Runs of each of ours with one thing switched off.
    pub ablation: Runs,
    /// All runs of the noise check.
    pub noise_check: f64,
    /// Runs of each method.
    pub seeds: u32,
}

/// Seconds for the runs of a method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Runs {
    /// For the first.
    pub first: f64,
    /// For each further one.
    pub again: f64,
}

/// Which kind a method is of: how long its runs are depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Our own method.
    Ours,
    /// Another way to render.
    Other,
    /// Ours with one thing switched off.
    Ablation,
}

/// Methods beside ours, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Company {
    /// Other ways to render.
    pub others: usize,
    /// Ours with one thing switched off.
    pub ablations: usize,
}

/// Of a scene, where a report of [`FEWEST_SCENES`] is to end in less than ten minutes, opening, measuring and drawing
/// included: each run takes some 0.4 s beside its tracing.
const IDEAL_SHARE: f64 = 170.0;
/// Of these. Our own run of 30 s is the longest that the table asks for. Ablations are there to be seen side by side: a second
/// of each, which the table asks for, does, and 16 samples of the owl. The reference gets the rest, about a third: measured errors are only as good.
const IDEAL: Plan = Plan {
    reference: 50.0,
    ours: Runs { first: 30.5, again: 2.5 },
    other: Runs { first: 6.0, again: 1.5 },
    ablation: Runs { first: 1.9, again: 1.1 },
    noise_check: 7.0,
    seeds: 4,
};
/// So many scenes share the whole; fewer do not take longer.
pub const FEWEST_SCENES: usize = 3;

impl Plan {
    /// For one of `scenes` scenes in `total`, with these methods beside ours and `seeds` runs of each. However many these are,
    /// the reference has its part and our first run its time: the others are shorter then.
    #[must_use]
    pub fn new(total: Duration, scenes: usize, company: Company, seeds: u32) -> Self {
        let share = Self::share(total, scenes);
        let scale = share / IDEAL_SHARE;
        let at = |runs: Runs, scale: f64| Runs { first: runs.first * scale, again: runs.again * scale };
        let ours = at(IDEAL.ours, scale);
        let fixed = Self {
            reference: IDEAL.reference * scale,
            ours: Runs { again: 0.0, ..ours },
            other: at(IDEAL.other, 0.0),
            ablation: at(IDEAL.ablation, 0.0),
            noise_check: IDEAL.noise_check * scale,
            seeds: seeds.max(1),
        };
        let wanted = Self { seeds: fixed.seeds, ..IDEAL };
        let wanted = wanted.seconds(company) - IDEAL.reference - IDEAL.ours.first - IDEAL.noise_check;
        // In units of what they would like to have; NaN (nobody wants anything) is no limit.
        let fit = ((share - fixed.seconds(company)) / wanted).min(scale);
        let mut plan = Self {
            ours: Runs { again: IDEAL.ours.again * fit, ..ours },
            other: at(IDEAL.other, fit),
            ablation: at(IDEAL.ablation, fit),
            ..fixed
        };
        plan.reference += share - plan.seconds(company);
        plan
    }

    /// Seconds of each of `scenes` scenes in `total`.
    #[must_use]
    pub fn share(total: Duration, scenes: usize) -> f64 {
        total.as_secs_f64() / scenes.max(FEWEST_SCENES) as f64
    }

    /// Of a run: the first of a method is longer.
    #[must_use]
    pub fn run(&self, kind: Kind, seed: u32) -> f64 {
        let runs = match kind {
            Kind::Ours => self.ours,
            Kind::Other => self.other,
            Kind::Ablation => self.ablation,
        };
        if seed == 0 { runs.first } else { runs.again }
    }

    /// Of a whole scene, with these methods beside ours.
    #[must_use]
    pub fn seconds(&self, company: Company) -> f64 {
        let again = f64::from(self.seeds - 1);
        let of = |runs: &Runs| runs.first + again * runs.again;
        let others = company.others as f64 * of(&self.other) + company.ablations as f64 * of(&self.ablation);
        self.reference + of(&self.ours) + others + self.noise_check
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn the_plan_fills_the_time_and_no_more() {
        for (scenes, others, ablations, seeds) in [(3, 2, 10, 4), (7, 9, 30, 8), (3, 0, 0, 1), (3, 2, 99, 64)]
        {
            let company = Company { others, ablations };
            let plan = Plan::new(Duration::from_secs(510), scenes, company, seeds);
            assert!((plan.seconds(company) * scenes as f64 - 510.0).abs() < 1e-9);
            assert!(plan.reference >= 0.29 * Plan::share(Duration::from_secs(510), scenes), "{plan:?}");
        }
        let company = Company { others: 2, ablations: 10 };
        let one = Plan::new(Duration::from_secs(510), 1, company, 4);
        assert!((one.seconds(company) - 170.0).abs() < 1e-9, "one scene does not take longer");
    }
}
