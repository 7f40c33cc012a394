//! What is asked of a file before anything else: its version, and which extensions it needs.

use super::parse::{self, OBJECT_MEMORY, Placement, VALUE_MEMORY, parse};
use super::place::NODE_MEMORY;
use crate::load::error::LoadError;
use crate::load::report::Sink;
use crate::scene::Material;
use gltf::json;
use serde::de::{IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;

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

/// What must be known before the rest can be parsed.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Head {
    asset: Option<HeadAsset>,
    #[serde(default)]
    extensions_required: Vec<String>,
    #[serde(default)]
    extensions_used: Vec<String>,
    #[serde(default)]
    nodes: Count,
    #[serde(default)]
    materials: Count,
    #[serde(default)]
    meshes: Count,
    #[serde(default)]
    accessors: Count,
    #[serde(default)]
    buffer_views: Count,
    #[serde(default)]
    images: Count,
    #[serde(default)]
    textures: Count,
}

/// How many things are in a list, without keeping any; what is no list, as in files of version 1, has none.
#[derive(Default)]
struct Count(u64);

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Counter;
        impl<'de> Visitor<'de> for Counter {
            type Value = Count;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Count, A::Error> {
                let mut count = 0;
                while list.next_element::<IgnoredAny>()?.is_some() {
                    count += 1;
                }
                Ok(Count(count))
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Count, A::Error> {
                while map.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
                Ok(Count(0))
            }
        }
        deserializer.deserialize_any(Counter)
    }
}

impl Head {
    /// Bytes that reading the whole tree takes, and what becomes of its nodes and materials: `{}` is three bytes in a file
    /// and hundreds in memory.
    fn memory(&self, json: &[u8]) -> u64 {
        // Lists grow by doubling.
        let kinds = [
            (&self.nodes, 2 * (size_of::<json::Node>() + size_of::<Placement>()) + NODE_MEMORY),
            (&self.materials, 2 * size_of::<json::Material>() + size_of::<Material>()),
            (&self.meshes, 2 * size_of::<json::Mesh>()),
            (&self.accessors, 2 * size_of::<json::Accessor>()),
            (&self.buffer_views, 2 * size_of::<json::buffer::View>()),
            (&self.images, 2 * size_of::<json::Image>()),
            (&self.textures, 2 * size_of::<json::Texture>()),
        ];
        let listed: u64 = kinds.iter().map(|(list, _)| list.0).sum();
        let all: u64 = kinds.iter().map(|(list, size)| list.0 * *size as u64).sum();
        let [objects, values] = parse::objects_and_values(json);
        all + objects.saturating_sub(listed) * OBJECT_MEMORY + values * VALUE_MEMORY + json.len() as u64
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct HeadAsset {
    /// A string, in files of version 1 also a number.
    version: Option<serde_json::Value>,
    min_version: Option<serde_json::Value>,
}

/// Refuses other versions and required extensions; warns of extensions that are merely used.
pub(super) fn check(file: &str, json: &[u8], sink: &mut Sink<'_>) -> Result<(), LoadError> {
    if json.iter().all(u8::is_ascii_whitespace) {
        return Err(LoadError::broken(file, "content", "the JSON is empty"));
    }
    let head: Head = parse(file, json)?;
    sink.budget.take(head.memory(json), file, "JSON")?;
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
    head.extensions_used.iter().for_each(|name| tell_if_unsupported(file, name, sink));
    Ok(())
}

fn tell_if_unsupported(file: &str, name: &str, sink: &mut Sink<'_>) {
    if !SUPPORTED.contains(&name) {
        sink.ignored(file, "", format!("extension {name} is not supported"));
    }
}

/// Tells what a material uses and we do not know, whether the file lists it or not.
pub(super) fn tell_unsupported(file: &str, material: &json::Material, sink: &mut Sink<'_>) {
    let extensions = material.extensions.iter().flat_map(|extensions| extensions.others.keys());
    extensions.for_each(|name| tell_if_unsupported(file, name, sink));
}

fn way_out(extension: &str) -> &'static str {
    match extension {
        "EXT_texture_avif" | "MSFT_texture_dds" => "export it again with PNG, JPEG or WebP textures",
        _ => "export it again without that extension",
    }
}
