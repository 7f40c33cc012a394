//! Normal maps, their frames, and that no normal makes a surface see itself.

use crate::geometry::Rng;
use crate::geometry::shared;
use crate::stage::Estimate;
use bevy_ecs::name::Name;
use glam::Vec3;
use penumbra::load::{LoadOptions, SceneSource, load};
use penumbra::scene::{Glossy, Layers, Material, Mesh};
use penumbra::torture::light::kinds::{Seen, glossy_kinds, layered_kinds};
use penumbra::torture::light::surfaces::floor_point;
use penumbra::trace::bsdf::Lobes;
use penumbra::trace::bsdf::normal::clear_of_surface;

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

/// How much light falls on a matte surface does not depend on who looks, whatever normal it is smoothed by: at the rim of a
/// smooth cylinder's cap that normal faces away from the eye.
#[test]
fn matte_surfaces_look_the_same_from_everywhere_whatever_their_normal() {
    let matte = Material { base_color: Vec3::splat(0.6), ..Material::default() };
    let plain = Glossy::Ggx { metallic: 0.0, roughness: 1.0, texture: None };
    let dull = Layers { specular: 0.0, ..Layers::default() };
    let layered = Material { glossy: plain, layers: Some(Box::new(dull)), ..matte.clone() };
    let normal = Vec3::new(0.9, 0.0, 0.435_889_9);
    for (name, material) in [("Lambert", &matte), ("layered", &layered)] {
        let mut seen_away = 0;
        for i in 0..200 {
            let wo = toward_sphere(i, 200, 0.05);
            let bsdf = Seen::new(material, wo).shaded_by(normal).bsdf();
            seen_away += i32::from(wo.dot(normal) < 0.0);
            for k in 0..50 {
                let wi = toward_sphere(k, 50, 0.05);
                let [diffuse, glossy] = bsdf.eval(wi);
                let wanted = 0.6 * normal.dot(wi).max(0.0) / std::f32::consts::PI;
                let off = (diffuse + glossy - wanted).abs().max_element();
                assert!(off < 1e-5, "{name}, from {wo} lit from {wi}: {diffuse} + {glossy}, not {wanted}");
            }
        }
        assert!(seen_away > 30, "{seen_away} eyes beyond the normal's horizon");
    }
}

/// What is proposed is what there is, whatever normal a surface is smoothed by: means of what samples weigh against integrals over
/// directions that are spread evenly, within 4.5 standard errors of both.
#[test]
fn what_is_proposed_under_a_bent_normal_is_what_there_is() {
    let kinds = glossy_kinds().into_iter().map(|(name, material, _)| (name, material)).chain(layered_kinds());
    let lobes = Lobes { delta: false, ..Lobes::ALL };
    let (mut all, mut compared) = (0, 0);
    for (name, material) in kinds {
        for (normal, wo) in [
            (Vec3::new(0.9, 0.0, 0.436), Vec3::new(-0.6, 0.6, 0.1)),
            (Vec3::new(0.95, 0.0, 0.3), Vec3::new(-0.5, 0.2, 0.4)),
            (Vec3::new(0.4, 0.3, 0.8), Vec3::new(-0.9, -0.3, 0.2)),
        ] {
            let seen = Seen::new(&material, wo).shaded_by(normal);
            let bsdf = seen.bsdf();
            let mut rng = Rng(3);
            let mut groups = [Vec::new(), Vec::new()];
            let mut peak = 0.0f32;
            for _ in 0..128 {
                let [mut proposed, mut there] = [0.0; 2];
                for _ in 0..512 {
                    if let Some(sample) = bsdf.sample(rng.unit(), rng.pair(), lobes) {
                        proposed += f64::from(sample.weight.max_element());
                        let [diffuse, glossy] = bsdf.eval(sample.wi);
                        peak = peak.max((diffuse + glossy).max_element());
                    }
                    let [diffuse, glossy] = bsdf.eval(rng.direction());
                    there += f64::from((diffuse + glossy).max_element()) * 4.0 * std::f64::consts::PI;
                }
                groups[0].push(proposed / 512.0);
                groups[1].push(there / 512.0);
            }
            all += 1;
            // Narrow lobes are met by hardly any direction that does not look for them.
            if peak > 3.0 {
                continue;
            }
            compared += 1;
            let [a, b] = groups.map(|groups| Estimate::of(&groups));
            let (off, error) = ((a.mean - b.mean).abs(), a.sigma.hypot(b.sigma));
            assert!(error < 0.02, "{name} is known to {error} only");
            assert!(
                off < 4.5 * error + 1e-6,
                "{name}, {normal} from {wo}: {} proposed, {} there",
                a.mean,
                b.mean
            );
        }
    }
    assert!(3 * compared > all, "{compared} of {all}");
}

/// The `i`-th of `count` directions above the floor, at least `least` high.
fn toward_sphere(i: u16, count: u16, least: f32) -> Vec3 {
    let z = least + (1.0 - least) * (f32::from(i) + 0.5) / f32::from(count);
    let (sin, cos) = (f32::from(i) * 2.399_963).sin_cos();
    Vec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z
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
