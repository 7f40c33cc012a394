//! From what a file says about triangles to a [`TriangleMesh`] that keeps its promises.

use super::report::{Kind, Sink};
use crate::scene::{Influences, Target, TriangleMesh};
use glam::{DVec3, Vec2, Vec3, Vec4};
use rayon::prelude::*;

/// Coordinates beyond this are left out: their products overflow single precision.
const FAR: f32 = 1e18;
/// Vertices or triangles that are worth another thread.
pub(super) const MANY: usize = 1 << 14;

/// One primitive: the attributes that are there have one entry a vertex.
#[derive(Default)]
pub(super) struct Part {
    pub(super) positions: Vec<Vec3>,
    pub(super) normals: Option<Vec<Vec3>>,
    pub(super) uvs: Option<Vec<Vec2>>,
    pub(super) second_uvs: Option<Vec<Vec2>>,
    pub(super) tangents: Option<Vec<Vec4>>,
    pub(super) colors: Option<Vec<Vec4>>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) slot: u16,
    /// Joints that carry the vertices, if the mesh has a skin.
    pub(super) influences: Influences,
    /// Morph targets, if it has any.
    pub(super) targets: Vec<Target>,
}

/// A finished mesh and what happened on the way.
pub(super) struct Finished {
    pub(super) mesh: TriangleMesh,
    /// Triangles before those without area were dropped.
    pub(super) triangles: usize,
    pub(super) mended: Mended,
}

/// How many things had to be mended.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Mended {
    pub(super) not_finite: usize,
    pub(super) too_far: usize,
    pub(super) without_area: usize,
    pub(super) normals: usize,
    pub(super) uvs: usize,
    pub(super) colors: usize,
    pub(super) turned: usize,
}

impl Mended {
    /// A remark for each kind.
    pub(super) fn tell(&self, file: &str, place: &str, sink: &mut Sink<'_>) {
        let kinds = [
            (self.not_finite, "triangles dropped: a position is not finite"),
            (self.too_far, "triangles dropped: a position is beyond the range of 1e18"),
            (self.without_area, "triangles without area dropped"),
            (self.normals, "vertex normals zero or not finite, replaced by those of the faces"),
            (self.uvs, "texture coordinates not finite, set to 0"),
            (self.colors, "vertex colours not finite, set to white"),
            (self.turned, "triangles whose corners go round against their normals, turned over"),
        ];
        for (count, what) in kinds.into_iter().filter(|(count, _)| *count > 0) {
            sink.remark(Kind::Repaired, file, place, what.to_owned(), count);
        }
    }
}

/// Gives primitives without normals, beside others with them, vertices of their own with face normals.
pub(super) fn faceted_beside_smooth(mut parts: Vec<Part>) -> Vec<Part> {
    if parts.iter().any(|part| part.normals.is_some()) {
        for part in parts.iter_mut().filter(|part| part.normals.is_none()) {
            *part = faceted(part);
        }
    }
    parts
}

