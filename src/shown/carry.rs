//! Samples of one view, found again in the next.
//!
//! Backward, from the new picture: where the surface of a pixel was in the old one, and whether that is what was
//! seen there. Old samples keep the exact place that they are of, so that small errors do not add up from step to
//! step. After B. Walter, G. Drettakis, S. Parker, "Interactive Rendering using the Render Cache", 1999, which goes
//! forward, and D. Nehab et al., "Accelerating Real-Time Shading with Reverse Reprojection Caching", 2007.

use super::{MOST, Shown};
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
/// How closely one looks, least first: least and largest side of the blocks of the new picture
/// in whose middle one looks (as large as the preview's pixels in between; around it the surface is continued as a
/// plane), and the share of them that may see an edge, so that their pixels are looked at one by one.
const EFFORTS: [([u32; 2], f32); 4] = [([8, 8], 0.0), ([4, 8], 0.0), ([4, 4], 0.1), ([2, 4], 0.2)];
/// Seconds of carrying over above which one looks less closely, and below which more.
const SECONDS: [f64; 2] = [0.007, 0.013];
/// A preview that counts less than this share of the old samples is left out.
const NOTABLE: f32 = 0.02;
/// Old pixels that are worth less are left alone, samples.
const LEAST: f32 = 1e-3;
/// Pixels beside a pixel.
const AROUND: [(f32, f32); 8] =
    [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];

/// The old picture, and the way into it.
struct Old<'a> {
    size: UVec2,
    sheet: Sheet,
    cells: &'a [Vec4],
    spots: &'a [Spot],
}

/// A row of the new picture: rays as linear functions of x, in render space and in the old camera's own.
struct Row {
    origin: [Vec3; 2],
    direction: [Vec3; 2],
    old_origin: [Vec3; 2],
    old_direction: [Vec3; 2],
}

impl Shown {
    /// Makes `kept` and `spots` those of `scene`'s viewpoint.
    pub(super) fn carry(&mut self, scene: &TraceScene, preview: Option<&Film>) {
        let Some(before) = self.viewpoint.replace(*scene.viewpoint) else { return };
        let size = self.size;
        let count = size.element_product() as usize;
        if self.spots.len() != count {
            self.spots.clear();
            self.spots.resize(count, Spot::UNKNOWN);
        }
        let new = scene.viewpoint.sheet(size);
        let start = Instant::now();
        let grid = Grid::new(scene, &new, preview, EFFORTS.len() - 1 - self.saved.min(EFFORTS.len() - 1));
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
        let seconds = start.elapsed().as_secs_f64();
        let [little, much] = SECONDS;
        if seconds > much {
            self.saved = (self.saved + 1).min(EFFORTS.len() - 1);
        } else if seconds < little {
            self.saved = self.saved.saturating_sub(1);
        }
    }
}

/// The new picture in blocks, and its preview.
struct Grid<'a> {
    size: UVec2,
    /// What is in the middle of each.
    blocks: Vec<Place>,
    /// Pixels of blocks that see an edge are looked at one by one.
    exact: bool,
    preview: Option<&'a Film>,
    /// What a sample of the preview counts: it is of many pixels.
    worth: f32,
}

impl<'a> Grid<'a> {
    fn new(scene: &TraceScene, sheet: &Sheet, preview: Option<&'a Film>, effort: usize) -> Self {
        let full = scene.settings.size;
        let ([least, most], most_edges) = EFFORTS[effort];
        let side = preview.map_or(least, |film| (full.y / film.size().y).clamp(least, most));
        let size = (full / side).max(UVec2::ONE);
        let pitch = full.as_vec2() / size.as_vec2();
        let width = size.x as usize;
        let mut blocks = vec![Place::unknown(); width * size.y as usize];
        blocks.par_chunks_exact_mut(width).zip(0..size.y).for_each(|(row, y)| {
            let middles: Vec<Vec2> =
                (0..size.x).map(|x| (Vec2::new(x as f32, y as f32) + 0.5) * pitch).collect();
            places(scene, &middles, row);
        });
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
        Self { size, exact: count as f32 <= most_edges * blocks.len() as f32, blocks, preview, worth }
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
    let block_of = |x: u32| x * grid.size.x / old.size.x;
    let mut exact = Vec::new();
    if grid.exact {
        let at_edges: Vec<u32> = (0..old.size.x).filter(|&x| grid.at(block_of(x), v).edge).collect();
        let middles: Vec<Vec2> =
            at_edges.iter().map(|&x| Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).collect();
        exact.resize(middles.len(), Place::unknown());
        places(scene, &middles, &mut exact);
    }
    let mut exact = exact.into_iter();
    let mut carried = 0;
    for ((x, kept), found) in (0..old.size.x).zip(kept).zip(found) {
        let block = grid.at(block_of(x), v);
        let place = if block.edge { exact.next().unwrap_or(*block) } else { *block };
        match row.find(new, old, x, y, &place) {
            Some(hit) => {
                let cell = old.cells[hit.index];
                // At an edge the preview may be of another surface; beside many old samples it says nothing.
                *kept = if block.edge || grid.worth < NOTABLE * hit.weight {
                    cell.truncate().extend(hit.weight)
                } else {
                    let preview = grid.own_color([x, y], old.size);
                    let sum = hit.weight + grid.worth;
                    let radiance = (cell.truncate() * hit.weight + preview * grid.worth) / sum;
                    radiance.extend(sum.min(MOST))
                };
                *found = old.spots[hit.index];
                if let Some(moved) = hit.moved {
                    found.position = moved;
                }
                carried += 1;
            }
            None => {
                let (position, depth) = row.meet(x, &place).unwrap_or((place.position, 1.0));
                let color = grid.color([x, y], old.size, &place, new.pixel(depth));
                *kept = color.extend(grid.worth);
                *found = Spot::from(&Place { position, edge: false, ..place });
            }
        }
    }
    carried
}

/// An old pixel.
struct Found {
    index: usize,
    /// How many samples it is worth.
    weight: f32,
    /// Where its light is taken to be of, if not of where it is.
    moved: Option<Vec3>,
}

impl Row {
    fn new(new: &Sheet, old: &Sheet, y: f32) -> Self {
        let at = |[start, across, down]: [Vec3; 3]| [start + down * y + across * 0.5, across];
        let (origin, direction) = (at(new.origin), at(new.direction));
        Self {
            origin,
            direction,
            old_origin: [old.own(origin[0]), old.axes * origin[1]],
            old_direction: direction.map(|d| old.axes * d),
        }
    }

