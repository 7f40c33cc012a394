//! Which vertices the triangles of a primitive use.

use super::Document;
use crate::bvh::MOST_TRIANGLES;
use crate::load::error::LoadError;
use crate::load::geometry::MANY;
use crate::load::report::Sink;
use gltf::json::mesh::{Mode, Primitive};
use rayon::prelude::*;

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
        let mut corners: Vec<u32> =
            (0..indices.count).into_par_iter().with_min_len(MANY).map(|i| indices.get_index(i)).collect();
        if let Some(vertex) = corners.iter().find(|&&vertex| vertex as usize >= count) {
            let what = format!("index out of range: vertex {vertex} of {count}");
            return Err(document.broken(&indices.place, what));
        }
        let vertices = renumber(&mut corners, count);
        Ok(Self { vertices, triangles: triangles_of(mode, corners.len(), |i| corners[i]) })
    }
}

/// Numbers the vertices that `corners` name anew, in their order, without those of the `count` that none names; returns the
/// old numbers.
fn renumber(corners: &mut [u32], count: usize) -> Vec<u32> {
    // A table, unless it would be mostly empty.
    if count <= 4 * corners.len() + 1024 {
        let mut numbers = vec![u32::MAX; count];
        corners.iter().for_each(|&vertex| numbers[vertex as usize] = 0);
        let used: Vec<u32> = (0..count as u32).filter(|&vertex| numbers[vertex as usize] == 0).collect();
        if used.len() < count {
            used.iter().zip(0..).for_each(|(&vertex, number)| numbers[vertex as usize] = number);
            corners.iter_mut().for_each(|vertex| *vertex = numbers[*vertex as usize]);
        }
        return used;
    }
    let mut used = corners.to_vec();
    used.sort_unstable();
    used.dedup();
    for vertex in corners {
        *vertex = used.partition_point(|known| known < vertex) as u32;
    }
    used
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
        // A corner twice is a stitch between two strips.
        Mode::TriangleStrip => (0..strip)
            .map(|i| corners([i, i + 1 + i % 2, i + 2 - i % 2]))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect(),
        Mode::TriangleFan => (0..strip).map(|i| corners([i + 1, i + 2, 0])).collect(),
        _ => (0..count / 3).map(|i| corners([3 * i, 3 * i + 1, 3 * i + 2])).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_keep_their_order_and_what_nobody_uses_goes() {
        let named = [7, 2, 7, 5, 2, 0];
        for count in [8, 100_000] {
            let mut corners = named;
            let used = renumber(&mut corners, count);
            assert_eq!(used, [0, 2, 5, 7]);
            assert_eq!(corners.map(|corner| used[corner as usize]), named);
        }
        let mut all = [2, 0, 1];
        assert_eq!((renumber(&mut all, 3), all), (vec![0, 1, 2], [2, 0, 1]));
    }
}
