//! Every `sample` against its `pdf`, and what the film says about its own noise.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "a test shows its figures, and fails at the first wrong one"
)]

#[path = "support/chi_square.rs"]
mod chi_square;
#[path = "support/stage.rs"]
mod stage;

use chi_square::{SAMPLES, sampler_against_density};

use glam::{DAffine3, DVec3, UVec2, Vec3};
use penumbra::app::{FrameBudget, FrameStats};
use penumbra::bvh::Ray;
use penumbra::scene::{Light, Material};
use penumbra::trace::film::Pixel;
use penumbra::trace::light::FlatLight;
use penumbra::trace::mesh_light::MeshLight;
use penumbra::trace::noise::relative_error;
use penumbra::trace::quad::Quad;
use penumbra::trace::shape_light::{Shape, ShapeLight};
use penumbra::trace::{Integrator, RenderSettings};
use stage::{Estimate, Frames as _, Rng, Stage, quad, reds, settings};
use std::f64::consts::PI;

const POINT: Vec3 = Vec3::new(0.2, -0.1, 0.05);

fn shape(shape: Shape) -> ShapeLight {
    ShapeLight::new(shape, [Vec3::ONE; 4], true, true)
}

/// What a ray toward `wi` finds the density to be.
fn hit_density(light: &ShapeLight, wi: Vec3) -> f64 {
    let ray = Ray::new(POINT, wi);
    light.intersect(&ray).map_or(0.0, |hit| f64::from(light.pdf(&ray, Vec3::Z, &hit)))
}

fn light_sample(light: &FlatLight, rng: &mut Rng, density: &impl Fn(Vec3) -> f64) -> Option<Vec3> {
    let sample = light.sample(POINT, Vec3::Z, rng.pair())?;
    let (said, found) = (f64::from(sample.pdf.unwrap()), density(sample.wi));
    // At the very rim rounding may let the ray pass.
    assert!(
        found == 0.0 || (said / found - 1.0).abs() < 2e-3,
        "pdf {said} of the sample, {found} of the hit"
    );
    Some(sample.wi)
}

/// Directions in a cone around `axis` (1 − cos and angle), and back.
fn cone_map(
    axis: DVec3,
    one_minus_cos: f64,
) -> (impl Fn(f64, f64) -> (DVec3, f64), impl Fn(DVec3) -> (f64, f64)) {
    let (x, y) = axis.any_orthonormal_pair();
    let direction = move |a: f64, b: f64| {
        let cos = 1.0 - a * one_minus_cos;
        let (sin, phi) = ((1.0 - cos * cos).max(0.0).sqrt(), 2.0 * PI * b);
        (x * (sin * phi.cos()) + y * (sin * phi.sin()) + axis * cos, 2.0 * PI * one_minus_cos)
    };
    let place = move |d: DVec3| {
        let a = 0.5 * (d.normalize() - axis).length_squared() / one_minus_cos;
        (a.clamp(0.0, 1.0), (d.dot(y).atan2(d.dot(x)) / (2.0 * PI)).rem_euclid(1.0))
    };
    (direction, place)
}

