//! G and C: rays against triangles, and cameras.

use super::Case;

/// The cases of this room.
pub(super) const CASES: &[Case] = &[];
