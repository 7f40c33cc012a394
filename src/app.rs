//! The World and the one list of systems.

use crate::image::develop::{Display, Picture};
use crate::load::{LoadError, LoadOptions, LoadReport, SceneSource, load};
use crate::preview::Preview;
use crate::scene::{Playing, deform, play, propagate_transforms};
use crate::shown::{Shown, develop_film, keep};
use crate::sync::{self, BlasCache, Instructions, MaterialNumbers, Redone, RenderOrigin, Traceable};
use crate::trace::noise;
use crate::trace::{
    Coverage, Film, Geometry, Lights, RayCounts, RenderSettings, Surfaces, Viewpoint, hurry, trace_adaptive,
    trace_half, trace_pass,
};
use bevy_ecs::prelude::*;
use bevy_ecs::schedule::{ScheduleLabel, SingleThreadedExecutor};
use bevy_ecs::system::ScheduleSystem;
use glam::UVec2;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Label of the one schedule.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Frame;

/// The phases of a frame, in order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FrameSystems {
    /// What the user does → entities and resources. Only the window puts systems here.
    Input,
    /// Entities → derived components.
    Update,
    /// Changed entities → flat arrays, and the one reset.
    Sync,
    /// Flat arrays → film.
    Trace,
    /// Film → picture.
    Present,
}

/// How much a frame may trace. Set by whoever runs frames.
#[derive(Resource, Clone, Debug)]
pub struct FrameBudget {
    /// Time for refinement; a frame ends at the first tile after it. `None`: one pass, whatever it takes.
    pub time: Option<Duration>,
    /// Raised from outside to end refinement at the next tile (a key was pressed). The frame's
    /// runner lowers it. A preview, once begun, always completes.
    pub interrupt: Arc<AtomicBool>,
    /// More samples go where there is more noise. And without a preview the first go to half of the pixels everywhere, if
    /// neighbours share paths: no film in files is like that.
    pub adaptive: bool,
    /// All the time there will be, if that is known: where it is short, the first samples go where they are needed most.
    pub limit: Option<Duration>,
    /// Samples per pixel after which nothing more is traced.
    pub sample_target: u32,
    /// Samples per pixel of one pass, if there is no time limit.
    pub pass_samples: u32,
    /// Only this part of the picture is refined, from its first pixel to the one after its last.
    pub region: Option<[UVec2; 2]>,
    /// For somebody who watches: a coarse whole picture first when the film was reset.
    pub preview: bool,
    /// For somebody who watches: a developed [`Picture`] at the end of each frame.
    pub develop: bool,
}

impl Default for FrameBudget {
    fn default() -> Self {
        Self {
            time: None,
            interrupt: Arc::default(),
            adaptive: false,
            limit: None,
            sample_target: 64,
            pass_samples: 1,
            region: None,
            preview: false,
            develop: false,
        }
    }
}

/// What happened lately: for the HUD, the reports and the tests.
#[derive(Resource, Clone, Debug, Default)]
pub struct FrameStats {
    /// Samples a pixel has on average.
    pub samples_per_pixel: f64,
    /// Whether the sample target is reached: another frame would do nothing.
    pub done: bool,
    /// Estimated relative noise of the picture (0.02 = 2 %), from two samples per pixel on, or three where time
    /// is short.
    pub noise: Option<f64>,
    /// How well it is known: see [`noise::Noise::doubt`].
    pub noise_doubt: f64,
    /// Samples per pixel that `noise` is of; 0 if it is of none.
    pub noise_samples: f64,
    /// Rays since the world was made, by kind.
    pub rays: RayCounts,
    /// Seconds spent tracing since the world was made.
    pub trace_seconds: f64,
    /// Those of them that the last frame spent.
    pub frame_seconds: f64,
    /// Rays of all kinds per second of tracing time, lately.
    pub rays_per_second: f64,
    /// Side of a preview pixel, if the picture is still partly a preview.
    pub preview_scale: Option<u32>,
    /// Seconds that the last preview took.
    pub preview_seconds: f64,
    /// Samples dropped because they were not finite.
    pub dropped: u64,
    /// Whether the last frame was the first one of this picture.
    pub begun: bool,
}

/// A world that can make frames.
pub struct App {
    /// Entities and resources.
    pub world: World,
}

