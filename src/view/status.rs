//! What the status says: names and values, without how they look.

use super::controls::{filter_name, integrator_name, tone_map_name};
use super::debug::DebugStatus;
use super::edit::EditStatus;
use super::instrument::Graph;
use super::pixel_view::Legend;
use crate::image::ToneMap;
use crate::scene::Filter;
use crate::trace::Integrator;
use glam::UVec2;
use std::sync::Arc;

/// What the engine says about itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Status {
    /// Samples a pixel has on average.
    pub samples_per_pixel: f64,
    /// Samples per pixel to stop at.
    pub sample_target: u32,
    /// Whether the target is reached.
    pub done: bool,
    /// Whether the user has paused refinement.
    pub paused: bool,
    /// Seconds at which the animations are, if not at rest.
    pub animation: Option<f64>,
    /// Estimated relative noise of the picture, and half its interval.
    pub noise: Option<(f64, f64)>,
    /// How it falls.
    pub graph: Arc<Graph>,
    /// What the colours stand for, if it is not light.
    pub legend: Option<Legend>,
    /// What is drawn into the scene.
    pub debug: DebugStatus,
    /// What is selected.
    pub edit: Option<Arc<EditStatus>>,
    /// Whether no file has what was edited.
    pub unsaved: bool,
    /// Rays of all kinds per second of tracing.
    pub rays_per_second: f64,
    /// Side of a preview pixel.
    pub preview_scale: Option<u32>,
    /// Share of the pixels that show samples of another view.
    pub kept: f64,
    /// Whether the picture is shown smoothed.
    pub smoothed: bool,
    /// The part of the picture that is refined, if not all: left, top, width, height in pixels.
    pub region: Option<[u32; 4]>,
    /// What loading has found.
    pub card: Arc<str>,
    /// What the machine holds and does, for who wants to know all.
    pub machine: Machine,
    /// How often the film was reset.
    pub resets: u64,
    /// Samples dropped because they were not finite.
    pub dropped: u64,
    /// Exposure in stops.
    pub exposure: f32,
    /// What happens above white.
    pub tone_map: ToneMap,
    /// Base speed, scene units per second.
    pub speed: f64,
    /// Keys turn about the pivot.
    pub orbiting: bool,
    /// Size of the picture in pixels.
    pub size: UVec2,
    /// How light is gathered.
    pub integrator: Integrator,
    /// Texture filter, if not the file's.
    pub filter: Option<Filter>,
    /// Instructions that rays are traced with.
    pub isa: &'static str,
}

/// What the machine holds and does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Machine {
    /// Threads that trace.
    pub threads: usize,
    /// Instances, triangles of all of them, and lights.
    pub counts: [usize; 3],
    /// Bytes of the film, of what is kept to be shown, and of the hierarchy.
    pub bytes: [usize; 3],
    /// Seconds that the last first picture took: its preview, and what was carried over.
    pub first_picture: [f64; 2],
    /// Seconds that the last development took.
    pub developing: f64,
}

/// How much is told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Level {
    /// Nothing.
    None,
    /// What one wants to know while flying.
    #[default]
    Short,
    /// How the picture is made.
    Long,
    /// All, also of the machine.
    All,
}

impl Level {
    /// The next one, round and round.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::None => Self::Short,
            Self::Short => Self::Long,
            Self::Long => Self::All,
            Self::All => Self::None,
        }
    }
}

/// What the window itself measures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Pictures shown in the last second.
    pub pictures_per_second: f64,
    /// From an event to the first picture that shows its effect, seconds: median and 99th percentile of the last ones.
    pub latency: Option<(f64, f64)>,
}

/// A value, what it is called, and a small addition.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// What it is.
    pub label: &'static str,
    /// How much.
    pub value: String,
    /// More about it.
    pub note: String,
}

fn cell(label: &'static str, value: String, note: String) -> Cell {
    Cell { label, value, note }
}

