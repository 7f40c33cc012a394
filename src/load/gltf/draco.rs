//! `KHR_draco_mesh_compression`: primitives that are decoded when the file is opened.

use super::Document;
use crate::load::error::LoadError;
use draco_core::decode_limits::DecodeLimits;
use draco_core::decoder_buffer::DecoderBuffer;
use draco_core::mesh::Mesh;
use draco_core::mesh_decoder::MeshDecoder;
use gltf::json::accessor::ComponentType;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};
use rayon::prelude::*;
use serde::Deserialize;
use std::collections::{BTreeMap, HashMap};

/// Elements of an accessor whose data is in a compressed primitive.
pub(super) struct Decoded {
    /// Tightly packed: `u32` for indices, else `f32`, normalised already.
    pub(super) bytes: Vec<u8>,
    pub(super) kind: ComponentType,
    pub(super) width: usize,
    pub(super) count: usize,
}

/// The extension as it stands in the file.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compression {
    buffer_view: u32,
    attributes: BTreeMap<String, u32>,
}

/// For each accessor of a compressed primitive what it holds.
pub(super) fn decode_all(document: &Document<'_>) -> Result<HashMap<usize, Decoded>, LoadError> {
    let primitives: Vec<(String, &Primitive)> = document
        .root
        .meshes
        .iter()
        .enumerate()
        .flat_map(|(i, mesh)| {
            let numbered = mesh.primitives.iter().enumerate();
            numbered.map(move |(k, primitive)| (format!("mesh {i}, primitive {k}, Draco"), primitive))
        })
        .collect();
    let decoded: Vec<_> = primitives
        .par_iter()
        .map(|(place, primitive)| decode(document, primitive, place))
        .collect::<Result<_, LoadError>>()?;
    Ok(decoded.into_iter().flatten().collect())
}

fn decode(
    document: &Document<'_>,
    primitive: &Primitive,
    place: &str,
) -> Result<Vec<(usize, Decoded)>, LoadError> {
    let others = primitive.extensions.as_ref().map(|extensions| &extensions.others);
    let Some(json) = others.and_then(|others| others.get("KHR_draco_mesh_compression")) else {
        return Ok(Vec::new());
    };
    let broken = |problem: String| document.broken(place, problem);
    let compression = Compression::deserialize(json).map_err(|error| broken(error.to_string()))?;
    let (bytes, _) = document.view(&Index::new(compression.buffer_view), place)?;
    let mut limits = DecodeLimits::default();
    limits.max_decoded_bytes = document.budget.left() / 4;
    limits.max_points = limits.max_decoded_bytes / 12;
    limits.max_faces = limits.max_points;
    let mut mesh = Mesh::new();
    MeshDecoder::new()
        .decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh)
        .map_err(|error| broken(format!("damaged data: {error}")))?;
    let count = mesh.num_points();
    let mut found = Vec::new();
    if let Some(index) = &primitive.indices {
        let indices: Vec<u32> = mesh.faces().iter().flatten().map(|point| point.0).collect();
        document.budget.take(indices.len() as u64 * 8, document.file, place)?;
        let decoded = Decoded {
            count: indices.len(),
            bytes: indices.iter().flat_map(|index| index.to_le_bytes()).collect(),
            kind: ComponentType::U32,
            width: 1,
        };
        found.push((index.value(), decoded));
    }
    for (name, &id) in &compression.attributes {
        let semantic: Checked<Semantic> =
            serde_json::from_value(name.as_str().into()).unwrap_or(Checked::Invalid);
        let (Some(accessor), Some(attribute)) =
            (primitive.attributes.get(&semantic), mesh.attribute_by_unique_id(id))
        else {
            continue;
        };
        let described = document.at(&document.root.accessors, accessor, "accessor", place)?;
        let width = usize::from(attribute.num_components());
        document.budget.take(8 * (count * width) as u64, document.file, place)?;
        let mut values = attribute.read_f32s(count, width);
        if described.normalized {
            let most = largest(described);
            values.iter_mut().for_each(|value| *value = (*value / most).max(-1.0));
        }
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        found.push((accessor.value(), Decoded { bytes, kind: ComponentType::F32, width, count }));
    }
    Ok(found)
}

/// What a normalised integer is divided by.
fn largest(accessor: &json::Accessor) -> f32 {
    match accessor.component_type {
        Checked::Valid(kind) => match kind.0 {
            ComponentType::I8 => 127.0,
            ComponentType::U8 => 255.0,
            ComponentType::I16 => 32767.0,
            ComponentType::U16 => 65535.0,
            ComponentType::U32 | ComponentType::F32 => 1.0,
        },
        Checked::Invalid => 1.0,
    }
}
