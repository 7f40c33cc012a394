//! G10: triangles that hierarchies are bad at.

use super::brute::aimed_ray;
use super::meshes::{Triangles, soup};
use crate::bvh::build::MAX_DEPTH;
use crate::bvh::wide::{Child, WIDTH};
use crate::bvh::{Aabb, Blas, Isa, Ray, WideBvh};
use crate::torture::oracle::{Balls, Rng, Tracer, ask, brute_force_in, check};
use crate::torture::{Case, Check, Effort, Trial};
use glam::Vec3;
use rayon::prelude::*;
use std::time::Instant;

pub(super) const CASE: Case = Case {
    id: "G10",
    title: "fans, stars, equal, concentric and shrinking triangles, needles, lines, a corner at 3e38",
    limit: "built in 3 times the time of random ones; depth up to 2 log2 n + 40 and the stack's; hits of trying all",
    run,
};

/// Nodes on the longest way down.
#[must_use]
pub fn depth(hierarchy: &WideBvh) -> usize {
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

/// The seven kinds, of `many` triangles where they can have many; first of all as many random ones.
#[must_use]
pub fn kinds(many: usize) -> Vec<(&'static str, Triangles)> {
    let mut rng = Rng(77);
    let around = |i: usize| {
        let angle = std::f32::consts::TAU * i as f32 / many as f32;
        Vec3::new(angle.cos(), angle.sin(), 0.0)
    };
    let fan = (0..many).map(|i| [Vec3::ZERO, around(i), around(i + 1)]).collect();
    let star = (0..many).map(|_| [Vec3::ZERO, rng.vec(), rng.vec()]).collect();
    let equal = vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; many];
    let concentric = (1..=many)
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
    let needles = (0..many / 10)
        .map(|_| {
            let p = rng.vec() * 10.0;
            [p - Vec3::ONE * 50.0, p + Vec3::ONE * 50.0, p + Vec3::ONE * 50.0 + rng.vec() * 1e-3]
        })
        .collect();
    // Gaps from 10⁻³⁰ to 1, to both sides.
    let line = (0..many)
        .map(|i| {
            let x = 10f32.powf(-30.0 * (i / 2) as f32 / (many / 2) as f32);
            let p = Vec3::X * if i % 2 == 0 { x } else { -x };
            [p, p + Vec3::Y * 1e-3, p + Vec3::Z * 1e-3]
        })
        .collect();
    let mut far_corner = soup(many - 1, 0.01, 2);
    far_corner.push([Vec3::ZERO, Vec3::X, Vec3::Y * 3e38]);
    vec![
        ("random", soup(many, 0.01, 1)),
        ("fan", fan),
        ("star", star),
        ("equal", equal),
        ("concentric", concentric),
        ("shrinking", shrinking),
        ("needles", needles),
        ("line", line),
        ("far corner", far_corner),
    ]
}

