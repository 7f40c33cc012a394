//! What a change redoes, that it resets the film, and what does not.

use super::stage::{Stage, quad, stage};
use bevy_ecs::hierarchy::ChildOf;
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, UVec2, Vec3};
use penumbra::app::{App, FrameBudget, FrameStats};
use penumbra::bvh::Ray;
use penumbra::image::Display;
use penumbra::scene::{
    ActiveCamera, Camera, Filter, Instance, Light, Material, Mesh, Texture, Transform, Visible,
};
use penumbra::sync::Redone;
use penumbra::trace::{Geometry, Integrator, RenderSettings};
use std::sync::Arc;

const NOTHING: Redone = Redone { blas: 0, refits: 0, tlas: 0, surfaces: 0, lights: 0, resets: 0 };

impl Stage {
    /// What the next frame redoes after `change`, and that the frame after it redoes nothing.
    fn redone_by(&mut self, change: impl FnOnce(&mut Self)) -> Redone {
        let count = |app: &App| *app.world.resource::<Redone>();
        let before = count(&self.app);
        change(self);
        self.app.frame();
        let after = count(&self.app);
        self.app.frame();
        assert_eq!(count(&self.app), after, "a second frame has nothing left to do");
        Redone {
            blas: after.blas - before.blas,
            refits: after.refits - before.refits,
            tlas: after.tlas - before.tlas,
            surfaces: after.surfaces - before.surfaces,
            lights: after.lights - before.lights,
            resets: after.resets - before.resets,
        }
    }
}

#[test]
fn the_first_frame_does_each_thing_once() {
    let mut stage = stage();
    let redone = stage.redone_by(|_| ());
    assert_eq!(redone, Redone { blas: 2, refits: 0, tlas: 1, surfaces: 1, lights: 1, resets: 1 });
}

#[test]
fn samples_accumulate_while_nothing_changes() {
    let mut stage = Stage::settled();
    assert_eq!(stage.redone_by(|_| ()), NOTHING);
    assert_eq!(stage.film().complete_samples(), 4);
    assert_eq!(stage.app.world.resource::<FrameStats>().samples_per_pixel, 4.0);
}

#[test]
fn a_changed_mesh_rebuilds_its_own_hierarchy_only() {
    let redone = Stage::settled().redone_by(|s| {
        let mesh = s.floor_mesh;
        Arc::make_mut(&mut s.get_mut::<Mesh>(mesh).0).positions[0].y = 0.1;
    });
    assert_eq!(redone.blas, 1);
    assert_eq!(redone, Redone { blas: 1, refits: redone.refits, tlas: 1, surfaces: 0, lights: 1, resets: 1 });
}

/// What reloading a file that did not change comes to.
#[test]
fn the_same_triangles_are_not_built_over_again() {
    let redone = Stage::settled().redone_by(|s| {
        let (instance, mesh) = (s.floor, s.floor_mesh);
        let again = s.app.world.get::<Mesh>(mesh).unwrap().0.as_ref().clone();
        s.app.world.despawn(mesh);
        let again = s.app.world.spawn(Mesh(Arc::new(again))).id();
        s.get_mut::<Instance>(instance).mesh = again;
    });
    assert_eq!(redone, Redone { tlas: 1, lights: 1, resets: 1, ..NOTHING });
    let redone = Stage::settled().redone_by(|s| {
        let (instance, mesh) = (s.floor, s.floor_mesh);
        let mut other = s.app.world.get::<Mesh>(mesh).unwrap().0.as_ref().clone();
        other.positions[0].x += 1e-3;
        s.app.world.despawn(mesh);
        let other = s.app.world.spawn(Mesh(Arc::new(other))).id();
        s.get_mut::<Instance>(instance).mesh = other;
    });
    assert_eq!(
        redone,
        Redone { blas: 1, tlas: 1, lights: 1, resets: 1, ..NOTHING },
        "one corner is elsewhere"
    );
}

#[test]
fn equal_meshes_of_one_frame_are_built_once() {
    let redone = Stage::settled().redone_by(|s| {
        let [first, second] = [s.floor, s.floating];
        let mesh = || quad(3.0);
        let meshes = [s.app.world.spawn(mesh()).id(), s.app.world.spawn(mesh()).id()];
        s.get_mut::<Instance>(first).mesh = meshes[0];
        s.get_mut::<Instance>(second).mesh = meshes[1];
    });
    assert_eq!(redone.blas, 1);
}

