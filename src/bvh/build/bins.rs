//! Boxes sorted into bins along each axis, and the cheapest plane between two.

use super::prim::{Extent, Prim, half_area};
use glam::Vec4;

/// Around what is in it.
#[derive(Clone, Copy)]
struct Bin {
    lo: Vec4,
    hi: Vec4,
}

/// Where the bins are.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    origin: Vec4,
    /// Bins per length; 0 along axes without extent.
    scale: Vec4,
}

impl Grid {
    pub fn new(extent: &Extent, bins: usize) -> Self {
        let size = extent.center_hi - extent.center_lo;
        let scale = size.map(|size| if size > 0.0 { bins as f32 / size } else { 0.0 });
        let finite = scale.map(|scale| if scale.is_finite() { scale } else { 0.0 });
        Self { origin: extent.center_lo, scale: finite }
    }

    /// For each axis the bin of a prim's centre.
    #[inline]
    pub fn bin<const N: usize>(&self, prim: &Prim) -> [usize; 3] {
        // Rounds down by adding so much that only whole numbers remain, which is cheaper than a cast that
        // saturates. Monotonic, which is all that matters.
        let place = (prim.center() - self.origin) * self.scale - 0.5;
        let place = place.min(Vec4::splat((N - 1) as f32)).max(Vec4::ZERO) + (1 << 23) as f32;
        [place.x, place.y, place.z].map(|place| place.to_bits() as usize % N)
    }
}

/// What is in the bins of each axis.
#[derive(Clone)]
pub(super) struct Bins<const N: usize> {
    grid: Grid,
    bins: [[Bin; N]; 3],
    counts: [[u32; N]; 3],
}

impl<const N: usize> Bins<N> {
    pub fn empty(grid: Grid) -> Self {
        let none = Bin { lo: Vec4::INFINITY, hi: Vec4::NEG_INFINITY };
        Self { grid, bins: [[none; N]; 3], counts: [[0; N]; 3] }
    }

    pub fn with(prims: &[Prim], grid: Grid) -> Self {
        let mut bins = Self::empty(grid);
        for prim in prims {
            for (axis, place) in grid.bin::<N>(prim).into_iter().enumerate() {
                let bin = &mut bins.bins[axis][place % N];
                bin.lo = bin.lo.min(prim.lo);
                bin.hi = bin.hi.max(prim.hi);
                bins.counts[axis][place % N] += 1;
            }
        }
        bins
    }

    pub fn union(mut self, other: Self) -> Self {
        for axis in 0..3 {
            for i in 0..N {
                let bin = &mut self.bins[axis][i];
                bin.lo = bin.lo.min(other.bins[axis][i].lo);
                bin.hi = bin.hi.max(other.bins[axis][i].hi);
                self.counts[axis][i] += other.counts[axis][i];
            }
        }
        self
    }
}

/// Bins of `axis` below `bin` are left of it.
pub(super) struct Plane {
    pub axis: usize,
    pub bin: usize,
}

/// The cheapest plane with something on both sides, and its cost: areas times numbers.
pub(super) fn best_plane<const N: usize>(bins: &Bins<N>) -> Option<(f32, Plane)> {
    let mut best: Option<(f32, Plane)> = None;
    for axis in 0..3 {
        if bins.grid.scale[axis] == 0.0 {
            continue;
        }
        let (boxes, counts) = (&bins.bins[axis], &bins.counts[axis]);
        // Cost of everything right of each plane, then sweep from the left.
        let mut right = [0.0; N];
        let (mut lo, mut hi, mut count) = (Vec4::INFINITY, Vec4::NEG_INFINITY, 0);
        for i in (1..N).rev() {
            lo = lo.min(boxes[i].lo);
            hi = hi.max(boxes[i].hi);
            count += counts[i];
            right[i] = half_area(lo, hi) * count as f32;
        }
        let all = count + counts[0];
        let (mut lo, mut hi, mut count) = (Vec4::INFINITY, Vec4::NEG_INFINITY, 0);
        for i in 1..N {
            lo = lo.min(boxes[i - 1].lo);
            hi = hi.max(boxes[i - 1].hi);
            count += counts[i - 1];
            let cost = half_area(lo, hi) * count as f32 + right[i];
            if count > 0 && count < all && best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, Plane { axis, bin: i }));
            }
        }
    }
    best
}
