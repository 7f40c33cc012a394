//! The hierarchy against brute force, and the hard cases of intersection. No tolerance anywhere.

use glam::{DAffine3, DQuat, DVec3, Vec3};
use penumbra::bvh::{Aabb, Blas, Bvh, Defect, Hit, Isa, Node, Placement, Probe, Ray, Tlas};
use proptest::prelude::*;
use std::sync::Arc;

/// A small deterministic source of numbers.
struct Rng(u64);

impl Rng {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = (((self.0 >> 18) ^ self.0) >> 27) as u32;
        x.rotate_right((self.0 >> 59) as u32)
    }
    fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / (1 << 24) as f32
    }
    fn vec(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vec();
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
    fn below(&mut self, n: usize) -> usize {
        self.bits() as usize % n
    }
}

/// Every triangle tried with the same routine, by the same rule about equals.
fn brute_force(triangles: &[[Vec3; 3]], ray: &Ray) -> Option<Hit> {
    let bounds = triangles.iter().fold(Aabb::EMPTY, |a, t| a.union(Aabb::around(t)));
    let probe = Probe::new(ray, &bounds);
    let mut best: Option<Hit> = None;
    for (triangle, corners) in (0..).zip(triangles) {
        if let Some(h) = probe.triangle(corners, best.map_or(ray.t_max, |b| b.t)) {
            let hit = Hit { t: h.t, u: h.u, v: h.v, triangle, instance: 0 };
            if best.is_none_or(|b| hit.beats(&b)) {
                best = Some(hit);
            }
        }
    }
    best
}

fn boxes(triangles: &[[Vec3; 3]]) -> Vec<Aabb> {
    triangles.iter().map(|t| Aabb::around(t)).collect()
}

/// Where triangles were split, their parts' leaves do not contain them whole.
fn check(blas: &Blas, triangles: &[[Vec3; 3]]) -> Result<(), Defect> {
    let hierarchy = blas.hierarchy();
    let whole = hierarchy.prims.len() == triangles.len();
    hierarchy.check(whole.then(|| boxes(triangles)).as_deref())
}

/// Half of the rays are aimed exactly at corners and edges.
fn aimed_ray(rng: &mut Rng, triangles: &[[Vec3; 3]], scale: f32, center: Vec3) -> Ray {
    let origin = center + rng.vec() * scale;
    let [a, b, c] = triangles[rng.below(triangles.len())];
    let target = match rng.below(4) {
        0 => a,
        1 => b.lerp(c, rng.unit()),
        2 => a * 0.25 + b * 0.25 + c * 0.5,
        _ => center + rng.vec() * scale,
    };
    Ray::new(origin, target - origin)
}

/// What one kernel says of rays: one by one and together, which must be the same.
fn ask(name: &str, blas: &Blas, rays: &[Ray]) -> Vec<Option<Hit>> {
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    blas.closest_hits(rays, &mut hits);
    blas.any_hits(rays, &mut blocked);
    for (i, ray) in rays.iter().enumerate() {
        assert_eq!(blas.closest_hit(ray), hits[i], "{name}: ray {i} alone, {ray:?}");
        assert_eq!(blas.any_hit(ray), hits[i].is_some(), "{name}: any-hit, ray {i} alone, {ray:?}");
        assert_eq!(blocked[i], hits[i].is_some(), "{name}: any-hit, ray {i}, {ray:?}");
    }
    hits
}

