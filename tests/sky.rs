//! The sky as a light: its samples go as its density says, and an even sky is the closed form.

use glam::{DMat3, DVec3, Mat3, UVec2, Vec2, Vec3};
use penumbra::app::{App, FrameBudget};
use penumbra::load::{LoadOptions, SceneSource};
use penumbra::open::{Wishes, open};
use penumbra::scene::{Light, Sky, Transform};
use penumbra::trace::sky::SkyLight;
use penumbra::trace::{Film, Integrator};
use std::path::Path;

/// A dim sky with a small sun and a black half, turned.
fn sky() -> (Sky, Mat3) {
    let (width, height) = (16, 8);
    let pixels = (0..width * height)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            match (x, y) {
                (3, 2) => Vec3::new(40.0, 30.0, 20.0),
                (0..8, _) => Vec3::new(0.2, 0.3, 0.5) * (1.0 + y as f32),
                _ => Vec3::ZERO,
            }
        })
        .collect();
    (Sky::new(width, pixels).unwrap(), Mat3::from_rotation_y(0.7) * Mat3::from_rotation_x(0.4))
}

/// Well spread numbers in [0, 1)²: the R2 sequence of M. Roberts, "The Unreasonable Effectiveness of Quasirandom
/// Sequences", 2018, and a hash where independent ones are needed.
fn random(i: u32, seed: u32) -> Vec2 {
    use penumbra::trace::sampler::{hash, unit_float};
    Vec2::new(unit_float(hash(i ^ seed)), unit_float(hash(i.wrapping_add(0x9e37_79b9) ^ hash(seed))))
}

#[test]
fn the_density_is_one_over_all_directions_and_zero_only_where_it_is_black() {
    let (sky, turned) = sky();
    let light = SkyLight::new(&sky, Vec3::ONE, turned, None).unwrap();
    // Midpoints in cosine and turn: an even grid in solid angle, finer than the pixels.
    let (mut sum, n) = (0.0, 1024);
    for i in 0..n {
        for j in 0..n {
            let cos = 1.0 - 2.0 * (i as f32 + 0.5) / n as f32;
            let (sin, angle) =
                ((1.0 - cos * cos).sqrt(), std::f32::consts::TAU * (j as f32 + 0.5) / n as f32);
            let (radiance, pdf) = light.toward(Vec3::new(sin * angle.cos(), cos, sin * angle.sin()));
            assert_eq!(radiance == Vec3::ZERO, pdf == 0.0);
            sum += f64::from(pdf);
        }
    }
    let integral = sum * 4.0 * std::f64::consts::PI / f64::from(n * n);
    assert!((integral - 1.0).abs() < 5e-3, "{integral}");
}

#[test]
fn samples_tell_the_radiance_and_density_of_their_direction() {
    let (sky, turned) = sky();
    let light = SkyLight::new(&sky, Vec3::new(1.0, 2.0, 0.5), turned, None).unwrap();
    let mut differing = 0;
    for i in 0..20_000 {
        let sample = light.sample(random(i, 1)).unwrap();
        assert!((sample.wi.length() - 1.0).abs() < 1e-5);
        let (radiance, pdf) = light.toward(sample.wi);
        // A direction on the border of two pixels may be rounded into the other.
        differing += u32::from(radiance != sample.radiance || Some(pdf) != sample.pdf);
    }
    assert!(differing < 20, "{differing}");
}

