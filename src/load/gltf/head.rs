//! What is asked of a file before anything else: its version, and which extensions it needs.

use super::parse::parse;
use crate::load::error::LoadError;
use crate::load::report::Sink;
use serde::Deserialize;

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
