//! Pictures written to files.

use super::scene::SceneArgs;
use super::values::{noise, sample_range, seconds};
use crate::image::recipe::read_arguments;
use clap::{Args, Parser};
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// Make this screenshot again: scene, camera and look are what it says
    #[arg(long, value_name = "SHOT.png", conflicts_with = "scene")]
    pub from: Option<PathBuf>,
    /// Scene and look.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Where to.
    #[command(flatten)]
    pub output: OutputArgs,
}

/// Where a headless render goes and when it ends.
#[derive(Clone, Debug, Args)]
pub struct OutputArgs {
    /// File to write: .png (developed), .exr (linear) or .film (to --resume or merge); may be given several
    /// times [default: SCENE.png, or nothing with --json]
    #[arg(short, long, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Stop tracing after this many seconds
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub time_limit: Option<Duration>,
    /// Render just these sample indices, A up to but not including B
    #[arg(long, value_name = "A..B", value_parser = sample_range, conflicts_with = "spp")]
    pub sample_range: Option<Range<u32>>,
    /// Stop at this noise, such as 1% or 0.01 (--spp and --time-limit may stop it earlier)
    #[arg(long, value_name = "X", value_parser = noise)]
    pub noise: Option<f64>,
    /// Go on with this film; N of --spp counts what it holds
    #[arg(long, value_name = "FILM")]
    pub resume: Option<PathBuf>,
    /// Picture (.exr best) or film to measure the true error by, in the window or for --error-log
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Table of true error against seconds and samples
    #[arg(long, value_name = "FILE.csv", requires = "reference")]
    pub error_log: Option<PathBuf>,
    /// Print one JSON object about the render to standard output
    #[arg(long)]
    pub json: bool,
    /// No progress on standard error
    #[arg(short, long)]
    pub quiet: bool,
}

/// The scene and the look that a picture's recipe says.
#[derive(Debug, Parser)]
struct RecipeArgs {
    #[command(flatten)]
    scene: SceneArgs,
}

impl RenderArgs {
    /// The scene and the look: those of `--from`, or those given.
    ///
    /// # Errors
    /// If there is no such picture, or it doesn't say.
    pub fn scene(self) -> Result<SceneArgs, String> {
        let Some(path) = self.from else { return Ok(self.scene) };
        let arguments = read_arguments(&path).map_err(|error| error.to_string())?;
        let wrong = |error: clap::Error| {
            let text = error.to_string();
            let line = text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
            format!("{}: its recipe is not for this version: {line}", path.display())
        };
        let arguments = std::iter::once("penumbra".to_owned()).chain(arguments);
        Ok(RecipeArgs::try_parse_from(arguments).map_err(wrong)?.scene)
    }
}
