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
mod animation;
mod buffer;
mod container;
mod deform;
mod draco;
mod layers;
mod light;
mod material;
mod mesh;
mod meshopt;
mod node;
mod texture;
mod vertices;

use super::budget::Budget;
use super::error::{LoadError, choices};
use super::report::{Phase, Sink};
use super::settings::Materials;
use super::source::{Bytes, Folder, without_bom};
use animation::AnimationJson;
use bevy_ecs::prelude::*;
use gltf::json::mesh::Primitive;
use gltf::json::{Index, Root};
use serde::Deserialize;
use std::collections::HashMap;
use std::sync::Arc;

/// Extensions that are honoured wholly or closely enough to accept a file that requires them.
const SUPPORTED: &[&str] = &[
    "EXT_mesh_features",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_structural_metadata",
    "EXT_texture_webp",
    "FB_ngon_encoding",
    "KHR_draco_mesh_compression",
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
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
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
    sink.begin(Phase::Parsing);
    let container = container::split(file, &bytes)?;
    let json = without_bom(container.json);
    check_head(file, json, sink)?;
    let (tree, more) = parse_tree(file, json)?;
    sink.begin(Phase::Reading);
    let buffers = buffer::read_all(&tree, folder, container.binary, &sink.budget);
    let mut document = Document {
        file,
        folder,
        root: tree,
        placements: more.nodes,
        animations: more.animations,
        variant: None,
        unpacked: Vec::new(),
        decoded: HashMap::new(),
        budget: Arc::clone(&sink.budget),
        buffers,
    };
    document.choose_variant(sink)?;
    document.check_references()?;
    sink.begin(Phase::Decompressing);
    document.unpacked = meshopt::decode_all(&document)?;
    document.decoded = draco::decode_all(&document)?;
    sink.begin(Phase::Images);
    let materials = material::spawn_all(&document, overrides, sink)?;
    sink.begin(Phase::Meshes);
    node::spawn_scene(&document, root, materials, sink)
}

/// A parsed file with its binary data.
struct Document<'a> {
    file: &'a str,
    folder: &'a Folder,
    root: Root,
    placements: Vec<Placement>,
    animations: Vec<AnimationJson>,
    /// Which of `KHR_materials_variants` is worn.
    variant: Option<u32>,
    buffers: Vec<buffer::Buffer<'a>>,
    /// Buffer views that were compressed, by index.
    unpacked: Vec<Option<Vec<u8>>>,
    /// Accessors of primitives that were compressed, by index.
    decoded: HashMap<usize, draco::Decoded>,
    budget: Arc<Budget>,
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

    /// Takes the material variant that the user wants.
    fn choose_variant(&mut self, sink: &mut Sink<'_>) -> Result<(), LoadError> {
        let extension = self.root.extensions.as_ref().and_then(|e| e.khr_materials_variants.as_ref());
        let variants = extension.map_or(&[][..], |extension| &extension.variants).iter().zip(0_u32..);
        let names: Vec<(String, u32)> = variants.map(|(variant, i)| (variant.name.clone(), i)).collect();
        self.variant = match &sink.options.variant {
            Some(wanted) => Some(self.chosen(wanted, "variant", &names)?),
            None => None,
        };
        if !names.is_empty() {
            let all: Vec<&str> = names.iter().map(|(name, _)| name.as_str()).collect();
            let worn = self.variant.map_or("its default materials", |i| all[i as usize]);
            sink.decide(self.file, format!("wears {worn} (--variant: {})", all.join(", ")));
        }
        Ok(())
    }

    /// The material of a primitive in the variant that is worn.
    fn material_of(&self, primitive: &Primitive) -> Option<u32> {
        let mappings = primitive.extensions.as_ref().and_then(|e| e.khr_materials_variants.as_ref());
        let mapped = self.variant.zip(mappings).and_then(|(variant, extension)| {
            extension.mappings.iter().find(|mapping| mapping.variants.contains(&variant))
        });
        mapped
            .map(|mapping| mapping.material)
            .or_else(|| primitive.material.as_ref().map(|index| index.value() as u32))
    }

    /// What the user chose by name or number.
    fn chosen<T: Copy>(
        &self,
        wanted: &str,
        kind: &'static str,
        list: &[(String, T)],
    ) -> Result<T, LoadError> {
        let by_name = list.iter().find(|(name, _)| name == wanted);
        let by_number = || list.get(wanted.parse::<usize>().ok()?);
        by_name.or_else(by_number).map(|&(_, value)| value).ok_or_else(|| {
            let names = choices(list.iter().map(|(name, _)| name.as_str()), "none");
            LoadError::NotThere { file: self.file.to_owned(), kind, wanted: wanted.to_owned(), names }
        })
    }

    /// The object that `index` names, or an error that says who names it.
    fn at<'l, T>(&self, list: &'l [T], index: &Index<T>, kind: &str, user: &str) -> Result<&'l T, LoadError> {
        list.get(index.value()).ok_or_else(|| {
            self.broken(user, format!("index out of range: names {kind} {} of {}", index.value(), list.len()))
        })
    }
}

