//! The edge of the shadow on coarse meshes with smooth normals.

use crate::stage::{Frames as _, Stage, ball, cube, quad, reds, settings};
use glam::{DAffine3, DVec3, Vec3};
use penumbra::scene::{Light, Material, TriangleMesh};
use penumbra::trace::Integrator;

fn smooth(mut mesh: TriangleMesh) -> TriangleMesh {
    mesh.normals = mesh.positions.iter().map(|p| p.normalize()).collect();
    mesh
}

fn sun(stage: &mut Stage, toward: DVec3) {
    let turn = glam::DQuat::from_rotation_arc(DVec3::NEG_Z, -toward.normalize());
    stage.add(Light::Directional { irradiance: Vec3::ONE, angle: 0.0 }, DAffine3::from_quat(turn));
}

/// Radiance along the great circle from the sun's side to the other, seen from the axis that both are square to.
fn meridian(mesh: TriangleMesh, integrator: Integrator) -> Vec<f64> {
    let size = 601;
    let mut stage = Stage::new(settings(size, size, integrator, 1));
    stage.add_mesh(mesh, Material::lambert(Vec3::ONE), DAffine3::IDENTITY);
    sun(&mut stage, DVec3::X);
    stage.look(DVec3::new(0.001, 0.002, 3.0), DVec3::ZERO, DVec3::Y, 2.0);
    let pixels = reds(stage.trace(4));
    let row = (size / 2 * size) as usize;
    // From the middle of the lit side to the middle of the dark one.
    pixels[row + 20..row + size as usize - 20].iter().rev().copied().collect()
}

#[test]
fn shade_fades_without_steps_on_a_coarse_ball() {
    for integrator in [Integrator::Direct, Integrator::Path] {
        // 80 and 168 facets.
        for rings in [5, 8] {
            let shade = meridian(smooth(ball(rings)), integrator);
            let most = shade.iter().copied().fold(0.0, f64::max);
            let steps = shade.windows(2).map(|pair| pair[1] - pair[0]);
            let (down, up) = steps.fold((0.0f64, 0.0f64), |(d, u), step| (d.min(step), u.max(step)));
            println!("{rings} rings: largest step down {:.4}, up {:.4} of the most", -down / most, up / most);
            assert!(-down < 0.02 * most && up < 0.02 * most, "{rings} rings: {down} {up} of {most}");
        }
    }
    // Without the lift its facets shadow each other: the checker sees it on flat facets.
    let flat = meridian(ball(5), Integrator::Direct);
    assert!(flat.windows(2).any(|pair| (pair[1] - pair[0]).abs() > 0.05), "no steps on facets");
}

/// A cube with smoothed normals on a floor: where they meet it stays dark, and nothing leaks into it.
#[test]
fn nothing_leaks_around_a_lifted_point() {
    let mut stage = Stage::new(settings(64, 64, Integrator::Direct, 1));
    stage.add_mesh(smooth(cube()), Material::lambert(Vec3::ONE), DAffine3::IDENTITY);
    // A wall of paper a hair away from the cube's side, between it and the sun.
    let paper = quad(Vec3::new(1.001, -4.0, -4.0), Vec3::Y * 8.0, Vec3::Z * 8.0);
    stage.add_mesh(paper, Material::lambert(Vec3::ZERO), DAffine3::IDENTITY);
    sun(&mut stage, DVec3::new(1.0, 0.2, 0.1));
    stage.look(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, DVec3::X, 1.9);
    let pixels = reds(stage.trace(4));
    assert!(pixels.iter().all(|p| *p == 0.0), "light on the far side of the paper");
}