fn same_as_brute_force(name: &str, triangles: &[[Vec3; 3]], rays: usize) {
    let blas = Blas::build(triangles);
    check(&blas, triangles).unwrap_or_else(|defect| panic!("{name}: {defect}"));
    let bounds = blas.bounds();
    let scale = (bounds.max * 0.5 - bounds.min * 0.5).max_element().max(1e-20) * 1.5;
    let mut rng = Rng(7);
    let mut all: Vec<Ray> = (0..rays)
        .flat_map(|_| {
            let ray = aimed_ray(&mut rng, triangles, scale, bounds.center());
            // Each with close neighbours, so that there are packets of all sizes.
            let near = rng.below(3);
            (0..=near).map(move |k| Ray { origin: ray.origin + ray.direction * (k as f32 * 1e-3), ..ray })
        })
        .filter(|ray| ray.direction != Vec3::ZERO && ray.direction.is_finite() && ray.origin.is_finite())
        .collect();
    let expected: Vec<Option<Hit>> = all.iter().map(|ray| brute_force(triangles, ray)).collect();
    let ends: Vec<(Ray, Ray)> = all
        .iter()
        .zip(&expected)
        .filter_map(|(&ray, hit)| {
            let t = (*hit)?.t;
            Some((Ray { t_max: t, ..ray }, Ray { t_max: t.next_down(), ..ray }))
        })
        .collect();
    all.extend(ends.iter().flat_map(|&(at, before)| [at, before]));
    let expected: Vec<Option<Hit>> = expected
        .into_iter()
        .chain(ends.iter().flat_map(|(at, before)| {
            let hit = brute_force(triangles, at);
            assert!(hit.is_some(), "{name}: t_max itself counts");
            [hit, brute_force(triangles, before)]
        }))
        .collect();
    for isa in Isa::available() {
        let name = format!("{name}, {}", isa.name());
        for (i, (hit, expected)) in
            ask(&name, &blas.clone().with_isa(isa), &all).iter().zip(&expected).enumerate()
        {
            assert_eq!(hit, expected, "{name}: ray {i} {:?}", all[i]);
        }
    }
}

/// From so far away that triangles are tested in double precision, together with nearer ones that are not.
#[test]
fn a_ray_does_not_depend_on_how_far_away_its_neighbours_start() {
    let triangles: Vec<_> = soup(300, 0.3, 4).into_iter().map(|t| t.map(|p| p * 1e11)).collect();
    let mut rng = Rng(3);
    let rays: Vec<Ray> = (0..2048)
        .map(|i| {
            let target = triangles[rng.below(triangles.len())].iter().sum::<Vec3>() / 3.0;
            let from = Vec3::new(3.0, 2.0, 5.0).normalize() * if i % 2 == 0 { 2e11 } else { 4e12 };
            Ray::new(target + from, -from)
        })
        .collect();
    let blas = Blas::build(&triangles);
    let expected: Vec<_> = rays.iter().map(|ray| brute_force(&triangles, ray)).collect();
    assert!(expected.iter().flatten().count() > 1000);
    for isa in Isa::available() {
        let name = format!("near and far, {}", isa.name());
        assert_eq!(ask(&name, &blas.clone().with_isa(isa), &rays), expected, "{name}");
    }
}

fn soup(count: usize, size: f32, seed: u64) -> Vec<[Vec3; 3]> {
    let mut rng = Rng(seed);
    (0..count)
        .map(|_| {
            let p = rng.vec();
            [p, p + rng.vec() * size, p + rng.vec() * size]
        })
        .collect()
}

#[test]
fn closest_hit_agrees_with_brute_force() {
    for (count, size) in [(1, 1.0), (2, 1.0), (5, 0.5), (100, 0.3), (3000, 0.1), (300, 3.0)] {
        same_as_brute_force(&format!("{count} triangles of {size}"), &soup(count, size, 3), 2000);
    }
}

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

#[test]
fn far_and_small_scenes_agree_with_brute_force() {
    for scale in [1e-3, 1.0, 1e3] {
        for shift in
            [Vec3::ZERO, Vec3::splat(1e3), Vec3::splat(1e5), Vec3::new(148_376.0, 1234.0, -223_423.0)]
        {
            let mut triangles: Vec<_> =
                soup(400, 0.3, 21).into_iter().map(|t| t.map(|p| p * scale + shift)).collect();
            // Rounded to f32 some collapse to a line, which has no surface.
            triangles.retain(|t| {
                let [a, b, c] = t.map(Vec3::as_dvec3);
                (b - a).cross(c - a) != DVec3::ZERO
            });
            if triangles.len() < 10 {
                continue;
            }
            same_as_brute_force(&format!("scale {scale}, shift {shift}"), &triangles, 1000);
        }
    }
}

