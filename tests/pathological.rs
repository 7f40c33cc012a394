//! A million triangles that hierarchies are bad at. One test, so that its times are not those of others too.

#[path = "support/geometry.rs"]
mod geometry;

use geometry::balls::Balls;
use geometry::{Rng, aimed_ray, brute_force_in, check, long, soup};
use glam::Vec3;
use penumbra::bvh::build::MAX_DEPTH;
use penumbra::bvh::wide::{Child, WIDTH};
use penumbra::bvh::{Aabb, Blas, Isa, Ray, WideBvh};
use rayon::prelude::*;
use std::time::Instant;

/// Nodes on the longest way down.
fn depth(hierarchy: &WideBvh) -> usize {
    let mut below = vec![1; hierarchy.nodes.len()];
    // Children come after their parents.
    for (index, node) in hierarchy.nodes.iter().enumerate().rev() {
        for slot in (0..WIDTH).filter(|&slot| !node.child_bounds(slot).is_empty()) {
            if let Child::Node(child) = Child::unpack(node.children[slot]) {
                below[index] = below[index].max(1 + below[child]);
            }
        }
    }
    below.first().copied().unwrap_or(0)
}

/// The seven of HARDCASES G10.
fn large() -> Vec<(&'static str, Vec<[Vec3; 3]>)> {
    const MANY: usize = 1_000_000;
    let mut rng = Rng(77);
    let around = |i: usize| {
        let angle = std::f32::consts::TAU * i as f32 / MANY as f32;
        Vec3::new(angle.cos(), angle.sin(), 0.0)
    };
    let fan = (0..MANY).map(|i| [Vec3::ZERO, around(i), around(i + 1)]).collect();
    let star = (0..MANY).map(|_| [Vec3::ZERO, rng.vec(), rng.vec()]).collect();
    let equal = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; MANY];
    let concentric = (1..=MANY)
        .map(|i| {
            let s = i as f32;
            [Vec3::new(-s, -s, 0.0), Vec3::new(s, -s, 0.0), Vec3::new(0.0, 2.0 * s, 0.0)]
        })
        .collect();
    let shrinking = (0..=120)
        .map(|k| {
            let s = (-(k as f32)).exp2();
            [Vec3::splat(s), Vec3::new(1.5 * s, s, s), Vec3::new(s, 1.5 * s, 2.0 * s)]
        })
        .collect();
    let needles = (0..100_000)
        .map(|_| {
            let p = rng.vec() * 10.0;
            [p - Vec3::ONE * 50.0, p + Vec3::ONE * 50.0, p + Vec3::ONE * 50.0 + rng.vec() * 1e-3]
        })
        .collect();
    // Gaps from 10⁻³⁰ to 1, to both sides.
    let line = (0..MANY)
        .map(|i| {
            let x = 10f32.powf(-30.0 * (i / 2) as f32 / (MANY / 2) as f32);
            let p = Vec3::X * if i % 2 == 0 { x } else { -x };
            [p, p + Vec3::Y * 1e-3, p + Vec3::Z * 1e-3]
        })
        .collect();
    let mut far_vertex = soup(MANY - 1, 0.01, 2);
    far_vertex.push([Vec3::ZERO, Vec3::X, Vec3::Y * 3e38]);
    vec![
        ("random", soup(MANY, 0.01, 1)),
        ("fan", fan),
        ("star", star),
        ("equal", equal),
        ("concentric", concentric),
        ("shrinking", shrinking),
        ("needles", needles),
        ("line", line),
        ("far vertex", far_vertex),
    ]
}

/// A million triangles each (10⁵ needles, 121 shrinking ones). Every point of every triangle is in a leaf; no way
/// down is longer than the stack allows, nor than 2 log₂ n + 40; a few rays, aimed at corners and edges, hit what
/// trying all hits, with every kernel.
///
/// 300 rays for each; with `PENUMBRA_LONG` the 10⁴ of HARDCASES G10, each against every triangle. A fifth of that where
/// rays have to ask nearly all triangles whatever the hierarchy: where those share a corner or are all the same.
/// A tenth with the far vertex, beside which all others are in one place, and all are asked in double precision.
/// The time of building is printed, and must be less than 10 times that of random triangles (3 is the mark, but
/// machines are shared).
#[test]
fn a_million_triangles_of_the_worst_kinds() {
    let mut random = f64::NAN;
    for (name, triangles) in large() {
        let start = Instant::now();
        let blas = Blas::build(&triangles);
        let seconds = start.elapsed().as_secs_f64();
        if name == "random" {
            random = seconds;
        }
        assert!(seconds < 10.0 * random, "{name}: {seconds} s, random {random} s");
        assert_eq!(check(&blas, &triangles), Ok(()), "{name}");
        let depth = depth(blas.hierarchy());
        let n = triangles.len() as f64;
        assert!(depth <= MAX_DEPTH && depth as f64 <= 2.0 * n.log2() + 40.0, "{name}: depth {depth}");

        // Without the far vertex, which is the last.
        let most =
            triangles[..triangles.len() - 1].iter().fold(Aabb::EMPTY, |all, t| all.union(Aabb::around(t)));
        let scale = (most.max - most.min).max_element() * 0.75;
        let part = match name {
            "fan" | "star" | "equal" | "concentric" | "line" => 5,
            "far vertex" => 10,
            _ => 1,
        };
        let count = if long() { 10_000 } else { 300 } / part;
        let mut rng = Rng(3);
        let rays: Vec<Ray> = std::iter::repeat_with(|| aimed_ray(&mut rng, &triangles, scale, most.center()))
            .filter(|ray| ray.direction != Vec3::ZERO && ray.direction.is_finite() && ray.origin.is_finite())
            .take(count)
            .collect();
        let bounds = blas.bounds();
        let balls = Balls::new(&triangles, (bounds.max * 0.5 - bounds.min * 0.5).max_element() * 2.0);
        let expected = |ray: &Ray| {
            if long() {
                brute_force_in(&bounds, &triangles, ray)
            } else {
                balls.brute_force(&bounds, &triangles, ray)
            }
        };
        let hits: usize = rays
            .par_chunks(15)
            .map(|rays| {
                let expected: Vec<_> = rays.iter().map(expected).collect();
                for isa in Isa::available() {
                    let (what, blas) = (format!("{name}, {}", isa.name()), blas.clone().with_isa(isa));
                    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
                    blas.closest_hits(rays, &mut hits);
                    blas.any_hits(rays, &mut blocked);
                    assert_eq!(hits, expected, "{what}");
                    assert!(expected.iter().zip(blocked).all(|(e, b)| e.is_some() == b), "{what}");
                    assert_eq!(blas.closest_hit(&rays[0]), expected[0], "{what}, alone");
                }
                expected.iter().flatten().count()
            })
            .sum();
        println!(
            "{name}: {} triangles, built in {seconds:.2} s = {:.2} of random, depth {depth}, cost {:.1}, {hits} of {count} \
             rays hit, {:.1} s in all",
            triangles.len(),
            seconds / random,
            blas.cost(),
            start.elapsed().as_secs_f64()
        );
        assert!(hits > 0, "{name}");
    }
}
