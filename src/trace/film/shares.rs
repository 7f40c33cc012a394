//! Which pixels get how many samples: shares, given out and replaced.

use super::tile::Early;
use super::{Film, TILE, Tile};
use crate::trace::allot::{AGAIN, EVEN};
use glam::Vec3;

/// Which pixels get how many of the next samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// All as many.
    Even,
    /// After so many of each, shares that end: see [`Film::allot_first`].
    FirstShares(u32),
    /// After so many of each, shares for good: see [`Film::allot`].
    Shares(u32),
}

impl Film {
    /// Whether it has the first sample of each pixel, also where nothing is refined now, and no other.
    #[must_use]
    pub fn has_one_each(&self) -> bool {
        let of = |tile: &Tile| tile.next_sample.checked_sub(self.first_sample) == Some(1) && !tile.half;
        !self.is_allotted() && self.region.is_none() && self.tiles.iter().all(of)
    }

    /// From now on keeps apart what the first [`EVEN`] samples of each pixel say, of which each has one: the later share of
    /// another must not depend on how many this one had by then, since that was found from the other.
    pub fn keep_early(&mut self) {
        for tile in &mut self.tiles {
            let early = tile.pixels().map(|pixel| Early::new(pixel, EVEN as u8 - 1)).collect();
            tile.early = early;
        }
    }

    /// Begins to give out shares, whole numbers of samples, after [`Film::keep_early`] by what that has kept. When
    /// [`Film::end_first_shares`] ends it, each pixel has as many as it must have for [`Film::allot`].
    pub fn allot_first(&mut self, shares: &[f32]) {
        self.stage = Stage::FirstShares(self.complete_samples());
        self.give_shares(shares);
    }

    /// Ends what [`Film::allot_first`] began, if all tiles have come so far, also those that rest now. Samples beyond are
    /// counted toward what [`Film::allot`] gives out next.
    pub fn end_first_shares(&mut self) -> bool {
        if !self.tiles.iter().all(|tile| tile.complete == EVEN) {
            return false;
        }
        self.stage = Stage::Even;
        for tile in &mut self.tiles {
            tile.next_sample += EVEN - 1;
            tile.more.iter_mut().for_each(|more| *more -= EVEN - 1);
        }
        true
    }

    /// Whether shares by the first sample of each pixel are being given out. Some pixels may have no other.
    #[must_use]
    pub fn has_first_shares(&self) -> bool {
        matches!(self.stage, Stage::FirstShares(_))
    }

    /// Means of both halves of each pixel, as far as they have samples, and of all; by the first [`EVEN`] or [`AGAIN`] samples if
    /// they are known apart. Rows from the top.
    pub(in crate::trace) fn early(&self) -> impl Iterator<Item = (Option<[Vec3; 2]>, Vec3)> {
        let across = self.size.x.div_ceil(TILE);
        let places = (0..self.size.y).flat_map(|y| (0..self.size.x).map(move |x| (x, y)));
        places.map(move |(x, y)| {
            let tile = &self.tiles[(y / TILE * across + x / TILE) as usize];
            if let Some(early) = tile.early.get((y % TILE * tile.size.x + x % TILE) as usize) {
                return (early.halves(), early.mean());
            }
            let pixel = self.pixel(x, y);
            let halves = pixel.half_mean(0).zip(pixel.half_mean(1));
            (halves.map(|(a, b)| [a.as_vec3(), b.as_vec3()]), pixel.mean().as_vec3())
        })
    }

    /// From now on gives each pixel its own share of all samples, of mean 1; `shares` are in rows of the whole picture.
    /// Every pixel must have the same number of samples, one at least, but for those of [`Film::allot_first`].
    ///
    /// A picture stays unbiased only if how many samples a pixel gets does not depend on what they say: so
    /// the share of one pixel is to be found from others.
    pub fn allot(&mut self, shares: &[f32]) {
        let even = self.complete_samples();
        // After first shares some have more already, which nobody can tell apart, and so have tiles that were refined before the
        // others: no other shares come then.
        let is_even = self.tiles.iter().all(|tile| tile.next_sample - self.first_sample == even);
        let missing = if self.keeps_early() || !is_even { 0 } else { AGAIN.saturating_sub(even) };
        self.stage = Stage::Shares(even);
        self.give_shares(shares);
        for tile in &mut self.tiles {
            tile.early = match missing {
                0 => Vec::new(),
                _ => tile.pixels().map(|pixel| Early::new(pixel, missing as u8)).collect(),
            };
        }
    }

