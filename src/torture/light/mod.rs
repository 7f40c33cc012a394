//! L, S and H: light, samples and shading.

use super::Case;

/// The cases of this room.
pub(super) const CASES: &[Case] = &[];
