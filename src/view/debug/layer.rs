//! Lines in the scene, drawn over the picture: what surfaces hide is faint.

use crate::trace::Viewpoint;
use crate::trace::first::FirstSurface;
use glam::{UVec2, Vec2, Vec3};

/// A transparent picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layer {
    /// Width and height.
    pub size: UVec2,
    /// Red, green, blue and opacity, rows from the top.
    pub rgba: Vec<[u8; 4]>,
}

/// A line in render space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Its ends.
    pub ends: [Vec3; 2],
    /// sRGB.
    pub color: [u8; 3],
    /// Opacity where it is seen, 0 to 1.
    pub alpha: f32,
}

/// How dark it is around a line, compared with how opaque that is.
const SHADE: f32 = 0.7;
/// How opaque a line is behind surfaces, compared with before them.
const HIDDEN: f32 = 0.16;
/// A line that lies in a surface is before it: by this part of its depth.
const TOLERANCE: f32 = 2e-3;

impl Layer {
    /// Nothing drawn.
    #[must_use]
    pub fn new(size: UVec2) -> Self {
        Self { size, rgba: vec![[0; 4]; size.element_product() as usize] }
    }

    /// Draws lines as seen from `viewpoint`, whose first surfaces are `surfaces`, if they are known.
    pub fn draw(&mut self, lines: &[Line], viewpoint: &Viewpoint, surfaces: Option<&[FirstSurface]>) {
        for line in lines {
            let Some([a, b]) = self.on_screen(line, viewpoint) else { continue };
            self.draw_line(line, a, b, surfaces);
        }
    }

    /// Both ends in pixels, with the reciprocal of their depths; cut off before the eye and at the border.
    fn on_screen(&self, line: &Line, viewpoint: &Viewpoint) -> Option<[Vec3; 2]> {
        let [mut a, mut b] = line.ends;
        if !(a.is_finite() && b.is_finite()) {
            return None;
        }
        let depth = |p: Vec3| viewpoint.project(p, self.size).z;
        let near = 1e-3 * (b - a).length().max(1e-6);
        let (da, db) = (depth(a), depth(b));
        if da < near && db < near {
            return None;
        }
        let cut = |from: Vec3, to: Vec3, d0: f32, d1: f32| from.lerp(to, (near - d0) / (d1 - d0));
        if da < near {
            a = cut(a, b, da, db);
        } else if db < near {
            b = cut(b, a, db, da);
        }
        let ends = [a, b].map(|p| viewpoint.project(p, self.size)).map(|p| Vec3::new(p.x, p.y, 1.0 / p.z));
        self.cut_off(ends)
    }

    /// The part within the picture. Reference: Y.-D. Liang, B. A. Barsky, "A New Concept and Method for Line
    /// Clipping", ACM TOG 3(1), 1984.
    fn cut_off(&self, [a, b]: [Vec3; 2]) -> Option<[Vec3; 2]> {
        let (along, most) = (b - a, self.size.as_vec2() - 1.0);
        let (mut first, mut last) = (0f32, 1f32);
        for (p, q) in [(-along.x, a.x), (along.x, most.x - a.x), (-along.y, a.y), (along.y, most.y - a.y)] {
            if p == 0.0 && q < 0.0 {
                return None;
            } else if p < 0.0 {
                first = first.max(q / p);
            } else if p > 0.0 {
                last = last.min(q / p);
            }
        }
        (first <= last && first.is_finite() && last.is_finite())
            .then(|| [a + along * first, a + along * last])
    }

    fn draw_line(&mut self, line: &Line, a: Vec3, b: Vec3, surfaces: Option<&[FirstSurface]>) {
        let along = (b - a).truncate().abs();
        let steps = along.max_element().ceil().max(1.0);
        let steep = along.y > along.x;
        for i in 0..=steps as u32 {
            // Reciprocal depths are linear on the screen.
            let p = a.lerp(b, i as f32 / steps);
            let across = if steep { Vec2::X } else { Vec2::Y };
            let place = p.truncate() - 0.5 * across;
            let part = (place - place.floor()).dot(across);
            for (offset, share) in [(Vec2::ZERO, 1.0 - part), (across, part)] {
                let at = (place + offset).floor();
                if at.cmpge(Vec2::ZERO).all() && at.cmplt(self.size.as_vec2()).all() {
                    let index = (at.y as u32 * self.size.x + at.x as u32) as usize;
                    let surface = surfaces.and_then(|cells| cells.get(index));
                    let hidden = surface.is_some_and(|s| 1.0 / p.z > s.depth * (1.0 + TOLERANCE));
                    self.blend(index, line.color, line.alpha * share * if hidden { HIDDEN } else { 1.0 });
                }
            }
        }
    }

    /// Darkens what is around the lines, so that light ones are seen on light walls.
    pub fn shade_around(&mut self) {
        let width = (self.size.x as usize).max(1);
        // The most opaque of each pixel and those beside it, then of that above and below.
        let mut beside = Vec::with_capacity(self.rgba.len());
        for row in self.rgba.chunks_exact(width) {
            let most =
                |x: usize| row[x.saturating_sub(1)..(x + 2).min(width)].iter().map(|pixel| pixel[3]).max();
            beside.extend((0..width).map(|x| most(x).unwrap_or(0)));
        }
        let rows: Vec<&[u8]> = beside.chunks_exact(width).collect();
        for (y, line) in self.rgba.chunks_exact_mut(width).enumerate() {
            let [above, here, below] = [y.saturating_sub(1), y, (y + 1).min(rows.len() - 1)].map(|y| rows[y]);
            for (x, pixel) in line.iter_mut().enumerate() {
                let most = above[x].max(here[x]).max(below[x]);
                // Most of a picture has no lines.
                if most > 0 {
                    *pixel = over_shade(*pixel, SHADE * f32::from(most) / 255.0);
                }
            }
        }
    }

