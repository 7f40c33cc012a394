//! Building and tracing by kernel and kind of ray, on geometry made here. `cargo bench`
//!
//! Before anything is timed its hits are compared with those of trying every triangle.

#![expect(missing_docs, reason = "criterion's macros write undocumented functions")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DAffine3, DVec3, Vec3};
use penumbra::bvh::{Aabb, Blas, Hit, Isa, Placement, Probe, Ray, Tlas};
use std::hint::black_box;
use std::sync::Arc;

/// Hills over a square of side 2, two triangles to each of `side`² fields.
fn terrain(side: usize) -> Vec<[Vec3; 3]> {
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
fn ray_kinds(blas: &Blas, side: usize) -> [(&'static str, Vec<Ray>); 3] {
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
/// If any of some rays does not hit what trying every triangle hits.
fn compare_with_all(blas: &Blas, triangles: &[[Vec3; 3]], rays: &[Ray]) {
    let rays: Vec<Ray> = rays.iter().step_by(rays.len() / 64).copied().collect();
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

fn trace(criterion: &mut Criterion) {
    let triangles = terrain(300);
    let blas = Blas::build(&triangles);
    for (kind, rays) in ray_kinds(&blas, 256) {
        let mut group = criterion.benchmark_group(format!("trace {kind}"));
        group.throughput(Throughput::Elements(rays.len() as u64));
        for isa in Isa::available() {
            let blas = blas.clone().with_isa(isa);
            compare_with_all(&blas, &triangles, &rays);
            let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
            group.bench_function(isa.name(), |bencher| {
                bencher.iter(|| match kind {
                    "shadow" => blas.any_hits(black_box(&rays), &mut blocked),
                    _ => blas.closest_hits(black_box(&rays), &mut hits),
                });
            });
        }
    }
}

fn build(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("build");
    for side in [22, 71, 224, 707] {
        let triangles = terrain(side);
        let blas = Blas::build(&triangles);
        compare_with_all(&blas, &triangles, &ray_kinds(&blas, 64)[0].1);
        group.throughput(Throughput::Elements(triangles.len() as u64));
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let name = format!("{} triangles, {threads} threads", triangles.len());
            group.bench_function(name, |bencher| {
                pool.install(|| bencher.iter(|| Blas::build(black_box(&triangles))));
            });
        }
    }
}

/// What has to be done when one of a thousand instances moved.
fn move_instance(criterion: &mut Criterion) {
    let triangles = terrain(30);
    let blas = Arc::new(Blas::build(&triangles));
    let at = |i: usize| {
        DAffine3::from_translation(DVec3::new((i % 32) as f64 * 3.0, (i % 7) as f64, (i / 32) as f64 * 3.0))
    };
    let mut placements: Vec<Placement> =
        (0..1000).filter_map(|i| Placement::new(Arc::clone(&blas), at(i))).collect();
    let ray = Ray::new(Vec3::new(3.1, 30.0, 0.1), -Vec3::Y);
    assert!(Tlas::build(placements.clone()).closest_hit(&ray).is_some_and(|hit| hit.instance < 1000));
    let mut step = 0;
    criterion.bench_function("one of 1,000 instances of 1,800 triangles moves", |bencher| {
        bencher.iter(|| {
            step += 1;
            if let Some(moved) = Placement::new(Arc::clone(&blas), at(step % 1000)) {
                placements[500] = moved;
            }
            Tlas::build(placements.clone())
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = build, trace, move_instance
}
criterion_main!(benches);
