//! The thread that owns the [`App`] and runs its frames, so that the window never waits for a ray.

use super::cameras::{
    Bookmarks, FileCameras, change_lens, change_projection, choose_camera, choose_side, recall, remember,
};
use super::controls::{Notice, Notices, Paused, change_display, change_pause, change_settings, print_camera};
use super::debug::layer::Layer;
use super::debug::{CurrentLayer, Debug, DebugLines, change_debug, draw_layer, explain_pinned};
use super::edit::{Editor, edit_scene, finish_sync, start_sync};
use super::fly::{FlySpeed, change_speed, fly_camera, look_around, take_off};
use super::input::{Command, Input};
use super::instrument::{Instrument, Reference, note_noise};
use super::orbit::{Navigation, change_navigation, focus, orbit_camera};
use super::pixel_view::{
    CurrentLegend, DepthWanted, FirstHits, PixelView, choose_pixel_view, develop_pixel_view,
    refine_first_hits,
};
use super::status::Status;
use crate::app::{App, FrameBudget, FrameStats, FrameSystems, trace_frame};
use crate::image::compare::LinearImage;
use crate::image::{Display, Picture};
use crate::scene::{ActiveCamera, SceneBounds, propagate_transforms};
use crate::sync::{Redone, build_blas, reset_film};
use crate::trace::{Geometry, RenderSettings};
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce;
use glam::DVec3;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Refinement per frame while the view changes: none, the next preview is worth more than some tiles.
const MOVING: Duration = Duration::ZERO;
/// Refinement per frame at rest. Commands interrupt it, so it costs no latency.
const RESTING: std::ops::RangeInclusive<Duration> = Duration::from_millis(30)..=Duration::from_millis(100);
/// The longer the view rests, the rarer the pictures: this share of the time since it changed.
const RESTING_SHARE: f64 = 0.1;

/// Speed at the start, in radii of the scene per second.
const RADII_PER_SECOND: f64 = 0.5;

/// Whether there is something left to do although all samples are there. Set by systems, lowered before each frame.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pending(pub bool);

/// What the engine tells the window's thread to look at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wake {
    /// [`Published`] has news.
    FrameReady,
    /// The scene could not be opened.
    OpenFailed(String),
    /// The engine's thread panicked.
    Crashed(String),
    /// Something to show to the user.
    Notice(String),
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
    /// For the status lines. `None` until the scene is open.
    pub status: Option<Status>,
    /// Whether the view is changing, so that pictures are to be shown at once.
    pub moving: bool,
    /// When the user asked for what the picture is the first to show.
    pub asked: Option<Instant>,
}

/// The engine's ends of what connects it with the window.
pub struct Engine<W> {
    /// A picture to measure the true error by.
    pub reference: Option<LinearImage>,
    /// From the window.
    pub commands: Receiver<Command>,
    /// Raised by the window after a command.
    pub interrupt: Arc<AtomicBool>,
    /// To the window.
    pub published: Arc<Mutex<Published>>,
    /// Makes the window look.
    pub wake: W,
}

/// Locks `mutex`, also after a thread panicked with it: what we share is whole at any time.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<W: Fn(Wake)> Engine<W> {
    /// Opens the app and runs frames until told to quit.
    pub fn run(mut self, open: impl FnOnce() -> Result<App, String>) {
        // A bug in a frame must end in a message, not in a window that never changes again.
        let outcome = catch_unwind(AssertUnwindSafe(|| match open() {
            Ok(mut app) => {
                let reference = self.reference.take().map(Reference::new);
                app.world.insert_resource(Instrument::against(reference));
                self.run_frames(&mut app);
            }
            Err(why) => (self.wake)(Wake::OpenFailed(why)),
        }));
        if let Err(panic) = outcome {
            (self.wake)(Wake::Crashed(panic_message(&*panic)));
        }
    }

    fn run_frames(&self, app: &mut App) {
        prepare(app, &self.interrupt);
        let mut view_changed_at = Instant::now();
        let mut idle = false;
        loop {
            let mut asked = None;
            if idle {
                // No CPU at all until the user does something.
                match self.commands.recv() {
                    Ok(Command::Quit) | Err(_) => return,
                    Ok(command) => note(app, &command, &mut asked),
                }
            }
            // Lowered before the commands are read: one that comes later raises it again.
            self.interrupt.store(false, Ordering::SeqCst);
            for command in self.commands.try_iter() {
                if matches!(command, Command::Quit) {
                    return;
                }
                note(app, &command, &mut asked);
            }
            let now = Instant::now();
            let mut input = app.world.resource_mut::<Input>();
            input.hold_until(now);
            let moving = input.is_moving() || input.has_motion();
            let paused = app.world.resource::<Paused>().0;
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
            let held = app.world.resource::<Input>().is_moving();
            idle = !held
                && (stats.done || app.world.resource::<Paused>().0)
                && !app.world.resource::<Pending>().0;
            self.say(app);
            self.publish(app, version, moving, asked);
        }
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
        let news = has_picture || !same_layer || published.status.as_ref() != Some(&status);
        published.status = Some(status);
        published.moving = moving;
        drop(published);
        if news {
            (self.wake)(Wake::FrameReady);
        }
    }

    /// Passes the frame's notices on.
    fn say(&self, app: &mut App) {
        for notice in std::mem::take(&mut app.world.resource_mut::<Notices>().0) {
            let text = match notice {
                Notice::Text(text) => text,
                Notice::Print(text) => {
                    use std::io::Write;
                    // Whoever closed standard output does not want to read it.
                    let _ = writeln!(std::io::stdout(), "{text}");
                    text
                }
            };
            (self.wake)(Wake::Notice(text));
        }
    }
}