#[test]
fn each_light_is_sampled_as_its_density_says() {
    let from = POINT.as_dvec3();
    // A parallelogram, by its own coordinates.
    let (corner, u, v) = (Vec3::new(-0.3, -0.5, 0.6), Vec3::new(1.0, 0.2, 0.4), Vec3::new(-0.1, 0.8, 0.3));
    let (c, du, dv) = (corner.as_dvec3(), u.as_dvec3(), v.as_dvec3());
    let normal = du.cross(dv);
    let onto = move |a: f64, b: f64| {
        let to = c + du * a + dv * b - from;
        (to.normalize(), normal.dot(to).abs() / to.length().powi(3))
    };
    let back = move |d: DVec3| {
        let p = from + d * ((c - from).dot(normal) / d.dot(normal)) - c;
        let inverse = 1.0 / normal.length_squared();
        let (a, b) = (p.cross(dv).dot(normal) * inverse, du.cross(p).dot(normal) * inverse);
        (a.clamp(0.0, 1.0), b.clamp(0.0, 1.0))
    };
    let light = shape(Shape::Parallelogram(Quad::new(corner, u, v)));
    let density = |wi: Vec3| hit_density(&light, wi);
    let flat = FlatLight::Shape(light.clone());
    sampler_against_density(
        "parallelogram",
        SAMPLES,
        |rng| light_sample(&flat, rng, &density),
        density,
        onto,
        back,
    );
    // The same as two triangles of a mesh, cut at its diagonal; cells are those of the parallelogram.
    let corners = vec![[corner, corner + u, corner + u + v], [corner, corner + u + v, corner + v]];
    let mesh = MeshLight {
        triangles: vec![3, 7],
        corners,
        cumulative: vec![0.5, 1.0],
        two_sided: true,
        ..MeshLight::default()
    };
    let mesh_density = |wi: Vec3| {
        let d = wi.as_dvec3();
        let (a, b) = back(d);
        let distance = (c - from).dot(normal) / d.dot(normal);
        let cos = normal.normalize().dot(d).abs();
        f64::from(mesh.pdf(if a > b { 3 } else { 7 }, POINT, (distance * distance) as f32, cos as f32))
    };
    let flat = FlatLight::Mesh(mesh.clone());
    sampler_against_density(
        "triangle mesh",
        SAMPLES,
        |rng| light_sample(&flat, rng, &mesh_density),
        mesh_density,
        onto,
        back,
    );
    // A disk, by squared radius and angle.
    let (center, facing, radius) = (Vec3::new(0.4, 0.3, 0.9), Vec3::new(0.3, -0.5, -0.8).normalize(), 0.7f32);
    let (dc, n, r) = (center.as_dvec3(), facing.as_dvec3().normalize(), f64::from(radius));
    let (x, y) = n.any_orthonormal_pair();
    let light = shape(Shape::Disk { center, normal: facing, radius });
    let density = |wi: Vec3| hit_density(&light, wi);
    let flat = FlatLight::Shape(light.clone());
    sampler_against_density(
        "disk",
        SAMPLES,
        |rng| light_sample(&flat, rng, &density),
        density,
        |a, b| {
            let (rho, phi) = (r * a.sqrt(), 2.0 * PI * b);
            let to = dc + x * (rho * phi.cos()) + y * (rho * phi.sin()) - from;
            (to.normalize(), PI * r * r * n.dot(to).abs() / to.length().powi(3))
        },
        |d| {
            let p = from + d * ((dc - from).dot(n) / d.dot(n)) - dc;
            let turn = (p.dot(y).atan2(p.dot(x)) / (2.0 * PI)).rem_euclid(1.0);
            ((p.length_squared() / (r * r)).min(1.0), turn)
        },
    );
    // Balls: from outside near and far, and from inside.
    for (name, center, radius) in [
        ("ball, near", Vec3::new(0.5, 0.6, 0.7), 0.9),
        ("ball, far", Vec3::new(5.0, 6.0, 70.0), 0.9),
        ("ball, from inside", Vec3::new(0.5, 0.6, 0.7), 2.0f32),
    ] {
        let light = shape(Shape::Sphere { center, radius });
        let density = |wi: Vec3| hit_density(&light, wi);
        let flat = FlatLight::Shape(light.clone());
        let to = center.as_dvec3() - from;
        let sin2 = (f64::from(radius) / to.length()).powi(2);
        let spread = if sin2 < 1.0 { sin2 / (1.0 + (1.0 - sin2).sqrt()) } else { 2.0 };
        let (direction, place) = cone_map(to.normalize(), spread);
        sampler_against_density(
            name,
            SAMPLES,
            |rng| light_sample(&flat, rng, &density),
            density,
            direction,
            place,
        );
    }
    // Lights beyond the scene.
    let axis = Vec3::new(0.3, -0.4, -0.7).normalize();
    for angle in [0.0093, 0.5, 2.0f64] {
        let sin2_radius = (0.5 * angle).sin().powi(2) as f32;
        let sun = FlatLight::Directional { axis, irradiance: Vec3::ONE, sin2_radius };
        let density = |wi: Vec3| sun.beyond(Vec3::Z, wi).map_or(0.0, |(_, pdf)| f64::from(pdf));
        let (direction, place) = cone_map(-axis.as_dvec3().normalize(), 1.0 - (0.5 * angle).cos());
        let name = format!("sun {angle} rad wide");
        sampler_against_density(
            &name,
            SAMPLES,
            |rng| light_sample(&sun, rng, &density),
            density,
            direction,
            place,
        );
    }
    let sky = FlatLight::Environment { radiance: Vec3::ONE };
    let density = |wi: Vec3| sky.beyond(Vec3::Z, wi).map_or(0.0, |(_, pdf)| f64::from(pdf));
    let (direction, place) = cone_map(DVec3::Z, 1.0);
    sampler_against_density(
        "sky",
        SAMPLES,
        |rng| light_sample(&sky, rng, &density),
        density,
        direction,
        place,
    );
}

#[test]
fn the_chi_square_finds_a_density_two_percent_wrong() {
    let sky = FlatLight::Environment { radiance: Vec3::ONE };
    // cos^1.1 instead of cos: the same everywhere but for a few percent.
    let density = |wi: Vec3| f64::from(wi.z.max(0.0)).powf(1.1) * 2.1 / (2.0 * PI);
    let (direction, place) = cone_map(DVec3::Z, 1.0);
    let sample = |rng: &mut Rng| Some(sky.sample(POINT, Vec3::Z, rng.pair())?.wi);
    let found = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        sampler_against_density("wrong", SAMPLES, sample, density, direction, place);
    }));
    assert!(found.is_err());
}

