//! The command line: arguments in, wishes out.

mod values;

use crate::bvh::Isa;
use crate::image::ToneMap;
use crate::image::recipe::read_arguments;
use crate::load::{LoadError, LoadOptions, SceneSource};
use crate::open::{Pose, Wishes};
use crate::report::{GivenReference, ReportJob};
use crate::scene::Filter;
use crate::trace::{Integrator, Sampling};
use clap::{Args, Parser, Subcommand, ValueEnum};
use glam::{DVec3, UVec2};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use values::{
    bytes, exposure, isa, length, noise, radius, resolution, sample_range, seconds, time, vector, view_angle,
};

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
    /// Print the manual page: penumbra man > penumbra.1
    Man,
}

/// Arguments of `torture`.
#[derive(Debug, Args)]
pub struct TortureArgs {
    /// Only this case, such as G1 (may be given several times) [default: all]
    #[arg(long, value_name = "ID")]
    pub case: Vec<String>,
    /// For hours: 10^9 rays, 10^8 samples
    #[arg(long)]
    pub long: bool,
    /// For seconds: few rays and samples
    #[arg(long, conflicts_with = "long")]
    pub quick: bool,
    /// Another seed, other rays
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Name the cases and what must hold
    #[arg(long)]
    pub list: bool,
    /// Look at the scene of this case, such as G1, in the window or, without a display, as a picture
    #[arg(long, value_name = "ID", conflicts_with = "case")]
    pub show: Option<String>,
    /// Show what it looks like when it breaks
    #[arg(long, requires = "show")]
    pub open_edge: bool,
    /// Print every check as JSON
    #[arg(long)]
    pub json: bool,
    /// Print the table as Markdown
    #[arg(long, conflicts_with = "json")]
    pub markdown: bool,
    /// Threads to use; 0 = all
    #[arg(short, long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// No progress on standard error
    #[arg(short, long)]
    pub quiet: bool,
}

/// Arguments of `completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// Whose
    pub shell: clap_complete::Shell,
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

/// The scene and how it should look.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// A .gltf, .glb, .obj or .toml file, or a built-in scene (see --list-scenes)
    #[arg(default_value = "cornell")]
    pub scene: String,
    /// Settings file to use instead of the .toml beside the scene
    #[arg(long, value_name = "FILE")]
    pub scene_settings: Option<PathBuf>,
    /// A picture of all directions (.hdr or .exr, longitude by latitude) that lights the scene in place of its own sky
    #[arg(long, value_name = "FILE")]
    pub hdri: Option<PathBuf>,
    /// Edits that were not saved, as a screenshot knows them
    #[arg(long, value_name = "TOML", hide = true)]
    pub edits: Option<String>,
    /// What of a file that holds several scenes, variants or poses.
    #[command(flatten)]
    pub part: PartArgs,
    /// Size of the picture
    #[arg(long, value_name = "WxH", value_parser = resolution)]
    pub resolution: Option<UVec2>,
    /// Samples per pixel
    #[arg(long, visible_alias = "samples", value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub spp: Option<u32>,
    /// The same number of samples for every pixel, also without --spp [default: more where there is more noise]
    #[arg(long)]
    pub even: bool,
    /// Another seed, other noise
    #[arg(long, value_name = "N")]
    pub seed: Option<u32>,
    /// Threads to trace with; 0 = all
    #[arg(short, long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Instructions to trace with, instead of the machine's widest: scalar, sse2 (neon on ARM), avx2 or avx512
    #[arg(long, value_name = "NAME", value_parser = isa)]
    pub isa: Option<Isa>,
    /// direct = direct light, also in mirrors and through glass; path = global illumination
    #[arg(long, value_enum)]
    pub integrator: Option<IntegratorArg>,
    /// Most bounces from eye to light: 0 shows only what shines, 1 direct light, 2 one bounce more
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// How the random numbers of a pixel are spread: same picture in the end, sooner or later
    #[arg(long, value_enum)]
    pub sampling: Option<SamplingArg>,
    /// Texture filter, whatever the file asks for
    #[arg(long, value_enum)]
    pub filter: Option<FilterArg>,
    /// Camera of the file, by name or by number from 0
    #[arg(long, value_name = "NAME|INDEX")]
    pub camera: Option<String>,
    /// Put the camera here
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub camera_position: Option<DVec3>,
    /// Look at this point
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub camera_focal_point: Option<DVec3>,
    /// What is up in the picture
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub camera_view_up: Option<DVec3>,
    /// Vertical field of view in degrees
    #[arg(long, value_name = "DEG", value_parser = view_angle)]
    pub camera_view_angle: Option<f32>,
    /// Look in parallel, with this height of the picture in scene units
    #[arg(long, value_name = "HEIGHT", value_parser = length, conflicts_with = "camera_view_angle")]
    pub camera_orthographic: Option<f32>,
    /// Radius of the lens in scene units: what is not in focus is blurred; 0 for none
    #[arg(long, value_name = "R", value_parser = radius)]
    pub lens_radius: Option<f32>,
    /// Distance of what is sharp along the line of sight [default: that of the focal point]
    #[arg(long, value_name = "D", value_parser = length)]
    pub focus_distance: Option<f32>,
    /// Exposure in stops
    #[arg(long, value_name = "EV", value_parser = exposure, allow_hyphen_values = true)]
    pub exposure: Option<f32>,
    /// What happens above white
    #[arg(long, value_enum)]
    pub tone_map: Option<ToneMapArg>,
}

