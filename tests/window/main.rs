//! The program in a real X server, driven as a user drives it.
//!
//! Needs `Xvfb`, `xdotool` and `import` of `ImageMagick`; with `openbox` and `wmctrl` also what only a
//! window manager can do. Without them the tests say that they were skipped, unless `CI` is set or
//! `PENUMBRA_WINDOW_TESTS=required`: then that is a failure.
#![cfg(all(feature = "view", target_os = "linux"))]

#[path = "../support/desktop.rs"]
mod desktop;
mod editing;
mod explaining;
mod files;
mod flying;
mod looks;
mod moving;
mod pictures;
mod places;
mod resizing;
mod things;
mod views;
mod watched;
