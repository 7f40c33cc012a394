//! Film → picture → file, and the comparison of two pictures.

pub mod compare;
pub mod develop;
pub mod error_log;
pub mod files;

pub use develop::{Display, Picture, ToneMap};
pub use error_log::ErrorLog;
pub use files::{ImageError, PictureFormat, save};
