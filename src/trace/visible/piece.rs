//! Convex polygons as seen from a point: cut by planes, and Lambert's closed form.

use crate::trace::blocker::EDGES;
use crate::trace::quad::angle_over_sine;
use glam::Vec3;

/// Most corners of a piece: four, and at most one more for each plane that cut it: two horizons and those of one blocker.
const CORNERS: usize = 6 + EDGES;

/// A convex polygon as seen from a point, by its corners relative to it.
#[derive(Clone, Copy)]
pub(super) struct Piece {
    pub(super) corners: [Vec3; CORNERS],
    pub(super) count: usize,
}

impl Piece {
    pub(super) const EMPTY: Self = Self { corners: [Vec3::ZERO; CORNERS], count: 0 };

    /// Whether no corner is inside.
    #[inline]
    pub(super) fn is_outside(&self, plane: Vec3) -> bool {
        self.corners[..self.count].iter().all(|p| plane.dot(*p) <= 0.0)
    }

    /// Whether all corners are inside.
    #[inline]
    pub(super) fn is_inside(&self, plane: Vec3) -> bool {
        self.corners[..self.count].iter().all(|p| plane.dot(*p) > 0.0)
    }

    /// What is on the side to which `plane`, a normal, points.
    #[inline]
    pub(super) fn inside(&self, plane: Vec3) -> Self {
        let (mut inside, mut outside) = (Self::EMPTY, Self::EMPTY);
        self.split(plane, &mut inside, &mut outside);
        inside
    }

    /// Adds what is on the side to which `plane`, a normal, points, and what is on the other, to two empty pieces. They
    /// have the corners in the plane in common.
    ///
    /// Reference: I. E. Sutherland, G. W. Hodgman, "Reentrant Polygon Clipping", CACM 17(1), 1974.
    #[inline]
    pub(super) fn split(&self, plane: Vec3, inside: &mut Self, outside: &mut Self) {
        let Some(&last) = self.corners[..self.count].last() else { return };
        let mut before = last;
        let mut height_before = plane.dot(before);
        for &here in &self.corners[..self.count] {
            let height = plane.dot(here);
            if (height > 0.0) != (height_before > 0.0) {
                let crossing = before + (here - before) * (height_before / (height_before - height));
                inside.push(crossing);
                outside.push(crossing);
            }
            if height > 0.0 {
                inside.push(here);
            } else {
                outside.push(here);
            }
            (before, height_before) = (here, height);
        }
    }

    /// Perhaps too many corners for it.
    #[inline]
    pub(super) fn is_full(&self) -> bool {
        self.count == CORNERS
    }

    fn push(&mut self, corner: Vec3) {
        if self.count < CORNERS {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    /// By the sum over its edges; its sign is that of the corners' sense of rotation.
    #[inline]
    pub(super) fn irradiance(&self, normal: Vec3) -> f32 {
        let corners = &self.corners[..self.count];
        let Some(&(mut before)) = corners.last() else { return 0.0 };
        let mut length_before = before.length();
        let mut sum = 0.0;
        for &here in corners {
            let length = here.length();
            let scale = 1.0 / (length_before * length);
            let cross = before.cross(here - before);
            sum += normal.dot(cross) * scale * angle_over_sine(before.dot(here) * scale);
            (before, length_before) = (here, length);
        }
        0.5 * sum
    }
}
