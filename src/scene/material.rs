//! What surfaces are made of.

use super::Layers;
use bevy_ecs::prelude::*;
use glam::{Affine2, Vec3};

/// A surface as a sum of lobes; a lobe whose weight is zero costs nothing.
///
/// Both sides of a triangle reflect. All colours are linear and in 0..=1 unless said otherwise.
#[derive(Component, Clone, Debug, PartialEq)]
pub struct Material {
    /// Base colour: albedo of the Lambert lobe, or specular colour of a metal (see [`Glossy::Ggx`]).
    pub base_color: Vec3,
    /// Multiplies `base_color` (and alpha, if [`Material::alpha`] looks at it).
    pub base_color_texture: Option<TextureUse>,
    /// The glossy lobe.
    pub glossy: Glossy,
    /// What extensions add to [`Glossy::Ggx`].
    pub layers: Option<Box<Layers>>,
    /// Tilts the shading normal.
    pub normal_map: Option<NormalMap>,
    /// Reflectance of a perfect mirror on top (MTL `illum 3`, `5`).
    pub mirror: Vec3,
    /// Perfectly smooth glass body: index of refraction above 1 and a tint of what passes.
    pub glass: Option<Glass>,
    /// Emitted radiance, W/(m² sr), 0 or more without bound, on the front (and back if `double_sided`).
    pub emission: Vec3,
    /// Multiplies `emission`.
    pub emission_texture: Option<TextureUse>,
    /// Coverage.
    pub alpha: Alpha,
    /// Coverage factor in 0..=1, times the base colour texture's alpha.
    pub opacity: f32,
    /// Whether the back emits too. (Reflection is on both sides.)
    pub double_sided: bool,
    /// Whether the eye and mirrors see through its back (glTF without `doubleSided`). Light does not go through.
    pub culled: bool,
    /// Shows its base colour whatever the light (`KHR_materials_unlit`).
    pub unlit: bool,
}

/// The glossy lobe of a [`Material`].
#[derive(Clone, Debug, PartialEq)]
pub enum Glossy {
    /// None: a Lambert surface.
    None,
    /// Normalised Blinn-Phong beside the Lambert lobe: MTL `Ks`, `Ns`.
    BlinnPhong {
        /// Albedo of the lobe at normal incidence.
        specular: Vec3,
        /// Exponent, 0 or more.
        exponent: f32,
        /// Its colour multiplies `specular`, its alpha `exponent`.
        texture: Option<TextureUse>,
    },
    /// glTF metallic-roughness, GGX with Smith masking: glTF 2.0 specification, appendix B.
    Ggx {
        /// 0 = dielectric with a reflectance of 4 % at normal incidence, 1 = metal.
        metallic: f32,
        /// Perceptual roughness in 0..=1; the GGX alpha is its square.
        roughness: f32,
        /// Green multiplies `roughness`, blue `metallic`.
        texture: Option<TextureUse>,
    },
}

/// Glass body of a [`Material`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Index of refraction inside over outside, at least 1.
    pub ior: f32,
    /// Colour of the transmitted light at each crossing.
    pub tint: Vec3,
}

/// How coverage is decided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alpha {
    /// Alpha is ignored.
    Opaque,
    /// There where alpha is at least the cutoff.
    Mask(f32),
    /// There with probability alpha.
    Blend,
}

/// A texture as one property of one material uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureUse {
    /// Entity with a [`super::Texture`]. If it is gone the factor alone counts.
    pub texture: Entity,
    /// `texture_from_mesh` coordinates (`KHR_texture_transform`, MTL `-s -o`).
    pub uv_transform: Affine2,
    /// Whether it lies on the mesh's second set of coordinates ([`super::TriangleMesh::second_uvs`]).
    pub second_uvs: bool,
}

/// A texture of directions in the frame of tangent, bitangent and normal: red, green and blue from 0 to 1
/// are −1 to 1. `T` names the texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap<T = TextureUse> {
    /// The directions; linear.
    pub texture: T,
    /// Multiplies what is along tangent and bitangent.
    pub scale: f32,
}

impl<T> NormalMap<T> {
    /// The same with another name for the texture; without one it is gone.
    pub fn renamed<U>(self, name: impl FnOnce(T) -> Option<U>) -> Option<NormalMap<U>> {
        name(self.texture).map(|texture| NormalMap { texture, scale: self.scale })
    }
}

impl From<Entity> for TextureUse {
    fn from(texture: Entity) -> Self {
        Self { texture, uv_transform: Affine2::IDENTITY, second_uvs: false }
    }
}

impl Default for Material {
    /// Light grey Lambert.
    fn default() -> Self {
        Self {
            base_color: Vec3::splat(0.8),
            base_color_texture: None,
            glossy: Glossy::None,
            layers: None,
            normal_map: None,
            mirror: Vec3::ZERO,
            glass: None,
            emission: Vec3::ZERO,
            emission_texture: None,
            alpha: Alpha::Opaque,
            opacity: 1.0,
            double_sided: false,
            culled: false,
            unlit: false,
        }
    }
}

impl Material {
    /// Lambert of this albedo.
    #[must_use]
    pub fn lambert(albedo: Vec3) -> Self {
        Self { base_color: albedo, ..Self::default() }
    }

    /// Perfect mirror of this reflectance.
    #[must_use]
    pub fn perfect_mirror(reflectance: Vec3) -> Self {
        Self { base_color: Vec3::ZERO, mirror: reflectance, ..Self::default() }
    }

    /// Lambert reflecting nothing, emitting this radiance.
    #[must_use]
    pub fn emissive(radiance: Vec3) -> Self {
        Self { base_color: Vec3::ZERO, emission: radiance, ..Self::default() }
    }
}
