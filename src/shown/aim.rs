//! Which old pixels show what new ones show, for several pixels of one surface at once.

use crate::trace::camera::Sheet;
use crate::trace::place::{Place, Spot};
use glam::{UVec2, Vec3, Vec4};

/// Surfaces count as the same up to an angle of this cosine, ...
const ALIKE: f32 = 0.9;
/// ... and up to a distance of so many pixels from the other one's plane.
const NEAR: f32 = 4.0;
/// Pixels beside a pixel, but for the one at (−1, −1), where one looks first if there is nothing in its own.
const OTHERS: &[[f32; 2]] =
    &[[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, 1.0]];

/// Pixels that are looked up together: plain loops over so many are vectors to the compiler.
pub const RUN: usize = 16;

/// The old picture, and the way into it.
pub struct Old<'a> {
    pub size: UVec2,
    pub sheet: Sheet,
    pub cells: &'a [Vec4],
    pub spots: &'a [Spot],
    /// Cells are of the middles of pixels alone, so that those of outlines are of one surface.
    pub is_sharp: bool,
}

/// Rays of the new picture as linear functions of the place, in render space and in the old camera's own: the value at
/// (0, 0), and what each pixel across and down adds.
pub struct Ways {
    origin: [Vec3; 3],
    direction: [Vec3; 3],
    old_origin: [Vec3; 3],
    old_direction: [Vec3; 3],
}

/// Middles of the pixels of a run, x and y. What is beyond it may be anything finite.
pub type Middles = [[f32; RUN]; 2];

/// Where the plane of a surface is for each pixel of a run, and where that was in the old picture.
pub struct Aims {
    /// In render space.
    pub points: [[f32; RUN]; 3],
    /// In the new picture; not positive or not finite where there is no plane.
    pub depth: [f32; RUN],
    /// In the old picture, pixels, ...
    pub at: [[f32; RUN]; 2],
    /// ... and how far away.
    pub old_depth: [f32; RUN],
    /// Middles of the pixels.
    pub middles: Middles,
    /// The share of an old pixel that a new one shows, along one side, at most 1: one old pixel for many new ones says less
    /// about each.
    pub spread: [f32; RUN],
    /// What is so far away from the middle of a pixel is beside it, pixels.
    pub near: [f32; RUN],
    /// What is so far away from the plane is not of it, scene units.
    pub reach: [f32; RUN],
}

/// The best old pixel for each of a run.
pub struct Finds {
    pub index: [u32; RUN],
    /// How far its light is from the middle of the pixel, pixels along one side; infinite if there is none.
    pub away: [f32; RUN],
    /// The same, with its direction.
    pub off: [[f32; RUN]; 2],
    /// The square of its length.
    pub square: [f32; RUN],
}

impl Ways {
    pub fn new(new: &Sheet, old: &Sheet) -> Self {
        let ([start, across, down], direction) = (new.origin, new.direction);
        Self {
            origin: new.origin,
            direction,
            old_origin: [old.own(start), old.axes * across, old.axes * down],
            old_direction: direction.map(|d| old.axes * d),
        }
    }

