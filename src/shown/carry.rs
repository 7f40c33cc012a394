//! Samples of one view, found again in the next.
//!
//! Backward, from the new picture: where the surface of a pixel was in the old one, and whether that is what was
//! seen there. Old samples keep the exact place that they are of, so that small errors do not add up from step to
//! step. After B. Walter, G. Drettakis, S. Parker, "Interactive Rendering using the Render Cache", 1999, which goes
//! forward, and D. Nehab et al., "Accelerating Real-Time Shading with Reverse Reprojection Caching", 2007.

use super::aim::{Old, RUN, Ways};
use super::fill::side;
use super::grid::{Grid, note};
use super::runs::{Run, runs};
use super::{MOST, Shown};
use crate::bvh::simd::{Job, Simd};
use crate::trace::camera::Sheet;
use crate::trace::place::{Place, Spot};
use crate::trace::{Film, TraceScene};
use glam::{UVec2, Vec4};
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// A preview that counts less than this share of the old samples is left out.
const NOTABLE: f32 = 0.02;
/// Pixels with fewer old samples are among the first to get new ones.
const POOR: f32 = 3.0;
/// One of so many is told of: they may be all of the picture.
const SPARSE: u32 = 16;
/// Of the time for carrying over, what new samples may take beside it.
const FILLING: f64 = 0.2;
/// Old pixels that are worth less are left alone, samples.
const LEAST: f32 = 0.02;

impl Shown {
    /// Makes `kept` and `spots` those of `scene`'s viewpoint, in about so many seconds.
    pub(super) fn carry(&mut self, scene: &TraceScene, preview: Option<&Film>, seconds: f64) {
        let Some(before) = self.viewpoint.replace(*scene.viewpoint) else { return };
        let size = self.size;
        let count = size.element_product() as usize;
        if self.spots.len() != count {
            self.spots.clear();
            self.spots.resize(count, Spot::UNKNOWN);
        }
        let new = scene.viewpoint.sheet(size);
        let grid = Grid::new(scene, &new, preview, &mut self.pace, seconds);
        let start = Instant::now();
        // Samples of the film are from anywhere in their pixels.
        let is_sharp = std::mem::take(&mut self.is_kept);
        if is_sharp {
            std::mem::swap(&mut self.cells, &mut self.kept);
        }
        self.kept.resize(count, Vec4::ZERO);
        self.spare.resize(count, Spot::UNKNOWN);
        let (cells, spots) = (&*self.cells, &*self.spots);
        let old = Old { size, sheet: before.sheet(size), cells, spots, is_sharp };
        let (mut kept, mut found) = (&mut *self.kept, &mut *self.spare);
        let mut bands = Vec::with_capacity(grid.size.y as usize);
        for v in 0..grid.size.y {
            let rows = grid.rows(v, size.y);
            let pixels = rows.len() * size.x as usize;
            let (own_kept, other_kept) = kept.split_at_mut(pixels);
            let (own_found, other_found) = found.split_at_mut(pixels);
            (kept, found) = (other_kept, other_found);
            bands.push(Band { v, rows, kept: own_kept, found: own_found });
        }
        let ways = Ways::new(&new, &old.sheet);
        let phase = self.fills % SPARSE;
        let carry = Carry { scene, new: &new, old: &old, grid: &grid, ways: &ways, phase };
        let mut lost: Vec<_> = bands.into_par_iter().map(|band| carry.band(band)).collect();
        std::mem::swap(&mut self.spots, &mut self.spare);
        lost.push(self.mark_outlines(&grid, &new));
        let missing: usize = lost.iter().map(|lost| lost.missing.len()).sum();
        self.share = (count - missing) as f64 / count as f64;
        self.exact_rows = 0;
        let looks: usize = lost.iter().map(|lost| lost.looks).sum();
        let looked = looks as f64 * self.pace.place.unwrap_or(0.0);
        note(&mut self.pace.pixel, (start.elapsed().as_secs_f64() - looked).max(0.0), count);
        // Without a preview the film itself has one of each pixel.
        if preview.is_some() {
            self.fill(scene, &lost, grid.worth, FILLING * seconds);
        }
    }

