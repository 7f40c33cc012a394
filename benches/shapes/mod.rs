//! Geometry and rays that are made here, for all benches.

mod terrain;

use glam::Vec3;
use penumbra::bvh::{Aabb, Blas, Hit, Probe, Ray};
pub use terrain::terrain;

/// `count` triangles in a cube of side 2, so large that a ray meets as many whatever `count` is.
pub fn soup(count: usize) -> Vec<[Vec3; 3]> {
    let size = (count as f32).sqrt().recip();
    (0..count)
        .map(|i| {
            let at = Vec3::from_array([11, 12, 13].map(|dimension| random(i, dimension) * 2.0 - 1.0));
            [21, 31, 41].map(|dimension| at + direction(i, dimension) * size)
        })
        .collect()
}

/// A number in [0, 1) for each `i` and `dimension`.
fn random(i: usize, dimension: u32) -> f32 {
    let mut x = (i as u32).wrapping_mul(0x9e37_79b9) ^ dimension.wrapping_mul(0x85eb_ca6b);
    for _ in 0..2 {
        x = (x ^ x >> 16).wrapping_mul(0x21f0_aaad);
        x = (x ^ x >> 15).wrapping_mul(0x735a_2d97);
    }
    (x >> 8) as f32 / (1 << 24) as f32
}

fn direction(i: usize, dimension: u32) -> Vec3 {
    let z = random(i, dimension) * 2.0 - 1.0;
    let (sin, cos) = (random(i, dimension + 1) * std::f32::consts::TAU).sin_cos();
    Vec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
}

/// From an eye above, in tiles of 8×8; and from where they arrive, to a lamp and anywhere.
pub fn ray_kinds(blas: &Blas, side: usize) -> [(&'static str, Vec<Ray>); 3] {
    let eye = Vec3::new(1.3, 0.9, 1.7);
    let (across, down) = (Vec3::new(1.7, 0.0, -1.3).normalize(), Vec3::new(-0.3, -1.0, -0.4).normalize());
    let primary: Vec<Ray> = (0..side * side)
        .map(|k| {
            let (tile, inside) = (k / 64, k % 64);
            let x = tile % (side / 8) * 8 + inside % 8;
            let y = tile / (side / 8) * 8 + inside / 8;
            let [u, v] = [x, y].map(|p| p as f32 / side as f32 - 0.5);
            Ray::new(eye, (-eye + across * u * 1.6 + down * v * 1.2).normalize())
        })
        .collect();
    let mut hits = vec![None; primary.len()];
    blas.closest_hits(&primary, &mut hits);
    let arrivals: Vec<Vec3> =
        primary.iter().zip(&hits).filter_map(|(ray, hit)| Some(ray.at((*hit)?.t) + Vec3::Y * 1e-4)).collect();
    let (mut shadow, mut bounce) = (Vec::new(), Vec::new());
    for (i, &origin) in arrivals.iter().enumerate() {
        let lamp = Vec3::new(random(i, 1) - 1.5, 0.6, random(i, 2));
        shadow.push(Ray { origin, direction: lamp - origin, t_max: 1.0 });
        bounce.push(Ray::new(origin, (direction(i, 3) + Vec3::Y * 1.001).normalize()));
    }
    [("primary", primary), ("shadow", shadow), ("bounce", bounce)]
}

/// # Panics
/// If any of `count` rays does not hit what trying every triangle hits.
pub fn compare_with_all(blas: &Blas, triangles: &[[Vec3; 3]], rays: &[Ray], count: usize) {
    let rays: Vec<Ray> = rays.iter().step_by((rays.len() / count).max(1)).copied().collect();
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    blas.closest_hits(&rays, &mut hits);
    blas.any_hits(&rays, &mut blocked);
    let bounds = triangles.iter().fold(Aabb::EMPTY, |bounds, corners| bounds.union(Aabb::around(corners)));
    for (i, ray) in rays.iter().enumerate() {
        let probe = Probe::new(ray, &bounds);
        let all = triangles.iter().zip(0..).filter_map(|(corners, triangle)| {
            let hit = probe.triangle(corners, ray.t_max)?;
            Some(Hit { t: hit.t, u: hit.u, v: hit.v, triangle, instance: 0 })
        });
        let expected = all.reduce(|a, b| if b.beats(&a) { b } else { a });
        assert_eq!((hits[i], blocked[i]), (expected, expected.is_some()), "{ray:?}");
    }
}