/// What one wants to know at any time.
#[must_use]
pub fn headline(status: &Status) -> Vec<Cell> {
    let (noise, doubt) = match status.noise {
        Some((noise, doubt)) => (percent(noise), format!("± {}", significant(doubt * 100.0, 1))),
        None => ("—".to_owned(), String::new()),
    };
    let mut cells = vec![cell("noise", noise, doubt)];
    if let Some(error) = status.graph.current.last().and_then(|point| point.error) {
        cells.push(cell("error", percent(error), "true".to_owned()));
    }
    cells.push(cell("samples", samples(status.samples_per_pixel), format!("/ {}", status.sample_target)));
    cells.push(match status.graph.forecast {
        _ if status.done || status.paused => {
            cell("state", if status.done { "done" } else { "paused" }.to_owned(), String::new())
        }
        Some(forecast) => {
            cell("time left", duration(forecast.seconds), format!("to {}", percent(forecast.goal)))
        }
        None => cell("time left", "—".to_owned(), String::new()),
    });
    cells
}

/// What needs saying at once, if anything: what is seen is not the picture as it will be.
#[must_use]
pub fn caution(status: &Status) -> Option<String> {
    let mut said = Vec::new();
    if let Some(scale) = status.preview_scale.filter(|&scale| scale > 1) {
        said.push(format!("preview 1/{scale}"));
    }
    said.extend(altered(status));
    if let Some([left, top, width, height]) = status.region {
        said.push(format!("only {width} × {height} at {left}, {top}"));
    }
    if status.dropped > 0 {
        said.push(format!("{} samples dropped: not finite", status.dropped));
    }
    (!said.is_empty()).then(|| said.join("  "))
}

/// What is told even where nothing else is: that more is shown than the film.
#[must_use]
pub fn altered(status: &Status) -> Option<String> {
    let mut said = Vec::new();
    if status.kept > 0.0 {
        said.push(format!("kept {:.0} %", status.kept * 100.0));
    }
    if status.smoothed {
        said.push("smoothed".to_owned());
    }
    (!said.is_empty()).then(|| said.join("  "))
}

/// Everything else.
#[must_use]
pub fn details(status: &Status, measured: Measured) -> Vec<Cell> {
    let plain = |label, value: String| cell(label, value, String::new());
    let latency = measured.latency.map_or_else(
        || "—".to_owned(),
        |(median, worst)| {
            format!("{} ms, 99 %: {} ms", significant(median * 1e3, 2), significant(worst * 1e3, 2))
        },
    );
    let mut cells = vec![
        plain("picture", format!("{} × {}", status.size.x, status.size.y)),
        plain("light", integrator_name(status.integrator).to_owned()),
        plain("exposure", format!("{:+.2} EV, {}", status.exposure, tone_map_name(status.tone_map))),
        plain("textures", filter_name(status.filter).to_owned()),
        plain(if status.orbiting { "orbit" } else { "fly" }, format!("{} / s", significant(status.speed, 3))),
        plain("rays", format!("{} M/s, {}", significant(status.rays_per_second / 1e6, 3), status.isa)),
        plain("pictures", format!("{} / s", significant(measured.pictures_per_second, 3))),
        plain("response", latency),
        plain("restarts", status.resets.to_string()),
    ];
    cells.extend(status.animation.map(|seconds| plain("animation", format!("{seconds:.2} s"))));
    cells
}

/// What the machine holds and does.
#[must_use]
pub fn machine(status: &Status) -> Vec<Cell> {
    let plain = |label, value: String| cell(label, value, String::new());
    let Machine { threads, counts, bytes, first_picture, developing } = status.machine;
    let [instances, triangles, lights] = counts;
    let [film, shown, hierarchy] = bytes.map(told_bytes);
    let [preview, carried] = first_picture.map(|seconds| significant(seconds * 1e3, 2));
    vec![
        plain(
            "scene",
            [counted(triangles, "triangle"), counted(instances, "instance"), counted(lights, "light")]
                .join(", "),
        ),
        plain("memory", format!("film {film}, shown {shown}, hierarchy {hierarchy}")),
        plain("first picture", format!("preview {preview}, kept {carried} ms")),
        plain("development", format!("{} ms", significant(developing * 1e3, 2))),
        plain("threads", threads.to_string()),
    ]
}

/// In the unit that makes them short.
fn told_bytes(bytes: usize) -> String {
    let (unit, name) = if bytes < 1_000_000 { (1e3, "kB") } else { (1e6, "MB") };
    format!("{} {name}", significant(bytes as f64 / unit, 3))
}

