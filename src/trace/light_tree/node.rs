//! Nodes of a [`super::LightTree`], and what they look like from a point.

use crate::trace::emitter::{Emitter, Receiver};
use glam::Vec3;
use std::ops::Range;

/// What the way down needs of emitters together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Node {
    /// Of the ball around their box.
    center: Vec3,
    radius: f32,
    axis: Vec3,
    cos_spread: f32,
    sin_spread: f32,
    intensity: f32,
    /// First of two children.
    pub(super) child: u32,
    /// Its emitters' places in the order of the tree; a leaf has one.
    pub(super) first: u32,
    pub(super) count: u32,
    /// They shine to the same sides, more or less.
    alike: bool,
}

/// Nodes of emitters that are alike, farther than so many times the radius of their ball and as far above the horizon, are not
/// looked into: among those their intensity decides.
const FAR: f32 = 6.0;
/// A node as seen from a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prospect {
    /// What it could bring if nothing is in between; by bounds of angles, but the distance of its middle.
    pub(super) importance: f32,
    pub(super) is_far: bool,
}

impl Node {
    pub(super) fn new(all: &Emitter, alike: bool, child: usize, places: Range<usize>) -> Self {
        let half = (all.bounds.max - all.bounds.min) * 0.5;
        let (sin_spread, cos_spread) = all.spread.sin_cos();
        Self {
            center: all.bounds.center(),
            radius: half.length(),
            axis: all.axis,
            cos_spread,
            sin_spread,
            intensity: all.intensity,
            child: child as u32,
            first: places.start as u32,
            count: places.len() as u32,
            alike: alike && all.intensity > 0.0,
        }
    }

    /// Without branches: which way they go nobody can foresee.
    #[inline(always)]
    pub(super) fn from(&self, to: &Receiver) -> Prospect {
        let select = |which: bool, yes: f32, no: f32| if which { yes } else { no };
        let along = self.center - to.point;
        let distance2 = along.length_squared();
        let radius2 = self.radius * self.radius;
        // From inside of the ball around them, they may be anywhere.
        let is_outside = distance2 > radius2;
        let inverse = 1.0 / distance2.max(radius2).max(f32::MIN_POSITIVE);
        let clear = (distance2 - radius2).max(0.0).sqrt();
        // Sines and cosines times the distance: of the angles to the middle, and then of those less the ball's angle, if they are
        // larger.
        let sine = |cosine: f32| (distance2 - cosine * cosine).max(0.0).sqrt();
        let nearest = |sine: f32, cosine: f32| {
            let is_beyond = is_outside & (sine * clear > cosine * self.radius);
            select(is_beyond, (cosine * clear + sine * self.radius) * inverse, 1.0)
        };
        let height = to.normal.dot(along);
        let arrives = nearest(sine(height), height);
        let front = -self.axis.dot(along);
        let side = sine(front);
        let beyond = side * self.cos_spread - front * self.sin_spread;
        let leaves = nearest(beyond, front * self.cos_spread + side * self.sin_spread);
        let leaves = select(beyond > 0.0, leaves, 1.0);
        // Never quite dark: what shines through a surface arrives from behind, and rounding must not decide.
        let importance = self.intensity * leaves.max(0.01) * arrives.max(0.05) * inverse;
        let far = FAR * self.radius;
        let is_far = self.alike & (height > far) & ((front > far) | (self.axis == Vec3::ZERO));
        Prospect { importance, is_far }
    }
}
