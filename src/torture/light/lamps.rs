//! L1 to L10: each kind of light by itself, where single precision has its traps.

use super::meter::{Plan, measure, ours};
use super::oracle::{self, Line};
use super::spot::{Expected, Spot, Thing, shining};
use crate::scene::{Emission, Light, TriangleMesh};
use crate::torture::{Case, Check, Trial};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// What a list of spots must keep.
pub(super) const LIMIT: &str = "computed: what f32 may round; sampled: 4.5 standard errors, themselves at most 1e-3; zero where it says zero";

fn of(trial: &Trial<'_>, id: &'static str, spots: &[Spot]) -> Vec<Check> {
    measure(trial, Plan::of(id), spots, &|ask| ours(ask, &|| !trial.interrupted()))
}

const UP: DVec3 = DVec3::Z;

/// L1: control.
#[must_use]
pub fn quads() -> Vec<Spot> {
    vec![
        Spot::under("overhead", DVec3::ZERO, UP, [v(-0.5, -0.5, 1.0), DVec3::X, DVec3::Y]),
        Spot::under("oblique", v(3.0, 0.25, 0.0), UP, [v(-1.0, -0.5, 2.0), DVec3::X * 2.0, DVec3::Y]),
    ]
}

/// L2: emissive triangles; five are those of Nori's direct lighting test.
#[must_use]
pub fn triangles() -> Vec<Spot> {
    let nori = [
        [-0.443432, 0.596366, 0.495985, -0.320397, 0.0677699, -0.229359, 0.0341197, 0.11415, -0.343049],
        [0.461963, 0.397843, 0.412747, -0.0381582, 0.851323, -0.156872, 0.195443, 0.891957, -0.260672],
        [0.100871, 0.289075, -0.422609, -0.308386, 0.629587, 0.423966, -0.373132, 0.237287, 0.351592],
        [-0.17575, 0.639397, 0.151268, 0.318604, 0.732996, 0.459771, 0.139095, 0.294498, 0.478556],
        [-0.17487, 0.447916, 0.367201, -0.405259, 0.249607, -0.354079, 0.356029, 0.0918984, -0.132271],
    ];
    let mut spots = vec![triangle("at height 1", UP, [0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0])];
    spots.extend(nori.map(|corners| {
        // Some of these hang low: the camera sees nothing of them from a hand's breadth below.
        Spot { eye: 0.01, ..triangle("Nori's", DVec3::Y, corners) }
    }));
    spots
}

fn triangle(name: &str, normal: DVec3, c: [f64; 9]) -> Spot {
    let corners = [0, 3, 6].map(|i| v(c[i], c[i + 1], c[i + 2]).as_vec3());
    let mesh =
        TriangleMesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..TriangleMesh::default() };
    let corners = corners.map(Vec3::as_dvec3);
    Spot::new(name, DVec3::ZERO, normal, move |p| oracle::polygon(&corners, p, normal)).with(shining(mesh))
}

/// L3: half of it under the horizon.
#[must_use]
pub fn cut_by_the_horizon() -> Vec<Spot> {
    let light = [v(2.0, -1.0, -1.0), DVec3::Y * 2.0, DVec3::Z * 2.0];
    let tilted = [v(1.0, -1.0, -0.7), v(0.2, 2.0, 0.1), v(0.3, 0.1, 1.6)];
    vec![
        Spot::under("half under the horizon", DVec3::ZERO, UP, light),
        Spot::under("tilted, under the horizon", DVec3::ZERO, v(0.2, 0.1, 1.0), tilted),
    ]
}

/// L4: standing on the floor.
#[must_use]
pub fn touching_the_floor() -> Vec<Spot> {
    [1.0, 0.1, 0.01, 1e-4, 1e-6]
        .map(|x| {
            let light = [v(0.0, -1.0, 0.0), DVec3::Y * 2.0, DVec3::Z];
            let spot = Spot::under(format!("from {x}"), v(x, 0.0, 0.0), UP, light).half(x.min(0.25) * 0.5);
            if x < 0.01 { spot.in_double_precision() } else { spot }
        })
        .to_vec()
}

