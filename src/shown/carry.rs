//! Samples of one view, found again in the next.
//!
//! Backward, from the new picture: where the surface of a pixel was in the old one, and whether that is what was
//! seen there. Old samples keep the exact place that they are of, so that small errors do not add up from step to
//! step. After B. Walter, G. Drettakis, S. Parker, "Interactive Rendering using the Render Cache", 1999, which goes
//! forward, and D. Nehab et al., "Accelerating Real-Time Shading with Reverse Reprojection Caching", 2007.

use super::aim::{Middles, Old, RUN, Ways, whole};
use super::grid::{Grid, note};
use super::{MOST, Shown};
use crate::bvh::simd::{Job, Simd};
use crate::trace::camera::Sheet;
use crate::trace::place::{Place, Spot, places};
use crate::trace::{Film, TraceScene};
use glam::{Vec2, Vec4};
use rayon::prelude::*;
use std::ops::Range;
use std::time::Instant;

/// A preview that counts less than this share of the old samples is left out.
const NOTABLE: f32 = 0.02;
/// Old pixels that are worth less are left alone, samples.
const LEAST: f32 = 1e-3;

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
        if std::mem::take(&mut self.is_kept) {
            std::mem::swap(&mut self.cells, &mut self.kept);
        }
        self.kept.resize(count, Vec4::ZERO);
        self.spare.resize(count, Spot::UNKNOWN);
        let old = Old { size, sheet: before.sheet(size), cells: &self.cells, spots: &self.spots };
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
        let carry = Carry { scene, new: &new, old: &old, grid: &grid, ways: &ways };
        let carried: usize = bands.into_par_iter().map(|band| carry.band(band)).sum();
        self.share = carried as f64 / count as f64;
        std::mem::swap(&mut self.spots, &mut self.spare);
        self.exact_rows = 0;
        let looked = grid.exact * self.pace.place.unwrap_or(0.0);
        note(&mut self.pace.pixel, (start.elapsed().as_secs_f64() - looked).max(0.0), count);
    }
}

/// A row of blocks of the new picture.
struct Band<'a> {
    v: u32,
    rows: Range<u32>,
    /// All pixels of `rows`.
    kept: &'a mut [Vec4],
    found: &'a mut [Spot],
}

/// Pixels that show one plane; [`RUN`] at most.
struct Run {
    place: Place,
    /// Whether they may see an edge.
    edge: bool,
    columns: Range<u32>,
    rows: Range<u32>,
}

impl Run {
    /// Whether what is at `place` up to column `end` is a part of it.
    fn takes(&self, place: &Place, end: u32, new: &Sheet) -> bool {
        let off = self.place.facet.dot(place.position - self.place.position);
        end - self.columns.start <= RUN as u32
            && self.place.thing == place.thing
            && self.place.facet == place.facet
            && off.abs() <= 0.1 * new.pixel(new.own(place.position).z)
    }

    /// The middles of its pixels, row by row.
    #[inline(always)]
    fn middles(&self) -> Middles {
        let (left, top) = (self.columns.start as f32 + 0.5, self.rows.start as f32 + 0.5);
        let width = self.columns.len() as f32;
        let per_pixel = 1.0 / width;
        let mut middles = [[0.0; RUN]; 2];
        for i in 0..RUN {
            let along = i as f32;
            let row = whole((along + 0.5) * per_pixel) as f32;
            middles[0][i] = left + (along - row * width);
            middles[1][i] = top + row;
        }
        middles
    }
}

/// All that one needs to know of both pictures.
#[derive(Clone, Copy)]
struct Carry<'a> {
    scene: &'a TraceScene<'a>,
    new: &'a Sheet,
    old: &'a Old<'a>,
    grid: &'a Grid<'a>,
    ways: &'a Ways,
}

