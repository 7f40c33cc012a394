//! Numerical stability, tried: hard cases with exact answers, as anyone can run them on their machine.
//!
//! A [`Case`] is one way in which ray tracers break. It runs at every [`Place`] and with every set of
//! instructions that matters to it, and gives a [`Check`] for each: what was counted, and the limit that
//! it must keep. Limits are those of theory (zero leaks, so many ulp, 4.5 standard errors), not of what
//! was measured.

pub mod geometry;
pub mod light;
pub mod oracle;
mod place;
pub mod stage;
mod table;
mod trial;

pub use place::Place;
pub use table::{json, markdown, rows};
pub use trial::{Effort, Step, Trial};

use crate::load::Made;
use serde::Serialize;

/// One way to break.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Short and stable, such as `G1`.
    pub id: &'static str,
    /// What is tried, in a few words.
    pub title: &'static str,
    /// What must hold, in words.
    pub limit: &'static str,
    /// Tries it.
    pub run: fn(&Trial<'_>) -> Vec<Check>,
}

/// One measured figure and its limit.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// Of what: mesh, place, kernel.
    pub what: String,
    /// How many were tried.
    pub tried: u64,
    /// What they are.
    pub unit: &'static str,
    /// What came out: smaller is better.
    #[serde(serialize_with = "table::as_it_is")]
    pub ours: f64,
    /// The most that is right.
    pub limit: f64,
    /// Why it may not be kept, if that is known and stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excuse: Option<&'static str>,
}

impl Check {
    /// `ours` of `tried` may be at most `limit`.
    #[must_use]
    pub fn new(what: impl Into<String>, tried: u64, unit: &'static str, ours: f64, limit: f64) -> Self {
        Self { what: what.into(), tried, unit, ours, limit, excuse: None }
    }

    /// None of `tried` may be wrong.
    #[must_use]
    pub fn none(what: impl Into<String>, tried: u64, unit: &'static str, wrong: u64) -> Self {
        Self::new(what, tried, unit, wrong as f64, 0.0)
    }

    /// Whether the limit is kept. What is not a number keeps none, nor does what tried nothing.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.tried > 0 && self.ours <= self.limit
    }
}

/// What a case came to.
#[derive(Clone, Debug)]
pub struct Tried {
    /// Which case.
    pub id: &'static str,
    /// What was tried.
    pub title: &'static str,
    /// What must hold.
    pub limit: &'static str,
    /// All that was measured.
    pub checks: Vec<Check>,
    /// How long it took.
    pub seconds: f64,
    /// Whether nobody interrupted it.
    pub complete: bool,
}

impl Tried {
    /// Whether all limits are kept. What was cut short shows nothing.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.complete && !self.checks.is_empty() && self.checks.iter().all(Check::holds)
    }

    /// Whether all limits are kept but those whose breach is stated.
    #[must_use]
    pub fn holds_but_for_what_is_stated(&self) -> bool {
        let fine = |check: &Check| check.holds() || check.excuse.is_some();
        self.complete && !self.checks.is_empty() && self.checks.iter().all(fine)
    }

    /// In a word or two. Of what was cut short not even a breach is sure: some sums were not complete.
    #[must_use]
    pub fn verdict(&self) -> &'static str {
        if !self.complete {
            "cut short"
        } else if self.holds() {
            "holds"
        } else if self.holds_but_for_what_is_stated() {
            "stated"
        } else {
            "BROKEN"
        }
    }

    /// The check that is furthest from keeping its limit; before those with an excuse one that has none.
    #[must_use]
    pub fn worst(&self) -> Option<&Check> {
        let badness = |check: &Check| {
            let breach = if check.holds() { 0 } else { 1 + u8::from(check.excuse.is_none()) };
            let ratio = match check.limit {
                0.0 => check.ours,
                // Both are slopes, and the steeper the better.
                limit if limit < 0.0 => limit / check.ours.min(-f64::MIN_POSITIVE),
                limit => check.ours / limit,
            };
            (breach, ratio)
        };
        self.checks.iter().max_by(|a, b| {
            let (a, b) = (badness(a), badness(b));
            a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
        })
    }
}

/// All cases, in the order of the table.
#[must_use]
pub fn cases() -> Vec<Case> {
    [geometry::CASES, light::CASES].concat()
}

