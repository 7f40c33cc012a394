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
use glam::{UVec2, Vec2, Vec4};
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
        let phase = self.fills % SPARSE;
        let carry = Carry { scene, new: &new, old: &old, grid: &grid, ways: &ways, phase };
        let lost: Vec<_> = bands.into_par_iter().map(|band| carry.band(band)).collect();
        let missing: usize = lost.iter().map(|lost| lost.missing.len()).sum();
        self.share = (count - missing) as f64 / count as f64;
        std::mem::swap(&mut self.spots, &mut self.spare);
        self.exact_rows = 0;
        let looks: usize = lost.iter().map(|lost| lost.looks).sum();
        let looked = looks as f64 * self.pace.place.unwrap_or(0.0);
        note(&mut self.pace.pixel, (start.elapsed().as_secs_f64() - looked).max(0.0), count);
        // Without a preview the film itself has one of each pixel.
        if preview.is_some() {
            self.fill(scene, &lost, grid.worth, FILLING * seconds);
        }
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
            && (self.place.thing == Place::NOTHING || off.abs() <= 0.1 * new.pixel(new.own(place.position).z))
    }

    /// The middles of its pixels, row by row.
    #[inline(always)]
    fn middles(&self) -> Middles {
        let (left, top) = (self.columns.start as f32 + 0.5, self.rows.start as f32 + 0.5);
        let width = self.columns.len() as f32;
        let per_pixel = 1.0 / width;
        let (mut xs, mut ys) = ([0.0; RUN], [0.0; RUN]);
        for (i, (x, y)) in xs.iter_mut().zip(&mut ys).enumerate() {
            let along = i as f32;
            let row = whole((along + 0.5) * per_pixel) as f32;
            (*x, *y) = (left + (along - row * width), top + row);
        }
        [xs, ys]
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
    /// Which of [`SPARSE`] pixels side by side may be poor.
    phase: u32,
}

impl Carry<'_> {
    /// Fills in a band.
    fn band(&self, band: Band<'_>) -> Lost {
        let (runs, looks) = self.runs(band.v, &band.rows);
        let lost = self.scene.geometry.tlas.isa().run(CarryBand { carry: *self, runs, band });
        Lost { looks, ..lost }
    }

    /// The runs of a band, and how many looks it took to find them.
    fn runs(&self, v: u32, rows: &Range<u32>) -> (Vec<Run>, usize) {
        let grid = self.grid;
        let span = |u: u32| grid.span(u, self.old.size.x);
        let mut runs: Vec<Run> = Vec::with_capacity((grid.size.x * rows.len() as u32) as usize);
        // Blocks of one plane, some rows at once; from left to right, which memory is made for.
        let whole = |u: u32| grid.step.is_none() || !grid.at(u, v).edge;
        let width = self.old.size.x;
        let together = ((RUN as u32 * grid.size.x + width / 2) / width).clamp(1, RUN as u32);
        for rows in parts(rows.clone(), together) {
            for u in (0..grid.size.x).filter(|&u| whole(u)) {
                let block = grid.at(u, v);
                for columns in parts(span(u), RUN as u32 / rows.len() as u32) {
                    runs.push(Run { place: *block, edge: block.edge, columns, rows: rows.clone() });
                }
            }
        }
        let Some(step) = grid.step else { return (runs, 0) };
        // Block by block, so that rays which are traced together stay together.
        let edges: Vec<u32> = (0..grid.size.x).filter(|&u| !whole(u)).collect();
        let half = 0.5 * step as f32;
        let middles: Vec<Vec2> = edges
            .iter()
            .flat_map(|&u| {
                rows.clone().flat_map(move |y| span(u).step_by(step as usize).map(move |x| (x, y)))
            })
            .map(|(x, y)| Vec2::new(x as f32 + half, y as f32 + 0.5))
            .collect();
        let mut exact = vec![Place::unknown(); middles.len()];
        places(self.scene, &middles, &mut exact);
        let mut exact = exact.into_iter();
        let mut along: Vec<Vec<Knot>> = rows.clone().map(|_| Vec::new()).collect();
        for u in edges {
            for knots in &mut along {
                let columns = parts(span(u), step);
                knots.extend(columns.zip(&mut exact).map(|(columns, place)| Knot::new(columns, step, place)));
            }
        }
        let (mut gap, mut looks) = (step as f32, middles.len());
        while gap > 1.0 {
            looks += self.bisect(rows, &mut along, gap);
            gap *= 0.5;
        }
        for (y, knots) in rows.clone().zip(along) {
            let first = runs.len();
            for Knot { columns, place, .. } in knots.into_iter().filter(|knot| !knot.columns.is_empty()) {
                match runs[first..].last_mut() {
                    Some(last)
                        if last.columns.end == columns.start && last.takes(&place, columns.end, self.new) =>
                    {
                        last.columns.end = columns.end;
                    }
                    _ => runs.push(Run { place, edge: true, columns, rows: y..y + 1 }),
                }
            }
        }
        (runs, looks)
    }

    /// Looks between any two knots so far apart, side by side, that show different surfaces. Returns how often.
    fn bisect(&self, rows: &Range<u32>, along: &mut [Vec<Knot>], gap: f32) -> usize {
        let mut between = Vec::new();
        for (row, knots) in along.iter().enumerate() {
            for (i, pair) in knots.windows(2).enumerate() {
                let [a, b] = pair else { continue };
                let differs = || {
                    let pixel = self.new.pixel(self.new.own(a.place.position).z.max(0.0));
                    !a.place.continues(&b.place, pixel)
                };
                if a.columns.end == b.columns.start && b.x - a.x == gap && differs() {
                    between.push((
                        row,
                        i,
                        Vec2::new(0.5 * (a.x + b.x), (rows.start + row as u32) as f32 + 0.5),
                    ));
                }
            }
        }
        let middles: Vec<Vec2> = between.iter().map(|(.., at)| *at).collect();
        let mut found = vec![Place::unknown(); middles.len()];
        places(self.scene, &middles, &mut found);
        // From right to left, so that what is not yet done stays where it is.
        for ((row, i, at), place) in between.into_iter().zip(found).rev() {
            let knots = &mut along[row];
            let columns = split(knots, i, gap);
            knots.insert(i + 1, Knot { x: at.x, columns, place });
        }
        middles.len()
    }
}

