//! Tangents for normal maps, where a file has none: Mikkelsen's, which those who bake such maps use too.

use super::report::{Kind, Sink};
use crate::scene::{Material, TextureUse, TriangleMesh};
use bevy_ecs::prelude::*;
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Mat2, Vec2, Vec3, Vec4};
use std::collections::HashMap;

/// Gives tangents to the triangles whose material of `materials`, by slot, has a normal map; `place` names the
/// mesh in `file`.
pub(super) fn complete_for(
    mesh: &mut TriangleMesh,
    materials: &[Entity],
    file: &str,
    place: &str,
    sink: &mut Sink<'_>,
) {
    let world = &*sink.world;
    let wants: Vec<Option<Directed>> =
        materials.iter().map(|material| world.get::<Material>(*material).and_then(directed)).collect();
    if wants.iter().all(Option::is_none) {
        // Nobody will look at them.
        mesh.tangents = Vec::new();
        return;
    }
    let without = complete(mesh, &wants);
    if without > 0 {
        let what = "corners have a normal map or a brush, but texture coordinates that say nothing about its \
                    direction: it is left out there";
        sink.remark(Kind::Ignored, file, place, what.to_owned(), without);
    }
}

/// By which texture coordinates a material has directions along its surface.
#[derive(Clone, Copy, PartialEq)]
struct Directed {
    second_uvs: bool,
    /// Texture from mesh: directions are those of the picture, however it is turned.
    turned: Mat2,
}

impl Directed {
    const PLAIN: Self = Self { second_uvs: false, turned: Mat2::IDENTITY };
}

impl From<TextureUse> for Directed {
    fn from(texture: TextureUse) -> Self {
        Self { second_uvs: texture.second_uvs, turned: texture.uv_transform.matrix2 }
    }
}

fn directed(material: &Material) -> Option<Directed> {
    let layers = material.layers.as_ref();
    let coat = layers.and_then(|layers| layers.clearcoat.as_ref()?.normal_map);
    let map = material.normal_map.or(coat).map(|map| map.texture.into());
    map.or_else(|| {
        let brushed = layers?.anisotropy.as_ref()?;
        Some(brushed.texture.map_or(Directed::PLAIN, Directed::from))
    })
}

/// Gives tangents to the triangles that want and have none; returns how many corners remain without, for
/// their texture coordinates have no area. A vertex whose triangles disagree is split.
///
/// `wants` says for each slot whether there is a normal map, and by which coordinates.
///
/// Reference: M. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008; glTF 2.0 specification, 3.7.2.1.
fn complete(mesh: &mut TriangleMesh, wants: &[Option<Directed>]) -> usize {
    let mut without = 0;
    for second_uvs in [false, true] {
        let faces = bare_faces(mesh, wants, second_uvs);
        let uvs = if second_uvs { &mesh.second_uvs } else { &mesh.uvs };
        if faces.is_empty() || uvs.is_empty() {
            without += 3 * faces.len();
            continue;
        }
        let tangents = vec![[Vec4::ZERO; 3]; faces.len()];
        let mut made = Made { mesh, wants, uvs, faces, tangents };
        // Its error has no kinds yet; without an answer the tangents stay zero.
        let _ = generate_tangents(&mut made);
        let Made { faces, tangents, .. } = made;
        without += tangents.iter().flatten().filter(|t| **t == Vec4::ZERO).count();
        attach(mesh, &faces, &tangents);
    }
    without
}

/// Triangles that want tangents by this set of texture coordinates.
fn bare_faces(mesh: &TriangleMesh, wants: &[Option<Directed>], second_uvs: bool) -> Vec<usize> {
    let is_bare = |corner: &u32| mesh.tangents.get(*corner as usize).is_none_or(|t| *t == Vec4::ZERO);
    let wanted = |slot: usize| wants.get(slot).copied().flatten().is_some_and(|d| d.second_uvs == second_uvs);
    (0..mesh.triangles.len())
        .filter(|&i| wanted(mesh.slot(i)) && mesh.triangles[i].iter().all(is_bare))
        .collect()
}

/// What is asked of the mesh, and the answers.
struct Made<'a> {
    mesh: &'a TriangleMesh,
    wants: &'a [Option<Directed>],
    uvs: &'a [Vec2],
    faces: Vec<usize>,
    tangents: Vec<[Vec4; 3]>,
}

impl Made<'_> {
    fn corner(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[self.faces[face]][corner] as usize
    }
}

impl Geometry for Made<'_> {
    fn num_faces(&self) -> usize {
        self.faces.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.corner(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        let flat = || super::geometry::unit_normal(self.mesh.corners(self.faces[face])).unwrap_or(Vec3::Z);
        self.mesh.normals.get(self.corner(face, corner)).copied().unwrap_or_else(flat).to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        // Mikkelsen's v grows upward, glTF's downward.
        let wanted = self.wants.get(self.mesh.slot(self.faces[face])).copied().flatten();
        let uv = wanted.unwrap_or(Directed::PLAIN).turned * self.uvs[self.corner(face, corner)];
        [uv.x, 1.0 - uv.y]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        let tangent = space.map_or(Vec4::ZERO, |space| Vec4::from(space.tangent_encoded()));
        let is_direction = tangent.is_finite() && tangent.truncate() != Vec3::ZERO;
        self.tangents[face][corner] = if is_direction { tangent } else { Vec4::ZERO };
    }
}

/// Writes the tangents of the corners of `faces` to the vertices.
fn attach(mesh: &mut TriangleMesh, faces: &[usize], tangents: &[[Vec4; 3]]) {
    mesh.tangents.resize(mesh.positions.len(), Vec4::ZERO);
    let bits = |t: Vec4| t.to_array().map(f32::to_bits);
    let mut first: HashMap<u32, Vec4> = HashMap::new();
    let mut twins: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    for (&face, corners) in faces.iter().zip(tangents) {
        for (corner, &tangent) in corners.iter().enumerate() {
            let vertex = mesh.triangles[face][corner];
            let at = *first.entry(vertex).or_insert(tangent);
            if at == tangent {
                mesh.tangents[vertex as usize] = tangent;
                continue;
            }
            let twin = *twins.entry((vertex, bits(tangent))).or_insert_with(|| {
                let twin = mesh.duplicate(vertex);
                mesh.tangents[twin as usize] = tangent;
                twin
            });
            mesh.triangles[face][corner] = twin;
        }
    }
}
