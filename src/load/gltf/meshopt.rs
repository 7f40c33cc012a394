//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: buffer views that are decoded when the file is opened.

use super::Document;
use crate::load::error::LoadError;
use gltf::json::{Index, buffer};
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{self, Filter, Mode};
use rayon::prelude::*;
use serde::Deserialize;

/// A codec never makes more than this many bytes of one.
const MOST_RATIO: u64 = 1024;

/// The extension as it stands in the file.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compression {
    buffer: u32,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: usize,
    mode: String,
    count: usize,
    filter: Option<String>,
}

/// For each buffer view its decoded bytes, if it is compressed.
pub(super) fn decode_all(document: &Document<'_>) -> Result<Vec<Option<Vec<u8>>>, LoadError> {
    document.root.buffer_views.par_iter().enumerate().map(|(i, view)| decode(document, i, view)).collect()
}

fn decode(document: &Document<'_>, i: usize, view: &buffer::View) -> Result<Option<Vec<u8>>, LoadError> {
    let others = view.extensions.as_ref().map(|extensions| &extensions.others);
    let names = ["KHR_meshopt_compression", "EXT_meshopt_compression"];
    let Some(json) = others.and_then(|others| names.iter().find_map(|name| others.get(*name))) else {
        return Ok(None);
    };
    let place = format!("buffer view {i}, meshopt compression");
    let broken = |problem: String| document.broken(&place, problem);
    let compression = Compression::deserialize(json).map_err(|error| broken(error.to_string()))?;
    let Compression { byte_offset, byte_length, byte_stride: stride, count, .. } = compression;
    let source = document.bytes(&Index::new(compression.buffer), byte_offset, byte_length, &place)?;
    let size = (count as u64).saturating_mul(stride as u64);
    if size > (source.len() as u64 + 64) * MOST_RATIO {
        return Err(broken(format!("count of {count} is out of range for {} bytes", source.len())));
    }
    document.budget.take(size, document.file, &place)?;
    let mode = match compression.mode.as_str() {
        "ATTRIBUTES" => Mode::Attributes,
        "TRIANGLES" => Mode::Triangles,
        "INDICES" => Mode::Indices,
        other => return Err(broken(format!("unknown mode `{other}`"))),
    };
    let mut work = Workspace::default();
    let decoded = match mode {
        Mode::Attributes => codec::decode_vertex_buffer(count, stride, source, &mut work),
        Mode::Triangles => codec::decode_index_buffer(count, stride, source, &mut work),
        Mode::Indices => codec::decode_index_sequence(count, stride, source, &mut work),
    };
    let mut bytes = decoded.map_err(|error| broken(format!("damaged data: {error}")))?;
    let filtered = match compression.filter.as_deref() {
        None | Some("NONE") => Ok(()),
        Some("COLOR") => codec::decode_filter_color(&mut bytes, count, stride, &mut work),
        Some(name) => Filter::parse(name).and_then(|filter| match filter {
            Filter::Octahedral => codec::decode_filter_oct(&mut bytes, count, stride, &mut work),
            Filter::Quaternion => codec::decode_filter_quat(&mut bytes, count, stride, &mut work),
            Filter::Exponential => codec::decode_filter_exp(&mut bytes, count, stride, &mut work),
            _ => Ok(()),
        }),
    };
    filtered.map_err(|error| broken(format!("filter failed: {error}")))?;
    Ok(Some(bytes))
}
