//! The rules of change: what is redone, what resets the film, and what does not.

use bevy_ecs::hierarchy::ChildOf;
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use bevy_ecs::schedule::{LogLevel, ScheduleBuildSettings};
use glam::{DAffine3, DVec3, UVec2, Vec2, Vec3};
use penumbra::app::{App, Frame, FrameBudget, FrameStats};
use penumbra::bvh::Ray;
use penumbra::image::{Display, Picture};
use penumbra::scene::{
    ActiveCamera, Camera, Encoding, Filter, Instance, Light, Material, Mesh, Texels, Texture, Transform,
    TriangleMesh, Visible, Wrap,
};
use penumbra::sync::Redone;
use penumbra::trace::explain::{Kind, explain};
use penumbra::trace::{Film, Geometry, Integrator, RenderSettings};
use std::sync::Arc;

const SIZE: UVec2 = UVec2::new(40, 30);

/// A quad on the floor and one above it under a group node, a lamp, and a camera that sees them.
struct Stage {
    app: App,
    group: Entity,
    floor: Entity,
    floating: Entity,
    floor_mesh: Entity,
    material: Entity,
    texture: Entity,
    lamp: Entity,
    camera: Entity,
}

fn quad(size: f32) -> Mesh {
    let s = 0.5 * size;
    let corner = |x, z| Vec3::new(x * s, 0.0, z * s);
    Mesh(Arc::new(TriangleMesh {
        positions: vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)],
        uvs: vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }))
}

fn stage() -> Stage {
    let mut app = App::new(RenderSettings { size: SIZE, ..RenderSettings::default() });
    let world = &mut app.world;
    let floor_mesh = world.spawn(quad(4.0)).id();
    let small_mesh = world.spawn(quad(1.0)).id();
    let texels = Texels { width: 2, height: 1, texels: vec![[200, 200, 200, 255], [90, 90, 90, 255]] };
    let texture = Texture {
        texels: Arc::new(texels),
        encoding: Encoding::Srgb,
        wrap: [Wrap::Repeat; 2],
        filter: Filter::Bilinear,
    };
    let texture = world.spawn(texture).id();
    let textured = Material { base_color_texture: Some(texture.into()), ..Material::default() };
    let material = world.spawn(textured).id();
    let floor = world.spawn(Instance { mesh: floor_mesh, materials: vec![material] }).id();
    let group = world.spawn(Transform::from_translation(DVec3::new(0.0, 0.5, 0.0))).id();
    let floating = world
        .spawn((Instance { mesh: small_mesh, materials: vec![] }, Transform::default(), ChildOf(group)))
        .id();
    let lamp = Light::Parallelogram {
        edge_u: Vec3::X,
        edge_v: Vec3::Z,
        radiance: [Vec3::splat(10.0); 4],
        two_sided: false,
    };
    let lamp = world.spawn((lamp, Transform::from_translation(DVec3::new(0.0, 3.0, 0.0)))).id();
    let pose = Transform::looking_at(DVec3::new(0.0, 2.0, 4.0), DVec3::ZERO, DVec3::Y);
    let camera = world.spawn((Camera::default(), pose)).id();
    world.insert_resource(ActiveCamera(camera));
    world.insert_resource(FrameBudget { sample_target: 1000, ..FrameBudget::default() });
    Stage { app, group, floor, floating, floor_mesh, material, texture, lamp, camera }
}

impl Stage {
    fn settled() -> Self {
        let mut stage = stage();
        stage.app.frame();
        stage.app.frame();
        stage
    }

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

    fn film(&self) -> &Film {
        self.app.world.resource::<Film>()
    }

    fn get_mut<T: Component<Mutability = bevy_ecs::component::Mutable>>(
        &mut self,
        entity: Entity,
    ) -> Mut<'_, T> {
        self.app.world.get_mut::<T>(entity).unwrap()
    }
}

const NOTHING: Redone = Redone { blas: 0, refits: 0, tlas: 0, surfaces: 0, lights: 0, resets: 0 };

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

#[test]
fn a_despawned_entity_disappears_from_the_picture() {
    let mut stage = Stage::settled();
    let group = stage.group;
    // With its children.
    assert!(stage.app.world.despawn(group));
    stage.app.frame();
    let mut fresh = self::stage();
    let group = fresh.group;
    assert!(fresh.app.world.despawn(group));
    fresh.app.frame();
    assert_eq!(stage.film(), fresh.film());
    assert_ne!(stage.film(), { self::stage() }.one_frame().film());
}

impl Stage {
    fn one_frame(mut self) -> Self {
        self.app.frame();
        self
    }
}

#[test]
fn a_picture_after_edits_equals_that_of_a_fresh_world() {
    let mut edited = Stage::settled();
    let (lamp, floor, material, floating) = (edited.lamp, edited.floor, edited.material, edited.floating);
    let edit = |s: &mut Stage| {
        s.get_mut::<Transform>(lamp).0.translation = DVec3::new(0.5, 2.0, 0.1);
        s.get_mut::<Transform>(floor).0.translation.y = -0.25;
        s.get_mut::<Material>(material).base_color = Vec3::new(0.2, 0.5, 0.7);
        assert!(s.app.world.despawn(floating));
    };
    edit(&mut edited);
    edited.app.frame();
    let mut fresh = stage();
    edit(&mut fresh);
    assert_eq!(edited.film(), fresh.one_frame().film());
}