/// What of a glTF file to load.
#[derive(Debug, Args)]
pub struct PartArgs {
    /// Scene of a glTF file, by name or by number from 0 [default: the file's]
    #[arg(long, value_name = "NAME|INDEX")]
    pub gltf_scene: Option<String>,
    /// Material variant of a glTF file, by name or by number from 0
    #[arg(long, value_name = "NAME|INDEX")]
    pub variant: Option<String>,
    /// Pose at this time of the animations, instead of the rest pose
    #[arg(long, value_name = "SECONDS", value_parser = time)]
    pub time: Option<f64>,
    /// Animation to take the pose from, by name or by number from 0 [default: the first, and those of other things]
    #[arg(long, value_name = "NAME|INDEX", requires = "time")]
    pub animation: Option<String>,
    /// Memory that loading may take, such as 2G or 500M [default: three quarters of what is free]
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub max_memory: Option<u64>,
}

impl PartArgs {
    fn load_options(&self, scene_settings: Option<PathBuf>) -> LoadOptions {
        LoadOptions {
            scene_settings,
            scene: self.gltf_scene.clone(),
            variant: self.variant.clone(),
            time: self.time,
            animation: self.animation.clone(),
            max_memory: self.max_memory,
            ..LoadOptions::default()
        }
    }
}

/// Arguments of `check`.
#[derive(Debug, Args)]
#[command(
    after_help = "Exit codes, the worst of all files: 0 valid; 6 loads, but something in it was mended, left out or \
approximated; 3 refused."
)]
pub struct CheckArgs {
    /// .gltf, .glb, .obj or .toml files, or built-in scenes
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<String>,
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

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// The picture: PNG, EXR or another common format
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
    /// Samples that must be there, no more and no less [default: from the first to the last that a film was to
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

/// Arguments of `report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Scenes to measure [default: cornell-point cornell bust]
    #[arg(value_name = "SCENES")]
    pub scenes: Vec<String>,
    /// Folder to write index.html, report.md, .csv, .json and pictures to; references are kept there too
    #[arg(long, value_name = "DIR", default_value = "report")]
    pub out: PathBuf,
    /// Under a minute in all: smaller pictures, shorter times
    #[arg(long)]
    pub quick: bool,
    /// Measure this model in place of our owl, as third of the default scenes
    #[arg(long, value_name = "FILE", conflicts_with = "scenes")]
    pub monkey: Option<String>,
    /// Size of the pictures [default: 256x256, 96x96 with --quick]
    #[arg(long, value_name = "WxH", value_parser = resolution)]
    pub resolution: Option<UVec2>,
    /// direct or path, whatever the scenes say
    #[arg(long, value_enum)]
    pub integrator: Option<IntegratorArg>,
    /// Most bounces from eye to light
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// Runs of each method, with different noise
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub seeds: u32,
    /// Converged picture (.exr) to measure errors against, instead of making one; of which scene, if there
    /// are several
    #[arg(long, value_name = "[SCENE=]FILE")]
    pub reference: Vec<String>,
    /// Seconds to take in all [default: 540, 45 with --quick; at most a third of it for a scene]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub time: Option<Duration>,
    /// Threads to trace with; 0 = all
    #[arg(short, long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// No progress on standard error
    #[arg(short, long)]
    pub quiet: bool,
}

/// See [`Integrator`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum IntegratorArg {
    /// Direct light, also in mirrors and through glass.
    Direct,
    /// Global illumination.
    Path,
}

