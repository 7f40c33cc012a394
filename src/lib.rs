//! Penumbra: a progressive CPU ray tracer that says how wrong its picture still is.
//!
//! Data flows one way: files → [`load`] → entities ([`scene`]) → `sync` → flat arrays → `bvh` and
//! [`trace`] → film → [`image`](mod@image) → file or screen. [`app`] holds the one list of systems.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, clippy::print_stderr)]

pub mod app;
pub mod bvh;
pub mod cli;
pub mod farm;
mod first_look;
pub mod image;
pub mod load;
pub mod open;
pub mod outputs;
pub mod preview;
pub mod reference;
pub mod render;
pub mod report;
pub mod scene;
pub mod shown;
pub mod sync;
pub mod torture;
pub mod trace;
#[cfg(feature = "view")]
pub mod view;
pub mod watch;
