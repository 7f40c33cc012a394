//! glTF meshes: all primitives of a mesh in one [`TriangleMesh`].

use super::Document;
use super::accessor::Elements;
use super::deform::{self, Follower};
use super::material::Palette;
use super::vertices::Used;
use crate::bvh::MOST_TRIANGLES;
use crate::load::error::LoadError;
use crate::load::geometry::{self, MANY, Part};
use crate::load::report::Sink;
use crate::load::tangents;
use crate::scene::{Deform, Material, Mesh, Skin};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{Vec2, Vec3, Vec4};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// A mesh in the world.
#[derive(Clone)]
pub(super) struct Built {
    /// None if it has no triangle to trace.
    pub(super) entity: Option<Entity>,
    pub(super) materials: Vec<Entity>,
    /// As the file has them, before those without area were dropped.
    pub(super) triangles: usize,
}

/// Meshes of a file, built when first used; one that changes shape once for each node.
#[derive(Default)]
pub(super) struct Meshes {
    built: HashMap<(usize, Option<usize>), Built>,
}

impl Meshes {
    /// The mesh entity of `index`.
    pub(super) fn get(
        &mut self,
        document: &Document<'_>,
        index: &Index<json::Mesh>,
        follower: Option<Follower>,
        palette: &mut Palette,
        user: &str,
        sink: &mut Sink<'_>,
    ) -> Result<Built, LoadError> {
        let key = (index.value(), follower.as_ref().map(|follower| follower.node));
        if let Some(built) = self.built.get(&key) {
            return Ok(built.clone());
        }
        let mesh = document.at(&document.root.meshes, index, "mesh", user)?;
        let label = format!("mesh {}", index.value());
        let mut parts = Vec::new();
        let mut materials: Vec<Entity> = Vec::new();
        let mut triangles = 0;
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("{label}, primitive {i}");
            if !has_surface(primitive) {
                // It says so, or that nobody knows what it is.
                read_primitive(document, primitive, [0; 2], None, &place, sink)?;
                continue;
            }
            let worn = document.material_of(primitive);
            let material = match worn {
                Some(index) => *document.at(&palette.materials, &Index::new(index), "material", &place)?,
                None => {
                    let colors = Checked::Valid(Semantic::Colors(0));
                    let has_colors = primitive.attributes.contains_key(&colors);
                    palette.default_material(document.file, has_colors, sink)
                }
            };
            let uv_sets = worn.map_or([0; 2], |index| palette.uv_sets[index as usize]);
            if worn.is_some_and(|index| palette.textured[index as usize]) {
                let has =
                    |set: u32| primitive.attributes.contains_key(&Checked::Valid(Semantic::TexCoords(set)));
                if !has(0) && !uv_sets.into_iter().any(has) {
                    let what = format!(
                        "no TEXCOORD_{} for the textures of its material: one texel all over",
                        uv_sets[0]
                    );
                    sink.ignored(document.file, &place, what);
                }
            }
            let more = document.meshes.get(index.value());
            if more.is_some_and(|mesh| mesh.turns_tangents(i)) {
                let what = "morph targets that move TANGENT: the tangents turn with the surface instead";
                sink.decide(document.file, what);
            }
            if more.is_some_and(|mesh| mesh.moves_more(i)) {
                let what = "morph targets that move COLOR_0 or TEXCOORD_n: these stay as they are";
                sink.ignored(document.file, &place, what);
            }
            let Some(mut part) =
                read_primitive(document, primitive, uv_sets, follower.as_ref(), &place, sink)?
            else {
                continue;
            };
            triangles += part.triangles.len();
            if triangles > MOST_TRIANGLES {
                return Err(document.broken(
                    place,
                    format!("more than {MOST_TRIANGLES} triangles: part it into several meshes"),
                ));
            }
            let slot = materials.iter().position(|&known| known == material).unwrap_or_else(|| {
                materials.push(material);
                materials.len() - 1
            });
            part.slot =
                u16::try_from(slot).map_err(|_| document.broken(&place, "more than 65536 materials"))?;
            parts.push(part);
        }
        if follower.is_some() {
            deform::take_for(document, &parts, &label)?;
        }
        let parts = geometry::faceted_beside_smooth(parts);
        let mut bound = follower.map(|follower| (follower, deform::gather(&parts)));
        // What has no area now may have it in another shape.
        let sides = materials.iter().map(|&material| sink.world.get::<Material>(material));
        let two_sided: Vec<bool> = sides.map(|material| material.is_none_or(|m| !m.culled)).collect();
        let is_two_sided = |slot: usize| two_sided.get(slot).copied().unwrap_or(true);
        let mut done = geometry::finish(geometry::merge(parts), bound.is_some(), is_two_sided);
        let unsplit = bound.is_some().then(|| (done.mesh.positions.len(), done.mesh.triangles.clone()));
        tangents::complete_for(&mut done.mesh, &materials, document.file, &label, sink);
        if let (Some((_, bonds)), Some((count, triangles))) = (&mut bound, unsplit) {
            deform::follow_splits(document, bonds, (count, &triangles), &done.mesh, &label)?;
        }
        done.mended.tell(document.file, &label, sink);
        let name = mesh.name.clone().unwrap_or(label);
        let mesh = Arc::new(done.mesh);
        let entity =
            (!mesh.triangles.is_empty()).then(|| sink.spawn((Name::new(name), Mesh(Arc::clone(&mesh)))));
        if let (Some(entity), Some((follower, (influences, targets)))) = (entity, bound) {
            let skin = follower.skin.map(|skin| Skin { influences, ..skin });
            let deform = Deform { rest: mesh, targets, weights: Some(follower.weights), skin };
            sink.world.entity_mut(entity).insert(deform);
        }
        let built = Built { entity, materials, triangles: done.triangles };
        self.built.insert(key, built.clone());
        Ok(built)
    }
}

