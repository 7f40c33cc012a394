//! Film → picture → file, and the comparison of two pictures.

pub mod compare;
pub mod develop;
pub mod error_log;
pub mod files;
pub mod recipe;
pub mod tone_map;

pub use develop::{Display, Picture};
pub use error_log::ErrorLog;
pub use files::{ImageError, PictureFormat, save};
pub use tone_map::ToneMap;
