//! Speed and error, measured: tables, curves over time and samples, pictures of where the error is.
//!
//! For each scene: a reference ([`reference`]), every method of [`methods`] several times over
//! ([`measure`]), and the noise number against the true error ([`noise_check`]). What was found is a
//! [`Report`], plain numbers; [`write`](mod@write) makes files of it.

pub mod curve;
pub mod facts;
pub mod false_color;
pub mod log_axis;
pub mod machine;
pub mod markdown;
pub mod measure;
pub mod methods;
pub mod noise_check;
pub mod page;
pub mod pictures;
pub mod plan;
pub mod plot;
pub mod reference;
pub mod run;
pub mod statistics;
pub mod tables;
pub mod write;

pub use reference::GivenReference;
pub use run::{ReportProgress, measure_all};
pub use write::write;

use crate::image::ImageError;
use crate::load::SceneSource;
use crate::open::{OpenError, Wishes};
use crate::reference::ReferenceError;
use glam::UVec2;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// What to measure, for how long, and where the findings go.
#[derive(Clone, Debug)]
pub struct ReportJob {
    /// The scenes.
    pub scenes: Vec<SceneSource>,
    /// How they should look; the size must be there.
    pub wishes: Wishes,
    /// Runs of each method.
    pub seeds: u32,
    /// Time for everything.
    pub total: Duration,
    /// References that somebody has already.
    pub references: Vec<GivenReference>,
    /// Where the files go.
    pub folder: PathBuf,
    /// Raised from outside to stop and write what there is.
    pub interrupt: Arc<AtomicBool>,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A scene cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] ImageError),
    /// The folder cannot be made or written to.
    #[error("{}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A reference has another size.
    #[error("{}: the reference is {}x{}, the pictures of {scene} are {}x{}; give it --resolution {}x{}",
        path.display(), found.x, found.y, wanted.x, wanted.y, found.x, found.y)]
    ReferenceSize {
        /// The reference.
        path: PathBuf,
        /// Of which scene.
        scene: String,
        /// Its size.
        found: UVec2,
        /// The size that is measured.
        wanted: UVec2,
    },
    /// A reference is for a scene that is not measured.
    #[error("--reference {given}: say of which scene it is as SCENE=FILE; measured are {scenes}")]
    ReferenceScene {
        /// The argument.
        given: String,
        /// The scenes.
        scenes: String,
    },
    /// A reference cannot be read.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// A reference may hold the samples of runs that are measured.
    #[error("{}: was made with seed {seed}, and the runs of a report have the seeds below {}: their errors would come out too \
             small; make it with another, such as --seed 12345", path.display(), reference::OWN_SEEDS)]
    ReferenceSeed {
        /// The reference.
        path: PathBuf,
        /// Its seed.
        seed: u32,
    },
    /// A reference holds values that are not finite.
    #[error("{}: the reference has {count} values that are not finite", path.display())]
    ReferenceBroken {
        /// The reference.
        path: PathBuf,
        /// How many.
        count: usize,
    },
    /// The findings cannot be written down.
    #[error("report.json: {0}")]
    Json(#[from] serde_json::Error),
    /// The curves cannot be drawn.
    #[error("{0}")]
    Plot(String),
}

/// All findings.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of this program.
    pub version: &'static str,
    /// What it ran on.
    pub machine: machine::Machine,
    /// Scene by scene.
    pub scenes: Vec<SceneReport>,
    /// Stopped before everything was measured.
    pub interrupted: bool,
}

/// Findings about one scene.
#[derive(Clone, Debug, Serialize)]
pub struct SceneReport {
    /// Its name, and the start of its files' names.
    pub name: String,
    /// Width of the pictures.
    pub width: u32,
    /// Height of the pictures.
    pub height: u32,
    /// `direct` or `path`.
    pub integrator: &'static str,
    /// Bounces at most.
    pub max_depth: u32,
    /// What it is and how fast.
    pub facts: facts::Facts,
    /// Seconds given to each part.
    pub plan: plan::Plan,
    /// What errors are measured against.
    pub reference: reference::ReferenceFacts,
    /// Speed and error of our own method, from its longest run.
    pub performance: measure::Performance,
    /// All methods.
    pub methods: Vec<MethodReport>,
    /// The noise number over the true error.
    pub noise_check: Option<noise_check::NoiseCheck>,
    /// For the page.
    #[serde(skip)]
    pub pictures: pictures::Pictures,
}

/// Findings about one method on one scene.
#[derive(Clone, Debug, Serialize)]
pub struct MethodReport {
    /// Short, without spaces.
    pub name: &'static str,
    /// For people.
    pub title: &'static str,
    /// What it changes.
    pub changes: &'static str,
    /// Ours with one thing switched off.
    pub ablation: bool,
    /// Each seed's measurements.
    pub runs: Vec<measure::Run>,
    /// Over all pixels.
    pub all: curve::Findings,
    /// Without the pixels that see a light, if there are such.
    pub surfaces: Option<curve::Findings>,
}

impl MethodReport {
    /// By one measure.
    #[must_use]
    pub fn findings(&self, measure: curve::Measure) -> Option<&curve::Findings> {
        match measure {
            curve::Measure::All => Some(&self.all),
            curve::Measure::Surfaces => self.surfaces.as_ref(),
        }
    }
}

impl SceneReport {
    /// The measures that there are findings by.
    #[must_use]
    pub fn measures(&self) -> Vec<curve::Measure> {
        let surfaces = self.methods.iter().any(|m| m.surfaces.is_some());
        if surfaces { vec![curve::Measure::All, curve::Measure::Surfaces] } else { vec![curve::Measure::All] }
    }

    /// The method of that name, if it got that far.
    #[must_use]
    pub fn method(&self, name: &str) -> Option<&MethodReport> {
        self.methods.iter().find(|m| m.name == name)
    }
}