/// A closed bumpy sphere: every edge has two faces.
fn closed_mesh(shift: Vec3) -> Vec<[Vec3; 3]> {
    const RINGS: usize = 16;
    let mut rng = Rng(1);
    let bumps: Vec<f32> = (0..(RINGS + 1) * RINGS).map(|_| 1.0 + 0.2 * rng.unit()).collect();
    let vertex = |i: usize, j: usize| {
        if i == 0 || i == RINGS {
            return shift + Vec3::Y * if i == 0 { 2.0 } else { -2.0 };
        }
        let theta = std::f32::consts::PI * i as f32 / RINGS as f32;
        let phi = std::f32::consts::TAU * (j % RINGS) as f32 / RINGS as f32;
        let p = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        shift + p * 2.0 * bumps[i * RINGS + j % RINGS]
    };
    let mut triangles = Vec::new();
    for i in 0..RINGS {
        for j in 0..RINGS {
            let (a, b, c, d) = (vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j));
            if i > 0 {
                triangles.push([a, b, c]);
            }
            if i < RINGS - 1 {
                triangles.push([a, c, d]);
            }
        }
    }
    triangles
}

/// Rays out of a closed mesh: a third at points of edges, a third at corners; each also normalised.
fn outward(rng: &mut Rng, triangles: &[[Vec3; 3]], center: Vec3, count: usize) -> Vec<Ray> {
    (0..count)
        .flat_map(|_| {
            let origin = center + rng.vec() * 0.5;
            let [a, b, c] = triangles[rng.below(triangles.len())];
            let target = match rng.below(3) {
                0 => origin + rng.direction(),
                1 => a.lerp(b, rng.unit()),
                _ => c,
            };
            [target - origin, (target - origin).normalize()].map(|direction| Ray::new(origin, direction))
        })
        .collect()
}

fn leaks(blas: &Blas, rays: &[Ray]) -> usize {
    let (mut hits, mut blocked) = (vec![None; rays.len()], vec![false; rays.len()]);
    blas.closest_hits(rays, &mut hits);
    blas.any_hits(rays, &mut blocked);
    hits.iter().zip(blocked).map(|(hit, blocked)| usize::from(hit.is_none()) + usize::from(!blocked)).sum()
}

#[test]
fn no_ray_leaks_out_of_a_closed_mesh() {
    for shift in [Vec3::ZERO, Vec3::splat(1e3), Vec3::new(148_376.0, 1234.0, -223_423.0)] {
        let triangles = closed_mesh(shift);
        let blas = Blas::build(&triangles);
        let mut rng = Rng(5);
        for round in 0..10 {
            let rays = outward(&mut rng, &triangles, shift, 50_000);
            for isa in Isa::available() {
                let leaks = leaks(&blas.clone().with_isa(isa), &rays);
                assert_eq!(leaks, 0, "round {round}, at {shift}, {}", isa.name());
            }
            let alone = |ray: &&Ray| blas.closest_hit(ray).is_none() || !blas.any_hit(ray);
            assert_eq!(rays.iter().step_by(10).find(alone), None, "round {round}, at {shift}");
        }
    }
}

/// Slivers are split, and stay as tight as whole triangles: a tube of needles along a diagonal.
#[test]
fn no_ray_leaks_out_of_split_needles() {
    const SIDES: usize = 24;
    let along = Vec3::new(40.0, 37.0, 31.0);
    let across = along.any_orthonormal_vector();
    let other = along.normalize().cross(across);
    let point = |i: usize| {
        let angle = std::f32::consts::TAU * (i % SIDES) as f32 / SIDES as f32;
        (across * angle.cos() + other * angle.sin()) * 0.6
    };
    let mut triangles = Vec::new();
    for i in 0..SIDES {
        let (a, b) = (point(i), point(i + 1));
        triangles.extend([[-along + a, -along + b, along + b], [-along + a, along + b, along + a]]);
        triangles.extend([[-along * 1.02, -along + b, -along + a], [along * 1.02, along + a, along + b]]);
    }
    let blas = Blas::build(&triangles);
    assert!(blas.hierarchy().prims.len() > 4 * triangles.len(), "they were not split");
    let rays = outward(&mut Rng(6), &triangles, Vec3::ZERO, 200_000);
    for isa in Isa::available() {
        assert_eq!(leaks(&blas.clone().with_isa(isa), &rays), 0, "{}", isa.name());
    }
    triangles.remove(7);
    assert!(leaks(&Blas::build(&triangles), &rays) > 0, "one is missing");
}

#[test]
fn opening_an_edge_lets_rays_out() {
    let mut triangles = closed_mesh(Vec3::ZERO);
    let hole = triangles.swap_remove(40);
    let blas = Blas::build(&triangles);
    assert!(blas.closest_hit(&Ray::new(Vec3::ZERO, hole.iter().sum::<Vec3>() / 3.0)).is_none());
}

