//! The `penumbra` command: arguments in, exit code out. The one place that prints.

use clap::{CommandFactory, Parser};
use indicatif::{ProgressBar, ProgressStyle};
use penumbra::cli::{
    CheckArgs, Cli, Command, CompareArgs, MergeArgs, OutputArgs, ReportArgs, SceneArgs, WindowArgs,
};
use penumbra::farm::{self, is_film};
use penumbra::image::compare::compare_files;
use penumbra::image::{ImageError, PictureFormat, save};
use penumbra::load::{Card, LoadError, LoadOptions, LoadReport, Phase, Verdict, Watcher, built_in_scenes};
use penumbra::open::OpenError;
use penumbra::render::{Progress, RenderError, RenderJob, RenderSummary, render};
use penumbra::report::{Report, ReportError, measure_all, write};
#[cfg(feature = "view")]
use penumbra::{app::FrameBudget, open::open, render::open_reference, trace::RenderSettings};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Where the window comes to rest, if nobody says.
#[cfg(feature = "view")]
const WINDOW_SAMPLES: u32 = 1024;

/// Documented in the README and in `--help`.
mod exit {
    pub const FAILED: u8 = 1;
    pub const BAD_COMMAND_LINE: u8 = 2;
    pub const SCENE_NOT_READABLE: u8 = 3;
    pub const BEFORE_TARGET: u8 = 4;
    pub const ABOVE_LIMIT: u8 = 5;
    pub const NOT_ALL_AS_IN_THE_FILE: u8 = 6;
    pub const INTERRUPTED: u8 = 130;
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let code = match cli.command {
        Some(Command::Render(args)) => {
            let output = args.output.clone();
            match args.scene() {
                Ok(scene) => headless(&scene, &output),
                Err(error) => {
                    eprintln!("error: {error}");
                    exit::BAD_COMMAND_LINE
                }
            }
        }
        Some(Command::Completions(args)) => {
            clap_complete::generate(args.shell, &mut Cli::command(), "penumbra", &mut std::io::stdout());
            0
        }
        Some(Command::Man) => manual(),
        Some(Command::Check(args)) => check(&args),
        Some(Command::Compare(args)) => compare(&args),
        Some(Command::Merge(args)) => merge(&args),
        Some(Command::Report(args)) => report(&args),
        None if cli.window.list_scenes => {
            for scene in built_in_scenes() {
                println!("{:<15} {}", scene.name, scene.description);
            }
            0
        }
        None if !cli.window.output.output.is_empty() => headless(&cli.window.scene, &cli.window.output),
        None => window(&cli.window),
    };
    ExitCode::from(code)
}

/// Prints the manual page. Whoever closed standard output does not want to read it.
fn manual() -> u8 {
    u8::from(clap_mangen::Man::new(Cli::command()).render(&mut std::io::stdout()).is_err())
}

#[cfg(not(feature = "view"))]
fn window(args: &WindowArgs) -> u8 {
    eprintln!("built without the window (feature `view`): rendering to a picture instead");
    instead_of_window(args)
}

#[cfg(feature = "view")]
fn window(args: &WindowArgs) -> u8 {
    use penumbra::view::{ViewError, ViewOptions, run};
    let source = match args.scene.source() {
        Ok(source) => source,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::SCENE_NOT_READABLE;
        }
    };
    set_threads(args.scene.threads);
    let keys = match penumbra::view::keys_file::read(args.keys.as_deref()) {
        Ok(keys) => keys,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::BAD_COMMAND_LINE;
        }
    };
    let replay = args.replay.as_deref().map(penumbra::view::replay::Replay::open).transpose();
    let record = args.record.as_deref().map(penumbra::view::replay::Recorder::create).transpose();
    let (replay, record) = match replay.and_then(|replay| Ok((replay, record?))) {
        Ok(both) => both,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::BAD_COMMAND_LINE;
        }
    };
    let replays = replay.is_some();
    let reference = match args.output.reference.as_deref().map(open_reference).transpose() {
        Ok(reference) => reference,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::FAILED;
        }
    };
    let (wishes, even) = (args.scene.wishes(&args.output), args.scene.even);
    let options = ViewOptions {
        title: format!("Penumbra – {}", source.name()),
        size: wishes.size.unwrap_or(RenderSettings::default().size),
        screenshot_stem: source.name(),
        reference,
        keys,
        replay,
        record,
        exit_after: None,
    };
    let load = args.scene.load_options();
    let opened = run(options, move || match open(&source, &load, &wishes) {
        Ok(mut opened) => {
            tell(&opened.report);
            let mut budget = opened.app.world.resource_mut::<FrameBudget>();
            budget.sample_target = opened.samples.unwrap_or(WINDOW_SAMPLES);
            budget.adaptive = opened.samples.is_none() && !even;
            Ok(opened.app)
        }
        Err(error) => Err(error.to_string()),
    });
    match opened {
        Ok(response) => {
            if replays {
                println!("{}", response.json());
            }
            0
        }
        Err(ViewError::NoDisplay(why)) => {
            eprintln!("no window: {why}; rendering to a picture instead");
            instead_of_window(args)
        }
        Err(ViewError::Scene(error)) => {
            eprintln!("error: {error}");
            exit::SCENE_NOT_READABLE
        }
        Err(error) => {
            eprintln!("error: {error}");
            exit::FAILED
        }
    }
}

