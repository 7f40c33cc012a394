//! L, S and H: light, samples and shading.

mod lamps;
pub mod meter;
pub mod oracle;
mod shadows;
pub mod spot;

pub use lamps::{
    balls, cut_by_the_horizon, edge_on, far, huge, inside_a_ball, line, lines, quads, touching_the_floor,
    triangles,
};
pub use shadows::{penumbra, shadows_of_a_line};

use super::Case;

/// The cases of this room.
pub(super) const CASES: &[Case] = &[
    lamps::L1,
    lamps::L2,
    lamps::L3,
    lamps::L4,
    lamps::L5,
    lamps::L6,
    lamps::L7,
    lamps::L8,
    lamps::L9,
    lamps::L10,
    shadows::L11,
    shadows::L11B,
    shadows::L11C,
];
