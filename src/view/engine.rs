//! The thread that owns the [`App`] and runs its frames, so that the window never waits for a ray.

use super::controls::Paused;
use super::debug::CurrentLayer;
use super::exchange::{Published, Wake, lock, panic_message, say};
use super::input::{Command, Input};
use super::instrument::{Instrument, Reference, Seen};
use super::keymap::Tap;
use super::playing::Clock;
use super::prepare::{prepare, status};
use super::reload::{self, load_again, open_other, set_sky};
use super::sides::{Compared, Sides};
use super::status::counted;
use super::waiting::{Files, counted_until, of_one_frame};
use super::watch::SceneWatch;
use crate::app::{App, FrameBudget, FrameStats};
use crate::image::Picture;
use crate::image::compare::LinearImage;
use crate::load::Watcher;
use crate::open::{LoadCard, SceneOrigin};
use crate::preview::Preview;
use crate::shown::Shown;
use crate::sync::Redone;
use crate::trace::{Film, Viewpoint};
use bevy_ecs::prelude::*;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Refinement per frame while the view changes: none, the next preview is worth more than some tiles.
const MOVING: Duration = Duration::ZERO;
/// Refinement per frame at rest. Commands interrupt it, so it costs no latency.
const RESTING: std::ops::RangeInclusive<Duration> = Duration::from_millis(30)..=Duration::from_millis(100);
/// The longer the view rests, the rarer the pictures: this share of the time since it changed.
const RESTING_SHARE: f64 = 0.1;

/// The longest that one waits for a picture to be presented.
const PRESENTING: Duration = Duration::from_millis(20);

/// Whether there is something left to do although all samples are there. Set by systems, lowered before each frame.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pending(pub bool);

/// The engine's ends of what connects it with the window.
pub struct Engine<W> {
    /// What it opens first.
    pub scene: String,
    /// A picture to measure the true error by.
    pub reference: Option<LinearImage>,
    /// From the window.
    pub commands: Receiver<Command>,
    /// To the engine itself, from whoever watches files for it.
    pub own: Sender<Command>,
    /// Raised by the window after a command.
    pub interrupt: Arc<AtomicBool>,
    /// To the window.
    pub published: Arc<Mutex<Published>>,
    /// Versions of the pictures that have been presented, if that takes time from tracing.
    pub presented: Option<Receiver<u64>>,
    /// Makes the window look.
    pub wake: W,
}

