//! Headless: frames until there are enough samples, then a file.

use crate::app::{FrameBudget, FrameStats};
use crate::farm::{FilmError, FilmFile, Header, Identity, is_film};
use crate::image::compare::LinearImage;
use crate::image::{Display, ErrorLog, ImageError};
use crate::load::{Kind, LoadOptions, Phase, SceneSource};
use crate::open::{OpenError, Opened, Wishes, open};
use crate::outputs::{NotWritten, folder_exists, save_all};
use crate::reference::{Reference, ReferenceError};
use crate::sync::traceable;
use crate::trace::guess::guessed;
use crate::trace::{Film, Geometry, RayCounts, RenderSettings};
use crate::watch::{Seen, Watch};
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
    /// Stop when the picture's relative noise is down to this.
    pub noise: Option<f64>,
    /// The same number of samples for every pixel, also where the end is open.
    pub even: bool,
    /// A film to go on with.
    pub resume: Option<PathBuf>,
    /// Reference and table: the true error as it falls.
    pub error_log: Option<(PathBuf, PathBuf)>,
    /// Files to write, `.png`, `.exr` or `.film`.
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
    /// A file could not be written.
    #[error(transparent)]
    Save(#[from] ImageError),
    /// One could not be written where it was to go, at the end.
    #[error(transparent)]
    NotWritten(#[from] NotWritten),
    /// A film cannot be gone on with.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// What is of the whole picture only.
    #[error(
        "--crop is for .png and .exr: a film, --resume and --reference are of the whole picture; leave it out, or them"
    )]
    OfAPart,
    /// The reference cannot be read, is of another size, or of the very samples of the render.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
}

/// How far a render is.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Samples a pixel has on average.
    pub samples: f64,
    /// Those of them that were there from the start.
    pub resumed: f64,
    /// Samples per pixel to make.
    pub target: u32,
    /// Seconds of tracing so far, and those it may take.
    pub seconds: f64,
    /// The time limit in seconds.
    pub limit: Option<f64>,
    /// Estimated relative noise.
    pub noise: Option<f64>,
    /// The noise to reach.
    pub noise_goal: Option<f64>,
    /// Seconds until then, as soon as that can be told.
    pub seconds_to_noise: Option<f64>,
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
    /// The part that is in the files, of these pixels: from the left, from the top, width and height.
    pub crop: Option<[u32; 4]>,
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
    /// Those of them that were in the film gone on with.
    pub resumed_samples: f64,
    /// Seconds of reading the files.
    pub load_seconds: f64,
    /// Of these, by phase.
    pub load_phases: Vec<(Phase, f64)>,
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
    /// The part of the pixels that has samples: less than 1 if there was not even time for one of each. Others are guessed
    /// from what is beside them.
    pub looked_at: f64,
    /// What loading had to say.
    pub warnings: Vec<String>,
    /// What was decided because the file is silent.
    pub decisions: Vec<String>,
    /// Files written.
    pub outputs: Vec<String>,
    /// Stopped from outside before the target.
    pub interrupted: bool,
    /// Stopped by the time limit or the sample count before a target that somebody set.
    pub out_of_time: bool,
}

/// A pass is made to last about this long, so that progress moves and an interruption is soon seen.
const PASS: Duration = Duration::from_millis(250);
/// If nobody says how many.
const DEFAULT_SAMPLES: u32 = 64;

