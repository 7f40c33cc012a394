//! G2: hit or miss, and where, against exact arithmetic.

use super::batches::{BATCH, Counting};
use crate::bvh::{Hit, Ray};
use crate::torture::oracle::{Maker, Rng, ask, kernels, truth};
use crate::torture::{Case, Check, Place, Trial};
use glam::Vec3;
use std::sync::Mutex;

pub(super) const CASE: Case = Case {
    id: "G2",
    title: "hit or miss, and t, against exact arithmetic",
    limit: "no other answer where the margin is above 8 ε of the products; t within 16 ε below a condition of 1000",
    run: |trial| run(trial, &kernels()),
};

/// A ray and a triangle.
pub type Pair = (Ray, [Vec3; 3]);

/// Three of four are aimed at the triangle, half are normalised.
fn aimed(rng: &mut Rng, origin: Vec3, corners: [Vec3; 3]) -> (Vec3, Vec3, [Vec3; 3]) {
    let target = if rng.below(4) == 0 { origin + rng.direction() } else { rng.point(corners) };
    (origin, target, corners)
}

fn unit(rng: &mut Rng) -> (Vec3, Vec3, [Vec3; 3]) {
    let corners = [rng.vec(), rng.vec(), rng.vec()];
    let origin = rng.vec();
    aimed(rng, origin, corners)
}

/// Every coordinate between 10⁻⁸ and 10⁸.
fn of_any_size(rng: &mut Rng) -> (Vec3, Vec3, [Vec3; 3]) {
    let mut any = || Vec3::ZERO.map(|_| rng.decades(-8.0, 8.0));
    let (corners, origin) = ([any(), any(), any()], any());
    aimed(rng, origin, corners)
}

/// A million times as long as wide.
fn sliver(rng: &mut Rng) -> (Vec3, Vec3, [Vec3; 3]) {
    let (a, along) = (rng.vec(), rng.direction());
    let across = along.cross(rng.direction()).normalize_or(Vec3::X);
    let corners = [a, a + along, a + along * rng.unit() + across * 1e-6];
    let origin = rng.vec() * 2.0;
    aimed(rng, origin, corners)
}

/// At 10⁻⁴ radians from the plane.
fn glancing(rng: &mut Rng) -> (Vec3, Vec3, [Vec3; 3]) {
    let corners = [rng.vec(), rng.vec(), rng.vec()];
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize_or(Vec3::Z);
    let inward = normal.cross(rng.direction()).normalize_or(Vec3::X) + normal * 1e-4;
    let target = rng.point(corners);
    (target - inward * (0.1 + 2.0 * rng.unit()), target, corners)
}

/// At a point of an edge; its floats are moved by up to four steps when all is where it belongs.
fn near_an_edge(rng: &mut Rng) -> (Vec3, Vec3, [Vec3; 3]) {
    let corners = [rng.vec(), rng.vec(), rng.vec()];
    let i = rng.below(3);
    (rng.vec() * 2.0, corners[i].lerp(corners[(i + 1) % 3], rng.unit()), corners)
}

/// A kind of triangles and rays.
#[derive(Clone, Copy)]
pub struct Family {
    /// What a table calls it.
    pub name: &'static str,
    make: fn(&mut Rng) -> (Vec3, Vec3, [Vec3; 3]),
    /// Steps of floats that the target is moved by at most.
    steps: usize,
}

/// The five of them.
pub const FAMILIES: [Family; 5] = [
    Family { name: "unit", make: unit, steps: 0 },
    Family { name: "any size", make: of_any_size, steps: 0 },
    Family { name: "slivers", make: sliver, steps: 0 },
    Family { name: "glancing", make: glancing, steps: 0 },
    Family { name: "near edges", make: near_an_edge, steps: 4 },
];

impl Family {
    /// One of it, at `place`. Half of the directions have unit length.
    pub fn pair(&self, rng: &mut Rng, place: Place) -> Pair {
        loop {
            let (origin, target, corners) = (self.make)(rng);
            let corners = corners.map(|p| place.point(p));
            let (origin, mut target) = (place.point(origin), place.point(target));
            if self.steps > 0 {
                target = target.map(|x| {
                    let off = rng.below(2 * self.steps + 1);
                    let step = |x: f32, _| if off < self.steps { x.next_down() } else { x.next_up() };
                    (0..off.abs_diff(self.steps)).fold(x, step)
                });
            }
            let direction = target - origin;
            let unit = rng.below(2) == 0 && direction.length_squared() > 1e-30;
            let direction = if unit { direction.normalize() } else { direction };
            if direction != Vec3::ZERO && direction.is_finite() {
                return (Ray::new(origin, direction), corners);
            }
        }
    }
}

/// What pairs have shown.
#[derive(Clone, Debug, Default)]
pub struct Shown {
    /// Answers that no rounding excuses, alone or together, for the nearest hit or for any.
    pub wrong: u64,
    /// Where both hit, below a condition of 1000: relative error of t in ε = 2⁻²⁴, in steps of floats, and the
    /// condition.
    pub off: Vec<[f64; 3]>,
}

