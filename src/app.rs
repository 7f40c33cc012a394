//! The World and the one list of systems.

use crate::image::{Display, Picture};
use crate::load::{LoadOptions, LoadReport, SceneSource};
use crate::scene::{ActiveCamera, Camera, Transform};
use crate::trace::{Film, RenderSettings};
use bevy_ecs::prelude::*;
use bevy_ecs::schedule::ScheduleLabel;
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
    /// Time for refinement; a frame ends at the first tile after it. `None`: a whole pass.
    pub time: Option<Duration>,
    /// Raised from outside to end refinement at the next tile (a key was pressed). The frame's
    /// runner lowers it. A preview, once begun, always completes.
    pub interrupt: Arc<AtomicBool>,
    /// Samples per pixel after which nothing more is traced.
    pub sample_target: u32,
    /// Trace a coarse whole picture first when the film has been reset.
    pub preview: bool,
}

impl Default for FrameBudget {
    fn default() -> Self {
        Self { time: None, interrupt: Arc::default(), sample_target: 64, preview: false }
    }
}

/// What happened lately: for the HUD, the reports and the tests.
#[derive(Resource, Clone, Debug, Default)]
pub struct FrameStats {
    /// Samples a pixel has on average.
    pub samples_per_pixel: f64,
    /// Whether the sample target is reached: another frame would do nothing.
    pub done: bool,
    /// Estimated relative noise of the picture (0.02 = 2 %), from two samples per pixel on.
    pub noise: Option<f64>,
    /// Rays of all kinds since the program started.
    pub rays: u64,
    /// Rays per second of tracing time, lately.
    pub rays_per_second: f64,
    /// Side of a preview pixel, if the picture is a preview.
    pub preview_scale: Option<u32>,
    /// How often the film was reset.
    pub resets: u64,
    /// Samples dropped because they were not finite.
    pub dropped: u64,
}

/// A world that can make frames.
pub struct App {
    /// Entities and resources.
    pub world: World,
}

impl App {
    /// A world with `source` loaded.
    ///
    /// # Errors
    /// If the scene cannot be loaded.
    pub fn open(_source: &SceneSource, _options: &LoadOptions, settings: RenderSettings) -> Result<(Self, LoadReport), String> {
        let mut world = World::new();
        world.insert_resource(settings);
        world.insert_resource(Film::new(settings.size, 0));
        world.init_resource::<Display>();
        world.init_resource::<Picture>();
        world.init_resource::<FrameBudget>();
        world.init_resource::<FrameStats>();
        let camera = world.spawn((Camera::default(), Transform::default())).id();
        world.insert_resource(ActiveCamera(camera));
        let mut frame = Schedule::new(Frame);
        frame.configure_sets((FrameSystems::Input, FrameSystems::Update, FrameSystems::Sync, FrameSystems::Trace, FrameSystems::Present).chain());
        frame.add_systems(crate::scene::propagate_transforms.in_set(FrameSystems::Update));
        frame.add_systems(stub.in_set(FrameSystems::Trace));
        world.add_schedule(frame);
        Ok((Self { world }, LoadReport::default()))
    }

    /// Adds a system to the frame, in its set (the window's are added here).
    pub fn add_systems<M>(&mut self, systems: impl IntoScheduleConfigs<bevy_ecs::system::ScheduleSystem, M>) {
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

fn stub(
    settings: Res<RenderSettings>,
    budget: Res<FrameBudget>,
    camera: Query<Ref<crate::scene::GlobalTransform>, With<Camera>>,
    mut picture: ResMut<Picture>,
    mut stats: ResMut<FrameStats>,
) {
    let start = Instant::now();
    let Ok(camera) = camera.single() else { return };
    if camera.is_changed() || picture.size != settings.size {
        stats.samples_per_pixel = 0.0;
    }
    stats.done = stats.samples_per_pixel >= f64::from(budget.sample_target);
    if stats.done {
        return;
    }
    let p = camera.0.translation;
    let (w, h) = (settings.size.x, settings.size.y);
    picture.size = settings.size;
    picture.rgba = (0..h)
        .flat_map(|y| (0..w).map(move |x| (x, y)))
        .flat_map(|(x, y)| [(x as f64 + p.x * 100.0) as u8, (y as f64 + p.y * 100.0) as u8, (p.z * 50.0) as u8, 255])
        .collect();
    picture.version += 1;
    stats.samples_per_pixel += 1.0;
    while start.elapsed() < budget.time.unwrap_or_default() && !budget.interrupt.load(Ordering::Relaxed) {
        std::thread::yield_now();
    }
}
