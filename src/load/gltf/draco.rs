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

/// For each accessor of a compressed primitive what it holds. Many primitives may name one view: it is decoded once.
pub(super) fn decode_all(document: &Document<'_>) -> Result<HashMap<usize, Decoded>, LoadError> {
    let mut views: BTreeMap<u32, Vec<Compressed<'_>>> = BTreeMap::new();
    for (i, mesh) in document.root.meshes.iter().enumerate() {
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            let others = primitive.extensions.as_ref().map(|extensions| &extensions.others);
            let Some(json) = others.and_then(|others| others.get("KHR_draco_mesh_compression")) else {
                continue;
            };
            let place = format!("mesh {i}, primitive {k}, Draco");
            let compression = Compression::deserialize(json).map_err(|why| document.broken(&place, why))?;
            let Compression { buffer_view, attributes } = compression;
            views.entry(buffer_view).or_default().push(Compressed { place, primitive, attributes });
        }
    }
    let views: Vec<_> = views.into_iter().collect();
    let decoded: Vec<_> = views
        .par_iter()
        .map(|(view, users)| decode(document, *view, users))
        .collect::<Result<_, LoadError>>()?;
    Ok(decoded.into_iter().flatten().collect())
}

/// A primitive that is compressed.
struct Compressed<'a> {
    place: String,
    primitive: &'a Primitive,
    attributes: BTreeMap<String, u32>,
}

/// What all users of a view want to know of it.
fn decode(
    document: &Document<'_>,
    view: u32,
    users: &[Compressed<'_>],
) -> Result<HashMap<usize, Decoded>, LoadError> {
    let mut found = HashMap::new();
    let Some(Compressed { place, .. }) = users.first() else { return Ok(found) };
    let (bytes, _) = document.view(&Index::new(view), place)?;
    let mut limits = DecodeLimits::default();
    limits.max_decoded_bytes = document.budget.left() / 4;
    limits.max_points = limits.max_decoded_bytes / 12;
    limits.max_faces = limits.max_points;
    let mut mesh = Mesh::new();
    MeshDecoder::new()
        .decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh)
        .map_err(|error| document.broken(place, format!("damaged data: {error}")))?;
    for user in users {
        unpack(document, user, &mesh, &mut found)?;
    }
    Ok(found)
}

/// Adds the accessors of a primitive that are not yet there.
fn unpack(
    document: &Document<'_>,
    Compressed { place, primitive, attributes }: &Compressed<'_>,
    mesh: &Mesh,
    found: &mut HashMap<usize, Decoded>,
) -> Result<(), LoadError> {
    let count = mesh.num_points();
    if let Some(index) = primitive.indices.as_ref().filter(|index| !found.contains_key(&index.value())) {
        let count = 3 * mesh.num_faces();
        document.budget.take(count as u64 * 8, document.file, place)?;
        let indices = mesh.faces().iter().flatten();
        let bytes = indices.flat_map(|point| point.0.to_le_bytes()).collect();
        found.insert(index.value(), Decoded { bytes, count, kind: ComponentType::U32, width: 1 });
    }
    for (name, &id) in attributes {
        let semantic: Checked<Semantic> =
            serde_json::from_value(name.as_str().into()).unwrap_or(Checked::Invalid);
        let (Some(accessor), Some(attribute)) =
            (primitive.attributes.get(&semantic), mesh.attribute_by_unique_id(id))
        else {
            continue;
        };
        if found.contains_key(&accessor.value()) {
            continue;
        }
        let described = document.at(&document.root.accessors, accessor, "accessor", place)?;
        let width = usize::from(attribute.num_components());
        document.budget.take(8 * (count * width) as u64, document.file, place)?;
        let mut values = attribute.read_f32s(count, width);
        if described.normalized {
            let most = largest(described);
            values.iter_mut().for_each(|value| *value = (*value / most).max(-1.0));
        }
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        found.insert(accessor.value(), Decoded { bytes, kind: ComponentType::F32, width, count });
    }
    Ok(())
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