/// Renders what the window would have shown to a picture.
fn instead_of_window(args: &WindowArgs) -> u8 {
    headless_to(&args.scene, &args.output, vec![picture_of(&args.scene)])
}

fn headless(scene: &SceneArgs, output: &OutputArgs) -> u8 {
    if output.reference.is_some() && output.error_log.is_none() {
        eprintln!("error: --reference needs --error-log FILE.csv to write the errors to");
        return exit::BAD_COMMAND_LINE;
    }
    let mut outputs = match files_to_write(&output.output) {
        Ok(outputs) => outputs,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::BAD_COMMAND_LINE;
        }
    };
    if outputs.is_empty() && !output.json {
        outputs.push(picture_of(scene));
    }
    headless_to(scene, output, outputs)
}

/// The files of `-o`, checked before any work is done.
fn files_to_write(given: &[PathBuf]) -> Result<Vec<PathBuf>, ImageError> {
    let mut outputs = Vec::new();
    for path in given {
        // NAME alone means both.
        if path.extension().is_none() {
            outputs.extend([path.with_extension("png"), path.with_extension("exr")]);
        } else {
            if !is_film(path) {
                PictureFormat::of(path)?;
            }
            outputs.push(path.clone());
        }
    }
    Ok(outputs)
}

/// `SCENE.png` in the current folder.
fn picture_of(scene: &SceneArgs) -> PathBuf {
    let name = scene.source().map_or_else(|_| "scene".to_owned(), |source| source.name());
    PathBuf::from(format!("{name}.png"))
}

fn headless_to(scene: &SceneArgs, output: &OutputArgs, outputs: Vec<PathBuf>) -> u8 {
    let source = match scene.source() {
        Ok(source) => source,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::SCENE_NOT_READABLE;
        }
    };
    set_threads(scene.threads);
    let interrupt = Arc::new(AtomicBool::new(false));
    stop_on_signals(&interrupt);
    let bar = Bar::new(output.quiet);
    let job = RenderJob {
        source,
        load: LoadOptions { watcher: bar.watcher(), ..scene.load_options() },
        wishes: scene.wishes(output),
        time_limit: output.time_limit,
        noise: output.noise,
        even: scene.even,
        resume: output.resume.clone(),
        error_log: output.reference.clone().zip(output.error_log.clone()),
        outputs,
        interrupt,
    };
    let say = |report: &LoadReport| {
        if !output.quiet {
            tell(report);
        }
    };
    let result = render(&job, |opened| say(&opened.report), |progress| bar.update(progress));
    bar.clear();
    match result {
        Ok(summary) => finish(&summary, output),
        Err(RenderError::Open(OpenError::Load(error @ LoadError::NotThere { .. }))) => {
            eprintln!("error: {error}");
            exit::BAD_COMMAND_LINE
        }
        Err(RenderError::Open(OpenError::Load(error))) => {
            eprintln!("error: {error}");
            exit::SCENE_NOT_READABLE
        }
        Err(RenderError::Open(error)) => {
            eprintln!("error: {error}");
            exit::BAD_COMMAND_LINE
        }
        Err(error) => {
            eprintln!("error: {error}");
            exit::FAILED
        }
    }
}

fn finish(summary: &RenderSummary, output: &OutputArgs) -> u8 {
    if !output.quiet {
        let noise = summary.noise.map_or("unknown".to_owned(), |n| format!("{:.2} %", n * 100.0));
        eprintln!(
            "{}: {:.0} samples per pixel in {:.2} s (load {:.2} s, build {:.3} s), {:.2} Mrays/s, estimated noise {noise}",
            summary.scene,
            summary.samples,
            summary.render_seconds,
            summary.load_seconds,
            summary.build_seconds,
            summary.rays_per_second * 1e-6,
        );
        for path in &summary.outputs {
            eprintln!("wrote {path}");
        }
    }
    if summary.dropped_samples > 0 {
        eprintln!("warning: {} samples were not finite and were left out", summary.dropped_samples);
    }
    if output.json {
        match serde_json::to_string(summary) {
            Ok(json) => println!("{json}"),
            Err(error) => {
                eprintln!("error: {error}");
                return exit::FAILED;
            }
        }
    }
    if summary.interrupted {
        exit::INTERRUPTED
    } else if summary.out_of_time {
        exit::BEFORE_TARGET
    } else {
        0
    }
}

