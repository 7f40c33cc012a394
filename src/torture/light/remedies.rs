//! L14 to L16: where one way of sampling gives way to another, densities, and lights of very unlike power.

use super::chi_square::{Draws, Map, compare};
use super::lamps::LIMIT;
use super::meter::{Plan, larger, measure, ours};
use super::oracle;
use super::spot::{Spot, Thing, shining};
use crate::bvh::Ray;
use crate::scene::{Light, TriangleMesh};
use crate::torture::oracle::Rng;
use crate::torture::{Case, Check, Trial};
use crate::trace::Lights;
use crate::trace::emitter::Receiver;
use crate::trace::light::FlatLight;
use crate::trace::lights::KNOWN_LIGHTS;
use crate::trace::mesh_light::MeshLight;
use crate::trace::quad::Quad;
use crate::trace::shape_light::{Shape, ShapeLight};
use crate::trace::spherical::SphericalTriangle;
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Just on either side of where the renderer takes another way.
#[must_use]
pub fn either_side_of_a_switch() -> Vec<Spot> {
    let mut spots = Vec::new();
    let around = |at: f64| [at * (1.0 - 1e-4), at * (1.0 + 1e-4)];
    // A quarter of the edge: by area, or by solid angle. A hundredth: in single precision, or in double.
    for height in [0.25, 0.01].map(around).as_flattened() {
        let light = [v(-0.5, -0.5, *height), DVec3::X, DVec3::Y];
        spots.push(
            Spot::under(format!("{height:.6} under its middle"), DVec3::ZERO, DVec3::Z, light).half(1e-3),
        );
        let aside = [v(0.0, -0.5, 0.0), DVec3::Y, DVec3::Z];
        let name = format!("{height:.6} before it, standing");
        spots.push(Spot::under(name, v(*height, 0.0, 0.0), DVec3::Z, aside).half(height * 0.1));
    }
    // Fifty times as far as it is large: single or double precision.
    for height in around(2499.5f64.sqrt()) {
        let light = [v(-0.5, -0.5, height), DVec3::X, DVec3::Y];
        spots.push(Spot::under(format!("{height:.4} under it"), DVec3::ZERO, DVec3::Z, light));
    }
    // An emissive triangle whose middle is as far as half of its longest edge.
    for height in around(1.25f64.sqrt()) {
        let corners = [v(-1.0, -1.0, height), v(1.0, 0.0, height), v(0.0, 1.0, height)].map(DVec3::as_vec3);
        let mesh = TriangleMesh {
            positions: corners.to_vec(),
            triangles: vec![[0, 1, 2]],
            ..TriangleMesh::default()
        };
        let corners = corners.map(Vec3::as_dvec3);
        let exact = move |p| oracle::polygon(&corners, p, DVec3::Z);
        let name = format!("{height:.6} under an emissive triangle");
        spots.push(Spot::new(name, DVec3::ZERO, DVec3::Z, exact).with(shining(mesh)));
    }
    spots
}

/// What is sampled, and what a ray finds the density to be.
type Density<'a> = Box<dyn Fn(Vec3) -> f64 + Sync + 'a>;
type Direction<'a> = Box<dyn Fn(f64, f64) -> (DVec3, f64) + Sync + 'a>;
type Back<'a> = Box<dyn Fn(DVec3) -> (f64, f64) + Sync + 'a>;

struct Sampled<'a> {
    name: String,
    light: FlatLight,
    from: Vec3,
    density: Density<'a>,
    map: Map<Direction<'a>, Back<'a>>,
}

