//! The torture chamber's room of light: each case holds, and each checker finds what it is there for.
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

mod lights;
mod numbers;
mod shading;

use penumbra::torture::{self, Check, Effort, Step, Trial};
use std::sync::atomic::AtomicBool;

static INTERRUPT: AtomicBool = AtomicBool::new(false);

fn silent(_: Step) {}

fn trial() -> Trial<'static> {
    Trial { effort: Effort::Quick, seed: 0, progress: &silent, interrupt: &INTERRUPT }
}

/// Panics unless all of a case's limits are kept.
fn holds(ids: &[&str]) {
    for id in ids {
        let case = torture::cases().into_iter().find(|case| case.id == *id).unwrap();
        let tried = torture::run(&case, &trial());
        let broken: Vec<&Check> = tried.checks.iter().filter(|check| !check.holds()).collect();
        println!("{id}: {} checks in {:.1} s", tried.checks.len(), tried.seconds);
        assert!(!tried.checks.is_empty());
        assert!(tried.holds_but_for_what_is_stated(), "{id}: {broken:#?}");
    }
}

/// Panics unless one of the checks is broken whose name has `word` in it, and says which.
fn finds(word: &str, checks: &[Check]) {
    let named: Vec<&Check> = checks.iter().filter(|check| check.what.contains(word)).collect();
    assert!(!named.is_empty(), "no check is about {word}: {checks:#?}");
    assert!(named.iter().any(|check| !check.holds()), "nobody notices: {named:#?}");
}

#[test]
fn lights_hold() {
    holds(&["L1", "L2", "L3", "L4", "L5", "L6", "L7", "L8", "L9", "L10"]);
}

#[test]
fn shadows_and_rooms_hold() {
    holds(&["L11", "L11b", "L11c", "L12", "L13"]);
}

#[test]
fn switches_densities_and_choices_hold() {
    holds(&["L14", "L15", "L16"]);
}

#[test]
fn random_numbers_hold() {
    holds(&["S1", "S2", "S3", "S4"]);
}

#[test]
fn sums_and_pictures_hold() {
    holds(&["S5", "S6", "S7", "S8", "S9", "S10"]);
}

#[test]
fn errors_fall_as_they_should() {
    holds(&["S11", "S12"]);
}

#[test]
fn shading_holds() {
    holds(&["H1", "H2", "H3", "H4", "H5", "H6", "H12"]);
}

#[test]
fn surfaces_and_transport_hold() {
    holds(&["H7", "H8", "H9", "H10", "H11"]);
}

/// What was interrupted is not judged; what was never tried does not hold.
#[test]
fn an_interrupted_case_says_nothing_wrong() {
    let interrupt = AtomicBool::new(true);
    let trial = Trial { interrupt: &interrupt, ..trial() };
    for case in torture::cases().into_iter().filter(|case| ["L1", "L12", "S6", "S12"].contains(&case.id)) {
        let tried = torture::run(&case, &trial);
        assert!(tried.checks.iter().all(Check::holds), "{}: {:#?}", case.id, tried.checks);
    }
}
