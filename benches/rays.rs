//! Building and tracing by kernel and kind of ray, on geometry made here. `cargo bench`
//!
//! Before anything is timed its hits are compared with those of trying every triangle.

#![expect(missing_docs, reason = "criterion's macros write undocumented functions")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DAffine3, DVec3, Vec3};
use penumbra::bvh::{Blas, Isa, Placement, Ray, Tlas};
use shapes::{compare_with_all, ray_kinds, terrain};
use std::hint::black_box;
use std::sync::Arc;

#[expect(dead_code, reason = "the soup is for `growth`")]
mod shapes;

fn trace(criterion: &mut Criterion) {
    let triangles = terrain(300);
    let blas = Blas::build(&triangles);
    for (kind, rays) in ray_kinds(&blas, 256) {
        let mut group = criterion.benchmark_group(format!("trace {kind}"));
        group.throughput(Throughput::Elements(rays.len() as u64));
        for isa in Isa::available() {
            let blas = blas.clone().with_isa(isa);
            compare_with_all(&blas, &triangles, &rays, 64);
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
        compare_with_all(&blas, &triangles, &ray_kinds(&blas, 64)[0].1, 64);
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

/// A mesh that is bent: its hierarchy with new boxes, beside a new one.
fn refit(criterion: &mut Criterion) {
    let triangles = terrain(300);
    let bent: Vec<[Vec3; 3]> =
        triangles.iter().map(|corners| corners.map(|p| p + Vec3::X * 0.1 * (p.y + p.z).sin())).collect();
    let blas = Blas::build(&triangles);
    let refitted = blas.refit(&bent).expect("bent a little");
    compare_with_all(&refitted, &bent, &ray_kinds(&refitted, 64)[2].1, 64);
    let mut group = criterion.benchmark_group("bend");
    group.throughput(Throughput::Elements(triangles.len() as u64));
    group.bench_function("refit", |bencher| bencher.iter(|| blas.refit(black_box(&bent))));
    group.bench_function("build", |bencher| bencher.iter(|| Blas::build(black_box(&bent))));
    group.finish();
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
    targets = build, refit, trace, move_instance
}
criterion_main!(benches);
