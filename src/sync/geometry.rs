//! Instances → the top level of the hierarchy.

use super::{Entities, Instructions, MaterialNumbers, MeshBlas, Redone, RenderOrigin};
use crate::bvh::{Blas, Placement, Tlas};
use crate::scene::{GlobalTransform, Hidden, Instance, Mesh, TriangleMesh};
use crate::trace::Geometry;
use crate::trace::scene::InstanceData;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use std::cmp::Reverse;
use std::sync::Arc;

/// Picks [`RenderOrigin`] when the first geometry is there: where the largest instance is of those that are neither turned nor scaled
/// (or of all), which so needs no placement; from there, where the scene's middle is farther than its extent, in steps of a
/// power of two towards it. So a scene around the origin stays where it is, and one that is moved as a whole has the same
/// coordinates again, to the bit.
pub fn choose_origin(
    mut origin: ResMut<RenderOrigin>,
    instances: Query<(Entity, &Instance, &GlobalTransform)>,
    meshes: Query<&MeshBlas>,
) {
    if origin.0.is_some() || instances.is_empty() {
        return;
    }
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut largest: Option<((bool, f64, Reverse<u32>), DVec3)> = None;
    for (entity, instance, global) in &instances {
        let Ok(MeshBlas(blas)) = meshes.get(instance.mesh) else { continue };
        let bounds = blas.bounds();
        if bounds.is_empty() {
            continue;
        }
        let size = global.0.matrix3 * (bounds.max.as_dvec3() - bounds.min.as_dvec3());
        let rank = (global.0.matrix3 == DMat3::IDENTITY, size.length(), Reverse(entity.index_u32()));
        if largest.is_none_or(|(before, _)| rank > before) {
            largest = Some((rank, global.0.translation));
        }
        for corner in [bounds.min, bounds.max] {
            let p = global.0.transform_point3(corner.as_dvec3());
            (low, high) = (low.min(p), high.max(p));
        }
    }
    if low == DVec3::INFINITY {
        return;
    }
    let extent = (high - low).max_element();
    let finite = low.is_finite() && high.is_finite();
    let grid = if extent > 0.0 { extent.log2().ceil().exp2() } else { 1.0 };
    let from = largest.map_or(DVec3::ZERO, |(_, place)| place);
    let steps = ((low + high) * 0.5 - from) / grid;
    origin.0 = Some(if finite { from + steps.trunc() * grid } else { DVec3::ZERO });
}

/// Builds the TLAS anew when an instance came, went, moved or changed its mesh or materials.
#[expect(clippy::too_many_arguments, reason = "everything that the top level is made of")]
pub fn sync_geometry(
    mut geometry: ResMut<Geometry>,
    mut redone: ResMut<Redone>,
    origin: Res<RenderOrigin>,
    numbers: Res<MaterialNumbers>,
    instructions: Res<Instructions>,
    instances: Query<(Entity, &Instance, &GlobalTransform), Without<Hidden>>,
    meshes: Query<(&Mesh, &MeshBlas)>,
    mut entities: ResMut<Entities>,
    changed: (
        Query<(), (With<Instance>, Or<(Changed<Instance>, Changed<GlobalTransform>, Changed<Hidden>)>)>,
        Query<(), Changed<MeshBlas>>,
    ),
    mut removed: (RemovedComponents<Instance>, RemovedComponents<MeshBlas>, RemovedComponents<Hidden>),
) {
    let removed = removed.0.read().count() + removed.1.read().count() + removed.2.read().count();
    let unchanged = changed.0.is_empty() && changed.1.is_empty() && removed == 0;
    // Values of materials don't matter here, only which numbers they have.
    if unchanged && !numbers.is_changed() && !instructions.is_changed() {
        return;
    }
    let mut placed: Vec<_> = instances.iter().collect();
    placed.sort_unstable_by_key(|(entity, ..)| entity.index_u32());
    let (mut placements, mut data) = (Vec::new(), Vec::new());
    entities.instances.clear();
    for (entity, instance, global) in placed {
        let Ok((mesh, MeshBlas(blas))) = meshes.get(instance.mesh) else { continue };
        let render_from_local = origin.render_from(global);
        let there = Placement::new(Arc::clone(blas), render_from_local);
        let flat = || flattened(&mesh.0, render_from_local);
        let there = there.map(|placement| (placement, Arc::clone(&mesh.0))).or_else(flat);
        let Some((placement, mesh)) = there else { continue };
        let normal_matrix = placement.local_from_world().matrix3.transpose();
        entities.instances.push(entity);
        placements.push(placement);
        let materials = instance.materials.iter().map(|&m| numbers.of(m)).collect();
        data.push(InstanceData { mesh, materials, normal_matrix });
    }
    *geometry = Geometry { tlas: Tlas::build(placements).with_isa(instructions.0), instances: data };
    redone.tlas += 1;
}

