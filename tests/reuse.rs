//! Neighbours share what their paths find: the same picture, sooner.
#![allow(clippy::print_stdout, reason = "a test shows its figures")]

#[path = "support/stage.rs"]
mod stage;

use glam::{DAffine3, DVec3, UVec2, Vec3};
use penumbra::app::FrameBudget;
use penumbra::scene::{Alpha, Light, Material};
use penumbra::trace::{Integrator, RenderSettings};
use stage::{Frames as _, Stage, ball, cube, quad, settings};

const SIZE: u32 = 32;
const SEEDS: u32 = 64;

/// A room with a lamp that shines up, so that all light comes round a corner: walls of two colours, a smooth ball, a
/// half-transparent sheet if asked for, and a window, through which some leave.
fn room(seed: u32, reuse: bool, sheet: bool) -> Stage {
    let settings = RenderSettings { seed, reuse, ..settings(SIZE, SIZE, Integrator::Path, 4) };
    let mut stage = Stage::new(settings);
    let here = DAffine3::IDENTITY;
    let mut walls = cube();
    walls.triangles.truncate(11);
    let grey = Material { double_sided: true, ..Material::lambert(Vec3::new(0.7, 0.5, 0.3)) };
    stage.add_mesh(walls, grey, here);
    let mut smooth = ball(6);
    smooth.normals = smooth.positions.clone();
    let place = DAffine3::from_scale_rotation_translation(
        DVec3::splat(0.4),
        glam::DQuat::from_rotation_y(0.3),
        DVec3::new(0.3, -0.5, 0.1),
    );
    stage.add_mesh(smooth, Material::lambert(Vec3::splat(0.8)), place);
    if sheet {
        let veil = Material { alpha: Alpha::Blend, opacity: 0.5, ..Material::lambert(Vec3::splat(0.5)) };
        let sheet = quad(Vec3::new(-0.9, 0.1, -0.9), Vec3::X * 1.8, Vec3::Z * 1.8);
        stage.add_mesh(sheet, Material { double_sided: true, ..veil }, here);
    }
    let lamp = Light::Parallelogram {
        edge_u: Vec3::X * 0.5,
        edge_v: Vec3::Z * -0.5,
        radiance: [Vec3::splat(8.0); 4],
        two_sided: false,
    };
    stage.add(lamp, DAffine3::from_translation(DVec3::new(0.0, 0.5, 0.0)));
    // Below the lamp; a tile is as wide as it is in a large picture.
    stage.look(DVec3::new(0.2, 0.05, -0.9), DVec3::new(0.1, -0.6, 0.4), DVec3::Y, 0.5);
    stage
}

/// Mean over seeds of every pixel, and the variance of one seed's picture, pixels averaged.
fn over_seeds(reuse: bool, sheet: bool, samples: u32) -> (Vec<DVec3>, Vec<DVec3>, f64) {
    let (mut sums, mut squares) = (vec![DVec3::ZERO; (SIZE * SIZE) as usize], Vec::new());
    squares.resize(sums.len(), DVec3::ZERO);
    for seed in 0..SEEDS {
        let mut stage = room(seed, reuse, sheet);
        let film = stage.trace(samples);
        for y in 0..SIZE {
            for (x, pixel) in film.row(y).enumerate() {
                let i = y as usize * SIZE as usize + x;
                sums[i] += pixel.mean();
                squares[i] += pixel.mean() * pixel.mean();
            }
        }
    }
    let n = f64::from(SEEDS);
    let means: Vec<DVec3> = sums.iter().map(|sum| *sum / n).collect();
    let variances: Vec<DVec3> =
        means.iter().zip(&squares).map(|(m, s)| (*s / n - *m * *m) * (n / (n - 1.0))).collect();
    let mean = variances.iter().map(|v| v.element_sum() / 3.0).sum::<f64>() / variances.len() as f64;
    (means, variances, mean)
}

