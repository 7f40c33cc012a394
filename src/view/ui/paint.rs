//! egui's triangles onto the bytes of a picture.
//!
//! A card and some text are a few ten thousand pixels: with a software driver this takes less time than handing
//! them over, and what a screenshot holds is what the window shows, bit for bit.

use egui::epaint::{ClippedPrimitive, Mesh, Primitive, Vertex};
use egui::{Color32, ImageData, Rect, TextureId, TexturesDelta};
use glam::UVec2;
use std::collections::HashMap;

/// The pictures that egui's triangles refer to: its font, above all.
#[derive(Default)]
pub struct Painter {
    textures: HashMap<TextureId, Atlas>,
}

#[derive(Default)]
struct Atlas {
    width: usize,
    height: usize,
    pixels: Vec<Color32>,
}

/// Steps of a pixel that corners are rounded to, so that neighbouring triangles meet exactly.
const STEPS: f32 = 16.0;
/// Corners farther out than this would overflow; nothing is drawn there.
const FARTHEST: f32 = 16384.0;

impl Painter {
    /// Takes note of what egui has changed.
    pub fn update(&mut self, delta: &TexturesDelta) {
        for (id, part) in &delta.set {
            let ImageData::Color(image) = &part.image;
            let [width, height] = image.size;
            let atlas = self.textures.entry(*id).or_default();
            match part.pos {
                None => *atlas = Atlas { width, height, pixels: image.pixels.clone() },
                Some([left, top]) => {
                    for (row, pixels) in image.pixels.chunks_exact(width.max(1)).enumerate() {
                        let start = (top + row) * atlas.width + left;
                        if let Some(to) = atlas.pixels.get_mut(start..start + width) {
                            to.copy_from_slice(pixels);
                        }
                    }
                }
            }
        }
        for id in &delta.free {
            self.textures.remove(id);
        }
    }

    /// Draws over `rgba`, opaque sRGB bytes of `size` pixels. There are `scale` pixels to a point of egui.
    pub fn paint(&self, rgba: &mut [u8], size: UVec2, primitives: &[ClippedPrimitive], scale: f32) {
        debug_assert_eq!(rgba.len(), size.element_product() as usize * 4);
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            let Primitive::Mesh(mesh) = primitive else { continue };
            let Some(atlas) = self.textures.get(&mesh.texture_id) else { continue };
            let target = Target { rgba, width: size.x as usize, clip: Clip::new(*clip_rect, scale, size) };
            draw_mesh(target, mesh, atlas, scale);
        }
    }
}

/// Pixels that may be drawn: from `low` up to, not including, `high`.
#[derive(Clone, Copy)]
struct Clip {
    low: [i32; 2],
    high: [i32; 2],
}

impl Clip {
    fn new(rect: Rect, scale: f32, size: UVec2) -> Self {
        let pixel = |at: f32, most: u32| (at * scale).round().clamp(0.0, most as f32) as i32;
        Self {
            low: [pixel(rect.min.x, size.x), pixel(rect.min.y, size.y)],
            high: [pixel(rect.max.x, size.x), pixel(rect.max.y, size.y)],
        }
    }
}

struct Target<'a> {
    rgba: &'a mut [u8],
    width: usize,
    clip: Clip,
}

fn draw_mesh(mut target: Target, mesh: &Mesh, atlas: &Atlas, scale: f32) {
    for corners in mesh.indices.chunks_exact(3) {
        let corner = |i: usize| mesh.vertices.get(corners[i] as usize).copied();
        if let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) {
            draw_triangle(&mut target, [a, b, c], atlas, scale);
        }
    }
}

/// Twice the area to the left of the way from `a` to `b` and on to `p`.
fn edge(a: [i64; 2], b: [i64; 2], p: [i64; 2]) -> i64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