/// Directions in a cone around `axis` (1 − cos and angle), and back.
fn cone<'a>(axis: DVec3, one_minus_cos: f64) -> Map<Direction<'a>, Back<'a>> {
    let (x, y) = axis.any_orthonormal_pair();
    Map {
        direction: Box::new(move |a, b| {
            let cos = 1.0 - a * one_minus_cos;
            let (sin, phi) = ((1.0 - cos * cos).max(0.0).sqrt(), 2.0 * PI * b);
            (x * (sin * phi.cos()) + y * (sin * phi.sin()) + axis * cos, 2.0 * PI * one_minus_cos)
        }),
        place: Box::new(move |d: DVec3| {
            let a = 0.5 * (d.normalize() - axis).length_squared() / one_minus_cos;
            (a.clamp(0.0, 1.0), (d.dot(y).atan2(d.dot(x)) / (2.0 * PI)).rem_euclid(1.0))
        }),
    }
}

/// Places of a parallelogram, and back.
fn flat<'a>(from: Vec3, [corner, u, v]: [Vec3; 3]) -> Map<Direction<'a>, Back<'a>> {
    let [from, c, u, v] = [from, corner, u, v].map(Vec3::as_dvec3);
    let normal = u.cross(v);
    Map {
        direction: Box::new(move |a, b| {
            let to = c + u * a + v * b - from;
            (to.normalize(), normal.dot(to).abs() / to.length().powi(3))
        }),
        place: Box::new(move |d: DVec3| {
            let p = from + d * ((c - from).dot(normal) / d.dot(normal)) - c;
            let inverse = 1.0 / normal.length_squared();
            let (a, b) = (p.cross(v).dot(normal) * inverse, u.cross(p).dot(normal) * inverse);
            (a.clamp(0.0, 1.0), b.clamp(0.0, 1.0))
        }),
    }
}

fn of_shape<'a>(name: &str, shape: Shape, from: Vec3, map: Map<Direction<'a>, Back<'a>>) -> Sampled<'a> {
    let light = ShapeLight::new(shape, [Vec3::ONE; 4], true, true);
    let asked = light.clone();
    let density = move |wi: Vec3| {
        let ray = Ray::new(from, wi);
        asked.intersect(&ray).map_or(0.0, |hit| f64::from(asked.pdf(&ray, Vec3::Z, &hit)))
    };
    Sampled { name: name.to_owned(), light: FlatLight::Shape(light), from, density: Box::new(density), map }
}

/// The same as two triangles of a mesh, cut at its diagonal; cells are those of the parallelogram.
fn of_mesh<'a>(name: &str, from: Vec3, edges: [Vec3; 3]) -> Sampled<'a> {
    let [corner, u, v] = edges;
    let triangles = [(3, [corner, corner + u, corner + u + v]), (7, [corner, corner + u + v, corner + v])];
    let mesh = MeshLight::new(0, triangles.into_iter(), [true, false], 1.0, None).unwrap_or_default();
    let (asked, back) = (mesh.clone(), flat(from, edges).place);
    let normal = u.as_dvec3().cross(v.as_dvec3());
    let density = move |wi: Vec3| {
        let d = wi.as_dvec3();
        let (a, b) = back(d);
        let distance = (corner.as_dvec3() - from.as_dvec3()).dot(normal) / d.dot(normal);
        let cos = normal.normalize().dot(d).abs();
        let triangle = if a > b { 3 } else { 7 };
        let to = Receiver { point: from, normal: Vec3::Z };
        f64::from(asked.pdf(triangle, &to, (distance * distance) as f32, cos as f32))
    };
    let map = flat(from, edges);
    Sampled { name: name.to_owned(), light: FlatLight::Mesh(mesh), from, density: Box::new(density), map }
}

