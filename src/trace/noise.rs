//! How wrong the picture still is, without a reference.
//!
//! Errors are relative to the brightness around: over all pixels, the root of the mean of
//! error² / (L² + (m / 10)²), where L is the mean luminance of the 7 x 7 pixels around and m the median
//! luminance of those that are not black. The constant keeps dark places from ruling it, and makes it
//! independent of exposure. The luminance of the pixel alone would not do for L: where few samples are bright,
//! as at the edge of a lamp, error and brightness are found by the same samples, and their ratio is too small
//! (by 0.6 at 16 samples in the Cornell box).

use super::Film;
use super::film::Pixel;
use crate::scene::color::luminance;
use glam::{DVec3, UVec2};
use rayon::prelude::*;

/// How far from a pixel its surroundings reach.
const AROUND: usize = 3;

/// An estimated relative error, and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// 0.02 for 2 %.
    pub relative: f64,
    /// Half the interval around it that holds the true error of 95 of 100 pictures: twice the scatter of the
    /// estimate and of the error itself, each of which is one draw. As far as squared pixel errors are of normal ones.
    pub doubt: f64,
}

/// Estimated relative error of the picture's luminance, 0.02 for 2 %: see [`estimate`].
#[must_use]
pub fn relative_noise(film: &Film) -> Option<f64> {
    estimate(film).map(|noise| noise.relative)
}

/// Estimated relative error of the picture's luminance.
///
/// The film's halves A and B are independent, so (A − B) / 2 has the variance of their mean: it stands for the
/// error. (Where one has a samples and the other b, (A − B) √(ab) / (a + b).) Pixels that are dark in every sample count as exact.
///
/// `None` before both halves have a sample, or when all is black. It knows nothing of light that no
/// sample has seen yet. Of a film that is confined to a region it is that region's.
#[must_use]
pub fn estimate(film: &Film) -> Option<Noise> {
    let [min, max] = part(film);
    let (picture, errors) = luminances(film)?;
    let squares = squares(&errors, &picture, max - min)?;
    let (sum, fourth) = squares.iter().fold((0.0, 0.0), |(sum, fourth), x| (sum + x, fourth + x * x));
    let relative = (sum / squares.len() as f64).sqrt();
    // Of a squared normal error x, E x² = 3 (E x)²; the root halves a relative scatter.
    let scatter = if sum > 0.0 { 0.5 * (2.0 / 3.0 * fourth).sqrt() / sum } else { 0.0 };
    Some(Noise { relative, doubt: relative * 1.96 * std::f64::consts::SQRT_2 * scatter })
}

/// Relative error of each pixel by the same estimate, rows from the top; 0 where both halves are black, and beside the region
/// that the film is confined to. Empty if the picture is not ready for it.
#[must_use]
pub fn map(film: &Film) -> Vec<f32> {
    let [min, max] = part(film);
    let squares = luminances(film).and_then(|(picture, errors)| squares(&errors, &picture, max - min));
    let Some(squares) = squares else { return Vec::new() };
    let (size, width) = (film.size(), (max - min).x as usize);
    let mut map = vec![0.0; size.element_product() as usize];
    let rows = map.chunks_exact_mut(size.x as usize).skip(min.y as usize);
    for (row, squares) in rows.zip(squares.chunks_exact(width)) {
        let own = row[min.x as usize..].iter_mut().zip(squares);
        own.for_each(|(error, square)| *error = square.sqrt() as f32);
    }
    map
}

/// The pixels that are worked on: the film's region as far as it lies in the picture, or all.
#[must_use]
pub fn part(film: &Film) -> [UVec2; 2] {
    let size = film.size();
    let region = film.region().map(|[min, max]| [min.min(size), max.min(size)]);
    region.filter(|[min, max]| max.cmpgt(*min).all()).unwrap_or([UVec2::ZERO, size])
}