    fn keeps_early(&self) -> bool {
        self.tiles.iter().any(|tile| !tile.early.is_empty())
    }

    /// Whether there are shares that better ones can replace: see [`Film::allot_again`].
    #[must_use]
    pub fn can_allot_again(&self) -> bool {
        matches!(self.stage, Stage::Shares(_)) && self.keeps_early()
    }

    /// Whether every pixel has the [`AGAIN`] samples that [`Film::allot_again`] goes by.
    #[must_use]
    pub fn is_ripe(&self) -> bool {
        let more = AGAIN.saturating_sub(self.even_samples());
        self.can_allot_again() && self.tiles.iter().flat_map(|tile| &tile.more).all(|&had| had >= more)
    }

    /// Replaces the shares of a film that [`Film::is_ripe`], for good. They are to be found from [`Film::early`], which is the first
    /// [`AGAIN`] samples of each pixel then: that they are as many does not depend on what any pixel's samples say.
    pub fn allot_again(&mut self, shares: &[f32]) {
        let more = AGAIN.saturating_sub(self.even_samples());
        let complete: Vec<u32> = self.tiles.iter().map(|tile| tile.complete).collect();
        self.stage = Stage::Shares(AGAIN);
        for tile in &mut self.tiles {
            tile.next_sample += more;
            tile.more.iter_mut().for_each(|had| *had -= more);
            tile.early = Vec::new();
        }
        self.give_shares(shares);
        self.tiles.iter_mut().zip(complete).for_each(|(tile, complete)| tile.complete = complete);
    }

    /// The share that each pixel has, rows from the top; none unless they have been given out.
    pub(in crate::trace) fn shares(&self) -> impl Iterator<Item = f32> {
        let across = self.size.x.div_ceil(TILE);
        let places = (0..self.size.y).flat_map(|y| (0..self.size.x).map(move |x| (x, y)));
        places.filter_map(move |(x, y)| {
            let tile = &self.tiles[(y / TILE * across + x / TILE) as usize];
            tile.shares.get((y % TILE * tile.size.x + x % TILE) as usize).copied()
        })
    }

    fn give_shares(&mut self, shares: &[f32]) {
        let even = self.even_samples();
        debug_assert!(!self.tiles.iter().any(Tile::is_half), "a half tile has no even number of samples");
        let across = self.size.x as usize;
        for tile in &mut self.tiles {
            let [x, y, width, height] =
                [tile.origin.x, tile.origin.y, tile.size.x, tile.size.y].map(|n| n as usize);
            tile.shares.clear();
            tile.shares.extend((y..y + height).flat_map(|y| &shares[y * across + x..][..width]));
            tile.more.resize(width * height, 0);
            tile.complete = even;
        }
    }

    /// Whether shares have been given out, be it first ones.
    #[must_use]
    pub fn is_allotted(&self) -> bool {
        self.stage != Stage::Even
    }

    /// Samples that each pixel had before [`Film::allot`]; 0 without it.
    #[must_use]
    pub fn even_samples(&self) -> u32 {
        match self.stage {
            Stage::Even => 0,
            Stage::FirstShares(even) | Stage::Shares(even) => even,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec2;

    #[test]
    fn no_share_goes_beyond_the_last_index() {
        let mut film = Film::new(UVec2::ONE, u32::MAX - 10);
        film.tiles_mut()[0].next_sample += 4;
        film.allot(&[100.0]);
        let tile = &film.tiles()[0];
        assert_eq!(tile.goal(0, 3), 6);
        assert_eq!(tile.goal(0, u32::MAX), 6);
    }
}
