//! Texture lookup: wrap, filter, decode. Decoding comes before filtering.

use crate::scene::color::linear_from_srgb;
use crate::scene::{Encoding, Filter, Texture, Wrap};
use glam::{Vec2, Vec4};
use std::sync::LazyLock;

static LINEAR_FROM_SRGB: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| linear_from_srgb(i as f32 / 255.0)));

/// The texture at `uv` (origin top left), RGBA. Coordinates that are not finite count as 0.
#[must_use]
pub fn lookup(texture: &Texture, filter: Filter, uv: Vec2) -> Vec4 {
    let uv = uv.map(|c| if c.is_finite() { c } else { 0.0 });
    let (width, height) = (texture.texels.width, texture.texels.height);
    // Huge coordinates have lost their fraction; reducing them first keeps the casts below exact.
    let wrapped = Vec2::new(reduce(uv.x, texture.wrap[0]), reduce(uv.y, texture.wrap[1]));
    let p = wrapped * Vec2::new(width as f32, height as f32);
    match filter {
        Filter::Nearest => texel(texture, p.x.floor() as i64, p.y.floor() as i64),
        Filter::Bilinear => {
            let corner = (p - 0.5).floor();
            let f = p - 0.5 - corner;
            let (x, y) = (corner.x as i64, corner.y as i64);
            let upper = texel(texture, x, y).lerp(texel(texture, x + 1, y), f.x);
            let lower = texel(texture, x, y + 1).lerp(texel(texture, x + 1, y + 1), f.x);
            upper.lerp(lower, f.y)
        }
    }
}

/// Brings a coordinate into one period (two for mirroring), without deciding about the border.
fn reduce(c: f32, wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => c - c.floor(),
        Wrap::Mirror => c - 2.0 * (0.5 * c).floor(),
        Wrap::Clamp => c.clamp(-1.0, 2.0),
    }
}

/// Texel `x`, `y`, wrapped in integers: no rounding can lead outside.
fn texel(texture: &Texture, x: i64, y: i64) -> Vec4 {
    let image = &texture.texels;
    let x = wrap_index(x, image.width, texture.wrap[0]);
    let y = wrap_index(y, image.height, texture.wrap[1]);
    let [r, g, b, a] = image.texels[y * image.width as usize + x];
    let data = |byte: u8| f32::from(byte) / 255.0;
    match texture.encoding {
        Encoding::Linear => Vec4::new(data(r), data(g), data(b), data(a)),
        Encoding::Srgb => {
            let table = &*LINEAR_FROM_SRGB;
            Vec4::new(table[usize::from(r)], table[usize::from(g)], table[usize::from(b)], data(a))
        }
    }
}

fn wrap_index(i: i64, size: u32, wrap: Wrap) -> usize {
    let n = i64::from(size);
    let wrapped = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * n);
            if i < n { i } else { 2 * n - 1 - i }
        }
        Wrap::Clamp => i.clamp(0, n - 1),
    };
    wrapped as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Texels;
    use std::sync::Arc;

    fn black_white(encoding: Encoding, wrap: Wrap) -> Texture {
        let texels = vec![[0, 0, 0, 255], [255, 255, 255, 255]];
        let texels = Arc::new(Texels { width: 2, height: 1, texels });
        Texture { texels, encoding, wrap: [wrap; 2], filter: Filter::Bilinear }
    }

    #[test]
    fn between_black_and_white_lies_half_the_light() {
        let texture = black_white(Encoding::Srgb, Wrap::Clamp);
        assert_eq!(lookup(&texture, Filter::Bilinear, Vec2::new(0.5, 0.5)).x, 0.5);
    }

    #[test]
    fn nearest_takes_the_texel_it_falls_into() {
        let texture = black_white(Encoding::Srgb, Wrap::Repeat);
        let at = |u| lookup(&texture, Filter::Nearest, Vec2::new(u, 0.0)).x;
        assert_eq!(
            [at(0.0), at(0.49), at(0.5), at(0.99), at(1.0), at(-0.01)],
            [0.0, 0.0, 1.0, 1.0, 0.0, 1.0]
        );
    }

    #[test]
    fn wrap_modes_differ_outside() {
        let at = |wrap, u| lookup(&black_white(Encoding::Linear, wrap), Filter::Nearest, Vec2::new(u, 0.0)).x;
        assert_eq!([at(Wrap::Repeat, 1.25), at(Wrap::Mirror, 1.25), at(Wrap::Clamp, 1.25)], [0.0, 1.0, 1.0]);
    }

    #[test]
    fn odd_coordinates_stay_inside() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for filter in [Filter::Nearest, Filter::Bilinear] {
                for u in [-1e-10, 1e30, -1e30, f32::NAN, f32::INFINITY, -0.0, 1.0, f32::MAX] {
                    let color = lookup(&black_white(Encoding::Srgb, wrap), filter, Vec2::new(u, u));
                    assert!(color.is_finite(), "{wrap:?} {filter:?} {u}");
                }
            }
        }
    }
}
