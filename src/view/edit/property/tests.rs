//! Every number can be set, and stays where it means something.

use super::*;
use crate::scene::Emission;

fn world() -> (World, Vec<Entity>) {
    let mut world = World::new();
    let phong = Glossy::BlinnPhong { specular: Vec3::splat(0.2), exponent: 30.0, texture: None };
    let material = world.spawn(Material { glossy: phong, ..Material::default() }).id();
    let ggx = Glossy::Ggx { metallic: 0.0, roughness: 0.5, texture: None };
    let emission = Vec3::new(2.0, 1.0, 0.5);
    let shiny = world.spawn(Material { glossy: ggx, emission, ..Material::default() }).id();
    let turned = DQuat::from_euler(EulerRot::ZYX, 0.3, 0.2, 0.1);
    let parent =
        world.spawn(Transform::from_parts(DVec3::new(1.0, 2.0, 3.0), turned, DVec3::splat(2.0))).id();
    let instance = |materials| Instance { mesh: parent, materials };
    let one = Vec3::ONE;
    let strength = [one, one * 2.0];
    let lights = [
        Light::Point { intensity: one },
        Light::Spot { intensity: one, inner_angle: 0.1, outer_angle: 0.5 },
        Light::Directional { irradiance: one, angle: 0.1 },
        Light::Segment { half_length: 1.0, strength, emission: Emission::Sine },
        Light::Parallelogram { edge_u: Vec3::X, edge_v: Vec3::Y, radiance: [one; 4], two_sided: false },
        Light::Disk { radius: 1.0, radiance: one, two_sided: false },
        Light::Sphere { radius: 1.0, radiance: one },
        Light::Environment { radiance: one },
    ];
    let mut all = vec![
        world.spawn((instance(vec![material]), ChildOf(parent))).id(),
        world.spawn((instance(vec![shiny]), ChildOf(parent))).id(),
    ];
    all.extend(
        lights.into_iter().map(|light| world.spawn((light, ChildOf(parent))).id()).collect::<Vec<_>>(),
    );
    crate::app::propagate(&mut world);
    (world, all)
}

#[test]
fn a_turn_goes_on_beyond_a_right_angle() {
    let (mut world, all) = world();
    let shown = |world: &World| {
        let rows = rows(world, all[0], 0, 1.0);
        [0, 1, 2].map(|axis| rows.iter().find(|row| row.property == Property::Turn(axis)).unwrap().value)
    };
    for (axis, value) in
        [(0, 0.0), (1, 0.0), (2, 0.0), (1, 85.0), (1, 95.0), (1, 120.0), (1, -170.0), (0, 30.0)]
    {
        set(&mut world, all[0], 0, Property::Turn(axis), value);
        assert!((shown(&world)[axis] - value).abs() < 1e-6, "{value} about {axis}: {:?}", shown(&world));
    }
    assert!((shown(&world)[1] + 170.0).abs() < 1e-6, "{:?}", shown(&world));
}

#[test]
fn angles_of_a_spot_are_limited_by_each_other() {
    let (mut world, all) = world();
    let spot = all[3];
    for (size, value, expected) in [(0, 50.0, 28.65), (1, 100.0, 90.0), (0, 30.0, 30.0), (1, 10.0, 30.0)] {
        let before = rows(&world, spot, 0, 1.0);
        let row = before.iter().find(|row| row.property == Property::Size(size)).unwrap();
        set(&mut world, spot, 0, row.property, f64::clamp(value, row.range[0], row.range[1]));
        let after = rows(&world, spot, 0, 1.0);
        let row = after.iter().find(|row| row.property == Property::Size(size)).unwrap();
        assert!((row.value - expected).abs() < 0.01, "{value}: {}", row.value);
    }
    for size in [1, 0] {
        let right = FRAC_PI_2;
        let light = Light::Spot { intensity: Vec3::ONE, inner_angle: right, outer_angle: right };
        world.entity_mut(spot).insert(light);
        for row in rows(&world, spot, 0, 1.0).iter().filter(|row| row.property == Property::Size(size)) {
            assert!((row.stepped(1.0) - 90.0).abs() < 1e-4 && row.stepped(-1.0) <= 90.0, "{row:?}");
        }
    }
}

