//! Light that is computed past what is in its way, against light that is counted ray by ray.
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

use glam::{DAffine3, DVec3, Vec3};
use penumbra::bvh::{Aabb, Blas, Placement, Shaft, Tlas};
use penumbra::trace::blocker::{Blocker, simplify};
use penumbra::trace::quad::{Quad, angle_over_sine};
use penumbra::trace::visible::irradiance;
use std::f64::consts::PI;
use std::sync::Arc;

/// The generator `SplitMix64`.
struct Rng(u64);

impl Rng {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    fn point(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        DVec3::new(self.within(low.x, high.x), self.within(low.y, high.y), self.within(low.z, high.z))
    }
}

/// Whether the open segment crosses the triangle.
fn crosses(from: DVec3, to: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let d = to - from;
    let side = |p: DVec3, q: DVec3| d.dot((p - from).cross(q - from));
    let (u, v, w) = (side(a, b), side(b, c), side(c, a));
    let through = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let normal = (b - a).cross(c - a);
    let t = normal.dot(a - from) / normal.dot(d);
    through && t > 0.0 && t < 1.0
}

/// A lamp above, a floor point, and some triangles of which most are between them.
struct Case {
    quad: Quad,
    point: DVec3,
    normal: DVec3,
    triangles: Vec<[DVec3; 3]>,
}

impl Case {
    fn random(rng: &mut Rng) -> Self {
        let edge = |rng: &mut Rng| rng.point(DVec3::splat(-1.0), DVec3::ONE).as_vec3();
        let quad = loop {
            let quad = Quad::new(Vec3::new(0.0, 0.0, 2.5), edge(rng), edge(rng));
            if quad.area > 0.1 {
                break quad;
            }
        };
        let point = rng.point(DVec3::new(-1.0, -1.0, -0.2), DVec3::new(1.0, 1.0, 0.2));
        let normal = rng.point(DVec3::new(-1.0, -1.0, 0.2), DVec3::ONE).normalize();
        let (low, high) = (DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 2.6));
        let corner = |rng: &mut Rng| rng.point(low, high).as_vec3().as_dvec3();
        let triangles = (0..1 + (rng.unit() * 4.0) as usize).map(|_| [corner(rng), corner(rng), corner(rng)]);
        Self { quad, point: point.as_vec3().as_dvec3(), normal, triangles: triangles.collect() }
    }

    fn blockers(&self) -> Vec<Blocker> {
        let side = (self.point - self.quad.corner.as_dvec3()).dot(self.quad.normal.as_dvec3()).signum();
        let facing = self.quad.normal * side as f32;
        let of = |t: &[DVec3; 3]| {
            Blocker::new(&[t[0].as_vec3(), t[1].as_vec3(), t[2].as_vec3()], self.quad.corner, facing, 1e-6)
        };
        self.triangles.iter().filter_map(of).collect()
    }

    fn exact(&self, blockers: &[Blocker]) -> f64 {
        let all = (1u64 << blockers.len()) as u32 - 1;
        let normal = self.normal.as_vec3();
        let found = irradiance(&self.quad, self.point.as_vec3(), [normal; 2], blockers, all);
        f64::from(found.expect("few pieces"))
    }

    /// By the middles of 300 × 300 cells; and what all of the lamp brings.
    fn counted(&self) -> (f64, f64) {
        const CELLS: usize = 300;
        let [corner, u, v] = [self.quad.corner, self.quad.u, self.quad.v].map(Vec3::as_dvec3);
        let (mut seen, mut all) = (0.0, 0.0);
        for i in 0..CELLS * CELLS {
            let [a, b] = [i % CELLS, i / CELLS].map(|k| (k as f64 + 0.5) / CELLS as f64);
            let there = corner + u * a + v * b;
            let d = there - self.point;
            let cosines = self.normal.dot(d) * self.quad.normal.as_dvec3().dot(d).abs();
            let part = cosines.max(0.0) / d.length_squared().powi(2);
            all += part;
            if !self.triangles.iter().any(|t| crosses(self.point, there, *t)) {
                seen += part;
            }
        }
        let cell = f64::from(self.quad.area) / (CELLS * CELLS) as f64;
        (seen * cell, all * cell)
    }
}

