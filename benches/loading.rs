//! Files of a hundred megabytes to their first picture, beside reading and decoding them alone: `cargo bench --bench loading`.
//!
//! Alone is what no program that shows all of a file can leave out: for glTF reading the file and decoding its images with
//! `image` on all threads, for OBJ reading it with `tobj`. Ours ends with a picture of 960×540, hierarchy and all.

#[path = "shapes/terrain.rs"]
mod terrain;

use glam::{UVec2, Vec3};
use image::codecs::jpeg::JpegEncoder;
use penumbra::app::FrameBudget;
use penumbra::load::{LoadOptions, SceneSource};
use penumbra::open::{Wishes, open};
use penumbra::trace::Integrator;
use rayon::prelude::*;
use serde_json::json;
use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// As the program has it.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

const ROUNDS: usize = 5;

/// Hills of `side`² fields, as vertices that their triangles share.
struct Hills {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

fn hills(side: usize) -> Hills {
    let corners = terrain::terrain(side);
    let row = side as u32 + 1;
    let mut positions = vec![Vec3::ZERO; (row * row) as usize];
    let mut triangles = Vec::with_capacity(corners.len());
    for (k, pair) in corners.chunks(2).enumerate() {
        let (i, j) = (k as u32 / side as u32, k as u32 % side as u32);
        let at = [i * row + j, (i + 1) * row + j, (i + 1) * row + j + 1, i * row + j + 1];
        for (vertex, place) in at.into_iter().zip([pair[0][0], pair[0][1], pair[0][2], pair[1][2]]) {
            positions[vertex as usize] = place;
        }
        triangles.extend([[at[0], at[1], at[2]], [at[0], at[2], at[3]]]);
    }
    Hills { positions, triangles }
}

/// A picture of `side`² texels with as much detail as photographs have.
fn photograph(side: u32, seed: u32) -> Result<Vec<u8>, Box<dyn Error>> {
    let texel = |x: u32, y: u32, c: u32| {
        let mut hash = (x / 3).wrapping_mul(0x9e37_79b9) ^ (y / 3 + seed * 977).wrapping_mul(0x85eb_ca6b);
        hash = (hash ^ hash >> 16).wrapping_mul(0x21f0_aaad);
        let wave = ((x + c * 97) as f32 * 0.01).sin() + (y as f32 * 0.013).cos();
        (128.0 + 40.0 * wave + (hash >> 27) as f32) as u8
    };
    let mut rgb = vec![0; (side * side * 3) as usize];
    rgb.par_chunks_mut((side * 3) as usize).enumerate().for_each(|(y, row)| {
        for (i, byte) in row.iter_mut().enumerate() {
            *byte = texel(i as u32 / 3, y as u32, i as u32 % 3);
        }
    });
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, 90).encode(&rgb, side, side, image::ExtendedColorType::Rgb8)?;
    Ok(jpeg)
}

/// A GLB of `pieces` meshes of hills in a row, and `images` that clothe them in turn.
fn write_glb(path: &Path, pieces: usize, side: usize, images: &[Vec<u8>]) -> Result<(), Box<dyn Error>> {
    let hills = hills(side);
    let (mut binary, mut views) = (Vec::new(), Vec::new());
    let mut view = |bytes: &[u8]| {
        views.push(json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len()}));
        binary.extend_from_slice(bytes);
        binary.resize(binary.len().next_multiple_of(4), 0);
        views.len() - 1
    };
    let (mut accessors, mut meshes, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
    let uvs: Vec<[f32; 2]> = hills.positions.iter().map(|p| [p.x * 0.5 + 0.5, p.z * 0.5 + 0.5]).collect();
    let normals = vec![Vec3::Y; hills.positions.len()];
    let (count, corners) = (hills.positions.len(), 3 * hills.triangles.len());
    for piece in 0..pieces {
        let first = accessors.len();
        // Each of another height: equal meshes would be built once.
        let steep = Vec3::new(1.0, 1.0 + piece as f32 / pieces as f32, 1.0);
        let positions: Vec<Vec3> = hills.positions.iter().map(|&p| p * steep).collect();
        for (bytes, kind, component, count) in [
            (bytemuck::cast_slice(&positions), "VEC3", 5126, count),
            (bytemuck::cast_slice(&normals), "VEC3", 5126, count),
            (bytemuck::cast_slice(&uvs), "VEC2", 5126, count),
            (bytemuck::cast_slice(&hills.triangles), "SCALAR", 5125, corners),
        ] {
            accessors.push(
                json!({"bufferView": view(bytes), "componentType": component, "count": count, "type": kind,
                "min": [-1, -1, -1], "max": [1, 1, 1]}),
            );
        }
        let material = (!images.is_empty()).then(|| piece % images.len());
        meshes.push(json!({"primitives": [{"attributes": {"POSITION": first, "NORMAL": first + 1, "TEXCOORD_0": first + 2},
            "indices": first + 3, "material": material}]}));
        nodes.push(json!({"mesh": piece, "translation": [2 * (piece % 8), 0, 2 * (piece / 8)]}));
    }
    let pictures: Vec<_> =
        images.iter().map(|jpeg| json!({"bufferView": view(jpeg), "mimeType": "image/jpeg"})).collect();
    let clothed =
        |i: usize| json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": i}, "metallicFactor": 0}});
    let mut text = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": (0..pieces).collect::<Vec<_>>()}],
        "nodes": nodes, "meshes": meshes, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": binary.len()}],
    });
    if !images.is_empty() {
        text["images"] = json!(pictures);
        text["textures"] = (0..images.len()).map(|i| json!({"source": i})).collect();
        text["materials"] = (0..images.len()).map(clothed).collect();
    } else {
        for mesh in text["meshes"].as_array_mut().into_iter().flatten() {
            if let Some(primitive) = mesh["primitives"][0].as_object_mut() {
                primitive.remove("material");
            }
        }
    }
    let mut json = serde_json::to_vec(&text)?;
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF".to_vec();
    for word in [2, 28 + json.len() + binary.len(), json.len(), 0x4e4f_534a] {
        glb.extend_from_slice(&(word as u32).to_le_bytes());
    }
    glb.extend_from_slice(&json);
    for word in [binary.len(), 0x004e_4942] {
        glb.extend_from_slice(&(word as u32).to_le_bytes());
    }
    glb.extend_from_slice(&binary);
    Ok(std::fs::write(path, glb)?)
}

