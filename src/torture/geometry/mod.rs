//! G and C: rays against triangles, and cameras.
//!
//! Checkers take whatever answers rays, so that others can be tried in our place: `benches/peers` does, and
//! `tests/torture.rs` puts saboteurs there.

pub mod alone;
pub mod batches;
pub mod brute;
pub mod camera;
pub mod counts;
pub mod dark;
pub mod degenerate;
pub mod exact;
pub mod far;
pub mod instances;
pub mod leaks;
pub mod leave;
pub mod meshes;
mod show;
pub mod stage;
pub mod ties;
pub mod worst;
pub mod zero;

use super::Case;
use crate::load::Made;

/// What can be looked at.
pub(super) const SHOWS: &[Made] = show::SHOWS;

/// The cases of this room.
pub(super) const CASES: &[Case] = &[
    leaks::CASE,
    exact::CASE,
    zero::CASE,
    brute::CASE,
    leave::SELF,
    leave::GAP,
    dark::ROOM,
    dark::SHADOW,
    far::CASE,
    degenerate::CASE,
    ties::CASE,
    worst::CASE,
    instances::CASE,
    camera::RAYS,
    camera::PLACES,
    counts::COUNTS,
    counts::EXTENT,
];