    /// Puts a colour over what is there.
    fn blend(&mut self, index: usize, color: [u8; 3], alpha: f32) {
        let old = self.rgba[index];
        let under = f32::from(old[3]) / 255.0 * (1.0 - alpha);
        let sum = alpha + under;
        if sum <= 0.0 {
            return;
        }
        let mix = |c: usize| ((f32::from(color[c]) * alpha + f32::from(old[c]) * under) / sum + 0.5) as u8;
        self.rgba[index] = [mix(0), mix(1), mix(2), (sum * 255.0 + 0.5) as u8];
    }

    /// Puts it over opaque sRGB bytes of the same size.
    pub fn cover(&self, rgba: &mut [u8]) {
        for (pixel, over) in rgba.chunks_exact_mut(4).zip(&self.rgba).filter(|(_, over)| over[3] > 0) {
            let alpha = u32::from(over[3]);
            for (byte, &c) in pixel[..3].iter_mut().zip(over) {
                *byte = ((u32::from(c) * alpha + u32::from(*byte) * (255 - alpha) + 127) / 255) as u8;
            }
        }
    }
}

/// A colour over so much black.
fn over_shade([r, g, b, own]: [u8; 4], shade: f32) -> [u8; 4] {
    let own = f32::from(own) / 255.0;
    let sum = own + shade * (1.0 - own);
    let mix = |c: u8| (f32::from(c) * own / sum + 0.5) as u8;
    [mix(r), mix(g), mix(b), (sum * 255.0 + 0.5) as u8]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: UVec2 = UVec2::new(64, 48);

    fn line(a: Vec3, b: Vec3) -> Line {
        Line { ends: [a, b], color: [0, 255, 0], alpha: 1.0 }
    }

    #[test]
    fn a_line_is_where_its_points_are_seen() {
        let viewpoint = Viewpoint::default();
        let mut layer = Layer::new(SIZE);
        let ends = [Vec3::new(-0.3, -0.2, -2.0), Vec3::new(0.5, 0.4, -6.0)];
        layer.draw(&[line(ends[0], ends[1])], &viewpoint, None);
        let mut drawn = 0.0;
        for i in 0..=100 {
            let p = viewpoint.project(ends[0].lerp(ends[1], i as f32 / 100.0), SIZE).truncate();
            let (x, y) = (p.x as usize, p.y as usize);
            drawn += f32::from(layer.rgba[y * SIZE.x as usize + x][3]) / 255.0;
        }
        assert!(drawn > 60.0, "{drawn} of 101");
        let pixels = layer.rgba.iter().filter(|p| p[3] > 0).count();
        assert!(pixels < 40, "a line, no plane: {pixels}");
    }

    #[test]
    fn around_a_line_it_is_darker_and_nowhere_else() {
        let mut layer = Layer::new(SIZE);
        let ends = [Vec3::new(-0.3, 0.0, -2.0), Vec3::new(0.3, 0.0, -2.0)];
        layer.draw(&[Line { color: [255; 3], ..line(ends[0], ends[1]) }], &Viewpoint::default(), None);
        let before = layer.clone();
        layer.shade_around();
        let mut white = vec![255; SIZE.element_product() as usize * 4];
        layer.cover(&mut white);
        assert!(white.iter().any(|&c| c < 180), "seen on white");
        let width = SIZE.x as usize;
        for (i, pixel) in layer.rgba.iter().enumerate() {
            let rows = [i.wrapping_sub(width), i, i + width];
            let near = rows.into_iter().flat_map(|i| [i.wrapping_sub(1), i, i + 1]);
            let has_line = near.filter_map(|i| before.rgba.get(i)).any(|pixel| pixel[3] > 0);
            assert_eq!(pixel[3] > 0, has_line, "{i}");
            assert!(pixel[3] >= before.rgba[i][3]);
        }
    }

    #[test]
    fn what_a_surface_hides_is_faint() {
        let viewpoint = Viewpoint::default();
        let wall = vec![FirstSurface { depth: 3.0, ..FirstSurface::default() }; 64 * 48];
        let opacity = |z: f32| {
            let mut layer = Layer::new(SIZE);
            layer.draw(&[line(Vec3::new(-0.5, 0.0, z), Vec3::new(0.5, 0.0, z))], &viewpoint, Some(&wall));
            layer.rgba.iter().map(|p| u32::from(p[3])).sum::<u32>()
        };
        assert!(opacity(-2.9) > 4 * opacity(-3.1), "{} {}", opacity(-2.9), opacity(-3.1));
        assert!(opacity(-3.0) > 4 * opacity(-3.1), "in the surface is not behind it");
        assert!(opacity(-3.1) > 0);
    }

    #[test]
    fn lines_from_anywhere_to_anywhere_do_no_harm() {
        let viewpoint = Viewpoint::default();
        let far = [0.0, 1.0, -1.0, 1e30, -1e30, f32::NAN, f32::INFINITY, -1e-30];
        let points: Vec<Vec3> =
            far.iter().flat_map(|&x| far.iter().map(move |&z| Vec3::new(x, 0.5 * x, z))).collect();
        let mut layer = Layer::new(SIZE);
        let lines: Vec<Line> = points.iter().flat_map(|&a| points.iter().map(move |&b| line(a, b))).collect();
        layer.draw(&lines, &viewpoint, None);
        Layer::new(UVec2::ONE).draw(&lines, &viewpoint, None);
    }
}