/// Of the pixels of that part, and what stands for their errors; `None` before both halves of each have a sample.
fn luminances(film: &Film) -> Option<(Vec<f64>, Vec<f64>)> {
    let brightness = |c: DVec3| f64::from(luminance(c.as_vec3()));
    let halves = |pixel: &Pixel| {
        let (a, b) = (brightness(pixel.half_mean(0)?), brightness(pixel.half_mean(1)?));
        let [in_a, in_b] = pixel.counts().map(f64::from);
        let all = in_a + in_b;
        Some(((a * in_a + b * in_b) / all, (a - b) * (in_a * in_b).sqrt() / all))
    };
    let [min, max] = part(film);
    let size = max - min;
    let (width, count) = (size.x as usize, size.element_product() as usize);
    let (mut picture, mut errors) = (vec![0.0; count], vec![0.0; count]);
    let rows = picture.par_chunks_exact_mut(width).zip(errors.par_chunks_exact_mut(width)).zip(min.y..max.y);
    let is_ready = rows.map(|((picture, errors), y)| {
        let mut places = picture.iter_mut().zip(errors).zip(film.row(y).skip(min.x as usize));
        places.all(|((luminance, error), pixel)| {
            halves(pixel).map(|found| (*luminance, *error) = found).is_some()
        })
    });
    is_ready.reduce(|| true, |a, b| a && b).then_some((picture, errors))
}

/// What [`relative_noise`] estimates: the error of a picture against the truth, both as luminances in rows
/// from the top. `None` if the truth is black.
#[must_use]
pub fn relative_error(picture: &[f64], truth: &[f64], size: UVec2) -> Option<f64> {
    let errors: Vec<f64> = picture.iter().zip(truth).map(|(p, t)| p - t).collect();
    relative(&errors, truth, size)
}

