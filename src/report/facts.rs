//! What a scene is: its size in triangles, levels and bytes, and how long it takes until it shows.

use crate::app::App;
use crate::bvh::wide::{Child, WIDTH};
use crate::bvh::{Blas, Placement, Tlas, WideBvh};
use crate::trace::Geometry;
use glam::Vec3;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;

/// What a scene is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Facts {
    /// Triangles of all instances.
    pub triangles: usize,
    /// Levels of nodes over the instances.
    pub top_levels: usize,
    /// Levels of nodes in the deepest mesh.
    pub mesh_levels: usize,
    /// Most entries of a leaf.
    pub largest_leaf: usize,
    /// Building all hierarchies, the fastest of three times.
    pub build_ms: f64,
    /// Bytes of all hierarchies, triangles included.
    pub hierarchy_bytes: usize,
    /// From opening the file to one sample in each pixel.
    pub seconds_to_first_picture: f64,
}

/// Builds are repeated so often, but not if one takes longer than [`LONG_BUILD_MS`].
const BUILDS: usize = 3;
const LONG_BUILD_MS: f64 = 500.0;

impl Facts {
    /// Of a built world.
    #[must_use]
    pub fn of(app: &App, seconds_to_first_picture: f64) -> Self {
        let geometry = app.world.resource::<Geometry>();
        let blas = distinct(&geometry.tlas);
        let (mesh_levels, largest_leaf) =
            blas.iter().map(|b| shape(b.hierarchy())).fold((0, 0), |a, b| (a.0.max(b.0), a.1.max(b.1)));
        Self {
            triangles: geometry.instances.iter().map(|i| i.mesh.triangles.len()).sum(),
            top_levels: shape(geometry.tlas.hierarchy()).0,
            mesh_levels,
            largest_leaf,
            build_ms: build_ms(geometry),
            hierarchy_bytes: geometry.tlas.hierarchy().bytes()
                + blas.iter().map(|b| b.bytes()).sum::<usize>(),
            seconds_to_first_picture,
        }
    }
}

/// Each mesh's hierarchy once.
fn distinct(tlas: &Tlas) -> Vec<&Arc<Blas>> {
    let mut all: Vec<&Arc<Blas>> = tlas.placements().iter().map(Placement::blas).collect();
    all.sort_by_key(|blas| Arc::as_ptr(blas));
    all.dedup_by_key(|blas| Arc::as_ptr(blas));
    all
}

/// Levels of nodes, and the most entries of a leaf.
fn shape(hierarchy: &WideBvh) -> (usize, usize) {
    let (mut levels, mut largest) = (0, 0);
    let mut waiting = if hierarchy.nodes.is_empty() { Vec::new() } else { vec![(0, 1)] };
    while let Some((index, level)) = waiting.pop() {
        levels = levels.max(level);
        let node = &hierarchy.nodes[index];
        for slot in (0..WIDTH).filter(|&slot| !node.child_bounds(slot).is_empty()) {
            match Child::unpack(node.children[slot]) {
                Child::Node(child) => waiting.push((child, level + 1)),
                Child::Leaf { count, .. } => largest = largest.max(count),
            }
        }
    }
    (levels, largest)
}

fn build_ms(geometry: &Geometry) -> f64 {
    let mut meshes: Vec<_> = geometry.instances.iter().map(|i| &i.mesh).collect();
    meshes.sort_by_key(|mesh| Arc::as_ptr(mesh));
    meshes.dedup_by_key(|mesh| Arc::as_ptr(mesh));
    let corners: Vec<Vec<[Vec3; 3]>> =
        meshes.iter().map(|mesh| (0..mesh.triangles.len()).map(|i| mesh.corners(i)).collect()).collect();
    let mut best = f64::INFINITY;
    for _ in 0..BUILDS {
        let placements = geometry.tlas.placements().to_vec();
        let start = Instant::now();
        let built: Vec<Blas> = corners.iter().map(|triangles| Blas::build(triangles)).collect();
        let top = Tlas::build(placements);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        // Kept until here, so that freeing is not timed.
        drop((built, top));
        best = best.min(ms);
        if ms > LONG_BUILD_MS {
            break;
        }
    }
    best
}