/// χ² of pixel counts at a level of 1e-6: fails for a density that is off by a few per cent in one pixel.
#[test]
fn samples_are_spread_as_the_density_says() {
    let (sky, turned) = sky();
    let light = SkyLight::new(&sky, Vec3::ONE, turned, None).unwrap();
    let [width, height] = sky.size();
    let count = 400_000;
    let mut seen = vec![0.0; width * height];
    for i in 0..count {
        let wi = light.sample(random(i, 7)).unwrap().wi;
        let [x, y] = sky.pixel_toward(turned.transpose() * wi);
        seen[y * width + x] += 1.0;
    }
    let statistic = |skew: f64| {
        let (mut chi2, mut cells) = (0.0, 0);
        for y in 0..height {
            let cos = |y: usize| (std::f64::consts::PI * y as f64 / height as f64).cos();
            for x in 0..width {
                let turn = std::f32::consts::TAU * ((x as f32 + 0.5) / width as f32 - 0.5);
                let polar = std::f32::consts::PI * (y as f32 + 0.5) / height as f32;
                let local = Vec3::new(polar.sin() * turn.sin(), polar.cos(), -polar.sin() * turn.cos());
                let (_, pdf) = light.toward(turned * local);
                let solid = std::f64::consts::TAU / width as f64 * (cos(y) - cos(y + 1));
                let expected =
                    f64::from(pdf) * solid * f64::from(count) * if (x, y) == (3, 2) { skew } else { 1.0 };
                if expected > 0.0 {
                    chi2 += (seen[y * width + x] - expected).powi(2) / expected;
                    cells += 1;
                } else {
                    // Of those on its border.
                    assert!(seen[y * width + x] <= 3.0);
                }
            }
        }
        // Wilson and Hilferty: the cube root of χ²/k is nearly normal.
        let k = f64::from(cells - 1);
        ((chi2 / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt()
    };
    assert!(statistic(1.0) < 4.75, "{}", statistic(1.0));
    assert!(statistic(1.03) > 4.75, "a wrong density is found");
}

#[test]
fn beside_a_sun_no_pixel_is_forgotten() {
    let pixels: Vec<Vec3> =
        (0..4096 * 4).map(|i| if i == 5000 { Vec3::splat(1e8) } else { Vec3::ONE }).collect();
    let sky = Sky::new(4096, pixels).unwrap();
    let light = SkyLight::new(&sky, Vec3::ONE, Mat3::IDENTITY, None).unwrap();
    for i in 0..4096 {
        let turn = std::f32::consts::TAU * (i as f32 + 0.5) / 4096.0;
        // Along the row of the sun, and along the one below.
        for y in [0.3, -0.3] {
            let (radiance, pdf) = light.toward(Vec3::new(turn.sin(), y, -turn.cos()).normalize());
            assert!(pdf > 0.0 && radiance.x >= 1.0, "{i}: {pdf}");
        }
    }
}

/// A white floor without anything else under this light, seen from above.
fn floor(light: Light, turn: DMat3, integrator: Integrator) -> Film {
    let folder = std::env::temp_dir().join(format!(
        "penumbra-sky-{}-{:?}",
        std::process::id(),
        std::thread::current().id()
    ));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("floor.toml");
    std::fs::write(folder.join("floor.obj"), "v -9 0 -9\nv 9 0 -9\nv 9 0 9\nv -9 0 9\nf 1 4 3 2\n").unwrap();
    let scene = "[[model]]\nfile = 'floor.obj'\nmaterial = 'white'\n[material.white]\nbase_color = [0.5, 0.5, 0.5]\n\
                 [[light]]\nkind = 'environment'\nradiance = [1, 1, 1]\n[camera]\nposition = [0, 4, 0.1]\ntarget = [0, 0, 0]\n";
    std::fs::write(&file, scene).unwrap();
    let wishes = Wishes { size: Some(UVec2::splat(16)), integrator: Some(integrator), ..Wishes::default() };
    let mut app = open(&SceneSource::File(file), &LoadOptions::default(), &wishes).unwrap().app;
    std::fs::remove_dir_all(&folder).unwrap();
    for (mut old, mut place) in app.world.query::<(&mut Light, &mut Transform)>().iter_mut(&mut app.world) {
        *old = light.clone();
        place.0.matrix3 = turn;
    }
    picture(&mut app, 64)
}

fn picture(app: &mut App, samples: u32) -> Film {
    app.world.insert_resource(FrameBudget { sample_target: samples, ..FrameBudget::default() });
    for _ in 0..samples {
        app.frame();
    }
    app.world.resource::<Film>().clone()
}

fn mean(film: &Film) -> DVec3 {
    let size = film.size();
    let sum: DVec3 = (0..size.y).flat_map(|y| film.row(y)).map(penumbra::trace::film::Pixel::mean).sum();
    sum / f64::from(size.element_product())
}

#[test]
fn an_even_sky_lights_a_floor_as_the_closed_form_says() {
    let even = Sky::new(8, vec![Vec3::new(1.0, 2.0, 3.0); 32]).unwrap();
    for integrator in [Integrator::Direct, Integrator::Path] {
        // Albedo · radiance: the whole half-space is seen.
        let lit = mean(&floor(
            Light::Sky { sky: even.clone(), scale: Vec3::splat(0.5) },
            DMat3::IDENTITY,
            integrator,
        ));
        let wanted = DVec3::new(1.0, 2.0, 3.0) * 0.25;
        assert!((lit / wanted - 1.0).abs().max_element() < 4e-3, "{integrator:?}: {lit}");
    }
}

#[test]
fn half_a_sky_lights_by_where_it_is() {
    // Bright from the horizon to 45 degrees above: E = π (1 − sin² 45°) = π/2, in every direction around.
    let pixels =
        (0..32 * 16).map(|i| if (4..8).contains(&(i / 32)) { Vec3::ONE } else { Vec3::ZERO }).collect();
    let band = Sky::new(32, pixels).unwrap();
    let light = || Light::Sky { sky: band.clone(), scale: Vec3::ONE };
    let lit = mean(&floor(light(), DMat3::from_rotation_y(1.0), Integrator::Direct));
    assert!((lit.x / 0.25 - 1.0).abs() < 6e-3, "{lit}");
    // Turned over, the band is below the horizon.
    let dark = mean(&floor(light(), DMat3::from_rotation_x(std::f64::consts::PI), Integrator::Direct));
    assert!(dark.max_element() < 1e-6, "{dark}");
}

#[test]
fn a_sky_file_replaces_the_scenes_own_and_a_bad_one_is_refused_by_name() {
    let folder = std::env::temp_dir().join(format!("penumbra-sky-file-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("sky.exr");
    let pixels: Vec<f32> = (0..8 * 4).flat_map(|_| [3.0, 2.0, 1.0]).collect();
    image::save_buffer_with_format(
        &file,
        bytemuck::cast_slice(&pixels),
        8,
        4,
        image::ColorType::Rgb32F,
        image::ImageFormat::OpenExr,
    )
    .unwrap();
    let opened = |sky: &Path| {
        let options = LoadOptions { sky: Some(sky.to_path_buf()), ..LoadOptions::default() };
        let wishes = Wishes { size: Some(UVec2::splat(16)), ..Wishes::default() };
        open(&SceneSource::parse("bust").unwrap(), &options, &wishes)
    };
    let mut app = opened(&file).unwrap().app;
    let lights: Vec<Light> = app.world.query::<&Light>().iter(&app.world).cloned().collect();
    assert_eq!(lights.iter().filter(|light| matches!(light, Light::Sky { .. })).count(), 1);
    assert!(!lights.iter().any(|light| matches!(light, Light::Environment { .. })));
    std::fs::write(&file, "not a picture").unwrap();
    let error = opened(&file).err().unwrap().to_string();
    assert!(error.contains("sky.exr") && error.contains("picture"), "{error}");
    std::fs::remove_dir_all(&folder).unwrap();
}