fn draw_triangle(target: &mut Target, mut corners: [Vertex; 3], atlas: &Atlas, scale: f32) {
    let near = |v: &Vertex| v.pos.x.abs() * scale < FARTHEST && v.pos.y.abs() * scale < FARTHEST;
    // Nor what is no number.
    if !corners.iter().all(near) {
        return;
    }
    let place = |v: &Vertex| [v.pos.x, v.pos.y].map(|x| (x * scale * STEPS).round() as i64);
    let mut places = [place(&corners[0]), place(&corners[1]), place(&corners[2])];
    let mut area = edge(places[0], places[1], places[2]);
    if area < 0 {
        corners.swap(1, 2);
        places.swap(1, 2);
        area = -area;
    }
    if area == 0 {
        return;
    }
    let steps = STEPS as i64;
    let range = |axis: usize| {
        let low = places.iter().map(|p| p[axis]).min().unwrap_or(0).div_euclid(steps) as i32;
        let high = places.iter().map(|p| p[axis]).max().unwrap_or(0).div_euclid(steps) as i32 + 1;
        low.max(target.clip.low[axis])..high.min(target.clip.high[axis])
    };
    let (columns, rows) = (range(0), range(1));
    if columns.is_empty() || rows.is_empty() {
        return;
    }
    // An edge belongs to the triangle below or right of it, so that no pixel is painted twice.
    let sides = [(1, 2), (2, 0), (0, 1)];
    let owned = sides.map(|(i, j)| {
        let (x, y) = (places[j][0] - places[i][0], places[j][1] - places[i][1]);
        i64::from(y < 0 || y == 0 && x > 0) - 1
    });
    let across = sides.map(|(i, j)| -(places[j][1] - places[i][1]) * steps);
    let look = Look::new(&corners, atlas);
    for y in rows {
        let first = [i64::from(columns.start) * steps + steps / 2, i64::from(y) * steps + steps / 2];
        let mut weights = sides.map(|(i, j)| edge(places[i], places[j], first));
        let row = y as usize * target.width;
        for x in columns.clone() {
            if (0..3).all(|i| weights[i] + owned[i] >= 0) {
                let share = |i: usize| weights[i] as f32 / area as f32;
                let color = look.at(share(0), share(1), share(2));
                let at = (row + x as usize) * 4;
                blend(&mut target.rgba[at..at + 4], color);
            }
            for (weight, step) in weights.iter_mut().zip(across) {
                *weight += step;
            }
        }
    }
}

/// How a triangle looks.
enum Look<'a> {
    Plain([f32; 4]),
    Shaded { colors: [[f32; 4]; 3], uvs: [[f32; 2]; 3], atlas: &'a Atlas },
}

fn channels(color: Color32) -> [f32; 4] {
    color.to_array().map(f32::from)
}

impl<'a> Look<'a> {
    fn new(corners: &[Vertex; 3], atlas: &'a Atlas) -> Self {
        let [a, b, c] = corners;
        if a.color == b.color && b.color == c.color && a.uv == b.uv && b.uv == c.uv {
            return Self::Plain(atlas.tinted(channels(a.color), [a.uv.x, a.uv.y]));
        }
        let (colors, uvs) = (corners.map(|v| channels(v.color)), corners.map(|v| [v.uv.x, v.uv.y]));
        Self::Shaded { colors, uvs, atlas }
    }

    fn at(&self, a: f32, b: f32, c: f32) -> [f32; 4] {
        match self {
            Self::Plain(color) => *color,
            Self::Shaded { colors, uvs, atlas } => {
                let color = std::array::from_fn(|i| colors[0][i] * a + colors[1][i] * b + colors[2][i] * c);
                let uv = std::array::from_fn(|i| uvs[0][i] * a + uvs[1][i] * b + uvs[2][i] * c);
                atlas.tinted(color, uv)
            }
        }
    }
}

impl Atlas {
    /// The texel under `uv` times `color`. egui puts letters on whole pixels: nearest is exact.
    fn tinted(&self, color: [f32; 4], uv: [f32; 2]) -> [f32; 4] {
        let at = |u: f32, size: usize| ((u * size as f32) as usize).min(size.saturating_sub(1));
        let texel = self.pixels.get(at(uv[1], self.height) * self.width + at(uv[0], self.width));
        let texel = channels(texel.copied().unwrap_or(Color32::WHITE));
        std::array::from_fn(|i| color[i] * texel[i] / 255.0)
    }
}