fn has_surface(primitive: &Primitive) -> bool {
    let surfaces = [Mode::Triangles, Mode::TriangleStrip, Mode::TriangleFan];
    matches!(primitive.mode, Checked::Valid(mode) if surfaces.contains(&mode))
}

/// Reads what a primitive's triangles use; None if there are none.
fn read_primitive(
    document: &Document<'_>,
    primitive: &Primitive,
    uv_sets: [u32; 2],
    follower: Option<&Follower>,
    place: &str,
    sink: &mut Sink<'_>,
) -> Result<Option<Part>, LoadError> {
    let file = document.file;
    let Checked::Valid(mode) = primitive.mode else {
        return Err(document.broken(place, "unknown mode (what the vertices form)"));
    };
    if !has_surface(primitive) {
        let what = format!("mode {} (points or lines) has no triangles", mode.as_gl_enum());
        sink.ignored(file, place, what);
        return Ok(None);
    }
    let attribute = |semantic: Semantic, width: &[usize]| -> Result<Option<Elements<'_>>, LoadError> {
        let label = format!("{place}, {}", semantic.to_string());
        let Some(index) = primitive.attributes.get(&Checked::Valid(semantic)) else {
            return Ok(None);
        };
        let elements = document.elements(index, &label)?;
        if !width.contains(&elements.width) {
            return Err(
                document.broken(&elements.place, format!("attribute has {} components", elements.width))
            );
        }
        Ok(Some(elements))
    };
    let Some(positions) = attribute(Semantic::Positions, &[3])? else {
        // The specification, 3.7.2: whoever reads it should skip it.
        sink.ignored(file, place, "no POSITION: nothing says where its vertices are");
        return Ok(None);
    };
    let normals = attribute(Semantic::Normals, &[3])?;
    let texture_coordinates = |set: u32, sink: &mut Sink<'_>| {
        let uvs = attribute(Semantic::TexCoords(set), &[2])?;
        if uvs.is_some() || set == 0 {
            return Ok(uvs);
        }
        sink.repaired(file, place, format!("no TEXCOORD_{set}, TEXCOORD_0 instead"));
        attribute(Semantic::TexCoords(0), &[2])
    };
    let uvs = texture_coordinates(uv_sets[0], sink)?;
    let second_uvs = if uv_sets[1] == uv_sets[0] { None } else { texture_coordinates(uv_sets[1], sink)? };
    // Without normals they don't count (glTF 2.0 specification, 3.7.2.1).
    let tangents = attribute(Semantic::Tangents, &[4])?.filter(|_| normals.is_some());
    let colors = attribute(Semantic::Colors(0), &[3, 4])?;
    let attributes = [&normals, &uvs, &second_uvs, &tangents, &colors].map(Option::as_ref);
    for other in attributes.into_iter().flatten() {
        if other.count != positions.count {
            let problem = format!("attribute has a count of {}, POSITION {}", other.count, positions.count);
            return Err(document.broken(&other.place, problem));
        }
    }
    let corners = match &primitive.indices {
        Some(index) => document.elements(index, place)?.count,
        None => positions.count,
    };
    let vertices = positions.count.min(corners) as u64;
    let triangles = if mode == Mode::Triangles { corners / 3 } else { corners } as u64;
    // Twice, because primitives are put together; then what building a hierarchy takes.
    let memory = 4 * positions.count as u64 + 2 * (vertices * 48 + triangles * 14) + triangles * 80;
    document.budget.take(memory, file, place)?;
    let used = Used::read(document, primitive, positions.count, mode, place, sink)?;
    let vertices = used.vertices.par_iter().with_min_len(MANY).map(|&v| v as usize);
    let mut part = Part {
        positions: vertices.clone().map(|v| Vec3::from(positions.get_f32(v))).collect(),
        normals: normals.map(|n| vertices.clone().map(|v| Vec3::from(n.get_f32(v))).collect()),
        uvs: uvs.map(|uvs| vertices.clone().map(|v| Vec2::from(uvs.get_f32(v))).collect()),
        second_uvs: second_uvs.map(|uvs| vertices.clone().map(|v| Vec2::from(uvs.get_f32(v))).collect()),
        tangents: tangents.map(|t| vertices.clone().map(|v| Vec4::from(t.get_f32(v))).collect()),
        colors: colors.map(|c| vertices.clone().map(|v| color(&c, v)).collect()),
        triangles: used.triangles,
        ..Part::default()
    };
    if let Some(follower) = follower {
        let (used, count) = (&used.vertices, positions.count);
        part.targets = deform::targets(document, primitive, used, count, place)?;
        if let Some(skin) = &follower.skin {
            let joints = skin.joints.len();
            part.influences = deform::influences(document, primitive, (used, count), joints, place, sink)?;
        }
    }
    Ok(Some(part))
}

fn color(colors: &Elements<'_>, vertex: usize) -> Vec4 {
    let rgba = Vec4::from(colors.get_f32::<4>(vertex));
    if colors.width == 3 { rgba.truncate().extend(1.0) } else { rgba }
}
