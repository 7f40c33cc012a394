//! What is seen at first in each pixel, without any light: depth, normal, base colour, and what finding it costs.
//!
//! A grid is filled coarse to fine, as far as there is time: its first level shows at once.

use super::TraceScene;
use super::surface::Interaction;
use crate::bvh::inspect::Order;
use crate::bvh::{Hit, Ray};
use glam::{UVec2, Vec2, Vec3};
use rayon::prelude::*;

/// The first surface behind a pixel's middle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FirstSurface {
    /// Along the line of sight, scene units; infinite where there is nothing.
    pub depth: f32,
    /// Unit shading normal toward the eye; zero where there is nothing.
    pub normal: Vec3,
    /// Base colour; white for lamps.
    pub albedo: Vec3,
}

/// What the camera ray through a pixel's middle costs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Boxes tested.
    pub boxes: u32,
    /// Triangles tested.
    pub triangles: u32,
}

/// One value for each pixel, that of a larger block until its own is there.
#[derive(Clone, Debug)]
pub struct Grid<T> {
    size: UVec2,
    /// Index into [`SCALES`] of the level that is being filled.
    level: usize,
    /// Rows of blocks of that level that are filled.
    rows: u32,
    cells: Vec<T>,
}

/// Sides of blocks.
const SCALES: [u32; 4] = [8, 4, 2, 1];
/// Rows of blocks between two looks at the clock.
const BAND: u32 = 8;

impl<T: Copy + Default + Send + Sync> Grid<T> {
    /// Nothing known yet.
    #[must_use]
    pub fn new(size: UVec2) -> Self {
        Self { size, level: 0, rows: 0, cells: vec![T::default(); size.element_product() as usize] }
    }

    /// Width and height.
    #[must_use]
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// Whether each pixel has its own value.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.level == SCALES.len()
    }

    /// Whether each pixel has at least the value of its largest block.
    #[must_use]
    pub fn is_covered(&self) -> bool {
        self.level > 0
    }

    /// In rows from the top.
    #[must_use]
    pub fn cells(&self) -> &[T] {
        &self.cells
    }

    /// Goes on as long as `keep_going`, but to the end of the first level in any case. `row` is given the
    /// places of a row in the picture, and fills in their values.
    pub fn refine(&mut self, keep_going: impl Fn() -> bool, row: impl Fn(&[Vec2], &mut [T]) + Sync) {
        while !self.is_complete() && (!self.is_covered() || keep_going()) {
            let scale = SCALES[self.level];
            let rows = self.size.y.div_ceil(scale);
            let band = BAND.min(rows - self.rows);
            let (width, first) = (self.size.x, self.rows * scale);
            let last = (first + band * scale).min(self.size.y);
            self.cells[(first * width) as usize..(last * width) as usize]
                .par_chunks_mut((width * scale) as usize)
                .zip(self.rows..self.rows + band)
                .for_each(|(cells, y)| fill(cells, width, y, scale, &row));
            self.rows += band;
            if self.rows == rows {
                (self.level, self.rows) = (self.level + 1, 0);
            }
        }
    }
}

/// Fills row `y` of blocks.
fn fill<T: Copy + Default>(
    cells: &mut [T],
    width: u32,
    y: u32,
    scale: u32,
    row: &impl Fn(&[Vec2], &mut [T]),
) {
    let middle = |i: u32| (i * scale) as f32 + 0.5 * scale as f32;
    let places: Vec<Vec2> = (0..width.div_ceil(scale)).map(|x| Vec2::new(middle(x), middle(y))).collect();
    let mut values = vec![T::default(); places.len()];
    row(&places, &mut values);
    for line in cells.chunks_mut(width as usize) {
        for (block, &value) in line.chunks_mut(scale as usize).zip(&values) {
            block.fill(value);
        }
    }
}

/// Fills in the first surfaces at `places` of the picture.
pub fn first_surfaces(scene: &TraceScene, places: &[Vec2], values: &mut [FirstSurface]) {
    let size = scene.settings.size;
    let rays: Vec<Ray> = places.iter().map(|&place| scene.viewpoint.ray(place, size)).collect();
    let mut hits = vec![None; rays.len()];
    // What is there by half is there.
    scene.closest_hits(&rays, &mut hits, |_| true, |_, _| 0.5);
    for ((value, ray), hit) in values.iter_mut().zip(&rays).zip(&hits) {
        *value = first_surface(scene, ray, hit.as_ref());
    }
}

fn first_surface(scene: &TraceScene, ray: &Ray, hit: Option<&Hit>) -> FirstSurface {
    let t_max = hit.map_or(f32::INFINITY, |hit| hit.t);
    if let Some(lamp) = scene.lights.closest(&Ray { t_max, ..*ray }) {
        let depth = scene.viewpoint.depth(ray, lamp.hit.t);
        return FirstSurface { depth, normal: -ray.direction, albedo: Vec3::ONE };
    }
    let Some(hit) = hit else { return FirstSurface { depth: f32::INFINITY, ..FirstSurface::default() } };
    let (instance, surface) = scene.surface_at(hit);
    let at = Interaction::new(scene, instance, hit, ray);
    let texel = scene.texture(surface.base_color_texture, at.uvs) * at.color;
    FirstSurface {
        depth: scene.viewpoint.depth(ray, hit.t),
        normal: at.normal,
        albedo: surface.material.base_color * texel.truncate(),
    }
}

/// Fills in the costs of camera rays at `places` of the picture.
pub fn costs(scene: &TraceScene, places: &[Vec2], values: &mut [Cost]) {
    for (value, &place) in values.iter_mut().zip(places) {
        let ray = scene.viewpoint.ray(place, scene.settings.size);
        let (_, visits) = scene.geometry.tlas.inspect(&ray, Order::NearFirst, false, |_| {});
        *value = Cost { boxes: visits.boxes, triangles: visits.triangles };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn a_grid_is_whole_at_once_and_exact_in_the_end() {
        for size in [UVec2::new(1, 1), UVec2::new(37, 19), UVec2::new(8, 200), UVec2::new(64, 3)] {
            let mut grid = Grid::<[u32; 2]>::new(size);
            let place = |places: &[Vec2], values: &mut [[u32; 2]]| {
                for (value, place) in values.iter_mut().zip(places) {
                    *value = place.as_uvec2().to_array().map(|i| i + 1);
                }
            };
            grid.refine(|| false, place);
            assert!(grid.is_covered());
            let cells = || (0..size.y).flat_map(|y| (0..size.x).map(move |x| [x, y]));
            for (cell, [x, y]) in grid.cells().iter().zip(cells()) {
                let block = [x, y].map(|i| i / 8 * 8 + 4 + 1);
                assert_eq!(*cell, block, "{size}");
            }
            // In small steps.
            while !grid.is_complete() {
                let once = Cell::new(true);
                grid.refine(|| once.replace(false), place);
            }
            for (cell, [x, y]) in grid.cells().iter().zip(cells()) {
                assert_eq!(*cell, [x + 1, y + 1], "{size}");
            }
        }
    }
}