/// `digits` significant digits, without exponent while it is short.
#[must_use]
pub fn significant(x: f64, digits: u32) -> String {
    let magnitude = x.abs();
    if magnitude == 0.0 {
        "0".to_owned()
    } else if !(1e-3..1e6).contains(&magnitude) {
        format!("{x:.*e}", digits.saturating_sub(1) as usize)
    } else {
        let decimals = (f64::from(digits) - 1.0 - magnitude.log10().floor()).max(0.0) as usize;
        format!("{x:.decimals$}")
    }
}

/// So many of them, in plain English.
#[must_use]
pub fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// Of 1, with three digits; round levels as they are.
#[must_use]
pub fn percent(part: f64) -> String {
    let text = significant(part * 100.0, 3);
    let short = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{short} %")
}

/// As people say it.
#[must_use]
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 119.5 => format!("{s:.0} s"),
        s if s < 7170.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_000.0 => format!("{:.0} h", s / 3600.0),
        s => format!("{:.0} days", s / 86400.0),
    }
}

/// Whole samples as such, and a digit of what is between.
fn samples(samples: f64) -> String {
    if samples.fract() == 0.0 { format!("{samples}") } else { format!("{samples:.1}") }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::instrument::{Forecast, Point};
    use super::*;

    pub(in super::super) fn status() -> Status {
        Status {
            samples_per_pixel: 2.75,
            sample_target: 64,
            done: false,
            paused: false,
            animation: None,
            noise: None,
            graph: Arc::default(),
            legend: None,
            debug: DebugStatus::default(),
            edit: None,
            unsaved: false,
            rays_per_second: 1.234_5e6,
            preview_scale: Some(4),
            kept: 0.0,
            smoothed: false,
            region: None,
            card: Arc::from("a.obj: valid"),
            machine: Machine::default(),
            resets: 3,
            dropped: 0,
            exposure: 1.0 / 3.0,
            tone_map: ToneMap::Clip,
            speed: 0.5,
            orbiting: false,
            size: UVec2::new(320, 240),
            integrator: Integrator::Direct,
            filter: None,
            isa: "scalar",
        }
    }

    fn text(cells: &[Cell]) -> String {
        let cells = cells.iter().map(|c| format!("{} {} {}", c.label, c.value, c.note).trim().to_owned());
        cells.collect::<Vec<_>>().join("; ")
    }

    #[test]
    fn unknown_noise_is_not_zero_noise() {
        let mut status = status();
        assert_eq!(text(&headline(&status)), "noise —; samples 2.8 / 64; time left —");
        assert_eq!(caution(&status).unwrap(), "preview 1/4");
        (status.kept, status.smoothed, status.region) = (0.876, true, Some([8, 16, 64, 32]));
        assert_eq!(caution(&status).unwrap(), "preview 1/4  kept 88 %  smoothed  only 64 × 32 at 8, 16");
        status.noise = Some((0.012_34, 0.000_51));
        let forecast = Some(Forecast { goal: 0.01, seconds: 12.3 });
        let point = Point { seconds: 1.0, samples: 2.75, noise: 0.012, doubt: 0.0, error: Some(0.02) };
        status.graph = Arc::new(Graph { current: vec![point], forecast, ..Graph::default() });
        assert_eq!(
            text(&headline(&status)),
            "noise 1.23 % ± 0.05; error 2 % true; samples 2.8 / 64; time left 12 s to 1 %"
        );
    }

    #[test]
    fn one_is_not_told_as_several() {
        let counts = [1, 1, 0];
        let status = Status { machine: Machine { counts, ..Machine::default() }, ..status() };
        assert_eq!(machine(&status)[0].value, "1 triangle, 1 instance, 0 lights");
        let status = Status { machine: Machine { counts: [2, 34, 1], ..Machine::default() }, ..status };
        assert_eq!(machine(&status)[0].value, "34 triangles, 2 instances, 1 light");
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0, 1900, 12_345_678].map(told_bytes), ["0 kB", "1.90 kB", "12.3 MB"]);
        let digits = [0.0, 1234.5, 0.012_34, 9.999, 1e7].map(|x| significant(x, 3));
        assert_eq!(digits, ["0", "1234", "0.0123", "10.00", "1.00e7"]);
        assert_eq!([0.1, 0.005, 0.012_3, 1.0].map(percent), ["10 %", "0.5 %", "1.23 %", "100 %"]);
        assert_eq!(
            [0.04, 9.96, 100.0, 600.0, 8000.0, 1e6].map(duration),
            ["0.0 s", "10 s", "100 s", "10 min", "2 h", "12 days"]
        );
    }
}
