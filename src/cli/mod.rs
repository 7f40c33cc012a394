//! The command line: arguments in, wishes out.

mod choices;
mod measure;
mod render;
mod scene;
mod values;

pub use choices::{FilterArg, IntegratorArg, LightUnitsArg, SamplingArg, ToneMapArg};
pub use measure::{ReportArgs, TortureArgs};
pub use render::{OutputArgs, RenderArgs};
pub use scene::{PartArgs, SceneArgs};

use crate::load::LoadOptions;
use clap::{Args, Parser, Subcommand};
use std::ffi::OsString;
use std::ops::Range;
use std::path::PathBuf;
use values::{exposure, sample_range};

/// Fly through a glTF or OBJ scene and watch its soft shadows converge.
#[derive(Debug, Parser)]
#[command(version, args_conflicts_with_subcommands = true, disable_help_subcommand = true)]
#[command(
    after_help = "Exit codes: 0 done; 1 failed (also: a film is damaged or does not fit); 2 bad command line; 3 scene not readable; \
4 stopped before the target; 5 --fail-above exceeded; 6 `check`: loads, but not all of it as it is in the file; 130 interrupted (what there was is saved)."
)]
pub struct Cli {
    /// What to do; nothing opens the window.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// What to open in the window.
    #[command(flatten)]
    pub window: WindowArgs,
}

/// Everything but the window.
#[derive(Debug, Subcommand)]
#[expect(clippy::large_enum_variant, reason = "made once, by clap")]
pub enum Command {
    /// Render to a file, without a window
    Render(RenderArgs),
    /// Load files and say what was found, mended, left out and approximated
    Check(CheckArgs),
    /// Say how much picture A differs from reference B
    Compare(CompareArgs),
    /// Make one picture of films that hold different samples of it
    Merge(MergeArgs),
    /// Measure speed and error over time, and write tables, curves and a page
    Report(ReportArgs),
    /// Try numerical stability on hard cases, and print what held
    Torture(TortureArgs),
    /// Print a script that completes commands in a shell: penumbra completions bash > FILE
    Completions(CompletionsArgs),
    /// Print the manual page, or write those of all commands into a folder: penumbra man share/man/man1
    Man(ManArgs),
}

/// Arguments of the window.
#[derive(Debug, Args)]
pub struct WindowArgs {
    /// Scene and look.
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Write a picture instead of opening a window (as `render`)
    #[command(flatten)]
    pub output: OutputArgs,
    /// Name the built-in scenes
    #[arg(long)]
    pub list_scenes: bool,
    /// Do what this file says, as if a user did it, and print the times from events to pictures as JSON
    #[arg(long, value_name = "FILE")]
    pub replay: Option<PathBuf>,
    /// Write down what the user does, for --replay
    #[arg(long, value_name = "FILE", conflicts_with = "replay")]
    pub record: Option<PathBuf>,
    /// Show no samples of the view before while moving (Y)
    #[arg(long)]
    pub no_kept_samples: bool,
    /// Never show the picture smoothed in its first second (U)
    #[arg(long)]
    pub no_smoothing: bool,
    /// Keys of your own [default: penumbra/keys.toml in your folder of settings, such as ~/.config]
    #[arg(long, value_name = "FILE.toml")]
    pub keys: Option<PathBuf>,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
#[command(
    after_help = "Exit codes, the worst of all files: 0 valid; 6 loads, but something in it was mended, left out or \
approximated; 3 refused."
)]
pub struct CheckArgs {
    /// .gltf, .glb, .obj or .toml files, folders with such, or built-in scenes
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<OsString>,
    /// Settings file to use instead of the .toml beside each scene
    #[arg(long, value_name = "FILE")]
    pub scene_settings: Option<PathBuf>,
    /// What of files that hold several scenes, variants or poses.
    #[command(flatten)]
    pub part: PartArgs,
    /// Print one JSON object a file, each on a line
    #[arg(long)]
    pub json: bool,
}

impl CheckArgs {
    /// How to load.
    #[must_use]
    pub fn load_options(&self) -> LoadOptions {
        self.part.load_options(self.scene_settings.clone())
    }
}

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// The picture: PNG, EXR or another common format, or a .film
    pub a: PathBuf,
    /// The reference, of the same size
    pub b: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// End with exit code 5 if the RMSE is above this
    #[arg(long, value_name = "X")]
    pub fail_above: Option<f64>,
}

/// Arguments of `merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Films of one picture, made with -o NAME.film
    #[arg(required = true, value_name = "FILM")]
    pub films: Vec<PathBuf>,
    /// File to write: .film, .exr or .png; may be given several times
    #[arg(short, long, required = true, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Samples that must be there, no more and no less [default: from number 0 to the last that a film was to
    /// hold]
    #[arg(long, value_name = "A..B", value_parser = sample_range)]
    pub sample_range: Option<Range<u32>>,
    /// Let samples be missing
    #[arg(long)]
    pub allow_gaps: bool,
    /// Exposure of a .png in stops [default: that of the first film]
    #[arg(long, value_name = "EV", value_parser = exposure, allow_hyphen_values = true)]
    pub exposure: Option<f32>,
    /// What happens above white in a .png [default: as in the first film]
    #[arg(long, value_enum)]
    pub tone_map: Option<ToneMapArg>,
    /// Nothing on standard error but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// Arguments of `completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// Whose
    pub shell: clap_complete::Shell,
}

/// Arguments of `man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// Folder for penumbra.1, penumbra-render.1 and so on; it is made if need be [default: print penumbra.1]
    #[arg(value_name = "DIR")]
    pub folder: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }
}