/// Renders to the target, the noise goal, the time limit or an interruption, and writes the files in each case.
///
/// # Errors
/// If the scene cannot be opened, the film not gone on with, or a file not read or written.
pub fn render(
    job: &RenderJob,
    opened: impl FnOnce(&Opened),
    mut progress: impl FnMut(&Progress),
) -> Result<RenderSummary, RenderError> {
    let start = Instant::now();
    job.outputs.iter().try_for_each(|path| folder_exists(path))?;
    let films = job.resume.is_some() || job.outputs.iter().any(|path| is_film(path));
    if job.wishes.crop.is_some() && (films || job.error_log.is_some()) {
        return Err(RenderError::OfAPart);
    }
    let mut scene = open(&job.source, &job.load, &job.wishes)?;
    let reference = job.error_log.as_ref().map(|(reference, _)| Reference::open(reference)).transpose()?;
    let identified = films || reference.as_ref().is_some_and(|reference| reference.seed().is_some());
    let identity = identified.then(|| Identity::of(&scene.app.world, job.source.name()));
    let (mut planned, mut resumed_samples) = (None, 0.0);
    if let (Some(path), Some(identity)) = (&job.resume, &identity) {
        let file = FilmFile::read(path)?;
        planned = file.header.planned.as_ref().map(|range| range.end.saturating_sub(range.start));
        let film = file.resume(path, identity, job.wishes.first_sample)?;
        resumed_samples = film.mean_samples();
        let what = format!("goes on from {resumed_samples:.0} samples per pixel");
        scene.report.add(Kind::Decided, &path.display().to_string(), what);
        scene.app.world.insert_resource(film);
    }
    // A noise goal is the target, unless the command line sets another beside it.
    let asked = job.wishes.samples.or(if job.noise.is_some() { None } else { planned.or(scene.samples) });
    let open_end = job.time_limit.is_some() || job.noise.is_some();
    let target = asked.unwrap_or(if open_end { u32::MAX } else { DEFAULT_SAMPLES });
    let first_sample = scene.app.world.resource::<Film>().first_sample();
    let target = target.min(u32::MAX - first_sample);
    let log = match (reference, &job.error_log) {
        (Some(reference), Some((_, log))) => {
            reference.has_size(scene.app.world.resource::<RenderSettings>().size)?;
            if let Some(identity) = &identity {
                reference.is_independent(identity, first_sample..first_sample + target)?;
            }
            Some(ErrorLog::create(log, reference.picture)?)
        }
        _ => None,
    };
    opened(&scene);
    let Opened { mut app, report, load_seconds, build_seconds, .. } = scene;

    let region = app.world.resource::<FrameBudget>().region;
    app.world.insert_resource(FrameBudget {
        // Shares are of whole pictures.
        adaptive: open_end && asked.is_none() && !films && !job.even && region.is_none(),
        region,
        limit: job.time_limit,
        interrupt: Arc::clone(&job.interrupt),
        ..FrameBudget::default()
    });
    let tracing = Instant::now();
    let mut watch = Watch::new(job.noise, log, app.world.resource::<Film>().complete_samples());
    let mut first_picture_seconds = None;
    let mut seconds_to_noise = None;
    let mut step = 1;
    let end = loop {
        let left = job.time_limit.map(|limit| limit.saturating_sub(tracing.elapsed() - watch.spent));
        if left.is_some_and(|left| left.is_zero()) {
            break End::Time;
        }
        {
            let mut budget = app.world.resource_mut::<FrameBudget>();
            budget.sample_target = watch.until(target);
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
        let film = app.world.resource::<Film>();
        let complete = film.complete_samples();
        let seconds = (tracing.elapsed() - watch.spent).as_secs_f64();
        if stats.samples_per_pixel >= 1.0 {
            first_picture_seconds.get_or_insert_with(|| start.elapsed().as_secs_f64());
        }
        if stats.noise.is_some_and(|noise| noise < 0.02) {
            seconds_to_noise.get_or_insert(seconds);
        }
        let seen = if stats.done { watch.look(film, seconds, stats.noise) } else { Seen::Noisy };
        let made = stats.samples_per_pixel - resumed_samples;
        let seconds_left = |samples: f64| (samples - stats.samples_per_pixel).max(0.0) * seconds / made;
        progress(&Progress {
            samples: stats.samples_per_pixel,
            resumed: resumed_samples,
            target,
            seconds,
            limit: job.time_limit.map(|l| l.as_secs_f64()),
            noise: stats.noise,
            noise_goal: job.noise,
            seconds_to_noise: watch.samples_to_goal().map(seconds_left).filter(|s| s.is_finite()),
        });
        match seen {
            Seen::QuietEnough => break End::Noise,
            Seen::Noisy if complete >= target => break End::Samples,
            Seen::Dark => break End::Dark,
            Seen::Noisy => {}
        }
        if job.interrupt.load(Ordering::Relaxed) {
            break End::Interrupted;
        }
    };
    let render_seconds = (tracing.elapsed() - watch.spent).as_secs_f64();

    let film = app.world.resource::<Film>();
    let noise = crate::trace::noise::relative_noise(film);
    let guess = film.has_gaps().then(|| {
        let pixels = guessed(film, &traceable(&app.world));
        LinearImage { size: film.size(), pixels }
    });
    watch.log(film, guess.as_ref(), render_seconds, noise);
    // Where somebody may want to go on, the film says how far it was to go.
    let planned = (job.noise.is_none() && target < u32::MAX - first_sample)
        .then(|| first_sample..first_sample + target.max(film.complete_samples()));
    let display = *app.world.resource::<Display>();
    let header = identity.map(|identity| Header::new(identity, planned, &display));
    save_all(&job.outputs, (film, guess.as_ref()), &display, header.as_ref(), region)?;
    if let Some(trouble) = watch.trouble {
        return Err(trouble.into());
    }
    let settings = app.world.resource::<RenderSettings>();
    let stats = app.world.resource::<FrameStats>();
    Ok(RenderSummary {
        scene: job.source.name(),
        version: env!("CARGO_PKG_VERSION"),
        width: settings.size.x,
        height: settings.size.y,
        crop: region.map(|[min, max]| [min.x, min.y, max.x - min.x, max.y - min.y]),
        integrator: settings.integrator.name(),
        max_depth: settings.max_depth,
        seed: settings.seed,
        threads: rayon::current_num_threads(),
        isa: app.world.resource::<Geometry>().tlas.isa().name(),
        triangles: report.triangles,
        first_sample,
        samples: stats.samples_per_pixel,
        resumed_samples,
        load_seconds,
        build_seconds,
        render_seconds,
        first_picture_seconds: first_picture_seconds.unwrap_or_else(|| start.elapsed().as_secs_f64()),
        seconds_to_noise_2_percent: seconds_to_noise,
        samples_per_second: (stats.samples_per_pixel - resumed_samples) / render_seconds,
        rays: stats.rays,
        rays_per_second: stats.rays.total() as f64 / render_seconds,
        noise,
        dropped_samples: stats.dropped,
        peak_memory_bytes: peak_memory(),
        load_phases: report.seconds.clone(),
        warnings: report.warnings(),
        looked_at: film.looked_at(),
        decisions: report.decisions(),
        outputs: job.outputs.iter().map(|p| p.display().to_string()).collect(),
        interrupted: matches!(end, End::Interrupted),
        out_of_time: match end {
            End::Noise | End::Interrupted => false,
            End::Samples => job.noise.is_some(),
            End::Time => asked.is_some() || job.noise.is_some(),
            End::Dark => true,
        },
    })
}

/// Why a render ended.
enum End {
    /// All samples that were asked for.
    Samples,
    /// The noise goal.
    Noise,
    /// The time limit.
    Time,
    /// There is a noise goal but no light.
    Dark,
    /// From outside.
    Interrupted,
}

/// From the kernel's own account of this process; `None` where there is no such file.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}
