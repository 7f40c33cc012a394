//! Faces of an OBJ file → one indexed triangle mesh.

use super::numbers::NONE;
use super::parts::Kinds;
use super::polygon;
use super::raw::{Corner, Raw};
use crate::scene::TriangleMesh;
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// Vertices at one position that are looked at to find a twin.
const MOST_STEPS: usize = 64;

/// Faces as triangles.
pub(super) struct Cut {
    pub(super) mesh: TriangleMesh,
    /// Faces whose triangles may not cover them.
    pub(super) given_up: usize,
}

/// Cuts all faces into triangles; corners that agree in everything share a vertex. `kinds` of faces are the slots, if there are
/// several.
pub(super) fn mesh(raw: &Raw, kinds: &Kinds) -> Cut {
    let normals = Normals::new(raw);
    let mut vertices = Vertices::new(raw, &normals);
    let mut corners: Vec<u32> = Vec::new();
    let mut points: Vec<DVec3> = Vec::new();
    let has_several = kinds.kinds.len() > 1;
    let mut given_up = 0;
    for (i, face) in raw.faces.iter().enumerate() {
        corners.clear();
        corners.extend(
            raw.corners_of(i).iter().map(|corner| vertices.get(corner, normals.index(i, face.group, corner))),
        );
        points.clear();
        points.extend(
            raw.corners_of(i).iter().map(|corner| raw.positions[corner.position as usize].as_dvec3()),
        );
        let (triangles, is_right) = polygon::triangulate(&points);
        given_up += usize::from(!is_right);
        vertices.mesh.triangles.extend(triangles.iter().map(|t| t.map(|corner| corners[corner])));
        if has_several {
            vertices.mesh.slots.resize(vertices.mesh.triangles.len(), kinds.of_faces[i]);
        }
    }
    Cut { mesh: vertices.mesh, given_up }
}

/// The normals of the file and, after them, those that are made here.
struct Normals<'a> {
    raw: &'a Raw,
    made: Vec<Vec3>,
    /// For a smoothing group and a position the index of its normal.
    smooth: HashMap<(u32, u32), u32>,
    /// Index of the flat normal of a face, if it needs one.
    flat: Vec<u32>,
}

impl<'a> Normals<'a> {
    fn new(raw: &'a Raw) -> Self {
        let mut normals = Self { raw, made: Vec::new(), smooth: HashMap::new(), flat: Vec::new() };
        let bare = |corner: &&Corner| corner.normal == NONE;
        let any_given = raw.corners.iter().any(|corner| corner.normal != NONE);
        let any_smooth = raw
            .faces
            .iter()
            .enumerate()
            .any(|(i, face)| face.group != 0 && raw.corners_of(i).iter().any(|c| bare(&c)));
        if !any_given && !any_smooth {
            return normals;
        }
        let first_made = raw.normals.len() as u32;
        let mut sums: Vec<DVec3> = Vec::new();
        for (i, face) in raw.faces.iter().enumerate() {
            let corners = raw.corners_of(i);
            if !corners.iter().any(|corner| bare(&corner)) {
                normals.flat.push(NONE);
                continue;
            }
            let points: Vec<DVec3> =
                corners.iter().map(|c| raw.positions[c.position as usize].as_dvec3()).collect();
            let normal = polygon::newell(&points).normalize_or_zero();
            if face.group == 0 {
                normals.flat.push(first_made + sums.len() as u32);
                sums.push(normal);
                continue;
            }
            normals.flat.push(NONE);
            for (k, corner) in corners.iter().enumerate().filter(|(_, corner)| bare(corner)) {
                let made = *normals.smooth.entry((face.group, corner.position)).or_insert_with(|| {
                    sums.push(DVec3::ZERO);
                    first_made + sums.len() as u32 - 1
                });
                // Weighted by the angle at the corner, so that the cut into faces does not matter.
                let [before, after] =
                    [points[(k + points.len() - 1) % points.len()], points[(k + 1) % points.len()]];
                let angle = (before - points[k]).angle_between(after - points[k]);
                sums[(made - first_made) as usize] += normal * if angle.is_finite() { angle } else { 0.0 };
            }
        }
        normals.made = sums.into_iter().map(|sum| sum.normalize_or_zero().as_vec3()).collect();
        normals
    }

    /// Whether the mesh has normals at all.
    fn any(&self) -> bool {
        !self.flat.is_empty()
    }

    fn index(&self, face: usize, group: u32, corner: &Corner) -> u32 {
        if corner.normal != NONE || !self.any() {
            return corner.normal;
        }
        if group == 0 {
            self.flat[face]
        } else {
            self.smooth.get(&(group, corner.position)).copied().unwrap_or(NONE)
        }
    }

    fn value(&self, index: u32) -> Vec3 {
        let index = index as usize;
        let given = self.raw.normals.get(index);
        given
            .or_else(|| self.made.get(index.wrapping_sub(self.raw.normals.len())))
            .copied()
            .unwrap_or(Vec3::ZERO)
    }
}

/// Vertices of the mesh, found again by position: a list of those made from each.
struct Vertices<'a> {
    raw: &'a Raw,
    normals: &'a Normals<'a>,
    mesh: TriangleMesh,
    /// By position: the vertex made from it last.
    last_made: Vec<u32>,
    /// By vertex: its indices of texture coordinates and normal, and the vertex made before it.
    links: Vec<(u32, u32, u32)>,
}

impl<'a> Vertices<'a> {
    fn new(raw: &'a Raw, normals: &'a Normals<'a>) -> Self {
        let last_made = vec![NONE; raw.positions.len()];
        Self { raw, normals, mesh: TriangleMesh::default(), last_made, links: Vec::new() }
    }

    fn get(&mut self, corner: &Corner, normal: u32) -> u32 {
        let position = corner.position as usize;
        let mut vertex = self.last_made[position];
        let mut steps = 0;
        while let Some(&(uv, known_normal, before)) = self.links.get(vertex as usize) {
            if (uv, known_normal) == (corner.uv, normal) {
                return vertex;
            }
            vertex = before;
            // A hub of a million flat faces would make this quadratic; a twin does no harm.
            steps += 1;
            if steps > MOST_STEPS {
                break;
            }
        }
        let made = self.links.len() as u32;
        self.links.push((corner.uv, normal, self.last_made[position]));
        self.last_made[position] = made;
        self.mesh.positions.push(self.raw.positions[position]);
        if self.normals.any() {
            self.mesh.normals.push(self.normals.value(normal));
        }
        if !self.raw.uvs.is_empty() {
            self.mesh.uvs.push(self.raw.uvs.get(corner.uv as usize).copied().unwrap_or(Vec2::ZERO));
        }
        if let Some(color) = self.raw.colors.get(position) {
            self.mesh.colors.push(color.extend(1.0));
        }
        made
    }
}
