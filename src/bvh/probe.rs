//! A ray made ready for boxes and triangles.

use super::triangle::THIN;
use super::{Aabb, Ray};
use glam::{Vec3, Vec3A};

/// A [`Ray`] prepared for everything inside one bounding box.
///
/// The triangle test decides with a slightly moved ray, and so says where it is hit: all of it rounds, by
/// at most [`SLACK`] of the largest distances involved. The box test must not be stricter, or
/// rays slip through between boxes; so it starts from an origin moved outward by that bound, taken
/// over the whole bounding box once per ray (it costs nothing per node).
///
/// Reference: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013,
/// sections 3.1 to 3.3.
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    /// That of the largest direction component; space is sheared along it.
    pub(super) axis: usize,
    /// The origin's components in the order of [`AXES`].
    pub(super) sheared_origin: Vec3,
    /// Along the other axes, how far the ray goes while it goes 1 along the last; its t there.
    pub(super) shear: Vec3,
    /// Reciprocal direction; ±`f32::MAX` where a component is 0, so that 0 · ∞ cannot happen.
    pub(super) inverse: Vec3,
    pub(super) near_origin: Vec3,
    pub(super) far_origin: Vec3,
    /// Triangles have to be tested in double precision.
    pub(super) extreme: bool,
}

/// Row by row, for each axis: the next two, and then itself.
pub(super) const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// Of the largest component; the first of equals.
#[inline(always)]
pub(super) fn largest_axis(v: Vec3) -> usize {
    let v = v.abs();
    let of_xy = usize::from(v.y > v.x);
    if v.z > v.x.max(v.y) { 2 } else { of_xy }
}

/// How far from its triangle a hit may be taken to be, in units of 2⁻²⁴ of the largest coordinates: by shearing
/// 5, which move corners; by products in the edge functions, which move weights, 6 / [`THIN`]; by the mean
/// of the distances 5. And 3 for the box test's own operations, rounded up.
pub(super) const SLACK: f32 = (14.0 + 6.0 / THIN) / (1 << 24) as f32;
/// Beyond this distance, or if all is nearer than its reciprocal, products in single precision might
/// overflow or vanish.
pub(super) const EXTREME: f32 = (1u64 << 40) as f32;

impl Probe {
    /// Prepares `ray` for boxes and triangles inside `bounds`.
    #[inline(always)]
    #[must_use]
    pub fn new(ray: &Ray, bounds: &Aabb) -> Self {
        Self::with_slack(ray, bounds, 1.0)
    }

    /// As [`Probe::new`], with boxes `factor` times as far beyond their true borders (a [`super::Tlas`]
    /// needs this: a ray that is rounded when transformed may hit what the original misses).
    #[inline(always)]
    pub(super) fn with_slack(ray: &Ray, bounds: &Aabb, factor: f32) -> Self {
        let (origin, direction) = (Vec3A::from(ray.origin), Vec3A::from(ray.direction));
        let axis = largest_axis(ray.direction);
        let [x, y, z] = AXES[axis];
        let along = ray.direction[z];
        let sheared = direction / Vec3A::splat(along);
        let shear = Vec3::new(sheared[x], sheared[y], 1.0 / along);

        let (below, above) = (Vec3A::from(bounds.min) - origin, Vec3A::from(bounds.max) - origin);
        let reach = below.abs().max(above.abs());
        // Two steps of the origin's own floats more: far from the world's origin a small sum rounds to nothing.
        let step = origin.abs() * (2.0 * f32::EPSILON) + f32::MIN_POSITIVE;
        let slack = (reach + reach[z]) * (SLACK * factor) + step;
        let outward = Vec3A::ONE.copysign(direction);
        // Infinity less infinity is not to happen either.
        let finite = |v: Vec3A| v.min(Vec3A::MAX).max(Vec3A::MIN);
        let inverse = finite(1.0 / direction);
        Self {
            origin: ray.origin,
            direction: ray.direction,
            axis,
            sheared_origin: Vec3::new(ray.origin[x], ray.origin[y], ray.origin[z]),
            shear,
            inverse: inverse.into(),
            near_origin: finite(origin + outward * slack).into(),
            far_origin: finite(origin - outward * slack).into(),
            extreme: !(1.0 / EXTREME..EXTREME).contains(&reach.max_element()),
        }
    }

    /// Bit 0 is set if the direction's x is negative (-0 too), bit 1 for y, bit 2 for z.
    #[inline(always)]
    #[must_use]
    pub fn octant(&self) -> usize {
        self.direction.is_negative_bitmask() as usize
    }

    /// Where the ray enters the box, if it does so at 0 ≤ t ≤ `t_max`.
    ///
    /// Every operation is monotonic in the corners: an outer box is never entered after an inner one.
    #[inline]
    #[must_use]
    pub fn enter(&self, min: Vec3, max: Vec3, t_max: f32) -> Option<f32> {
        let backward = self.direction.is_negative_mask();
        let near = (Vec3::select(backward, max, min) - self.near_origin) * self.inverse;
        let far = (Vec3::select(backward, min, max) - self.far_origin) * self.inverse;
        let near = near.max_element().max(0.0);
        (near <= far.min_element().min(t_max)).then_some(near)
    }
}