#[test]
fn what_is_seen_past_triangles_is_what_rays_count() {
    let mut rng = Rng(1);
    let (mut worst, mut partly, mut caught) = (0.0_f64, 0, 0);
    for _ in 0..400 {
        let case = Case::random(&mut rng);
        let (seen, all) = case.counted();
        if all < 1e-3 {
            continue;
        }
        let mut blockers = case.blockers();
        let error = (case.exact(&blockers) - seen).abs() / all;
        worst = worst.max(error);
        if seen < 0.98 * all && seen > 0.02 * all {
            partly += 1;
            // The same test sees one that is left out.
            blockers.pop();
            caught += u32::from((case.exact(&blockers) - seen).abs() / all > 0.01);
        }
    }
    println!(
        "worst difference {worst:.1e} of the lamp, {partly} partly hidden, {caught} times a missing triangle seen"
    );
    // A boundary crosses no more than about 2 of each 300 cells, and errs by half a cell in either direction.
    assert!(worst < 5e-3, "{worst}");
    assert!(partly > 100 && caught > partly / 2);
}

#[test]
fn a_lamp_past_nothing_sends_what_lambert_says() {
    let mut rng = Rng(2);
    let mut worst = 0.0_f64;
    for _ in 0..300 {
        let case = Case::random(&mut rng);
        let (_, all) = case.counted();
        let (point, normal) = (case.point.as_vec3(), case.normal.as_vec3());
        if all < 1e-3 || !case.quad.is_large(point) {
            continue;
        }
        worst = worst.max((case.exact(&[]) / all - 1.0).abs());
        if case.quad.is_above(point, normal) {
            let plain = f64::from(case.quad.irradiance(point, normal).abs());
            worst = worst.max((plain / case.exact(&[]) - 1.0).abs());
        }
    }
    // The middles of the cells are good for some 1e-5 where all is above the horizon, 1e-3 where it cuts cells.
    assert!(worst < 2e-3, "{worst:e}");
}

/// Over its middle, at the distance of its side.
#[test]
fn a_square_overhead_is_lamberts_square() {
    let quad = Quad::new(Vec3::new(-0.5, -0.5, 1.0), Vec3::X, Vec3::Y);
    // E = 4 · (x/√(1+x²)) · atan(x/√(1+x²)) for a square of half side x at distance 1 above its middle.
    let k = 0.5 / 1.25_f64.sqrt();
    let expected = 4.0 * k * k.atan();
    let found = f64::from(quad.irradiance(Vec3::ZERO, Vec3::Z).abs());
    assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}");
    let cut = irradiance(&quad, Vec3::ZERO, [Vec3::Z; 2], &[], 0).expect("one piece");
    assert!((f64::from(cut) / expected - 1.0).abs() < 1e-6);
}

#[test]
fn the_angle_over_its_sine() {
    assert!((angle_over_sine(1.0) - 1.0).abs() < 1e-7);
    for i in 0..199_000 {
        let c = -0.99 + i as f32 * 1e-5;
        let angle = f64::from(c).acos();
        let expected = if angle == 0.0 { 1.0 } else { angle / angle.sin() };
        // Near ±1 the cosine itself says little about the angle.
        let error = (f64::from(angle_over_sine(c)) / expected - 1.0).abs();
        assert!(error < if c < -0.9 { 4e-6 } else { 5e-7 }, "{c}: {error:e}");
    }
}

