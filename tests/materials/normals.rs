//! Normal maps, their frames, and that no normal makes a surface see itself.

use crate::geometry::{Rng, shared};
use bevy_ecs::name::Name;
use glam::{Affine2, DAffine3, DMat3, DVec3, Vec2, Vec3, Vec4};
use penumbra::bvh::{Hit, Ray};
use penumbra::load::{LoadOptions, SceneSource, load};
use penumbra::scene::{Encoding, Filter, Material, Mesh, NormalMap, Texels, Texture, TriangleMesh, Wrap};
use penumbra::torture::geometry::alone::Alone;
use penumbra::trace::bsdf::normal::clear_of_surface;
use penumbra::trace::scene::{Surface, TextureIndex};
use penumbra::trace::surface::Interaction;
use std::sync::Arc;

fn reflect(wo: Vec3, n: Vec3) -> Vec3 {
    n * (2.0 * n.dot(wo)) - wo
}

fn floor_point(normal: Vec3, wo: Vec3) -> Interaction {
    Interaction {
        position: Vec3::ZERO,
        error: Vec3::ZERO,
        geometric_normal: Vec3::Z,
        normal,
        tangent: Vec4::ZERO,
        wo,
        uvs: [Vec2::ZERO; 2],
        color: Vec4::ONE,
        front: true,
        lifted: None,
    }
}

#[test]
fn no_tilted_mirror_reflects_into_its_own_surface() {
    let mut rng = Rng(3);
    let (mut kept, mut turned, mut wrong_before) = (0, 0, 0);
    for i in 0..1_000_000 {
        let mut wo = rng.direction();
        wo.z = wo.z.abs();
        if i % 4 == 0 {
            // Grazing.
            wo.z *= 1e-4;
            wo = wo.normalize();
        }
        if wo.z <= 0.0 {
            continue;
        }
        let mut normal = rng.direction();
        if i % 2 == 0 {
            normal = (normal * 0.3 + Vec3::Z).normalize();
        }
        let mirrored = reflect(wo, normal);
        let valid = mirrored.z > 1e-3 && normal.dot(wo) > 0.0;
        wrong_before += u32::from(mirrored.z <= 0.0 || normal.dot(wo) <= 0.0);
        let mended = clear_of_surface(normal, &floor_point(normal, wo));
        assert!((mended.length() - 1.0).abs() < 1e-5, "{mended}");
        assert!(mended.dot(wo) > 0.0, "{normal} seen from {wo} becomes {mended}, which faces away");
        assert!(reflect(wo, mended).z > 0.0, "{normal} seen from {wo} becomes {mended}: into the surface");
        if valid {
            assert_eq!(mended, normal, "changed without need");
            kept += 1;
        } else {
            turned += 1;
        }
    }
    println!("{kept} normals were kept, {turned} turned; {wrong_before} would have been wrong");
    assert!(kept > 100_000 && wrong_before > 100_000, "the test must see both");
}

#[test]
fn a_normal_sets_in_to_turn_without_a_step() {
    let wo = Vec3::new(0.8, 0.0, 0.6);
    let at = |tilt: f32| {
        let normal = Vec3::new(-tilt.sin(), 0.0, tilt.cos());
        clear_of_surface(normal, &floor_point(normal, wo))
    };
    let mut before = at(0.0);
    for i in 1..=3000 {
        let now = at(i as f32 * 5e-4);
        assert!((now - before).length() < 4e-3, "a step at a tilt of {}", i as f32 * 5e-4);
        before = now;
    }
}

/// A square of size 2 with u along +X and v along −Y, whose normal map is one texel.
fn square(texel: [u8; 4], scale: f32, place: DAffine3) -> (Alone, Surface) {
    let mesh = TriangleMesh {
        positions: [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, y]| Vec3::new(x, y, 0.0)).to_vec(),
        normals: vec![Vec3::Z; 4],
        uvs: [[0., 1.], [1., 1.], [1., 0.], [0., 0.]].map(Vec2::from).to_vec(),
        tangents: vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    };
    let texels = Arc::new(Texels { width: 1, height: 1, texels: vec![texel] });
    let texture =
        Texture { texels, encoding: Encoding::Linear, wrap: [Wrap::Repeat; 2], filter: Filter::Nearest };
    let mut alone = Alone::new(mesh, place).unwrap();
    alone.surfaces.textures.push(texture);
    let texture = TextureIndex { index: 0, uv_transform: Affine2::IDENTITY, second_uvs: false };
    let surface =
        Surface { normal_map: Some(NormalMap { texture, scale }), ..Surface::from(Material::default()) };
    (alone, surface)
}