impl<W: Fn(Wake) + Clone + Send + Sync + 'static> Engine<W> {
    /// Opens the app and runs frames until told to quit.
    pub fn run(mut self, open: impl FnOnce(Watcher) -> Result<App, String>) {
        // A bug in a frame must end in a message, not in a window that never changes again.
        let outcome = catch_unwind(AssertUnwindSafe(|| match open(self.watcher(&self.scene)) {
            Ok(mut app) => {
                let wrong = told_wrong(&app);
                if !wrong.is_empty() {
                    let name = app.world.get_resource::<SceneOrigin>().map(|origin| origin.source.name());
                    (self.wake)(Wake::Notice(format!("{}{wrong}", name.unwrap_or_default())));
                }
                let (viewpoint, seen) = (*app.world.resource::<Viewpoint>(), Seen::of(&app.world));
                let reference = self.reference.take().map(|image| Reference::new(image, viewpoint, seen));
                app.world.insert_resource(Instrument::against(reference));
                self.run_frames(app);
            }
            Err(why) => (self.wake)(Wake::OpenFailed(why)),
        }));
        if let Err(panic) = outcome {
            (self.wake)(Wake::Crashed(panic_message(&*panic)));
        }
    }

    /// Shows how far loading is.
    fn watcher(&self, name: &str) -> Watcher {
        let (published, wake, name) = (Arc::clone(&self.published), self.wake.clone(), name.to_owned());
        Watcher(Some(Arc::new(move |phase, part| {
            let text = format!("loading {name}: {phase} {:.0} %", f64::from((part * 20.0).round() * 5.0));
            let mut published = lock(&published);
            // Not for each triangle.
            if published.loading.as_deref() != Some(&text) {
                published.loading = Some(text);
                drop(published);
                wake(Wake::FrameReady);
            }
        })))
    }

    fn run_frames(&self, mut app: App) {
        lock(&self.published).loading = None;
        prepare(&mut app, &self.interrupt);
        let mut files = self.watch(&app);
        let mut view_changed_at = Instant::now();
        let mut idle = false;
        let mut waiting = VecDeque::new();
        loop {
            let mut asked = None;
            if idle {
                // No CPU at all until the user does something, or files do.
                match files.wait(&self.commands) {
                    Ok(command) => waiting.push_back(command),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => return,
                }
            }
            let is_behind = !waiting.is_empty();
            // Lowered before the commands are read: one that comes later raises it again.
            self.interrupt.store(false, Ordering::SeqCst);
            waiting.extend(self.commands.try_iter());
            let commands = of_one_frame(&mut waiting);
            if !waiting.is_empty() {
                self.interrupt.store(true, Ordering::SeqCst);
            }
            let mut wanted = None;
            for command in commands {
                match command {
                    Command::Quit => return,
                    Command::Open(path) => wanted = Some(Some(path)),
                    Command::FilesChanged => files.look(),
                    Command::Tap { press, .. } if press.tap == Tap::Reload => wanted = Some(None),
                    command => note(&mut app, &command, &mut asked),
                }
            }
            if files.is_time() {
                wanted = wanted.or(Some(None));
            }
            if let Some(path) = wanted {
                if let Some(mut other) = self.replaced(&mut app, path) {
                    // What was kept is of whatever scene it was.
                    if let Some(sides) = app.world.remove_resource::<Sides>() {
                        other.world.insert_resource(sides);
                    }
                    app = other;
                    prepare(&mut app, &self.interrupt);
                    view_changed_at = Instant::now();
                }
                // Also if it could not be: what was missing may come.
                files = self.watch(&app);
            }
            let app = &mut app;
            let now = Instant::now();
            let mut input = app.world.resource_mut::<Input>();
            input.hold_until(counted_until(&waiting, now));
            let plays = app.world.resource::<Clock>().runs();
            let input = app.world.resource::<Input>();
            let moving = plays || input.is_moving() || input.has_motion();
            let paused = rests(app);
            app.world.resource_mut::<FrameBudget>().time = Some(match (paused, moving) {
                (true, _) => Duration::ZERO,
                (false, true) => MOVING,
                (false, false) => {
                    (now - view_changed_at).mul_f64(RESTING_SHARE).clamp(*RESTING.start(), *RESTING.end())
                }
            });

            let resets = app.world.resource::<Redone>().resets;
            let version = app.world.resource::<Picture>().version;
            app.world.resource_mut::<Pending>().0 = false;
            app.frame();
            app.world.resource_mut::<Input>().end_frame();

            let stats = app.world.resource::<FrameStats>();
            let moving = moving || app.world.resource::<Redone>().resets != resets;
            if moving {
                view_changed_at = Instant::now();
            }
            let held = app.world.resource::<Input>().is_moving() || app.world.resource::<Clock>().runs();
            // A frame that was cut off has shown nothing, and what cut it off may have been read before.
            let cut_off = self.interrupt.load(Ordering::SeqCst);
            idle = !held && !cut_off && (stats.done || rests(app)) && !app.world.resource::<Pending>().0;
            say(app, &self.wake);
            self.publish(app, version, moving, asked);
            let shown = app.world.resource::<Picture>().version;
            if self.await_presented(shown, moving)
                && shown != version
                && !is_behind
                && let Some(asked) = asked
            {
                let known = app.world.resource::<FrameStats>().preview_seconds
                    + app.world.resource::<Shown>().seconds[0];
                app.world.resource_mut::<Preview>().answered(asked.elapsed().as_secs_f64() - known);
            }
        }
    }

    /// The scene loaded again, or that of `path` in its place; `None`, and a notice, if that cannot be.
    fn replaced(&self, app: &mut App, path: Option<PathBuf>) -> Option<App> {
        let start = Instant::now();
        let again = path.is_none();
        let name =
            path.as_ref().map(|path| path.file_name().unwrap_or_default().to_string_lossy().into_owned());
        let is_sky = path.as_deref().is_some_and(reload::is_sky);
        let watcher = self.watcher(name.as_deref().unwrap_or("the scene again"));
        let loaded = match path {
            Some(path) if is_sky => set_sky(app, path, watcher),
            Some(path) => open_other(app, &path, watcher),
            None => load_again(app, watcher),
        };
        lock(&self.published).loading = None;
        match loaded {
            Ok(other) => {
                let scene =
                    other.world.get_resource::<SceneOrigin>().map_or_else(String::new, |o| o.source.name());
                let (verb, seconds) =
                    (if again { "reloaded" } else { "opened" }, start.elapsed().as_secs_f64());
                let what = if is_sky { name.as_ref().unwrap_or(&scene) } else { &scene };
                let wrong = told_wrong(&other);
                (self.wake)(Wake::Notice(format!("{verb} {what} in {seconds:.2} s{wrong}")));
                let folder =
                    other.world.get_resource::<SceneOrigin>().map_or_else(String::new, |o| o.source.folder());
                (self.wake)(Wake::Opened { name: scene, folder });
                Some(other)
            }
            Err(why) => {
                let why = format!("still the old scene: {why}");
                (self.wake)(if again { Wake::Notice(why) } else { Wake::NotOpened(why) });
                None
            }
        }
    }

    fn watch(&self, app: &App) -> Files {
        let origin = app.world.get_resource::<SceneOrigin>();
        let files = origin.map(|origin| origin.options.files.list()).filter(|files| !files.is_empty());
        let watch = files.map(|files| {
            let (own, interrupt) = (self.own.clone(), Arc::clone(&self.interrupt));
            SceneWatch::new(files, move || {
                // An engine that has ended does not care.
                let _ = own.send(Command::FilesChanged);
                interrupt.store(true, Ordering::SeqCst);
            })
        });
        let mut files = Files { watch, due: None };
        // They may have changed since they were read.
        files.look();
        files
    }

    /// Hands over what is new.
    fn publish(&self, app: &App, old_version: u64, moving: bool, asked: Option<Instant>) {
        let picture = app.world.resource::<Picture>();
        let status = status(app);
        let mut published = lock(&self.published);
        let has_picture = picture.version != old_version;
        if has_picture {
            let mut copy = published.picture.take().unwrap_or_else(|| std::mem::take(&mut published.spare));
            // The copy is made without the lock, for the window may want to draw.
            drop(published);
            copy.rgba.clone_from(&picture.rgba);
            (copy.size, copy.version) = (picture.size, picture.version);
            published = lock(&self.published);
            published.picture = Some(copy);
            published.asked = published.asked.or(asked);
        }
        let layer = app.world.resource::<CurrentLayer>().0.clone();
        let same_layer = match (&layer, &published.layer) {
            (Some(new), Some(old)) => Arc::ptr_eq(new, old),
            (None, None) => true,
            _ => false,
        };
        published.layer = layer;
        let compared = app.world.resource::<Compared>();
        let same_side = compared.is(&published.compared);
        published.compared.clone_from(compared);
        let news = has_picture || !same_layer || !same_side || published.status.as_ref() != Some(&status);
        published.status = Some(status);
        published.moving = moving;
        drop(published);
        if news {
            (self.wake)(Wake::FrameReady);
        }
    }

    /// Where presenting takes time from tracing, one after the other: together each would only take longer, and the picture
    /// that somebody waits for would come later. Whether it has been seen to be presented.
    fn await_presented(&self, version: u64, moving: bool) -> bool {
        let Some(presented) = &self.presented else { return false };
        if !moving {
            presented.try_iter().for_each(drop);
            return false;
        }
        let until = Instant::now() + PRESENTING;
        // If none comes, the window is hidden or slow.
        while let Ok(other) = presented.recv_timeout(until.saturating_duration_since(Instant::now())) {
            if other == version {
                return true;
            }
        }
        false
    }
}

/// Whether nothing is to be refined: but what was changed meanwhile is seen whole.
fn rests(app: &App) -> bool {
    app.world.resource::<Paused>().0 && app.world.resource::<Film>().complete_samples() > 0
}

/// How much of the scene is not as its files say; nothing if all is.
fn told_wrong(app: &App) -> String {
    let card = app.world.get_resource::<LoadCard>();
    match card.map_or(0, |card| card.warnings) {
        0 => String::new(),
        count => {
            format!(": {} loading had to deal with, see the report ({{report}})", counted(count, "thing"))
        }
    }
}

/// Applies `command`; the first question for another view is remembered in `asked`.
fn note(app: &mut App, command: &Command, asked: &mut Option<Instant>) {
    let at = app.world.resource_mut::<Input>().apply(command);
    *asked = asked.or(at);
}

#[cfg(test)]
mod tests;