/// L5: seen edge-on.
#[must_use]
pub fn edge_on() -> Vec<Spot> {
    [1.0, 0.01, 1e-4, 1e-6, 0.0]
        .map(|d: f64| {
            let light = [v(0.0, -0.5, 1.0), DVec3::Y, DVec3::Z];
            let half = if d == 0.0 { 1e-6 } else { d.min(1.0) };
            let spot = Spot::under(format!("{d} off its plane"), v(d, 0.0, 0.0), UP, light).half(half);
            if d < 0.01 { spot.in_double_precision() } else { spot }
        })
        .to_vec()
}

/// L6: far away.
#[must_use]
pub fn far() -> Vec<Spot> {
    [10.0, 1e3, 1e4, 1e6]
        .map(|h| {
            let light = [v(-0.5, -0.5, h), DVec3::X, DVec3::Y];
            let spot = Spot::under(format!("height {h:e}"), DVec3::ZERO, UP, light);
            if h > 50.0 { spot.in_double_precision() } else { spot }
        })
        .to_vec()
}

/// L7: larger than the sky.
#[must_use]
pub fn huge() -> Vec<Spot> {
    let light = [v(-5e5, -5e5, 1.0), DVec3::X * 1e6, DVec3::Y * 1e6];
    vec![Spot::under("1e6 wide at height 1", DVec3::ZERO, UP, light)]
}

fn ball(name: String, to: DVec3, radius: f64) -> Spot {
    let radius = f64::from(radius as f32);
    let light = Light::Sphere { radius: radius as f32, radiance: Vec3::ONE };
    Spot::new(name, DVec3::ZERO, UP, move |p| oracle::ball(radius, to - p, UP))
        .with(Thing::Light(light, DAffine3::from_translation(to)))
}

/// L8: balls, cut by the horizon, tiny, and touched.
#[must_use]
pub fn balls() -> Vec<Spot> {
    let mut spots: Vec<Spot> = [0.0, 1.0, FRAC_PI_2, 1.8, 2.0]
        .map(|angle: f64| {
            ball(format!("{angle:.2} rad off the normal"), v(angle.sin(), 0.0, angle.cos()) * 2.0, 1.0)
        })
        .to_vec();
    spots.extend([1e-2, 1e-4, 1e-6].map(|ratio| {
        let ball = ball(format!("of {ratio:e} of its distance"), DVec3::Z * 100.0, 100.0 * ratio);
        Spot { bound: if ratio < 1e-3 { 1e-5 } else { ball.bound }, ..ball }
    }));
    // Under the horizon, all of it.
    spots.push(Spot {
        expected: Expected::Dark,
        ..ball("2.2 rad off the normal".to_owned(), v(2.2f64.sin(), 0.0, 2.2f64.cos()) * 2.0, 1.0)
    });
    for off in [-1.0, 0.0, 1.0] {
        let touched = 1.0 + off * 2f64.powi(-23);
        let ball = ball(format!("{off} ulp off its surface"), DVec3::Z * touched, 1.0);
        // Small, so that the receiver is where the ball is touched.
        spots.push(Spot { expected: Expected::Finite, ..ball }.half(1e-4));
    }
    spots
}

/// L9: inside of a ball.
#[must_use]
pub fn inside_a_ball() -> Vec<Spot> {
    [
        (DVec3::ZERO, UP),
        (v(2.0, 1.0, -1.0), v(1.0, 1.0, 1.0)),
        (v(0.0, -3.9, 0.0), v(0.0, -1.0, 0.3)),
        (v(0.0, 0.0, 3.5), -UP),
        (v(0.0, 0.0, -4.999), UP),
    ]
    .map(|(point, normal)| {
        let light = Light::Sphere { radius: 5.0, radiance: Vec3::ONE };
        Spot::new(format!("at {point}"), point, normal, |_| PI)
            .with(Thing::Light(light, DAffine3::IDENTITY))
            .half(1e-3)
    })
    .to_vec()
}