#[test]
fn two_triangles_of_a_wall_are_one_blocker() {
    let corners = [(-1.0, 0.0), (1.0, 0.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, z)| Vec3::new(x, 0.3, z));
    let [a, b, c, d] = corners;
    let lamp = Vec3::new(0.0, 0.0, 2.0);
    let make = |t: [Vec3; 3]| Blocker::new(&t, lamp, Vec3::NEG_Z, 1e-6).expect("below the lamp");
    let point = Vec3::new(0.1, -0.4, 0.0);
    let patch = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| point.as_dvec3() + DVec3::new(x, y, 0.0) * 0.1);
    let quad = Quad::new(Vec3::new(-0.5, -0.5, 2.0), Vec3::X, Vec3::Y);
    let seen = |blockers: &[Blocker]| {
        let all = (1 << blockers.len()) - 1;
        irradiance(&quad, point, [Vec3::Z; 2], blockers, all).expect("few pieces")
    };
    // Flat, or bent: what counts is what it looks like. In each order, each way round.
    for fourth in [d, d + Vec3::Y * 0.1, d - Vec3::Y * 0.1] {
        for [x, y] in [[[a, b, c], [a, c, fourth]], [[c, b, a], [c, fourth, a]], [[c, fourth, a], [a, b, c]]]
        {
            let mut two = vec![make(x), make(y)];
            let apart = two.clone();
            simplify(&mut two, 0, &patch);
            assert_eq!(two.len(), 1, "{fourth}");
            assert!((seen(&two) - seen(&apart)).abs() < 1e-6, "{fourth}");
        }
    }
    // Not convex, or seen from both sides: two. What lies in another is none.
    for fourth in [Vec3::new(1.2, 0.3, 1.5), Vec3::new(1.2, -1.1, 0.0)] {
        let mut two = vec![make([a, b, c]), make([a, c, fourth])];
        simplify(&mut two, 0, &patch);
        assert_eq!(two.len(), 2, "{fourth}");
    }
    let mut two = vec![make([a, b, c]), make([a, c, Vec3::new(0.0, 0.3, 0.2)])];
    simplify(&mut two, 0, &patch);
    assert_eq!(two.len(), 1);
    assert!((seen(&two) - seen(&[make([a, b, c])])).abs() < 1e-7);
}

/// Boxes and other bodies that stand between a patch and a lamp: as few outlines as they are, all points of the patch see
/// of the lamp what they saw of it past each triangle.
#[test]
fn outlines_hide_what_their_triangles_hide() {
    let mut rng = Rng(5);
    let (mut worst, mut partly, mut before, mut after, mut caught) = (0.0_f64, 0, 0, 0, 0);
    for _ in 0..300 {
        let quad = Quad::new(Vec3::new(-0.6, -0.5, 2.5), Vec3::new(1.2, 0.1, 0.1), Vec3::new(0.0, 1.0, -0.1));
        let place = DAffine3::from_scale_rotation_translation(
            rng.point(DVec3::splat(0.05), DVec3::new(0.4, 0.4, 0.6)),
            glam::DQuat::from_rotation_z(rng.unit() * PI) * glam::DQuat::from_rotation_x(rng.unit()),
            rng.point(DVec3::new(-0.4, -0.4, 0.9), DVec3::new(0.4, 0.4, 1.4)),
        );
        let corner = |i: usize| {
            let side = |bit: usize| if i >> bit & 1 == 1 { 1.0 } else { -1.0 };
            place.transform_point3(DVec3::new(side(0), side(1), side(2))).as_vec3()
        };
        let facing = -quad.normal;
        let of = |t: [usize; 3]| Blocker::new(&t.map(corner), quad.corner, facing, 1e-6);
        let faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let triangles = faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]);
        let apart: Vec<Blocker> = triangles.filter_map(of).collect();
        let middle = rng.point(DVec3::new(-0.5, -0.5, -0.1), DVec3::new(0.5, 0.5, 0.1));
        let size = 0.05;
        let patch = [(-size, -size), (size, -size), (size, size), (-size, size)]
            .map(|(x, y)| middle + DVec3::new(x, y, 0.1 * x));
        let mut outlines = apart.clone();
        simplify(&mut outlines, 0, &patch);
        (before, after) = (before + apart.len(), after + outlines.len());
        for _ in 0..20 {
            let point = on(&mut rng, patch).as_vec3();
            let seen = |blockers: &[Blocker]| {
                let all = (1 << blockers.len()) - 1;
                irradiance(&quad, point, [Vec3::Z; 2], blockers, all).map(f64::from)
            };
            // In a dozen triangles the lamp may fall to too many pieces.
            let (Some(whole), Some(expected)) = (seen(&[]), seen(&apart)) else { continue };
            let difference =
                |outlines: &[Blocker]| (expected - seen(outlines).expect("few pieces")).abs() / whole;
            worst = worst.max(difference(&outlines));
            if (0.02..0.98).contains(&(expected / whole)) {
                partly += 1;
                // The same test sees one that is left out, if no other hides the same.
                caught += u32::from(difference(&outlines[1..]) > 1e-4);
            }
        }
    }
    println!(
        "{before} triangles, {after} outlines; worst difference {worst:.1e} of the lamp; {partly} partly, {caught} caught"
    );
    assert!(worst < 4e-6, "{worst:e}");
    assert!(after * 4 < before && partly > 1000 && caught * 2 > partly);
}

