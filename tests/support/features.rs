//! The Cornell box, and in it, or behind its back wall where nobody sees it, something that needs more than it does.
#![allow(dead_code, reason = "test and bench use their parts")]

use glam::{DAffine3, DVec3, UVec2, Vec2, Vec3};
use penumbra::app::App;
use penumbra::load::{LoadOptions, SceneSource};
use penumbra::open::{Wishes, open};
use penumbra::scene::{
    Alpha, Encoding, Filter, Instance, Light, Material, Mesh, Texels, Texture, Transform, TriangleMesh, Wrap,
};
use penumbra::trace::Integrator;
use std::sync::Arc;

/// What a scene may need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    Mirror,
    Texture,
    Alpha,
}

pub const NEEDS: [Needs; 3] = [Needs::Mirror, Needs::Texture, Needs::Alpha];

/// The Cornell box as it is.
pub fn cornell(size: u32, integrator: Integrator) -> App {
    let wishes = Wishes {
        size: Some(UVec2::splat(size)),
        integrator: Some(integrator),
        max_depth: Some(4),
        ..Wishes::default()
    };
    open(&SceneSource::BuiltIn("cornell"), &LoadOptions::default(), &wishes).unwrap().app
}

/// With a square of half a metre, seen before the back wall, or unseen behind it.
pub fn cornell_with(needs: Needs, is_seen: bool, size: u32, integrator: Integrator) -> App {
    let mut app = cornell(size, integrator);
    let material = match needs {
        Needs::Mirror => Material { mirror: Vec3::splat(0.8), ..Material::default() },
        Needs::Texture => {
            let texels =
                Texels { width: 2, height: 1, texels: vec![[200, 200, 200, 255], [90, 90, 90, 255]] };
            let texture = Texture {
                texels: Arc::new(texels),
                encoding: Encoding::Srgb,
                wrap: [Wrap::Repeat; 2],
                filter: Filter::Bilinear,
            };
            let texture = app.world.spawn(texture).id();
            Material { base_color_texture: Some(texture.into()), ..Material::default() }
        }
        Needs::Alpha => Material { alpha: Alpha::Blend, opacity: 0.5, ..Material::default() },
    };
    let corner = |x, y| Vec3::new(x, y, 0.0);
    let mesh = TriangleMesh {
        positions: vec![corner(0.0, 0.0), corner(0.0, 500.0), corner(500.0, 500.0), corner(500.0, 0.0)],
        uvs: vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    };
    let mesh = app.world.spawn(Mesh(Arc::new(mesh))).id();
    let material = app.world.spawn(material).id();
    // The back wall is at 559.2 mm; rays that leave the room by its open front never come here.
    let place = DVec3::new(30.0, 30.0, if is_seen { 550.0 } else { 600.0 });
    let place = Transform(DAffine3::from_translation(place));
    app.world.spawn((Instance { mesh, materials: vec![material] }, place));
    app.build();
    app
}

/// With twenty small lamps more.
pub fn cornell_with_lamps(size: u32) -> App {
    let mut app = cornell(size, Integrator::Direct);
    for i in 0..20 {
        let at = DVec3::new(100.0 + 15.0 * f64::from(i), 500.0, 100.0);
        let lamp = Light::Point { intensity: Vec3::splat(1e3) };
        app.world.spawn((lamp, Transform(DAffine3::from_translation(at))));
    }
    app.build();
    app
}