impl Carry<'_> {
    /// Fills in a band; returns how many pixels have old samples.
    fn band(&self, band: Band<'_>) -> usize {
        let runs = self.runs(band.v, &band.rows);
        self.scene.geometry.tlas.isa().run(CarryBand { carry: *self, runs, band })
    }

    /// The runs of a band.
    fn runs(&self, v: u32, rows: &Range<u32>) -> Vec<Run> {
        let grid = self.grid;
        let span = |u: u32| grid.span(u, self.old.size.x);
        let mut runs: Vec<Run> = Vec::with_capacity((grid.size.x * rows.len() as u32) as usize);
        // Blocks of one plane, some rows at once; from left to right, which memory is made for.
        let whole = |u: u32| grid.step.is_none() || !grid.at(u, v).edge;
        let together = (RUN as u32 * grid.size.x / self.old.size.x).clamp(1, RUN as u32);
        for rows in parts(rows.clone(), together) {
            for u in (0..grid.size.x).filter(|&u| whole(u)) {
                let block = grid.at(u, v);
                for columns in parts(span(u), RUN as u32 / rows.len() as u32) {
                    runs.push(Run { place: *block, edge: block.edge, columns, rows: rows.clone() });
                }
            }
        }
        let Some(step) = grid.step else { return runs };
        // Block by block, so that rays which are traced together stay together.
        let edges: Vec<u32> = (0..grid.size.x).filter(|&u| !whole(u)).collect();
        let half = 0.5 * step as f32;
        let middles: Vec<Vec2> = edges
            .iter()
            .flat_map(|&u| rows.clone().flat_map(move |y| span(u).step_by(step as usize).map(move |x| (x, y))))
            .map(|(x, y)| Vec2::new(x as f32 + half, y as f32 + 0.5))
            .collect();
        let mut exact = vec![Place::unknown(); middles.len()];
        places(self.scene, &middles, &mut exact);
        let mut first = 0;
        let mut along: Vec<Vec<Run>> = rows.clone().map(|_| Vec::new()).collect();
        for u in edges {
            for (y, along) in rows.clone().zip(&mut along) {
                for columns in parts(span(u), step) {
                    let place = exact[first];
                    first += 1;
                    match along.last_mut() {
                        Some(last)
                            if last.columns.end == columns.start
                                && last.takes(&place, columns.end, self.new) =>
                        {
                            last.columns.end = columns.end;
                        }
                        _ => along.push(Run { place, edge: true, columns, rows: y..y + 1 }),
                    }
                }
            }
        }
        runs.extend(along.into_iter().flatten());
        runs
    }
}

/// A range in parts of `length`; the last may be shorter.
fn parts(whole: Range<u32>, length: u32) -> impl Iterator<Item = Range<u32>> {
    let end = whole.end;
    whole.step_by(length.max(1) as usize).map(move |start| start..(start + length.max(1)).min(end))
}

struct CarryBand<'a> {
    carry: Carry<'a>,
    runs: Vec<Run>,
    band: Band<'a>,
}

impl Job for CarryBand<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> usize {
        let Carry { new, old, grid, ways, .. } = self.carry;
        let Band { rows: band, kept, found, .. } = self.band;
        let mut carried = 0;
        for run in self.runs {
            let Run { place, edge, ref columns, ref rows } = run;
            let surface = Spot::from(&Place { edge: false, ..place });
            let aims = ways.aim(new, &old.sheet, run.middles(), &place);
            let finds = aims.find(new, old, &place, columns.len() * rows.len());
            let mut i = 0;
            for y in rows.clone() {
                let first = ((y - band.start) * old.size.x) as usize;
                let pixels = first + columns.start as usize..first + columns.end as usize;
                let pixels = kept[pixels.clone()].iter_mut().zip(&mut found[pixels]);
                for (x, (kept, found)) in columns.clone().zip(pixels) {
                    let there = &old.spots[finds.index[i % RUN] as usize];
                    let cell = old.cells[finds.index[i % RUN] as usize];
                    let keeps = f32::from(place.keeps.min(there.keeps));
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
                        *found = *there;
                        if away > near {
                            found.position = aims.point(i % RUN);
                        }
                        carried += 1;
                    } else {
                        let depth = aims.depth[i % RUN];
                        let is_there = depth > 0.0 && depth.is_finite() && place.thing != Place::NOTHING;
                        let (position, depth) =
                            if is_there { (aims.point(i % RUN), depth) } else { (place.position, 1.0) };
                        let color = grid.color([x, y], old.size, &place, new.pixel(depth));
                        *kept = color.extend(grid.worth);
                        *found = Spot { position, ..surface };
                    }
                    i += 1;
                }
            }
        }
        carried
    }
}
