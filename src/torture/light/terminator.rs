//! H1: the edge of the shadow on coarse smooth meshes.

use super::meter::{larger, places};
use super::pictures::differing;
use crate::scene::{Light, Material, TriangleMesh};
use crate::torture::stage::{Stage, ball, cube, quad, reds, settings};
use crate::torture::{Case, Check, Place, Trial};
use crate::trace::Integrator;
use glam::{DAffine3, DQuat, DVec3, Vec3};
use std::collections::HashMap;

const HERE: DAffine3 = DAffine3::IDENTITY;

/// With the normals of the ball around its middle.
fn smooth(mut mesh: TriangleMesh) -> TriangleMesh {
    mesh.normals = mesh.positions.iter().map(|p| p.normalize()).collect();
    mesh
}

/// An icosahedron, each of its faces in four: 80 facets.
fn icosphere() -> TriangleMesh {
    let g = 0.5 * (1.0 + 5f32.sqrt());
    let mut positions: Vec<Vec3> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        positions.extend([Vec3::new(0.0, a, b), Vec3::new(a, b, 0.0), Vec3::new(b, 0.0, a)]);
    }
    // Faces are all triples at the least distance, their front outside.
    let near = |a: usize, b: usize| positions[a].distance(positions[b]) < 2.1;
    let mut faces = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let out =
                        (positions[b] - positions[a]).cross(positions[c] - positions[a]).dot(positions[a]);
                    faces.push(if out > 0.0 { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    let mut mesh =
        TriangleMesh { positions: positions.iter().map(|p| p.normalize()).collect(), ..Default::default() };
    let mut middles: HashMap<(usize, usize), usize> = HashMap::new();
    for face in faces {
        let middle = [0, 1, 2].map(|i| {
            let (a, b) = (face[i], face[(i + 1) % 3]);
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                mesh.positions.push((mesh.positions[a] + mesh.positions[b]).normalize());
                mesh.positions.len() - 1
            })
        });
        let [a, b, c] = face.map(|i| i as u32);
        let [ab, bc, ca] = middle.map(|i| i as u32);
        mesh.triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    mesh
}

/// A sun of irradiance 1, in that direction.
pub(super) fn sun(stage: &mut Stage, toward: DVec3) {
    let turn = DQuat::from_rotation_arc(DVec3::NEG_Z, -toward.normalize());
    stage.add(Light::Directional { irradiance: Vec3::ONE, angle: 0.0 }, DAffine3::from_quat(turn));
}

/// Radiance along the meridian from the sun's side to the other, of a ball that the sun meets at 60 degrees to the eye.
fn meridian(mesh: TriangleMesh, integrator: Integrator, place: Place) -> Vec<f64> {
    let (size, rows) = (601, 3);
    let shift = DVec3::splat(place.shift);
    let mut stage = Stage::placed(settings(size, rows, integrator, 1), place.scale, shift);
    stage.add_mesh(mesh, Material::lambert(Vec3::ONE), HERE);
    sun(&mut stage, DVec3::new(60f64.to_radians().sin(), 0.0, 60f64.to_radians().cos()));
    stage.look(DVec3::new(0.001, 0.002, 3.0), DVec3::ZERO, DVec3::Y, 2.0);
    let (film, _) = stage.expose(4, || true);
    // Without the silhouette, and from where the sun stands straight above.
    let row: Vec<f64> = film.row(rows / 2).map(|pixel| pixel.mean().x).collect();
    let row: Vec<f64> = row[20..size as usize - 20].iter().rev().copied().collect();
    let brightest = row.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |(i, _)| i);
    row[brightest..].to_vec()
}

/// No steps, and brightness goes one way.
#[must_use]
pub fn judge_meridian(what: &str, shade: &[f64]) -> Vec<Check> {
    let most = shade.iter().copied().fold(0.0, f64::max);
    let steps = || shade.windows(2).map(|pair| (pair[1] - pair[0]) / most);
    let n = shade.len() as u64;
    let (down, up) = (steps().fold(0.0, |m, s| larger(m, -s)), steps().fold(0.0, larger));
    vec![
        Check::new(format!("{what}: largest step, of the most"), n, "pixels", down, 0.02),
        Check::new(format!("{what}: largest step the wrong way"), n, "pixels", up, 0.02),
    ]
}

fn terminator(trial: &Trial<'_>) -> Vec<Check> {
    let mut checks = Vec::new();
    for place in places(trial.effort) {
        if trial.interrupted() {
            return checks;
        }
        for (name, mesh) in [("80 facets", icosphere()), ("168 facets", ball(8))] {
            for integrator in [Integrator::Direct, Integrator::Path] {
                let shade = meridian(smooth(mesh.clone()), integrator, place);
                let what = format!("{name}, {}, {}", integrator.name(), place.name());
                checks.extend(judge_meridian(&what, &shade));
            }
        }
        checks.push(leak(place, PAPER));
        checks.push(contact(place, 0.0));
    }
    checks.push(flat_normals(|normal| normal));
    checks
}