/// Puts primitives into one mesh. Where only some have an attribute, the others get its neutral
/// value, and face normals.
pub(super) fn merge(parts: Vec<Part>) -> TriangleMesh {
    let parts = faceted_beside_smooth(parts);
    let any_normals = parts.iter().any(|part| part.normals.is_some());
    let any_uvs = parts.iter().any(|part| part.uvs.is_some());
    let any_second_uvs = parts.iter().any(|part| part.second_uvs.is_some());
    let any_tangents = parts.iter().any(|part| part.tangents.is_some());
    let any_colors = parts.iter().any(|part| part.colors.is_some());
    let several_slots = parts.iter().any(|part| part.slot != 0);
    let mut mesh = TriangleMesh::default();
    let mut parts = parts.into_iter();
    if let (1, false) = (parts.len(), several_slots)
        && let Some(part) = parts.next()
    {
        let Part { positions, triangles, .. } = part;
        let [uvs, second_uvs] = [part.uvs, part.second_uvs].map(Option::unwrap_or_default);
        let [tangents, colors] = [part.tangents, part.colors].map(Option::unwrap_or_default);
        let normals = part.normals.unwrap_or_default();
        return TriangleMesh { positions, triangles, normals, uvs, second_uvs, tangents, colors, ..mesh };
    }
    for mut part in parts {
        let first = mesh.positions.len() as u32;
        let count = part.positions.len();
        mesh.triangles.extend(part.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
        if several_slots {
            mesh.slots.resize(mesh.triangles.len(), part.slot);
        }
        mesh.positions.append(&mut part.positions);
        if any_normals {
            mesh.normals.extend(part.normals.unwrap_or_else(|| vec![Vec3::ZERO; count]));
        }
        if any_uvs {
            mesh.uvs.extend(part.uvs.unwrap_or_else(|| vec![Vec2::ZERO; count]));
        }
        if any_second_uvs {
            mesh.second_uvs.extend(part.second_uvs.unwrap_or_else(|| vec![Vec2::ZERO; count]));
        }
        if any_tangents {
            mesh.tangents.extend(part.tangents.unwrap_or_else(|| vec![Vec4::ZERO; count]));
        }
        if any_colors {
            mesh.colors.extend(part.colors.unwrap_or_else(|| vec![Vec4::ONE; count]));
        }
    }
    mesh
}

/// Three vertices of its own for each triangle, with the normal of the face.
fn faceted(part: &Part) -> Part {
    let corners = || part.triangles.iter().flatten().map(|&corner| corner as usize);
    let positions: Vec<Vec3> = corners().map(|corner| part.positions[corner]).collect();
    let (faces, _) = positions.as_chunks::<3>();
    let normals = faces.iter().flat_map(|&face| [unit_normal(face).unwrap_or(Vec3::ZERO); 3]).collect();
    Part {
        normals: Some(normals),
        uvs: part.uvs.as_ref().map(|uvs| corners().map(|corner| uvs[corner]).collect()),
        second_uvs: part.second_uvs.as_ref().map(|uvs| corners().map(|corner| uvs[corner]).collect()),
        // Tangents without normals don't count (glTF 2.0 specification, 3.7.2.1).
        tangents: None,
        colors: part.colors.as_ref().map(|colors| corners().map(|corner| colors[corner]).collect()),
        triangles: (0..part.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        positions,
        slot: part.slot,
        influences: part.influences.of(corners()),
        targets: part.targets.iter().map(|target| target.of(corners())).collect(),
    }
}

/// Unit normal of a counter-clockwise triangle, if it has an area in double precision.
pub(super) fn unit_normal(corners: [Vec3; 3]) -> Option<Vec3> {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let (ab, ac) = (b - a, c - a);
    let longest = ab.abs().max_element().max(ac.abs().max_element());
    (ab / longest).cross(ac / longest).try_normalize().map(DVec3::as_vec3)
}

/// Drops what cannot be traced and mends what can, so that every promise of [`TriangleMesh`] holds.
/// With `keep_flat`, triangles without area stay. `two_sided`: the slots whose triangles have no front that counts.
pub(super) fn finish(
    mut mesh: TriangleMesh,
    keep_flat: bool,
    two_sided: impl Fn(usize) -> bool + Sync,
) -> Finished {
    let is_near = |p: &Vec3| p.abs().max_element() <= FAR;
    let all_near = mesh.positions.par_iter().with_min_len(MANY).all(|p| p.is_finite() && is_near(p));
    let not_finite =
        if all_near { 0 } else { retain(&mut mesh, |corners| corners.iter().all(|p| p.is_finite())) };
    let mut mended = Mended { not_finite, ..Mended::default() };
    let triangles = mesh.triangles.len();
    mended.too_far = if all_near { 0 } else { retain(&mut mesh, |corners| corners.iter().all(is_near)) };
    mended.without_area = if keep_flat { 0 } else { mesh.drop_degenerate() };
    mend_normals(&mut mesh, &mut mended);
    mended.turned = turn_to_normals(&mut mesh, two_sided);
    for uv in mesh.uvs.iter_mut().chain(&mut mesh.second_uvs) {
        if !uv.is_finite() {
            *uv = Vec2::ZERO;
            mended.uvs += 1;
        }
    }
    mesh.tangents.par_iter_mut().with_min_len(MANY).for_each(|tangent| {
        let side = if tangent.w < 0.0 { -1.0 } else { 1.0 };
        // What has no direction is made later, where a normal map needs it.
        *tangent = tangent.truncate().try_normalize().map_or(Vec4::ZERO, |t| t.extend(side));
    });
    for color in &mut mesh.colors {
        if !color.is_finite() {
            *color = Vec4::ONE;
            mended.colors += 1;
        }
        *color = color.clamp(Vec4::ZERO, Vec4::ONE);
    }
    Finished { mesh, triangles, mended }
}

/// Keeps the triangles whose corners pass; returns how many do not.
fn retain(mesh: &mut TriangleMesh, mut pass: impl FnMut([Vec3; 3]) -> bool) -> usize {
    let keep: Vec<bool> = (0..mesh.triangles.len()).map(|i| pass(mesh.corners(i))).collect();
    let dropped = keep.iter().filter(|&&kept| !kept).count();
    if dropped > 0 {
        let mut kept = keep.iter().copied();
        mesh.triangles.retain(|_| kept.next().unwrap_or(true));
        let mut kept = keep.iter().copied();
        mesh.slots.retain(|_| kept.next().unwrap_or(true));
    }
    dropped
}

/// Turns triangles over that none of their normals agrees with, as mirrored exports and some CAD programs leave them: else their
/// normals would be those of the other side. Returns how many.
fn turn_to_normals(mesh: &mut TriangleMesh, two_sided: impl Fn(usize) -> bool + Sync) -> usize {
    let TriangleMesh { positions, normals, slots, .. } = mesh;
    if normals.is_empty() {
        return 0;
    }
    let turn = |(i, corners): (usize, &mut [u32; 3])| {
        if !two_sided(slots.get(i).map_or(0, |&slot| usize::from(slot))) {
            return 0;
        }
        let [a, b, c] = corners.map(|i| positions[i as usize]);
        let facet = (b - a).cross(c - a);
        let is_against = corners.iter().all(|&i| normals[i as usize].dot(facet) < 0.0);
        if is_against {
            corners.swap(1, 2);
        }
        usize::from(is_against)
    };
    mesh.triangles.par_iter_mut().enumerate().with_min_len(MANY).map(turn).sum()
}

/// Unit length for all; what has no direction gets the mean normal of its faces.
fn mend_normals(mesh: &mut TriangleMesh, mended: &mut Mended) {
    let is_broken = |normal: &mut Vec3| {
        let unit = normal.as_dvec3().try_normalize();
        *normal = unit.map_or(Vec3::ZERO, DVec3::as_vec3);
        unit.is_none()
    };
    let broken: Vec<bool> = mesh.normals.par_iter_mut().with_min_len(MANY).map(is_broken).collect();
    mended.normals = broken.iter().filter(|&&b| b).count();
    if mended.normals == 0 {
        return;
    }
    let mut sums = vec![DVec3::ZERO; mesh.normals.len()];
    for (i, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(i).map(Vec3::as_dvec3);
        for &corner in corners {
            sums[corner as usize] += (b - a).cross(c - a);
        }
    }
    for ((normal, sum), _) in mesh.normals.iter_mut().zip(sums).zip(broken).filter(|(_, broken)| *broken) {
        *normal = sum.try_normalize().unwrap_or(DVec3::Y).as_vec3();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(offset: f32) -> Part {
        Part {
            positions: [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]].map(|p| Vec3::from(p) + offset).to_vec(),
            triangles: vec![[0, 1, 2]],
            ..Part::default()
        }
    }

    #[test]
    fn a_part_without_normals_gets_face_normals_beside_one_with() {
        let smooth = Part { normals: Some(vec![Vec3::X; 3]), slot: 1, ..triangle(0.0) };
        let mesh = merge(vec![smooth, triangle(5.0)]);
        assert_eq!(mesh.normals, [[Vec3::X; 3], [Vec3::Z; 3]].concat());
        assert_eq!(mesh.slots, [1, 0]);
        assert_eq!(mesh.triangles[1], [3, 4, 5]);
    }

    #[test]
    fn triangles_that_are_not_finite_go_before_the_count_and_flat_ones_after() {
        let mut flat = triangle(0.0);
        flat.positions[2] = flat.positions[1];
        let mut far = triangle(0.0);
        far.positions[0].x = f32::NAN;
        let done = finish(merge(vec![flat, far, triangle(0.0)]), false, |_| true);
        assert_eq!((done.triangles, done.mesh.triangles.len()), (2, 1));
        assert_eq!((done.mended.not_finite, done.mended.without_area), (1, 1));
    }

    #[test]
    fn zero_normals_become_face_normals() {
        let part =
            Part { normals: Some(vec![Vec3::ZERO, Vec3::splat(f32::NAN), Vec3::X * 3.0]), ..triangle(0.0) };
        let done = finish(merge(vec![part]), false, |_| true);
        assert_eq!(done.mesh.normals, [Vec3::Z, Vec3::Z, Vec3::X]);
    }

    #[test]
    fn a_triangle_goes_round_as_its_normals_say() {
        let by = |normals: [Vec3; 3], two_sided: bool| {
            let mesh = merge(vec![Part { normals: Some(normals.to_vec()), ..triangle(0.0) }]);
            let done = finish(mesh, false, |_| two_sided);
            (done.mesh.triangles[0], done.mended.turned)
        };
        let around = |normals| by(normals, true);
        assert_eq!(by([Vec3::NEG_Z; 3], false), ([0, 1, 2], 0));
        assert_eq!(around([Vec3::Z; 3]), ([0, 1, 2], 0));
        assert_eq!(around([Vec3::NEG_Z; 3]), ([0, 2, 1], 1));
        assert_eq!(around([Vec3::NEG_Z, Vec3::NEG_Z, Vec3::Z]), ([0, 1, 2], 0));
    }

    #[test]
    fn a_sliver_has_its_normal() {
        let normal = unit_normal([Vec3::ZERO, Vec3::X * 1e6, Vec3::new(5e5, 1e-6, 0.0)]);
        assert!(normal.is_some_and(|n| (n - Vec3::Z).length() < 1e-6));
    }
}
