//! The pass table, for people and for programs.

use super::{Check, Tried};
use serde::Serialize;
use std::fmt::Write;

/// A line of the table: case, title, what was tried, ours, the limit, verdict.
#[must_use]
pub fn rows(all: &[Tried]) -> Vec<[String; 6]> {
    all.iter().map(row).collect()
}

fn row(tried: &Tried) -> [String; 6] {
    let verdict = if tried.holds() {
        "holds"
    } else if tried.holds_but_for_what_is_stated() {
        "stated"
    } else {
        "BROKEN"
    };
    let worst = tried.worst();
    [
        tried.id.to_owned(),
        tried.title.to_owned(),
        count(&tried.checks),
        worst.map_or("—".to_owned(), |check| format!("{} {}", number(check.ours), check.what)),
        tried.limit.to_owned(),
        verdict.to_owned(),
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

/// With every check.
///
/// # Errors
/// Never in practice: all numbers and names can be written.
pub fn json(all: &[Tried]) -> serde_json::Result<String> {
    #[derive(Serialize)]
    struct Table<'a> {
        version: &'static str,
        cases: &'a [Tried],
    }
    serde_json::to_string_pretty(&Table { version: env!("CARGO_PKG_VERSION"), cases: all })
}
