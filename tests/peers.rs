//! Our pictures of the peers' scenes against their converged references (Mitsuba 3).

mod support;

use glam::{UVec2, Vec3};
use penumbra::app::FrameBudget;
use penumbra::image::compare::LinearImage;
use penumbra::image::files::linear_pixels;
use penumbra::load::{LoadOptions, SceneSource};
use penumbra::open::{Opened, Wishes, open};
use penumbra::trace::{Film, Integrator, Lights, Viewpoint};
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The peers' scene `name` in our format, written into `folder`.
fn convert(peers: &Path, name: &str, folder: &Path) -> PathBuf {
    let json = std::fs::read_to_string(peers.join(format!("scenes/{name}.json"))).unwrap();
    let scene: Value = serde_json::from_str(&json).unwrap();
    let mut toml = String::new();
    for (name, material) in scene["materials"].as_object().unwrap() {
        let rgb = &material["rgb"];
        match material["type"].as_str().unwrap() {
            "mirror" => writeln!(toml, "[material.{name}]\nbase_color = [0, 0, 0]\nmirror = {rgb}").unwrap(),
            _ => writeln!(toml, "[material.{name}]\nbase_color = {rgb}").unwrap(),
        }
    }
    for mesh in scene["meshes"].as_array().unwrap() {
        let file = peers.join("scenes").join(mesh["obj"].as_str().unwrap()).canonicalize().unwrap();
        // The peers shade flat: positions only.
        let flat = folder.join(format!("{name}-{}", file.file_name().unwrap().to_string_lossy()));
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&flat, flat_obj(&text)).unwrap();
        writeln!(
            toml,
            "[[model]]\nfile = {:?}\nmaterial = {}\nmatrix = {}",
            flat, mesh["material"], mesh["transform"]
        )
        .unwrap();
    }
    for light in scene["lights"].as_array().unwrap() {
        writeln!(toml, "[[light]]\nkind = \"parallelogram\"").unwrap();
        for key in ["corner", "edge_u", "edge_v", "radiance"] {
            writeln!(toml, "{key} = {}", light[key]).unwrap();
        }
    }
    let camera = &scene["camera"];
    writeln!(
        toml,
        "[camera]\nposition = {}\ntarget = {}\nup = {}",
        camera["eye"], camera["target"], camera["up"]
    )
    .unwrap();
    writeln!(toml, "vertical_fov = {}", camera["vfov_deg"]).unwrap();
    writeln!(toml, "[render]\nresolution = [{}, {}]", camera["width"], camera["height"]).unwrap();
    let path = folder.join(format!("{name}.toml"));
    std::fs::write(&path, toml).unwrap();
    path
}

/// Vertices and faces of an OBJ text, without normals and texture coordinates.
fn flat_obj(text: &str) -> String {
    let mut flat = String::new();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => writeln!(flat, "{line}").unwrap(),
            Some("f") => {
                let corners: Vec<&str> = words.map(|w| w.split('/').next().unwrap()).collect();
                writeln!(flat, "f {}", corners.join(" ")).unwrap();
            }
            _ => {}
        }
    }
    flat
}

/// False where a light is seen directly, grown by 2 pixels: the peers leave those out.
fn mask(lights: &Lights, viewpoint: &Viewpoint, size: UVec2) -> Vec<bool> {
    let (w, h) = (size.x as i32, size.y as i32);
    let center = |x: i32, y: i32| UVec2::new(x as u32, y as u32).as_vec2() + 0.5;
    let lit: Vec<bool> = (0..h)
        .flat_map(|y| (0..w).map(move |x| (x, y)))
        .map(|(x, y)| lights.closest(&viewpoint.ray(center(x, y), size)).is_some())
        .collect();
    (0..h)
        .flat_map(|y| (0..w).map(move |x| (x, y)))
        .map(|(x, y)| {
            !(-2..=2).any(|dy: i32| {
                (-2..=2).any(|dx: i32| {
                    let (x, y) = (x + dx, y + dy);
                    (0..w).contains(&x) && (0..h).contains(&y) && lit[(y * w + x) as usize]
                })
            })
        })
        .collect()
}

/// Mean over the 8×8 pixels from `x`, `y` on.
fn tile_brightness(image: &LinearImage, x: usize, y: usize) -> f64 {
    let row = |y: usize| &image.pixels[y * image.size.x as usize + x..][..8];
    (y..y + 8).flat_map(row).map(|p| f64::from(p.element_sum() / 3.0)).sum::<f64>() / 64.0
}

struct Outcome {
    rmse: f64,
    bias: f64,
    /// Largest |mean difference| of an 8×8 tile over its standard error.
    worst_tile: f64,
}

/// Renders `runs` independent pictures of `spp` samples and compares their mean with the reference.
fn against_reference(peers: &Path, name: &str, mode: &str, runs: u32, spp: u32) -> Outcome {
    against_reference_with(peers, name, mode, runs, spp, 1.0)
}

