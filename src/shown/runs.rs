//! Which pixels of the new picture show one plane: whole blocks, and pieces of rows where these see edges.
//!
//! There one looks along each row at knots, as many as there is time for, and then between any two that differ, until what
//! is between them is a pixel: outlines are right to the pixel for a tenth of the rays.

use super::aim::{Middles, RUN, whole};
use super::grid::Grid;
use crate::trace::TraceScene;
use crate::trace::camera::Sheet;
use crate::trace::place::{Place, places};
use glam::Vec2;
use std::ops::Range;

/// Pixels that show one plane; [`RUN`] at most.
pub struct Run {
    pub place: Place,
    /// Whether they may see an edge.
    pub edge: bool,
    pub columns: Range<u32>,
    pub rows: Range<u32>,
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
    pub fn middles(&self) -> Middles {
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

/// The runs of block row `v`, and how many looks it took to find them.
pub fn runs(scene: &TraceScene, new: &Sheet, grid: &Grid, v: u32) -> (Vec<Run>, usize) {
    let [width, height] = scene.settings.size.to_array();
    let rows = &grid.rows(v, height);
    let span = |u: u32| grid.columns(u, width);
    let mut runs: Vec<Run> = Vec::with_capacity((grid.size.x * rows.len() as u32) as usize);
    // Blocks of one plane, some rows at once; from left to right, which memory is made for.
    let whole = |u: u32| grid.step.is_none() || !grid.at(u, v).edge;
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
        .flat_map(|&u| rows.clone().flat_map(move |y| span(u).step_by(step as usize).map(move |x| (x, y))))
        .map(|(x, y)| Vec2::new(x as f32 + half, y as f32 + 0.5))
        .collect();
    let mut exact = vec![Place::unknown(); middles.len()];
    places(scene, &middles, &mut exact);
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
        looks += bisect(scene, new, rows, &mut along, gap);
        gap *= 0.5;
    }
    for (y, knots) in rows.clone().zip(along) {
        let first = runs.len();
        for Knot { columns, place, .. } in knots.into_iter().filter(|knot| !knot.columns.is_empty()) {
            match runs[first..].last_mut() {
                Some(last) if last.columns.end == columns.start && last.takes(&place, columns.end, new) => {
                    last.columns.end = columns.end;
                }
                _ => runs.push(Run { place, edge: true, columns, rows: y..y + 1 }),
            }
        }
    }
    (runs, looks)
}

/// Looks between any two knots so far apart, side by side, that show different surfaces. Returns how often.
fn bisect(scene: &TraceScene, new: &Sheet, rows: &Range<u32>, along: &mut [Vec<Knot>], gap: f32) -> usize {
    let mut between = Vec::new();
    for (row, knots) in along.iter().enumerate() {
        for (i, pair) in knots.windows(2).enumerate() {
            let [a, b] = pair else { continue };
            let differs = || {
                let pixel = new.pixel(new.own(a.place.position).z.max(0.0));
                !a.place.continues(&b.place, pixel)
            };
            if a.columns.end == b.columns.start && b.x - a.x == gap && differs() {
                between.push((row, i, Vec2::new(0.5 * (a.x + b.x), (rows.start + row as u32) as f32 + 0.5)));
            }
        }
    }
    let middles: Vec<Vec2> = between.iter().map(|(.., at)| *at).collect();
    let mut found = vec![Place::unknown(); middles.len()];
    places(scene, &middles, &mut found);
    // From right to left, so that what is not yet done stays where it is.
    for ((row, i, at), place) in between.into_iter().zip(found).rev() {
        let knots = &mut along[row];
        let columns = split(knots, i, gap);
        knots.insert(i + 1, Knot { x: at.x, columns, place });
    }
    middles.len()
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