/// The scene of that name, `torture:G1` or, as it looks when it breaks, `torture:G1-open`.
#[must_use]
pub fn shown(name: &str) -> Option<Made> {
    shows().into_iter().find(|made| made.name.eq_ignore_ascii_case(name))
}

/// All scenes that can be looked at.
#[must_use]
pub fn shows() -> Vec<Made> {
    geometry::SHOWS.to_vec()
}

/// Why there is no scene of that case, or none of how it looks when it breaks; and what there is.
#[must_use]
pub fn why_not_shown(id: &str, open: bool) -> String {
    let all: Vec<&str> = shows().iter().map(|made| made.name.trim_start_matches("torture:")).collect();
    let why = if open && shown(&format!("torture:{id}")).is_some() {
        "nobody made a broken one of it"
    } else if cases().iter().all(|case| !case.id.eq_ignore_ascii_case(id)) {
        "there is no such case"
    } else if id.starts_with(['S', 's']) {
        "it tries numbers, which have no picture"
    } else {
        "it measures single points of light and shade, not a picture"
    };
    format!("--show {id}: {why}; there are {}", all.join(", "))
}

/// Runs `case`.
#[must_use]
pub fn run(case: &Case, trial: &Trial<'_>) -> Tried {
    let start = std::time::Instant::now();
    let checks = (case.run)(trial);
    Tried {
        id: case.id,
        title: case.title,
        limit: case.limit,
        checks,
        seconds: start.elapsed().as_secs_f64(),
        complete: !trial.interrupted(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tried(checks: Vec<Check>) -> Tried {
        Tried { id: "X1", title: "", limit: "", checks, seconds: 0.0, complete: true }
    }

    #[test]
    fn a_limit_is_kept_or_not() {
        assert!(Check::none("", 10, "rays", 0).holds());
        assert!(!Check::none("", 10, "rays", 1).holds());
        assert!(!Check::none("", 0, "rays", 0).holds(), "nothing tried, nothing shown");
        assert!(!Check::new("", 10, "ulp", f64::NAN, 1.0).holds());
        assert!(!tried(Vec::new()).holds());
    }

    #[test]
    fn an_excuse_is_no_verdict() {
        let broken = Check { excuse: Some("why"), ..Check::none("", 10, "rays", 1) };
        let both = tried(vec![Check::none("", 10, "rays", 0), broken]);
        assert!(!both.holds() && both.holds_but_for_what_is_stated());
        assert_eq!(both.worst().map(|check| check.ours), Some(1.0));
    }

    #[test]
    fn what_was_cut_short_has_no_verdict() {
        let whole = tried(vec![Check::none("", 10, "rays", 0)]);
        assert_eq!(whole.verdict(), "holds");
        let part = Tried { complete: false, ..whole };
        assert!(!part.holds() && !part.holds_but_for_what_is_stated());
        assert_eq!(part.verdict(), "cut short");
        let interrupt = std::sync::atomic::AtomicBool::new(true);
        let trial = Trial { effort: Effort::Quick, seed: 1, progress: &|_| {}, interrupt: &interrupt };
        let case = Case { id: "X1", title: "", limit: "", run: |_| vec![Check::none("", 10, "rays", 0)] };
        assert!(!run(&case, &trial).complete);
    }

    #[test]
    fn ids_are_unique() {
        let mut ids: Vec<_> = cases().iter().map(|case| case.id).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), cases().len());
    }

    #[test]
    fn what_broke_is_named_before_what_is_excused() {
        let check = |what: &str, ours: f64, limit: f64| Check::new(what, 1, "", ours, limit);
        let excused = Check { excuse: Some("known"), ..check("excused", 624.0, 16.0) };
        let worst = |checks: Vec<Check>| tried(checks).worst().map(|check| check.what.clone());
        let broken = check("broken", 2.0, 0.0);
        assert_eq!(worst(vec![broken.clone(), excused.clone(), check("held", 0.9, 1.0)]).unwrap(), "broken");
        assert_eq!(worst(vec![check("held", 9.0, 9.5), excused]).unwrap(), "excused");
        // Slopes, which have to be below.
        assert_eq!(worst(vec![check("steep", -1.2, -0.7), check("flat", -0.5, -0.7)]).unwrap(), "flat");
        assert_eq!(
            worst(vec![Check::none("nothing tried", 0, "", 0), check("held", 1.0, 1.0)]).unwrap(),
            "nothing tried"
        );
    }
}
