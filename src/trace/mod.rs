//! How light travels: functions over flat arrays. No ECS below the doc comments, no files, no clock.

pub mod film;
pub mod settings;

pub use film::Film;
pub use settings::{Integrator, RenderSettings};
