//! Samples of one view, found again in the next.
//!
//! Backward, from the new picture: where the surface of a pixel was in the old one, and whether that is what was
//! seen there. Old samples keep the exact place that they are of, so that small errors do not add up from step to
//! step. After B. Walter, G. Drettakis, S. Parker, "Interactive Rendering using the Render Cache", 1999, which goes
//! forward, and D. Nehab et al., "Accelerating Real-Time Shading with Reverse Reprojection Caching", 2007.

use super::{MOST, Shown};
use crate::bvh::simd::{Job, Simd};
use crate::trace::camera::Sheet;
use crate::trace::place::{Place, Spot, places};
use crate::trace::{Film, TraceScene};
use glam::{UVec2, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::time::Instant;

/// Surfaces count as the same up to an angle of this cosine, ...
const ALIKE: f32 = 0.9;
/// ... and up to a distance of so many pixels from the other one's plane.
const NEAR: f32 = 4.0;
/// Sides of the blocks of the new picture in whose middle one looks, pixels: as large as the preview's pixels, between
/// these two, or the last if there is no time. Around it the surface is continued as a plane.
const SIDES: [u32; 3] = [2, 4, 8];
/// Of the time for carrying over, what looking may take before one knows where the edges are.
const FIRST_LOOK: f64 = 0.6;
/// A preview that counts less than this share of the old samples is left out.
const NOTABLE: f32 = 0.02;
/// Old pixels that are worth less are left alone, samples.
const LEAST: f32 = 1e-3;
/// Pixels beside a pixel, but for the one at (1, 1), where one looks first if there is nothing in its own.
const OTHERS: &[[f32; 2]] =
    &[[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]];

/// The old picture, and the way into it.
struct Old<'a> {
    size: UVec2,
    sheet: Sheet,
    cells: &'a [Vec4],
    spots: &'a [Spot],
}

/// A row of the new picture: rays as linear functions of x, in render space and in the old camera's own.
struct Row {
    /// Middle of it, pixels.
    y: f32,
    origin: [Vec3; 2],
    direction: [Vec3; 2],
    old_origin: [Vec3; 2],
    old_direction: [Vec3; 2],
}

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
        self.kept.resize(count, Vec4::ZERO);
        self.spare.resize(count, Spot::UNKNOWN);
        if std::mem::take(&mut self.is_kept) {
            std::mem::swap(&mut self.cells, &mut self.kept);
        }
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

/// What carrying over costs on this machine in this scene.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    /// Seconds for one place that is looked at.
    pub place: Option<f64>,
    /// Seconds for one pixel, apart from that.
    pixel: Option<f64>,
}

/// Before anything was measured: seconds for a pixel or a place.
const FIRST_GUESS: f64 = 2e-8;

/// Learns that `count` of something took so long. Half the old value, so that one hiccup of the machine is no rule.
pub(super) fn note(pace: &mut Option<f64>, seconds: f64, count: usize) {
    let measured = seconds / count.max(1) as f64;
    *pace = Some(pace.map_or(measured, |old| 0.5 * (old + measured)));
}

/// The new picture in blocks, and its preview.
struct Grid<'a> {
    size: UVec2,
    /// What is in the middle of each.
    blocks: Vec<Place>,
    /// Pixels of blocks that see an edge are looked at one by one: so many, or none.
    exact: f64,
    preview: Option<&'a Film>,
    /// What a sample of the preview counts: it is of many pixels.
    worth: f32,
}

impl<'a> Grid<'a> {
    fn new(
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
        let seconds = start.elapsed().as_secs_f64();
        left -= seconds;
        note(&mut pace.place, seconds, blocks.len());
        // Planes must go on from block to block.
        let mut edges = vec![false; blocks.len()];
        edges.par_chunks_exact_mut(width).zip(0..size.y as usize).for_each(|(edges, y)| {
            for (x, edge) in edges.iter_mut().enumerate() {
                let here = &blocks[y * width + x];
                let pixel = sheet.pixel(sheet.own(here.position).z.max(0.0));
                let rows = y.saturating_sub(1)..(y + 2).min(size.y as usize);
                let columns = x.saturating_sub(1)..(x + 2).min(width);
                *edge = rows.into_iter().any(|y| {
                    blocks[y * width..][columns.clone()].iter().any(|other| !here.continues(other, pixel))
                });
            }
        });
        let count = edges.iter().filter(|&&edge| edge).count();
        for (block, edge) in blocks.iter_mut().zip(edges) {
            block.edge = edge;
        }
        let worth =
            preview.map_or(0.0, |film| film.size().element_product() as f32 / full.element_product() as f32);
        let exact = count as f64 * pixels / blocks.len() as f64;
        let is_cheap = exact * pace.place.unwrap_or(FIRST_GUESS) <= left;
        Self { size, exact: if is_cheap { exact } else { 0.0 }, blocks, preview, worth }
    }