/// Makes room between knot number `i` and the next, so far apart, for one in their middle; says for which pixels.
fn split(knots: &mut [Knot], i: usize, gap: f32) -> Range<u32> {
    let middle = knots[i].x + 0.5 * gap;
    // The last of a block may stand for few.
    let most = knots[i + 1].columns.end;
    let (start, end) = (from(middle - 0.25 * gap).min(most), from(middle + 0.25 * gap).min(most));
    knots[i].columns.end = start;
    knots[i + 1].columns.start = end;
    start..end
}

/// The first pixel whose middle is not left of `x`.
fn from(x: f32) -> u32 {
    (x - 0.5).ceil() as u32
}

/// A look along a row, and the pixels that it stands for.
struct Knot {
    x: f32,
    columns: Range<u32>,
    place: Place,
}

/// A range in parts of `length`; the last may be shorter.
fn parts(whole: Range<u32>, length: u32) -> impl Iterator<Item = Range<u32>> {
    let end = whole.end;
    whole.step_by(length.max(1) as usize).map(move |start| start..(start + length.max(1)).min(end))
}

impl Knot {
    /// In the middle of as many pixels as a look usually stands for.
    fn new(columns: Range<u32>, step: u32, place: Place) -> Self {
        Self { x: columns.start as f32 + 0.5 * step as f32, columns, place }
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
                        if kept.w < POOR && (x + 5 * y) % SPARSE == phase {
                            lost.poor.push(UVec2::new(x, y));
                        }
                    } else {
                        let depth = aims.depth[i % RUN];
                        let is_there = depth > 0.0 && depth.is_finite() && place.thing != Place::NOTHING;
                        let (position, depth) =
                            if is_there { (aims.point(i % RUN), depth) } else { (place.position, 1.0) };
                        let color = grid.color([x, y], old.size, &place, new.pixel(depth));
                        *kept = color.extend(grid.worth);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn however_often_one_looks_again_each_pixel_is_of_one_knot() {
        for (side, step) in [(2, 1), (2, 2), (4, 4), (8, 2), (8, 4), (8, 8)] {
            for width in 1..200_u32 {
                let blocks = (width / side).max(1);
                let spans =
                    (0..blocks).map(|u| (u * width).div_ceil(blocks)..((u + 1) * width).div_ceil(blocks));
                let knot = |columns| Knot::new(columns, step, Place::unknown());
                let mut knots: Vec<Knot> = spans.flat_map(|span| parts(span, step)).map(knot).collect();
                let mut gap = step as f32;
                while gap > 1.0 {
                    // As if all were different.
                    for i in (1..knots.len()).rev() {
                        let [a, b] = [&knots[i - 1], &knots[i]];
                        if a.columns.end == b.columns.start && b.x - a.x == gap {
                            let x = 0.5 * (a.x + b.x);
                            let columns = split(&mut knots, i - 1, gap);
                            knots.insert(i, Knot { x, columns, place: Place::unknown() });
                        }
                    }
                    gap *= 0.5;
                }
                let mut next = 0;
                for columns in
                    knots.into_iter().map(|knot| knot.columns).filter(|columns| !columns.is_empty())
                {
                    assert_eq!(columns.start, next, "{width} pixels in blocks of {side}, once for {step}");
                    next = columns.end;
                }
                assert_eq!(next, width, "{width} pixels in blocks of {side}, once for {step}");
            }
        }
    }
}