/// 2⁻²⁴, the rounding unit.
const EPSILON: f64 = 0.5 * f32::EPSILON as f64;

/// What `maker` says of one pair.
pub fn judge(maker: &Maker<'_>, (ray, corners): &Pair, shown: &mut Shown) {
    let truth = truth(ray, corners);
    let tracer = (maker.make)(&[*corners]);
    let answers = ask(tracer.as_ref(), &[*ray; 8]);
    let hits = truth.inside && truth.t > 0.0;
    if truth.certain {
        let right = |hit: Option<&Hit>| hit.is_some() == hits;
        shown.wrong += u64::from(answers.wrong_by(|_, hit| right(hit), |_| hits) > 0);
    }
    if let Some(hit) = answers.hits[0].filter(|_| hits && truth.condition < 1e3) {
        let off = (f64::from(hit.t) - truth.t).abs();
        let near = truth.t as f32;
        let step = f64::from(near.next_up()) - f64::from(near);
        shown.off.push([off / (EPSILON * truth.t), off / step, truth.condition]);
    }
}

const WHY: &str = "t is the mean of the corners' distances weighted by edge functions in single precision, which \
                   moves the point in the plane by some ε; seen at a flat angle that is farther along the ray, in \
                   proportion to the condition (next line)";

/// The case for whatever answers rays.
#[must_use]
pub fn run(trial: &Trial<'_>, makers: &[Maker<'_>]) -> Vec<Check> {
    let mut sets = Vec::new();
    for family in FAMILIES {
        // Of any size is of any size.
        let places = if family.name == "any size" { &Place::ALL[..1] } else { &Place::ALL };
        sets.extend(places.iter().map(|&place| (family, place)));
    }
    let each = trial.pick(2 * BATCH, 8 * BATCH, 1_000_000);
    let mut checks = vec![bad_case(makers)];
    for (number, &(family, place)) in sets.iter().enumerate() {
        let what = format!("{}, {}", family.name, place.name());
        let part = [number, number + 1].map(|n| n as f64 / sets.len() as f64);
        let all: Vec<Mutex<Shown>> = makers.iter().map(|_| Mutex::default()).collect();
        let counting = Counting { trial, id: CASE.id, what: &what, part, batch: BATCH };
        let (rays, _) = counting.sum(each, 0, |batch| {
            let mut rng = Rng::numbered(trial.seed, batch);
            let pairs: Vec<Pair> = (0..BATCH).map(|_| family.pair(&mut rng, place)).collect();
            for (maker, all) in makers.iter().zip(&all) {
                let mut shown = Shown::default();
                pairs.iter().for_each(|pair| judge(maker, pair, &mut shown));
                if let Ok(mut all) = all.lock() {
                    all.wrong += shown.wrong;
                    all.off.extend(shown.off);
                }
            }
            Vec::new()
        });
        for (maker, shown) in makers.iter().zip(all) {
            let shown = shown.into_inner().unwrap_or_default();
            let what = format!("{what}, {}", maker.name);
            checks.push(Check::none(format!("hit or miss: {what}"), rays, "rays", shown.wrong));
            checks.extend(of_t(&what, &shown.off));
        }
        if trial.interrupted() {
            break;
        }
    }
    checks
}

/// The error of t against the mark, and against what theory says of the test.
fn of_t(what: &str, off: &[[f64; 3]]) -> Vec<Check> {
    if off.is_empty() {
        return Vec::new();
    }
    let worst = |of: fn(&[f64; 3]) -> f64| off.iter().map(of).fold(0.0, f64::max);
    let mark = Check {
        excuse: Some(WHY),
        ..Check::new(format!("ε off in t: {what}"), off.len() as u64, "hits", worst(|o| o[0]), 16.0)
    };
    // All but one of a thousand.
    let mut sorted: Vec<f64> = off.iter().map(|o| o[0]).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let nearly_all = sorted[(sorted.len() * 999 / 1000).min(sorted.len() - 1)];
    // 16 ε below a condition of 8, and 4 times the condition from there on; in units of 2⁻²³.
    let bound = |o: &[f64; 3]| o[0] / 2.0 / if o[2] < 8.0 { 16.0 } else { 4.0 * o[2] };
    vec![
        mark,
        Check {
            excuse: Some(WHY),
            ..Check::new(format!("ε off in t, 99.9 %: {what}"), off.len() as u64, "hits", nearly_all, 16.0)
        },
        Check::new(
            format!("t, of what its condition allows: {what}"),
            off.len() as u64,
            "hits",
            worst(bound),
            1.0,
        ),
    ]
}

/// Of pbrt's tests, `Triangle.BadCases`: a triangle without area hits nothing.
fn bad_case(makers: &[Maker<'_>]) -> Check {
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
    let asked = |maker: &Maker<'_>| ask((maker.make)(&[triangle]).as_ref(), &[ray; 8]).wrong(&[None; 8]);
    let wrong = makers.iter().map(asked).sum();
    Check::none("pbrt's triangle without area", 8 * makers.len() as u64, "rays", wrong)
}
