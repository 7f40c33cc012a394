//! Which scene, which part of it, and how it should look.

use super::choices::{FilterArg, IntegratorArg, LightUnitsArg, SamplingArg, ToneMapArg};
use super::render::OutputArgs;
use super::values::{bytes, crop, exposure, isa, length, radius, resolution, time, vector, view_angle};
use crate::bvh::Isa;
use crate::load::{LoadError, LoadOptions, SceneSource};
use crate::open::{Pose, Wishes};
use clap::Args;
use glam::{DVec3, UVec2};
use std::ffi::OsString;
use std::path::PathBuf;

/// The scene and how it should look.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// A .gltf, .glb, .obj or .toml file, a folder with one, or a built-in scene (see --list-scenes)
    #[arg(default_value = "cornell")]
    pub scene: OsString,
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
    /// Only this part of the picture: W by H pixels, the first of them X from its left and Y from its top
    #[arg(long, value_name = "X,Y,W,H", value_parser = crop)]
    pub crop: Option<[UVec2; 2]>,
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
    #[arg(long, value_name = "NAME|INDEX", allow_hyphen_values = true)]
    pub gltf_scene: Option<String>,
    /// Material variant of a glTF file, by name or by number from 0
    #[arg(long, value_name = "NAME|INDEX", allow_hyphen_values = true)]
    pub variant: Option<String>,
    /// Pose at this time of the animations, instead of the rest pose
    #[arg(long, value_name = "SECONDS", value_parser = time)]
    pub time: Option<f64>,
    /// Animation to play or to take the pose from, by name or by number from 0 [default: the first, and those of other things]
    #[arg(long, value_name = "NAME|INDEX", allow_hyphen_values = true)]
    pub animation: Option<String>,
    /// Units of the lamps in a glTF file [default: what the file lets one see]
    #[arg(long, value_enum)]
    pub light_units: Option<LightUnitsArg>,
    /// Memory that loading may take, such as 2G or 500M [default: three quarters of what is free]
    #[arg(long, value_name = "SIZE", value_parser = bytes)]
    pub max_memory: Option<u64>,
}

impl PartArgs {
    /// What to load, with settings of this file.
    pub(super) fn load_options(&self, scene_settings: Option<PathBuf>) -> LoadOptions {
        LoadOptions {
            scene_settings,
            scene: self.gltf_scene.clone(),
            variant: self.variant.clone(),
            time: self.time,
            animation: self.animation.clone(),
            light_units: self.light_units.map(Into::into),
            max_memory: self.max_memory,
            ..LoadOptions::default()
        }
    }
}

impl SceneArgs {
    /// Which scene.
    ///
    /// # Errors
    /// If it is neither a file nor built in.
    pub fn source(&self) -> Result<SceneSource, LoadError> {
        if let Some(made) = self.scene.to_str().and_then(crate::torture::shown) {
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
            crop: self.crop,
            samples: range.as_ref().map(|r| r.end - r.start).or(self.spp),
            first_sample: range.map(|r| r.start),
            integrator: self.integrator.map(Into::into),
            max_depth: self.max_depth,
            seed: self.seed,
            sampling: self.sampling.map(Into::into),
            filter: self.filter.map(Into::into),
            exposure: self.exposure,
            tone_map: self.tone_map.map(Into::into),
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
