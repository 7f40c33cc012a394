//! L11: penumbrae by similar triangles; and shadows of lines, sharp along and soft across.

use super::lamps::{LIMIT, line};
use super::meter::{Plan, measure, ours};
use super::oracle::{self, Line};
use super::spot::{Expected, Spot, opaque, panel};
use crate::scene::Emission;
use crate::torture::{Case, Check, Effort, Place, Trial};
use glam::DVec3;

/// Height of the light.
const HEIGHT: f64 = 4.0;

/// A unit square at height 4, of which an opaque half-plane x < 0 at height `h`, `size` wide and twice as long, leaves
/// x > −x (4 − h) / h.
fn under_an_edge(x: f64, h: f64, size: f64) -> Spot {
    let seen = move |p: DVec3| {
        let from = (-p.x * (HEIGHT - h) / h).max(-0.5);
        let corner = |x: f64, y: f64| DVec3::new(x, y, HEIGHT);
        (from < 0.5).then(|| [corner(from, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(from, 0.5)])
    };
    let (point, edge) = (DVec3::X * x, 0.5 * h / (HEIGHT - h));
    let exact = move |p| seen(p).map_or(0.0, |corners| oracle::polygon(&corners, p, DVec3::Z));
    // Where little of the light is seen its edge is known no better than where it is cut.
    let condition = move |p| {
        let all = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, y)| DVec3::new(x, y, HEIGHT));
        oracle::polygon_condition(&all, p, DVec3::Z)
    };
    let lit = Spot::new(format!("x = {x:.3e}"), point, DVec3::Z, exact)
        .with(panel(DVec3::new(-0.5, -0.5, HEIGHT), DVec3::X, DVec3::Y))
        .half(0.5 * edge);
    let lit = Spot { computed: true, eye: 0.5 * h, ..lit };
    let edge_at = |z: f64| opaque(DVec3::new(-size, -size, z), DVec3::X * size, DVec3::Y * (2.0 * size));
    let hidden = lit.clone().with(edge_at(h));
    if x < -edge {
        hidden.expecting(Expected::Dark)
    } else if x > edge {
        // A camera and a render space as with it.
        hidden.expecting(Expected::Same(Box::new(lit.with(edge_at(-h)))))
    } else {
        hidden.with_condition(condition)
    }
}

/// `count` places across a strip three times as wide as the penumbra under an edge at height `h`, of something as large
/// in proportion to that: the place of a large one is known less well where it is far from the origin.
#[must_use]
pub fn penumbra(h: f64, count: u32) -> Vec<Spot> {
    penumbra_of(h, 100.0 * h, count)
}

/// The same of something so large.
#[must_use]
pub fn penumbra_of(h: f64, size: f64, count: u32) -> Vec<Spot> {
    let width = 3.0 * h / (HEIGHT - h);
    let places = (0..count).map(|i| width * (f64::from(i) / f64::from(count - 1) - 0.5));
    places.map(|x| under_an_edge(x, h, size)).collect()
}

/// A line at height 4 along x, and an opaque half-plane at height 1: x < 0, or y < 0.
#[must_use]
pub fn shadows_of_a_line() -> Vec<Spot> {
    let (a, b) = (DVec3::new(-0.5, 0.0, HEIGHT), DVec3::new(0.5, 0.0, HEIGHT));
    let mut spots = Vec::new();
    for (emission, kind) in [(Emission::Isotropic, Line::Isotropic), (Emission::Sine, Line::Sine)] {
        for x in [-0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2] {
            let seen = move |p: DVec3| {
                let from = (-3.0 * p.x).max(-0.5);
                let part = DVec3::new(from, 0.0, HEIGHT);
                if from < 0.5 { oracle::line(part, b, p, DVec3::Z, kind) } else { 0.0 }
            };
            let across = opaque(DVec3::new(-100.0, -100.0, 1.0), DVec3::X * 100.0, DVec3::Y * 200.0);
            let name = format!("{kind:?}, across at {x}");
            let spot = Spot::new(name, DVec3::X * x, DVec3::Z, seen).with(line(a, b, emission)).half(0.1);
            let spot = spot.with(across);
            spots.push(if x < -1.0 / 6.0 { spot.expecting(Expected::Dark) } else { spot });
        }
        for y in [-1e-3, 1e-3] {
            let along = opaque(DVec3::new(-100.0, -100.0, 1.0), DVec3::X * 200.0, DVec3::Y * 100.0);
            let aside = opaque(DVec3::new(-100.0, -100.0, -1.0), DVec3::X * 200.0, DVec3::Y * 100.0);
            let all = move |p| oracle::line(a, b, p, DVec3::Z, kind);
            let name = format!("{kind:?}, along at {y}");
            let spot = Spot::new(name, DVec3::Y * y, DVec3::Z, all).with(line(a, b, emission)).half(1e-4);
            let expected =
                if y < 0.0 { Expected::Dark } else { Expected::Same(Box::new(spot.clone().with(aside))) };
            spots.push(spot.with(along).expecting(expected));
        }
    }
    spots
}

/// So many places at the origin, and 11 elsewhere; 201 everywhere if there is time. Of something so large.
fn edges(trial: &Trial<'_>, id: &'static str, h: f64, size: f64, here: u32) -> Vec<Check> {
    let [here, elsewhere] = match trial.effort {
        Effort::Quick => [11, 11],
        Effort::Normal => [here, 11],
        Effort::Long => [201, 201],
    };
    const ALL: &[Place] = &Place::ALL;
    let (origin, others) = ALL.split_at(1);
    let mut checks = Vec::new();
    for (places, count) in [(origin, here), (others, elsewhere)] {
        let plan = Plan { places, together: true, samples: [1 << 13, 1 << 13, 1 << 23], ..Plan::of(id) };
        checks.extend(measure(trial, plan, &penumbra_of(h, size, count), &|ask| {
            ours(ask, &|| !trial.interrupted())
        }));
    }
    checks
}

/// As wide as its height.
pub const L11: Case = Case {
    id: "L11",
    title: "a penumbra by similar triangles, at 201 places (11 away from the origin, but with --long)",
    limit: LIMIT,
    run: |trial| edges(trial, "L11", 1.0, 100.0, 201),
};

/// At the contact.
pub const L11B: Case = Case {
    id: "L11b",
    title: "the penumbra of an edge a thousandth above the floor: no leak at the contact",
    limit: LIMIT,
    run: |trial| {
        let mut checks = edges(trial, "L11b", 1e-3, 0.1, 201);
        checks.extend(edges(trial, "L11b", 1e-3, 100.0, 11).into_iter().map(|check| {
            let what = format!("of 100 x 200, {}", check.what);
            Check { what, ..check }
        }));
        checks
    },
};

/// Of lines.
pub const L11C: Case = Case {
    id: "L11c",
    title: "shadows of a line: sharp along it, soft across",
    limit: LIMIT,
    run: |trial| {
        measure(trial, Plan::of("L11c"), &shadows_of_a_line(), &|ask| ours(ask, &|| !trial.interrupted()))
    },
};