fn all_lights<'a>() -> Vec<Sampled<'a>> {
    let from = Vec3::new(0.2, -0.1, 0.05);
    let far = [Vec3::new(-0.3, -0.5, 0.6), Vec3::new(1.0, 0.2, 0.4), Vec3::new(-0.1, 0.8, 0.3)];
    let near = [Vec3::new(-0.3, -0.5, 0.1), far[1], far[2]];
    let parallelogram = |[corner, u, v]: [Vec3; 3]| Shape::Parallelogram(Quad::new(corner, u, v));
    let mut all = vec![
        of_shape("parallelogram", parallelogram(far), from, flat(from, far)),
        of_shape("parallelogram, near", parallelogram(near), from, flat(from, near)),
        of_mesh("emissive triangles", from, far),
        of_mesh("emissive triangles, near", from, near),
        disk(from),
    ];
    for (name, center, radius) in [
        ("ball, near", Vec3::new(0.5, 0.6, 0.7), 0.9),
        ("ball, far", Vec3::new(5.0, 6.0, 70.0), 0.9),
        ("ball, from inside", Vec3::new(0.5, 0.6, 0.7), 2.0f32),
    ] {
        let to = center.as_dvec3() - from.as_dvec3();
        let sin2 = (f64::from(radius) / to.length()).powi(2);
        let spread = if sin2 < 1.0 { sin2 / (1.0 + (1.0 - sin2).sqrt()) } else { 2.0 };
        all.push(of_shape(name, Shape::Sphere { center, radius }, from, cone(to.normalize(), spread)));
    }
    let axis = Vec3::new(0.3, -0.4, -0.7).normalize();
    for angle in [0.0093, 0.5, 2.0f64] {
        let sin2_radius = (0.5 * angle).sin().powi(2) as f32;
        let light = FlatLight::Directional { axis, irradiance: Vec3::ONE, sin2_radius };
        let map = cone(-axis.as_dvec3().normalize(), 1.0 - (0.5 * angle).cos());
        all.push(beyond(format!("sun {angle} rad wide"), light, from, map));
    }
    let sky = FlatLight::Environment { radiance: Vec3::ONE };
    all.push(beyond("sky".to_owned(), sky, from, cone(DVec3::Z, 1.0)));
    all
}

/// A disk, by squared radius and angle.
fn disk<'a>(from: Vec3) -> Sampled<'a> {
    let (center, normal, radius) = (Vec3::new(0.4, 0.3, 0.9), Vec3::new(0.3, -0.5, -0.8).normalize(), 0.7f32);
    let (c, n, r) = (center.as_dvec3() - from.as_dvec3(), normal.as_dvec3().normalize(), f64::from(radius));
    let (x, y) = n.any_orthonormal_pair();
    let map = Map::<Direction, Back> {
        direction: Box::new(move |a, b| {
            let (rho, phi) = (r * a.sqrt(), 2.0 * PI * b);
            let to = c + x * (rho * phi.cos()) + y * (rho * phi.sin());
            (to.normalize(), PI * r * r * n.dot(to).abs() / to.length().powi(3))
        }),
        place: Box::new(move |d: DVec3| {
            let p = d * (c.dot(n) / d.dot(n)) - c;
            let turn = (p.dot(y).atan2(p.dot(x)) / (2.0 * PI)).rem_euclid(1.0);
            ((p.length_squared() / (r * r)).min(1.0), turn)
        }),
    };
    of_shape("disk", Shape::Disk { center, normal, radius }, from, map)
}

fn beyond<'a>(name: String, light: FlatLight, from: Vec3, map: Map<Direction<'a>, Back<'a>>) -> Sampled<'a> {
    let asked = light.clone();
    let density = move |wi: Vec3| asked.beyond(Vec3::Z, wi).map_or(0.0, |(_, pdf)| f64::from(pdf));
    Sampled { name, light, from, density: Box::new(density), map }
}