fn write_obj(path: &Path, side: usize) -> Result<(), Box<dyn Error>> {
    let hills = hills(side);
    let mut text = String::new();
    for p in &hills.positions {
        writeln!(text, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z)?;
    }
    for corners in &hills.triangles {
        let [a, b, c] = corners.map(|corner| corner + 1);
        writeln!(text, "f {a} {b} {c}")?;
    }
    Ok(std::fs::write(path, text)?)
}

/// Seconds of what nobody can leave out.
fn alone(path: &Path, images: &[Vec<u8>]) -> Result<f64, Box<dyn Error>> {
    let start = Instant::now();
    if path.extension().is_some_and(|ending| ending == "obj") {
        let loaded = tobj::load_obj(path, &tobj::LoadOptions::default())?;
        let seconds = start.elapsed().as_secs_f64();
        drop(loaded);
        return Ok(seconds);
    }
    let bytes = std::fs::read(path)?;
    let decode = |jpeg: &Vec<u8>| image::load_from_memory(jpeg).map(image::DynamicImage::into_rgba8);
    let decoded: Vec<_> = images.par_iter().map(decode).collect::<Result<_, _>>()?;
    let seconds = start.elapsed().as_secs_f64();
    drop((bytes, decoded));
    Ok(seconds)
}

/// Seconds to the first picture, and what they went to.
fn ours(path: &Path) -> Result<(f64, String), Box<dyn Error>> {
    let wishes = Wishes {
        size: Some(UVec2::new(960, 540)),
        integrator: Some(Integrator::Direct),
        ..Wishes::default()
    };
    let start = Instant::now();
    let mut opened = open(&SceneSource::File(path.to_owned()), &LoadOptions::default(), &wishes)?;
    let loaded = Instant::now();
    let time = Some(Duration::ZERO);
    let budget = FrameBudget { preview: true, develop: true, time, ..FrameBudget::default() };
    opened.app.world.insert_resource(budget);
    opened.app.frame();
    let (seconds, picture) = (start.elapsed().as_secs_f64(), loaded.elapsed().as_secs_f64());
    let mut phases = String::new();
    for (phase, seconds) in &opened.report.seconds {
        if *seconds >= 5e-4 {
            write!(phases, "{phase} {:.0}, ", seconds * 1e3)?;
        }
    }
    write!(phases, "hierarchy {:.0}, picture {:.0}", opened.build_seconds * 1e3, picture * 1e3)?;
    Ok((seconds, phases))
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::temp_dir().join(format!("penumbra-loading-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let done = measure(&folder);
    std::fs::remove_dir_all(&folder)?;
    done
}

fn measure(folder: &Path) -> Result<(), Box<dyn Error>> {
    let large: Vec<Vec<u8>> = (0..8).map(|i| photograph(4096, i)).collect::<Result<_, _>>()?;
    let small: Vec<Vec<u8>> = (0..32).map(|i| photograph(2048, i)).collect::<Result<_, _>>()?;
    let file = |name: &str| folder.join(name);
    let files: [(&str, PathBuf, &[Vec<u8>]); 4] = [
        ("one mesh, 8 images of 4096²", file("scan.glb"), &large),
        ("256 meshes, 32 images of 2048²", file("parts.glb"), &small),
        ("one mesh, no image", file("bare.glb"), &[]),
        ("1.8 million triangles", file("terrain.obj"), &[]),
    ];
    write_glb(&files[0].1, 1, 1000, &large)?;
    write_glb(&files[1].1, 256, 64, &small)?;
    write_glb(&files[2].1, 1, 1340, &[])?;
    write_obj(&files[3].1, 950)?;
    println!("| file | MB | alone s | first picture s | ratio | of that, ms |\n|---|---|---|---|---|---|");
    for (what, path, images) in &files {
        let megabytes = std::fs::metadata(path)?.len() as f64 * 1e-6;
        let (mut least, mut ratios, mut phases) = ([f64::INFINITY; 2], Vec::new(), String::new());
        for _ in 0..ROUNDS {
            let theirs = alone(path, images)?;
            let (ours, said) = ours(path)?;
            if ours < least[1] {
                phases = said;
            }
            least = [least[0].min(theirs), least[1].min(ours)];
            ratios.push(ours / theirs);
        }
        ratios.sort_by(f64::total_cmp);
        let [theirs, ours] = least;
        println!(
            "| {what} | {megabytes:.0} | {theirs:.2} | {ours:.2} | {:.1} | {phases} |",
            ratios[ROUNDS / 2]
        );
    }
    Ok(())
}
