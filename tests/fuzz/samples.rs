//! The valid files that are changed: each with as much of its format in it as possible.

use super::builder::{Builder, TRIANGLE};
use std::fmt::Write;
use std::io::Cursor;
use std::path::Path;

/// A scene and the one of its files that is changed.
pub struct Sample {
    /// The scene's file.
    pub name: &'static str,
    /// Its content, if it is not the one that is changed.
    pub main: Vec<u8>,
    /// Name of the file that is changed; empty for the scene's own.
    pub mutated: &'static str,
    /// Its content.
    pub bytes: Vec<u8>,
    /// Files beside it.
    pub others: Vec<(&'static str, Vec<u8>)>,
}

impl Sample {
    fn scene(name: &'static str, bytes: Vec<u8>) -> Self {
        Self { name, main: Vec::new(), mutated: "", bytes, others: Vec::new() }
    }

    fn beside(name: &'static str, main: &str, mutated: &'static str, bytes: Vec<u8>) -> Self {
        Self { name, main: main.as_bytes().to_vec(), mutated, bytes, others: Vec::new() }
    }
}

/// RFC 4648.
pub fn base64(bytes: &[u8]) -> String {
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let word = |chunk: &[u8]| {
        let bits =
            chunk.iter().enumerate().fold(0_u32, |bits, (i, &byte)| bits | u32::from(byte) << (16 - 8 * i));
        let word: String =
            (0..=chunk.len()).map(|i| char::from(digits[(bits >> (18 - 6 * i) & 63) as usize])).collect();
        format!("{word:=<4}")
    };
    bytes.chunks(3).map(word).collect()
}

fn own_file(path: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

fn picture(format: image::ImageFormat) -> Vec<u8> {
    let mut image = image::RgbImage::new(16, 16);
    for (x, y, pixel) in image.enumerate_pixels_mut() {
        *pixel = image::Rgb([(x * 16) as u8, (y * 16) as u8, (x * y) as u8]);
    }
    let mut bytes = Cursor::new(Vec::new());
    let image = image::DynamicImage::from(image);
    let image = match format {
        image::ImageFormat::Hdr | image::ImageFormat::OpenExr => image.into_rgb32f().into(),
        _ => image,
    };
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// Skin, morph targets, animation, sparse accessor, instances, strips, lights, cameras, variants, textures.
fn rich() -> String {
    let mut file = Builder::default();
    let positions = file.floats("VEC3", &TRIANGLE);
    let normals = file.floats("VEC3", &[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    let uvs = file.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
    let colors = file.bytes4(&[[255, 0, 0, 255]; 3], true);
    let joints = file.bytes4(&[[0, 1, 0, 0]; 3], false);
    let weights = file.bytes4(&[[128, 127, 0, 0]; 3], true);
    let index_view = file.view(&[0, 1, 2, 0], "");
    let indices = file.accessor(index_view, r#""componentType":5121,"count":3,"type":"SCALAR""#);
    let target = file.floats("VEC3", &[0., 0., 1., 0., 0., 2., 0., 0., 3.]);
    let sparse_indices = file.view(&[1, 0], "");
    let sparse_values = file.view(&[0, 0, 128, 63, 0, 0, 0, 0, 0, 0, 0, 0], "");
    let base = file.view(&[0; 36], "");
    let sparse = file.accessor(
        base,
        &format!(
            r#""componentType":5126,"count":3,"type":"VEC3","sparse":{{"count":1,"indices":{{"bufferView":{sparse_indices},"componentType":5121}},"values":{{"bufferView":{sparse_values}}}}}"#
        ),
    );
    let bind: Vec<f32> = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.].repeat(2);
    let bind = file.floats("MAT4", &bind);
    let times = file.floats("SCALAR", &[0.0, 1.0]);
    let moves = file.floats("VEC3", &[0., 0., 0., 1., 1., 1.]);
    let turns = file.floats("VEC4", &[0., 0., 0., 1., 0., 1., 0., 0.]);
    let grows = file.floats("SCALAR", &[0., 0., 0., 0., 1., 0.]);
    let image = file.view(&picture(image::ImageFormat::Png), "");
    file.finish(&format!(
        r#""scene":0,"scenes":[{{"nodes":[0,1,2,5]}},{{"name":"other","nodes":[4]}}],
        "extensionsUsed":["KHR_lights_punctual","EXT_mesh_gpu_instancing","KHR_materials_variants","KHR_texture_transform"],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"spot","intensity":50,"color":[1,0.5,0.2],"range":9,"spot":{{"innerConeAngle":0.1,"outerConeAngle":0.5}}}},{{"type":"directional","intensity":3}}]}},
          "KHR_materials_variants":{{"variants":[{{"name":"a"}},{{"name":"b"}}]}}}},
        "nodes":[{{"mesh":0,"skin":0,"weights":[0.5]}},{{"name":"j0","children":[3],"translation":[0,1,0],"rotation":[0,0,0,1]}},
          {{"mesh":1,"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":{positions},"SCALE":{target}}}}}}}}},
          {{"name":"j1","scale":[1,2,1],"camera":0,"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},{{"mesh":1}},
          {{"camera":1,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,4,1],"children":[],"mesh":1,"extensions":{{"KHR_lights_punctual":{{"light":1}}}}}}],
        "cameras":[{{"type":"perspective","perspective":{{"yfov":0.8,"znear":0.1}}}},{{"type":"orthographic","orthographic":{{"xmag":1,"ymag":1,"znear":0,"zfar":9}}}}],
        "skins":[{{"joints":[1,3],"inverseBindMatrices":{bind}}}],
        "meshes":[{{"weights":[0.1],"primitives":[{{"attributes":{{"POSITION":{positions},"NORMAL":{normals},"TEXCOORD_0":{uvs},"COLOR_0":{colors},"JOINTS_0":{joints},"WEIGHTS_0":{weights}}},"indices":{indices},"material":0,"targets":[{{"POSITION":{target},"NORMAL":{normals}}}]}}]}},
          {{"primitives":[{{"attributes":{{"POSITION":{sparse},"TEXCOORD_1":{uvs}}},"material":1,"extensions":{{"KHR_materials_variants":{{"mappings":[{{"material":0,"variants":[1]}}]}}}}}},{{"attributes":{{"POSITION":{positions}}},"mode":5}}]}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,0.5,0.2,0.9],"metallicFactor":0.5,"roughnessFactor":0.3,"baseColorTexture":{{"index":0,"extensions":{{"KHR_texture_transform":{{"offset":[0.5,0],"rotation":0.3,"scale":[2,2],"texCoord":1}}}}}},"metallicRoughnessTexture":{{"index":0}}}},"normalTexture":{{"index":0,"scale":0.5}},"alphaMode":"MASK","alphaCutoff":0.4,"emissiveFactor":[0.1,0.2,0.3],"emissiveTexture":{{"index":0,"texCoord":1}},"extensions":{{"KHR_materials_emissive_strength":{{"emissiveStrength":4}}}}}},
          {{"doubleSided":true,"alphaMode":"BLEND","extensions":{{"KHR_materials_transmission":{{"transmissionFactor":0.9}},"KHR_materials_ior":{{"ior":1.4}},"KHR_materials_volume":{{"thicknessFactor":1,"attenuationDistance":2,"attenuationColor":[0.9,0.5,0.2]}},"KHR_materials_specular":{{"specularFactor":0.5}},"KHR_materials_clearcoat":{{"clearcoatFactor":1}},"KHR_materials_sheen":{{"sheenRoughnessFactor":0.4}}}}}}],
        "textures":[{{"source":0,"sampler":0}}],"samplers":[{{"magFilter":9728,"minFilter":9987,"wrapS":33071,"wrapT":33648}}],"images":[{{"bufferView":{image},"mimeType":"image/png"}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{moves}}},{{"input":{times},"output":{turns},"interpolation":"STEP"}},{{"input":{times},"output":{grows},"interpolation":"CUBICSPLINE"}}],
          "channels":[{{"sampler":0,"target":{{"node":1,"path":"translation"}}}},{{"sampler":1,"target":{{"node":3,"path":"rotation"}}}},{{"sampler":2,"target":{{"node":0,"path":"weights"}}}}]}}]"#
    ))
}

