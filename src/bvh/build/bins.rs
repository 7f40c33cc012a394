//! Boxes sorted into bins along each axis, and the cheapest plane between two.

use super::prim::{Extent, Prim};
use glam::Vec4;

/// Where the bins are.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    origin: Vec4,
    /// Bins per length; 0 along axes without extent.
    scale: Vec4,
}

impl Grid {
    /// Over where the centres are. What is outside counts as in the outermost bins.
    pub fn new<const N: usize>(centers: &Extent) -> Self {
        let size = centers.hi - centers.lo;
        let scale = size.map(|size| if size > 0.0 { N as f32 / size } else { 0.0 });
        let finite = scale.map(|scale| if scale.is_finite() { scale } else { 0.0 });
        Self { origin: centers.lo, scale: finite }
    }

    /// For each axis the bin of a prim's centre.
    #[inline]
    fn bin<const N: usize>(&self, prim: &Prim) -> [usize; 3] {
        let place = self.place::<N>(prim);
        [place.x, place.y, place.z].map(|place| place.to_bits() as usize % N)
    }

    /// Whether it is in a bin below the plane.
    #[inline]
    pub fn is_below<const N: usize>(&self, plane: &Plane, prim: &Prim) -> bool {
        self.place::<N>(prim).cmplt(Vec4::splat(ROUNDER + plane.bin as f32)).bitmask() >> plane.axis & 1 != 0
    }

    /// The numbers of the bins, added to [`ROUNDER`].
    #[inline]
    fn place<const N: usize>(&self, prim: &Prim) -> Vec4 {
        let place = (prim.center() - self.origin) * self.scale - 0.5;
        place.min(Vec4::splat((N - 1) as f32)).max(Vec4::ZERO) + ROUNDER
    }
}

/// So large that only whole numbers remain of what is added, and these are the lowest bits: cheaper than a cast
/// that saturates. It rounds monotonically, which is all that matters.
const ROUNDER: f32 = (1 << 23) as f32;

/// What is in the bins of each axis.
#[derive(Clone)]
pub(super) struct Bins<const N: usize> {
    grid: Grid,
    /// Around what is in each.
    bins: [[Extent; N]; 3],
    counts: [[u32; N]; 3],
}

impl<const N: usize> Bins<N> {
    pub fn empty(grid: Grid) -> Self {
        Self { grid, bins: [[Extent::EMPTY; N]; 3], counts: [[0; N]; 3] }
    }

    pub fn with(prims: &[Prim], grid: Grid) -> Self {
        let mut bins = Self::empty(grid);
        for prim in prims {
            for (axis, place) in grid.bin::<N>(prim).into_iter().enumerate() {
                bins.bins[axis][place].add(prim);
                bins.counts[axis][place] += 1;
            }
        }
        bins
    }

    pub fn union(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            for i in 0..N {
                self.bins[axis][i] = self.bins[axis][i].union(other.bins[axis][i]);
                self.counts[axis][i] += other.counts[axis][i];
            }
        }
        self
    }

    /// How many are below the plane.
    pub fn count_below(&self, plane: &Plane) -> usize {
        self.counts[plane.axis][..plane.bin].iter().sum::<u32>() as usize
    }

    /// The boxes of what is below and of what is above the plane.
    pub fn sides(&self, plane: &Plane) -> [Extent; 2] {
        let (below, above) = self.bins[plane.axis].split_at(plane.bin);
        [below, above].map(|bins| bins.iter().copied().fold(Extent::EMPTY, Extent::union))
    }

    /// Whether nothing is in the first or last bin of an axis.
    pub fn has_empty_ends(&self) -> bool {
        let is_empty = |counts: &[u32; N]| counts[0] == 0 || counts[N - 1] == 0;
        (0..3).any(|axis| self.grid.scale[axis] > 0.0 && is_empty(&self.counts[axis]))
    }

    /// The cheapest plane with something on both sides, by areas times numbers.
    pub fn best_plane(&self) -> Option<Plane> {
        let mut best: Option<(f32, Plane)> = None;
        for axis in 0..3 {
            if self.grid.scale[axis] == 0.0 {
                continue;
            }
            let (boxes, counts) = (&self.bins[axis], &self.counts[axis]);
            // Cost of everything right of each plane, then sweep from the left.
            let mut right = [0.0; N];
            let (mut extent, mut count) = (Extent::EMPTY, 0);
            for i in (1..N).rev() {
                extent = extent.union(boxes[i]);
                count += counts[i];
                right[i] = extent.half_area() * count as f32;
            }
            let all = count + counts[0];
            let (mut extent, mut count) = (Extent::EMPTY, 0);
            for i in 1..N {
                extent = extent.union(boxes[i - 1]);
                count += counts[i - 1];
                let cost = extent.half_area() * count as f32 + right[i];
                if count > 0 && count < all && best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    best = Some((cost, Plane { axis, bin: i }));
                }
            }
        }
        best.map(|(_, plane)| plane)
    }
}

/// Bins of `axis` below `bin` are left of it.
pub(super) struct Plane {
    pub axis: usize,
    pub bin: usize,
}
