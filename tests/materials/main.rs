//! What surfaces do with light: normals, lobes, layers, textures.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test shows its figures, and fails at the first wrong one"
)]
#![allow(clippy::duplicate_mod, reason = "several of the modules below use the same random numbers")]

#[path = "../support/chi_square.rs"]
mod chi_square;
mod energy;
#[path = "../support/geometry.rs"]
mod geometry;
mod kinds;
mod normals;
mod samplers;
#[path = "../support/stage.rs"]
mod stage;
mod terminator;
