//! The pass table, for people and for programs.

use super::{Check, Tried};
use serde::{Serialize, Serializer};
use std::fmt::Write;

/// A line of the table: case, title, what was tried, ours, the limit, verdict.
#[must_use]
pub fn rows(all: &[Tried]) -> Vec<[String; 6]> {
    all.iter().map(row).collect()
}

fn row(tried: &Tried) -> [String; 6] {
    let worst = tried.worst();
    [
        tried.id.to_owned(),
        tried.title.to_owned(),
        count(&tried.checks),
        worst.map_or("—".to_owned(), |check| format!("{} {}", number(check.ours), check.what)),
        tried.limit.to_owned(),
        tried.verdict().to_owned(),
    ]
}

/// All that was tried, by unit.
fn count(checks: &[Check]) -> String {
    let mut units: Vec<(&str, u64)> = Vec::new();
    for check in checks {
        match units.iter_mut().find(|(unit, _)| *unit == check.unit) {
            Some((_, sum)) => *sum += check.tried,
            None => units.push((check.unit, check.tried)),
        }
    }
    units.iter().map(|(unit, sum)| format!("{} {unit}", number(*sum as f64))).collect::<Vec<_>>().join(", ")
}

/// Short: whole up to a million, else with an exponent.
fn number(x: f64) -> String {
    if x.fract() == 0.0 && x.abs() < 1e6 { format!("{x}") } else { format!("{x:.2e}") }
}

/// As a Markdown table.
#[must_use]
pub fn markdown(all: &[Tried]) -> String {
    let mut text =
        "| case | what | tried | ours (worst) | limit | verdict |\n|---|---|---|---|---|---|\n".to_owned();
    for row in rows(all) {
        let _ = writeln!(text, "| {} |", row.join(" | "));
    }
    text
}

/// A number; what is none by its name, which JSON has no number for.
pub(super) fn as_it_is<S: Serializer>(x: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if x.is_finite() { serializer.serialize_f64(*x) } else { serializer.serialize_str(&x.to_string()) }
}

/// With every check, and whether it holds.
///
/// # Errors
/// Never in practice: all numbers and names can be written.
pub fn json(all: &[Tried]) -> serde_json::Result<String> {
    #[derive(Serialize)]
    struct Table<'a> {
        version: &'static str,
        cases: Vec<One<'a>>,
    }
    #[derive(Serialize)]
    struct One<'a> {
        id: &'static str,
        title: &'static str,
        limit: &'static str,
        verdict: &'static str,
        complete: bool,
        seconds: f64,
        checks: Vec<Judged<'a>>,
    }
    #[derive(Serialize)]
    struct Judged<'a> {
        holds: bool,
        #[serde(flatten)]
        check: &'a Check,
    }
    fn judged(check: &Check) -> Judged<'_> {
        Judged { holds: check.holds(), check }
    }
    fn one(tried: &Tried) -> One<'_> {
        let Tried { id, title, limit, ref checks, seconds, complete } = *tried;
        let checks = checks.iter().map(judged).collect();
        One { id, title, limit, verdict: tried.verdict(), complete, seconds, checks }
    }
    let cases = all.iter().map(one).collect();
    serde_json::to_string_pretty(&Table { version: env!("CARGO_PKG_VERSION"), cases })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_read_verdicts() {
        let check = |ours: f64| Check::new("x", 10, "rays", ours, 1.0);
        let tried = |checks| Tried { id: "X1", title: "t", limit: "l", checks, seconds: 0.5, complete: true };
        let cut = Tried { complete: false, ..tried(vec![check(0.5)]) };
        let all = [tried(vec![check(0.5), check(f64::NAN), check(f64::INFINITY)]), cut];
        let read: serde_json::Value = serde_json::from_str(&json(&all).unwrap()).unwrap();
        let [first, second] = [0, 1].map(|i| &read["cases"][i]);
        assert_eq!((&first["verdict"], &first["complete"]), (&"BROKEN".into(), &true.into()));
        assert_eq!((&second["verdict"], &second["complete"]), (&"cut short".into(), &false.into()));
        let checks = &first["checks"];
        assert_eq!((&checks[0]["holds"], &checks[0]["ours"]), (&true.into(), &0.5.into()));
        assert_eq!((&checks[1]["holds"], &checks[1]["ours"]), (&false.into(), &"NaN".into()));
        assert_eq!(checks[2]["ours"], "inf");
        assert_eq!(rows(&all)[1][5], "cut short");
        assert!(markdown(&all).lines().last().unwrap().ends_with("| cut short |"));
    }
}