fn tell(report: &LoadReport) {
    for line in report.warnings() {
        eprintln!("warning: {line}");
    }
    for line in report.decisions() {
        eprintln!("note: {line}");
    }
}

fn set_threads(threads: usize) {
    // Fails only if the pool is already there, which is no harm.
    let _ = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
}

/// The first signal asks for an end with a picture, the second ends at once.
fn stop_on_signals(interrupt: &Arc<AtomicBool>) {
    let interrupt = Arc::clone(interrupt);
    let set = ctrlc::set_handler(move || {
        if interrupt.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(exit::INTERRUPTED));
        }
    });
    if let Err(error) = set {
        eprintln!("warning: Ctrl-C will not save the picture: {error}");
    }
}

/// How much of the work is done, and the seconds that are left; `None` until that can be told.
fn how_far(progress: &Progress) -> (f64, Option<f64>) {
    let made = progress.samples - progress.resumed;
    let to_make = f64::from(progress.target) - progress.resumed;
    let by_samples = (made / to_make > 0.01).then(|| progress.seconds * (to_make / made - 1.0));
    let by_time = progress.limit.map(|limit| limit - progress.seconds);
    // Whatever comes first ends it.
    let ends = [by_samples, by_time, progress.seconds_to_noise];
    let left = ends.into_iter().flatten().map(|left| left.max(0.0)).reduce(f64::min);
    let part = left.map_or(0.0, |left| progress.seconds / (progress.seconds + left));
    (if part.is_finite() { part } else { 0.0 }, left)
}

/// One line, redrawn on a terminal; elsewhere a line every few seconds.
struct Bar {
    bar: Option<ProgressBar>,
    last_line: std::cell::Cell<Option<Instant>>,
    quiet: bool,
}

impl Bar {
    fn new(quiet: bool) -> Self {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template("{bar:32} {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(1000).with_style(style)
        });
        Self { bar, last_line: std::cell::Cell::new(Some(Instant::now())), quiet }
    }

    /// Shows how far loading is.
    fn watcher(&self) -> Watcher {
        let Some(bar) = self.bar.clone() else { return Watcher::default() };
        Watcher(Some(Arc::new(move |phase, part| {
            // Where each phase begins, as large files go.
            let (start, end) = match phase {
                Phase::Reading => (0.0, 0.1),
                Phase::Parsing => (0.1, 0.4),
                Phase::Decompressing => (0.4, 0.5),
                Phase::Images => (0.5, 0.8),
                Phase::Meshes => (0.8, 0.95),
                Phase::Framing => (0.95, 1.0),
            };
            let part: f32 = start + (end - start) * part;
            bar.set_position((part * 1000.0) as u64);
            bar.set_message(format!("loading: {phase}"));
        })))
    }

    fn update(&self, progress: &Progress) {
        let (part, left) = how_far(progress);
        let left = left.map_or("—".to_owned(), |seconds| format!("{seconds:.0} s left"));
        let noise = progress.noise.map_or("—".to_owned(), |n| format!("{:.2} %", n * 100.0));
        self.show(
            part,
            format!(
                "{:.0} samples per pixel, noise {noise}, {:.0} s, {left}",
                progress.samples, progress.seconds
            ),
        );
    }

    fn show(&self, part: f64, message: String) {
        if let Some(bar) = &self.bar {
            bar.set_position((part * 1000.0) as u64);
            bar.set_message(message);
        } else if !self.quiet
            && self.last_line.get().is_none_or(|last| last.elapsed() > Duration::from_secs(5))
        {
            eprintln!("{:3.0} %: {message}", part * 100.0);
            self.last_line.set(Some(Instant::now()));
        }
    }

    fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Prints the report card of each file.