    fn at(&self, x: u32, y: u32) -> &Place {
        &self.blocks[(y * self.size.x + x) as usize]
    }

    /// What the preview shows at pixel (x, y) of a picture of `full` pixels.
    fn own_color(&self, [x, y]: [u32; 2], full: UVec2) -> Vec3 {
        self.preview.map_or(Vec3::ZERO, |film| {
            let small = film.size();
            film.pixel(x * small.x / full.x, y * small.y / full.y).mean().as_vec3()
        })
    }

    /// What the preview shows at pixel (x, y) of a picture of `full` pixels, or beside it, of the surface at `place`.
    fn color(&self, [x, y]: [u32; 2], full: UVec2, place: &Place, pixel: f32) -> Vec3 {
        let Some(film) = self.preview else { return Vec3::ZERO };
        let small = film.size();
        let (u, v) = (x * small.x / full.x, y * small.y / full.y);
        let color = |u: u32, v: u32| film.pixel(u, v).mean().as_vec3();
        let is_it = |u: u32, v: u32| {
            let middle = |i: u32, small: u32, blocks: u32| (2 * i + 1) * blocks / (2 * small);
            let block = self.at(middle(u, small.x, self.size.x), middle(v, small.y, self.size.y));
            place.continues(block, 8.0 * pixel)
        };
        if is_it(u, v) {
            return color(u, v);
        }
        let rows = v.saturating_sub(1)..(v + 2).min(small.y);
        let columns = u.saturating_sub(1)..(u + 2).min(small.x);
        let mut around = rows.flat_map(|v| columns.clone().map(move |u| (u, v)));
        let (u, v) = around.find(|&(u, v)| is_it(u, v)).unwrap_or((u, v));
        color(u, v)
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
    let mut exact = Vec::new();
    if grid.exact > 0.0 {
        let at_edges = (0..old.size.x).filter(|&x| grid.at(x * grid.size.x / old.size.x, v).edge);
        let middles: Vec<Vec2> = at_edges.map(|x| Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).collect();
        exact.resize(middles.len(), Place::unknown());
        places(scene, &middles, &mut exact);
    }
    scene.geometry.tlas.isa().run(CarryRow { new, old, grid, row, y, exact, kept, found })
}

struct CarryRow<'a> {
    new: &'a Sheet,
    old: &'a Old<'a>,
    grid: &'a Grid<'a>,
    row: Row,
    y: u32,
    /// What the pixels of blocks that see an edge show, one after the other.
    exact: Vec<Place>,
    kept: &'a mut [Vec4],
    found: &'a mut [Spot],
}

