//! Hit or miss, and where, against exact arithmetic.

#[path = "support/geometry.rs"]
mod geometry;
#[path = "support/exact.rs"]
mod whole;

use geometry::{Rng, brute_force};
use glam::Vec3;
use penumbra::bvh::{Blas, Hit, Isa, Ray};
use rayon::prelude::*;
use whole::truth;

type Case = (Ray, [Vec3; 3]);

/// A point of a triangle.
fn point(rng: &mut Rng, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let s = rng.unit().sqrt();
    let v = s * rng.unit();
    a * (1.0 - s) + b * (s - v) + c * v
}

/// Three of four are aimed at the triangle, half are normalised.
fn aimed(rng: &mut Rng, origin: Vec3, corners: [Vec3; 3]) -> Case {
    let target = if rng.below(4) == 0 { origin + rng.direction() } else { point(rng, corners) };
    toward(rng, origin, target, corners)
}

fn toward(rng: &mut Rng, origin: Vec3, target: Vec3, corners: [Vec3; 3]) -> Case {
    let direction = target - origin;
    let normalized = rng.below(2) == 0 && direction.length_squared() > 1e-30;
    (Ray::new(origin, if normalized { direction.normalize() } else { direction }), corners)
}

fn unit(rng: &mut Rng) -> Case {
    let corners = [rng.vec(), rng.vec(), rng.vec()];
    let origin = rng.vec();
    aimed(rng, origin, corners)
}

/// Every coordinate between 10⁻⁸ and 10⁸.
fn of_any_size(rng: &mut Rng) -> Case {
    let mut any = || Vec3::ZERO.map(|_| rng.decades(-8.0, 8.0));
    let (corners, origin) = ([any(), any(), any()], any());
    aimed(rng, origin, corners)
}

/// A million times as long as wide.
fn sliver(rng: &mut Rng) -> Case {
    let (a, along) = (rng.vec(), rng.direction());
    let across = along.cross(rng.direction()).normalize_or(Vec3::X);
    let corners = [a, a + along, a + along * rng.unit() + across * 1e-6];
    let origin = rng.vec() * 2.0;
    aimed(rng, origin, corners)
}

/// At 10⁻⁴ radians from the plane.
fn glancing(rng: &mut Rng) -> Case {
    let corners = [rng.vec(), rng.vec(), rng.vec()];
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize_or(Vec3::Z);
    let inward = normal.cross(rng.direction()).normalize_or(Vec3::X) + normal * 1e-4;
    let target = point(rng, corners);
    let origin = target - inward * (0.1 + 2.0 * rng.unit());
    toward(rng, origin, target, corners)
}

/// Within four steps of its floats from an edge.
fn near_an_edge(rng: &mut Rng) -> Case {
    let corners = [rng.vec(), rng.vec(), rng.vec()];
    let i = rng.below(3);
    let on = corners[i].lerp(corners[(i + 1) % 3], rng.unit());
    let target = on.map(|x| {
        let off = rng.below(9);
        (0..off.abs_diff(4)).fold(x, |x, _| if off < 4 { x.next_down() } else { x.next_up() })
    });
    let origin = rng.vec() * 2.0;
    toward(rng, origin, target, corners)
}

/// What one case has shown.
struct Outcome {
    certain: bool,
    wrong: bool,
    /// Where both hit.
    off: Option<Off>,
}

/// How far t is from the exact one.
#[derive(Clone, Copy, Debug)]
struct Off {
    /// Relative.
    epsilons: f64,
    /// In steps of floats.
    ulps: f64,
    condition: f64,
}

/// Alone and eight together, with every kernel: as the one formula says.
fn engine_hit(kernels: &[Isa], (ray, corners): &Case) -> Option<Hit> {
    let expected = brute_force(&[*corners], ray);
    let blas = Blas::build(&[*corners]);
    for &isa in kernels {
        let blas = blas.clone().with_isa(isa);
        let (mut hits, mut blocked) = ([None; 8], [false; 8]);
        blas.closest_hits(&[*ray; 8], &mut hits);
        blas.any_hits(&[*ray; 8], &mut blocked);
        assert_eq!(blas.closest_hit(ray), expected, "{}: {ray:?} {corners:?}", isa.name());
        assert_eq!(hits, [expected; 8], "{}, together: {ray:?} {corners:?}", isa.name());
        assert_eq!(blocked, [expected.is_some(); 8], "{}, any: {ray:?} {corners:?}", isa.name());
    }
    expected
}

fn outcome(kernels: &[Isa], case: &Case) -> Outcome {
    let (ray, corners) = case;
    let truth = truth(ray, corners);
    let hit = engine_hit(kernels, case);
    let wrong = hit.is_some() != (truth.inside && truth.t > 0.0);
    if wrong && truth.certain {
        println!("{case:?}: {truth:?}, but {hit:?}");
    }
    let off = hit.filter(|_| truth.inside && truth.t > 0.0).map(|hit| {
        let off = (f64::from(hit.t) - truth.t).abs();
        let near = truth.t as f32;
        let step = f64::from(near.next_up()) - f64::from(near);
        Off {
            epsilons: off / (f64::from(f32::EPSILON) * truth.t),
            ulps: off / step,
            condition: truth.condition,
        }
    });
    Outcome { certain: truth.certain, wrong, off }
}