fn relative(errors: &[f64], brightness: &[f64], size: UVec2) -> Option<f64> {
    let squares = squares(errors, brightness, size)?;
    Some((squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Squared relative error of each pixel.
fn squares(errors: &[f64], brightness: &[f64], size: UVec2) -> Option<Vec<f64>> {
    let mut lit: Vec<f64> = brightness.iter().copied().filter(|&i| i > 0.0).collect();
    if lit.is_empty() {
        return None;
    }
    let middle = lit.len() / 2;
    let median = *lit.select_nth_unstable_by(middle, f64::total_cmp).1;
    let floor = (0.1 * median).powi(2);
    let mut squares = means_around(brightness, size);
    squares.par_iter_mut().zip(errors).with_min_len(4096).for_each(|(mean, e)| {
        *mean = e * e / (*mean * *mean + floor);
    });
    Some(squares)
}

/// Means over squares around each pixel, as far as they lie in the picture: first along columns, then rows.
fn means_around(values: &[f64], size: UVec2) -> Vec<f64> {
    let (width, height) = (size.x as usize, size.y as usize);
    let reach = |at: usize, end: usize| at.saturating_sub(AROUND)..(at + AROUND + 1).min(end);
    let mut means = vec![0.0; values.len()];
    let rows = means.par_chunks_exact_mut(width).enumerate();
    rows.for_each_init(Vec::new, |sums: &mut Vec<f64>, (y, means)| {
        let near = reach(y, height);
        sums.clear();
        sums.resize(width, 0.0);
        for row in values[near.start * width..near.end * width].chunks_exact(width) {
            sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
        for (x, mean) in means.iter_mut().enumerate() {
            let across = reach(x, width);
            *mean = sums[across.clone()].iter().sum::<f64>() / (across.len() * near.len()) as f64;
        }
    });
    means
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Nobody waits for the rest of the picture.
    #[test]
    fn the_noise_of_a_region_is_known_although_nothing_is_known_of_the_rest() {
        let size = UVec2::new(32, 24);
        let mut film = Film::new(size, 0);
        let region = [UVec2::new(8, 8), UVec2::new(20, 16)];
        film.confine(Some(region));
        assert_eq!((estimate(&film), map(&film)), (None, Vec::new()));
        for tile in film.tiles_mut().iter_mut().filter(|tile| !tile.rests()) {
            for pixel in tile.pixels_mut() {
                pixel.add(0, Vec3::splat(1.1));
                pixel.add(1, Vec3::splat(0.9));
            }
        }
        // Halves of 1.1 and 0.9: an error of 0.1 beside 1 and a tenth of that.
        let wanted = 0.1 / 1.01f64.sqrt();
        assert!((estimate(&film).unwrap().relative - wanted).abs() < 1e-6);
        let map = map(&film);
        assert_eq!(map.len(), 32 * 24);
        let is_known = |x: u32, y: u32| (map[(y * 32 + x) as usize] - wanted as f32).abs() < 1e-6;
        let inside = |x: u32, y: u32| (8..20).contains(&x) && (8..16).contains(&y);
        assert!((0..24).all(|y| (0..32).all(|x| is_known(x, y) == inside(x, y))));
        film.confine(None);
        assert_eq!(estimate(&film), None);
    }

    #[test]
    fn means_are_those_of_the_pixels_around() {
        for (width, height) in [(1, 1), (2, 9), (9, 2), (13, 11), (4, 4)] {
            let values: Vec<f64> = (0..width * height).map(|i| f64::from(i * i % 17)).collect();
            let means = means_around(&values, UVec2::new(width, height));
            for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
                let near: Vec<f64> = (0..width * height)
                    .filter(|i| (i % width).abs_diff(x) <= 3 && (i / width).abs_diff(y) <= 3)
                    .map(|i| values[i as usize])
                    .collect();
                let mean = near.iter().sum::<f64>() / near.len() as f64;
                assert!((means[(y * width + x) as usize] - mean).abs() < 1e-9, "{x} {y} of {width} {height}");
            }
        }
    }

    #[test]
    fn an_even_error_on_an_even_picture_is_what_it_is() {
        let (truth, picture) = (vec![2.0; 100], vec![2.2; 100]);
        let error = relative_error(&picture, &truth, UVec2::new(20, 5)).unwrap();
        assert!((error - 0.1 / 1.01f64.sqrt()).abs() < 1e-9, "{error}");
        assert_eq!(relative_error(&picture, &vec![0.0; 100], UVec2::new(20, 5)), None);
    }

    /// Sixteen samples a pixel of a grey picture, with normal errors; and the true relative error.
    fn noisy(seed: u32, size: UVec2) -> (Film, f64) {
        use crate::trace::sampler::{hash, unit_float};
        let mut film = Film::new(size, 0);
        let mut counter = hash(seed);
        let mut normal = || {
            let mut sum = 0.0;
            for _ in 0..12 {
                counter = counter.wrapping_add(1);
                sum += unit_float(hash(counter));
            }
            sum - 6.0
        };
        for tile in film.tiles_mut() {
            for pixel in tile.pixels_mut() {
                for i in 0..16 {
                    pixel.add(i, Vec3::splat(10.0 + normal()));
                }
            }
        }
        let picture: Vec<f64> = (0..size.y).flat_map(|y| film.row(y)).map(|pixel| pixel.mean().x).collect();
        let error = relative_error(&picture, &vec![10.0; picture.len()], size).unwrap();
        (film, error)
    }

    #[test]
    fn the_interval_holds_the_true_error_of_nineteen_pictures_in_twenty() {
        let inside = (0..400).filter(|&seed| {
            let (film, error) = noisy(seed, UVec2::new(24, 16));
            let noise = estimate(&film).unwrap();
            (error - noise.relative).abs() <= noise.doubt
        });
        // 380 are expected, with a standard deviation of 4.4.
        let count = inside.count();
        assert!((362..=398).contains(&count), "{count} of 400");
    }

    #[test]
    fn the_map_is_of_the_number() {
        let (film, _) = noisy(1, UVec2::new(24, 16));
        let map = map(&film);
        let mean = map.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>() / map.len() as f64;
        assert!((mean.sqrt() / relative_noise(&film).unwrap() - 1.0).abs() < 1e-6);
    }
}