/// Objects of one file have their origin where the file has its own.
#[test]
fn what_is_far_from_its_origin_turns_about_its_middle() {
    let triangles = |low: f32| crate::scene::TriangleMesh {
        positions: vec![Vec3::splat(low), Vec3::splat(low) + Vec3::X, Vec3::splat(low + 2.0)],
        ..crate::scene::TriangleMesh::default()
    };
    for (low, stays) in [(10.0, DVec3::splat(11.0)), (-1.0, DVec3::ZERO)] {
        let mut world = World::new();
        let mesh = world.spawn(Mesh(std::sync::Arc::new(triangles(low)))).id();
        let instance = Instance { mesh, materials: Vec::new() };
        let group = world.spawn(Transform::default()).id();
        let thing = world.spawn((instance, ChildOf(group))).id();
        crate::app::propagate(&mut world);
        for entity in [thing, group] {
            for (property, value) in
                [(Property::Turn(1), 45.0), (Property::Scale, 3.0), (Property::Turn(0), 120.0)]
            {
                let before = world.get::<GlobalTransform>(thing).unwrap().0.transform_point3(stays);
                set(&mut world, entity, 0, property, value);
                let after = world.get::<GlobalTransform>(thing).unwrap().0.transform_point3(stays);
                assert!((after - before).length() < 1e-5, "{property:?}: {before} {after}");
            }
        }
    }
}

#[test]
fn what_is_set_is_what_it_is_then_and_nothing_else_changes() {
    let (mut world, all) = world();
    for entity in all {
        for row in rows(&world, entity, 0, 1.0) {
            let before = rows(&world, entity, 0, 1.0);
            let up = row.stepped(1.0);
            let wanted = if up == row.value { row.stepped(-1.0) } else { up };
            assert_ne!(wanted, row.value, "{row:?}");
            set(&mut world, entity, 0, row.property, wanted);
            for (old, new) in before.iter().zip(rows(&world, entity, 0, 1.0)) {
                let coupled = matches!(
                    (row.property, new.property),
                    (Property::LightColor(_), Property::Power | Property::LightColor(_))
                        | (Property::Power, Property::LightColor(_))
                        | (Property::EmissionColor(_), Property::Emission | Property::EmissionColor(_))
                );
                let expected = if old.property == row.property { wanted } else { old.value };
                let off = (new.value - expected).abs();
                assert!(coupled || off < 1e-5 * expected.abs().max(1.0), "{row:?}: {new:?}, not {expected}");
            }
            set(&mut world, entity, 0, row.property, row.value);
        }
    }
}

#[test]
fn values_stay_where_they_mean_something() {
    let (world, all) = world();
    for row in all.iter().flat_map(|&entity| rows(&world, entity, 0, 1.0)) {
        for steps in [-1e9, -1000.0, 1000.0] {
            let value = row.stepped(steps);
            assert!(value >= row.range[0] && value <= row.range[1], "{row:?} {value}");
        }
    }
}

#[test]
fn a_sun_stands_where_a_compass_and_a_protractor_say() {
    let mut world = World::new();
    let parent = world.spawn(Transform::from_parts(DVec3::ONE, DQuat::from_rotation_x(0.7), DVec3::ONE)).id();
    let light = Light::Directional { irradiance: Vec3::ONE, angle: 0.01 };
    let sun = world.spawn((light, Transform::default(), ChildOf(parent))).id();
    crate::app::propagate(&mut world);
    let labels: Vec<&str> = rows(&world, sun, 0, 1.0).iter().map(|row| row.label).collect();
    assert_eq!(labels[..3], ["azimuth", "elevation", "strength"]);
    let shines = |world: &World| -world.get::<GlobalTransform>(sun).unwrap().0.matrix3.z_axis;
    let half = 0.5_f64.sqrt();
    for (azimuth, elevation, along) in [
        (0.0, 0.0, DVec3::Z),
        (90.0, 0.0, DVec3::NEG_X),
        (180.0, 45.0, DVec3::new(0.0, -half, -half)),
        (270.0, -90.0, DVec3::Y),
        (270.0, 90.0, DVec3::NEG_Y),
        (270.0, 0.0, DVec3::X),
    ] {
        set(&mut world, sun, 0, Property::Azimuth, azimuth);
        set(&mut world, sun, 0, Property::Elevation, elevation);
        assert!((shines(&world) - along).length() < 1e-9, "{azimuth} {elevation}: {}", shines(&world));
    }
    // From the zenith it comes down on the side that it went up.
    set(&mut world, sun, 0, Property::Elevation, 90.0);
    set(&mut world, sun, 0, Property::Elevation, 10.0);
    assert!((stands(&world.get::<GlobalTransform>(sun).unwrap().0)[0] - 270.0).abs() < 1e-6);
}
