//! Meshes that change shape: morph targets, then the joints of a skin.

use super::{GlobalTransform, Mesh, MorphWeights, TriangleMesh};
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// How a [`Mesh`] follows morph weights and joints; beside it on its entity.
#[derive(Component, Clone, Debug)]
pub struct Deform {
    /// The shape that targets and joints start from.
    pub rest: Arc<TriangleMesh>,
    /// Morph targets.
    pub targets: Vec<Target>,
    /// Entity with the [`MorphWeights`] of the targets.
    pub weights: Option<Entity>,
    /// The skin, if there is one.
    pub skin: Option<Skin>,
}

/// A morph target: offsets for all vertices, or empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Target {
    /// Added to positions.
    pub positions: Vec<Vec3>,
    /// Added to normals.
    pub normals: Vec<Vec3>,
}

/// Joints that carry the vertices of a mesh.
#[derive(Clone, Debug)]
pub struct Skin {
    /// Entities with a [`GlobalTransform`], and `joint_from_mesh` in the pose the mesh was made in.
    pub joints: Vec<(Option<Entity>, DAffine3)>,
    /// Which joints carry each vertex.
    pub influences: Influences,
    /// Entity in whose space the mesh is; its placement takes no part in the shape.
    pub space: Entity,
}

/// Which joints carry each vertex, and how much.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Influences {
    /// Joints a vertex has.
    pub per_vertex: usize,
    /// Indices into [`Skin::joints`]; what is beyond them has no weight.
    pub joints: Vec<u16>,
    /// One for each joint index. They need not sum to 1.
    pub weights: Vec<f32>,
}

/// Gives meshes with a [`Deform`] the shape that their weights and joints ask for, where these changed.
pub fn deform(
    mut meshes: Query<(Ref<Deform>, &mut Mesh)>,
    weights: Query<Ref<MorphWeights>>,
    placed: Query<Ref<GlobalTransform>>,
) {
    for (deform, mut mesh) in &mut meshes {
        let given = deform.weights.and_then(|entity| weights.get(entity).ok());
        let mut changed = deform.is_added() || given.as_ref().is_some_and(DetectChanges::is_changed);
        let matrices = deform.skin.as_ref().map(|skin| {
            let world_from_mesh = placed.get(skin.space).map_or_else(|_| DAffine3::IDENTITY, |t| t.0);
            let mesh_from_world = world_from_mesh.inverse();
            let one = |(joint, joint_from_bind): &(Option<Entity>, DAffine3)| {
                let placed = joint.and_then(|joint| placed.get(joint).ok());
                changed |= placed.as_ref().is_some_and(DetectChanges::is_changed);
                let mesh_from_joint = placed.map_or(DAffine3::IDENTITY, |t| mesh_from_world * t.0);
                mesh_from_joint * *joint_from_bind
            };
            skin.joints.iter().map(one).collect::<Vec<_>>()
        });
        if changed {
            let given = given.as_ref().map_or(&[][..], |weights| &weights.0);
            *mesh = Mesh(Arc::new(deform.shape(given, matrices.as_deref())));
        }
    }
}

