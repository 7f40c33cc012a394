//! Checked access to accessors: nothing is read outside its view, nothing allocated from a count.

use super::Document;
use super::draco::Decoded;
use crate::load::error::LoadError;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Index, buffer::View};

/// Most elements of an accessor that has no data (all zero).
const MOST_ZEROS: u64 = 1 << 24;

/// Elements of an accessor, decoded one by one on demand.
pub(super) struct Elements<'a> {
    /// Name for messages, e.g. `accessor 3`.
    pub(super) place: String,
    /// Number of elements.
    pub(super) count: usize,
    /// Components an element has.
    pub(super) width: usize,
    /// How components are stored.
    pub(super) kind: ComponentType,
    normalized: bool,
    dense: Option<Dense<'a>>,
    /// Replaced elements, by index; values tightly packed.
    sparse: Option<(Vec<(u32, u32)>, &'a [u8])>,
}

struct Dense<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Document<'a> {
    /// Opens an accessor. Afterwards every element below `count` can be read.
    pub(super) fn elements<'d>(
        &'d self,
        index: &Index<Accessor>,
        user: &str,
    ) -> Result<Elements<'d>, LoadError> {
        let accessor = self.at(&self.root.accessors, index, "accessor", user)?;
        let place = format!("accessor {} ({user})", index.value());
        if let Some(Decoded { bytes, kind, width, count }) = self.decoded.get(&index.value()) {
            let dense = Some(Dense { bytes, stride: width * kind.size() });
            let (count, width, kind) = (*count, *width, *kind);
            return Ok(Elements { place, count, width, kind, normalized: false, dense, sparse: None });
        }
        let (Checked::Valid(kind), Checked::Valid(shape)) = (accessor.component_type, accessor.type_) else {
            return Err(self.broken(place, "unknown component type or type"));
        };
        let kind = kind.0;
        let width = match shape {
            Type::Scalar => 1,
            Type::Vec2 => 2,
            Type::Vec3 => 3,
            Type::Vec4 | Type::Mat2 => 4,
            Type::Mat3 => 9,
            Type::Mat4 => 16,
        };
        let size = width * kind.size();
        let count = accessor.count.0;
        let dense = match &accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                Some(self.dense(view, offset, count, size, &place)?)
            }
            None if count <= MOST_ZEROS => None,
            None => {
                return Err(
                    self.broken(place, format!("count of {count} without a buffer view: limit {MOST_ZEROS}"))
                );
            }
        };
        let sparse = match &accessor.sparse {
            Some(sparse) => Some(self.sparse(sparse, count, size, &place)?),
            None => None,
        };
        let normalized = accessor.normalized;
        Ok(Elements { place, count: count as usize, width, kind, normalized, dense, sparse })
    }

    /// `count` elements of `size` bytes in a view, at its stride.
    fn dense(
        &self,
        view: &Index<View>,
        offset: u64,
        count: u64,
        size: usize,
        place: &str,
    ) -> Result<Dense<'_>, LoadError> {
        let (bytes, stride) = self.view(view, place)?;
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(self.broken(place, format!("stride of {stride} below the element's {size} bytes")));
        }
        let needed = match count.checked_sub(1) {
            None => Some(0),
            Some(before) => before.checked_mul(stride as u64).and_then(|n| n.checked_add(size as u64)),
        };
        let available = (bytes.len() as u64).checked_sub(offset);
        match (needed, available) {
            (Some(needed), Some(available)) if needed <= available => {
                let bytes = bytes.get(offset as usize..).unwrap_or_default();
                Ok(Dense { bytes, stride })
            }
            _ => {
                let length = bytes.len();
                let what = format!("count {count} at offset {offset}, stride {stride}");
                Err(self.broken(place, format!("out of range: {what} in a buffer view of {length} bytes")))
            }
        }
    }

    fn sparse(
        &self,
        sparse: &gltf::json::accessor::sparse::Sparse,
        count: u64,
        size: usize,
        place: &str,
    ) -> Result<(Vec<(u32, u32)>, &[u8]), LoadError> {
        let replaced = sparse.count.0;
        let place = format!("{place}, sparse");
        let Checked::Valid(kind) = sparse.indices.component_type else {
            return Err(self.broken(place, "unknown type of its indices"));
        };
        let kind = kind.0;
        let indices = self.dense(
            &sparse.indices.buffer_view,
            sparse.indices.byte_offset.0,
            replaced,
            kind.size(),
            &place,
        )?;
        let values =
            self.dense(&sparse.values.buffer_view, sparse.values.byte_offset.0, replaced, size, &place)?;
        let mut order = Vec::with_capacity(replaced as usize);
        for slot in 0..replaced as usize {
            let index = component(indices.bytes, slot * indices.stride, kind) as u32;
            if u64::from(index) >= count {
                return Err(self.broken(place, format!("index out of range: {index} of {count}")));
            }
            order.push((index, slot as u32));
        }
        order.sort_unstable();
        Ok((order, values.bytes))
    }
}