#[test]
fn a_refitted_hierarchy_hits_what_a_new_one_hits() {
    let triangles: Vec<[Vec3; 3]> = (0..1600)
        .flat_map(|k| {
            let point = |di: usize, dj: usize| {
                let (x, z) = ((k % 40 + di) as f32 * 0.05 - 1.0, (k / 40 + dj) as f32 * 0.05 - 1.0);
                Vec3::new(x, 0.2 * (x * 9.0).sin() * (z * 7.0).cos(), z)
            };
            let [a, b, c, d] = [point(0, 0), point(1, 0), point(1, 1), point(0, 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let blas = Blas::build(&triangles);
    let bend = |amount: f32| -> Vec<[Vec3; 3]> {
        triangles.iter().map(|t| t.map(|p| p + Vec3::Y * (p.x * 3.0).sin() * amount)).collect()
    };
    let mut rng = Rng(31);
    let mut refitted = blas.clone();
    for amount in [0.1, 0.2, 0.0] {
        let moved = bend(amount);
        refitted = refitted.refit(&moved).expect("bent a little");
        assert_eq!(check(&refitted, &moved), Ok(()));
        for _ in 0..1000 {
            let ray = aimed_ray(&mut rng, &moved, 2.0, Vec3::ZERO);
            assert_eq!(refitted.closest_hit(&ray), brute_force(&moved, &ray));
        }
    }
    assert_eq!(refitted.cost(), blas.cost(), "bent back");
    // Many small steps do not wear it out unseen.
    let apart = |step: usize| -> Vec<[Vec3; 3]> {
        let mut rng = Rng(5);
        triangles
            .iter()
            .map(|t| (t, rng.vec()))
            .map(|(t, v)| t.map(|p| p + v * 0.002 * step as f32))
            .collect()
    };
    assert!(blas.refit(&apart(1)).is_some());
    assert!((1..200).try_fold(blas.clone(), |blas, step| blas.refit(&apart(step))).is_none());
    assert!(blas.refit(&triangles[1..]).is_none(), "one is missing");
    let shuffled: Vec<_> = (0..3200).map(|i| triangles[i * 1237 % 3200]).collect();
    assert!(blas.refit(&shuffled).is_none(), "all are elsewhere");
    let mut without_place = triangles.clone();
    without_place[7][1].x = f32::NAN;
    assert!(blas.refit(&without_place).is_none());
    let mut collapsed = triangles.clone();
    collapsed[9] = [Vec3::ZERO; 3];
    assert!(Blas::build(&collapsed).refit(&triangles).is_none(), "one has come back");
}

/// Axis-parallel and diagonal rays on a grid, origins on slabs and corners: all that makes 0 · ∞.
#[test]
fn zero_direction_components_miss_nothing() {
    let mut triangles = Vec::new();
    for (x, y, z) in (0..8).flat_map(|x| (0..8).flat_map(move |y| (0..8).map(move |z| (x, y, z)))) {
        if (x + y + z) % 3 != 0 {
            continue;
        }
        let p = |dx: i32, dy: i32, dz: i32| Vec3::new((x + dx) as f32, (y + dy) as f32, (z + dz) as f32);
        let [a, b, c, d] = [p(0, 0, 0), p(1, 0, 0), p(1, 1, 0), p(0, 1, 0)];
        let [e, f, g, h] = [p(0, 0, 1), p(1, 0, 1), p(1, 1, 1), p(0, 1, 1)];
        for [p, q, r, s] in
            [[a, b, c, d], [e, f, g, h], [a, b, f, e], [d, c, g, h], [a, d, h, e], [b, c, g, f]]
        {
            triangles.extend([[p, q, r], [p, r, s]]);
        }
    }
    let blas = Blas::build(&triangles);
    let mut tried = 0;
    for d in 0..27 {
        let direction = Vec3::new((d % 3) as f32 - 1.0, (d / 3 % 3) as f32 - 1.0, (d / 9) as f32 - 1.0);
        if direction == Vec3::ZERO {
            continue;
        }
        for negative_zero in [false, true] {
            let direction =
                if negative_zero { direction.map(|c| if c == 0.0 { -0.0 } else { c }) } else { direction };
            // Every 35th of the 21³ origins, others for each direction: brute force over all triangles is slow.
            for o in (d % 7..9261).step_by(7 * 5) {
                let origin = Vec3::new((o % 21) as f32, (o / 21 % 21) as f32, (o / 441) as f32) * 0.5 - 1.0;
                let ray = Ray::new(origin, direction);
                assert_eq!(blas.closest_hit(&ray), brute_force(&triangles, &ray), "{ray:?}");
                tried += 1;
            }
        }
    }
    assert!(tried > 10_000);
    let quad = [[Vec3::ZERO, Vec3::X, Vec3::ONE.with_z(0.0)], [Vec3::ZERO, Vec3::ONE.with_z(0.0), Vec3::Y]];
    let blas = Blas::build(&quad);
    for direction in [Vec3::Z * 1e-30, Vec3::new(1e-45, 0.0, 1.0), Vec3::new(-0.0, -0.0, 1.0)] {
        let hit = blas.closest_hit(&Ray::new(Vec3::new(0.5, 0.25, -1.0), direction));
        assert!(hit.is_some_and(|h| h.t.is_finite()), "{direction:?}");
    }
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

#[test]
fn of_coincident_faces_the_lowest_index_wins() {
    let mut triangles = soup(300, 0.5, 4);
    let doubled = triangles.clone();
    triangles.extend(doubled);
    let blas = Blas::build(&triangles);
    let mut rng = Rng(3);
    let mut hits = 0;
    for _ in 0..5000 {
        if let Some(hit) = blas.closest_hit(&aimed_ray(&mut rng, &triangles, 2.0, Vec3::ZERO)) {
            assert!(hit.triangle < 300, "{hit:?}");
            hits += 1;
        }
    }
    assert!(hits > 1000);
}

fn place(triangles: &[[Vec3; 3]], world_from_local: DAffine3) -> Placement {
    Placement::new(Arc::new(Blas::build(triangles)), world_from_local).unwrap()
}

#[test]
fn instances_agree_with_each_alone() {
    let mut rng = Rng(17);
    let meshes: Vec<_> = (0..4).map(|i| soup(200, 0.4, 100 + i)).collect();
    let placements: Vec<_> = (0..40)
        .map(|i| {
            let rotation =
                DQuat::from_axis_angle(rng.direction().as_dvec3().normalize(), f64::from(rng.unit()) * 6.0);
            let scale = DVec3::new(1.0, 0.3, if i % 3 == 0 { -2.0 } else { 1.5 });
            let at = rng.vec().as_dvec3() * 8.0;
            place(&meshes[i % 4], DAffine3::from_scale_rotation_translation(scale, rotation, at))
        })
        .collect();
    let tlas = Tlas::build(placements.clone());
    for i in 0..2_100 {
        let ray = Ray::new(rng.vec() * 12.0, rng.direction());
        let expected = placements
            .iter()
            .zip(0..)
            .filter_map(|(p, instance)| {
                let hit = Tlas::build(vec![p.clone()]).closest_hit(&ray)?;
                Some(Hit { instance, ..hit })
            })
            .reduce(|a, b| if b.beats(&a) { b } else { a });
        assert_eq!(tlas.closest_hit(&ray), expected, "ray {i}");
        assert_eq!(tlas.any_hit(&ray), expected.is_some(), "any-hit, ray {i}");
    }
}

#[test]
fn no_ray_leaks_out_of_a_closed_instance() {
    let triangles = closed_mesh(Vec3::ZERO);
    let mut rng = Rng(23);
    let mut leaks = 0;
    for _ in 0..200 {
        let rotation =
            DQuat::from_axis_angle(rng.direction().as_dvec3().normalize(), f64::from(rng.unit()) * 6.0);
        let scale = DVec3::from_array([(); 3].map(|()| 10f64.powf(f64::from(rng.unit()) * 4.0 - 2.0)));
        let at = rng.vec().as_dvec3() * 10f64.powf(f64::from(rng.unit()) * 8.0 - 4.0);
        let placed = DAffine3::from_scale_rotation_translation(scale, rotation, at);
        let tlas = Tlas::build(vec![place(&triangles, placed)]);
        for _ in 0..500 {
            let origin = placed.transform_point3(rng.vec().as_dvec3() * 0.5).as_vec3();
            let corner = triangles[rng.below(triangles.len())][0];
            let target = placed.transform_point3(corner.as_dvec3()).as_vec3();
            let ray = Ray::new(origin, target - origin);
            leaks += u32::from(tlas.closest_hit(&ray).is_none()) + u32::from(!tlas.any_hit(&ray));
        }
    }
    assert_eq!(leaks, 0);
}

#[test]
fn a_singular_placement_is_refused() {
    let blas = Arc::new(Blas::build(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]));
    assert!(Placement::new(Arc::clone(&blas), DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0))).is_none());
    assert!(Placement::new(blas, DAffine3::from_translation(DVec3::splat(f64::NAN))).is_none());
}

#[test]
fn nothing_is_hit_where_there_is_nothing() {
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(Blas::build(&[]).closest_hit(&ray), None);
    assert_eq!(Tlas::build(Vec::new()).closest_hit(&ray), None);
    assert!(!Tlas::build(vec![place(&[], DAffine3::IDENTITY)]).any_hit(&ray));
}

#[test]
fn the_checker_finds_each_defect() {
    let triangles = soup(200, 0.2, 8);
    let boxes = boxes(&triangles);
    let good = Bvh::build(&boxes);
    assert_eq!(good.check(&boxes), Ok(()));
    let inner = good.nodes.iter().position(|n| n.count == 0).unwrap();
    let leaf = good.nodes.iter().position(|n| n.count > 0).unwrap();

    let mut broken = good.clone();
    broken.nodes[inner].max = broken.nodes[inner].min;
    assert!(matches!(broken.check(&boxes), Err(Defect::ChildOutsideParent { .. })));
    let mut broken = good.clone();
    broken.nodes[leaf].max = broken.nodes[leaf].min;
    assert!(matches!(broken.check(&boxes), Err(Defect::PrimOutsideLeaf { .. })));
    let mut broken = good.clone();
    broken.prims[1] = broken.prims[0];
    assert!(broken.check(&boxes).is_err());
    let mut broken = good.clone();
    broken.nodes[inner].first = 1 << 30;
    assert!(matches!(broken.check(&boxes), Err(Defect::Dangling { .. })));
    let mut broken = good;
    broken.nodes[leaf].count = 0;
    broken.nodes[leaf].first = 0;
    assert!(matches!(broken.check(&boxes), Err(Defect::Dangling { .. })), "no way back to the root");
}

#[test]
fn the_checker_finds_a_path_longer_than_a_traversal_stack() {
    // A chain: node 2 i is inner, node 2 i − 1 a leaf of one box beside it.
    let chain = |levels: u32| {
        let (min, max) = (Vec3::ZERO, Vec3::ONE);
        let mut nodes = vec![Node { min, first: 1, max, count: 0 }];
        for level in 1..=levels {
            nodes.push(Node { min, first: level - 1, max, count: 1 });
            nodes.push(Node { min, first: 2 * level + 1, max, count: 0 });
        }
        *nodes.last_mut().unwrap() = Node { min, first: levels, max, count: 1 };
        Bvh { nodes, prims: (0..=levels).collect() }.check(&vec![Aabb { min, max }; levels as usize + 1])
    };
    assert_eq!(chain(20), Ok(()));
    assert!(matches!(chain(200), Err(Defect::TooDeep { .. })));
}

#[test]
fn the_build_is_the_same_for_any_number_of_threads() {
    let boxes = boxes(&soup(50_000, 0.01, 6));
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Bvh::build(&boxes))
    };
    let (one, four) = (build(1), build(4));
    assert_eq!((one.nodes, one.prims), (four.nodes, four.prims));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn any_soup_agrees_with_brute_force(
        corners in prop::collection::vec(prop::array::uniform3(prop::array::uniform3(-10.0f32..10.0)), 1..60),
        rays in prop::collection::vec((prop::array::uniform3(-12.0f32..12.0), prop::array::uniform3(-1.0f32..1.0)), 1..20),
    ) {
        let triangles: Vec<[Vec3; 3]> = corners.iter().map(|t| t.map(Vec3::from_array)).collect();
        let blas = Blas::build(&triangles);
        prop_assert_eq!(check(&blas, &triangles), Ok(()));
        for (origin, direction) in rays {
            let ray = Ray::new(Vec3::from_array(origin), Vec3::from_array(direction));
            prop_assert_eq!(blas.closest_hit(&ray), brute_force(&triangles, &ray));
        }
    }
}
