//! Triangle meshes and their instances.

use bevy_ecs::prelude::*;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::sync::Arc;

/// A mesh asset: its own entity, shared by any number of [`Instance`]s.
///
/// Replace the `Arc` (or `Arc::make_mut` it) to edit; `Changed<Mesh>` rebuilds just its own BLAS.
#[derive(Component, Clone, Debug)]
pub struct Mesh(pub Arc<TriangleMesh>);

/// Indexed triangles in local space. Counter-clockwise is the front.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions; every one that a triangle uses is finite.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals: one a vertex, or empty for flat shading.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, origin at the top left (glTF): one a vertex, or empty.
    pub uvs: Vec<Vec2>,
    /// A second set of them, for textures that say so: one a vertex, or empty.
    pub second_uvs: Vec<Vec2>,
    /// Unit direction of growing u for normal maps, and in w the side of the bitangent w · (normal × tangent):
    /// one a vertex, zero where there is none; or empty.
    pub tangents: Vec<Vec4>,
    /// Linear RGBA factors on the base colour: one a vertex, or empty.
    pub colors: Vec<Vec4>,
    /// Vertex indices, each below `positions.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle the index into [`Instance::materials`]; empty means all 0.
    pub slots: Vec<u16>,
}

impl TriangleMesh {
    /// Which of the instance's materials `triangle` wears.
    #[inline]
    #[must_use]
    pub fn slot(&self, triangle: usize) -> usize {
        self.slots.get(triangle).map_or(0, |&slot| usize::from(slot))
    }

    /// The three corners of `triangle` in local space.
    #[inline]
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        let [a, b, c] = self.triangles[triangle];
        [self.positions[a as usize], self.positions[b as usize], self.positions[c as usize]]
    }

    /// Adds a vertex that is in everything like `vertex`; returns its index.
    pub fn duplicate(&mut self, vertex: u32) -> u32 {
        fn again<T: Copy>(attribute: &mut Vec<T>, vertex: u32) {
            if let Some(&value) = attribute.get(vertex as usize) {
                attribute.push(value);
            }
        }
        again(&mut self.positions, vertex);
        again(&mut self.normals, vertex);
        again(&mut self.uvs, vertex);
        again(&mut self.second_uvs, vertex);
        again(&mut self.tangents, vertex);
        again(&mut self.colors, vertex);
        self.positions.len() as u32 - 1
    }

    /// Drops triangles with no area or with a corner that is not finite; returns how many.
    ///
    /// The area is judged in double precision after scaling, so that tiny triangles stay.
    pub fn drop_degenerate(&mut self) -> usize {
        let keep: Vec<bool> = (0..self.triangles.len())
            .into_par_iter()
            .with_min_len(1 << 14)
            .map(|i| {
                let [a, b, c] = self.corners(i).map(Vec3::as_dvec3);
                let normal = (b - a).cross(c - a);
                normal.is_finite() && normal.length_squared() > 0.0
            })
            .collect();
        let dropped = keep.iter().filter(|&&k| !k).count();
        if dropped > 0 {
            let mut kept = keep.iter();
            self.triangles.retain(|_| kept.next().copied().unwrap_or(true));
            let mut kept = keep.iter();
            self.slots.retain(|_| kept.next().copied().unwrap_or(true));
        }
        dropped
    }
}

/// One placed use of a mesh. Both references are to entities, so an edit shows up as a change there.
#[derive(Component, Clone, Debug, PartialEq)]
#[require(super::Transform)]
pub struct Instance {
    /// Entity with a [`Mesh`]. If it is gone, so is the instance from the picture.
    pub mesh: Entity,
    /// Entities with a [`super::Material`], by slot. A missing one shows as the default material.
    pub materials: Vec<Entity>,
}
