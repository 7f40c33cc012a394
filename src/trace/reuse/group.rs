//! Which pixels of a tile share their paths.

use crate::trace::film::TILE;
use glam::UVec2;

/// Pixels that share: a power of two, at most half of a tile.
pub const MEMBERS: usize = 32;
/// Of a whole tile.
pub const GROUPS: usize = (TILE * TILE) as usize / MEMBERS;

/// The group of a pixel of a tile: those of one colour of the chess board.
fn group(x: u32, y: u32) -> usize {
    ((x ^ y) & 1) as usize % GROUPS
}

/// The groups of a tile.
#[derive(Debug, Default)]
pub struct Groups {
    /// Pixels of each, in rows from the top.
    pub members: [Vec<u32>; GROUPS],
    /// Of each pixel: the first of its group, and its own number in it.
    pub ranks: Vec<(u32, u32)>,
}

impl Groups {
    /// Those of a tile of this size.
    pub fn of(&mut self, size: UVec2) {
        self.members.iter_mut().for_each(Vec::clear);
        self.ranks.clear();
        for (i, (x, y)) in (0..).zip((0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y)))) {
            let members = &mut self.members[group(x, y)];
            members.push(i);
            self.ranks.push((members[0], members.len() as u32 - 1));
        }
    }
}

/// Makes the shares of the members of each group equal; in rows of a picture of `width` pixels.
pub fn even_out(shares: &mut [f32], width: usize) {
    let tile = TILE as usize;
    let height = shares.len() / width.max(1);
    for (top, left) in (0..height).step_by(tile).flat_map(|y| (0..width).step_by(tile).map(move |x| (y, x))) {
        let pixels = || {
            (top..(top + tile).min(height)).flat_map(move |y| {
                (left..(left + tile).min(width))
                    .map(move |x| (group((x - left) as u32, (y - top) as u32), y * width + x))
            })
        };
        let (mut sums, mut counts) = ([0.0; GROUPS], [0.0; GROUPS]);
        for (group, i) in pixels() {
            sums[group] += shares[i];
            counts[group] += 1.0;
        }
        for (group, i) in pixels() {
            shares[i] = sums[group] / counts[group];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_of_the_group_and_none_is_lost() {
        // One whole tile and one that is cut off, side by side.
        let (width, height) = (11, 8);
        let mut shares: Vec<f32> = (0..width * height).map(|i| (i % 7) as f32).collect();
        let sum: f32 = shares.iter().sum();
        even_out(&mut shares, width);
        assert!((shares.iter().sum::<f32>() - sum).abs() < 1e-3);
        assert_eq!((shares[0], shares[8]), (shares[2 * width + 6], shares[width + 9]));
        assert_ne!(shares[0], shares[1]);
    }

    #[test]
    fn members_are_of_one_colour() {
        let mut groups = Groups::default();
        groups.of(UVec2::new(3, 8));
        for (pixel, (leader, rank)) in groups.ranks.iter().enumerate() {
            let pixel = pixel as u32;
            let colour = |i: u32| (i % 3 + i / 3) & 1;
            assert_eq!(colour(pixel), colour(*leader));
            assert_eq!(groups.members[colour(pixel) as usize][*rank as usize], pixel);
        }
    }
}
