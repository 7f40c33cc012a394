//! Headless: frames until there are enough samples, then a file.

use crate::app::{FrameBudget, FrameStats};
use crate::image::{Display, ImageError, save};
use crate::load::{LoadOptions, SceneSource};
use crate::open::{OpenError, Opened, Wishes, open};
use crate::trace::{Film, Geometry, Integrator, RayCounts, RenderSettings};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What to render, for how long, and where to.
#[derive(Clone, Debug)]
pub struct RenderJob {
    /// The scene.
    pub source: SceneSource,
    /// How to load it.
    pub load: LoadOptions,
    /// How it should look.
    pub wishes: Wishes,
    /// Stop after this much tracing.
    pub time_limit: Option<Duration>,
    /// Files to write, `.png` or `.exr`.
    pub outputs: Vec<PathBuf>,
    /// Raised from outside to stop and save what there is.
    pub interrupt: Arc<AtomicBool>,
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The scene cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A file cannot be written.
    #[error(transparent)]
    Save(#[from] ImageError),
}

/// How far a render is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Samples a pixel has on average.
    pub samples: f64,
    /// Samples per pixel to make.
    pub target: u32,
    /// Seconds of tracing so far, and those it may take.
    pub seconds: f64,
    /// The time limit in seconds.
    pub limit: Option<f64>,
    /// Estimated relative noise.
    pub noise: Option<f64>,
}

/// What was done: the object that `--json` prints.
#[derive(Clone, Debug, Serialize)]
pub struct RenderSummary {
    /// Name of the scene.
    pub scene: String,
    /// Version of this program.
    pub version: &'static str,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `direct` or `path`.
    pub integrator: &'static str,
    /// Bounces at most.
    pub max_depth: u32,
    /// Seed of the samples.
    pub seed: u32,
    /// Threads that traced.
    pub threads: usize,
    /// Instruction set of the traversal.
    pub isa: &'static str,
    /// Triangles of all instances.
    pub triangles: usize,
    /// First sample index.
    pub first_sample: u32,
    /// Samples per pixel, on average.
    pub samples: f64,
    /// Seconds of reading the files.
    pub load_seconds: f64,
    /// Seconds of building the hierarchies and the other arrays.
    pub build_seconds: f64,
    /// Seconds of tracing.
    pub render_seconds: f64,
    /// Seconds from the start to a first complete picture.
    pub first_picture_seconds: f64,
    /// Seconds of tracing until the estimated noise first was below 2 %.
    pub seconds_to_noise_2_percent: Option<f64>,
    /// Samples per pixel and second of tracing.
    pub samples_per_second: f64,
    /// Rays by kind.
    pub rays: RayCounts,
    /// Rays of all kinds per second of tracing.
    pub rays_per_second: f64,
    /// Estimated relative noise of the picture.
    pub noise: Option<f64>,
    /// Samples dropped because they were not finite.
    pub dropped_samples: u64,
    /// Most memory the process ever had, in bytes, where the system tells.
    pub peak_memory_bytes: Option<u64>,
    /// What loading had to say.
    pub warnings: Vec<String>,
    /// What was decided because the file is silent.
    pub decisions: Vec<String>,
    /// Files written.
    pub outputs: Vec<String>,
    /// Stopped from outside before the target.
    pub interrupted: bool,
    /// Stopped by the time limit before a target that somebody set.
    pub out_of_time: bool,
}

/// A pass is made to last about this long, so that progress moves and an interruption is soon seen.
const PASS: Duration = Duration::from_millis(250);
/// If nobody says how many.
const DEFAULT_SAMPLES: u32 = 64;

/// Renders to the end, the time limit or an interruption, and writes the files in each case.
///
/// # Errors
/// If the scene cannot be opened or a file not written.
pub fn render(
    job: &RenderJob,
    opened: impl FnOnce(&Opened),
    mut progress: impl FnMut(&Progress),
) -> Result<RenderSummary, RenderError> {
    let start = Instant::now();
    let scene = open(&job.source, &job.load, &job.wishes)?;
    opened(&scene);
    let Opened { mut app, report, load_seconds, build_seconds, samples } = scene;
    let target = samples.unwrap_or(if job.time_limit.is_some() { u32::MAX } else { DEFAULT_SAMPLES });

    app.world.insert_resource(FrameBudget {
        sample_target: target,
        interrupt: Arc::clone(&job.interrupt),
        ..FrameBudget::default()
    });
    let tracing = Instant::now();
    let mut first_picture_seconds = None;
    let mut seconds_to_noise = None;
    let mut step = 1;
    let interrupted = loop {
        let left = job.time_limit.map(|limit| limit.saturating_sub(tracing.elapsed()));
        if left.is_some_and(|left| left.is_zero()) {
            break false;
        }
        {
            let mut budget = app.world.resource_mut::<FrameBudget>();
            budget.pass_samples = step;
            // With a limit passes may end in the middle; without, they are whole.
            budget.time = left.map(|left| left.min(PASS));
        }
        let pass = Instant::now();
        app.frame();
        if pass.elapsed() < PASS / 2 {
            step = (step * 2).min(64);
        }
        let stats = app.world.resource::<FrameStats>();
        let seconds = tracing.elapsed().as_secs_f64();
        if stats.samples_per_pixel >= 1.0 {
            first_picture_seconds.get_or_insert_with(|| start.elapsed().as_secs_f64());
        }
        if stats.noise.is_some_and(|noise| noise < 0.02) {
            seconds_to_noise.get_or_insert(seconds);
        }
        progress(&Progress {
            samples: stats.samples_per_pixel,
            target,
            seconds,
            limit: job.time_limit.map(|l| l.as_secs_f64()),
            noise: stats.noise,
        });
        if stats.done {
            break false;
        }
        if job.interrupt.load(Ordering::Relaxed) {
            break true;
        }
    };
    let render_seconds = tracing.elapsed().as_secs_f64();

    let film = app.world.resource::<Film>();
    for path in &job.outputs {
        save(path, film, app.world.resource::<Display>())?;
    }
    let settings = app.world.resource::<RenderSettings>();
    let stats = app.world.resource::<FrameStats>();
    Ok(RenderSummary {
        scene: job.source.name(),
        version: env!("CARGO_PKG_VERSION"),
        width: settings.size.x,
        height: settings.size.y,
        integrator: match settings.integrator {
            Integrator::Direct => "direct",
            Integrator::Path => "path",
        },
        max_depth: settings.max_depth,
        seed: settings.seed,
        threads: rayon::current_num_threads(),
        isa: app.world.resource::<Geometry>().tlas.isa().name(),
        triangles: report.triangles,
        first_sample: job.wishes.first_sample,
        samples: stats.samples_per_pixel,
        load_seconds,
        build_seconds,
        render_seconds,
        first_picture_seconds: first_picture_seconds.unwrap_or_else(|| start.elapsed().as_secs_f64()),
        seconds_to_noise_2_percent: seconds_to_noise,
        samples_per_second: stats.samples_per_pixel / render_seconds,
        rays: stats.rays,
        rays_per_second: stats.rays.total() as f64 / render_seconds,
        noise: crate::trace::noise::relative_noise(film),
        dropped_samples: stats.dropped,
        peak_memory_bytes: peak_memory(),
        warnings: report.warnings,
        decisions: report.decisions,
        outputs: job.outputs.iter().map(|p| p.display().to_string()).collect(),
        interrupted,
        out_of_time: !interrupted && samples.is_some() && !stats.done,
    })
}

/// From the kernel's own account of this process; `None` where there is no such file.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}
