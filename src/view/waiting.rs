//! What the engine waits for, and what is waiting for it.

use super::input::Command;
use super::watch::{PAUSE, SceneWatch};
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::Instant;

/// The files of the scene, and when it is to be loaded again for them.
pub struct Files {
    /// None without files.
    pub watch: Option<SceneWatch>,
    /// When.
    pub due: Option<Instant>,
}

impl Files {
    /// Something happened in their folders.
    pub fn look(&mut self) {
        if self.watch.as_mut().is_some_and(SceneWatch::has_changed) {
            self.due = Some(Instant::now() + PAUSE);
        }
    }

    /// Whether it is to be loaded now; once.
    pub fn is_time(&mut self) -> bool {
        self.due.take_if(|due| *due <= Instant::now()).is_some()
    }

    /// The next command, or until it is time.
    pub fn wait(&self, commands: &Receiver<Command>) -> Result<Command, RecvTimeoutError> {
        match self.due {
            Some(due) => commands.recv_timeout(due.saturating_duration_since(Instant::now())),
            None => commands.recv().map_err(|_| RecvTimeoutError::Disconnected),
        }
    }
}

/// Takes what the next frame does. Its systems have an order of their own: what a key does shall come after all that
/// the user did before, so a key waits for a frame of its own, with its repetitions.
pub fn of_one_frame(waiting: &mut VecDeque<Command>) -> Vec<Command> {
    let first = match waiting.front() {
        Some(Command::Tap { press, .. }) => Some(press.tap),
        _ => None,
    };
    let waits = |command: &Command| matches!(command, Command::Tap { press, .. } if Some(press.tap) != first);
    let count = waiting.iter().skip(1).position(waits).map_or(waiting.len(), |others| others + 1);
    waiting.drain(..count).collect()
}

/// Until when keys that are held count in this frame: what happens from the next key on comes with that one's frame.
pub fn counted_until(waiting: &VecDeque<Command>, now: Instant) -> Instant {
    match waiting.front() {
        Some(Command::Tap { at, .. }) => now.min(*at),
        _ => now,
    }
}