    /// Marks spots beside those of other surfaces, and returns those that lost what they had: it was of such a one.
    fn mark_outlines(&mut self, grid: &Grid, sheet: &Sheet) -> Lost {
        let [width, height] = self.size.to_array();
        let spots = &self.spots;
        let outlines = |v: u32| {
            let edges = (0..grid.size.x).filter(move |&u| grid.at(u, v).edge);
            let columns = edges.flat_map(move |u| grid.columns(u, width));
            let pixels = columns.flat_map(move |x| grid.rows(v, height).map(move |y| (x, y)));
            let at = move |x: u32, y: u32| (y * width + x) as usize;
            let is_outline = move |x: u32, y: u32| {
                let here = &spots[at(x, y)];
                let pixel = side(sheet, here);
                let differs = |x: u32, y: u32| !here.continues(&spots[at(x, y)], pixel);
                x > 0 && differs(x - 1, y)
                    || x + 1 < width && differs(x + 1, y)
                    || y > 0 && differs(x, y - 1)
                    || y + 1 < height && differs(x, y + 1)
            };
            let marked = move |(x, y)| (x, y, is_outline(x, y));
            pixels.map(marked).filter(move |&(x, y, now)| now || spots[at(x, y)].is_outline())
        };
        let found: Vec<(u32, u32, bool)> = (0..grid.size.y).into_par_iter().flat_map_iter(outlines).collect();
        let mut lost = Lost::default();
        for (x, y, is_outline) in found {
            let at = (y * width + x) as usize;
            self.spots[at] = self.spots[at].unmarked();
            if is_outline {
                self.spots[at].keeps |= Spot::OUTLINE;
            } else {
                self.kept[at].w = 0.0;
                lost.missing.push(UVec2::new(x, y));
            }
        }
        lost
    }
}

/// Pixels of which too little was known.
#[derive(Default)]
pub(super) struct Lost {
    /// Those without old samples.
    pub missing: Vec<UVec2>,
    /// Those with few.
    pub poor: Vec<UVec2>,
    /// How many looks it took to find out.
    looks: usize,
}

/// A row of blocks of the new picture.
struct Band<'a> {
    v: u32,
    rows: Range<u32>,
    /// All pixels of `rows`.
    kept: &'a mut [Vec4],
    found: &'a mut [Spot],
}

/// All that one needs to know of both pictures.
#[derive(Clone, Copy)]
struct Carry<'a> {
    scene: &'a TraceScene<'a>,
    new: &'a Sheet,
    old: &'a Old<'a>,
    grid: &'a Grid<'a>,
    ways: &'a Ways,
    /// Which of [`SPARSE`] pixels side by side may be poor.
    phase: u32,
}

impl Carry<'_> {
    /// Fills in a band.
    fn band(&self, band: Band<'_>) -> Lost {
        let (runs, looks) = runs(self.scene, self.new, self.grid, band.v);
        let lost = self.scene.geometry.tlas.isa().run(CarryBand { carry: *self, runs, band });
        Lost { looks, ..lost }
    }
}

struct CarryBand<'a> {
    carry: Carry<'a>,
    runs: Vec<Run>,
    band: Band<'a>,
}

impl Job for CarryBand<'_> {
    type Output = Lost;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> Lost {
        let Carry { new, old, grid, ways, .. } = self.carry;
        let Band { rows: band, kept, found, .. } = self.band;
        let (mut lost, phase) = (Lost::default(), self.carry.phase);
        for run in self.runs {
            let Run { place, edge, ref columns, ref rows } = run;
            let surface = Spot::from(&Place { edge: false, ..place });
            let aims = ways.aim(new, &old.sheet, run.middles(), &place);
            let finds = aims.find(new, old, &place, columns.len() * rows.len(), edge);
            let mut i = 0;
            for y in rows.clone() {
                let first = ((y - band.start) * old.size.x) as usize;
                let pixels = first + columns.start as usize..first + columns.end as usize;
                let pixels = kept[pixels.clone()].iter_mut().zip(&mut found[pixels]);
                for (x, (kept, found)) in columns.clone().zip(pixels) {
                    let there = &old.spots[finds.index[i % RUN] as usize];
                    let cell = old.cells[finds.index[i % RUN] as usize];
                    let keeps = f32::from(place.keeps.min(there.unmarked().keeps));
                    let spread = aims.spread[i % RUN];
                    let weight = cell.w.min(MOST).min(keeps) * spread * spread;
                    let (away, near) = (finds.away[i % RUN], aims.near[i % RUN]);
                    // Beside an edge it may be of the next pixel.
                    if away <= 2.0 * near && weight > LEAST {
                        // At an edge the preview may be of another surface; beside many old samples it says nothing.
                        *kept = if edge || grid.worth < NOTABLE * weight {
                            cell.truncate().extend(weight)
                        } else {
                            let preview = grid.own_color([x, y], old.size);
                            let sum = weight + grid.worth;
                            let radiance = (cell.truncate() * weight + preview * grid.worth) / sum;
                            radiance.extend(sum.min(MOST))
                        };
                        *found = if old.is_sharp { there.unmarked() } else { *there };
                        if away > near {
                            found.position = aims.point(i % RUN);
                        }
                        if kept.w < POOR && (x + 5 * y) % SPARSE == phase {
                            lost.poor.push(UVec2::new(x, y));
                        }
                    } else {
                        let depth = aims.depth[i % RUN];
                        let is_there = depth > 0.0 && depth.is_finite() && place.thing != Place::NOTHING;
                        let (position, depth) =
                            if is_there { (aims.point(i % RUN), depth) } else { (place.position, 1.0) };
                        *kept = grid.color([x, y], old.size, &place, new.pixel(depth));
                        *found = Spot { position, ..surface };
                        lost.missing.push(UVec2::new(x, y));
                    }
                    i += 1;
                }
            }
        }
        lost
    }
}