/// Adds the window's resources and systems.
fn prepare(app: &mut App, interrupt: &Arc<AtomicBool>) {
    let mut budget = app.world.resource_mut::<FrameBudget>();
    budget.interrupt = Arc::clone(interrupt);
    (budget.preview, budget.develop) = (true, true);
    // The camera may be asked for its place before the first frame has run.
    let propagated = app.world.run_system_once(propagate_transforms);
    debug_assert!(propagated.is_ok());
    let camera = app.world.resource::<ActiveCamera>().0;
    app.world.insert_resource(FileCameras { home: camera, last: camera });
    app.world.insert_resource(Input::new(Instant::now()));
    app.world.init_resource::<Paused>();
    app.world.init_resource::<Notices>();
    app.world.init_resource::<Bookmarks>();
    app.world.init_resource::<Pending>();
    app.world.init_resource::<PixelView>();
    app.world.init_resource::<CurrentLegend>();
    app.world.init_resource::<DepthWanted>();
    app.world.init_resource::<FirstHits>();
    app.world.init_resource::<Debug>();
    app.world.init_resource::<Editor>();
    app.world.init_resource::<DebugLines>();
    app.world.init_resource::<CurrentLayer>();
    let pivot = app.world.get_resource::<SceneBounds>().map_or(DVec3::ZERO, |bounds| bounds.center);
    let vertical_fov = std::f32::consts::FRAC_PI_4;
    app.world.insert_resource(Navigation { orbiting: false, pivot, vertical_fov });
    if !app.world.contains_resource::<FlySpeed>() {
        let radius = app.world.get_resource::<SceneBounds>().map_or(2.0, |bounds| bounds.radius);
        app.world.insert_resource(FlySpeed(RADII_PER_SECOND * radius));
    }
    app.add_systems(
        (
            change_settings,
            change_display,
            change_pause,
            (change_speed, change_navigation, choose_camera, take_off, recall, choose_side).chain(),
            (change_projection, change_lens, focus, look_around, fly_camera, orbit_camera).chain(),
            (remember, print_camera, choose_pixel_view, change_debug, edit_scene).chain(),
        )
            .chain()
            .in_set(FrameSystems::Input),
    );
    app.add_systems(refine_first_hits.in_set(FrameSystems::Trace).after(trace_frame));
    app.add_systems(start_sync.in_set(FrameSystems::Sync).before(build_blas));
    app.add_systems(finish_sync.in_set(FrameSystems::Sync).after(reset_film));
    app.add_systems(explain_pinned.in_set(FrameSystems::Sync).after(reset_film));
    app.add_systems((note_noise, develop_pixel_view, draw_layer).chain().in_set(FrameSystems::Present));
}

/// Applies `command`; the first question for another view is remembered in `asked`.
fn note(app: &mut App, command: &Command, asked: &mut Option<Instant>) {
    let at = app.world.resource_mut::<Input>().apply(command);
    *asked = asked.or(at);
}

fn status(app: &App) -> Status {
    let world = &app.world;
    let stats = world.resource::<FrameStats>();
    let settings = world.resource::<RenderSettings>();
    let display = world.resource::<Display>();
    Status {
        samples_per_pixel: stats.samples_per_pixel,
        sample_target: world.resource::<FrameBudget>().sample_target,
        done: stats.done,
        paused: world.resource::<Paused>().0,
        noise: stats.noise.map(|noise| (noise, stats.noise_doubt)),
        graph: Arc::clone(&world.resource::<Instrument>().graph),
        legend: world.resource::<CurrentLegend>().0.clone(),
        debug: world.resource::<Debug>().status(),
        edit: world.resource::<Editor>().status(),
        rays_per_second: stats.rays_per_second,
        preview_scale: stats.preview_scale,
        resets: world.resource::<Redone>().resets,
        dropped: stats.dropped,
        exposure: display.exposure,
        tone_map: display.tone_map,
        speed: world.resource::<FlySpeed>().0,
        orbiting: world.resource::<Navigation>().orbiting,
        size: settings.size,
        integrator: settings.integrator,
        filter: settings.filter,
        isa: world.resource::<Geometry>().tlas.isa().name(),
    }
}

/// The text of a caught panic.
pub fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("panic without a message").to_owned()
}