/// See [`Sampling`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum SamplingArg {
    /// Each number by itself.
    Independent,
    /// A jittered grid of 4 x 4 cells, over and over.
    Stratified,
    /// Sobol' points with a random shift.
    Shifted,
    /// Sobol' points with Owen's scrambling: the default.
    Sobol,
}

/// See [`Filter`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum FilterArg {
    /// The texel under the point.
    Nearest,
    /// Linear between four texels.
    Bilinear,
}

/// See [`ToneMap`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum ToneMapArg {
    /// Cut off.
    Clip,
    /// Khronos PBR Neutral.
    Neutral,
    /// As film does: bright colours fade to white.
    Agx,
    /// ACES, by its usual fit.
    Aces,
}

impl IntegratorArg {
    fn integrator(self) -> Integrator {
        match self {
            Self::Direct => Integrator::Direct,
            Self::Path => Integrator::Path,
        }
    }
}

impl From<ToneMapArg> for ToneMap {
    fn from(arg: ToneMapArg) -> Self {
        match arg {
            ToneMapArg::Clip => Self::Clip,
            ToneMapArg::Neutral => Self::Neutral,
            ToneMapArg::Agx => Self::AgX,
            ToneMapArg::Aces => Self::Aces,
        }
    }
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

impl SceneArgs {
    /// Which scene.
    ///
    /// # Errors
    /// If it is neither a file nor built in.
    pub fn source(&self) -> Result<SceneSource, LoadError> {
        if let Some(made) = crate::torture::shown(&self.scene) {
            return Ok(SceneSource::Made(made));
        }
        SceneSource::parse(&self.scene)
    }

    /// How to load it.
    #[must_use]
    pub fn load_options(&self) -> LoadOptions {
        LoadOptions {
            edits: self.edits.clone(),
            sky: self.hdri.clone(),
            ..self.part.load_options(self.scene_settings.clone())
        }
    }

    /// How it should look.
    #[must_use]
    pub fn wishes(&self, output: &OutputArgs) -> Wishes {
        let range = output.sample_range.clone();
        Wishes {
            size: self.resolution,
            samples: range.as_ref().map(|r| r.end - r.start).or(self.spp),
            first_sample: range.map(|r| r.start),
            integrator: self.integrator.map(IntegratorArg::integrator),
            max_depth: self.max_depth,
            seed: self.seed,
            sampling: self.sampling.map(|s| match s {
                SamplingArg::Independent => Sampling::Independent,
                SamplingArg::Stratified => Sampling::Stratified,
                SamplingArg::Shifted => Sampling::Shifted,
                SamplingArg::Sobol => Sampling::Sobol,
            }),
            filter: self.filter.map(|f| match f {
                FilterArg::Nearest => Filter::Nearest,
                FilterArg::Bilinear => Filter::Bilinear,
            }),
            exposure: self.exposure,
            tone_map: self.tone_map.map(ToneMap::from),
            isa: self.isa,
            camera: self.camera.clone(),
            pose: Pose {
                position: self.camera_position,
                focal_point: self.camera_focal_point,
                view_up: self.camera_view_up,
                view_angle: self.camera_view_angle,
                orthographic: self.camera_orthographic,
                lens_radius: self.lens_radius,
                focus_distance: self.focus_distance,
            },
        }
    }
}

impl CheckArgs {
    /// How to load.
    #[must_use]
    pub fn load_options(&self) -> LoadOptions {
        self.part.load_options(self.scene_settings.clone())
    }
}

impl ReportArgs {
    /// What to measure.
    ///
    /// # Errors
    /// If a scene is neither a file nor built in.
    pub fn job(&self, interrupt: Arc<AtomicBool>) -> Result<ReportJob, LoadError> {
        let monkey = self.monkey.as_deref().unwrap_or("bust");
        let names: Vec<&str> = if self.scenes.is_empty() {
            vec!["cornell-point", "cornell", monkey]
        } else {
            self.scenes.iter().map(String::as_str).collect()
        };
        let (size, total) = if self.quick { (96, 45) } else { (256, 540) };
        Ok(ReportJob {
            scenes: names.into_iter().map(SceneSource::parse).collect::<Result<_, _>>()?,
            wishes: Wishes {
                size: Some(self.resolution.unwrap_or(UVec2::splat(size))),
                integrator: self.integrator.map(IntegratorArg::integrator),
                max_depth: self.max_depth,
                ..Wishes::default()
            },
            seeds: self.seeds,
            total: self.time.unwrap_or(Duration::from_secs(total)),
            references: self.reference.iter().map(|text| GivenReference::parse(text)).collect(),
            folder: self.out.clone(),
            interrupt,
        })
    }
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