/// Every light's sampler; `wrong` by what its density is multiplied, for a test of the test.
#[must_use]
pub fn densities(trial: &Trial<'_>, wrong: &(dyn Fn(Vec3) -> f64 + Sync)) -> Vec<Check> {
    let lights = all_lights();
    let draws = Draws {
        count: trial.pick(200_000, 1_000_000, 100_000_000),
        seed: trial.seed.wrapping_add(12),
        cells: if trial.effort == crate::torture::Effort::Quick { 16 } else { 64 },
        fine: 1024,
        level: 1e-4,
        tests: lights.len() as u32,
    };
    let of = |sampled: &Sampled| {
        if trial.interrupted() {
            return Vec::new();
        }
        let (mut far_off, mut asked) = (0.0f64, 0);
        let density = |wi: Vec3| (sampled.density)(wi) * wrong(wi);
        let sample = |rng: &mut Rng| {
            let sample = sampled.light.sample(sampled.from, Vec3::Z, rng.pair())?;
            // What a sample says is what a ray finds; at the very rim rounding may let the ray pass.
            let (said, found) = (f64::from(sample.pdf?), density(sample.wi));
            if found != 0.0 {
                asked += 1;
                far_off = larger(far_off, (said / found - 1.0).abs());
            }
            Some(sample.wi)
        };
        let mut checks = compare(&sampled.name, draws, sample, density, &sampled.map);
        let what = format!("{}: a sample's density and that of its ray, relative", sampled.name);
        checks.push(Check::new(what, asked, "samples", far_off, 2e-3));
        trial.tell("L15", sampled.name.clone(), 0.5);
        checks
    };
    lights.par_iter().flat_map_iter(of).collect()
}

/// A bright far light and a faint near one, alone and together; and with eight more, so that one is chosen.
#[must_use]
pub fn unlike_lights() -> Vec<Spot> {
    let square = |height: f64, aside: f64| {
        let corner = |x: f64, y: f64| v(aside + x, y, height);
        [corner(-0.5, -0.5), corner(-0.5, 0.5), corner(0.5, 0.5), corner(0.5, -0.5)]
    };
    let light = |height: f64, aside: f64, radiance: f32| {
        let radiance = [Vec3::splat(radiance); 4];
        let light = Light::Parallelogram { edge_u: Vec3::X, edge_v: Vec3::Y, radiance, two_sided: true };
        Thing::Light(light, DAffine3::from_translation(v(aside, 0.0, height)))
    };
    // Radiance times 1e8, and a distance at which they bring nearly the same.
    // Beside each other: they hide what is behind them.
    let (far, near) = ((1e4, 0.0, 1e8f32), (1.0, -1.5, 1.0f32));
    let rest: Vec<(f64, f64, f32)> = (0..8).map(|i| (2.0, 3.0 + f64::from(i), 1.0)).collect();
    let of = move |name: &str, lights: Vec<(f64, f64, f32)>, computed: bool| {
        let all = lights.clone();
        let exact = move |p| {
            let each =
                |(h, a, r): &(f64, f64, f32)| f64::from(*r) * oracle::polygon(&square(*h, *a), p, DVec3::Z);
            all.iter().map(each).sum::<f64>()
        };
        let all = lights.clone();
        let condition = move |p| {
            let each = |(h, a, r): &(f64, f64, f32)| {
                let corners = square(*h, *a);
                // Whatever is far is computed in double precision.
                let single = oracle::polygon_condition(&corners, p, DVec3::Z);
                f64::from(*r) * if *h > 50.0 { oracle::polygon(&corners, p, DVec3::Z) } else { single }
            };
            all.iter().map(each).sum::<f64>()
        };
        let spot = Spot::new(name, DVec3::ZERO, DVec3::Z, exact).with_condition(condition);
        let spot = lights.into_iter().fold(spot, |spot, (h, a, r)| spot.with(light(h, a, r)));
        Spot { computed, ..spot }
    };
    let chosen: Vec<_> = [far, near].into_iter().chain(rest).collect();
    vec![
        of("the bright one", vec![far], true),
        of("the faint one", vec![near], true),
        of("both", vec![far, near], false),
        of("one of ten by choice", chosen, false),
    ]
}

/// How much more the choice of a light scatters than if each were chosen alike: no more than four times, of more than 32 ten, whatever they
/// bring.
#[must_use]
pub fn choice(what: &str, chances: &[f64], brought: &[f64]) -> Check {
    let even = brought.len() as f64;
    let square =
        |p: &dyn Fn(usize) -> f64| brought.iter().enumerate().map(|(i, f)| f * f / p(i)).sum::<f64>();
    let ratio = square(&|i| chances[i]) / square(&|_| 1.0 / even);
    Check::new(
        format!("{what}: second moment beside even choice"),
        brought.len() as u64,
        "lights",
        ratio,
        if brought.len() <= KNOWN_LIGHTS { 4.000_01 } else { 10.000_01 },
    )
}