fn check(args: &CheckArgs) -> u8 {
    let options = args.load_options();
    let mut worst = Verdict::Valid;
    for file in &args.files {
        let card = Card::check(file, &options);
        worst = worst.max(card.verdict);
        if !args.json {
            println!("{}", card.text());
            continue;
        }
        match serde_json::to_string(&card) {
            Ok(json) => println!("{json}"),
            Err(error) => {
                eprintln!("error: {error}");
                return exit::FAILED;
            }
        }
    }
    match worst {
        Verdict::Valid => 0,
        Verdict::Repaired => exit::NOT_ALL_AS_IN_THE_FILE,
        Verdict::Refused => exit::SCENE_NOT_READABLE,
    }
}

fn merge(args: &MergeArgs) -> u8 {
    let outputs = match files_to_write(&args.output) {
        Ok(outputs) => outputs,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::BAD_COMMAND_LINE;
        }
    };
    let merged = match farm::merge(&args.films, args.sample_range.clone(), args.allow_gaps) {
        Ok(Some(merged)) => merged,
        // The command line wants one at least.
        Ok(None) => return exit::BAD_COMMAND_LINE,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::FAILED;
        }
    };
    let mut display = merged.header.display();
    display.exposure = args.exposure.unwrap_or(display.exposure);
    display.tone_map = args.tone_map.map_or(display.tone_map, Into::into);
    for path in &outputs {
        let written = if is_film(path) { merged.write(path) } else { save(path, &merged.film, &display) };
        if let Err(error) = written {
            eprintln!("error: {error}");
            return exit::FAILED;
        }
    }
    if !args.quiet {
        let (fewest, most) = merged.samples();
        let samples = if fewest == most { most.to_string() } else { format!("{fewest} to {most}") };
        let scene = &merged.header.identity.scene;
        eprintln!("{scene}: {} films, {samples} samples per pixel", args.films.len());
        for path in &outputs {
            eprintln!("wrote {}", path.display());
        }
    }
    0
}

fn report(args: &ReportArgs) -> u8 {
    let interrupt = Arc::new(AtomicBool::new(false));
    let job = match args.job(Arc::clone(&interrupt)) {
        Ok(job) => job,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::SCENE_NOT_READABLE;
        }
    };
    set_threads(args.threads);
    stop_on_signals(&interrupt);
    let bar = Bar::new(args.quiet);
    let measured = measure_all(&job, |progress| {
        bar.show(progress.part, format!("{}, {:.0} s left", progress.what, progress.seconds_left));
    });
    bar.clear();
    match measured.and_then(|report| Ok((write(&report, &job.folder)?, report))) {
        Ok((files, report)) => {
            if !args.quiet {
                eprint!("{}", slopes(&report));
                eprintln!("wrote {} files; read {}", files.len(), job.folder.join("index.html").display());
            }
            if report.interrupted { exit::INTERRUPTED } else { 0 }
        }
        Err(error) => {
            eprintln!("error: {error}");
            match error {
                ReportError::Open(OpenError::Load(_)) => exit::SCENE_NOT_READABLE,
                ReportError::ReferenceScene { .. } => exit::BAD_COMMAND_LINE,
                _ => exit::FAILED,
            }
        }
    }
}

/// A line for each method on each scene.
fn slopes(report: &Report) -> String {
    let mut lines = String::new();
    for scene in &report.scenes {
        for method in &scene.methods {
            let found = method.surfaces.as_ref().unwrap_or(&method.all);
            let slope = found.slope.map_or("—".to_owned(), |fit| format!("{:+.3}", fit.slope));
            let error = found.curve.last().map_or(0.0, |point| point.rmse);
            lines +=
                &format!("{:<16} {:<18} slope {slope}, last RMSE {error:.2e}\n", scene.name, method.title);
        }
    }
    lines
}

fn compare(args: &CompareArgs) -> u8 {
    let difference = match compare_files(&args.a, &args.b) {
        Ok(difference) => difference,
        Err(error) => {
            eprintln!("error: {error}");
            return exit::FAILED;
        }
    };
    if args.json {
        match serde_json::to_string(&difference) {
            Ok(json) => println!("{json}"),
            Err(error) => {
                eprintln!("error: {error}");
                return exit::FAILED;
            }
        }
    } else {
        let [x, y] = difference.max_at;
        println!("RMSE      {:.6e}", difference.rmse);
        println!("relMSE    {:.6e}", difference.relative_mse);
        println!("max error {:.6e} at pixel {x},{y}", difference.max_error);
        println!("mean      {:+.6e}", difference.bias);
        if difference.not_finite > 0 {
            println!("{} values are not finite and were left out", difference.not_finite);
        }
    }
    let failed = |limit: f64| difference.not_finite > 0 || difference.rmse > limit;
    if args.fail_above.is_some_and(failed) { exit::ABOVE_LIMIT } else { 0 }
}