impl Job for CarryRow<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<S: Simd>(self, _: S) -> usize {
        let Self { new, old, grid, row, y, exact, kept, found } = self;
        let mut exact = exact.into_iter().peekable();
        let v = y * grid.size.y / old.size.y;
        let (mut carried, mut x) = (0, 0);
        while x < old.size.x {
            let u = x * grid.size.x / old.size.x;
            let block = grid.at(u, v);
            let (place, end) = match exact.next_if(|_| block.edge) {
                Some(place) => (place, x + 1),
                None => (*block, ((u + 1) * old.size.x).div_ceil(grid.size.x)),
            };
            let end = end.min(x + RUN as u32);
            let surface = Spot::from(&Place { edge: false, ..place });
            let aims = row.aim(new, &old.sheet, x, &place);
            let finds = aims.find(new, old, &place);
            for (i, x) in (x..end).enumerate() {
                let (kept, found) = (&mut kept[x as usize], &mut found[x as usize]);
                let there = &old.spots[finds.index[i] as usize];
                let cell = old.cells[finds.index[i] as usize];
                let keeps = f32::from(place.keeps.min(there.keeps));
                let weight = cell.w.min(MOST).min(keeps) * aims.spread[i] * aims.spread[i];
                // Beside an edge it may be of the next pixel.
                if finds.away[i] <= 2.0 * aims.near[i] && weight > LEAST {
                    // At an edge the preview may be of another surface; beside many old samples it says nothing.
                    *kept = if block.edge || grid.worth < NOTABLE * weight {
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
            x = end;
        }
        carried
    }
}

/// Pixels side by side that show one surface. Plain loops over so many are vectors to the compiler.
const RUN: usize = 8;

/// Where the plane of a surface is for each pixel of a run, and where that was in the old picture.
struct Aims {
    /// In render space.
    points: [[f32; RUN]; 3],
    /// In the new picture; not positive or not finite where there is no plane.
    depth: [f32; RUN],
    /// In the old picture, pixels, ...
    at: [[f32; RUN]; 2],
    /// ... and how far away.
    old_depth: [f32; RUN],
    /// Middles of the pixels.
    middles: [[f32; RUN]; 2],
    /// The share of an old pixel that a new one shows, along one side, at most 1: one old pixel for many new ones says less
    /// about each.
    spread: [f32; RUN],
    /// What is so far away from the middle of a pixel is beside it, pixels.
    near: [f32; RUN],
    /// What is so far away from the plane is not of it, scene units.
    reach: [f32; RUN],
}

/// The best old pixel for each of a run.
struct Finds {
    index: [u32; RUN],
    /// How far its light is from the middle of the pixel, pixels along one side; infinite if there is none.
    away: [f32; RUN],
    /// The same, with its direction.
    off: [[f32; RUN]; 2],
    /// The square of its length.
    square: [f32; RUN],
}

impl Row {
    fn new(new: &Sheet, old: &Sheet, y: f32) -> Self {
        let at = |[start, across, down]: [Vec3; 3]| [start + down * y + across * 0.5, across];
        let (origin, direction) = (at(new.origin), at(new.direction));
        Self {
            y,
            origin,
            direction,
            old_origin: [old.own(origin[0]), old.axes * origin[1]],
            old_direction: direction.map(|d| old.axes * d),
        }
    }

    /// From pixel `first` on, for the plane of `place`, or for what is infinitely far.
    #[inline(always)]
    fn aim(&self, new: &Sheet, old: &Sheet, first: u32, place: &Place) -> Aims {
        let nothing = place.thing == Place::NOTHING;
        let ([o, o_across], [d, d_across]) = (self.origin, self.direction);
        let (above, sinks) = (place.facet.dot(place.position - o), place.facet.dot(o_across));
        let (falls, falls_across) = (place.facet.dot(d), place.facet.dot(d_across));
        let [mut from, mut from_across] = self.old_origin;
        let [to, to_across] = self.old_direction;
        if nothing {
            (from, from_across) = (Vec3::ZERO, Vec3::ZERO);
        }
        let mut xs = [0.0; RUN];
        for (i, x) in xs.iter_mut().enumerate() {
            *x = first as f32 + i as f32;
        }
        let mut depth = [1.0; RUN];
        if !nothing {
            for i in 0..RUN {
                depth[i] = (above - sinks * xs[i]) / (falls + falls_across * xs[i]);
            }
        }
        let (mut points, mut own) = ([[0.0; RUN]; 3], [[0.0; RUN]; 3]);
        for axis in 0..3 {
            for i in 0..RUN {
                let (x, t) = (xs[i], depth[i]);
                points[axis][i] = o[axis] + o_across[axis] * x + (d[axis] + d_across[axis] * x) * t;
                own[axis][i] = from[axis] + from_across[axis] * x + (to[axis] + to_across[axis] * x) * t;
            }
        }
        let [mut at, mut middles] = [[[0.0; RUN]; 2]; 2];
        let (mut spread, mut near, mut reach) = ([1.0; RUN], [1.0; RUN], [0.0; RUN]);
        for i in 0..RUN {
            let there = old.place(Vec3::new(own[0][i], own[1][i], own[2][i]));
            (at[0][i], at[1][i]) = (there.x, there.y);
            (middles[0][i], middles[1][i]) = (xs[i] + 0.5, self.y);
            if !nothing {
                let (pixel, old_pixel) = (new.pixel(depth[i]), old.pixel(own[2][i]));
                spread[i] = (pixel / old_pixel).min(1.0);
                near[i] = 0.8 / spread[i];
                reach[i] = NEAR * pixel.max(old_pixel);
            }
        }
        Aims { points, depth, at, old_depth: own[2], middles, spread, near, reach }
    }
}

impl Aims {
    #[inline(always)]
    fn point(&self, i: usize) -> Vec3 {
        Vec3::new(self.points[0][i], self.points[1][i], self.points[2][i])
    }

    /// The old pixels that show what these show if it is of the surface of `place`.
    #[inline(always)]
    fn find(&self, new: &Sheet, old: &Old, place: &Place) -> Finds {
        let none = [f32::INFINITY; RUN];
        let mut finds = Finds { index: [0; RUN], away: none, off: [none; 2], square: none };
        // Parallel rays see one point of what is infinitely far.
        if place.thing == Place::NOTHING && !(new.perspective && old.sheet.perspective) {
            return finds;
        }
        self.look(&self.at, new, old, place, &mut finds);
        let (mut is_beside, mut is_lost) = (false, false);
        for i in 0..RUN {
            is_beside |= finds.away[i] > self.near[i];
            is_lost |= finds.away[i] == f32::INFINITY;
        }
        if is_beside && place.thing != Place::NOTHING {
            // It is of a place beside its pixel, and so are those of its neighbours: one on the other side is nearer.
            let mut beside = self.at;
            for (at, off) in beside.iter_mut().zip(&finds.off) {
                for i in 0..RUN {
                    let step = if off[i] > 0.0 { -1.0 } else { 1.0 };
                    at[i] += if off[i].abs() > 0.5 { step } else { 0.0 };
                }
            }
            self.look(&beside, new, old, place, &mut finds);
            // The others, if there was another surface.
            for [x, y] in if is_lost { OTHERS } else { &[] } {
                let mut at = self.at;
                for i in 0..RUN {
                    at[0][i] += x;
                    at[1][i] += y;
                }
                self.look(&at, new, old, place, &mut finds);
            }
        }
        finds
    }

    /// Takes the old pixels at `at` where they are better than what was found so far.
    #[inline(always)]
    fn look(&self, at: &[[f32; RUN]; 2], new: &Sheet, old: &Old, place: &Place, finds: &mut Finds) {
        let [width, height] = old.size.as_vec2().to_array();
        let (mut index, mut is_it) = ([0; RUN], [false; RUN]);
        for i in 0..RUN {
            let (x, y) = (at[0][i], at[1][i]);
            is_it[i] = (self.depth[i] > 0.0) & (self.old_depth[i] > 0.0) & (x >= 0.0) & (y >= 0.0);
            is_it[i] &= (x < width) & (y < height);
            // Somewhere in it, also if it is not a number.
            let (x, y) = (x.max(0.0).min(width - 1.0), y.max(0.0).min(height - 1.0));
            index[i] = y as i32 * old.size.x as i32 + x as i32;
        }
        let (mut points, mut words) = ([[0.0; RUN]; 3], [0_u32; RUN]);
        for i in 0..RUN {
            let there = &old.spots[index[i] as usize];
            [points[0][i], points[1][i], points[2][i]] = there.position.to_array();
            is_it[i] &= there.thing == place.thing;
            let [x, y, z] = there.facet;
            words[i] = u32::from_le_bytes([x as u8, y as u8, z as u8, there.keeps]);
        }
        let mut facets = [[0.0; RUN]; 3];
        for (axis, facet) in facets.iter_mut().enumerate() {
            for i in 0..RUN {
                facet[i] = ((words[i] << (24 - 8 * axis)) as i32 >> 24) as f32 * (1.0 / 127.0);
            }
        }
        for i in 0..RUN {
            is_it[i] &= words[i] >> 24 > 0;
        }
        if place.thing == Place::NOTHING {
            for i in 0..RUN {
                finds.index[i] = index[i] as u32;
                finds.away[i] = if is_it[i] { 0.0 } else { f32::INFINITY };
            }
            return;
        }
        for i in 0..RUN {
            let there = Vec3::new(points[0][i], points[1][i], points[2][i]);
            let facet = Vec3::new(facets[0][i], facets[1][i], facets[2][i]);
            let off_plane = place.facet.dot(there - self.point(i)).abs();
            is_it[i] &= (facet.dot(place.facet) > ALIKE) & (off_plane <= self.reach[i]);
            let place = new.place(new.own(there));
            let (x, y) = (place.x - self.middles[0][i], place.y - self.middles[1][i]);
            let square = x * x + y * y;
            let is_better = is_it[i] & (square < finds.square[i]);
            finds.index[i] = if is_better { index[i] as u32 } else { finds.index[i] };
            finds.away[i] = if is_better { x.abs().max(y.abs()) } else { finds.away[i] };
            finds.off[0][i] = if is_better { x } else { finds.off[0][i] };
            finds.off[1][i] = if is_better { y } else { finds.off[1][i] };
            finds.square[i] = if is_better { square } else { finds.square[i] };
        }
    }
}
