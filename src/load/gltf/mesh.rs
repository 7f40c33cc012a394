//! glTF meshes: all primitives of a mesh in one [`TriangleMesh`].

use super::accessor::Elements;
use super::material::Palette;
use super::{Document, skin};
use crate::load::error::LoadError;
use crate::load::geometry::{self, Part};
use crate::load::report::Sink;
use crate::scene::Mesh;
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{DAffine3, Vec2, Vec3, Vec4};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};
use std::collections::HashMap;
use std::sync::Arc;

/// Most triangles of one file, counted once a mesh: what fits into 32-bit vertex indices thrice over.
const MOST_TRIANGLES: usize = 1 << 28;

/// A mesh in the world.
#[derive(Clone)]
pub(super) struct Built {
    /// None if it has no triangle to trace.
    pub(super) entity: Option<Entity>,
    pub(super) materials: Vec<Entity>,
    /// As the file has them, before those without area were dropped.
    pub(super) triangles: usize,
}

/// Meshes of a file, built when first used; a skinned one once for each skin.
#[derive(Default)]
pub(super) struct Meshes {
    built: HashMap<(usize, Option<usize>), Built>,
    triangles: usize,
}

impl Meshes {
    /// The mesh entity of `index`, posed by `joints` if it is skinned.
    pub(super) fn get(
        &mut self,
        document: &Document<'_>,
        index: &Index<json::Mesh>,
        skin: Option<(usize, &[DAffine3])>,
        palette: &mut Palette,
        user: &str,
        sink: &mut Sink<'_>,
    ) -> Result<Built, LoadError> {
        let key = (index.value(), skin.map(|(skin, _)| skin));
        if let Some(built) = self.built.get(&key) {
            return Ok(built.clone());
        }
        let mesh = document.at(&document.root.meshes, index, "mesh", user)?;
        let label = format!("mesh {}", index.value());
        let mut parts = Vec::new();
        let mut materials: Vec<Entity> = Vec::new();
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("{label}, primitive {i}");
            let material = match &primitive.material {
                Some(material) => *document.at(&palette.materials, &Index::new(material.value() as u32), "material", &place)?,
                None => palette.default_material(document.file, sink),
            };
            let uv_set = primitive.material.as_ref().map_or(0, |m| palette.uv_sets[m.value()]);
            let joints = skin.map(|(_, joints)| joints);
            let Some(mut part) = read_primitive(document, primitive, uv_set, &mesh.weights, joints, &place, sink)? else {
                continue;
            };
            self.triangles += part.triangles.len();
            if self.triangles > MOST_TRIANGLES {
                return Err(document.broken(place, format!("more than {MOST_TRIANGLES} triangles: too large")));
            }
            let slot = materials.iter().position(|&known| known == material).unwrap_or_else(|| {
                materials.push(material);
                materials.len() - 1
            });
            part.slot = u16::try_from(slot).map_err(|_| document.broken(&place, "more than 65536 materials"))?;
            parts.push(part);
        }
        let done = geometry::finish(geometry::merge(parts));
        for line in done.mended.lines() {
            sink.warn(format!("{}: {label}: {line}", document.file));
        }
        let name = mesh.name.clone().unwrap_or(label);
        let entity = (!done.mesh.triangles.is_empty()).then(|| sink.spawn((Name::new(name), Mesh(Arc::new(done.mesh)))));
        let built = Built { entity, materials, triangles: done.triangles };
        self.built.insert(key, built.clone());
        Ok(built)
    }
}