/// A scale of 0 leaves something to be seen, from the side that it has left.
#[test]
fn what_is_flattened_is_there() {
    let mut stage = Stage::settled();
    let floor = stage.floor;
    let there = |stage: &mut Stage, scale: DVec3| {
        stage.redone_by(|s| s.get_mut::<Transform>(floor).0 = DAffine3::from_scale(scale));
        let down = Ray::new(Vec3::new(1.9, 9.0, 1.9), Vec3::NEG_Y);
        stage.app.world.resource::<Geometry>().tlas.closest_hit(&down).map(|hit| hit.t)
    };
    let whole = there(&mut stage, DVec3::ONE);
    assert!(whole.is_some());
    assert_eq!(there(&mut stage, DVec3::new(1.0, 0.0, 1.0)), whole);
    assert_eq!(there(&mut stage, DVec3::X), None, "a line is nothing");
}

#[test]
fn a_moved_mesh_keeps_the_structure_of_its_hierarchy() {
    let redone = Stage::settled().redone_by(|s| {
        let mesh = s.floor_mesh;
        for position in &mut Arc::make_mut(&mut s.get_mut::<Mesh>(mesh).0).positions {
            position.y += 0.1;
        }
    });
    assert_eq!(redone, Redone { blas: 1, refits: 1, tlas: 1, surfaces: 0, lights: 1, resets: 1 });
}

#[test]
fn a_moved_instance_touches_the_top_level_only() {
    let top_level = Redone { blas: 0, refits: 0, tlas: 1, surfaces: 0, lights: 1, resets: 1 };
    let mut stage = Stage::settled();
    let floor = stage.floor;
    assert_eq!(stage.redone_by(|s| s.get_mut::<Transform>(floor).0.translation.y = -0.1), top_level);
    let group = stage.group;
    assert_eq!(
        stage.redone_by(|s| s.get_mut::<Transform>(group).0.translation.x = 0.2),
        top_level,
        "by its parent"
    );
    let floating = stage.floating;
    let world = |s: &mut Stage| {
        s.app.world.entity_mut(floating).remove::<ChildOf>();
    };
    assert_eq!(stage.redone_by(world), top_level, "set free from its parent");
}

#[test]
fn instances_come_and_go_at_the_top_level() {
    let top_level = Redone { blas: 0, refits: 0, tlas: 1, surfaces: 0, lights: 1, resets: 1 };
    let mut stage = Stage::settled();
    let floating = stage.floating;
    assert_eq!(stage.redone_by(|s| assert!(s.app.world.despawn(floating))), top_level);
    let mesh = stage.floor_mesh;
    let spawn = |s: &mut Stage| {
        s.app.world.spawn(Instance { mesh, materials: vec![] });
    };
    assert_eq!(stage.redone_by(spawn), top_level);
    assert_eq!(
        stage.redone_by(|s| assert!(s.app.world.despawn(mesh))),
        top_level,
        "a mesh, with both its instances"
    );
    assert_eq!(stage.app.world.resource::<Geometry>().instances.len(), 0);
}

#[test]
fn a_material_touches_no_geometry() {
    let surfaces = Redone { blas: 0, refits: 0, tlas: 0, surfaces: 1, lights: 1, resets: 1 };
    let mut stage = Stage::settled();
    let (material, texture) = (stage.material, stage.texture);
    assert_eq!(stage.redone_by(|s| s.get_mut::<Material>(material).base_color = Vec3::X), surfaces);
    assert_eq!(stage.redone_by(|s| s.get_mut::<Texture>(texture).filter = Filter::Nearest), surfaces);
    assert_eq!(stage.redone_by(|s| assert!(s.app.world.despawn(texture))), surfaces);
    let redone = stage.redone_by(|s| assert!(s.app.world.despawn(material)));
    assert_eq!((redone.blas, redone.surfaces, redone.resets), (0, 1, 1));
}

