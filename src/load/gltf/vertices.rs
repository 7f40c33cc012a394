//! Which vertices the triangles of a primitive use.

use super::Document;
use super::mesh::MOST_TRIANGLES;
use crate::load::error::LoadError;
use crate::load::report::Sink;
use gltf::json::mesh::{Mode, Primitive};
use std::collections::HashMap;

/// The vertices that triangles use, renumbered: several primitives often share one large array.
pub(super) struct Used {
    pub(super) vertices: Vec<u32>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl Used {
    pub(super) fn read(
        document: &Document<'_>,
        primitive: &Primitive,
        count: usize,
        mode: Mode,
        place: &str,
        sink: &mut Sink<'_>,
    ) -> Result<Self, LoadError> {
        let Some(index) = &primitive.indices else {
            let triangles = triangles_of(mode, count, |i| i as u32);
            if triangles.len() > MOST_TRIANGLES {
                return Err(document.broken(place, "vertex count too large"));
            }
            leftover(document, mode, count, place, sink);
            return Ok(Self { vertices: (0..count as u32).collect(), triangles });
        };
        let indices = document.elements(index, &format!("{place}, indices"))?;
        if !indices.is_index_type() {
            return Err(document.broken(&indices.place, "indices must be unsigned integers"));
        }
        leftover(document, mode, indices.count, place, sink);
        let mut numbers = Numbers::new(count, indices.count);
        let mut vertices = Vec::new();
        let mut renumbered = Vec::with_capacity(indices.count);
        for i in 0..indices.count {
            let vertex = indices.get_index(i);
            if vertex as usize >= count {
                return Err(document
                    .broken(&indices.place, format!("index out of range: vertex {vertex} of {count}")));
            }
            renumbered.push(numbers.number(vertex, &mut vertices));
        }
        Ok(Self { vertices, triangles: triangles_of(mode, renumbered.len(), |i| renumbered[i]) })
    }
}

/// Old vertex number → new: a table, or a map where the table would be mostly empty.
enum Numbers {
    Table(Vec<u32>),
    Map(HashMap<u32, u32>),
}

impl Numbers {
    fn new(vertices: usize, indices: usize) -> Self {
        if vertices <= 4 * indices + 1024 {
            Self::Table(vec![u32::MAX; vertices])
        } else {
            Self::Map(HashMap::new())
        }
    }

    fn number(&mut self, vertex: u32, vertices: &mut Vec<u32>) -> u32 {
        let known = match self {
            Self::Table(table) => &mut table[vertex as usize],
            Self::Map(map) => map.entry(vertex).or_insert(u32::MAX),
        };
        if *known == u32::MAX {
            *known = vertices.len() as u32;
            vertices.push(vertex);
        }
        *known
    }
}

fn leftover(document: &Document<'_>, mode: Mode, count: usize, place: &str, sink: &mut Sink<'_>) {
    if mode == Mode::Triangles && !count.is_multiple_of(3) {
        let what = "number of indices is not a multiple of 3; the rest is left out";
        sink.repaired(document.file, place, what);
    }
}

/// Corners of each triangle; every other one of a strip is turned so that all face the same way.
fn triangles_of(mode: Mode, count: usize, vertex: impl Fn(usize) -> u32) -> Vec<[u32; 3]> {
    let corners = |[a, b, c]: [usize; 3]| [vertex(a), vertex(b), vertex(c)];
    let strip = count.saturating_sub(2);
    match mode {
        Mode::TriangleStrip => (0..strip).map(|i| corners([i, i + 1 + i % 2, i + 2 - i % 2])).collect(),
        Mode::TriangleFan => (0..strip).map(|i| corners([i + 1, i + 2, 0])).collect(),
        _ => (0..count / 3).map(|i| corners([3 * i, 3 * i + 1, 3 * i + 2])).collect(),
    }
}
