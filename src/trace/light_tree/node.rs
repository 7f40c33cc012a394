//! Nodes of a [`super::LightTree`], and what they look like from a point.

use crate::bvh::simd::{Lanes, Mask, Simd};
use crate::trace::emitter::{Emitter, Receiver};
use std::ops::Range;

/// Children of a node at most.
pub(super) const WIDTH: usize = 16;
/// One number of each child.
pub(super) type Row = [f32; WIDTH];

/// What the way down needs of the children of a node; those that it does not have are zeros.
#[derive(Clone, Debug, Default, PartialEq)]
#[repr(align(64))]
pub(super) struct Node {
    /// Of the ball around the box of each; the inverse is of four times its radius.
    center: [Row; 3],
    radius: Row,
    inverse: Row,
    /// Squared distance of the nearest, at least; and what they send at least, times that squared and a distance.
    close: Row,
    least: Row,
    /// [`crate::trace::emitter::Sides`], in parts of the intensity of all: squares without their weight.
    weight: Row,
    squares: [Row; 6],
    front: [Row; 3],
    /// Part of the intensity of all; equal parts of nothing.
    share: Row,
    /// What they are chosen by if nothing is known of what is in between. And sums of these.
    blind: Row,
    blinds: Row,
    /// From so far on, and so high above the horizon, nothing is to be chosen in a child but by intensity; if as much leaves it as
    /// `facing`.
    far: Row,
    facing: Row,
    pub(super) children: [Child; WIDTH],
    last: usize,
    /// The node above, and which of its children this is.
    pub(super) parent: (u32, u32),
}

/// Where a child leads.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Child {
    /// Its emitters' places in the order of the tree.
    pub(super) first: u32,
    pub(super) count: u32,
    /// Its own node, if it has more than one.
    pub(super) node: u32,
}

/// What the children of a node bring to a point.
pub(super) struct Seen {
    /// How far above the horizon they are, and how much they send here, times their distance.
    height: Row,
    sent: Row,
    brought: Row,
    /// Of each and all before it.
    sums: Row,
    /// What to weigh that by, and what is chosen blindly, so that there is 1 in all.
    seeing: f32,
    blind: f32,
}

/// Emitters together, some or one.
pub(super) struct Group {
    pub(super) all: Emitter,
    /// They shine to the same sides, more or less.
    pub(super) alike: bool,
    pub(super) places: Range<usize>,
}

/// Nodes of emitters that are alike, farther than so many times the radius of their ball and as far above the horizon, are not
/// looked into: among those their intensity decides.
const FAR: f32 = 6.0;
/// What they are expected to bring does not know what is in between: so often their intensity and their number decide alike.
const BLIND: f32 = 0.1;
/// From within the ball of those that face all directions, the squared distance is at least this part of that of its radius, and
/// what is sent is at least this part of the intensity, falling with the squared distance. Found for 3000 emitters around sixty points:
/// second moment 10 with 1 and 0, 1.7 to 2.1 so; half or double of either has more. Those that face one direction send nothing along
/// their plane: from inside of a ball that shines, where all of what is near does that, it is 1.06 so, and 1.37 if all have this.
const CLOSE: f32 = 0.4;
const ANYWHERE: f32 = 0.1;

impl Node {
    /// Of these, with the intensity of each in all.
    pub(super) fn new(groups: &[(&Group, f64)], parent: (u32, u32)) -> Self {
        let ends = [f32::NEG_INFINITY; WIDTH];
        let last = groups.len() - 1;
        let mut node = Self { parent, last, far: ends, facing: ends, ..Self::default() };
        let sum: f64 = groups.iter().map(|(_, intensity)| intensity).sum();
        let is_something = sum > 0.0 && sum < f64::INFINITY;
        let count: usize = groups.iter().map(|(group, _)| group.places.len()).sum();
        let mut blinds = 0.0;
        for (i, &(Group { all, alike, places }, intensity)) in groups.iter().enumerate() {
            let share = if is_something { (intensity / sum) as f32 } else { 1.0 / groups.len() as f32 };
            let blind = 0.5 * (share + places.len() as f32 / count as f32);
            blinds += blind;
            (node.share[i], node.blind[i], node.blinds[i]) = (share, blind, blinds);
            let (center, radius) = (all.bounds.center(), ((all.bounds.max - all.bounds.min) * 0.5).length());
            (node.radius[i], node.inverse[i]) = (radius, 0.25 / radius.max(f32::MIN_POSITIVE));
            let sides = all.sides;
            let part =
                |of: f32, whole: f32| if whole > 0.0 && whole < f32::INFINITY { of / whole } else { 0.0 };
            node.weight[i] = share * part(sides.weight, all.intensity);
            for (row, square) in node.squares.iter_mut().zip(sides.squares) {
                row[i] = part(square, sides.weight);
            }
            let scattered = sides.scattered();
            node.close[i] = radius * radius * (1.0 - scattered * (1.0 - CLOSE));
            node.least[i] = share * scattered * ANYWHERE * radius.powi(3);
            for axis in 0..3 {
                node.center[axis][i] = center[axis];
                node.front[axis][i] = share * part(sides.front[axis], all.intensity);
            }
            (node.far[i], node.facing[i]) = match places.len() {
                1 => (f32::NEG_INFINITY, f32::NEG_INFINITY),
                _ if *alike && intensity > 0.0 => (FAR * radius, FAR * radius * share),
                _ => (f32::INFINITY, f32::INFINITY),
            };
            node.children[i] = Child { first: places.start as u32, count: places.len() as u32, node: 0 };
        }
        // For the sums of children that are not there.
        node.blinds[groups.len()..].fill(blinds);
        node
    }