impl Elements<'_> {
    /// Element `i` as numbers: integers normalised if the accessor says so, else as they are.
    pub(super) fn get<const N: usize>(&self, i: usize) -> [f64; N] {
        let (bytes, at) = self.locate(i);
        std::array::from_fn(|c| {
            if c >= self.width {
                return 0.0;
            }
            let value = component(bytes, at + c * self.kind.size(), self.kind);
            match self.kind {
                _ if !self.normalized => value,
                ComponentType::I8 => (value / 127.0).max(-1.0),
                ComponentType::U8 => value / 255.0,
                ComponentType::I16 => (value / 32767.0).max(-1.0),
                ComponentType::U16 => value / 65535.0,
                ComponentType::U32 | ComponentType::F32 => value,
            }
        })
    }

    /// As [`Elements::get`] in single precision.
    pub(super) fn get_f32<const N: usize>(&self, i: usize) -> [f32; N] {
        let (ComponentType::F32, None, Some(dense)) = (self.kind, &self.sparse, &self.dense) else {
            return self.get::<N>(i).map(|value| value as f32);
        };
        // What nearly all files have, without the detour.
        let (components, _) = dense.bytes[i * dense.stride..].as_chunks::<4>();
        std::array::from_fn(|c| if c < self.width { f32::from_le_bytes(components[c]) } else { 0.0 })
    }

    /// Element `i` of a scalar integer accessor.
    pub(super) fn get_index(&self, i: usize) -> u32 {
        let (bytes, at) = self.locate(i);
        component(bytes, at, self.kind) as u32
    }

    /// Whether its components are of one of the types that glTF allows for indices.
    pub(super) fn is_index_type(&self) -> bool {
        matches!(self.kind, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) && self.width == 1
    }

    fn locate(&self, i: usize) -> (&[u8], usize) {
        if let Some((order, values)) = &self.sparse
            && let Some(&(_, slot)) = order[..order.partition_point(|&(index, _)| index as usize <= i)].last()
            && order.binary_search(&(i as u32, slot)).is_ok()
        {
            return (values, slot as usize * self.width * self.kind.size());
        }
        self.dense.as_ref().map_or((&[], 0), |dense| (dense.bytes, i * dense.stride))
    }
}

/// One component; what lies outside (an accessor of zeros) is 0.
fn component(bytes: &[u8], at: usize, kind: ComponentType) -> f64 {
    fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
        bytes.get(at..at + N).and_then(|slice| slice.try_into().ok()).unwrap_or([0; N])
    }
    match kind {
        ComponentType::I8 => f64::from(i8::from_le_bytes(array(bytes, at))),
        ComponentType::U8 => f64::from(u8::from_le_bytes(array(bytes, at))),
        ComponentType::I16 => f64::from(i16::from_le_bytes(array(bytes, at))),
        ComponentType::U16 => f64::from(u16::from_le_bytes(array(bytes, at))),
        ComponentType::U32 => f64::from(u32::from_le_bytes(array(bytes, at))),
        ComponentType::F32 => f64::from(f32::from_le_bytes(array(bytes, at))),
    }
}
