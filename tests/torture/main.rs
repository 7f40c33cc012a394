//! The torture chamber's cases hold, and every checker finds who does it wrong.

mod geometry;
mod program;
mod scenes;
mod show;
