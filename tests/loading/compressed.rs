//! Compressed geometry and textures. The files were made from `wave.gltf` (ours) and `checker.png` by gltfpack 1.3,
//! gltf-pipeline (Draco) and basisu.

use super::builder::Builder;
use super::*;

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/loading/compressed").join(name)
}

/// World positions and normals of all triangle corners, and where the x axis goes.
struct Shape {
    corners: Vec<[DVec3; 2]>,
    uvs: Vec<Vec2>,
    axis: DVec3,
}

fn shape(name: &str, time: Option<f64>) -> Shape {
    let mut world = World::new();
    let options = LoadOptions { time, ..LoadOptions::default() };
    let report = load(&mut world, &SceneSource::File(path(name)), &options).unwrap();
    assert!(report.warnings().is_empty(), "{name}: {:?}", report.warnings());
    assert_eq!(report.triangles, 128, "{name}");
    let mut query = world.query::<(&Instance, &GlobalTransform)>();
    let (instance, GlobalTransform(place)) = query.single(&world).unwrap();
    let mesh = &world.get::<Mesh>(instance.mesh).unwrap().0;
    let vertices = mesh.triangles.iter().flatten().map(|&vertex| vertex as usize);
    let normal = |i: usize| place.matrix3.inverse().transpose() * mesh.normals[i].as_dvec3();
    let corner = |i: usize| [place.transform_point3(mesh.positions[i].as_dvec3()), normal(i).normalize()];
    let corners = vertices.clone().map(corner).collect();
    let uvs = vertices.map(|i| mesh.uvs[i]).collect();
    let axis = named::<GlobalTransform>(&mut world, "wave").0.transform_vector3(DVec3::Y).normalize();
    Shape { corners, uvs, axis }
}

#[test]
fn compressed_geometry_is_the_plain_one_within_its_precision() {
    let files = [
        ("wave-quantized.glb", false),
        ("wave-meshopt.glb", false),
        ("wave-meshopt-khr.glb", false),
        ("wave-meshopt-float.glb", true),
        ("wave-draco.glb", true),
    ];
    let plain = shape("wave.gltf", None);
    for (name, has_plain_uvs) in files {
        let packed = shape(name, None);
        for (i, [position, normal]) in plain.corners.iter().enumerate() {
            // Compressors reorder triangles; the corner must be there all the same.
            let distance = |k: &usize| (packed.corners[*k][0] - *position).length();
            let twin = (0..packed.corners.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
            assert!(distance(&twin) < 2e-3, "{name}: no corner at {position}");
            let angle = packed.corners[twin][1].angle_between(*normal);
            assert!(angle < 0.02, "{name}: normal off by {angle}");
            let uv = (packed.uvs[twin] - plain.uvs[i]).length();
            assert!(!has_plain_uvs || uv < 2e-3, "{name}: texture coordinates off by {uv}");
        }
    }
}

#[test]
fn compressed_animations_turn_as_the_plain_one_does() {
    // At a keyframe of the compressor's, which makes 30 a second.
    let plain = shape("wave.gltf", Some(0.1)).axis;
    assert!((plain.angle_between(DVec3::Y) - 0.24).abs() < 1e-6);
    for name in ["wave-meshopt.glb", "wave-meshopt-khr.glb", "wave-meshopt-float.glb"] {
        let packed = shape(name, Some(0.1)).axis;
        assert!(packed.angle_between(plain) < 2e-3, "{name}: {packed} is not {plain}");
    }
}

#[test]
fn damaged_compression_is_refused_with_its_place() {
    for name in ["wave-meshopt.glb", "wave-draco.glb"] {
        let good = std::fs::read(path(name)).unwrap();
        let (json_end, length) =
            (20 + u32::from_le_bytes(good[12..16].try_into().unwrap()) as usize, good.len());
        let mut bad = good.clone();
        bad[json_end + 8..length].fill(0xa5);
        let folder = Folder::new(&[(name, &bad)]);
        let message = folder.load(name).1.unwrap_err().to_string();
        assert_says(
            &message,
            if name.contains("draco") {
                "mesh 0, primitive 0, Draco: damaged"
            } else {
                "meshopt compression: damaged"
            },
        );
    }
}

/// A file of which two primitives name one compressed view.
fn twice(draco: &[u8]) -> Vec<u8> {
    let end = 20 + u32::from_le_bytes(draco[12..16].try_into().unwrap()) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&draco[20..end]).unwrap();
    let primitives = json["meshes"][0]["primitives"].as_array_mut().unwrap();
    primitives.push(primitives[0].clone());
    let json = json.to_string();
    let size = json.len().next_multiple_of(4);
    let head = [12 + 8 + size + draco.len() - end, size].map(|length| (length as u32).to_le_bytes());
    let [total, size_of_json] = head;
    [b"glTF\x02\0\0\0", &total[..], &size_of_json, b"JSON", format!("{json:size$}").as_bytes(), &draco[end..]]
        .concat()
}

#[test]
fn a_compressed_view_may_be_named_twice() {
    let name = "wave-draco.glb";
    let (_, report) = loaded_all(&[(name, &twice(&std::fs::read(path(name)).unwrap()))]);
    assert_eq!((report.triangles, report.warnings()), (256, Vec::new()));
}

fn textured(image: &str) -> String {
    let mut file = Builder::default();
    let positions = file.floats("VEC3", &builder::TRIANGLE);
    let uvs = file.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
    file.finish(&format!(
        r#""extensionsRequired":["KHR_texture_basisu"],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions},"TEXCOORD_0":{uvs}}},"material":0}}]}}],"nodes":[{{"mesh":0}}],"scenes":[{{"nodes":[0]}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
        "textures":[{{"extensions":{{"KHR_texture_basisu":{{"source":0}}}}}}],"images":[{{"uri":"{image}"}}]"#
    ))
}

#[test]
fn basis_universal_textures_show_the_picture_they_were_made_of() {
    let checker = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/checker.png");
    let plain = image::open(checker).unwrap().into_rgba8();
    for (name, most) in [("checker-uastc.ktx2", 2.0), ("checker-etc1s.ktx2", 12.0)] {
        let bytes = std::fs::read(path(name)).unwrap();
        let (mut world, report) = loaded_all(&[("a.gltf", textured(name).as_bytes()), (name, &bytes)]);
        assert!(report.warnings().is_empty(), "{:?}", report.warnings());
        let texels = &world.query::<&Texture>().single(&world).unwrap().texels;
        assert_eq!([texels.width, texels.height], [plain.width(), plain.height()]);
        let off: f64 = plain
            .as_raw()
            .iter()
            .zip(texels.texels.as_flattened())
            .map(|(&a, &b)| f64::from(a.abs_diff(b)))
            .sum();
        let mean = off / plain.as_raw().len() as f64;
        assert!(mean < most, "{name}: off by {mean} on average");
        // A truncated one is a warning and a stand-in.
        let (_, report) = loaded_all(&[("a.gltf", textured(name).as_bytes()), (name, &bytes[..60])]);
        assert_says(&report.warnings().join("\n"), "KTX2 image cannot be decoded");
    }
}
