//! TOML settings: a sidecar beside a scene, or a scene of its own.
//!
//! A file `scene.toml` beside `scene.glb`, `scene.gltf` or `scene.obj` is read with it (or the one
//! the caller names). Opened itself, it lists its models under `[[model]]`; a file with `[[model]]`
//! is no sidecar. Lengths are scene units, angles degrees, colours linear RGB. All keys but those
//! marked * may be missing; a wrong key or value is an error with its line.
//!
//! ```toml
//! [[model]]
//! file = "room.glb"            # * relative to this file: .gltf, .glb or .obj
//! material = "white"           # use [material.white] for all its surfaces
//! translation = [0, 0, 0]
//! rotation = [0, 90, 0]        # degrees about x, then y, then z
//! scale = 2.0                  # or [1, 2, 1]; applied first
//! # or matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], rows first
//!
//! [material.white]             # replaces the model's material of that name
//! base_color = [0.7, 0.7, 0.7] # albedo, 0 to 1; 0.8 if missing, 0 beside mirror, glass or emission
//! base_color_texture = "a.png" # relative to this file, multiplied by base_color
//! filter = "nearest"           # or "bilinear"
//! uv_scale = [4, 4]            # repeats of the texture
//! metallic = 0.0               # with roughness: GGX, 0 to 1
//! roughness = 0.5
//! specular = [0.2, 0.2, 0.2]   # with exponent: Blinn-Phong, albedo 0 to 1
//! exponent = 100               # 0 or more
//! mirror = [0.9, 0.9, 0.9]     # reflectance of a perfect mirror, 0 to 1
//! glass = { ior = 1.5, tint = [1, 1, 1] }
//! emission = [1, 1, 1]         # radiance, W/(m² sr)
//! opacity = 1.0
//! double_sided = false         # whether the back emits too
//!
//! [[light]]
//! kind = "parallelogram"       # radiance in W/(m² sr), towards edge_u × edge_v
//! corner = [0, 2, 0]           # *
//! edge_u = [1, 0, 0]           # *
//! edge_v = [0, 0, 1]           # *
//! radiance = [5, 5, 5]         # * or four: at corner, + edge_u, + edge_v, + both
//! two_sided = false
//! visible = true               # for parallelogram, disk and sphere: seen, and blocking light
//! # kind = "disk": center*, normal* (towards which it shines), radius*, radiance*, two_sided, visible
//! # kind = "sphere": center*, radius*, radiance*, visible
//! # kind = "segment": from*, to*, strength* in W/(sr m) (or two: at each end), emission = "sine" | "isotropic"
//! # kind = "point": position*, intensity* in W/sr
//! # kind = "spot": position*, target*, intensity*, outer_angle* and inner_angle (half angles)
//! # kind = "directional": direction* of travel, irradiance* in W/m², angle (diameter of its disc)
//! # kind = "environment": radiance*
//!
//! [camera]                     # becomes the first camera and the active one
//! position = [0, 1, 5]         # *
//! target = [0, 1, 0]           # *
//! up = [0, 1, 0]
//! vertical_fov = 40.0          # degrees, 45 if missing; or orthographic_height in scene units
//! lens_radius = 0.05           # scene units; missing: all is sharp
//! focus_distance = 4.0         # of what is sharp, scene units; that of the target if missing
//!
//! [render]
//! integrator = "path"          # or "direct"
//! max_depth = 8                # bounces; 1 = direct light
//! spp = 64                     # samples per pixel
//! exposure = 0.0               # EV
//! resolution = [640, 480]
//! seed = 0
//! filter = "file"              # textures: "nearest", "bilinear", or as the file says
//!
//! # [[edit]] origin = [0, 0, 0]: where coordinates are counted from, so that rounding stays the same
//! [[edit]]                     # as the window writes it: what was changed, by the names on the way to it
//! entity = ["room", "chair#2"] # * the second chair of the room
//! copy_of = ["room", "chair"]  # it is made first, as a copy of this one
//! matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] # in its parent, rows first
//! hidden = false
//! light = { spectra = [[1, 1, 1]], sizes = [0.5] } # of the light that it is
//! slot = 0                     # which of its materials is meant below
//! material = { base_color = [0.7, 0.7, 0.7], roughness = 0.5 } # also metallic, specular, exponent, mirror, emission
//! ```

mod camera;
pub mod edit;
mod light;
mod material;
mod model;

pub(crate) use edit::Edits;
pub(super) use material::Materials;
pub(super) use model::Model;

use super::error::LoadError;
use super::report::Sink;
use super::source::{Folder, without_bom};
use bevy_ecs::prelude::*;
use glam::{DVec3, Vec3};
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

/// The `[render]` table: what is missing is for the caller to choose.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SidecarRender {
    /// How light is followed.
    pub integrator: Option<SidecarIntegrator>,
    /// Most bounces; 0 shows only what shines.
    pub max_depth: Option<u32>,
    /// Samples per pixel, at least 1.
    pub spp: Option<u32>,
    /// Exposure in EV (powers of two).
    pub exposure: Option<f32>,
    /// Width and height in pixels, 1 to 65536 each.
    pub resolution: Option<[u32; 2]>,
    /// Seed of the sampler.
    pub seed: Option<u64>,
    /// Texture filter.
    pub filter: Option<SidecarFilter>,
    /// See [`edit::EditTable::origin`].
    #[serde(skip)]
    pub origin: Option<[f64; 3]>,
}

/// `integrator` of the `[render]` table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SidecarIntegrator {
    /// Light that comes straight from lights.
    Direct,
    /// Light over any number of bounces.
    Path,
}

/// `filter` of the `[render]` table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SidecarFilter {
    /// Nearest for all textures.
    Nearest,
    /// Bilinear for all textures.
    Bilinear,
    /// As each texture's file says.
    File,
}

