//! What the engine's thread and the window's tell each other.

use super::controls::{Notice, Notices};
use super::debug::layer::Layer;
use super::plain::{Plain, Shot};
use super::sides::Compared;
use super::status::Status;
use crate::app::App;
use crate::image::Picture;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// What the engine tells the window's thread to look at.
#[derive(Clone, Debug)]
pub enum Wake {
    /// [`Published`] has news.
    FrameReady,
    /// The scene could not be opened.
    OpenFailed(String),
    /// The engine's thread panicked.
    Crashed(String),
    /// The picture of the film alone that this key asked for.
    Plain(Shot),
    /// Something to show to the user.
    Notice(String),
    /// What the user wanted to open could not be, and why.
    NotOpened(String),
    /// Something to be pasted elsewhere, and what to say before it.
    Copy {
        /// Nothing, or with its end of a sentence.
        said: String,
        /// To be pasted.
        text: String,
    },
    /// Another scene is shown now.
    Opened {
        /// Its name.
        name: String,
        /// Where its file lies, with a separator at its end; empty if it has none.
        folder: String,
    },
}

/// The latest that the engine made; what the window has not taken is overwritten.
#[derive(Debug, Default)]
pub struct Published {
    /// A picture, if it is newer than the one taken last.
    pub picture: Option<Picture>,
    /// A picture that is no longer needed, for its memory.
    pub spare: Picture,
    /// What is drawn over the picture.
    pub layer: Option<Arc<Layer>>,
    /// What is loading, and how far it is.
    pub loading: Option<String>,
    /// What the picture is compared with.
    pub compared: Compared,
    /// For the status lines. `None` until the scene is open.
    pub status: Option<Status>,
    /// Whether the view is changing, so that pictures are to be shown at once.
    pub moving: bool,
    /// When the user asked for what the picture is the first to show.
    pub asked: Option<Instant>,
}

/// Locks `mutex`, also after a thread panicked with it: what we share is whole at any time.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Passes the frame's notices on.
pub fn say(app: &mut App, wake: &impl Fn(Wake)) {
    for shot in std::mem::take(&mut app.world.resource_mut::<Plain>().0) {
        wake(Wake::Plain(shot));
    }
    for notice in std::mem::take(&mut app.world.resource_mut::<Notices>().0) {
        wake(match notice {
            Notice::Text(text) => Wake::Notice(text),
            Notice::Print(text) => {
                use std::io::Write;
                // Whoever closed standard output does not want to read it.
                let _ = writeln!(std::io::stdout(), "{text}");
                Wake::Copy { said: String::new(), text }
            }
            Notice::Saved(said, text) => {
                use std::io::Write;
                let _ = writeln!(std::io::stdout(), "{text}");
                Wake::Copy { said, text }
            }
        });
    }
}

/// The text of a caught panic.
pub fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("panic without a message").to_owned()
}
