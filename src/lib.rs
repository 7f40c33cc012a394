//! Penumbra: a progressive CPU ray tracer that says how wrong its picture still is.
//!
//! Data flows one way: files → [`load`] → entities ([`scene`]) → `sync` → flat arrays → `bvh` and
//! `trace` → film → `image` → file or screen.

pub mod load;
pub mod scene;
