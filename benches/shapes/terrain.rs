//! Hills.

use glam::Vec3;

/// Hills over a square of side 2, two triangles to each of `side`² fields.
pub fn terrain(side: usize) -> Vec<[Vec3; 3]> {
    let point = |i: usize, j: usize| {
        let (x, z) = (i as f32 / side as f32 * 2.0 - 1.0, j as f32 / side as f32 * 2.0 - 1.0);
        let wave = |frequency: f32| (x * frequency).sin() * (z * frequency * 1.3).cos() / frequency;
        Vec3::new(x, 0.8 * wave(4.0) + 0.5 * wave(31.0) + 0.3 * wave(170.0), z)
    };
    (0..side * side)
        .flat_map(|k| {
            let (i, j) = (k / side, k % side);
            let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}