/// `color` is multiplied by its alpha already.
fn blend(pixel: &mut [u8], color: [f32; 4]) {
    let rest = 1.0 - color[3] / 255.0;
    for (byte, over) in pixel[..3].iter_mut().zip(color) {
        *byte = (over + f32::from(*byte) * rest + 0.5) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Pos2, pos2};

    fn painter() -> Painter {
        let white = Atlas { width: 1, height: 1, pixels: vec![Color32::WHITE] };
        Painter { textures: HashMap::from([(TextureId::default(), white)]) }
    }

    fn fan(points: &[Pos2], color: Color32) -> ClippedPrimitive {
        let mut mesh = Mesh::default();
        for &pos in points {
            mesh.vertices.push(Vertex { pos, uv: pos2(0.0, 0.0), color });
        }
        for i in 1..points.len() as u32 - 1 {
            // Every other one the wrong way round: egui does not care.
            if i % 2 == 0 { mesh.add_triangle(0, i, i + 1) } else { mesh.add_triangle(0, i + 1, i) }
        }
        ClippedPrimitive { clip_rect: Rect::EVERYTHING, primitive: Primitive::Mesh(mesh) }
    }

    #[test]
    fn neighbouring_triangles_paint_each_pixel_once() {
        let size = UVec2::new(40, 30);
        for scale in [1.0, 1.5, 2.0] {
            for (dx, dy) in [(0.0, 0.0), (0.3, 0.7), (-5.2, 11.1)] {
                let circle: Vec<Pos2> = (0..17)
                    .map(|i| f32::from(i as u8) / 17.0 * std::f32::consts::TAU)
                    .map(|angle| pos2(12.0 + dx + 9.0 * angle.cos(), 9.0 + dy + 9.0 * angle.sin()))
                    .collect();
                let mut rgba = vec![0; size.element_product() as usize * 4];
                let half = Color32::from_rgba_premultiplied(100, 100, 100, 128);
                painter().paint(&mut rgba, size, &[fan(&circle, half)], scale);
                assert!(rgba.iter().all(|&c| c == 0 || c == 100), "twice, or by halves");
                let painted = rgba.iter().filter(|&&c| c == 100).count();
                assert!(painted > 100, "{painted}");
            }
        }
    }

    #[test]
    fn a_square_covers_exactly_its_pixels_inside_the_clip() {
        let size = UVec2::new(8, 8);
        let mut rgba = vec![255; 256];
        let square = [pos2(1.0, 1.0), pos2(5.0, 1.0), pos2(5.0, 4.0), pos2(1.0, 4.0)];
        let mut primitive = fan(&square, Color32::BLACK);
        primitive.clip_rect = Rect::from_min_max(pos2(2.0, 0.0), pos2(4.0, 100.0));
        painter().paint(&mut rgba, size, &[primitive], 1.0);
        for (i, pixel) in rgba.chunks_exact(4).enumerate() {
            let (x, y) = (i % 8, i / 8);
            let inside = (2..4).contains(&x) && (1..4).contains(&y);
            assert_eq!(pixel[0] == 0, inside, "{x} {y}");
            assert_eq!(pixel[3], 255);
        }
    }

    #[test]
    fn what_lies_outside_or_nowhere_does_no_harm() {
        let size = UVec2::new(3, 2);
        let mut rgba = vec![7; 24];
        for points in [
            [pos2(f32::NAN, 0.0), pos2(1.0, 0.0), pos2(0.0, 1.0)],
            [pos2(-1e30, 0.0), pos2(1e30, 0.0), pos2(0.0, 1e30)],
            [pos2(-10.0, -10.0), pos2(-5.0, -10.0), pos2(-5.0, -5.0)],
            [pos2(1.0, 1.0), pos2(1.0, 1.0), pos2(1.0, 1.0)],
        ] {
            painter().paint(&mut rgba, size, &[fan(&points, Color32::WHITE)], 1.0);
        }
        assert!(rgba.iter().all(|&c| c == 7));
    }
}