impl Deform {
    /// The rest shape with `weights` of its targets, then carried by `mesh_from_bind` of each joint.
    #[must_use]
    pub fn shape(&self, weights: &[f32], mesh_from_bind: Option<&[DAffine3]>) -> TriangleMesh {
        let mut mesh = self.rest.as_ref().clone();
        for (target, &weight) in self.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            add(&mut mesh.positions, &target.positions, weight);
            add(&mut mesh.normals, &target.normals, weight);
        }
        if !mesh.tangents.is_empty() && weights.iter().any(|&weight| weight != 0.0) {
            carry_tangents(&self.rest, &mut mesh);
        }
        if let (Some(skin), Some(matrices)) = (&self.skin, mesh_from_bind) {
            mesh.tangents.par_iter_mut().enumerate().for_each(|(i, tangent)| {
                if let Some(carrier) = skin.influences.carrier(i, matrices) {
                    let turned =
                        (carrier.matrix3 * tangent.truncate().as_dvec3()).normalize_or_zero().as_vec3();
                    // A mirroring pose turns the cross product of normal and tangent round.
                    *tangent = turned.extend(tangent.w * carrier.matrix3.determinant().signum() as f32);
                }
            });
        }
        let mut no_normals = vec![Vec3::ZERO; if mesh.normals.is_empty() { mesh.positions.len() } else { 0 }];
        let normals = if mesh.normals.is_empty() { &mut no_normals } else { &mut mesh.normals };
        let vertices = mesh.positions.par_iter_mut().zip(normals.par_iter_mut()).enumerate();
        vertices.for_each(|(i, (position, normal))| {
            if let Some(carrier) = self
                .skin
                .as_ref()
                .zip(mesh_from_bind)
                .and_then(|(skin, matrices)| skin.influences.carrier(i, matrices))
            {
                *position = carrier.transform_point3(position.as_dvec3()).as_vec3();
                *normal = turned(&carrier.matrix3, *normal);
            }
            // What leads nowhere stays as it was.
            if !position.is_finite() {
                *position = self.rest.positions[i];
            }
            if let Some(&rest) = self.rest.normals.get(i) {
                *normal = normal.as_dvec3().try_normalize().map_or(rest, DVec3::as_vec3);
            }
        });
        mesh
    }
}

/// Tangents as the triangles around them take them along from `rest` to the shape of `mesh`.
fn carry_tangents(rest: &TriangleMesh, mesh: &mut TriangleMesh) {
    let mut carried = vec![DVec3::ZERO; mesh.tangents.len()];
    for (i, corners) in rest.triangles.iter().enumerate() {
        let edges = |mesh: &TriangleMesh| {
            let [a, b, c] = mesh.corners(i).map(Vec3::as_dvec3);
            [b - a, c - a]
        };
        let ([u, v], [to_u, to_v]) = (edges(rest), edges(mesh));
        let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
        let area = uu * vv - uv * uv;
        if area <= 0.0 {
            continue;
        }
        for &corner in corners {
            // The tangent as a sum of both edges.
            let tangent = rest.tangents[corner as usize].truncate().as_dvec3();
            let (along_u, along_v) = (tangent.dot(u), tangent.dot(v));
            let (a, b) = ((along_u * vv - along_v * uv) / area, (along_v * uu - along_u * uv) / area);
            carried[corner as usize] += (to_u * a + to_v * b) * area.sqrt();
        }
    }
    for (tangent, carried) in mesh.tangents.iter_mut().zip(carried) {
        if let Some(unit) = carried.try_normalize() {
            *tangent = unit.as_vec3().extend(tangent.w);
        }
    }
}

impl Target {
    /// The offsets of these vertices.
    #[must_use]
    pub fn of(&self, vertices: impl Iterator<Item = usize> + Clone) -> Self {
        let pick = |offsets: &[Vec3]| vertices.clone().filter_map(|i| offsets.get(i).copied()).collect();
        Self { positions: pick(&self.positions), normals: pick(&self.normals) }
    }
}

impl Influences {
    /// The influences of these vertices.
    #[must_use]
    pub fn of(&self, vertices: impl Iterator<Item = usize> + Clone) -> Self {
        let (joints, weights) = vertices
            .flat_map(|i| i * self.per_vertex..(i + 1) * self.per_vertex)
            .map(|i| (self.joints[i], self.weights[i]))
            .unzip();
        Self { per_vertex: self.per_vertex, joints, weights }
    }

    /// Weighted mean of the matrices of a vertex; `None` if nothing carries it.
    fn carrier(&self, vertex: usize, matrices: &[DAffine3]) -> Option<DAffine3> {
        let range = vertex * self.per_vertex..(vertex + 1) * self.per_vertex;
        let mut sum = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
        let mut total = 0.0;
        for (&joint, &weight) in self.joints.get(range.clone())?.iter().zip(self.weights.get(range)?) {
            if let Some(matrix) = matrices.get(usize::from(joint)).filter(|_| weight > 0.0) {
                let weight = f64::from(weight);
                sum.matrix3 += matrix.matrix3 * weight;
                sum.translation += matrix.translation * weight;
                total += weight;
            }
        }
        (total > 0.0 && total.is_finite())
            .then(|| DAffine3 { matrix3: sum.matrix3 * (1.0 / total), translation: sum.translation / total })
    }
}

