//! Meshes → bottom levels of the hierarchy: kept, refitted or built.

use super::Redone;
use crate::bvh::Blas;
use crate::scene::Mesh;
use bevy_ecs::prelude::*;
use glam::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;
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
    let made: Vec<(Entity, u64, Done)> = changed
        .into_par_iter()
        .map(|(entity, mesh, old)| {
            let numbers = (0..mesh.0.triangles.len()).into_par_iter().with_min_len(1 << 14);
            let triangles: Vec<[Vec3; 3]> = numbers.map(|i| mesh.0.corners(i)).collect();
            let key = fingerprint(&triangles);
            let known = cache.0.get(&key).and_then(Weak::upgrade);
            let done = if let Some(known) = known.filter(|known| known.is_over(&triangles)) {
                Done::Kept(known)
            } else if let Some(refitted) = old.and_then(|MeshBlas(old)| old.refit(&triangles)) {
                Done::Refitted(refitted)
            } else {
                Done::Built(Blas::build(&triangles))
            };
            (entity, key, done)
        })
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
    cache.0.retain(|_, blas| blas.strong_count() > 0);
    for entity in removed.read() {
        if let Ok(mut entity) = commands.get_entity(entity) {
            entity.remove::<MeshBlas>();
        }
    }
}

/// The same for equal triangles, hardly ever for others: made of their number and some thousand of them.
fn fingerprint(triangles: &[[Vec3; 3]]) -> u64 {
    let step = (triangles.len() / 4096).max(1);
    let corners = triangles.iter().step_by(step).flatten().flat_map(Vec3::to_array);
    corners.fold(triangles.len() as u64, |key, x| {
        (key ^ u64::from(x.to_bits())).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
    })
}