#[test]
fn a_light_touches_lights_only() {
    let lights = Redone { blas: 0, refits: 0, tlas: 0, surfaces: 0, lights: 1, resets: 1 };
    let mut stage = Stage::settled();
    let lamp = stage.lamp;
    assert_eq!(stage.redone_by(|s| s.get_mut::<Transform>(lamp).0.translation.y = 2.5), lights);
    let dim = |s: &mut Stage| *s.get_mut::<Light>(lamp) = Light::Point { intensity: Vec3::ONE };
    assert_eq!(stage.redone_by(dim), lights);
    let hide = |s: &mut Stage| {
        s.app.world.entity_mut(lamp).insert(Visible(false));
    };
    assert_eq!(stage.redone_by(hide), lights);
    assert_eq!(stage.redone_by(|s| assert!(s.app.world.despawn(lamp))), lights);
}

#[test]
fn camera_and_settings_only_reset() {
    let reset = Redone { resets: 1, ..NOTHING };
    let mut stage = Stage::settled();
    let camera = stage.camera;
    assert_eq!(stage.redone_by(|s| s.get_mut::<Transform>(camera).0.translation.x = 0.5), reset);
    let settings = |change: fn(&mut RenderSettings)| {
        move |s: &mut Stage| change(&mut s.app.world.resource_mut::<RenderSettings>())
    };
    assert_eq!(stage.redone_by(settings(|r| r.max_depth = 2)), reset);
    assert_eq!(stage.redone_by(settings(|r| r.seed = 2)), reset);
    assert_eq!(stage.redone_by(settings(|r| r.integrator = Integrator::Path)), reset);
    assert_eq!(stage.redone_by(settings(|r| r.filter = Some(Filter::Nearest))), reset);
    assert_eq!(stage.redone_by(settings(|r| r.size = UVec2::new(17, 1))), reset);
    assert_eq!(stage.film().size(), UVec2::new(17, 1));
    let other = |s: &mut Stage| {
        let other = s.app.world.spawn((Camera::default(), Transform::default())).id();
        s.app.world.insert_resource(ActiveCamera(other));
    };
    assert_eq!(stage.redone_by(other), reset);
}

#[test]
fn several_changes_at_once_reset_once() {
    let redone = Stage::settled().redone_by(|s| {
        let (camera, lamp, floor, material) = (s.camera, s.lamp, s.floor, s.material);
        s.get_mut::<Transform>(camera).0.translation.x = 0.5;
        s.get_mut::<Transform>(lamp).0.translation.x = 0.5;
        s.get_mut::<Transform>(floor).0.translation.x = 0.5;
        s.get_mut::<Material>(material).base_color = Vec3::Y;
        s.app.world.resource_mut::<RenderSettings>().seed = 7;
    });
    assert_eq!(redone, Redone { blas: 0, refits: 0, tlas: 1, surfaces: 1, lights: 1, resets: 1 });
}

#[test]
fn nothing_else_resets() {
    let mut stage = Stage::settled();
    let (camera, floor, group) = (stage.camera, stage.floor, stage.group);
    let same_pose = |s: &mut Stage| {
        let pose = *s.app.world.get::<Transform>(camera).unwrap();
        s.get_mut::<Transform>(camera).set_if_neq(pose);
    };
    assert_eq!(stage.redone_by(same_pose), NOTHING);
    let touched = |s: &mut Stage| s.get_mut::<Transform>(group).set_changed();
    assert_eq!(stage.redone_by(touched), NOTHING, "written, but not changed");
    let display = |s: &mut Stage| s.app.world.resource_mut::<Display>().exposure = 2.0;
    assert_eq!(stage.redone_by(display), NOTHING);
    let budget = |s: &mut Stage| s.app.world.resource_mut::<FrameBudget>().sample_target = 900;
    assert_eq!(stage.redone_by(budget), NOTHING);
    let name = |s: &mut Stage| {
        s.app.world.entity_mut(floor).insert(Name::new("floor"));
        s.app.world.spawn(Name::new("nothing to see"));
    };
    assert_eq!(stage.redone_by(name), NOTHING);
    let other_camera = |s: &mut Stage| {
        s.app.world.spawn((Camera::default(), Transform::default()));
    };
    assert_eq!(stage.redone_by(other_camera), NOTHING, "a camera that nobody looks through");
    assert_eq!(stage.film().complete_samples(), 2 + 2 * 6);
}
