//! L, S and H: light, samples and shading.
//!
//! What judges is apart from what is judged: a list of [`spot::Spot`]s is measured by a [`meter::Meter`], sums by any
//! [`sums::Accumulator`], numbers by any function of bits. So a test can put something wrong in the renderer's place.

pub mod chi_square;
pub mod kinds;
pub mod lamps;
pub mod meter;
pub mod numbers;
pub mod oracle;
pub mod pictures;
pub mod remedies;
pub mod rooms;
pub mod shading;
pub mod shadows;
pub mod slopes;
pub mod spot;
pub mod sums;
pub mod surfaces;
pub mod terminator;
pub mod textures;
pub mod transport;

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
    rooms::L12,
    rooms::L13,
    remedies::L14,
    remedies::L15,
    remedies::L16,
    numbers::S1,
    numbers::S2,
    numbers::S3,
    numbers::S4,
    sums::S5,
    pictures::S6,
    pictures::S7,
    sums::S8,
    pictures::S9,
    sums::S10,
    slopes::S11,
    slopes::S12,
    terminator::H1,
    shading::H2,
    surfaces::H3,
    shading::H4,
    textures::H5,
    textures::H6,
    transport::H7,
    transport::H8,
    transport::H9,
    surfaces::H10,
    surfaces::H11,
    textures::H12,
];