pub fn gltf() -> Vec<Sample> {
    let wave = own_file("tests/loading/compressed/wave.gltf");
    vec![
        Sample::scene("rich.gltf", rich().into_bytes()),
        Sample::scene("rich.gltf", rich().into_bytes()),
        Sample::scene("cornell.gltf", own_file("assets/cornell.gltf")),
        Sample::scene("wave.gltf", wave),
    ]
}

/// The JSON's data URI as a binary chunk.
pub fn glb() -> Vec<Sample> {
    let mut json: serde_json::Value = serde_json::from_str(&rich()).unwrap();
    let uri = json["buffers"][0].as_object_mut().unwrap().remove("uri").unwrap();
    let mut binary = decode(uri.as_str().unwrap().split_once(',').unwrap().1);
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((28 + json.len() + binary.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json), (b"BIN\0", binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    // An odd length goes past the mending of lengths: its header and binary data are changed as they are.
    let odd = [bytes.clone(), vec![0]].concat();
    vec![Sample::scene("rich.glb", bytes), Sample::scene("odd.glb", odd)]
}

fn decode(text: &str) -> Vec<u8> {
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let (mut bits, mut count, mut bytes) = (0_u32, 0, Vec::new());
    for byte in text.bytes().filter(|&byte| byte != b'=') {
        bits = bits << 6 | digits.iter().position(|&digit| digit == byte).unwrap() as u32;
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    bytes
}

pub fn compressed() -> Vec<Sample> {
    let file = |name: &str| own_file(&format!("tests/loading/compressed/{name}"));
    let odd = |name: &str| [file(name), vec![0]].concat();
    vec![
        Sample::scene("meshopt.glb", file("wave-meshopt.glb")),
        Sample::scene("meshopt-odd.glb", odd("wave-meshopt.glb")),
        Sample::scene("khr-odd.glb", odd("wave-meshopt-khr.glb")),
        Sample::scene("float-odd.glb", odd("wave-meshopt-float.glb")),
        Sample::scene("draco.glb", file("wave-draco.glb")),
        Sample::scene("draco-odd.glb", odd("wave-draco.glb")),
        Sample::scene("draco-odd.glb", odd("wave-draco.glb")),
    ]
}

const OBJ: &str = "mtllib a.mtl\no thing\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nv 2 0.5 0\nv 3 -0.5 1e-3\n\
vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nvn 0 1 0\ng a b\nusemtl red\ns 1\nf 1/1/1 2/2/1 3/3/2\nf 1//1 3//2 4//1\nusemtl shiny \\\n metal\n\
s off\nf -6 -5 -4 -3 -2\nf 1 2 5 3 6 4\nl 1 2 3\np 1\nf 2/1 3/2 5/3\n# comment\ncurv 0 1 1 2\n";

const MTL: &str = "newmtl red\nKa 0.1 0.1 0.1\nKd 0.8 0.1 0.1\nKs 0.3 0.3 0.3\nKe 0 0 0\nNs 50\nNi 1.5\nd 0.9\nillum 2\n\
map_Kd -s 2 2 1 -o 0.1 0.2 0 -clamp on t.png\nmap_d t.png\nbump -bm 0.5 t.png\nnewmtl shiny   metal\nPr 0.3\nPm 1\nPs 0.1\nPc 0.2\nTf 0.9 1 0.9\nTr 0.1\nillum 7\nmap_Ke t.png\n";

pub fn obj() -> Vec<Sample> {
    let mut grid = String::new();
    for i in 0..40 {
        writeln!(grid, "v {} {} {}", i % 8, i / 8, i % 3).unwrap();
        if i >= 9 && i % 8 > 0 {
            writeln!(grid, "f -1 -2 -10 -9").unwrap();
        }
    }
    let others = vec![("a.mtl", MTL.as_bytes().to_vec()), ("t.png", picture(image::ImageFormat::Png))];
    vec![
        Sample { others, ..Sample::scene("a.obj", OBJ.as_bytes().to_vec()) },
        Sample::scene("grid.obj", grid.into_bytes()),
    ]
}

pub fn mtl() -> Vec<Sample> {
    let others = vec![("t.png", picture(image::ImageFormat::Png))];
    vec![Sample { others, ..Sample::beside("a.obj", OBJ, "a.mtl", MTL.as_bytes().to_vec()) }]
}

pub fn toml() -> Vec<Sample> {
    ["gallery.toml", "mirrors.toml", "cornell.toml"]
        .into_iter()
        .map(|name| {
            let others =
                ["gallery.obj", "gallery.mtl", "cornell.obj", "cornell.mtl", "sphere.obj", "plane.obj"];
            let others = others.map(|other| (other, own_file(&format!("assets/{other}")))).to_vec();
            Sample { others, ..Sample::scene(name, own_file(&format!("assets/{name}"))) }
        })
        .collect()
}

pub fn images() -> Vec<Sample> {
    use image::ImageFormat::{Bmp, Gif, Hdr, Jpeg, OpenExr, Png, Tga, Tiff, WebP};
    let scene = |name: &str| {
        let mut file = Builder::default();
        let positions = file.floats("VEC3", &TRIANGLE);
        file.finish(&format!(
            r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}},"material":0}}]}}],"nodes":[{{"mesh":0}}],"scenes":[{{"nodes":[0]}}],
            "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],"textures":[{{"source":0}}],"images":[{{"uri":"{name}"}}]"#
        ))
    };
    let formats = [
        ("a.png", Png),
        ("a.jpg", Jpeg),
        ("a.webp", WebP),
        ("a.gif", Gif),
        ("a.bmp", Bmp),
        ("a.tga", Tga),
        ("a.tiff", Tiff),
        ("a.hdr", Hdr),
        ("a.exr", OpenExr),
    ];
    let mut samples: Vec<Sample> = formats
        .into_iter()
        .map(|(name, format)| Sample::beside("a.gltf", &scene(name), name, picture(format)))
        .collect();
    for name in ["checker-etc1s.ktx2", "checker-uastc.ktx2"] {
        let bytes = own_file(&format!("tests/loading/compressed/{name}"));
        samples.push(Sample::beside("a.gltf", &scene(name), name, bytes));
    }
    samples
}
