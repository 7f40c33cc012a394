//! Meshes → bottom levels of the hierarchy: kept, refitted or built.

use super::Redone;
use crate::bvh::Blas;
use crate::scene::{Mesh, TriangleMesh};
use bevy_ecs::prelude::*;
use glam::Vec3;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Weak};

/// The bottom-level hierarchy of a [`Mesh`], on its entity; derived by [`build_blas`].
#[derive(Component, Clone, Debug)]
pub struct MeshBlas(pub Arc<Blas>);

/// All hierarchies in use, so that the same triangles (of a file that is loaded again, or of meshes that are
/// equal) are not built over twice.
#[derive(Resource, Clone, Debug, Default)]
pub struct BlasCache(HashMap<u64, Weak<Blas>>);

/// What became of a mesh.
enum Done {
    Kept(Arc<Blas>),
    Refitted(Blas),
    Built(Blas),
}

/// Finds, refits or builds the BLAS of each new or changed mesh.
pub fn build_blas(
    mut commands: Commands,
    mut redone: ResMut<Redone>,
    mut cache: ResMut<BlasCache>,
    changed: Query<(Entity, &Mesh, Option<&MeshBlas>), Changed<Mesh>>,
    mut removed: RemovedComponents<Mesh>,
) {
    let changed: Vec<_> = changed.iter().collect();
    let key = |&(_, mesh, _): &(Entity, &Mesh, Option<&MeshBlas>)| fingerprint(&mesh.0);
    let keys: Vec<u64> = changed.par_iter().map(key).collect();
    let mut seen = HashSet::new();
    let is_first: Vec<bool> = keys.iter().map(|&key| seen.insert(key)).collect();
    // What is equal to another finds that one's.
    for firsts in [true, false] {
        let all = changed.par_iter().zip(&keys).zip(&is_first);
        let made: Vec<(Entity, u64, Done)> = all
            .filter(|(_, is_first)| **is_first == firsts)
            .map(|((&(entity, mesh, old), &key), _)| (entity, key, find(&cache, key, &mesh.0, old)))
            .collect();
        for (entity, key, done) in made {
            redone.refits += u64::from(matches!(done, Done::Refitted(_)));
            redone.blas += u64::from(!matches!(done, Done::Kept(_)));
            let blas = match done {
                Done::Kept(blas) => blas,
                Done::Refitted(blas) | Done::Built(blas) => Arc::new(blas),
            };
            cache.0.insert(key, Arc::downgrade(&blas));
            commands.entity(entity).insert(MeshBlas(blas));
        }
    }
    cache.0.retain(|_, blas| blas.strong_count() > 0);
    for entity in removed.read() {
        if let Ok(mut entity) = commands.get_entity(entity) {
            entity.remove::<MeshBlas>();
        }
    }
}

/// The hierarchy of a mesh that had the `old` one.
fn find(cache: &BlasCache, key: u64, mesh: &TriangleMesh, old: Option<&MeshBlas>) -> Done {
    let numbers = (0..mesh.triangles.len()).into_par_iter().with_min_len(1 << 14);
    let triangles: Vec<[Vec3; 3]> = numbers.map(|i| mesh.corners(i)).collect();
    let known = cache.0.get(&key).and_then(Weak::upgrade);
    if let Some(known) = known.filter(|known| known.is_over(&triangles)) {
        Done::Kept(known)
    } else if let Some(refitted) = old.and_then(|MeshBlas(old)| old.refit(&triangles)) {
        Done::Refitted(refitted)
    } else {
        Done::Built(Blas::build(&triangles))
    }
}

/// The same for equal triangles, hardly ever for others: made of their number and some thousand of them.
fn fingerprint(mesh: &TriangleMesh) -> u64 {
    let count = mesh.triangles.len();
    let some = (0..count).step_by((count / 4096).max(1));
    let corners = some.flat_map(|i| mesh.corners(i)).flat_map(|p| p.to_array());
    corners.fold(count as u64, |key, x| {
        (key ^ u64::from(x.to_bits())).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
    })
}