/// The same with our picture `gain` times as bright, to see that a bias is found.
fn against_reference_with(peers: &Path, name: &str, mode: &str, runs: u32, spp: u32, gain: f32) -> Outcome {
    // One of its own for each picture: tests run at the same time.
    let folder = support::folder(&format!("peers/{name}.{mode}.{gain}"));
    let path = convert(peers, name, &folder);
    let reference = LinearImage::open(&peers.join(format!("refs/{name}.{mode}.exr"))).unwrap();
    let integrator = if mode == "direct" { Integrator::Direct } else { Integrator::Path };
    // Five edges from eye to light join four bounces.
    let wishes = Wishes { integrator: Some(integrator), max_depth: Some(4), ..Wishes::default() };
    let Opened { mut app, .. } = open(&SceneSource::File(path), &LoadOptions::default(), &wishes).unwrap();
    let size = reference.size;
    let (tiles_x, tiles_y) = (size.x as usize / 8, size.y as usize / 8);
    let mut sum = vec![Vec3::ZERO; reference.pixels.len()];
    let mut tile_means = vec![Vec::new(); tiles_x * tiles_y];
    let mut keep = Vec::new();
    for run in 0..runs {
        app.world.insert_resource(Film::new(size, run * spp));
        app.world.insert_resource(FrameBudget {
            sample_target: spp,
            pass_samples: spp,
            ..FrameBudget::default()
        });
        app.frame();
        if keep.is_empty() {
            keep = mask(app.world.resource::<Lights>(), app.world.resource::<Viewpoint>(), size);
        }
        let pixels: Vec<Vec3> =
            linear_pixels(app.world.resource::<Film>()).iter().map(|p| *p * gain).collect();
        let mut tiles = vec![(0.0, 0.0); tiles_x * tiles_y];
        for (i, (p, r)) in pixels.iter().zip(&reference.pixels).enumerate() {
            sum[i] += *p;
            if keep[i] {
                let tile = i / size.x as usize / 8 * tiles_x + i % size.x as usize / 8;
                tiles[tile].0 += f64::from((*p - *r).element_sum() / 3.0);
                tiles[tile].1 += 1.0;
            }
        }
        for (means, (sum, count)) in tile_means.iter_mut().zip(tiles) {
            if count > 32.0 {
                means.push(sum / count);
            }
        }
    }
    let (mut square, mut bias, mut count) = (0.0, 0.0, 0.0);
    for ((s, r), keep) in sum.iter().zip(&reference.pixels).zip(&keep) {
        if *keep {
            let d = (*s / runs as f32 - *r).as_dvec3();
            square += d.length_squared() / 3.0;
            bias += d.element_sum() / 3.0;
            count += 1.0;
        }
    }
    // The reference has noise too (said in BASELINE.md), and is rounded to 11 bits: half a step is a bias
    // that a whole tile may share.
    let reference_error: f64 = match (name, mode) {
        ("cornell_mirror", _) => 5.8e-3,
        (_, "direct") => 1.2e-4,
        _ => 4.4e-4,
    };
    let worst_tile = tile_means
        .iter()
        .enumerate()
        .filter(|(_, means)| !means.is_empty())
        .map(|(tile, means)| {
            let rounding = tile_brightness(&reference, tile % tiles_x * 8, tile / tiles_x * 8) / 4096.0;
            let n = means.len() as f64;
            let mean = means.iter().sum::<f64>() / n;
            let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
            (mean.abs() - rounding).max(0.0) / (variance / n + reference_error.powi(2) / 8.0).sqrt()
        })
        .fold(0.0, f64::max);
    let film = app.world.resource::<Film>();
    penumbra::image::save(&folder.join(format!("{name}.{mode}.png")), film, &Default::default()).unwrap();
    let outcome = Outcome { rmse: (square / count).sqrt(), bias: bias / count, worst_tile };
    println!(
        "{name} {mode}: RMSE {:.2e}, bias {:+.1e}, worst tile {:.1} sigma",
        outcome.rmse, outcome.bias, outcome.worst_tile
    );
    outcome
}

#[test]
fn pictures_agree_with_the_converged_references() {
    let Some(shared) = support::shared("pictures_agree_with_the_converged_references") else { return };
    let peers = shared.join("peers/renderers");
    // 32 samples per pixel leave noise of about half of this.
    for (name, mode, rmse) in [
        ("cornell", "direct", 1.3e-3),
        ("softshadows", "direct", 7e-3),
        ("cornell", "path5", 1.8e-2),
        ("softshadows", "path5", 1.4e-2),
        ("cornell_mirror", "path5", 9e-2),
    ] {
        let outcome = against_reference(&peers, name, mode, 32, 1);
        assert!(outcome.rmse < rmse, "{name} {mode}: RMSE {}", outcome.rmse);
        // Student's t with 31 degrees of freedom, two-sided, 1e-4 over 5 × 4,096 tiles: 7.3.
        assert!(outcome.worst_tile < 7.3, "{name} {mode}: a tile is off by {:.1} sigma", outcome.worst_tile);
    }
}

#[test]
fn a_light_one_percent_too_bright_is_found() {
    let Some(shared) = support::shared("a_light_one_percent_too_bright_is_found") else { return };
    let outcome = against_reference_with(&shared.join("peers/renderers"), "cornell", "direct", 32, 1, 1.01);
    assert!(outcome.worst_tile > 7.3, "worst tile only {:.1} sigma", outcome.worst_tile);
}
