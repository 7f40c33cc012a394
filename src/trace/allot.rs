//! Where samples are needed: shares from the error that the first few show.
//!
//! Pixels are coloured as a chess board, and those of one colour get as many samples as the noise of the
//! other colour around them asks for. So how many a pixel gets does not depend on its own samples, and its mean
//! stays unbiased; a mean that ends when it looks good is not.

use super::Film;
use crate::scene::color::luminance;
use glam::{UVec2, Vec4};

/// Even samples per pixel before shares are given out.
pub const EVEN: u32 = 3;
/// By so many samples of each pixel shares are found anew, and better, once the picture has [`RIPE`] of them on average: what the very
/// first have missed, a thin post perhaps, is seen by then. As measured, with both numbers.
pub const AGAIN: u32 = 8;
/// See [`AGAIN`]. Most pixels have as many by then; the others get them first.
pub const RIPE: u32 = 16;
/// What the first shares still count then. Along an edge eight samples are so well spread that both halves often agree; not so
/// three.
const OLD: f32 = 0.5;
/// Nobody gets less than this share for good, or ever more than that many: what the first samples have missed must have its
/// chance.
const LEAST: f32 = 0.05;
const MOST: f32 = 200.0;
/// What is so many times as bright as half of the picture may have larger errors: they are seen no better, and a
/// lamp's edge would get all samples.
const BRIGHT: f32 = 10.0;

/// Pixels of the other colour: those beside, and for what few samples have missed some farther ones, which count less.
const NEAR: [(i32, i32); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
const FAR: [(i32, i32); 12] = [
    (-3, 0),
    (3, 0),
    (0, -3),
    (0, 3),
    (-2, -1),
    (-2, 1),
    (2, -1),
    (2, 1),
    (-1, -2),
    (-1, 2),
    (1, -2),
    (1, 2),
];
/// What the noise of a far one counts beside that of a near one.
const FAR_NOISE: f32 = 0.1;
/// What a step between two near ones counts beside noise, squared: an edge goes through the pixel, perhaps just so that both
/// halves agree. As measured, like the others.
const EDGE: f32 = 0.06;
/// A step is what goes beyond this part of the brightest one's square: shades that change slowly cost few samples.
const SLOPE: f32 = 0.1;
/// What a step between far ones counts beside one between near ones, squared.
const FAR_EDGE: f32 = 0.05;
/// Of the squared error: where n samples leave an error of σ/n^a, with a = 0.75 for scrambled nets on penumbrae and edges, the
/// mean squared error is least with n in proportion to σ^(1/(a + ½)).
const POWER: f32 = 0.4;

/// Shares for [`Film::allot_first`], about one sample per pixel: where pixels differ there is an edge, or noise. Most get none.
#[must_use]
pub fn first_shares(film: &Film) -> Vec<f32> {
    let seen = Seen::of(film);
    let wanted = seen.each(|x, y| {
        let [near, far] = [seen.around(&NEAR, x, y), seen.around(&FAR, x, y)];
        (near.step + FAR_EDGE * far.step).powf(POWER)
    });
    shared_out(wanted, 0.0).into_iter().map(f32::round).collect()
}

/// Shares for [`Film::allot`]. Half the difference of the two halves stands for the error; beyond a part of what is there,
/// so do steps.
#[must_use]
pub fn shares(film: &Film) -> Vec<f32> {
    let seen = Seen::of(film);
    let wanted = seen.each(|x, y| {
        let [near, far] = [seen.around(&NEAR, x, y), seen.around(&FAR, x, y)];
        let count = near.count + FAR_NOISE * far.count;
        // A picture of one pixel has no others.
        if count == 0.0 {
            return 1.0;
        }
        ((near.noise + FAR_NOISE * far.noise) / count + EDGE * (near.step - SLOPE * near.brightest).max(0.0))
            .powf(POWER)
    });
    shared_out(wanted, LEAST)
}

/// Shares for [`Film::allot_again`].
#[must_use]
pub fn shares_again(film: &Film) -> Vec<f32> {
    let mut shares = shares(film);
    for (share, old) in shares.iter_mut().zip(film.shares()) {
        *share += OLD * (old - *share);
    }
    shares
}

/// These numbers, so that they are 1 on average, and none of them far off.
fn shared_out(mut wanted: Vec<f32>, least: f32) -> Vec<f32> {
    let mean =
        |values: &[f32]| values.iter().map(|v| f64::from(*v)).sum::<f64>() as f32 / values.len() as f32;
    let average = mean(&wanted);
    if !(average > 0.0 && average.is_finite()) {
        wanted.fill(1.0);
        return wanted;
    }
    wanted.iter_mut().for_each(|w| *w = (*w / average).clamp(least, MOST));
    let average = mean(&wanted);
    wanted.iter_mut().for_each(|w| *w /= average);
    wanted
}

/// What the first few samples of a picture say.
struct Seen {
    size: UVec2,
    /// Of each pixel, rows from the top: its mean, and the squared difference of the two halves. One that lacks one (it has a
    /// single sample, or all of that half were dropped) says nothing of noise.
    cells: Vec<Vec4>,
}

/// What some pixels say together.
struct Around {
    /// How many there are.
    count: f32,
    /// The sum of their squared differences of halves.
    noise: f32,
    /// The square of how far their means are apart.
    step: f32,
    /// The square of what is nowhere exceeded.
    brightest: f32,
}

impl Seen {
    fn of(film: &Film) -> Self {
        let mut cells: Vec<Vec4> = film
            .early()
            .map(|(halves, mean)| mean.extend(halves.map_or(0.0, |[a, b]| (a - b).length_squared())))
            .collect();
        let light: Vec<f32> = cells.iter().map(|cell| luminance(cell.truncate())).collect();
        let mut sorted = light.clone();
        let middle = sorted.len() / 2;
        let bright = BRIGHT * *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
        if bright > 0.0 {
            for (cell, light) in cells.iter_mut().zip(&light) {
                let dimmed = (light / bright).powi(2) + 1.0;
                *cell = (cell.truncate() / dimmed.sqrt()).extend(cell.w / dimmed);
            }
        }
        Self { size: film.size(), cells }
    }

    fn each(&self, of: impl Fn(u32, u32) -> f32) -> Vec<f32> {
        (0..self.size.y).flat_map(|y| (0..self.size.x).map(move |x| (x, y))).map(|(x, y)| of(x, y)).collect()
    }

    /// What those around a pixel say that are in the picture.
    #[inline]
    fn around(&self, offsets: &[(i32, i32)], x: u32, y: u32) -> Around {
        let (mut low, mut high, mut sum) = (Vec4::INFINITY, Vec4::NEG_INFINITY, Vec4::ZERO);
        for &(dx, dy) in offsets {
            let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            if x < self.size.x && y < self.size.y {
                let cell = self.cells[(y * self.size.x + x) as usize];
                (low, high) = (low.min(cell), high.max(cell));
                sum += cell.with_x(1.0);
            }
        }
        let step = (high - low).max(Vec4::ZERO).truncate().length_squared();
        Around { count: sum.x, noise: sum.w, step, brightest: high.truncate().length_squared() }
    }
}