    /// How children are chosen at a point.
    #[inline(always)]
    pub(super) fn seen<S: Simd>(&self, simd: S, to: &Receiver) -> Seen {
        let zeros = [0.0; WIDTH];
        let mut seen =
            Seen { height: zeros, sent: zeros, brought: zeros, sums: zeros, seeing: 0.0, blind: 1.0 };
        for i in 0..WIDTH {
            (seen.height[i], seen.sent[i], seen.brought[i]) = self.brought(i, to);
        }
        S::F16::load(simd, &seen.brought).running_sums(simd).store(&mut seen.sums);
        let seeing = (1.0 - BLIND) / seen.sums[WIDTH - 1];
        // Not where none is expected to bring anything, or one is infinitely near.
        if (seeing > 0.0) & (seeing < f32::INFINITY) {
            (seen.seeing, seen.blind) = (seeing, BLIND);
        } else {
            (seen.brought, seen.sums) = (zeros, zeros);
        }
        seen
    }

    /// The chance of a child.
    #[inline(always)]
    pub(super) fn chance(&self, seen: &Seen, child: usize) -> f32 {
        seen.brought[child] * seen.seeing + self.blind[child] * seen.blind
    }

    /// Which child a number in [0, 1) means, the chance of that, and what is left of the number.
    #[inline(always)]
    pub(super) fn choose<S: Simd>(&self, simd: S, seen: &Seen, random: f32) -> (usize, f32, f32) {
        let row = |row: &Row| S::F16::load(simd, row);
        let weight = |x: f32| S::F16::splat(simd, x);
        let ends = row(&seen.sums) * weight(seen.seeing) + row(&self.blinds) * weight(seen.blind);
        let end = |i: usize| seen.sums[i] * seen.seeing + self.blinds[i] * seen.blind;
        let wanted = random * end(WIDTH - 1);
        let child = ends.le(weight(wanted)).bits().count_ones() as usize;
        let child = child.min(self.last);
        let chance = self.chance(seen, child);
        (child, chance, (wanted - (end(child) - chance)) / chance)
    }

    /// How far above the horizon a child is; what it sends here, times its distance; and what it brings if nothing is in between,
    /// nearly. Without branches: which way they go nobody can foresee.
    #[inline(always)]
    fn brought(&self, i: usize, to: &Receiver) -> (f32, f32, f32) {
        let select = |which: bool, yes: f32, no: f32| if which { yes } else { no };
        let [x, y, z] =
            [self.center[0][i] - to.point.x, self.center[1][i] - to.point.y, self.center[2][i] - to.point.z];
        let distance2 = x * x + y * y + z * z;
        let radius = self.radius[i];
        // From inside of the ball around them, they may be anywhere.
        let inverse = 1.0 / distance2.max(self.close[i]).max(1e-30);
        let [xx, yy, zz, yz, zx, xy] = &self.squares;
        let squares = x * (x * xx[i] + y * (2.0 * xy[i]))
            + y * (y * yy[i] + z * (2.0 * yz[i]))
            + z * (z * zz[i] + x * (2.0 * zx[i]));
        let front = self.front[0][i] * x + self.front[1][i] * y + self.front[2][i] * z;
        let sent = self.weight[i] * squares.max(0.0).sqrt() - front;
        let height = to.normal.x * x + to.normal.y * y + to.normal.z * z;
        // The mean over the ball of what is above the horizon, if all heights were as frequent.
        let above = height + radius;
        let straddling = above * above * self.inverse[i];
        let mean = select(height >= radius, height, select(above > 0.0, straddling, 0.0));
        // Never quite dark: what shines through a surface arrives from behind, and rounding
        // must not decide.
        let arriving = mean.max(0.05 * height.abs());
        let sending = sent.max(0.05 * self.share[i] * radius) + self.least[i] * inverse;
        (height, sent, sending * arriving * inverse * inverse)
    }

    /// Whether nothing is to be chosen in a child but by intensity.
    #[inline(always)]
    pub(super) fn is_end(&self, i: usize, seen: &Seen) -> bool {
        // What is not a number is an end, too.
        let goes_on = (seen.height[i] <= self.far[i]) | (seen.sent[i] <= self.facing[i]);
        !goes_on
    }
}