/// A place in the middle of a penumbra, so small that every pixel shows the same.
fn flat_penumbra(width: u32, height: u32, strip: f64, seed: u32) -> Stage {
    let mut stage =
        Stage::new(RenderSettings { seed, shafts: false, ..settings(width, height, Integrator::Direct, 1) });
    let here = DAffine3::IDENTITY;
    stage.add_mesh(quad(Vec3::new(-2.0, -2.0, 0.0), Vec3::X * 4.0, Vec3::Y * 4.0), Material::default(), here);
    stage.add_mesh(
        quad(Vec3::new(-100.0, -100.0, 1.0), Vec3::X * 100.0, Vec3::Y * 200.0),
        Material::default(),
        here,
    );
    let light =
        Light::Parallelogram { edge_u: Vec3::X, edge_v: Vec3::Y, radiance: [Vec3::ONE; 4], two_sided: true };
    stage.add(light, DAffine3::from_translation(DVec3::Z * 4.0));
    stage.look(DVec3::Z * 0.5, DVec3::ZERO, DVec3::Y, strip);
    stage
}

#[test]
fn the_noise_of_neighbouring_pixels_is_not_correlated() {
    for samples in [1, 2, 16] {
        let (w, h) = (320u32, 320u32);
        let mut stage = flat_penumbra(w, h, 1e-5, 0);
        let pixels = reds(stage.trace(samples));
        let mean = pixels.iter().sum::<f64>() / pixels.len() as f64;
        let variance = pixels.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / pixels.len() as f64;
        let n = f64::from(w * h);
        for (dx, dy) in [(1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (16, 0), (0, 16)] {
            let mut sum = 0.0;
            for (x, y) in (0..w - dx).flat_map(|x| (0..h - dy).map(move |y| (x, y))) {
                let at = |x: u32, y: u32| pixels[(y * w + x) as usize] - mean;
                sum += at(x, y) * at(x + dx, y + dy);
            }
            let correlation = sum / variance / n;
            println!("{samples} samples, {dx} {dy}: {correlation:+.1e} (bound {:.1e})", 5.0 / n.sqrt());
            assert!(correlation.abs() < 5.0 / n.sqrt(), "{samples} samples: {correlation} at {dx}, {dy}");
        }
    }
}

#[test]
fn the_noise_estimate_is_the_true_error() {
    let size = 24;
    let scene = |seed, samples| {
        let mut stage = flat_penumbra(size, size, 0.5, seed);
        stage.app.world.resource_mut::<FrameBudget>().pass_samples = 16;
        stage.trace(samples);
        let noise = stage.app.world.resource::<FrameStats>().noise;
        (reds(stage.film()), noise)
    };
    let (truth, _) = scene(12_345, 16_384);
    let (mut estimated, mut actual) = (Vec::new(), Vec::new());
    for seed in 0..100 {
        let (picture, noise) = scene(seed, 16);
        actual.push(relative_error(&picture, &truth, UVec2::splat(size)).unwrap());
        estimated.push(noise.expect("an estimate"));
    }
    let ratios: Vec<f64> = estimated.iter().zip(&actual).map(|(e, a)| e / a).collect();
    let (ratio, error) = (Estimate::of(&ratios), Estimate::of(&actual));
    let spread = ratio.sigma * 10.0;
    println!(
        "true relative error {:.4}, estimate over it {:.3} ± {spread:.3} in one run",
        error.mean, ratio.mean
    );
    assert!((ratio.mean - 1.0).abs() < 0.1, "{ratio:?}");
}

#[test]
fn a_hundred_million_samples_add_up_exactly() {
    let mut pixel = Pixel::default();
    for i in 0..100_000_000 {
        pixel.add(i, Vec3::splat(0.1));
    }
    pixel.add(100_000_000, Vec3::splat(1e6));
    let exact = (f64::from(0.1f32) * 1e8 + 1e6) / (1e8 + 1.0);
    assert!((pixel.mean().x / exact - 1.0).abs() < 1e-15);
    assert_eq!(pixel.count(), 100_000_001);
}

#[test]
fn a_sample_that_is_no_number_is_dropped_and_counted() {
    let mut pixel = Pixel::default();
    assert!(pixel.add(0, Vec3::ONE));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
        assert!(!pixel.add(1, Vec3::new(1.0, bad, 1.0)));
    }
    assert_eq!((pixel.mean(), pixel.count()), (DVec3::ONE, 1));
    // Through the whole way: a light of no number makes each sample drop, and no pixel wrong.
    let mut stage = flat_penumbra(8, 8, 0.5, 0);
    stage.add(
        Light::Point { intensity: Vec3::splat(f32::NAN) },
        DAffine3::from_translation(DVec3::new(1.0, 0.0, 0.5)),
    );
    stage.app.frame();
    let film = stage.film();
    assert!(film.dropped() > 0 && reds(film).iter().all(|r| r.is_finite()));
}

#[test]
fn error_falls_faster_than_with_independent_samples() {
    // Root mean square over pixels and seeds, on a penumbra: independent samples would halve it from n to 4 n.
    let rms = |samples: u32| {
        let mut stage = flat_penumbra(64, 64, 1e-5, samples);
        let e = Estimate::of(&reds(stage.trace(samples)));
        e.sigma * 64.0 / e.mean
    };
    let errors: Vec<f64> = [4, 16, 64, 256, 1024].map(rms).to_vec();
    let slope = (errors[4] / errors[0]).ln() / 256f64.ln();
    println!("relative error at 4 to 1024 samples {errors:?}, slope {slope:.2}");
    assert!(slope < -0.65, "slope {slope}");
}