    /// For the plane of `place`, or for what is infinitely far.
    #[inline(always)]
    pub fn aim(&self, new: &Sheet, old: &Sheet, middles: Middles, place: &Place) -> Aims {
        let nothing = place.thing == Place::NOTHING;
        let [xs, ys] = &middles;
        let (o, d) = (&self.origin, &self.direction);
        let above = place.facet.dot(place.position - o[0]);
        let [sinks_x, sinks_y] = [place.facet.dot(o[1]), place.facet.dot(o[2])];
        let [falls, falls_x, falls_y] = [place.facet.dot(d[0]), place.facet.dot(d[1]), place.facet.dot(d[2])];
        let mut from = &self.old_origin;
        let to = &self.old_direction;
        if nothing {
            from = &[Vec3::ZERO; 3];
        }
        let mut depth = [1.0; RUN];
        if !nothing {
            for i in 0..RUN {
                let (x, y) = (xs[i], ys[i]);
                depth[i] = (above - sinks_x * x - sinks_y * y) / (falls + falls_x * x + falls_y * y);
            }
        }
        let (mut points, mut own) = ([[0.0; RUN]; 3], [[0.0; RUN]; 3]);
        for axis in 0..3 {
            for i in 0..RUN {
                let (x, y, t) = (xs[i], ys[i], depth[i]);
                points[axis][i] = at_pixel(o, axis, x, y) + at_pixel(d, axis, x, y) * t;
                own[axis][i] = at_pixel(from, axis, x, y) + at_pixel(to, axis, x, y) * t;
            }
        }
        let mut at = [[0.0; RUN]; 2];
        let (mut spread, mut near, mut reach) = ([1.0; RUN], [1.0; RUN], [0.0; RUN]);
        for i in 0..RUN {
            let there = old.place(Vec3::new(own[0][i], own[1][i], own[2][i]));
            (at[0][i], at[1][i]) = (there.x, there.y);
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
    pub fn point(&self, i: usize) -> Vec3 {
        Vec3::new(self.points[0][i], self.points[1][i], self.points[2][i])
    }

    /// The old pixels that show what the first `count` of these show if it is of the surface of `place`. Only at an edge it may have
    /// been at an edge.
    #[inline(always)]
    pub fn find(&self, new: &Sheet, old: &Old, place: &Place, count: usize, edge: bool) -> Finds {
        let none = [f32::INFINITY; RUN];
        let mut finds = Finds { index: [0; RUN], away: none, off: [none; 2], square: none };
        // Parallel rays see one point of what is infinitely far.
        if place.thing == Place::NOTHING && !(new.perspective && old.sheet.perspective) {
            return finds;
        }
        let most = if old.is_sharp || edge { u8::MAX } else { !Spot::OUTLINE };
        let wanted = (place, u32::from(most));
        self.look(&self.at, new, old, wanted, &mut finds);
        let (mut is_beside, mut is_lost) = (false, false);
        for i in 0..count {
            is_beside |= finds.away[i] > 1.25 * self.near[i];
            is_lost |= finds.away[i] == f32::INFINITY;
        }
        if is_beside && place.thing != Place::NOTHING {
            // It is of a place beside its pixel, and so are those of its neighbours: one on the other side is nearer.
            let mut beside = self.at;
            for (at, off) in beside.iter_mut().zip(&finds.off) {
                for (at, off) in at.iter_mut().zip(off) {
                    let step = if *off > 0.0 { -1.0 } else { 1.0 };
                    *at += if off.abs() > 0.5 { step } else { 0.0 };
                }
            }
            self.look(&beside, new, old, wanted, &mut finds);
            // The others, if there was another surface.
            for [x, y] in if is_lost { OTHERS } else { &[] } {
                let mut at = self.at;
                at[0].iter_mut().for_each(|at| *at += x);
                at[1].iter_mut().for_each(|at| *at += y);
                self.look(&at, new, old, wanted, &mut finds);
            }
        }
        finds
    }

    /// Takes the old pixels at `at` where they are better than what was found so far, if their [`Spot::keeps`] are at most so many.
    #[inline(always)]
    fn look(
        &self,
        at: &[[f32; RUN]; 2],
        new: &Sheet,
        old: &Old,
        (place, most): (&Place, u32),
        finds: &mut Finds,
    ) {
        let [width, height] = old.size.as_vec2().to_array();
        let (mut index, mut is_it) = ([0_u32; RUN], [false; RUN]);
        for i in 0..RUN {
            let (x, y) = (at[0][i], at[1][i]);
            is_it[i] = (self.depth[i] > 0.0) & (self.old_depth[i] > 0.0) & (x >= 0.0) & (y >= 0.0);
            is_it[i] &= (x < width) & (y < height);
            // Somewhere in it, also if it is not a number.
            let (x, y) = (x.max(0.0).min(width - 0.5), y.max(0.0).min(height - 0.5));
            index[i] = whole(y) * old.size.x + whole(x);
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
            let keeps = words[i] >> 24;
            is_it[i] &= (keeps & u32::from(!Spot::OUTLINE) > 0) & (keeps <= most);
        }
        if place.thing == Place::NOTHING {
            for i in 0..RUN {
                finds.index[i] = index[i];
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
            finds.index[i] = if is_better { index[i] } else { finds.index[i] };
            finds.away[i] = if is_better { x.abs().max(y.abs()) } else { finds.away[i] };
            finds.off[0][i] = if is_better { x } else { finds.off[0][i] };
            finds.off[1][i] = if is_better { y } else { finds.off[1][i] };
            finds.square[i] = if is_better { square } else { finds.square[i] };
        }
    }
}

/// The value of a linear function along one axis.
#[inline(always)]
fn at_pixel(of: &[Vec3; 3], axis: usize, x: f32, y: f32) -> f32 {
    of[0][axis] + of[1][axis] * x + of[2][axis] * y
}

/// Without what is behind the point, from 0 to 2²² (where it ends in .0, that or one less): what the conversion of the language
/// does beyond its range costs more than all of this.
#[inline(always)]
pub fn whole(x: f32) -> u32 {
    // What is added has no digits behind the point, so that they are rounded off.
    ((x - 0.5).max(0.0) + (1 << 23) as f32).to_bits() & 0x7f_ffff
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Viewpoint;

    /// Where pixel (8, 8) finds its sample, and how far from its middle, if that is in pixel (x, y) of the old picture,
    /// of the same view.
    fn found(x: u32, y: u32) -> (u32, f32) {
        found_from(8, x, y)
    }

    /// The same for pixel (own, own).
    fn found_from(own: u32, x: u32, y: u32) -> (u32, f32) {
        let size = UVec2::splat(16);
        let [new, sheet] = [(); 2].map(|()| Viewpoint::default().sheet(size));
        let [start, across, down] = new.direction;
        let middle = own as f32 + 0.5;
        let position = new.origin[0] + (start + (across + down) * middle) * 5.0;
        let place = Place { position, facet: Vec3::Z, thing: 3, keeps: 64, ..Place::unknown() };
        let mut spots = vec![Spot::UNKNOWN; 256];
        spots[(y * 16 + x) as usize] = Spot::from(&place);
        let old = Old { size, sheet, cells: &[Vec4::ONE; 256], spots: &spots, is_sharp: false };
        let ways = Ways::new(&new, &old.sheet);
        let finds = ways.aim(&new, &old.sheet, [[middle; RUN]; 2], &place).find(&new, &old, &place, 1, false);
        (finds.index[0], finds.away[0])
    }

    #[test]
    fn a_sample_is_found_in_its_pixel_and_in_all_beside_it() {
        for (x, y) in (7..10).flat_map(|y| (7..10).map(move |x| (x, y))) {
            let (index, away) = found(x, y);
            assert_eq!(index, y * 16 + x);
            assert!(away < 1e-3, "({x}, {y}): {away} pixels");
        }
        // To the last one.
        for x in [0, 15] {
            assert_eq!(found_from(x, x, x).0, x * 17);
        }
        for (x, y) in [(10, 8), (8, 6), (5, 5)] {
            assert_eq!(found(x, y).1, f32::INFINITY, "({x}, {y})");
        }
    }
}
