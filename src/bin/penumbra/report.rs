//! `report`.

use crate::bar::Bar;
use crate::exit;
use crate::signal::{set_threads, stop_on_signals};
use penumbra::cli::ReportArgs;
use penumbra::open::OpenError;
use penumbra::report::{Report, ReportError, measure_all, write};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Measures, and writes the page.
pub fn run(args: &ReportArgs) -> u8 {
    let interrupt = Arc::new(AtomicBool::new(false));
    let job = match args.job(Arc::clone(&interrupt)) {
        Ok(job) => job,
        Err(error) => return exit::because(&error, exit::SCENE_NOT_READABLE),
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
