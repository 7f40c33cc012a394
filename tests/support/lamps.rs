//! A room lit by any number of small lamps.
#![allow(dead_code, reason = "the test and the bench each use their part")]

use crate::stage::{Estimate, Frames as _, Stage, ball, cube, quad, settings};
use glam::{DAffine3, DVec3, Vec3};
use penumbra::scene::{Light, Material, TriangleMesh};
use penumbra::torture::oracle::Rng;
use penumbra::trace::{Integrator, RenderSettings};
use std::time::{Duration, Instant};

pub const SIZE: u32 = 24;
const SEEDS: u32 = 24;

/// A room with a shelf in it, lit by `count` shining triangles under its ceiling, of the same power together, which hang
/// in the room or lie in one mesh.
fn room(seed: u32, count: usize, apart: bool, depth: u32) -> Stage {
    let integrator = if depth == 1 { Integrator::Direct } else { Integrator::Path };
    let settings = RenderSettings { seed, ..settings(SIZE, SIZE, integrator, depth) };
    let mut stage = Stage::new(settings);
    let here = DAffine3::IDENTITY;
    let grey = Material { double_sided: true, ..Material::lambert(Vec3::splat(0.6)) };
    stage.add_mesh(cube(), grey.clone(), here);
    stage.add_mesh(quad(Vec3::new(-1.0, -0.3, -0.4), Vec3::X, Vec3::Z * 0.8), grey, here);
    let mut rng = Rng(7);
    let side = (0.02 / count as f64).sqrt() as f32;
    let mut mesh = TriangleMesh::default();
    for i in 0..count as u32 {
        let middle = Vec3::new(rng.unit() * 1.8 - 0.9, 0.9 - 0.3 * rng.unit(), rng.unit() * 1.8 - 0.9);
        let turn = rng.direction().any_orthonormal_pair();
        mesh.positions.extend([middle, middle + turn.0 * side, middle + turn.1 * side]);
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let shining = Material { double_sided: true, ..Material::emissive(Vec3::splat(100.0)) };
    if apart {
        for corners in mesh.positions.chunks(3) {
            let light = Light::Parallelogram {
                edge_u: corners[1] - corners[0],
                edge_v: (corners[2] - corners[0]) * 0.5,
                radiance: [Vec3::splat(100.0); 4],
                two_sided: true,
            };
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            stage.add(light, DAffine3::from_translation(middle.as_dvec3()));
        }
    } else {
        stage.add_mesh(mesh, shining, here);
    }
    stage.look(DVec3::new(0.0, -0.5, -0.9), DVec3::new(0.0, -0.8, 0.4), DVec3::Y, 1.0);
    stage
}

/// A ball between three hundred shining triangles that face it.
pub fn beside_a_ball(seed: u32, integrator: Integrator) -> Stage {
    let settings = RenderSettings { seed, ..settings(SIZE, SIZE, integrator, 1) };
    let mut stage = Stage::new(settings);
    stage.add_mesh(ball(6), Material::lambert(Vec3::splat(0.8)), DAffine3::IDENTITY);
    let (mut rng, mut mesh) = (Rng(9), TriangleMesh::default());
    for i in 0..300 {
        let out = rng.direction();
        let (middle, turn) = (out * (1.1 + 0.4 * rng.unit()), out.any_orthonormal_pair());
        mesh.positions.extend([middle, middle + turn.0 * 0.03, middle + turn.1 * 0.03]);
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let shining = Material { double_sided: true, ..Material::emissive(Vec3::splat(20.0)) };
    stage.add_mesh(mesh, shining, DAffine3::IDENTITY);
    stage.look(DVec3::new(0.0, 0.6, 3.0), DVec3::ZERO, DVec3::Y, 0.6);
    stage
}

/// What pictures of many seeds come to.
pub struct Measured {
    /// Its mean brightness.
    pub picture: Estimate,
    /// Variance of a pixel of one picture, relative to the squared mean.
    pub variance: f64,
    /// Of rendering one picture, without building the scene.
    pub time: Duration,
}

pub fn measure(count: usize, apart: bool, depth: u32, samples: u32) -> Measured {
    let pixels = (SIZE * SIZE) as usize;
    let (mut sums, mut squares, mut means) = (vec![0.0; pixels], vec![0.0; pixels], Vec::new());
    let mut time = Duration::ZERO;
    for seed in 0..SEEDS {
        let mut stage = room(seed, count, apart, depth);
        // The first sample is also the one before which everything is built.
        stage.trace(1);
        let start = Instant::now();
        let film = stage.trace(samples);
        time += start.elapsed() / SEEDS;
        let values: Vec<f64> =
            (0..SIZE).flat_map(|y| film.row(y).map(|p| p.mean().y).collect::<Vec<_>>()).collect();
        for (i, value) in values.iter().enumerate() {
            sums[i] += value;
            squares[i] += value * value;
        }
        means.push(values.iter().sum::<f64>() / pixels as f64);
    }
    let n = f64::from(SEEDS);
    let variance: f64 =
        sums.iter().zip(&squares).map(|(s, q)| (q / n - (s / n).powi(2)) * n / (n - 1.0)).sum::<f64>()
            / pixels as f64;
    let picture = Estimate::of(&means);
    Measured { picture, variance: variance / (picture.mean * picture.mean), time }
}