impl App {
    /// A world with no entity in it yet.
    #[must_use]
    pub fn new(settings: RenderSettings) -> Self {
        let mut world = World::new();
        world.insert_resource(settings);
        world.insert_resource(Film::new(settings.size, 0));
        world.init_resource::<Display>();
        world.init_resource::<Picture>();
        world.init_resource::<Preview>();
        world.init_resource::<Shown>();
        world.init_resource::<FrameBudget>();
        world.init_resource::<FrameStats>();
        world.init_resource::<Geometry>();
        world.init_resource::<Surfaces>();
        world.init_resource::<Lights>();
        world.init_resource::<Coverage>();
        world.init_resource::<Viewpoint>();
        world.init_resource::<RenderOrigin>();
        world.init_resource::<Instructions>();
        world.init_resource::<MaterialNumbers>();
        world.init_resource::<BlasCache>();
        world.init_resource::<Redone>();
        world.init_resource::<sync::Entities>();
        world.add_schedule(frame_schedule());
        Self { world }
    }

    /// A world with `source` loaded.
    ///
    /// # Errors
    /// If the scene cannot be loaded.
    pub fn open(
        source: &SceneSource,
        options: &LoadOptions,
        settings: RenderSettings,
    ) -> Result<(Self, LoadReport), LoadError> {
        let mut app = Self::new(settings);
        let report = load(&mut app.world, source, options)?;
        Ok((app, report))
    }

    /// Brings all that is derived from the entities up to date, without tracing.
    pub fn build(&mut self) {
        let target = std::mem::take(&mut self.world.resource_mut::<FrameBudget>().sample_target);
        self.frame();
        self.world.resource_mut::<FrameBudget>().sample_target = target;
    }

    /// A small picture of what the camera sees, apart from the film. Call [`App::build`] first.
    #[must_use]
    pub fn probe(&self, size: UVec2, samples: u32) -> Film {
        let mut film = Film::new(size, 0);
        trace_pass(&sync::traceable(&self.world), &mut film, samples, samples, || true);
        film
    }

    /// Adds systems to the frame, each in its set.
    pub fn add_systems<M>(&mut self, systems: impl IntoScheduleConfigs<ScheduleSystem, M>) {
        self.world.schedule_scope(Frame, |_, schedule| {
            schedule.add_systems(systems);
        });
    }

    /// Runs one frame.
    pub fn frame(&mut self) {
        self.world.run_schedule(Frame);
        // Stand-alone bevy_ecs: nobody else forgets removals.
        self.world.clear_trackers();
    }
}

/// Brings [`crate::scene::GlobalTransform`]s up to date outside of a frame.
pub fn propagate(world: &mut World) {
    // The system takes its inputs from this very world and cannot fail to run.
    let _ = world.run_system_cached(propagate_transforms);
}

/// The one list of systems.
fn frame_schedule() -> Schedule {
    use FrameSystems::{Input, Present, Sync, Trace, Update};
    let mut frame = Schedule::new(Frame);
    // Eight short systems: threads are for the tiles, which rayon spreads inside `trace_frame`.
    frame.set_executor(SingleThreadedExecutor::new());
    frame.configure_sets((Input, Update, Sync, Trace, Present).chain());
    frame.add_systems((
        (play.run_if(resource_exists_and_changed::<Playing>), propagate_transforms, deform)
            .chain()
            .in_set(Update),
        (
            sync::build_blas,
            sync::choose_origin,
            sync::sync_surfaces,
            sync::sync_geometry,
            sync::sync_lights,
            sync::sync_coverage,
            sync::sync_viewpoint,
            sync::reset_film,
        )
            .chain()
            .in_set(Sync),
        (trace_frame, keep).chain().in_set(Trace),
        develop_film.run_if(is_worth_developing).in_set(Present),
    ));
    frame
}

/// Somebody looks, and does not wait for a newer picture already: one key press costs one picture.
fn is_worth_developing(budget: Res<FrameBudget>, stats: Res<FrameStats>) -> bool {
    budget.develop && (stats.begun || !budget.interrupt.load(Ordering::Relaxed))
}

/// Time for fewer samples than that is short.
const FEW_SAMPLES: f64 = 3.0;

/// How many times as long as an estimate of the noise takes is traced before the next, unless it is asked for.
const ESTIMATE: f64 = 20.0;
/// For who watches it is made after so many seconds, whatever it takes.
const LATE: f64 = 0.3;

/// When the noise was estimated, in seconds of tracing, and how long that took.
#[derive(Default)]
pub struct Estimated {
    at: f64,
    took: f64,
}