/// Times to build, beside that of the first kind: the faster of two, for machines are shared.
#[must_use]
pub fn times<T>(
    trial: &Trial<'_>,
    kinds: &[(&'static str, Triangles)],
    build: impl Fn(&[[Vec3; 3]]) -> T,
) -> Vec<Check> {
    let timed = |triangles: &Triangles| {
        let start = Instant::now();
        let built = build(triangles);
        let seconds = start.elapsed().as_secs_f64();
        drop(built);
        seconds
    };
    let mut random = None;
    let check = |(name, triangles): &(&'static str, Triangles)| {
        trial.tell(CASE.id, *name, 0.0);
        let seconds = timed(triangles).min(timed(triangles));
        let beside = seconds / *random.get_or_insert(seconds);
        let what = format!("time to build, of random: {name}");
        Check::new(what, triangles.len() as u64, "triangles", beside, 3.0)
    };
    kinds.iter().take_while(|_| !trial.interrupted()).map(check).collect()
}

/// Whether a hierarchy over `n` triangles is no deeper than it may be.
#[must_use]
pub fn shallow(what: &str, n: u64, hierarchy: &WideBvh) -> Check {
    let most = (2.0 * (n as f64).log2() + 40.0).min(MAX_DEPTH as f64);
    Check::new(format!("depth: {what}"), n, "triangles", depth(hierarchy) as f64, most)
}

fn run(trial: &Trial<'_>) -> Vec<Check> {
    let many = trial.pick(20_000, 40_000, 1_000_000) as usize;
    let mut checks = Vec::new();
    let kinds = kinds(many);
    // Seconds are short, and shared with other tests: `tests/torture/scenes.rs` asks again until they are its own.
    if trial.effort != Effort::Quick {
        checks.extend(times(trial, &kinds, Blas::build));
    }
    for (number, (name, triangles)) in kinds.iter().enumerate() {
        trial.tell(CASE.id, *name, number as f64 / kinds.len() as f64);
        let blas = Blas::build(triangles);
        let whole = u64::from(check(&blas, triangles).is_err());
        checks.push(Check::none(
            format!("nodes: {name}"),
            blas.hierarchy().nodes.len() as u64,
            "nodes",
            whole,
        ));
        let what = format!("{name}, cost {:.1}", blas.cost());
        checks.push(shallow(&what, triangles.len() as u64, blas.hierarchy()));
        let tracers: Vec<(&str, Blas)> =
            Isa::available().into_iter().map(|isa| (isa.name(), blas.clone().with_isa(isa))).collect();
        checks.extend(hits(trial, name, triangles, &tracers));
        if trial.interrupted() {
            break;
        }
    }
    checks
}

/// Rays aimed at corners and edges hit what trying all hits.
#[must_use]
pub fn hits<T: Tracer>(
    trial: &Trial<'_>,
    name: &str,
    triangles: &[[Vec3; 3]],
    tracers: &[(&str, T)],
) -> Vec<Check> {
    // Without the last, which may be the far corner's.
    let most = triangles[..triangles.len() - 1].iter().fold(Aabb::EMPTY, |all, t| all.union(Aabb::around(t)));
    let scale = (most.max - most.min).max_element() * 0.75;
    // Where triangles share a corner or are all the same, rays have to ask nearly all whatever the hierarchy; beside a
    // far corner all others are in one place, and are asked in double precision. Hours suffice for that too.
    let part = match name {
        _ if trial.effort == Effort::Long => 1,
        "fan" | "star" | "equal" | "concentric" | "line" => 5,
        "far corner" => 10,
        _ => 1,
    };
    let count = trial.pick(200, 1000, 10_000) as usize / part;
    let mut rng = Rng::numbered(trial.seed, 10);
    let rays: Vec<Ray> = std::iter::repeat_with(|| aimed_ray(&mut rng, triangles, scale, most.center()))
        .filter(|ray| ray.direction != Vec3::ZERO && ray.direction.is_finite() && ray.origin.is_finite())
        .take(count)
        .collect();
    let bounds = triangles.iter().fold(Aabb::EMPTY, |all, t| all.union(Aabb::around(t)));
    let balls = Balls::new(triangles, (bounds.max * 0.5 - bounds.min * 0.5).max_element() * 2.0);
    let expected: Vec<_> = rays
        .par_iter()
        .map(|ray| match trial.effort {
            Effort::Long => brute_force_in(&bounds, triangles, ray),
            _ => balls.brute_force(&bounds, triangles, ray),
        })
        .collect();
    let seen = expected.iter().flatten().count();
    let check = |(kernel, tracer): &(&str, T)| {
        let pieces = rays.par_chunks(15).zip(expected.par_chunks(15));
        let wrong = pieces.map(|(rays, expected)| ask(tracer, rays).wrong(expected)).sum();
        let tried = if seen > 0 { count as u64 } else { 0 };
        Check::none(format!("hits: {name}, {kernel}"), tried, "rays", wrong)
    };
    tracers.iter().map(check).collect()
}
