//! Where one looks at the new view, as there is time: in the middle of blocks, and more closely where these see edges.

use crate::trace::camera::Sheet;
use crate::trace::place::{Place, places};
use crate::trace::{Film, TraceScene};
use glam::{UVec2, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// Sides of the blocks of the new picture in whose middle one looks, pixels: as large as the preview's pixels, between
/// the first two, or the last if there is no time. Around it the surface is continued as a plane.
const SIDES: [u32; 3] = [2, 4, 8];
/// Of the time for carrying over, what looking may take before one knows where the edges are.
const FIRST_LOOK: f64 = 0.6;
/// Pixels along a row for which one looks once where there are edges, as there is time, and how many looks that makes for each
/// when it is looked again between different ones; ...
const STEPS: [(u32, f64); 4] = [(1, 1.0), (2, 1.2), (4, 1.4), (8, 2.0)];
/// ... or somewhat less, as a share of the time for carrying over: without, thin things fall apart.
const OVERTIME: f64 = 0.25;

/// What carrying over costs on this machine in this scene.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    /// Seconds for one place that is looked at.
    pub place: Option<f64>,
    /// Seconds for one pixel, apart from that.
    pub pixel: Option<f64>,
    /// Seconds for a sample of a pixel that lacks one.
    pub sample: Option<f64>,
}

/// What the preview of another surface counts: less than what is found again in the next step.
const NOTHING: f32 = 1e-3;
/// Before anything was measured: seconds for a pixel or a place.
const FIRST_GUESS: f64 = 2e-8;

/// Learns that `count` of something took so long. Half the old value, so that one hiccup of the machine is no rule.
pub fn note(pace: &mut Option<f64>, seconds: f64, count: usize) {
    let measured = seconds / count.max(1) as f64;
    *pace = Some(pace.map_or(measured, |old| 0.5 * (old + measured)));
}

/// Which of `length` pixels are those of block number `i` of `blocks`.
fn part(i: u32, blocks: u32, length: u32) -> Range<u32> {
    (i * length).div_ceil(blocks)..((i + 1) * length).div_ceil(blocks)
}

/// The new picture in blocks, and its preview.
pub struct Grid<'a> {
    pub size: UVec2,
    /// What is in the middle of each.
    blocks: Vec<Place>,
    /// Blocks that see an edge are looked at anew along each row, once for so many pixels, if there is time.
    pub step: Option<u32>,
    preview: Option<&'a Film>,
    /// What a sample of the preview counts: it is of many pixels.
    pub worth: f32,
}