/// Adds samples to the film within the budget; first of all a preview, if somebody watches.
pub fn trace_frame(
    inputs: Traceable,
    budget: Res<FrameBudget>,
    mut film: ResMut<Film>,
    mut preview: ResMut<Preview>,
    mut stats: ResMut<FrameStats>,
    redone: Res<Redone>,
    mut last: Local<(u64, bool)>,
    mut estimated: Local<Estimated>,
) {
    let scene = inputs.scene();
    // Sample indices end with u32: nobody waits for those beyond.
    let target = budget.sample_target.min(u32::MAX - film.first_sample());
    let mut start = Instant::now();
    let mut seconds = 0.0;
    // Not each time: it would count as a change of the film.
    if film.region() != budget.region {
        film.confine(budget.region);
        // What was known of other pixels.
        (stats.noise, stats.noise_samples) = (None, 0.0);
        estimated.at = f64::NEG_INFINITY;
    }
    let mut rays = RayCounts::default();
    // Once for each reset: a preview that came anew each frame would leave no time for anything else. And once for who begins
    // to watch what was reset before.
    let now = (redone.resets, budget.preview);
    stats.begun = std::mem::replace(&mut *last, now) != now;
    if stats.begun {
        stats.noise = None;
        stats.noise_samples = 0.0;
        estimated.at = f64::NEG_INFINITY;
        if budget.preview {
            match preview.trace(&scene) {
                Some(counts) => rays = rays + counts,
                // So cheap that the film's own first pass is the preview.
                None => {
                    film.confine(None);
                    rays = rays + trace_pass(&scene, &mut film, target.min(1), 1, || true);
                    preview.note(start.elapsed(), f64::from(scene.settings.size.element_product()));
                    film.confine(budget.region);
                }
            }
            seconds = start.elapsed().as_secs_f64();
            stats.preview_seconds = seconds;
            start = Instant::now();
        }
    }
    let in_time = || budget.time.is_none_or(|time| start.elapsed() < time);
    let keep_going = || in_time() && !budget.interrupt.load(Ordering::Relaxed);
    // Paths are shared among pixels of one colour: halves take no longer than the whole.
    let halves = budget.adaptive && !budget.preview && scene.settings.shares_paths();
    if halves && film.complete_samples() == 0 && target > 0 {
        rays = rays + trace_half(&scene, &mut film, keep_going);
    }
    while film.complete_samples() < target && keep_going() {
        let step = budget.pass_samples;
        let spent = stats.trace_seconds + start.elapsed().as_secs_f64();
        if budget.adaptive && budget.limit.is_some_and(|limit| FEW_SAMPLES * spent > limit.as_secs_f64()) {
            hurry(&scene, &mut film);
        }
        rays = rays
            + if budget.adaptive && (budget.region.is_none() || film.is_allotted()) {
                trace_adaptive(&scene, &mut film, target, step, keep_going)
            } else {
                trace_pass(&scene, &mut film, target, step, keep_going)
            };
        if budget.time.is_none() {
            break;
        }
    }
    seconds += start.elapsed().as_secs_f64();
    stats.rays = stats.rays + rays;
    stats.trace_seconds += seconds;
    stats.frame_seconds = seconds;
    if rays.total() > 0 {
        stats.rays_per_second = rays.total() as f64 / seconds;
    }
    stats.samples_per_pixel = film.mean_samples();
    stats.done = film.complete_samples() >= target;
    let coarse = preview.film().filter(|_| film.complete_samples() == 0);
    stats.preview_scale = coarse.map(|_| preview.scale()).filter(|&scale| scale > 1);
    stats.dropped = film.dropped();
    // The estimate costs as much as a few samples: it is made each time the count has grown by a quarter, if by then it has
    // become cheap beside them.
    let longest = if budget.develop { LATE } else { f64::INFINITY };
    let is_cheap = stats.trace_seconds - estimated.at >= (ESTIMATE * estimated.took).min(longest);
    // Of all pixels together: where noise is unequal so are they, and a pass over all takes long.
    let samples = stats.samples_per_pixel;
    let has_time = stats.done || !(budget.develop && budget.interrupt.load(Ordering::Relaxed));
    if film.complete_samples() >= 2
        && has_time
        && (is_cheap && samples >= 1.25 * stats.noise_samples || stats.done)
        && samples != stats.noise_samples
    {
        let start = Instant::now();
        let noise = noise::estimate(&film);
        *estimated = Estimated { at: stats.trace_seconds, took: start.elapsed().as_secs_f64() };
        stats.noise = noise.map(|noise| noise.relative);
        stats.noise_doubt = noise.map_or(0.0, |noise| noise.doubt);
        stats.noise_samples = samples;
    }
}
