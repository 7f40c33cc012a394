//! Tangents for normal maps, where a file has none: Mikkelsen's, which those who bake such maps use too.

use super::geometry::MANY;
use super::report::{Kind, Sink};
use crate::scene::{Material, TextureUse, TriangleMesh};
use bevy_ecs::prelude::*;
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Mat2, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::collections::HashMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::sync::atomic::{AtomicU32, Ordering};

/// Most faces around one vertex: Mikkelsen's way compares each with each.
const MOST_FACES: u32 = 1024;

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
    let (without, crowded) = complete(mesh, &wants);
    if crowded > 0 {
        let what = format!(
            "triangles share a vertex with more than {MOST_FACES} others: the directions of a normal map or brush are \
             those of each one alone"
        );
        sink.remark(Kind::Approximated, file, place, what, crowded);
    }
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
/// their texture coordinates have no area, and how many triangles were too many around a vertex. A vertex whose
/// triangles disagree is split.
///
/// `wants` says for each slot whether there is a normal map, and by which coordinates.
///
/// Reference: M. Mikkelsen, "Simulation of Wrinkled Surfaces Revisited", 2008; glTF 2.0 specification, 3.7.2.1.
fn complete(mesh: &mut TriangleMesh, wants: &[Option<Directed>]) -> (usize, usize) {
    let (mut without, mut alone) = (0, 0);
    for second_uvs in [false, true] {
        let faces = bare_faces(mesh, wants, second_uvs);
        let uvs = if second_uvs { &mesh.second_uvs } else { &mesh.uvs };
        if faces.is_empty() || uvs.is_empty() {
            without += 3 * faces.len();
            continue;
        }
        let mut made = Made { mesh, wants, uvs, faces, tangents: Vec::new() };
        let crowded = made.take_crowded();
        alone += crowded.len();
        made.tangents = vec![[Vec4::ZERO; 3]; made.faces.len()];
        // Its error has no kinds yet; without an answer the tangents stay zero.
        let _ = generate_tangents(&mut made);
        let first_alone = made.faces.len();
        made.faces.extend(crowded);
        made.tangents
            .extend((first_alone..made.faces.len()).map(|face| made.of_face(face)).collect::<Vec<_>>());
        let Made { faces, tangents, .. } = made;
        without += tangents.iter().flatten().filter(|t| **t == Vec4::ZERO).count();
        attach(mesh, &faces, &tangents);
    }
    (without, alone)
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

    /// Takes out the faces that share a corner (place, normal and texture coordinates) with too many others. Corners
    /// are told apart by hashes: two that fall together only make it a little stricter.
    fn take_crowded(&mut self) -> Vec<usize> {
        let table: Vec<AtomicU32> =
            (0..(4 * self.faces.len()).next_power_of_two()).map(|_| AtomicU32::new(0)).collect();
        let cell = |face: usize, corner: usize| {
            let mut hasher = DefaultHasher::new();
            // Zeros of both signs are one place.
            self.position(face, corner).map(|v| (v + 0.0).to_bits()).hash(&mut hasher);
            self.normal(face, corner).map(|v| (v + 0.0).to_bits()).hash(&mut hasher);
            self.tex_coord(face, corner).map(|v| (v + 0.0).to_bits()).hash(&mut hasher);
            hasher.finish() as usize & (table.len() - 1)
        };
        let corners = |face: usize| [0, 1, 2].map(|corner| &table[cell(face, corner)]);
        (0..self.faces.len()).into_par_iter().with_min_len(MANY).for_each(|face| {
            for count in corners(face) {
                count.fetch_add(1, Ordering::Relaxed);
            }
        });
        let is_crowded = |face| corners(face).iter().any(|count| count.load(Ordering::Relaxed) > MOST_FACES);
        if table.iter().all(|count| count.load(Ordering::Relaxed) <= MOST_FACES) {
            return Vec::new();
        }
        let (crowded, others) = (0..self.faces.len()).partition::<Vec<usize>, _>(|&face| is_crowded(face));
        let named = |faces: Vec<usize>| faces.into_iter().map(|face| self.faces[face]).collect::<Vec<_>>();
        let (crowded, others) = (named(crowded), named(others));
        self.faces = others;
        crowded
    }

    /// Tangents of a face by itself: where its texture's u grows, along the surface of each corner.
    fn of_face(&self, face: usize) -> [Vec4; 3] {
        let [a, b, c] = [0, 1, 2].map(|corner| Vec3::from(self.position(face, corner)));
        let [u, v, w] = [0, 1, 2].map(|corner| Vec2::from(self.tex_coord(face, corner)));
        let (by_b, by_c) = (v - u, w - u);
        let side = by_b.perp_dot(by_c).signum();
        let along = ((b - a) * by_c.y - (c - a) * by_b.y) * side;
        [0, 1, 2].map(|corner| {
            let normal = Vec3::from(self.normal(face, corner));
            let tangent = along.reject_from_normalized(normal).try_normalize();
            tangent.filter(|_| by_b.perp_dot(by_c) != 0.0).map_or(Vec4::ZERO, |tangent| tangent.extend(side))
        })
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle of this texture for each blade around the z axis.
    fn blades(count: usize) -> TriangleMesh {
        let mut mesh = TriangleMesh::default();
        for i in 0..count {
            let (sin, cos) = (i as f32 * 0.001).sin_cos();
            let first = 3 * i as u32;
            mesh.positions.extend([Vec3::ZERO, Vec3::Z, Vec3::new(cos, sin, 0.0)]);
            mesh.uvs.extend([Vec2::ZERO, Vec2::Y, Vec2::X]);
            mesh.normals.extend([Vec3::new(-sin, cos, 0.0); 3]);
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        mesh
    }

    #[test]
    fn a_face_by_itself_has_the_tangents_that_mikkelsen_gives_it() {
        let wants = [Some(Directed::PLAIN)];
        for mirrored in [1.0, -1.0] {
            let mut mesh = blades(3);
            mesh.uvs.iter_mut().for_each(|uv| uv.x = uv.x * mirrored + 0.3 * uv.y);
            let (faces, tangents) = ((0..3).collect(), Vec::new());
            let made = Made { mesh: &mesh, wants: &wants, uvs: &mesh.uvs, faces, tangents };
            let alone: Vec<Vec4> = (0..3).flat_map(|face| made.of_face(face)).collect();
            assert_eq!(complete(&mut mesh, &wants), (0, 0));
            for (ours, theirs) in alone.iter().zip(&mesh.tangents) {
                assert!((*ours - *theirs).length() < 1e-5, "{ours} {theirs}");
            }
        }
    }

    #[test]
    fn a_hundred_thousand_faces_at_one_edge_take_no_hour() {
        let mut mesh = blades(100_000);
        // One normal, so that all share both ends of the edge.
        mesh.normals.fill(Vec3::X);
        assert_eq!(complete(&mut mesh, &[Some(Directed::PLAIN)]).1, 100_000);
        let mut mesh = blades(1000);
        mesh.normals.fill(Vec3::X);
        assert_eq!(complete(&mut mesh, &[Some(Directed::PLAIN)]).1, 0);
    }
}