fn add(values: &mut [Vec3], offsets: &[Vec3], weight: f32) {
    for (value, &offset) in values.iter_mut().zip(offsets) {
        *value += offset * weight;
    }
}

/// A normal carried along: cofactors are the inverse transpose times the determinant, and exist for flat
/// matrices too.
fn turned(matrix: &DMat3, normal: Vec3) -> Vec3 {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let turned = cofactors * normal.as_dvec3() * matrix.determinant().signum();
    turned.normalize_or_zero().as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> Deform {
        let rest = TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0],
            normals: vec![Vec3::Z; 3],
            triangles: vec![[0, 1, 2]],
            ..TriangleMesh::default()
        };
        Deform { rest: Arc::new(rest), targets: Vec::new(), weights: None, skin: None }
    }

    #[test]
    fn targets_add_up_by_weight() {
        let target = |offset: Vec3| Target { positions: vec![offset; 3], normals: Vec::new() };
        let deform = Deform { targets: vec![target(Vec3::Y), target(Vec3::Z)], ..line() };
        assert_eq!(deform.shape(&[0.5, -2.0], None).positions[1], Vec3::new(1.0, 0.5, -2.0));
        assert_eq!(deform.shape(&[], None), *deform.rest);
    }

    #[test]
    fn a_vertex_between_two_joints_goes_half_way_with_each() {
        let influences = Influences {
            per_vertex: 2,
            joints: vec![0, 1, 0, 1, 0, 9],
            weights: vec![1.0, 0.0, 1.0, 1.0, 0.0, 1.0],
        };
        let skin = Skin { joints: Vec::new(), influences, space: Entity::PLACEHOLDER };
        let deform = Deform { skin: Some(skin), ..line() };
        let turn = DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let matrices = [turn, turn * DAffine3::from_translation(DVec3::Y * 2.0)];
        let shape = deform.shape(&[], Some(&matrices));
        // Half of y turned to z; a joint that is not there carries nothing.
        assert!((shape.positions[1] - Vec3::new(1.0, 0.0, 1.0)).length() < 1e-6, "{}", shape.positions[1]);
        assert!((shape.normals[1] - Vec3::NEG_Y).length() < 1e-6);
        assert_eq!((shape.positions[2], shape.normals[2]), (Vec3::X * 2.0, Vec3::Z));
    }

    /// A triangle with tangents along +X.
    fn brushed() -> TriangleMesh {
        TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            tangents: vec![Vec3::X.extend(1.0); 3],
            triangles: vec![[0, 1, 2]],
            ..TriangleMesh::default()
        }
    }

    #[test]
    fn tangents_turn_once_with_their_joint() {
        let influences = Influences { per_vertex: 1, joints: vec![0; 3], weights: vec![1.0; 3] };
        let skin = Skin { joints: Vec::new(), influences, space: Entity::PLACEHOLDER };
        let deform = Deform { rest: Arc::new(brushed()), skin: Some(skin), ..line() };
        let turn = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let shape = deform.shape(&[], Some(&[turn]));
        assert!((shape.tangents[1] - Vec3::Y.extend(1.0)).length() < 1e-6, "{}", shape.tangents[1]);
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let shape = deform.shape(&[], Some(&[mirror]));
        assert_eq!(shape.tangents[1], Vec3::NEG_X.extend(-1.0));
    }

    #[test]
    fn tangents_go_with_the_shape_of_a_target() {
        // Half a turn about +Z.
        let positions = brushed().positions.iter().map(|p| -2.0 * *p).collect();
        let turned = Target { positions, normals: Vec::new() };
        let deform = Deform { rest: Arc::new(brushed()), targets: vec![turned], ..line() };
        let shape = deform.shape(&[1.0], None);
        assert_eq!(shape.positions[1], Vec3::NEG_X);
        assert!((shape.tangents[2] - Vec3::NEG_X.extend(1.0)).length() < 1e-6, "{}", shape.tangents[2]);
    }
}