impl<'a> Grid<'a> {
    pub fn new(
        scene: &TraceScene,
        sheet: &Sheet,
        preview: Option<&'a Film>,
        pace: &mut Pace,
        seconds: f64,
    ) -> Self {
        let full = scene.settings.size;
        let pixels = f64::from(full.element_product());
        let mut left = seconds - pixels * pace.pixel.unwrap_or(FIRST_GUESS);
        let [least, middle, most] = SIDES;
        let side = preview.map_or(least, |film| (full.y / film.size().y).clamp(least, middle));
        let looks = pixels / f64::from(side * side) * pace.place.unwrap_or(FIRST_GUESS);
        let side = if looks <= FIRST_LOOK * left { side } else { most };
        let start = Instant::now();
        let size = (full / side).max(UVec2::ONE);
        let pitch = full.as_vec2() / size.as_vec2();
        let width = size.x as usize;
        let mut blocks = vec![Place::unknown(); width * size.y as usize];
        blocks.par_chunks_exact_mut(width).zip(0..size.y).for_each(|(row, y)| {
            let middles: Vec<Vec2> =
                (0..size.x).map(|x| (Vec2::new(x as f32, y as f32) + 0.5) * pitch).collect();
            places(scene, &middles, row);
        });
        let took = start.elapsed().as_secs_f64();
        left -= took;
        note(&mut pace.place, took, blocks.len());
        // Planes must go on to the four blocks beside. What only touches the corner of a block is found with the next step.
        let mut edges = vec![false; blocks.len()];
        edges.par_chunks_exact_mut(width).zip(0..size.y as usize).for_each(|(edges, y)| {
            for (x, edge) in edges.iter_mut().enumerate() {
                let here = &blocks[y * width + x];
                let pixel = sheet.pixel(sheet.own(here.position).z.max(0.0));
                let differs = |x: usize, y: usize| !here.continues(&blocks[y * width + x], pixel);
                *edge = x > 0 && differs(x - 1, y)
                    || x + 1 < width && differs(x + 1, y)
                    || y > 0 && differs(x, y - 1)
                    || y + 1 < size.y as usize && differs(x, y + 1);
            }
        });
        let count = edges.iter().filter(|&&edge| edge).count();
        for (block, edge) in blocks.iter_mut().zip(edges) {
            block.edge = edge;
        }
        let worth =
            preview.map_or(0.0, |film| film.size().element_product() as f32 / full.element_product() as f32);
        let at_edges = count as f64 * pixels / blocks.len() as f64;
        let place = pace.place.unwrap_or(FIRST_GUESS);
        let looks = |(step, again): (u32, f64)| at_edges / f64::from(step) * again;
        let fits = |step: (u32, f64), left: f64| (looks(step) * place <= left).then_some(step);
        // A look stands for pixels of its own block.
        let steps = || STEPS.into_iter().filter(|(step, _)| *step <= side);
        let step = steps().find_map(|step| fits(step, left));
        let in_overtime = |step| fits(step, left.max(0.0) + OVERTIME * seconds);
        let step = step.or_else(|| steps().next_back().and_then(in_overtime));
        Self { size, step: step.map(|(step, _)| step), blocks, preview, worth }
    }

    /// Pixels of block column `u` of a row of `width`.
    pub fn columns(&self, u: u32, width: u32) -> Range<u32> {
        part(u, self.size.x, width)
    }

    /// Rows of pixels of block row `v` of a picture of so many rows.
    pub fn rows(&self, v: u32, height: u32) -> Range<u32> {
        part(v, self.size.y, height)
    }

    pub fn at(&self, x: u32, y: u32) -> &Place {
        &self.blocks[(y * self.size.x + x) as usize]
    }

    /// What the preview shows at pixel (x, y) of a picture of `full` pixels.
    pub fn own_color(&self, [x, y]: [u32; 2], full: UVec2) -> Vec3 {
        self.preview.map_or(Vec3::ZERO, |film| {
            let small = film.size();
            film.pixel(x * small.x / full.x, y * small.y / full.y).mean().as_vec3()
        })
    }

    /// What the preview shows at pixel (x, y) of a picture of `full` pixels, or beside it, of the surface at `place`, and what that
    /// counts: nearly nothing if it shows another.
    pub fn color(&self, [x, y]: [u32; 2], full: UVec2, place: &Place, pixel: f32) -> Vec4 {
        let Some(film) = self.preview else { return Vec4::ZERO };
        let small = film.size();
        let (u, v) = (x * small.x / full.x, y * small.y / full.y);
        let color = |u: u32, v: u32, worth: f32| film.pixel(u, v).mean().as_vec3().extend(worth);
        let is_it = |u: u32, v: u32| {
            let middle = |i: u32, small: u32, blocks: u32| (2 * i + 1) * blocks / (2 * small);
            let block = self.at(middle(u, small.x, self.size.x), middle(v, small.y, self.size.y));
            place.continues(block, 8.0 * pixel)
        };
        if is_it(u, v) {
            return color(u, v, self.worth);
        }
        let rows = v.saturating_sub(1)..(v + 2).min(small.y);
        let columns = u.saturating_sub(1)..(u + 2).min(small.x);
        let mut around = rows.flat_map(|v| columns.clone().map(move |u| (u, v)));
        match around.find(|&(u, v)| is_it(u, v)) {
            Some((u, v)) => color(u, v, self.worth),
            None => color(u, v, self.worth.min(NOTHING)),
        }
    }
}
