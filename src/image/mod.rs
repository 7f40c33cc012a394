//! Film → picture → file, and the comparison of two pictures.

pub mod develop;

pub use develop::{Display, Picture, ToneMap};
