//! A quad on the floor and one above it under a group node, a lamp, and a camera that sees them.

use bevy_ecs::hierarchy::ChildOf;
use bevy_ecs::prelude::*;
use glam::{DVec3, UVec2, Vec2, Vec3};
use penumbra::app::{App, FrameBudget};
use penumbra::scene::{
    ActiveCamera, Camera, Encoding, Filter, Instance, Light, Material, Mesh, Texels, Texture, Transform,
    TriangleMesh, Wrap,
};
use penumbra::trace::{Film, RenderSettings};
use std::sync::Arc;

pub const SIZE: UVec2 = UVec2::new(40, 30);

pub struct Stage {
    pub app: App,
    pub group: Entity,
    pub floor: Entity,
    pub floating: Entity,
    pub floor_mesh: Entity,
    pub material: Entity,
    pub texture: Entity,
    pub lamp: Entity,
    pub camera: Entity,
}

pub fn quad(size: f32) -> Mesh {
    let s = 0.5 * size;
    let corner = |x, z| Vec3::new(x * s, 0.0, z * s);
    Mesh(Arc::new(TriangleMesh {
        positions: vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)],
        uvs: vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    }))
}

pub fn stage() -> Stage {
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
    pub fn settled() -> Self {
        let mut stage = stage();
        stage.app.frame();
        stage.app.frame();
        stage
    }

    pub fn one_frame(mut self) -> Self {
        self.app.frame();
        self
    }

    pub fn film(&self) -> &Film {
        self.app.world.resource::<Film>()
    }

    pub fn get_mut<T: Component<Mutability = bevy_ecs::component::Mutable>>(
        &mut self,
        entity: Entity,
    ) -> Mut<'_, T> {
        self.app.world.get_mut::<T>(entity).unwrap()
    }
}