/// A line of strength 1 per length.
#[must_use]
pub fn line(a: DVec3, b: DVec3, emission: Emission) -> Thing {
    let turn = DQuat::from_rotation_arc(DVec3::X, (b - a).normalize());
    let light =
        Light::Segment { half_length: (0.5 * a.distance(b)) as f32, strength: [Vec3::ONE; 2], emission };
    Thing::Light(light, DAffine3::from_rotation_translation(turn, (a + b) * 0.5))
}

/// L10: lines, and a thin box in place of one.
#[must_use]
pub fn lines() -> Vec<Spot> {
    let (flat, tilted) = ((v(-1.5, 0.0, 2.0), v(1.5, 0.0, 2.0)), (v(-1.5, 0.0, 2.0), v(1.5, 0.5, 3.0)));
    let mut spots = Vec::new();
    for ((a, b), point) in [(flat, DVec3::ZERO), (tilted, v(2.0, 1.0, 0.0)), (tilted, v(1.0, -3.0, 0.0))] {
        for (emission, kind) in [(Emission::Isotropic, Line::Isotropic), (Emission::Sine, Line::Sine)] {
            let name = format!("{kind:?} from {point}");
            spots.push(
                Spot::new(name, point, UP, move |p| oracle::line(a, b, p, UP, kind))
                    .with(line(a, b, emission)),
            );
        }
    }
    spots.push(thin_box());
    spots
}

/// A cylinder of 32 sides, of radius ρ = 1e-3 and radiance 1: a line of strength 2 ρ, for a thousandth of it.
fn thin_box() -> Spot {
    const SIDES: u32 = 32;
    let rho = 1e-3;
    let mut mesh = TriangleMesh::default();
    for i in 0..SIDES {
        let (y, z) = (2.0 * std::f32::consts::PI * i as f32 / SIDES as f32).sin_cos();
        let ring = Vec3::new(0.0, y, z) * rho + Vec3::Z * 2.0;
        mesh.positions.extend([ring - Vec3::X * 1.5, ring + Vec3::X * 1.5]);
        let (a, b) = (2 * i, (2 * i + 2) % (2 * SIDES));
        mesh.triangles.extend([[a, b + 1, a + 1], [a, b, b + 1]]);
    }
    let exact =
        move |p| 2.0 * f64::from(rho) * oracle::line(v(-1.5, 0.0, 2.0), v(1.5, 0.0, 2.0), p, UP, Line::Sine);
    let mut spot = Spot::new("a box 0.001 thick", DVec3::ZERO, UP, exact).with(shining(mesh));
    if let Expected::Value { model, .. } = &mut spot.expected {
        *model = 1e-3;
    }
    spot
}

macro_rules! case {
    ($name:ident, $id:literal, $spots:ident, $title:literal) => {
        #[doc = $title]
        pub const $name: Case =
            Case { id: $id, title: $title, limit: LIMIT, run: |trial| of(trial, $id, &$spots()) };
    };
}

case!(L1, "L1", quads, "a parallelogram light against Lambert's closed form");
case!(L2, "L2", triangles, "emissive triangles against Lambert's closed form");
case!(L3, "L3", cut_by_the_horizon, "a light half under the horizon");
case!(L4, "L4", touching_the_floor, "a light that stands on the floor, down to 1e-6 before it");
case!(L5, "L5", edge_on, "a light seen edge-on, down to 0 off its plane");
case!(L6, "L6", far, "a light as far away as a million times its size");
case!(L7, "L7", huge, "a light a million times as large as its distance");
case!(L8, "L8", balls, "balls: cut by the horizon, tiny, touched");
case!(L9, "L9", inside_a_ball, "inside of a ball that shines inward");
case!(L10, "L10", lines, "lines, isotropic and sine, and a thin box in place of one");
