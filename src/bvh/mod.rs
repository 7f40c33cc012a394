//! How a ray finds what it hits: geometry only. Knows no material, light or entity.
//!
//! Two levels of pointer-free bounding volume hierarchies: a [`Blas`] over the triangles of each
//! mesh, a [`Tlas`] over their placed instances. Watertight, without an absolute epsilon: the
//! bounds of all rounding errors follow from the ray and the size of what it is tested against.

pub mod aabb;
mod batch;
pub mod blas;
mod braid;
pub mod build;
mod filter;
mod found;
pub mod inspect;
mod leaves;
mod merge;
mod packet;
pub mod probe;
pub mod ray;
mod refit;
mod rows;
pub mod shaft;
pub mod simd;
mod single;
pub mod tlas;
mod together;
pub mod traverse;
pub mod triangle;
mod walk;
pub mod wide;

pub use aabb::Aabb;
pub use blas::Blas;
pub use braid::Entry;
pub use build::{Bvh, Defect, MOST_TRIANGLES, Node};
pub use filter::Accept;
pub use probe::Probe;
pub use ray::{Hit, Ray};
pub use shaft::Shaft;
pub use simd::Isa;
pub use tlas::{Placement, Tlas};
pub use wide::WideBvh;