    /// Where the ray of pixel `x` meets the plane of `place`, and how deep.
    #[inline(always)]
    fn meet(&self, x: u32, place: &Place) -> Option<(Vec3, f32)> {
        let at = |[start, across]: [Vec3; 2]| start + across * x as f32;
        let (origin, direction) = (at(self.origin), at(self.direction));
        let t = place.facet.dot(place.position - origin) / place.facet.dot(direction);
        // NaN where there is no plane.
        (t > 0.0 && t.is_finite()).then(|| (origin + direction * t, t))
    }

    /// The old pixel that shows what pixel `x` shows if it is of the surface of `place`.
    #[inline(always)]
    fn find(&self, new: &Sheet, old: &Old, x: u32, y: u32, place: &Place) -> Option<Found> {
        let at = |[start, across]: [Vec3; 2]| start + across * x as f32;
        if place.thing == Place::NOTHING {
            // Parallel rays see one point of what is infinitely far.
            if !(new.perspective && old.sheet.perspective) {
                return None;
            }
            let own = at(self.old_direction);
            let index = old.index(old.sheet.place(own), own.z)?;
            let there = &old.spots[index];
            let weight = old.cells[index].w.min(MOST);
            let is_it = there.thing == Place::NOTHING && there.keeps > 0 && weight > LEAST;
            return is_it.then_some(Found { index, weight, moved: None });
        }
        let (point, depth) = self.meet(x, place)?;
        let own = at(self.old_origin) + at(self.old_direction) * depth;
        let (pixel, old_pixel) = (new.pixel(depth), old.sheet.pixel(own.z));
        let reach = NEAR * pixel.max(old_pixel);
        let is_it = |index: usize| {
            let there = &old.spots[index];
            there.thing == place.thing
                && there.keeps > 0
                && there.facet().dot(place.facet) > ALIKE
                && place.facet.dot(there.position - point).abs() <= reach
        };
        let middle = Vec2::new(x as f32, y as f32) + 0.5;
        let off = |index: usize| new.place(new.own(old.spots[index].position)) - middle;
        // One old pixel for many new ones says less about each.
        let spread = (pixel / old_pixel).min(1.0);
        let near = 0.8 / spread;
        let center = old.sheet.place(own);
        let first = old.index(center, own.z)?;
        let (mut index, mut moved) = (first, None);
        let mut away = Vec2::INFINITY;
        if is_it(first) {
            away = off(first);
        }
        if away.abs().max_element() > near {
            // It is of a place beside its pixel, or of several surfaces: a neighbour may be nearer.
            for (dx, dy) in AROUND {
                let Some(other) = old.index(center + Vec2::new(dx, dy), own.z).filter(|&i| is_it(i)) else {
                    continue;
                };
                let its = off(other);
                if its.length_squared() < away.length_squared() {
                    (index, away) = (other, its);
                }
            }
            // Beside an edge it may be of the next pixel.
            if away.abs().max_element() > 2.0 * near {
                return None;
            }
            moved = (away.abs().max_element() > near).then_some(point);
        }
        let keeps = f32::from(place.keeps.min(old.spots[index].keeps));
        let weight = old.cells[index].w.min(MOST).min(keeps) * (spread * spread);
        (weight > LEAST).then_some(Found { index, weight, moved })
    }
}

impl Old<'_> {
    /// The pixel there.
    #[inline(always)]
    fn index(&self, at: Vec2, depth: f32) -> Option<usize> {
        let inside = depth > 0.0
            && at.x >= 0.0
            && at.y >= 0.0
            && at.x < self.size.x as f32
            && at.y < self.size.y as f32;
        inside.then(|| at.y as usize * self.size.x as usize + at.x as usize)
    }
}