fn unlike(trial: &Trial<'_>) -> Vec<Check> {
    let mut checks =
        measure(trial, Plan::of("L16"), &unlike_lights(), &|ask| ours(ask, &|| !trial.interrupted()));
    let mut rng = Rng(trial.seed.wrapping_add(5));
    for n in [2, 10, 1000] {
        // Powers over sixteen decades; what they bring has nothing to do with it.
        let lamp = |rng: &mut Rng| FlatLight::Point {
            position: Vec3::ZERO,
            intensity: Vec3::splat(rng.decades(-8.0, 8.0).abs()),
        };
        let lights = Lights::new((0..n).map(|_| lamp(&mut rng)).collect(), Vec::new(), None);
        let to = Receiver { point: Vec3::NEG_Z, normal: Vec3::Z };
        let chances: Vec<f64> = (0..n as u32).map(|i| f64::from(lights.chance(1, i, &to))).collect();
        let brought: Vec<f64> = (0..n).map(|_| f64::from(rng.decades(-8.0, 8.0).abs())).collect();
        checks.push(choice(&format!("{n} lights"), &chances, &brought));
        let faint: Vec<f64> = chances
            .iter()
            .map(|c| if *c == chances.iter().copied().fold(1.0, f64::min) { 1.0 } else { 0.0 })
            .collect();
        checks.push(choice(&format!("only the faintest of {n}"), &chances, &faint));
    }
    checks
}

/// Solid angles of triangles far away: what they are in the plane, over the distance squared, to second order.
#[must_use]
pub fn solid_angles(count: u64, seed: u64, solid_angle: impl Fn([DVec3; 3]) -> f64) -> Check {
    let mut rng = Rng(seed);
    let mut worst = 0.0f64;
    for _ in 0..count {
        let [b, c] = [0; 2].map(|_| DVec3::new(f64::from(rng.unit()), f64::from(rng.unit()), 0.0));
        let distance = f64::from(rng.decades(3.0, 6.0).abs());
        let at = |p: DVec3| p + DVec3::Z * distance;
        let area = 0.5 * b.cross(c).length();
        if area < 1e-3 {
            continue;
        }
        let found = solid_angle([at(DVec3::ZERO), at(b), at(c)]);
        worst = larger(worst, (found * distance * distance / area - 1.0).abs());
    }
    Check::new("solid angle of far triangles, relative", count, "triangles", worst, 1e-5)
}

/// Switches.
pub const L14: Case = Case {
    id: "L14",
    title: "no step where one way of sampling or computing gives way to another",
    limit: LIMIT,
    run: |trial| {
        let spots = either_side_of_a_switch();
        let mut checks = measure(trial, Plan::of("L14"), &spots, &|ask| ours(ask, &|| !trial.interrupted()));
        let count = trial.pick(10_000, 100_000, 10_000_000);
        checks.push(solid_angles(count, trial.seed.wrapping_add(9), |corners| {
            SphericalTriangle::new(corners).map_or(0.0, |triangle| triangle.solid_angle)
        }));
        checks
    },
};

/// Densities.
pub const L15: Case = Case {
    id: "L15",
    title: "every light is sampled as its density says, which integrates to 1",
    limit: "χ² over cells of directions: p > 1e-4 for all together",
    run: |trial| densities(trial, &|_| 1.0),
};

/// Power.
pub const L16: Case = Case {
    id: "L16",
    title: "a faint near light beside one 1e8 times as strong; choice among many",
    limit: "4.5 standard errors, themselves at most 1e-3; no choice among up to 32 four times as bad as an even one, among more ten times",
    run: unlike,
};
