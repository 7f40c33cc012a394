//! What tests of geometry share: the program's own oracles, and some of its ways to ask.
#![allow(dead_code, unused_imports, reason = "each test file uses its part")]

pub mod scenes;

pub use penumbra::torture::geometry::brute::aimed_ray;
pub use penumbra::torture::geometry::meshes::{bumpy_sphere, soup};
pub use penumbra::torture::oracle::{
    Balls, Rng, brute_force, brute_force_in, check, check_hierarchy, inside, is_closed,
};

#[path = "mod.rs"]
mod support;

pub use support::shared;

use glam::{DAffine3, Vec3};
use penumbra::bvh::{Aabb, Blas, Hit, Placement, Ray};
use std::sync::Arc;

pub fn boxes(triangles: &[[Vec3; 3]]) -> Vec<Aabb> {
    triangles.iter().map(|t| Aabb::around(t)).collect()
}

/// What one kernel says of rays: one by one and together, which must be the same.
pub fn ask(name: &str, blas: &Blas, rays: &[Ray]) -> Vec<Option<Hit>> {
    let answers = penumbra::torture::oracle::ask(blas, rays);
    assert_eq!(answers.wrong(&answers.hits), 0, "{name}: alone or any-hit");
    answers.hits
}

pub fn place(triangles: &[[Vec3; 3]], world_from_local: DAffine3) -> Placement {
    Placement::new(Arc::new(Blas::build(triangles)), world_from_local).unwrap()
}

/// Whether to take the time for the full counts.
pub fn long() -> bool {
    std::env::var_os("PENUMBRA_LONG").is_some()
}