/// A wall whose top is at the lamp's height, a hair above or below it: whichever corner its triangles begin with.
#[test]
fn a_wall_up_to_the_lamps_height_hides_all_that_it_hides() {
    let quad = Quad::new(Vec3::new(-0.5, -0.5, 2.0), Vec3::X, Vec3::Y);
    let point = DVec3::new(1.0, 0.1, 0.0);
    let patch = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| point + DVec3::new(x, y, 0.0) * 0.1);
    for top in [2.0f32, 2.0f32.next_up(), 2.0f32.next_down(), 2.0 - 1e-5, 2.0 + 1e-5, 2.5, 1.9] {
        let [a, b, c, d] = [(-2.0, 0.0), (2.0, 0.0), (2.0, f64::from(top)), (-2.0, f64::from(top))]
            .map(|(y, z)| DVec3::new(0.3, y, z));
        for turn in 0..6 {
            let order = |t: [DVec3; 3]| {
                let [x, y, z] = [0, 1, 2].map(|k| t[(k + turn) % 3]);
                if turn < 3 { [x, y, z] } else { [x, z, y] }
            };
            let triangles = vec![order([a, b, c]), order([a, c, d])];
            let case = Case { quad, point, normal: DVec3::Z, triangles };
            let (seen, all) = case.counted();
            assert!(seen > 0.1 * all && seen < 0.6 * all, "partly");
            let mut blockers = case.blockers();
            for merged in [false, true] {
                if merged {
                    simplify(&mut blockers, 0, &patch);
                }
                let error = (case.exact(&blockers) - seen).abs() / all;
                assert!(error < 5e-3, "{top}, {turn}, {merged}: {error}");
            }
        }
    }
}

/// A patch of a floor, a lamp, and something between or beside them.
fn shaft(rng: &mut Rng) -> ([DVec3; 4], [DVec3; 4]) {
    let parallelogram = |rng: &mut Rng, middle: DVec3, size: f64| {
        let [u, v] = [(); 2].map(|()| rng.point(DVec3::splat(-size), DVec3::splat(size)));
        [middle - u - v, middle + u - v, middle + u + v, middle - u + v]
    };
    let patch = parallelogram(rng, DVec3::ZERO, 0.2);
    let there = rng.point(DVec3::splat(-3.0), DVec3::splat(3.0));
    (patch, parallelogram(rng, there, 0.5))
}

fn on(rng: &mut Rng, [a, b, _, d]: [DVec3; 4]) -> DVec3 {
    a + (b - a) * rng.unit() + (d - a) * rng.unit()
}

