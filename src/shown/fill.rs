//! New samples for pixels of a moving picture of which the old ones say nothing: where something came into view, at edges.

use super::Shown;
use super::carry::Lost;
use super::grid::note;
use crate::trace::TraceScene;
use crate::trace::camera::Sheet;
use crate::trace::integrator::Batch;
use crate::trace::place::{Place, Spot, places};
use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;
use std::time::Instant;

/// Before anything was measured: seconds for a sample.
const FIRST_GUESS: f64 = 2e-6;
/// What samples count at pixels beside their own at most, ...
const BESIDE: f32 = 0.25;
/// ... and at least to be taken over once more.
const FAINT: f32 = 0.1;
/// No sample counts as brighter, radiance: sums of more would overflow.
const BRIGHTEST: f32 = 1e30;
/// Where a pixel without any looks for one, pixels.
const NEAR: [[i32; 2]; 8] = [[-1, 0], [0, -1], [1, 0], [0, 1], [-2, 0], [0, -2], [2, 0], [0, 2]];

impl Shown {
    /// Gives samples to as many of those as there is time for, evenly; the others that have none take that of one near them.
    /// What has no sample at all counts `guess`.
    pub(super) fn fill(&mut self, scene: &TraceScene, lost: &[Lost], guess: f32, seconds: f64) {
        let start = Instant::now();
        let most = (seconds / self.pace.sample.unwrap_or(FIRST_GUESS)) as usize;
        self.fills = self.fills.wrapping_add(1);
        let missing: Vec<UVec2> = lost.iter().flat_map(|lost| &lost.missing).copied().collect();
        let poor: Vec<UVec2> = lost.iter().flat_map(|lost| &lost.poor).copied().collect();
        let (missing_step, missing_first) = self.step(missing.len(), most);
        let chosen = missing.iter().skip(missing_first).step_by(missing_step);
        let left = most.saturating_sub(missing.len());
        let (poor_step, poor_first) = self.step(poor.len(), left);
        let others = poor.iter().skip(poor_first).step_by(poor_step).take(left);
        let pixels: Vec<UVec2> = chosen.chain(others).copied().collect();
        if pixels.is_empty() {
            return;
        }
        let index = self.fills;
        let part = pixels.len().div_ceil(2 * rayon::current_num_threads()).max(64);
        let samples: Vec<Vec3> = pixels
            .par_chunks(part)
            .map_init(Batch::default, |batch, pixels| batch.single_samples(scene, pixels, index).to_vec())
            .flatten_iter()
            .collect();
        // What was found out of whole blocks may not be so in each of their pixels, and what is known of one surface must not go on
        // as if it were of another.
        let found: Vec<Place> = pixels
            .par_chunks(part)
            .flat_map_iter(|pixels| {
                let middles: Vec<Vec2> = pixels.iter().map(|pixel| pixel.as_vec2() + 0.5).collect();
                let mut found = vec![Place::unknown(); middles.len()];
                places(scene, &middles, &mut found);
                found
            })
            .collect();
        let width = self.size.x;
        let sheet = scene.viewpoint.sheet(self.size);
        let at = |pixel: UVec2| (pixel.y * width + pixel.x) as usize;
        let news = pixels.iter().zip(&samples).zip(&found).filter(|((_, sample), _)| sample.is_finite());
        for ((&pixel, &sample), place) in news {
            let (kept, spot) = (&mut self.kept[at(pixel)], &mut self.spots[at(pixel)]);
            let now = Spot::from(place);
            let is_same = spot.continues(&now, side(&sheet, &now));
            let old = if kept.w > guess && is_same { kept.w } else { 0.0 };
            if old == 0.0 {
                let mark = if is_same { spot.keeps & Spot::OUTLINE } else { Spot::OUTLINE };
                *spot = Spot { keeps: now.keeps | mark, ..now };
            }
            let sample = sample.min(Vec3::splat(BRIGHTEST));
            *kept = ((kept.truncate() * old + sample) / (old + 1.0)).extend(old + 1.0);
        }
        // Where nearly all is new, there is nobody to ask.
        if missing.len() < self.kept.len() / 4 {
            // Twice, for there may be some only on the other side.
            let still: Vec<UVec2> =
                missing.into_iter().filter(|&pixel| !self.borrow(pixel, &sheet, guess)).collect();
            still.into_iter().rev().for_each(|pixel| {
                self.borrow(pixel, &sheet, guess);
            });
        }
        note(&mut self.pace.sample, start.elapsed().as_secs_f64(), pixels.len());
    }

    /// If the pixel has no sample, it takes what one beside it shows of the same thing, unless that is a mirror; false if there is
    /// none.
    fn borrow(&mut self, pixel: UVec2, sheet: &Sheet, guess: f32) -> bool {
        let width = self.size.x;
        let at = |pixel: UVec2| (pixel.y * width + pixel.x) as usize;
        let here = at(pixel);
        let beside = NEAR.iter().map(|&by| pixel.wrapping_add_signed(by.into()));
        let beside = beside.filter(|there| there.cmplt(self.size).all()).map(at);
        let mut known = beside.filter(|&there| self.kept[there].w > guess.max(FAINT));
        if self.kept[here].w > guess || self.spots[here].unmarked().keeps == 0 {
            return true;
        }
        let spot = &self.spots[here];
        let found = known.find(|&there| spot.continues(&self.spots[there], side(sheet, spot)));
        let Some(there) = found else { return false };
        // The farther it comes, the less it counts.
        let there = self.kept[there];
        self.kept[here] = there.truncate().extend((0.5 * there.w).min(BESIDE));
        true
    }

    /// Each how manieth of `count` is taken if that may be `most`, and which is the first.
    fn step(&self, count: usize, most: usize) -> (usize, usize) {
        let step = count.div_ceil(most.max(1)).max(1);
        (step, self.fills as usize % step)
    }
}

/// Of a pixel at that place, scene units.
pub(super) fn side(sheet: &Sheet, spot: &Spot) -> f32 {
    sheet.pixel(sheet.own(spot.position).z.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Viewpoint;
    use glam::Vec4;

    #[test]
    fn a_pixel_without_samples_takes_those_of_the_same_thing_unless_it_is_a_mirror() {
        let spot = |thing, keeps| Spot { thing, keeps, facet: [0, 0, 127], ..Spot::UNKNOWN };
        let (here, other) = (Vec4::new(0.0, 0.0, 0.0, 0.01), Vec4::new(5.0, 5.0, 5.0, 8.0));
        let of = |spots: [Spot; 3]| {
            let size = UVec2::new(3, 1);
            let kept = vec![other, here, Vec4::splat(2.0)];
            let mut shown = Shown { size, kept, spots: spots.to_vec(), ..Shown::default() };
            (shown.borrow(UVec2::new(1, 0), &Viewpoint::default().sheet(size), 0.01), shown.kept[1])
        };
        let of_right = Vec4::new(2.0, 2.0, 2.0, BESIDE);
        assert_eq!(of([spot(7, 64), spot(3, 64), spot(3, 64)]), (true, of_right));
        assert_eq!(of([spot(3, 64), spot(3, 64), spot(3, 64)]).1, other.truncate().extend(BESIDE));
        assert_eq!(of([spot(7, 64), spot(3, 64), spot(7, 64)]), (false, here), "nobody shows it");
        assert_eq!(
            of([spot(3, 0), spot(3, 0), spot(3, 0)]),
            (true, here),
            "its neighbours show something else"
        );
    }
}
