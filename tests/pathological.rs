//! Input that hierarchies are bad at.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::{Rng, same_as_brute_force, soup};
use glam::Vec3;

#[test]
fn pathological_geometry_agrees_with_brute_force_and_keeps_its_bounds() {
    let mut rng = Rng(11);
    let fan: Vec<_> = (0..2000).map(|_| [Vec3::ZERO, rng.vec(), rng.vec()]).collect();
    let equal = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 1000];
    let concentric: Vec<_> = (1..1000)
        .map(|i| {
            let s = i as f32;
            [Vec3::new(-s, -s, 0.0), Vec3::new(s, -s, 0.0), Vec3::new(0.0, 2.0 * s, 0.0)]
        })
        .collect();
    let shrinking: Vec<_> = (0..=120)
        .map(|k| {
            let s = (-(k as f32)).exp2();
            [Vec3::splat(s), Vec3::new(1.5 * s, s, s), Vec3::new(s, 1.5 * s, 2.0 * s)]
        })
        .collect();
    let needles: Vec<_> = (0..2000)
        .map(|_| {
            let p = rng.vec() * 10.0;
            [p - Vec3::ONE * 50.0, p + Vec3::ONE * 50.0, p + Vec3::ONE * 50.0 + rng.vec() * 1e-3]
        })
        .collect();
    let line: Vec<_> = (0..40)
        .map(|k| {
            let x = 10f32.powi(k % 20 - 10) * if k < 20 { 1.0 } else { -1.0 };
            [Vec3::X * x, Vec3::X * x + Vec3::Y * 1e-3, Vec3::X * x + Vec3::Z * 1e-3]
        })
        .collect();
    let flat: Vec<_> = soup(500, 0.2, 5).into_iter().map(|t| t.map(|p| p.with_y(0.25))).collect();
    let mut mixed = soup(500, 1e-4, 9);
    mixed.push([Vec3::new(-1e6, 0.0, -1e6), Vec3::new(1e6, 0.0, -1e6), Vec3::new(0.0, 0.0, 1e6)]);
    let mut far_vertex = soup(100, 0.2, 2);
    far_vertex.push([Vec3::ZERO, Vec3::X, Vec3::Y * 3e38]);
    for (name, triangles) in [
        ("fan", fan),
        ("equal", equal),
        ("concentric", concentric),
        ("shrinking", shrinking),
        ("needles", needles),
        ("line", line),
        ("flat", flat),
        ("mixed scales", mixed),
        ("far vertex", far_vertex),
    ] {
        same_as_brute_force(name, &triangles, 1000);
    }
}