/// Facets as they are, for a test of the test.
#[must_use]
pub fn faceted_meridian() -> Vec<f64> {
    meridian(icosphere(), Integrator::Direct, Place::ORIGIN)
}

/// Where the paper is before a cube that ends at 1.
pub const PAPER: f32 = 1.001;

/// A wall of paper a hair away from the side of a cube with smoothed normals, between it and the sun: nothing leaks
/// around it. Who starts rays beyond the paper sees it so much nearer to the cube's middle.
#[must_use]
pub fn leak(place: Place, paper: f32) -> Check {
    let shift = DVec3::splat(place.shift);
    let mut stage = Stage::placed(settings(64, 64, Integrator::Direct, 1), place.scale, shift);
    stage.add_mesh(smooth(cube()), Material::lambert(Vec3::ONE), HERE);
    let paper = quad(Vec3::new(paper, -4.0, -4.0), Vec3::Y * 8.0, Vec3::Z * 8.0);
    stage.add_mesh(paper, Material::lambert(Vec3::ZERO), HERE);
    sun(&mut stage, DVec3::new(1.0, 0.2, 0.1));
    stage.look(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, DVec3::X, 1.9);
    let (film, _) = stage.expose(4, || true);
    let lit = reds(&film).iter().filter(|r| **r != 0.0).count() as u64;
    Check::none(format!("lit behind paper, {}", place.name()), 64 * 64, "pixels", lit)
}

/// Suns that bring nothing to where the side of a cube that is seen from −x meets the floor: behind it, almost in the floor,
/// and under it; the last two so high that the upper half of that side, if it were as round as its normals say, would be lit.
const BEHIND: [DVec3; 5] = [
    DVec3::new(1.0, 0.2, 0.5),
    DVec3::new(1.0, 0.02, 0.004),
    DVec3::new(-1.0, 0.1, -0.5),
    DVec3::new(0.3, 0.1, 1.0),
    DVec3::new(0.05, 0.0, 1.0),
];

/// A cube with smoothed normals that stands on a floor: its contact is dark, and all of its side by the first three suns. Rays that
/// start away from the cube, as if it were round, leave it behind or begin below the floor. `gap`: between both.
#[must_use]
pub fn contact(place: Place, gap: f64) -> Check {
    let shift = DVec3::splat(place.shift);
    let (mut lit, mut tried) = (0, 0);
    // Across the contact, and the side from before it.
    let views =
        [(DVec3::new(-4.0, 0.1, 2.0), DVec3::NEG_X, 0.05), (DVec3::new(-5.0, 0.0, 1.0), DVec3::Z, 1.9)];
    for (i, toward) in BEHIND.into_iter().enumerate() {
        for (eye, target, width) in views.into_iter().take(if i < 3 { 2 } else { 1 }) {
            let mut stage = Stage::placed(settings(48, 48, Integrator::Direct, 1), place.scale, shift);
            let standing = DAffine3::from_translation(DVec3::Z * (1.0 + gap));
            stage.add_mesh(smooth(cube()), Material::lambert(Vec3::ONE), standing);
            let floor = quad(Vec3::new(-8.0, -8.0, 0.0), Vec3::X * 16.0, Vec3::Y * 16.0);
            stage.add_mesh(floor, Material::lambert(Vec3::ONE), HERE);
            sun(&mut stage, toward);
            stage.look(eye, target, DVec3::Z, width);
            let (film, _) = stage.expose(4, || true);
            lit += reds(&film).iter().filter(|r| **r != 0.0).count() as u64;
            tried += 48 * 48;
        }
    }
    Check::none(format!("lit beside a cube that stands on a floor, {}", place.name()), tried, "pixels", lit)
}

/// A mesh whose normals are those of its facets looks as one that has none; `seen` makes of them those that are seen.
#[must_use]
pub fn flat_normals(seen: impl Fn(Vec3) -> Vec3) -> Check {
    let plain = cube();
    let mut told = TriangleMesh::default();
    for triangle in 0..plain.triangles.len() {
        let [a, b, c] = plain.corners(triangle);
        let first = told.positions.len() as u32;
        told.positions.extend([a, b, c]);
        told.normals.extend([seen((b - a).cross(c - a).normalize()); 3]);
        told.triangles.push([first, first + 1, first + 2]);
    }
    let picture = |mesh: TriangleMesh| {
        let mut stage = Stage::new(settings(64, 64, Integrator::Direct, 1));
        stage.add_mesh(mesh, Material::default(), HERE);
        sun(&mut stage, DVec3::new(1.0, 2.0, 3.0));
        stage.add(Light::Environment { radiance: Vec3::ONE }, HERE);
        stage.look_wide(DVec3::new(3.0, 2.0, 4.0), DVec3::ZERO);
        stage.expose(16, || true).0
    };
    differing("flat normals change nothing", &picture(told), &picture(plain))
}

/// Coarse and smooth.
pub const H1: Case = Case {
    id: "H1",
    title: "the edge of the shadow on coarse smooth meshes; nothing leaks around what is near",
    limit: "steps of at most 2 % of the most; 0 pixels lit; flat meshes unchanged to the bit",
    run: terminator,
};