#[test]
fn a_shaft_never_overlooks_what_is_in_the_way() {
    let mut rng = Rng(3);
    let (mut in_the_way, mut free, mut known_free, mut blind) = (0, 0, 0, 0);
    for _ in 0..400 {
        let (patch, lamp) = shaft(&mut rng);
        let whole = Shaft::new(&patch, &lamp);
        // Half of the lamp: what it overlooks shows that the test would see it.
        let half =
            Shaft::new(&patch, &[lamp[0], lamp[1], lamp[0].lerp(lamp[3], 0.5), lamp[1].lerp(lamp[2], 0.5)]);
        let segments: Vec<_> = (0..200).map(|_| (on(&mut rng, patch), on(&mut rng, lamp))).collect();
        for _ in 0..40 {
            let middle = rng.point(DVec3::splat(-3.0), DVec3::splat(3.0));
            let corner = |rng: &mut Rng| (middle + rng.point(DVec3::splat(-1.0), DVec3::ONE)).as_vec3();
            let triangle = [corner(&mut rng), corner(&mut rng), corner(&mut rng)];
            let exact = triangle.map(Vec3::as_dvec3);
            let blocks = segments.iter().any(|(a, b)| crosses(*a, *b, exact));
            let missed = whole.misses_triangle(&triangle);
            assert!(!(blocks && missed), "{triangle:?} is in the way from {patch:?} to {lamp:?}");
            assert!(!(blocks && whole.misses_box(&Aabb::around(&triangle))));
            if blocks {
                in_the_way += 1;
                blind += u32::from(half.misses_triangle(&triangle));
            } else {
                free += 1;
                known_free += u32::from(missed);
            }
        }
    }
    println!(
        "{in_the_way} in the way; {known_free} of {free} others known to be free; half a shaft overlooks {blind}"
    );
    assert!(in_the_way > 200 && known_free * 10 > free * 8 && blind > 10);
}

#[test]
fn all_placed_triangles_in_the_way_are_named() {
    let mut rng = Rng(4);
    let mut named_at_all = 0;
    for _ in 0..40 {
        let triangles: Vec<[Vec3; 3]> = (0..300)
            .map(|_| {
                let middle = rng.point(DVec3::splat(-3.0), DVec3::splat(3.0));
                [(); 3].map(|()| (middle + rng.point(DVec3::splat(-0.3), DVec3::splat(0.3))).as_vec3())
            })
            .collect();
        let placed = DAffine3::from_scale_rotation_translation(
            DVec3::new(1.5, -0.7, 1.1),
            glam::DQuat::from_rotation_z(rng.unit() * PI),
            rng.point(DVec3::NEG_ONE, DVec3::ONE),
        );
        let blas = Arc::new(Blas::build(&triangles));
        let places = [DAffine3::IDENTITY, placed];
        let placements = places.map(|place| Placement::new(Arc::clone(&blas), place).expect("not flat"));
        let tlas = Tlas::build(placements.to_vec());
        let (patch, lamp) = shaft(&mut rng);
        let mut named = Vec::new();
        let finished = tlas.blockers(&Shaft::new(&patch, &lamp), |instance, triangle| {
            named.push((instance, triangle));
            true
        });
        if !finished {
            continue;
        }
        named_at_all += named.len();
        for _ in 0..200 {
            let (from, to) = (on(&mut rng, patch), on(&mut rng, lamp));
            for (instance, place) in (0..).zip(&places) {
                for triangle in &triangles {
                    let there = triangle.map(|p| place.transform_point3(p.as_dvec3()));
                    if crosses(from, to, there) {
                        let is = |(i, t): &(u32, [Vec3; 3])| {
                            *i == instance
                                && t.iter().zip(there).all(|(p, q)| p.as_dvec3().distance(q) < 1e-5)
                        };
                        assert!(named.iter().any(is), "{triangle:?} of {instance} was not named");
                    }
                }
            }
        }
        // Giving up is said.
        assert!(named.is_empty() || !tlas.blockers(&Shaft::new(&patch, &lamp), |_, _| false));
    }
    assert!(named_at_all > 100);
}