/// A parsed settings file; nothing is checked beyond its types.
pub(super) struct Settings {
    file: String,
    folder: Folder,
    text: String,
    tables: Tables,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Tables {
    #[serde(default)]
    model: Vec<Spanned<model::ModelTable>>,
    #[serde(default)]
    material: BTreeMap<String, Spanned<material::MaterialTable>>,
    #[serde(default)]
    light: Vec<Spanned<light::LightTable>>,
    camera: Option<Spanned<camera::CameraTable>>,
    render: Option<Spanned<SidecarRender>>,
    #[serde(default)]
    edit: Vec<Spanned<edit::EditTable>>,
}

impl Settings {
    /// Parses the text of a settings file.
    pub(super) fn parse(file: &str, folder: Folder, bytes: &[u8]) -> Result<Self, LoadError> {
        let text = std::str::from_utf8(without_bom(bytes))
            .map_err(|_| LoadError::broken(file, "encoding", "not UTF-8 text"))?
            .to_owned();
        let tables = toml::from_str(&text).map_err(|error: toml::de::Error| {
            let line = error.span().map_or(1, |span| line_of(&text, span.start));
            LoadError::broken(file, format!("line {line}"), error.message().replace('\n', ", "))
        })?;
        Ok(Self { file: file.to_owned(), folder, text, tables })
    }

    /// Whether it has edits, and nothing that they could be of.
    pub(super) fn is_of_a_scene(&self) -> bool {
        !(self.has_models() || self.tables.edit.is_empty())
    }

    /// Whether it is a scene of its own.
    pub(super) fn has_models(&self) -> bool {
        !self.tables.model.is_empty()
    }

    fn broken<T>(&self, table: &Spanned<T>, what: &str, problem: impl std::fmt::Display) -> LoadError {
        let line = line_of(&self.text, table.span().start);
        LoadError::broken(&self.file, format!("line {line}, {what}"), problem)
    }

    /// Spawns the materials, for models to find by name.
    pub(super) fn spawn_materials(&self, sink: &mut Sink<'_>) -> Result<Materials, LoadError> {
        material::spawn_all(self, sink)
    }

    /// The models to load, checked, with their materials found among `materials`.
    pub(super) fn models(&self, materials: &mut Materials) -> Result<Vec<Model>, LoadError> {
        self.tables.model.iter().map(|table| model::resolve(self, table, materials)).collect()
    }

    /// Spawns the camera and hands over the render options.
    pub(super) fn spawn_camera(&self, sink: &mut Sink<'_>) -> Result<Option<Entity>, LoadError> {
        if let Some(render) = &self.tables.render {
            self.check_render(render)?;
            sink.report.render = render.get_ref().clone();
        }
        match &self.tables.camera {
            Some(table) => camera::spawn(self, table, sink).map(Some),
            None => Ok(None),
        }
    }

    /// Spawns the lights.
    pub(super) fn spawn_lights(&self, sink: &mut Sink<'_>) -> Result<(), LoadError> {
        self.tables.light.iter().enumerate().try_for_each(|(i, table)| light::spawn(self, i, table, sink))
    }

    fn check_render(&self, table: &Spanned<SidecarRender>) -> Result<(), LoadError> {
        let render = table.get_ref();
        let wrong = |problem: &str| Err(self.broken(table, "[render]", problem));
        match render {
            _ if render.spp == Some(0) => wrong("spp must be at least 1"),
            _ if render.exposure.is_some_and(|ev| !ev.is_finite() || ev.abs() > 100.0) => {
                wrong("exposure must be within -100 to 100 EV")
            }
            _ if render.resolution.is_some_and(|[w, h]| w.min(h) < 1 || w.max(h) > 65536) => {
                wrong("resolution must be within 1 to 65536 pixels each way")
            }
            _ => Ok(()),
        }
    }
}

/// Line of a byte offset, from 1.
fn line_of(text: &str, offset: usize) -> usize {
    text.bytes().take(offset).filter(|&byte| byte == b'\n').count() + 1
}

/// Checks one value of a table after the other; the first problem wins.
#[derive(Default)]
struct Check {
    problem: Option<String>,
}

impl Check {
    fn that(&mut self, good: bool, problem: impl FnOnce() -> String) {
        if !good && self.problem.is_none() {
            self.problem = Some(problem());
        }
    }

    /// A point or vector, finite.
    fn point(&mut self, key: &str, value: [f64; 3]) -> DVec3 {
        let value = DVec3::from(value);
        self.that(value.is_finite() && value.abs().max_element() <= 1e15, || {
            format!("{key} must be finite and within 1e15")
        });
        value
    }

    /// A spectrum of 0 or more.
    fn spectrum(&mut self, key: &str, value: [f32; 3]) -> Vec3 {
        let value = Vec3::from(value);
        self.that(value.is_finite() && value.min_element() >= 0.0, || {
            format!("{key} must be finite and not negative")
        });
        value
    }

    /// A colour in 0..=1.
    fn color(&mut self, key: &str, value: [f32; 3]) -> Vec3 {
        let value = Vec3::from(value);
        self.that(value.min_element() >= 0.0 && value.max_element() <= 1.0, || {
            format!("{key} must be within 0 to 1")
        });
        value
    }

    fn unit(&mut self, key: &str, value: f32) -> f32 {
        self.that((0.0..=1.0).contains(&value), || format!("{key} must be within 0 to 1, not {value}"));
        value
    }

    /// A length above 0.
    fn length(&mut self, key: &str, value: f32) -> f32 {
        self.that(value.is_finite() && value > 0.0, || format!("{key} must be above 0, not {value}"));
        value
    }
}
