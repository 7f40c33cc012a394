//! Progress on standard error.

use indicatif::{ProgressBar, ProgressStyle};
use penumbra::load::{Phase, Watcher};
use penumbra::render::Progress;
use std::io::IsTerminal;
use std::sync::Arc;
use std::time::{Duration, Instant};

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
pub struct Bar {
    bar: Option<ProgressBar>,
    last_line: std::cell::Cell<Option<Instant>>,
    quiet: bool,
}

impl Bar {
    pub fn new(quiet: bool) -> Self {
        let bar = (!quiet && std::io::stderr().is_terminal()).then(|| {
            let style = ProgressStyle::with_template("{bar:32} {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(1000).with_style(style)
        });
        Self { bar, last_line: std::cell::Cell::new(Some(Instant::now())), quiet }
    }

    /// Shows how far loading is.
    pub fn watcher(&self) -> Watcher {
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

    /// Shows how far rendering is.
    pub fn update(&self, progress: &Progress) {
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

    /// Shows a line, and how much of the work is done, 0 to 1.
    pub fn show(&self, part: f64, message: String) {
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

    /// Takes the line away.
    pub fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