#[test]
fn no_two_systems_race() {
    let mut stage = stage();
    stage.app.world.schedule_scope(Frame, |world, schedule| {
        schedule.set_build_settings(ScheduleBuildSettings {
            ambiguity_detection: LogLevel::Error,
            ..ScheduleBuildSettings::default()
        });
        schedule.initialize(world).unwrap();
    });
}

#[test]
fn the_target_ends_the_work_and_a_higher_one_continues_it() {
    let mut stage = stage();
    stage.app.world.resource_mut::<FrameBudget>().sample_target = 3;
    for _ in 0..5 {
        stage.app.frame();
    }
    assert_eq!(stage.film().complete_samples(), 3);
    assert!(stage.app.world.resource::<FrameStats>().done);
    stage.app.world.resource_mut::<FrameBudget>().sample_target = 4;
    stage.app.frame();
    assert_eq!(stage.film().complete_samples(), 4);
}

#[test]
fn a_watched_frame_shows_a_whole_picture_even_if_interrupted_at_once() {
    let mut stage = stage();
    {
        let mut budget = stage.app.world.resource_mut::<FrameBudget>();
        budget.preview = true;
        budget.develop = true;
        budget.time = Some(std::time::Duration::ZERO);
        budget.interrupt.store(true, std::sync::atomic::Ordering::Relaxed);
    }
    stage.app.frame();
    let picture = stage.app.world.resource::<Picture>();
    assert_eq!((picture.size, picture.version), (SIZE, 1));
    let lit = picture.rgba.chunks_exact(4).filter(|p| p[0] > 30).count();
    assert!(lit > 200, "the floor is in the picture: {lit} lit pixels");
    stage.app.frame();
    assert_eq!(stage.app.world.resource::<Picture>().version, 1, "nothing new, nothing developed");
}

#[test]
fn empty_worlds_and_dark_scenes_are_pictures_too() {
    let mut empty = App::new(RenderSettings { size: UVec2::ONE, ..RenderSettings::default() });
    empty.frame();
    assert_eq!(empty.world.resource::<Film>().pixel(0, 0).mean(), DVec3::ZERO);
    let mut stage = stage();
    let lamp = stage.lamp;
    assert!(stage.app.world.despawn(lamp));
    stage.app.frame();
    assert_eq!(stage.film().pixel(20, 15).mean(), DVec3::ZERO);
}

#[test]
fn an_explanation_adds_up_to_the_picture() {
    let mut stage = stage();
    stage
        .app
        .world
        .spawn((Light::Point { intensity: Vec3::ONE }, Transform::from_translation(DVec3::Y * 2.0)));
    {
        let mut budget = stage.app.world.resource_mut::<FrameBudget>();
        (budget.sample_target, budget.pass_samples) = (64, 64);
    }
    stage.app.frame();
    let scene = penumbra::sync::traceable(&stage.app.world);
    let (mut lit, mut blocked) = (0, 0);
    let (mut told_sum, mut film_sum, mut variance) = (0.0, 0.0, 0.0);
    for (x, y) in (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| (x, y))) {
        let told = explain(&scene, UVec2::new(x, y), 0..64, 10.0);
        assert_eq!(told.radiance.len(), 64);
        let reds: Vec<f64> = told.radiance.iter().map(|r| f64::from(r.x)).collect();
        let mean = reds.iter().sum::<f64>() / 64.0;
        variance += reds.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / 64.0 / 63.0;
        told_sum += mean;
        film_sum += stage.film().pixel(x, y).mean().x;
        let brought: f32 = told.lights.iter().map(|row| row.contribution).sum();
        let all = told.radiance.iter().map(|&r| penumbra::scene::color::luminance(r)).sum::<f32>() / 64.0;
        assert!((brought - all).abs() <= 1e-4 * all, "{x} {y}: {brought} of {all}");
        for row in &told.lights {
            assert!(row.lit + row.dark <= row.samples, "{row:?}");
            assert!(row.lit == 0 || row.contribution > 0.0, "{row:?}");
        }
        let count = |kind| told.segments.iter().filter(|s| s.kind == kind).count();
        assert_eq!(count(Kind::Camera), 64);
        assert_eq!(count(Kind::Lit), told.lights.iter().map(|row| row.lit as usize).sum::<usize>());
        (lit, blocked) = (lit + count(Kind::Lit), blocked + count(Kind::Shadow));
    }
    assert!(lit > 1000 && blocked > 30, "the quad throws a shadow: {lit} {blocked}");
    // No lamp is in view, so all light is that of the samples. The film's share of the noise is smaller still.
    let off = (told_sum - film_sum).abs() / (2.0 * variance).sqrt();
    assert!(off < 4.0, "{told_sum} told, {film_sum} in the film: {off} standard errors");
}
