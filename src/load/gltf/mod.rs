//! glTF 2.0 → entities.
//!
//! The crate `gltf` gives the JSON schema (`gltf::json::Root`); everything that touches sizes and
//! indices is checked here, because its own import trusts them and its validation refuses files
//! before we could say why. The steps: container ([`container`]), JSON, buffers ([`buffer`]),
//! materials and images ([`material`], [`texture`]), hierarchy ([`node`]), meshes ([`mesh`]).
//!
//! Rules where the format leaves a choice: one [`crate::scene::Mesh`] per glTF mesh with all its
//! primitives; missing normals mean flat shading; skinned meshes stand in their rest pose, morph
//! targets at the default weights; 1 candela is 1/683 W/sr and 1 lux 1/683 W/m².

mod accessor;
mod buffer;
mod container;
mod layers;
mod light;
mod material;
mod mesh;
mod node;
mod skin;
mod texture;
mod vertices;

use super::error::LoadError;
use super::report::Sink;
use super::settings::Materials;
use super::source::{Bytes, Folder, without_bom};
use bevy_ecs::prelude::*;
use gltf::json::{Index, Root};
use serde::Deserialize;

/// Extensions that are honoured wholly or closely enough to accept a file that requires them.
const SUPPORTED: [&str; 18] = [
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "MSFT_lod",
];

/// Reads `bytes` and spawns the default scene below `root`.
pub(super) fn load(
    file: &str,
    folder: &Folder,
    bytes: Bytes,
    root: Entity,
    overrides: &mut Materials,
    sink: &mut Sink<'_>,
) -> Result<(), LoadError> {
    let container = container::split(file, &bytes)?;
    let json = without_bom(container.json);
    check_head(file, json, sink)?;
    let tree: Root = parse(file, json)?;
    let placements: Placements = parse(file, json)?;
    let buffers = buffer::read_all(&tree, folder, container.binary);
    let document = Document { file, folder, root: tree, placements: placements.nodes, buffers };
    document.check_references()?;
    let materials = material::spawn_all(&document, overrides, sink)?;
    node::spawn_scene(&document, root, materials, sink)
}

/// A parsed file with its binary data.
struct Document<'a> {
    file: &'a str,
    folder: &'a Folder,
    root: Root,
    placements: Vec<Placement>,
    buffers: Vec<buffer::Buffer<'a>>,
}

impl Document<'_> {
    fn broken(&self, place: impl std::fmt::Display, problem: impl std::fmt::Display) -> LoadError {
        LoadError::broken(self.file, place, problem)
    }

    /// Whether accessors and buffer views name what exists, used or not: a file where they do not is
    /// damaged.
    fn check_references(&self) -> Result<(), LoadError> {
        let root = &self.root;
        for (i, accessor) in root.accessors.iter().enumerate() {
            if let Some(view) = &accessor.buffer_view {
                self.at(&root.buffer_views, view, "buffer view", &format!("accessor {i}"))?;
            }
        }
        for (i, view) in root.buffer_views.iter().enumerate() {
            self.at(&root.buffers, &view.buffer, "buffer", &format!("buffer view {i}"))?;
        }
        Ok(())
    }

    /// The object that `index` names, or an error that says who names it.
    fn at<'l, T>(&self, list: &'l [T], index: &Index<T>, kind: &str, user: &str) -> Result<&'l T, LoadError> {
        list.get(index.value()).ok_or_else(|| {
            self.broken(user, format!("index out of range: names {kind} {} of {}", index.value(), list.len()))
        })
    }
}

/// Where nodes stand, in double precision: `gltf::json` keeps only single.
#[derive(Deserialize)]
struct Placements {
    #[serde(default)]
    nodes: Vec<Placement>,
}

/// Placement of one node; see the glTF specification, section 3.5.3.
#[derive(Default, Deserialize)]
struct Placement {
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

/// What must be known before the rest can be parsed.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Head {
    asset: Option<HeadAsset>,
    #[serde(default)]
    extensions_required: Vec<String>,
    #[serde(default)]
    extensions_used: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct HeadAsset {
    version: Option<String>,
    min_version: Option<String>,
}

fn parse<'a, T: Deserialize<'a>>(file: &str, json: &'a [u8]) -> Result<T, LoadError> {
    serde_json::from_slice(json).map_err(|error| {
        let text = error.to_string();
        let reason = text.split(" at line ").next().unwrap_or_default();
        let place = format!("line {} column {}", error.line(), error.column());
        LoadError::broken(file, place, format!("not valid glTF JSON: {reason}"))
    })
}

/// Refuses other versions and required extensions; warns of extensions that are merely used.
fn check_head(file: &str, json: &[u8], sink: &mut Sink<'_>) -> Result<(), LoadError> {
    if json.iter().all(u8::is_ascii_whitespace) {
        return Err(LoadError::broken(file, "content", "the JSON is empty"));
    }
    let head: Head = parse(file, json)?;
    let version = |text: Option<String>| text.unwrap_or_else(|| "missing".to_owned());
    let Some(asset) = head.asset else {
        return Err(LoadError::broken(file, "asset", "not a glTF file: no `asset` with a version"));
    };
    let asked = version(asset.min_version.clone().or(asset.version));
    if asked.is_empty() {
        return Err(LoadError::broken(file, "asset", "the version is empty; Penumbra reads glTF 2.0"));
    }
    if !asked.starts_with("2.") || (asset.min_version.is_some() && asked != "2.0") {
        let problem = format!("glTF version {asked}; Penumbra reads 2.0: export it again as glTF 2.0");
        return Err(LoadError::broken(file, "asset", problem));
    }
    for extension in &head.extensions_required {
        if !SUPPORTED.contains(&extension.as_str()) {
            return Err(LoadError::Extension {
                file: file.to_owned(),
                extension: extension.clone(),
                way_out: way_out(extension),
            });
        }
    }
    let ignored: Vec<&str> =
        head.extensions_used.iter().map(String::as_str).filter(|name| !SUPPORTED.contains(name)).collect();
    if !ignored.is_empty() {
        sink.warn(format!("{file}: extensions not supported and ignored: {}", ignored.join(", ")));
    }
    Ok(())
}

fn way_out(extension: &str) -> &'static str {
    match extension {
        "KHR_draco_mesh_compression" => "export it again without Draco compression",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "export it again without meshopt compression (gltfpack without -c)"
        }
        "KHR_texture_basisu" => "export it again with PNG or JPEG textures",
        _ => "export it again without that extension",
    }
}
