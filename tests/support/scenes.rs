//! Geometry of files, without all the rest.

use bevy_ecs::prelude::*;
use glam::{DAffine3, Vec3};
use penumbra::load::{LoadOptions, SceneSource, load};
use penumbra::scene::{GlobalTransform, Instance, Mesh, TriangleMesh};
use std::path::Path;
use std::sync::Arc;

/// The meshes of a file, each as often as it is placed.
pub fn placed_meshes(file: &Path) -> Vec<(Arc<TriangleMesh>, DAffine3)> {
    let mut world = World::new();
    load(&mut world, &SceneSource::File(file.to_path_buf()), &LoadOptions::default()).unwrap();
    let mut query = world.query::<(Entity, &Instance, &GlobalTransform)>();
    let mut instances: Vec<_> = query.iter(&world).map(|(e, i, t)| (e, i.mesh, t.0)).collect();
    instances.sort_unstable_by_key(|&(entity, ..)| entity);
    instances.into_iter().map(|(_, mesh, t)| (Arc::clone(&world.get::<Mesh>(mesh).unwrap().0), t)).collect()
}

/// All triangles of a file where they are placed.
pub fn triangles(file: &Path) -> Vec<[Vec3; 3]> {
    let corners = |(mesh, place): (Arc<TriangleMesh>, DAffine3)| {
        let placed = move |p: Vec3| place.transform_point3(p.as_dvec3()).as_vec3();
        (0..mesh.triangles.len()).map(|i| mesh.corners(i).map(placed)).collect::<Vec<_>>()
    };
    placed_meshes(file).into_iter().flat_map(corners).collect()
}
