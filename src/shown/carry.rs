//! Samples of one view, found again in the next.
//!
//! Backward, from the new picture: where the surface of a pixel was in the old one, and whether that is what was
//! seen there. Old samples keep the exact place that they are of, so that small errors do not add up from step to
//! step. After B. Walter, G. Drettakis, S. Parker, "Interactive Rendering using the Render Cache", 1999, which goes
//! forward, and D. Nehab et al., "Accelerating Real-Time Shading with Reverse Reprojection Caching", 2007.

use super::aim::{Old, RUN, Row};
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
        let width = size.x as usize;
        let carried: usize = self
            .kept
            .par_chunks_exact_mut(width)
            .zip(self.spare.par_chunks_exact_mut(width))
            .zip(0..size.y)
            .map(|((kept, found), y)| carry_row(scene, &new, &old, &grid, y, kept, found))
            .sum();
        self.share = carried as f64 / count as f64;
        std::mem::swap(&mut self.spots, &mut self.spare);
        self.exact_rows = 0;
        let looked = grid.exact * self.pace.place.unwrap_or(0.0);
        note(&mut self.pace.pixel, (start.elapsed().as_secs_f64() - looked).max(0.0), count);
    }
}

/// Fills in row `y`; returns how many pixels have old samples.
fn carry_row(
    scene: &TraceScene,
    new: &Sheet,
    old: &Old,
    grid: &Grid<'_>,
    y: u32,
    kept: &mut [Vec4],
    found: &mut [Spot],
) -> usize {
    let row = Row::new(new, &old.sheet, y as f32 + 0.5);
    let v = y * grid.size.y / old.size.y;
    let span = |u: u32| grid.span(u, old.size.x);
    let mut exact = Vec::new();
    if let Some(step) = grid.step {
        let edges = (0..grid.size.x).filter(|&u| grid.at(u, v).edge);
        let starts = edges.flat_map(|u| span(u).step_by(step as usize));
        let half = 0.5 * step as f32;
        let middles: Vec<Vec2> = starts.map(|x| Vec2::new(x as f32 + half, y as f32 + 0.5)).collect();
        exact.resize(middles.len(), Place::unknown());
        places(scene, &middles, &mut exact);
    }
    let mut exact = exact.into_iter();
    let mut runs: Vec<Run> = Vec::with_capacity(grid.size.x as usize);
    for u in 0..grid.size.x {
        let block = grid.at(u, v);
        let stride = grid.step.filter(|_| block.edge).unwrap_or(RUN as u32);
        for x in span(u).step_by(stride as usize) {
            let place = if block.edge { exact.next().unwrap_or(*block) } else { *block };
            let end = (x + stride).min(span(u).end);
            match runs.last_mut() {
                Some(last) if block.edge && last.takes(&place, end, new) => last.pixels.end = end,
                _ => runs.push(Run { place, edge: block.edge, pixels: x..end }),
            }
        }
    }
    scene.geometry.tlas.isa().run(CarryRow { new, old, grid, row, y, runs, kept, found })
}

/// Pixels side by side that show one plane; [`RUN`] at most.
struct Run {
    place: Place,
    /// Whether they may see an edge.
    edge: bool,
    pixels: Range<u32>,
}

impl Run {
    /// Whether what is at `place` up to pixel `end` is a part of it.
    fn takes(&self, place: &Place, end: u32, new: &Sheet) -> bool {
        let off = self.place.facet.dot(place.position - self.place.position);
        self.edge
            && end - self.pixels.start <= RUN as u32
            && self.place.thing == place.thing
            && self.place.facet == place.facet
            && off.abs() <= 0.1 * new.pixel(new.own(place.position).z)
    }
}

struct CarryRow<'a> {
    new: &'a Sheet,
    old: &'a Old<'a>,
    grid: &'a Grid<'a>,
    row: Row,
    y: u32,
    runs: Vec<Run>,
    kept: &'a mut [Vec4],
    found: &'a mut [Spot],
}

impl Job for CarryRow<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> usize {
        let Self { new, old, grid, row, y, runs, kept, found } = self;
        let mut carried = 0;
        for Run { place, edge, pixels } in runs {
            let surface = Spot::from(&Place { edge: false, ..place });
            let aims = row.aim(new, &old.sheet, pixels.start, &place);
            let finds = aims.find(new, old, &place, pixels.len());
            for (i, x) in pixels.enumerate() {
                let (kept, found) = (&mut kept[x as usize], &mut found[x as usize]);
                let there = &old.spots[finds.index[i] as usize];
                let cell = old.cells[finds.index[i] as usize];
                let keeps = f32::from(place.keeps.min(there.keeps));
                let weight = cell.w.min(MOST).min(keeps) * aims.spread[i] * aims.spread[i];
                // Beside an edge it may be of the next pixel.
                if finds.away[i] <= 2.0 * aims.near[i] && weight > LEAST {
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
                    if finds.away[i] > aims.near[i] {
                        found.position = aims.point(i);
                    }
                    carried += 1;
                } else {
                    let depth = aims.depth[i];
                    let is_there = depth > 0.0 && depth.is_finite() && place.thing != Place::NOTHING;
                    let (position, depth) =
                        if is_there { (aims.point(i), depth) } else { (place.position, 1.0) };
                    let color = grid.color([x, y], old.size, &place, new.pixel(depth));
                    *kept = color.extend(grid.worth);
                    *found = Spot { position, ..surface };
                }
            }
        }
        carried
    }
}