/// Pictures with and without: they differ by no more than their own noise, and with it that is far less.
#[test]
fn sharing_changes_no_mean_and_lowers_the_noise() {
    with_and_without(false, 8.0);
}

/// Who sees a neighbour's end is then a matter of chance; the sheet itself is lit, and has ends on it.
#[test]
fn sharing_changes_no_mean_through_a_half_transparent_sheet() {
    with_and_without(true, 4.0);
}

/// Fails if the means differ, or the variance does not fall to less than one part in `least`.
fn with_and_without(sheet: bool, least: f64) {
    let (shared, spread, variance) = over_seeds(true, sheet, 16);
    let (alone, other_spread, other_variance) = over_seeds(false, sheet, 16);
    let n = f64::from(SEEDS);
    let (mut sum, mut count, mut bias, mut error) = (0.0, 0.0, 0.0, 0.0);
    for i in 0..shared.len() {
        for c in 0..3 {
            let variance = (spread[i][c] + other_spread[i][c]) / n;
            if variance > 0.0 {
                let difference = shared[i][c] - alone[i][c];
                sum += difference * difference / variance;
                bias += difference;
                error += variance;
                count += 1.0;
            }
        }
    }
    // The mean of z² would be 1.03 (Student's t with some 120 degrees of freedom). Channels say nearly the same,
    // and so may, at worst, the 32 pixels of a group.
    let chi2 = sum / count;
    let deviations = bias / (error * 3.0 * 32.0).sqrt();
    let ratio = other_variance / variance;
    let total = alone.iter().map(|mean| mean.element_sum()).sum::<f64>();
    let (bias, sigma) = (bias / total, (error * 3.0 * 32.0).sqrt() / total);
    println!("mean z² {chi2:.3}, bias {bias:+.1e} ± {sigma:.1e}, variance 1/{ratio:.1} at equal samples");
    assert!(deviations.abs() < 4.5, "biased by {deviations} σ");
    assert!((0.7..1.35).contains(&chi2), "mean z² is {chi2}");
    assert!(ratio > least, "only {ratio}");
}

/// In one go, in parts, and with shares that differ: the film is a function of the sample range.
#[test]
fn a_picture_in_parts_is_the_picture() {
    let film = |steps: &[u32], adaptive: bool, pass: u32| {
        let mut stage = room(3, true, false);
        for &samples in steps {
            {
                let mut budget = stage.app.world.resource_mut::<FrameBudget>();
                budget.sample_target = samples;
                budget.pass_samples = pass;
                budget.adaptive = adaptive;
            }
            while !stage.app.world.resource::<penumbra::app::FrameStats>().done
                || stage.film().complete_samples() < samples
            {
                stage.app.frame();
            }
        }
        let film = stage.film();
        (0..SIZE * SIZE).map(|i| *film.pixel(i % SIZE, i / SIZE)).collect::<Vec<_>>()
    };
    for adaptive in [false, true] {
        let whole = film(&[40], adaptive, 64);
        assert!(whole == film(&[8, 13, 40], adaptive, 3), "adaptive: {adaptive}");
    }
}

/// A picture whose last column of tiles is one pixel wide, and one of a single pixel.
#[test]
fn tiles_that_are_cut_off_are_whole() {
    for (width, height) in [(SIZE + 1, 9), (1, 1), (2, 1)] {
        let mut stage = room(0, true, false);
        stage.app.world.resource_mut::<RenderSettings>().size = UVec2::new(width, height);
        stage.app.world.resource_mut::<FrameBudget>().sample_target = 8;
        for _ in 0..100 {
            stage.app.frame();
        }
        let film = stage.film();
        assert_eq!((film.complete_samples(), film.size()), (8, UVec2::new(width, height)));
        assert!((0..height).all(|y| film.row(y).all(|pixel| pixel.count() == 8 && pixel.mean().is_finite())));
    }
}
