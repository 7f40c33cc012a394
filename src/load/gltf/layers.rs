//! Material extensions → [`Layers`].

use super::texture::{Textures, Use};
use crate::load::report::Sink;
use crate::scene::{
    Anisotropy, Body, Clearcoat, Encoding, Layers, NormalMap, Sheen, TextureUse, Transmission,
};
use glam::Vec3;
use gltf::json;
use gltf::json::extensions::material::{Ior, Specular, Transmission as TransmissionTable, Volume};
use gltf::json::material::NormalTexture;
use gltf::json::texture::Info;
use serde::Deserialize;
use serde::de::DeserializeOwned;

/// `KHR_materials_clearcoat`.
#[derive(Clone, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct ClearcoatTable {
    clearcoat_factor: f32,
    clearcoat_texture: Option<Info>,
    clearcoat_roughness_factor: f32,
    clearcoat_roughness_texture: Option<Info>,
    clearcoat_normal_texture: Option<NormalTexture>,
}

/// `KHR_materials_sheen`.
#[derive(Clone, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct SheenTable {
    sheen_color_factor: [f32; 3],
    sheen_color_texture: Option<Info>,
    sheen_roughness_factor: f32,
    sheen_roughness_texture: Option<Info>,
}

/// `KHR_materials_anisotropy`.
#[derive(Clone, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct AnisotropyTable {
    anisotropy_strength: f32,
    anisotropy_rotation: f32,
    anisotropy_texture: Option<Info>,
}

/// The layers that a material's extensions ask for.
#[derive(Default)]
pub(super) struct Extensions {
    ior: Option<Ior>,
    specular: Option<Specular>,
    transmission: Option<TransmissionTable>,
    volume: Option<Volume>,
    clearcoat: Option<ClearcoatTable>,
    sheen: Option<SheenTable>,
    anisotropy: Option<AnisotropyTable>,
    /// Names of those that are not written as they should be.
    pub(super) odd: Vec<&'static str>,
}

impl Extensions {
    pub(super) fn of(material: &json::Material) -> Self {
        let Some(extensions) = &material.extensions else { return Self::default() };
        let mut odd = Vec::new();
        Self {
            ior: extensions.ior.clone(),
            specular: extensions.specular.clone(),
            transmission: extensions.transmission.clone(),
            volume: extensions.volume.clone(),
            clearcoat: table(&extensions.others, "KHR_materials_clearcoat", &mut odd),
            sheen: table(&extensions.others, "KHR_materials_sheen", &mut odd),
            anisotropy: table(&extensions.others, "KHR_materials_anisotropy", &mut odd),
            odd,
        }
    }

    /// An index of refraction that no body has, in place of which there is the usual one.
    pub(super) fn odd_ior(&self) -> Option<f32> {
        let said = self.ior.as_ref()?.ior.0;
        (said != 0.0 && index(said) != said).then_some(said)
    }

    /// All textures that they use.
    pub(super) fn uses(&self) -> Vec<Use> {
        let specular = self.specular.as_ref().map(|s| [&s.specular_texture, &s.specular_color_texture]);
        let coat = self.clearcoat.as_ref().map(|c| [&c.clearcoat_texture, &c.clearcoat_roughness_texture]);
        let sheen = self.sheen.as_ref().map(|s| [&s.sheen_color_texture, &s.sheen_roughness_texture]);
        let pairs = [specular, coat, sheen].into_iter().flatten().flatten();
        let transmission = self.transmission.as_ref().map(|t| &t.transmission_texture);
        let brushed = self.anisotropy.as_ref().map(|a| &a.anisotropy_texture);
        let normal = self.clearcoat.as_ref().and_then(|coat| coat.clearcoat_normal_texture.as_ref());
        pairs
            .chain(transmission)
            .chain(brushed)
            .flatten()
            .map(Use::from)
            .chain(normal.map(Use::from))
            .collect()
    }

