//! Pictures without a window.

use crate::bar::Bar;
use crate::exit;
use crate::print::line;
use crate::signal::{set_threads, stop_on_signals};
use penumbra::cli::{OutputArgs, SceneArgs};
use penumbra::farm::is_film;
use penumbra::image::{ImageError, PictureFormat};
use penumbra::load::{LoadError, LoadOptions, LoadReport};
use penumbra::open::OpenError;
use penumbra::render::{RenderError, RenderJob, RenderSummary, render};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// `render`, and the window with files to write.
pub fn run(scene: &SceneArgs, output: &OutputArgs) -> u8 {
    if output.reference.is_some() && output.error_log.is_none() {
        eprintln!("error: --reference needs --error-log FILE.csv to write the errors to");
        return exit::BAD_COMMAND_LINE;
    }
    let mut outputs = match files_to_write(&output.output) {
        Ok(outputs) => outputs,
        Err(error) => return exit::because(&error, exit::BAD_COMMAND_LINE),
    };
    if outputs.is_empty() && !output.json {
        outputs.push(picture_of(scene));
    }
    render_to(scene, output, outputs)
}

/// The files of `-o`, checked before any work is done.
pub fn files_to_write(given: &[PathBuf]) -> Result<Vec<PathBuf>, ImageError> {
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
pub fn picture_of(scene: &SceneArgs) -> PathBuf {
    let mut name = scene.source().map_or_else(|_| "scene".into(), |source| source.stem());
    name.push(".png");
    PathBuf::from(name)
}

/// Renders to `outputs`.
pub fn render_to(scene: &SceneArgs, output: &OutputArgs, outputs: Vec<PathBuf>) -> u8 {
    let source = match scene.source() {
        Ok(source) => source,
        Err(error) => return exit::because(&error, exit::SCENE_NOT_READABLE),
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
            exit::because(&error, exit::BAD_COMMAND_LINE)
        }
        Err(RenderError::Open(OpenError::Load(error))) => exit::because(&error, exit::SCENE_NOT_READABLE),
        Err(RenderError::Open(error)) => exit::because(&error, exit::BAD_COMMAND_LINE),
        Err(error @ RenderError::OfAPart) => exit::because(&error, exit::BAD_COMMAND_LINE),
        Err(error) => exit::because(&error, exit::FAILED),
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
    if summary.looked_at < 1.0 {
        let part = 100.0 * summary.looked_at;
        eprintln!("warning: there was time for {part:.0} % of the pixels; the others are guessed");
    }
    if summary.dropped_samples > 0 {
        eprintln!("warning: {} samples were not finite and were left out", summary.dropped_samples);
    }
    if output.json {
        match serde_json::to_string(summary) {
            Ok(json) => line(json),
            Err(error) => return exit::because(&error, exit::FAILED),
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

/// Says what loading had to mend or decide.
pub fn tell(report: &LoadReport) {
    for line in report.warnings() {
        eprintln!("warning: {line}");
    }
    for line in report.decisions() {
        eprintln!("note: {line}");
    }
}
