//! Bump maps → normal maps.

use crate::scene::Texels;
use glam::Vec3;

/// How high white is over black at `-bm 1`, in sides of the picture: no standard says.
const HEIGHT: f32 = 0.01;

/// Whether a picture that calls itself a bump map is one of normals: mostly bluish, as those are.
pub(super) fn is_normal_map(texels: &Texels) -> bool {
    let bluish =
        |[r, g, b, _]: &[u8; 4]| *b > 128 && r.abs_diff(128) < 100 && g.abs_diff(128) < 100 && b > r && b > g;
    texels.texels.iter().filter(|texel| bluish(texel)).count() * 10 > texels.texels.len() * 9
}

/// How high a picture is: as bright as it is, from 0 to 1.
pub(super) fn heights_of(texels: &Texels) -> Vec<f32> {
    let bright = |&[r, g, b, _]: &[u8; 4]| f32::from(u16::from(r) + u16::from(g) + u16::from(b)) / 765.0;
    texels.texels.iter().map(bright).collect()
}

/// The normals of a surface of these heights, row by row, times `-bm`.
pub(super) fn normals_of_heights(size: [u32; 2], heights: &[f32], bump: f32, clamp: bool) -> Texels {
    let [width, height] = size.map(i64::from);
    let at = |x: i64, y: i64| {
        let inside = |i: i64, n: i64| if clamp { i.clamp(0, n - 1) } else { i.rem_euclid(n) };
        heights[(inside(y, height) * width + inside(x, width)) as usize]
    };
    let scale = 0.5 * HEIGHT * bump;
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let texels = places.map(|(x, y)| {
        // Rows go down, the bitangent up.
        let slope = [
            (at(x + 1, y) - at(x - 1, y)) * width as f32 * scale,
            (at(x, y - 1) - at(x, y + 1)) * height as f32 * scale,
        ];
        let normal = Vec3::new(-slope[0], -slope[1], 1.0).normalize();
        let [r, g, b] = ((normal * 0.5 + 0.5) * 255.0).round().to_array().map(|c| c as u8);
        [r, g, b, 255]
    });
    Texels { width: size[0], height: size[1], texels: texels.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_to_the_right_tilts_to_the_left_and_one_upward_down() {
        let slope = |f: fn(u32, u32) -> u8| {
            let texels = (0..64).map(|i| [f(i % 8, i / 8); 4]).collect();
            let heights = heights_of(&Texels { width: 8, height: 8, texels });
            let normals = normals_of_heights([8, 8], &heights, 10.0, true);
            assert!(!is_normal_map(&Texels { texels: vec![[200; 4]; 4], width: 2, height: 2 }));
            normals.texels[3 * 8 + 3]
        };
        let [r, g, b, _] = slope(|x, _| x as u8 * 30);
        assert!(r < 120 && g == 128 && b > 200, "{r} {g} {b}");
        // The first row is the top.
        let [r, g, _, _] = slope(|_, y| (7 - y) as u8 * 30);
        assert!(r == 128 && g < 120, "{r} {g}");
        assert!(is_normal_map(&Texels { width: 1, height: 1, texels: vec![[128, 128, 255, 255]] }));
    }
}