/// Five times 200,000 triangles, each with a ray, alone and together, with every kernel.
///
/// Hit or miss: no other answer than the exact one where the margins are above 8 ε times the sizes of the products
/// (`truth` says how both are measured).
///
/// t: within 16 ε of the exact one, relative, below a condition of 8; within 4 ε times the condition from there to
/// 1000. The mark of HARDCASES G2 is 16 ε up to 1000, and is not met: measured below 1000 at worst 150 ε (unit), 469 ε
/// (of any size), 0.5 ε (sliver), 254 ε (glancing) and 85 ε (near an edge); 99.9 % are within 16, 258, 0.5, 371 and
/// 17 ulp.
///
/// Why: t is the mean of the corners' distances weighted by edge functions in single precision. These have errors
/// of some ε of their products, which move the point in the plane; seen at a flat angle that is farther along the
/// ray, in proportion to the condition. Only near and thin triangles are measured again in double precision.
#[test]
fn hits_are_those_of_exact_arithmetic() {
    const CASES: u64 = 200_000;
    let kernels = Isa::available();
    let families: [(&str, fn(&mut Rng) -> Case); 5] = [
        ("unit", unit),
        ("of any size", of_any_size),
        ("sliver", sliver),
        ("glancing", glancing),
        ("near an edge", near_an_edge),
    ];
    for (name, family) in families {
        let one = |i: u64| {
            let mut rng = Rng(i.wrapping_mul(0x9e37_79b9_7f4a_7c15));
            let usable = |(ray, _): &Case| ray.direction != Vec3::ZERO && ray.direction.is_finite();
            let case = std::iter::repeat_with(|| family(&mut rng)).find(usable);
            outcome(&kernels, &case.unwrap())
        };
        let outcomes: Vec<Outcome> = (0..CASES).into_par_iter().map(one).collect();
        let count = |is: fn(&Outcome) -> bool| outcomes.iter().filter(|o| is(o)).count();
        let (certain, wrong) = (count(|o| o.certain), count(|o| o.wrong));
        let off: Vec<Off> = outcomes.iter().filter_map(|o| o.off).collect();
        println!("{name}: {certain} certain, {wrong} others answered otherwise, {} hits in both", off.len());
        for limit in [8.0, 1e3, f64::INFINITY] {
            let mut below: Vec<&Off> = off.iter().filter(|o| o.condition < limit).collect();
            below.sort_by(|a, b| a.ulps.total_cmp(&b.ulps));
            if let [.., last] = below[..] {
                let relative = below.iter().fold(0.0f64, |worst, o| worst.max(o.epsilons));
                let quantile = below[below.len() * 999 / 1000].ulps;
                let (hits, worst) = (below.len(), last.ulps);
                println!(
                    "  condition < {limit}: {hits} hits, t off by at worst {relative:.2} ε, {worst:.2} ulp, \
                     99.9 % {quantile:.2} ulp"
                );
            }
        }
        assert_eq!(count(|o| o.wrong && o.certain), 0, "{name}");
        let bound = |o: &Off| if o.condition < 8.0 { 16.0 } else { 4.0 * o.condition };
        let measure = |o: &Off| o.epsilons / bound(o);
        let decent = off.iter().filter(|o| o.condition < 1e3);
        let worst = decent.max_by(|a, b| measure(a).total_cmp(&measure(b))).unwrap();
        println!("  condition < 1000: at worst {:.2} of what is allowed", measure(worst));
        assert!(measure(worst) <= 1.0, "{name}: {worst:?}");
    }
}

/// The judge itself: on an edge, one float beside it, clearly beside it; in the plane; in front and behind.
#[test]
fn exact_arithmetic_knows_edges() {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let down = |x: f32, y: f32| truth(&Ray::new(Vec3::new(x, y, 1.0), Vec3::NEG_Z * 3.0), &corners);
    let on = down(0.5, 0.5);
    assert!(on.inside && !on.certain && on.t == 1.0 / 3.0, "{on:?}");
    let beside = down(0.5, 0.5f32.next_up());
    assert!(!beside.inside && !beside.certain, "{beside:?}");
    let tiny = down(1e-38, 1e-38);
    assert!(tiny.inside, "{tiny:?}");
    assert!(!down(-1e-45, 0.5).inside);
    assert!(!down(0.6, 0.6).inside && down(0.6, 0.6).certain);
    assert!(down(0.3, 0.3).inside && down(0.3, 0.3).certain);
    let behind = truth(&Ray::new(Vec3::new(0.3, 0.3, -1.0), Vec3::NEG_Z), &corners);
    assert!(behind.inside && behind.t == -1.0 && behind.certain, "{behind:?}");
    assert!(!truth(&Ray::new(Vec3::new(-1.0, 0.2, 0.0), Vec3::X), &corners).inside, "in the plane");
    // A difference of products that single precision takes for -128 (HARDCASES G2).
    let [a, b, c, d] = [33_962.035f32, -30_438.8, 41_563.4, -24_871.969];
    let flat = [Vec3::ZERO, Vec3::new(a, d, 0.0), Vec3::new(c, b, 0.0)];
    let through = truth(&Ray::new(Vec3::new(a + c, b + d, 1.0) / 3.0, Vec3::NEG_Z), &flat);
    let cancels = f64::from(a).abs() * f64::from(b).abs() * 2.0 / 75.1656;
    assert!((through.condition / cancels - 1.0).abs() < 1e-2, "{through:?}, not {cancels}");
}

/// pbrt-v4's `BadCases`: a triangle of area exactly 0.
#[test]
fn a_triangle_without_area_is_never_hit() {
    let triangle = [
        Vec3::new(-1113.4546, -79.049614, -56.24319),
        Vec3::new(-1113.4546, -87.09227, -56.24319),
        Vec3::new(-1113.4546, -79.209015, -56.24319),
    ];
    let ray = Ray {
        origin: Vec3::new(-1081.4792, 99.999954, 87.77011),
        direction: Vec3::new(-32.1073, -183.35587, -144.60764),
        t_max: 0.9999,
    };
    assert_eq!(Blas::build(&[triangle]).closest_hit(&ray), None);
}
