//! The kinds of surfaces that are judged, each as a point of a floor whose normal is +Z and whose tangent is +X.

use crate::scene::{Anisotropy, Body, Clearcoat, Glossy, Layers, Material, Sheen, Transmission};
use crate::torture::stage::{Stage, settings};
use crate::trace::Integrator;
use crate::trace::bsdf::{Bsdf, Passed};
use crate::trace::scene::Surface;
use crate::trace::surface::Interaction;
use glam::{Vec2, Vec3, Vec4};
use std::sync::Arc;

/// A material seen from one direction.
pub struct Seen {
    stage: Stage,
    surface: Surface,
    at: Interaction,
}

impl Seen {
    /// From outside, toward `wo`.
    #[must_use]
    pub fn new(material: &Material, wo: Vec3) -> Self {
        Self::from_side(material, wo, true)
    }

    /// The floor's normal faces the eye in any case; `front` says whether that is the outside.
    #[must_use]
    pub fn from_side(material: &Material, wo: Vec3, front: bool) -> Self {
        let mut stage = Stage::new(settings(1, 1, Integrator::Path, 1));
        stage.app.build();
        let layers = material.layers.as_ref().map(|layers| Box::new(layers.renamed(|_| None)));
        let has_body = |layers: &Layers<_>| layers.transmission.as_ref().is_some_and(|t| t.body.is_some());
        let body = layers.as_deref().filter(|layers| has_body(layers));
        let passed = body.map(|layers| Arc::new(Passed::new(layers.ior)));
        let material = Material { layers: None, ..material.clone() };
        let surface = Surface { layers, passed, ..Surface::from(material) };
        let at = Interaction {
            position: Vec3::ZERO,
            error: Vec3::ZERO,
            geometric_normal: Vec3::Z,
            normal: Vec3::Z,
            tangent: Vec4::new(1.0, 0.0, 0.0, 1.0),
            wo: wo.normalize(),
            uvs: [Vec2::ZERO; 2],
            color: Vec4::ONE,
            front,
            lifted: None,
        };
        Self { stage, surface, at }
    }

    /// The same where the surface is smoothed: with this normal to shade by.
    #[must_use]
    pub fn shaded_by(mut self, normal: Vec3) -> Self {
        self.at.normal = normal.normalize();
        self
    }

    /// The lobes there.
    #[must_use]
    pub fn bsdf(&self) -> Bsdf {
        Bsdf::new(&self.stage.scene(), &self.surface, &self.at)
    }
}

/// Microfacets.
#[must_use]
pub fn ggx(metallic: f32, roughness: f32) -> Glossy {
    Glossy::Ggx { metallic, roughness, texture: None }
}

/// Metallic-roughness of this albedo with these layers.
#[must_use]
pub fn layered(albedo: f32, metallic: f32, roughness: f32, layers: Layers) -> Material {
    let glossy = ggx(metallic, roughness);
    Material { glossy, layers: Some(Box::new(layers)), ..Material::lambert(Vec3::splat(albedo)) }
}

/// Varnish.
#[must_use]
pub fn coat(roughness: f32) -> Option<Clearcoat> {
    Some(Clearcoat { factor: 1.0, texture: None, roughness, roughness_texture: None, normal_map: None })
}

/// Velvet.
#[must_use]
pub fn sheen(color: f32, roughness: f32) -> Option<Sheen> {
    Some(Sheen { color: Vec3::splat(color), color_texture: None, roughness, roughness_texture: None })
}

/// Strokes.
#[must_use]
pub fn brushed(strength: f32) -> Option<Anisotropy> {
    Some(Anisotropy { strength, rotation: 0.0, texture: None })
}

/// Glass.
#[must_use]
pub fn body(factor: f32) -> Option<Transmission> {
    Some(Transmission { factor, texture: None, body: Some(Body { absorption: Vec3::ZERO }) })
}

/// A thin sheet.
#[must_use]
pub fn pane(factor: f32) -> Option<Transmission> {
    Some(Transmission { factor, texture: None, body: None })
}

/// With the tangent of the typical angle between the normal and the half vector.
#[must_use]
pub fn glossy_kinds() -> Vec<(&'static str, Material, f64)> {
    let phong = |exponent| Glossy::BlinnPhong { specular: Vec3::splat(0.7), exponent, texture: None };
    [
        ("Lambert", Glossy::None, 0.8, 1.0),
        ("GGX of roughness 0.05", ggx(1.0, 0.05), 0.8, 0.0025),
        ("GGX of roughness 0.1", ggx(1.0, 0.1), 0.8, 0.01),
        ("GGX of roughness 0.3", ggx(1.0, 0.3), 0.8, 0.09),
        ("GGX of roughness 1", ggx(1.0, 1.0), 0.8, 1.0),
        ("GGX over Lambert", ggx(0.0, 0.5), 0.5, 0.5),
        ("Blinn-Phong of exponent 1", phong(1.0), 0.0, 1.0),
        ("Blinn-Phong of exponent 50", phong(50.0), 0.0, 0.2),
        ("Blinn-Phong over Lambert", phong(5.0), 0.4, 0.6),
    ]
    .map(|(name, glossy, albedo, width)| {
        (name, Material { glossy, ..Material::lambert(Vec3::splat(albedo)) }, width)
    })
    .to_vec()
}

/// All with lobes wide enough for cells of a sphere.
#[must_use]
pub fn layered_kinds() -> Vec<(&'static str, Material)> {
    let none = Layers::default;
    vec![
        ("varnish over Lambert", layered(0.8, 0.0, 0.6, Layers { clearcoat: coat(0.5), ..none() })),
        ("varnish over metal", layered(0.8, 1.0, 0.8, Layers { clearcoat: coat(0.5), ..none() })),
        ("velvet", layered(0.3, 0.0, 0.9, Layers { sheen: sheen(0.9, 0.5), ..none() })),
        ("brushed metal", layered(0.8, 1.0, 0.4, Layers { anisotropy: brushed(0.8), ..none() })),
        (
            "dielectric of index 2, tinted and weak",
            layered(
                0.5,
                0.0,
                0.4,
                Layers { ior: 2.0, specular: 0.5, specular_color: Vec3::new(1.0, 0.3, 0.1), ..none() },
            ),
        ),
        ("rough glass", layered(1.0, 0.0, 0.5, Layers { transmission: body(1.0), ..none() })),
        (
            "rougher glass of index 1.2",
            layered(0.7, 0.0, 0.8, Layers { transmission: body(1.0), ior: 1.2, ..none() }),
        ),
        ("rough pane", layered(1.0, 0.0, 0.5, Layers { transmission: pane(1.0), ..none() })),
        ("half of it a rough pane", layered(0.6, 0.0, 0.6, Layers { transmission: pane(0.5), ..none() })),
        (
            "all at once",
            layered(
                0.7,
                0.3,
                0.5,
                Layers {
                    clearcoat: coat(0.6),
                    sheen: sheen(0.4, 0.6),
                    anisotropy: brushed(0.5),
                    transmission: body(0.5),
                    ..none()
                },
            ),
        ),
    ]
}