/// What becomes of a mesh whose placement makes it flat, as a scale of 0 does: no ray can be taken to where it was made, so it is made
/// where it is. `None` if it is nowhere.
fn flattened(mesh: &TriangleMesh, render_from_local: DAffine3) -> Option<(Placement, Arc<TriangleMesh>)> {
    let place = |p: &Vec3| render_from_local.transform_point3(p.as_dvec3()).as_vec3();
    let positions: Vec<Vec3> = mesh.positions.iter().map(place).collect();
    let corners = |[a, b, c]: [u32; 3]| [a, b, c].map(|i| positions[i as usize]);
    let corners: Vec<_> = mesh.triangles.iter().map(|&corner| corners(corner)).collect();
    let placement = Placement::new(Arc::new(Blas::build(&corners)), DAffine3::IDENTITY)?;
    // Normals and tangents have no directions any more.
    let flat = || TriangleMesh {
        positions,
        uvs: mesh.uvs.clone(),
        second_uvs: mesh.second_uvs.clone(),
        colors: mesh.colors.clone(),
        triangles: mesh.triangles.clone(),
        slots: mesh.slots.clone(),
        ..TriangleMesh::default()
    };
    (!placement.blas().bounds().is_empty()).then(|| (placement, Arc::new(flat())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_ecs::system::RunSystemOnce;

    /// The origin of a room whose middle is beside its own origin, and of a ball in it, with many more triangles.
    fn origin(room_at: DVec3) -> DVec3 {
        let mut world = World::new();
        world.init_resource::<RenderOrigin>();
        let triangle = [Vec3::ZERO, Vec3::new(8.0, 4.0, 0.0), Vec3::new(0.0, 4.0, 3.0)];
        for (triangles, turn, at) in [
            (vec![triangle.map(|p| p * 0.1); 50], DMat3::from_rotation_y(1.0), DVec3::new(6.0, 1.0, 1.0)),
            (vec![triangle.map(|p| p * 0.1); 50], DMat3::IDENTITY, DVec3::new(2.0, 1.0, 1.0)),
            (vec![triangle], DMat3::IDENTITY, DVec3::ZERO),
        ] {
            let mesh = world.spawn(MeshBlas(Arc::new(Blas::build(&triangles)))).id();
            let place = DAffine3::from_mat3_translation(turn, at + room_at);
            world.spawn((Instance { mesh, materials: Vec::new() }, GlobalTransform(place)));
        }
        world.run_system_once(choose_origin).unwrap();
        world.resource::<RenderOrigin>().0.unwrap()
    }

    #[test]
    fn what_is_largest_needs_no_placement_and_a_scene_that_is_moved_takes_its_origin_along() {
        assert_eq!(origin(DVec3::ZERO), DVec3::ZERO);
        for far in [DVec3::new(1e6, -3e5, 0.1), DVec3::splat(1e12)] {
            assert_eq!(origin(far), far);
        }
    }
}