/// The normal is fixed to the surface: placed, mirrored, squeezed, seen from behind.
#[test]
fn a_normal_map_is_carried_along_by_its_placement() {
    let texel = [178, 153, 230, 255];
    let n = (Vec3::new(178.0, 153.0, 230.0) / 255.0 * 2.0 - 1.0).as_dvec3();
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 0.8);
    for scale in
        [DVec3::ONE, DVec3::new(-1.0, 1.0, 1.0), DVec3::new(1.0, -1.0, 1.0), DVec3::new(2.0, 2.0, -2.0)]
    {
        for strength in [1.0, 0.5] {
            let matrix = turn * DMat3::from_diagonal(scale);
            let (alone, surface) = square(texel, strength, DAffine3::from_mat3(matrix));
            let hit = Hit { t: 1.0, u: 0.3, v: 0.2, triangle: 0, instance: 0 };
            let axis = |v: DVec3| (matrix * v).normalize();
            let (u, up) = (axis(DVec3::X), axis(DVec3::Y));
            // The front is where local +Z is: a placement carries normals over with their side.
            let out = axis(DVec3::Z);
            let tilt = f64::from(strength);
            let expected = (u * n.x * tilt + up * n.y * tilt + out * n.z).normalize().as_vec3();
            for side in [1.0f32, -1.0] {
                let ray = Ray::new(Vec3::ZERO, -out.as_vec3() * side);
                let at = alone.at(&hit, &ray);
                let normal = at.bsdf(&alone.scene(), &surface).normal();
                let off = (normal - expected * side).length();
                assert!(off < 1e-5, "scale {scale}, from {side}: {normal}, not {}", expected * side);
            }
        }
    }
}

/// Bakers and renderers must agree on tangents: ours against those in files, by Blender, and (the helmet) by a
/// tool that smooths a little differently.
#[test]
fn made_tangents_are_those_that_files_have() {
    let Some(shared) = shared("made_tangents_are_those_that_files_have") else {
        return;
    };
    for (name, share) in [("02_suzanne", 0.98), ("FlightHelmet", 0.9)] {
        let folder = std::env::temp_dir().join(format!("penumbra-tangents-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for entry in std::fs::read_dir(shared.join("scenes/gltf").join(name)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                std::fs::copy(&path, folder.join(path.file_name().unwrap())).unwrap();
            }
        }
        let original = folder.join(format!("{name}.gltf"));
        let text = std::fs::read_to_string(&original).unwrap();
        let bare = folder.join("bare.gltf");
        std::fs::write(&bare, text.replace("\"TANGENT\"", "\"_TANGENT\"")).unwrap();
        let [given, made] = [&original, &bare].map(|path| {
            let mut world = bevy_ecs::world::World::new();
            let report = load(&mut world, &SceneSource::File(path.clone()), &LoadOptions::default()).unwrap();
            assert_eq!(report.warnings(), [""; 0]);
            let mut query = world.query::<(&Name, &Mesh)>();
            let mut meshes: Vec<_> =
                query.iter(&world).map(|(name, mesh)| (name.to_string(), mesh.0.clone())).collect();
            meshes.sort_by(|(a, _), (b, _)| a.cmp(b));
            meshes
        });
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(given.len(), made.len());
        let (mut close, mut all, mut sides) = (0, 0, 0);
        for ((_, given), (_, made)) in given.iter().zip(&made) {
            assert!(!given.tangents.is_empty() && !made.tangents.is_empty());
            let corners = given.triangles.as_flattened().iter().zip(made.triangles.as_flattened());
            for (&a, &b) in corners {
                let (a, b) = (given.tangents[a as usize], made.tangents[b as usize]);
                all += 1;
                close += i32::from(a.truncate().dot(b.truncate()) > 0.999);
                sides += i32::from(a.w == b.w);
            }
        }
        println!("{name}: {close} of {all} tangents within 2.6 degrees, {sides} of the same side");
        assert!(f64::from(close) > share * f64::from(all) && f64::from(sides) > 0.999 * f64::from(all));
    }
}
