//! What glTF extensions add to metallic-roughness.

use super::{NormalMap, TextureUse};
use glam::Vec3;

/// Layers and refinements of [`super::Glossy::Ggx`]; one that is absent costs nothing. `T` names a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers<T = TextureUse> {
    /// Index of refraction of the dielectric, at least 1 (`KHR_materials_ior`); infinity: it reflects all of
    /// `specular_color` at normal incidence.
    pub ior: f32,
    /// How strong the dielectric's reflection is, in 0..=1 (`KHR_materials_specular`).
    pub specular: f32,
    /// Its alpha multiplies `specular`.
    pub specular_texture: Option<T>,
    /// Colour of the dielectric's reflection at normal incidence; may exceed 1, the reflectance does not.
    pub specular_color: Vec3,
    /// Multiplies `specular_color`.
    pub specular_color_texture: Option<T>,
    /// Brushed surfaces.
    pub anisotropy: Option<Anisotropy<T>>,
    /// A varnish on top of all.
    pub clearcoat: Option<Clearcoat<T>>,
    /// Fibres that stand up, below the varnish.
    pub sheen: Option<Sheen<T>>,
    /// What is let through instead of scattered.
    pub transmission: Option<Transmission<T>>,
}

/// `KHR_materials_anisotropy`.
#[derive(Clone, Debug, PartialEq)]
pub struct Anisotropy<T = TextureUse> {
    /// 0 = as rough in all directions; 1 = along the direction, alpha is 1.
    pub strength: f32,
    /// Radians from the tangent toward the bitangent.
    pub rotation: f32,
    /// Red and green: the direction, as in a normal map; blue multiplies `strength`.
    pub texture: Option<T>,
}

/// `KHR_materials_clearcoat`: of an index of refraction of 1.5.
#[derive(Clone, Debug, PartialEq)]
pub struct Clearcoat<T = TextureUse> {
    /// How much of the surface has it, in 0..=1.
    pub factor: f32,
    /// Its red multiplies `factor`.
    pub texture: Option<T>,
    /// Perceptual roughness, in 0..=1.
    pub roughness: f32,
    /// Its green multiplies `roughness`.
    pub roughness_texture: Option<T>,
    /// Its own; without one the coat is smooth whatever lies below.
    pub normal_map: Option<NormalMap<T>>,
}

/// `KHR_materials_sheen`.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheen<T = TextureUse> {
    /// Colour, in 0..=1.
    pub color: Vec3,
    /// Multiplies `color`.
    pub color_texture: Option<T>,
    /// Perceptual roughness, in 0..=1.
    pub roughness: f32,
    /// Its alpha multiplies `roughness`.
    pub roughness_texture: Option<T>,
}

/// `KHR_materials_transmission` and `_volume`; what passes is tinted by the base colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Transmission<T = TextureUse> {
    /// Share that is let through instead of scattered, in 0..=1.
    pub factor: f32,
    /// Its red multiplies `factor`.
    pub texture: Option<T>,
    /// The body behind the surface; `None`: it is a thin pane, behind which the outside begins again.
    pub body: Option<Body>,
}

/// What light crosses inside a transmitting body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Absorption coefficient, 1 over scene unit of the body, 0 or more.
    pub absorption: Vec3,
}

impl<T> Default for Layers<T> {
    /// Changes nothing.
    fn default() -> Self {
        Self {
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            anisotropy: None,
            clearcoat: None,
            sheen: None,
            transmission: None,
        }
    }
}

impl<T: Copy> Layers<T> {
    /// The same with other names for the textures; one without a name is gone.
    pub fn renamed<U>(&self, name: impl Fn(T) -> Option<U>) -> Layers<U> {
        let name = |texture: Option<T>| texture.and_then(&name);
        Layers {
            ior: self.ior,
            specular: self.specular,
            specular_texture: name(self.specular_texture),
            specular_color: self.specular_color,
            specular_color_texture: name(self.specular_color_texture),
            anisotropy: self.anisotropy.as_ref().map(|a| Anisotropy {
                strength: a.strength,
                rotation: a.rotation,
                texture: name(a.texture),
            }),
            clearcoat: self.clearcoat.as_ref().map(|coat| Clearcoat {
                factor: coat.factor,
                texture: name(coat.texture),
                roughness: coat.roughness,
                roughness_texture: name(coat.roughness_texture),
                normal_map: coat.normal_map.and_then(|map| map.renamed(|texture| name(Some(texture)))),
            }),
            sheen: self.sheen.as_ref().map(|sheen| Sheen {
                color: sheen.color,
                color_texture: name(sheen.color_texture),
                roughness: sheen.roughness,
                roughness_texture: name(sheen.roughness_texture),
            }),
            transmission: self.transmission.as_ref().map(|t| Transmission {
                factor: t.factor,
                texture: name(t.texture),
                body: t.body,
            }),
        }
    }
}