/// Reads what a primitive's triangles use; None if there are none.
fn read_primitive(
    document: &Document<'_>,
    primitive: &Primitive,
    uv_set: u32,
    weights: &Option<Vec<f32>>,
    joints: Option<&[DAffine3]>,
    place: &str,
    sink: &mut Sink<'_>,
) -> Result<Option<Part>, LoadError> {
    let file = document.file;
    let Checked::Valid(mode) = primitive.mode else {
        return Err(document.broken(place, "unknown mode (what the vertices form)"));
    };
    if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        sink.warn(format!("{file}: {place}: mode {} (points or lines) has no triangles, skipped", mode.as_gl_enum()));
        return Ok(None);
    }
    let attribute = |semantic: Semantic, width: &[usize]| -> Result<Option<Elements<'_>>, LoadError> {
        let label = format!("{place}, {}", semantic.to_string());
        let Some(index) = primitive.attributes.get(&Checked::Valid(semantic)) else {
            return Ok(None);
        };
        let elements = document.elements(index, &label)?;
        if !width.contains(&elements.width) {
            return Err(document.broken(&elements.place, format!("attribute has {} components", elements.width)));
        }
        Ok(Some(elements))
    };
    let Some(positions) = attribute(Semantic::Positions, &[3])? else {
        sink.warn(format!("{file}: {place}: no POSITION, skipped"));
        return Ok(None);
    };
    let normals = attribute(Semantic::Normals, &[3])?;
    let mut uvs = attribute(Semantic::TexCoords(uv_set), &[2])?;
    if uvs.is_none() && uv_set != 0 {
        sink.warn(format!("{file}: {place}: no TEXCOORD_{uv_set}, TEXCOORD_0 instead"));
        uvs = attribute(Semantic::TexCoords(0), &[2])?;
    }
    let colors = attribute(Semantic::Colors(0), &[3, 4])?;
    let skinning = match joints {
        Some(matrices) => attribute(Semantic::Joints(0), &[4])?.zip(attribute(Semantic::Weights(0), &[4])?).map(|(j, w)| (matrices, j, w)),
        None => None,
    };
    let bound = skinning.as_ref().map(|(_, joints, weights)| [joints, weights]);
    let attributes = [normals.as_ref(), uvs.as_ref(), colors.as_ref()];
    for other in attributes.into_iter().flatten().chain(bound.into_iter().flatten()) {
        if other.count != positions.count {
            let problem = format!("attribute has a count of {}, POSITION {}", other.count, positions.count);
            return Err(document.broken(&other.place, problem));
        }
    }
    let used = Used::read(document, primitive, positions.count, mode, place, sink)?;
    let morphs = Morphs::open(document, primitive, weights, positions.count, place)?;
    let vertices = used.vertices.iter().map(|&v| v as usize);
    let mut part = Part {
        positions: vertices.clone().map(|v| Vec3::from(morphs.apply(0, v, positions.get_f32(v)))).collect(),
        normals: normals.map(|n| vertices.clone().map(|v| Vec3::from(morphs.apply(1, v, n.get_f32(v)))).collect()),
        uvs: uvs.map(|uvs| vertices.clone().map(|v| Vec2::from(uvs.get_f32(v))).collect()),
        colors: colors.map(|c| vertices.clone().map(|v| color(&c, v)).collect()),
        triangles: used.triangles,
        slot: 0,
    };
    if let Some((matrices, joints, weights)) = &skinning {
        skin::pose(&mut part, &used.vertices, matrices, joints, weights);
    }
    Ok(Some(part))
}

fn color(colors: &Elements<'_>, vertex: usize) -> Vec4 {
    let rgba = Vec4::from(colors.get_f32::<4>(vertex));
    if colors.width == 3 { rgba.truncate().extend(1.0) } else { rgba }
}

/// Morph targets at the default weights of the mesh.
struct Morphs<'a> {
    targets: Vec<(f32, [Option<Elements<'a>>; 2])>,
}

impl<'a> Morphs<'a> {
    fn open(document: &'a Document<'_>, primitive: &Primitive, weights: &Option<Vec<f32>>, count: usize, place: &str) -> Result<Self, LoadError> {
        let mut targets = Vec::new();
        for (i, target) in primitive.targets.iter().flatten().enumerate() {
            let weight = weights.as_ref().and_then(|weights| weights.get(i)).copied().unwrap_or(0.0);
            if weight == 0.0 {
                continue;
            }
            let open = |index: &Option<Index<json::Accessor>>| match index {
                Some(index) => document.elements(index, &format!("{place}, morph target {i}")).map(Some),
                None => Ok(None),
            };
            let pair = [open(&target.positions)?, open(&target.normals)?];
            if pair.iter().flatten().any(|elements| elements.count != count) {
                return Err(document.broken(place, format!("morph target {i} has another count of vertices")));
            }
            targets.push((weight, pair));
        }
        Ok(Self { targets })
    }

    fn apply(&self, attribute: usize, vertex: usize, mut value: [f32; 3]) -> [f32; 3] {
        for (weight, pair) in &self.targets {
            if let Some(elements) = &pair[attribute] {
                let delta = elements.get_f32::<3>(vertex);
                value = std::array::from_fn(|c| value[c] + weight * delta[c]);
            }
        }
        value
    }
}

/// The vertices that triangles use, renumbered: several primitives often share one large array.
struct Used {
    vertices: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

impl Used {
    fn read(document: &Document<'_>, primitive: &Primitive, count: usize, mode: Mode, place: &str, sink: &mut Sink<'_>) -> Result<Self, LoadError> {
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
                return Err(document.broken(&indices.place, format!("index out of range: vertex {vertex} of {count}")));
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
        if vertices <= 4 * indices + 1024 { Self::Table(vec![u32::MAX; vertices]) } else { Self::Map(HashMap::new()) }
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
    if mode == Mode::Triangles && count % 3 != 0 {
        sink.warn(format!("{}: {place}: {count} indices are not a multiple of 3; the rest is left out", document.file));
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
