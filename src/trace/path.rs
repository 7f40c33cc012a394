//! A path of light under way, followed from the eye, and which random numbers it uses where.

use super::connect::passed;
use super::emitter::Receiver;
use super::sampler::Sampler;
use super::scene::Surface;
use super::surface::Interaction;
use crate::bvh::Ray;
use glam::Vec3;

/// One path under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    /// Which entry of the batch it adds to.
    pub(super) entry: u32,
    pub(super) sampler: Sampler,
    pub(super) ray: Ray,
    /// What light at the ray's end is worth at the eye.
    pub(super) throughput: Vec3,
    pub(super) depth: u32,
    /// How the last bounce chose the ray's direction; `None`: no light sample could have found it.
    pub(super) bounce: Option<Bounce>,
    /// Only collects what shines at its end.
    pub(super) last: bool,
    /// Absorption coefficient of the body that the ray crosses; zero outside.
    pub(super) absorption: Vec3,
}

impl Path {
    /// What absorbs beyond a vertex.
    #[inline]
    pub(super) fn absorption_toward(&self, surface: &Surface, at: &Interaction, wi: Vec3) -> Vec3 {
        match surface.body() {
            Some(body) if at.geometric_normal.dot(wi) < 0.0 => {
                if at.front {
                    body.absorption
                } else {
                    Vec3::ZERO
                }
            }
            _ => self.absorption,
        }
    }

    /// With what is left where its ray has come to `t`.
    #[inline]
    pub(super) fn after(mut self, t: f32) -> Self {
        if self.absorption != Vec3::ZERO {
            self.throughput *= passed(self.absorption, t * self.ray.direction.length());
        }
        self
    }
}

/// The smooth bounce that a ray comes from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounce {
    pub(super) pdf: f32,
    /// The very one for which lights were chosen: where it is they may be as likely by a factor of a hundred.
    pub(super) from: Receiver,
    /// Lights that have been counted in full where it comes from, a bit for each.
    pub(super) counted: u32,
}

/// Dimensions of the sampler: pair 0 is the place in the pixel, 1 that on the lens; a bounce has this many pairs
/// from 1 on, of which it does not use the first.
pub(super) const PAIRS_PER_BOUNCE: u32 = 32;
pub(super) const LOBE: u32 = 1;
pub(super) const DIRECTION: u32 = 2;
pub(super) const PICK: u32 = 3;
pub(super) const LIGHT: u32 = 4;
/// From this depth on a path may end by chance.
pub(super) const ROULETTE_DEPTH: u32 = 4;
