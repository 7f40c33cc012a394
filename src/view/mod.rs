//! What people see: a window that is never busy, over an engine that always is.
//!
//! Two threads. The window's ([`window`]) handles events, draws and presents; the engine's
//! ([`engine`]) owns the [`App`] and runs its frames. [`input::Command`]s go one way over a channel,
//! pictures the other way over a shared slot. What a key does stands in [`keymap`], and what it does
//! to the world in [`fly`] and [`controls`].

pub mod bookmarks;
pub mod cameras;
pub mod chord;
pub mod controls;
pub mod crop;
pub mod debug;
pub mod edit;
pub mod engine;
pub mod exchange;
pub mod flags;
pub mod fly;
pub mod input;
pub mod instrument;
pub mod keymap;
mod keys;
pub mod keys_file;
pub mod orbit;
pub mod pixel_view;
pub mod plain;
pub mod playing;
mod pointer;
mod prepare;
mod present;
pub mod recipe;
pub mod reload;
pub mod replay;
pub mod screen;
pub mod screenshot;
pub mod sides;
pub mod status;
pub mod ui;
mod waiting;
pub mod watch;
pub mod window;

use crate::app::App;
use crate::image::compare::LinearImage;
use crate::load::Watcher;
use exchange::Wake;
use glam::UVec2;
use std::time::Duration;
use winit::event_loop::{EventLoop, EventLoopBuilder};

/// What the window is like.
#[derive(Debug)]
pub struct ViewOptions {
    /// First words of the window's title.
    pub title: String,
    /// Size of the picture when the window opens, physical pixels, or ...
    pub size: UVec2,
    /// ... points of the display, if nobody asked for that size.
    pub in_points: bool,
    /// Where to look for other scenes first, with a separator at its end.
    pub folder: String,
    /// Name of the scene: screenshots are called `{screenshot_stem}_{n}.png`.
    pub screenshot_stem: String,
    /// A picture to measure the true error by, of the view that the window opens with.
    pub reference: Option<LinearImage>,
    /// Which keys do what.
    pub keys: keymap::Keymap,
    /// What to say first.
    pub notice: String,
    /// What to do, as if a user did it. Then the times from events to pictures are printed.
    pub replay: Option<replay::Replay>,
    /// Where to write down what the user does.
    pub record: Option<replay::Recorder>,
    /// Closes the window by itself after this time.
    pub exit_after: Option<Duration>,
}

/// How fast the window answered.
#[derive(Clone, Debug, Default)]
pub struct Response {
    /// From events to the first picture that shows their effect, sorted.
    pub latencies: Vec<Duration>,
    /// Pictures presented.
    pub pictures: u64,
    /// Those of them while the view changed, and the time that they took.
    pub moving_pictures: u64,
    /// See `moving_pictures`.
    pub moving_time: Duration,
}

impl Response {
    /// The latency that this part of all does not exceed, milliseconds; `None` if there was no event.
    #[must_use]
    pub fn percentile(&self, part: f64) -> Option<f64> {
        let rank = (self.latencies.len() as f64 * part).ceil() as usize;
        let latency = self.latencies.get(rank.max(1) - 1).or(self.latencies.last())?;
        Some(latency.as_secs_f64() * 1e3)
    }

    /// One JSON object.
    #[must_use]
    pub fn json(&self) -> String {
        let number = |x: Option<f64>| x.map_or("null".to_owned(), |x| format!("{x:.2}"));
        let rate = self.moving_pictures as f64 / self.moving_time.as_secs_f64();
        format!(
            "{{\"events\": {}, \"median_ms\": {}, \"p99_ms\": {}, \"pictures\": {}, \"moving_pictures_per_second\": {}}}",
            self.latencies.len(),
            number(self.percentile(0.5)),
            number(self.percentile(0.99)),
            self.pictures,
            number(Some(rate).filter(|rate| rate.is_finite())),
        )
    }
}

/// Why there is no window (any more).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// There is nothing to open a window on. The scene has not been opened.
    #[error("no window can be opened: {0}")]
    NoDisplay(String),
    /// The scene could not be opened.
    #[error("{0}")]
    Scene(String),
    /// The window or the engine behind it broke down.
    #[error("the window was lost: {0}")]
    Lost(String),
}

/// Opens the window and returns when it is closed.
///
/// `open` makes the app, and says how far it is. It runs on the engine's thread once the window is there, so a scene that
/// loads for a minute is a window that says so for a minute. Call this on the main thread, once.
///
/// # Errors
/// - [`ViewError::NoDisplay`] without a display server, its libraries or a graphics adapter;
///   `open` has not been called then.
/// - [`ViewError::Scene`] if `open` fails.
/// - [`ViewError::Lost`] if the window or the engine breaks down later.
pub fn run(
    options: ViewOptions,
    open: impl FnOnce(Watcher) -> Result<App, String> + Send + 'static,
) -> Result<Response, ViewError> {
    let event_loop = event_loop().map_err(ViewError::NoDisplay)?;
    let mut viewer = window::Viewer::new(options, event_loop.create_proxy(), Box::new(open));
    let outcome = event_loop.run_app(&mut viewer);
    let response = viewer.finish()?;
    outcome.map_err(|e| ViewError::Lost(e.to_string()))?;
    Ok(response)
}

fn event_loop() -> Result<EventLoop<Wake>, String> {
    let mut builder = EventLoop::<Wake>::with_user_event();
    prefer_what_is_there(&mut builder)?;
    // A missing libxkbcommon-x11 is a panic in there.
    screen::quietly(|| builder.build())
        .map_err(|panic| format!("a library is missing: {panic}"))?
        .map_err(|e| without_place(&e.to_string()).to_owned())
}

/// Without the source file and line that winit begins its messages with.
fn without_place(message: &str) -> &str {
    match message.strip_prefix("os error at ").and_then(|rest| rest.split_once(": ")) {
        Some((_, what)) => what,
        None => message,
    }
}

/// Chooses X11 if the Wayland display that the environment names does not answer: the event loop
/// would not fall back by itself, and cannot be tried twice.
#[cfg(target_os = "linux")]
fn prefer_what_is_there(builder: &mut EventLoopBuilder<Wake>) -> Result<(), String> {
    use std::env::var_os;
    use std::os::unix::net::UnixStream;
    use std::path::PathBuf;
    use winit::platform::x11::EventLoopBuilderExtX11;

    let set = |name| var_os(name).filter(|value| !value.is_empty());
    let (wayland, x11) = (set("WAYLAND_DISPLAY"), set("DISPLAY"));
    if set("WAYLAND_SOCKET").is_some() {
        return Ok(());
    }
    let Some(name) = wayland else {
        return match x11 {
            Some(_) => Ok(()),
            None => Err("neither DISPLAY nor WAYLAND_DISPLAY is set".to_owned()),
        };
    };
    // `join` keeps an absolute name as it is.
    let socket = set("XDG_RUNTIME_DIR").map(PathBuf::from).unwrap_or_default().join(name);
    if x11.is_some() && UnixStream::connect(&socket).is_err() {
        builder.with_x11();
    }
    Ok(())
}

#[cfg(not(target_os = "linux"))]
fn prefer_what_is_there(_: &mut EventLoopBuilder<Wake>) -> Result<(), String> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_tell_what_is_wrong_and_not_where_in_the_source() {
        assert_eq!(without_place("os error at /a/b.rs:7: no display: :9"), "no display: :9");
        assert_eq!(
            without_place("the requested operation is not supported"),
            "the requested operation is not supported"
        );
    }
}