/// What is read a second time: where nodes stand, in double precision (`gltf::json` keeps only single),
/// and animations.
#[derive(Deserialize)]
struct More {
    #[serde(default)]
    nodes: Vec<Placement>,
    #[serde(default)]
    animations: Vec<AnimationJson>,
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
    /// A string, in files of version 1 also a number.
    version: Option<serde_json::Value>,
    min_version: Option<serde_json::Value>,
}

fn parse<'a, T: Deserialize<'a>>(file: &str, json: &'a [u8]) -> Result<T, LoadError> {
    serde_json::from_slice(json).map_err(|error| {
        let text = error.to_string();
        let reason = text.split(" at line ").next().unwrap_or_default();
        let place = format!("line {} column {}", error.line(), error.column());
        LoadError::broken(file, place, format!("not valid glTF JSON: {reason}"))
    })
}

/// The whole tree, and what is read a second time; once more where that fails without what `gltf::json` knows less of
/// than the format (animations, of which it has only those of nodes; scenes, to which it denies being empty; whole
/// numbers that some write as `4.0`).
fn parse_tree(file: &str, json: &[u8]) -> Result<(Root, More), LoadError> {
    let (tree, more) = match (parse(file, json), parse(file, json)) {
        (Ok(tree), Ok(more)) => return Ok((tree, more)),
        either => either,
    };
    let mut value: serde_json::Value = parse(file, json)?;
    write_without_point(&mut value);
    let more = more.or_else(|why| serde_json::from_value(value.clone()).map_err(|_| why))?;
    if let Some(root) = value.as_object_mut() {
        root.remove("animations");
        let scenes = root.get_mut("scenes").and_then(|scenes| scenes.as_array_mut());
        for scene in scenes.into_iter().flatten().filter_map(|scene| scene.as_object_mut()) {
            scene.entry("nodes").or_insert_with(|| serde_json::Value::Array(Vec::new()));
        }
    }
    let tree = tree.or_else(|why| serde_json::from_value(value).map_err(|_| why))?;
    Ok((tree, more))
}

/// Makes whole numbers of those that are written as `4.0`, to all depths (`serde_json` allows 128).
fn write_without_point(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Number(number) => {
            // Up to here all whole numbers are different numbers in double precision.
            let whole =
                number.as_f64().filter(|v| number.is_f64() && v.fract() == 0.0 && v.abs() < 2_f64.powi(53));
            if let Some(whole) = whole {
                *number = (whole as i64).into();
            }
        }
        serde_json::Value::Array(items) => items.iter_mut().for_each(write_without_point),
        serde_json::Value::Object(members) => members.values_mut().for_each(write_without_point),
        _ => {}
    }
}

/// Refuses other versions and required extensions; warns of extensions that are merely used.
fn check_head(file: &str, json: &[u8], sink: &mut Sink<'_>) -> Result<(), LoadError> {
    if json.iter().all(u8::is_ascii_whitespace) {
        return Err(LoadError::broken(file, "content", "the JSON is empty"));
    }
    let head: Head = parse(file, json)?;
    let version = |value: Option<serde_json::Value>| match value {
        Some(serde_json::Value::String(text)) => text,
        Some(other) => other.to_string(),
        None => "missing".to_owned(),
    };
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
        for name in ignored {
            sink.ignored(file, "", format!("extension {name} is not supported"));
        }
    }
    Ok(())
}

fn way_out(extension: &str) -> &'static str {
    match extension {
        "EXT_texture_avif" | "MSFT_texture_dds" => "export it again with PNG, JPEG or WebP textures",
        _ => "export it again without that extension",
    }
}