    /// The layers, if there are any; `unit` brings factors into 0..=1.
    pub(super) fn layers(
        &self,
        sets: [u32; 2],
        unit: &impl Fn(f32) -> f32,
        textures: &mut Textures<'_>,
        sink: &mut Sink<'_>,
    ) -> Option<Layers> {
        let mut layers = Layers::default();
        let mut texture = |info: &Option<Info>, encoding| -> Option<TextureUse> {
            textures.get(info.as_ref()?, encoding, sets, sink)
        };
        if let Some(ior) = &self.ior {
            layers.ior = index(ior.ior.0);
        }
        if let Some(specular) = &self.specular {
            layers.specular = unit(specular.specular_factor.0);
            layers.specular_texture = texture(&specular.specular_texture, Encoding::Linear);
            // May exceed 1.
            let color = Vec3::from(specular.specular_color_factor.0);
            layers.specular_color = if color.is_finite() { color.max(Vec3::ZERO) } else { Vec3::ONE };
            layers.specular_color_texture = texture(&specular.specular_color_texture, Encoding::Srgb);
        }
        if let Some(table) = self.anisotropy.as_ref().filter(|table| table.anisotropy_strength > 0.0) {
            let rotation = table.anisotropy_rotation;
            layers.anisotropy = Some(Anisotropy {
                strength: unit(table.anisotropy_strength),
                rotation: if rotation.is_finite() { rotation } else { 0.0 },
                texture: texture(&table.anisotropy_texture, Encoding::Linear),
            });
        }
        if let Some(table) = self.sheen.as_ref().filter(|table| table.sheen_color_factor != [0.0; 3]) {
            layers.sheen = Some(Sheen {
                color: Vec3::from(table.sheen_color_factor.map(unit)),
                color_texture: texture(&table.sheen_color_texture, Encoding::Srgb),
                roughness: unit(table.sheen_roughness_factor),
                roughness_texture: texture(&table.sheen_roughness_texture, Encoding::Linear),
            });
        }
        if let Some(table) =
            self.transmission.as_ref().filter(|t| t.transmission_factor.0 > 0.0 && layers.ior.is_finite())
        {
            layers.transmission = Some(Transmission {
                factor: unit(table.transmission_factor.0),
                texture: texture(&table.transmission_texture, Encoding::Linear),
                body: self.volume.as_ref().filter(|volume| volume.thickness_factor.0 > 0.0).map(body),
            });
        }
        if let Some(table) = self.clearcoat.as_ref().filter(|table| table.clearcoat_factor > 0.0) {
            let (coat, rough) = (&table.clearcoat_texture, &table.clearcoat_roughness_texture);
            let (coat, rough) = (texture(coat, Encoding::Linear), texture(rough, Encoding::Linear));
            layers.clearcoat = Some(Clearcoat {
                factor: unit(table.clearcoat_factor),
                texture: coat,
                roughness: unit(table.clearcoat_roughness_factor),
                roughness_texture: rough,
                normal_map: table.clearcoat_normal_texture.as_ref().and_then(|normal| {
                    let texture = textures.get(normal, Encoding::Linear, sets, sink)?;
                    Some(NormalMap {
                        texture,
                        scale: if normal.scale.is_finite() { normal.scale } else { 1.0 },
                    })
                }),
            });
        }
        (layers != Layers::default()).then_some(layers)
    }
}

fn table<T: DeserializeOwned>(
    others: &serde_json::Map<String, serde_json::Value>,
    name: &'static str,
    odd: &mut Vec<&'static str>,
) -> Option<T> {
    let value = others.get(name)?;
    let read = T::deserialize(value).ok();
    if read.is_none() {
        odd.push(name);
    }
    read
}

/// 0 stands for a reflection of all light (`KHR_materials_ior`).
fn index(ior: f32) -> f32 {
    match ior {
        0.0 => f32::INFINITY,
        ior if ior.is_finite() && ior >= 1.0 => ior,
        _ => 1.5,
    }
}

/// Absorption by which white light becomes the attenuation colour after the attenuation distance.
fn body(volume: &Volume) -> Body {
    let distance = volume.attenuation_distance.0;
    if !(distance.is_finite() && distance > 0.0) {
        return Body { absorption: Vec3::ZERO };
    }
    // Black would absorb without bound; this is black enough.
    let left = volume.attenuation_color.0.map(|c| if c.is_finite() { c.clamp(1e-4, 1.0) } else { 1.0 });
    Body { absorption: Vec3::from(left.map(|c| -c.ln() / distance)) }
}

/// `KHR_materials_pbrSpecularGlossiness` as a dielectric of that reflectance: its diffuse colour is the base
/// colour, and roughness is what glossiness lacks to 1.
pub(super) fn of_specular_glossiness(
    old: &json::extensions::material::PbrSpecularGlossiness,
    sets: [u32; 2],
    unit: &impl Fn(f32) -> f32,
    textures: &mut Textures<'_>,
    sink: &mut Sink<'_>,
) -> (Layers, f32, Option<TextureUse>) {
    let glossiness = unit(old.glossiness_factor.0);
    let mut layers = Layers {
        ior: f32::INFINITY,
        specular_color: Vec3::from(old.specular_factor.0.map(unit)),
        ..Layers::default()
    };
    let Some(info) = &old.specular_glossiness_texture else {
        return (layers, 1.0 - glossiness, None);
    };
    layers.specular_color_texture = textures.get(info, Encoding::Srgb, sets, sink);
    let roughness = textures.made(info, glossiness, sets, sink, |[_, _, _, alpha]| {
        let rough = 1.0 - glossiness * f32::from(alpha) / 255.0;
        [255, (rough * 255.0).round() as u8, 255, 255]
    });
    (layers, if roughness.is_some() { 1.0 } else { 1.0 - glossiness }, roughness)
}
