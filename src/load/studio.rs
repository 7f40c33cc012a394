//! The environment of a scene that has no light.

use crate::scene::{Glossy, Instance, Light, Material, Sky};
use bevy_ecs::prelude::*;
use glam::Vec3;
use std::f32::consts::PI;

/// Rows of the graded sky: in a mirror none is to be seen as such.
const ROWS: usize = 512;
/// How much brighter it is straight above than at the horizon, as a share of that; so much darker it is straight below.
const GRADE: f32 = 0.75;
/// Metals this rough or rougher show no picture of what is around them.
const BLURRED: f32 = 0.4;

/// The same radiance from all sides or, where mirrors, smooth metals and glass would show nothing else, one that grows with height
/// and has the same mean.
pub(super) fn environment(world: &mut World, radiance: f32) -> Light {
    let graded = if has_mirrors(world) { graded() } else { None };
    match graded {
        Some(sky) => Light::Sky { sky, scale: Vec3::splat(radiance) },
        None => Light::Environment { radiance: Vec3::splat(radiance) },
    }
}

fn graded() -> Option<Sky> {
    let row = |i: usize| {
        let height = (PI * (i as f32 + 0.5) / ROWS as f32).cos();
        Vec3::splat(1.0 + GRADE * height)
    };
    Sky::new(1, (0..ROWS).map(row).collect())
}

/// Whether what is shown has a surface in which, or through which, one sees what is around it.
fn has_mirrors(world: &mut World) -> bool {
    let is_mirror = |material: &Material| {
        let is_smooth_metal = matches!(material.glossy, Glossy::Ggx { metallic, roughness, .. } if metallic > 0.5 && roughness < BLURRED);
        let is_clear =
            material.glass.is_some() || material.layers.as_ref().is_some_and(|l| l.transmission.is_some());
        material.mirror != Vec3::ZERO || !material.unlit && (is_smooth_metal || is_clear)
    };
    let instances = world.query::<&Instance>();
    let mut materials = instances.iter_manual(world).flat_map(|instance| &instance.materials);
    materials.any(|&material| world.get::<Material>(material).is_some_and(is_mirror))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Glass;

    #[test]
    fn the_graded_sky_is_as_bright_as_the_even_one_and_brighter_above() {
        let sky = graded().unwrap();
        let rows = sky.radiance();
        let share = |i: usize| (PI * (i as f32 + 0.5) / ROWS as f32).sin();
        let sum: f32 = rows.iter().enumerate().map(|(i, radiance)| radiance.x * share(i)).sum();
        let mean = sum / (0..ROWS).map(share).sum::<f32>();
        assert!((mean - 1.0).abs() < 1e-4, "{mean}");
        assert!(rows.windows(2).all(|pair| pair[0].x > pair[1].x && pair[1].x > 0.0));
    }

    #[test]
    fn only_scenes_with_mirrors_have_it() {
        let with = |material: Material| {
            let mut world = World::new();
            let material = world.spawn(material).id();
            world.spawn(Instance { mesh: material, materials: vec![material] });
            matches!(environment(&mut world, 0.25), Light::Sky { .. })
        };
        let metal = |roughness| Glossy::Ggx { metallic: 1.0, roughness, texture: None };
        assert!(with(Material { mirror: Vec3::splat(0.1), ..Material::default() }));
        assert!(with(Material { glossy: metal(0.1), ..Material::default() }));
        assert!(with(Material { glass: Some(Glass { ior: 1.5, tint: Vec3::ONE }), ..Material::default() }));
        assert!(!with(Material { glossy: metal(0.9), ..Material::default() }));
        assert!(!with(Material { glossy: metal(0.1), unlit: true, ..Material::default() }));
        assert!(!with(Material::default()));
    }
}
