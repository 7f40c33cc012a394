//! How well lights are sampled, to be switched off where it is measured what that brings.

/// What goes into the choice of a light and of a place on it. Without any of it places are even by area and lights even by
/// number; all give the same picture in the end, and differ in how soon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightSampling {
    /// Places on a parallelogram by nearly what they bring ([`super::quad::Brightness`]).
    pub product: bool,
    /// Places on balls, and on what is near, evenly by solid angle ([`super::spherical`]).
    pub solid_angle: bool,
    /// One among many lights, or triangles of one, by what it may bring ([`super::light_tree`]).
    pub tree: bool,
}

impl LightSampling {
    /// All of it, as always but in comparisons.
    pub const BEST: Self = Self { product: true, solid_angle: true, tree: true };
    /// Nothing of it: evenly by area.
    pub const PLAIN: Self = Self { product: false, solid_angle: false, tree: false };
}

impl Default for LightSampling {
    fn default() -> Self {
        Self::BEST
    }
}
