//! glTF materials.

use super::Document;
use super::texture::{Textures, uses};
use crate::load::error::LoadError;
use crate::load::report::{Kind, Sink};
use crate::load::settings::Materials;
use crate::scene::{Alpha, Encoding, Glass, Glossy, Material};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::Vec3;
use gltf::json;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked;
use std::cell::Cell;

/// Above this, and below [`GLASS_ROUGHNESS`], a transmissive material becomes clear glass.
const GLASS_TRANSMISSION: f32 = 0.5;
const GLASS_ROUGHNESS: f32 = 0.25;

/// Material entities of a file.
pub(super) struct Palette {
    /// By index in the file.
    pub(super) materials: Vec<Entity>,
    /// For primitives that name none.
    default: Option<Entity>,
    /// Which `TEXCOORD_n` each material wants.
    pub(super) uv_sets: Vec<u32>,
}

impl Palette {
    /// The material for primitives without one, spawned when it is first needed.
    pub(super) fn default_material(&mut self, file: &str, sink: &mut Sink<'_>) -> Entity {
        *self.default.get_or_insert_with(|| {
            sink.decide(file, "surfaces without a material are light grey");
            sink.spawn((Name::new("default"), Material::default()))
        })
    }
}

/// Decodes the images that materials use and spawns textures and materials, in file order.
pub(super) fn spawn_all(
    document: &Document<'_>,
    overrides: &mut Materials,
    sink: &mut Sink<'_>,
) -> Result<Palette, LoadError> {
    if let Some(all) = overrides.all {
        let count = document.root.materials.len();
        return Ok(Palette { materials: vec![all; count], default: Some(all), uv_sets: vec![0; count] });
    }
    let mut textures = Textures::new(document, sink)?;
    let mut palette = Palette { materials: Vec::new(), default: None, uv_sets: Vec::new() };
    for (i, material) in document.root.materials.iter().enumerate() {
        let name = material.name.clone().unwrap_or_else(|| format!("material {i}"));
        palette.uv_sets.push(uv_set(document, material, &name, sink));
        let entity = match overrides.replacement(&name) {
            Some(entity) => entity,
            None => {
                let component = convert(document, material, &name, &mut textures, sink);
                sink.spawn((Name::new(name), component))
            }
        };
        palette.materials.push(entity);
    }
    let with_normal_map = document.root.materials.iter().filter(|m| m.normal_texture.is_some()).count();
    if with_normal_map > 0 {
        let what = "normal maps are not supported and ignored".to_owned();
        sink.remark(Kind::Ignored, document.file, "", what, with_normal_map);
    }
    Ok(palette)
}

/// A mesh has one set of texture coordinates: the one that the first texture asks for.
fn uv_set(document: &Document<'_>, material: &json::Material, name: &str, sink: &mut Sink<'_>) -> u32 {
    let uses = uses(material);
    let set = uses.first().map_or(0, |first| first.uv_set);
    if uses.iter().any(|other| other.uv_set != set) {
        let file = document.file;
        let what = format!("textures use several TEXCOORD sets; all get TEXCOORD_{set}");
        sink.approximated(file, &format!("material `{name}`"), what);
    }
    set
}

fn convert(
    document: &Document<'_>,
    material: &json::Material,
    name: &str,
    textures: &mut Textures<'_>,
    sink: &mut Sink<'_>,
) -> Material {
    let pbr = &material.pbr_metallic_roughness;
    let extensions = material.extensions.clone().unwrap_or_default();
    let clamped = Cell::new(false);
    let unit = |value: f32| {
        let inside = if value.is_finite() { value.clamp(0.0, 1.0) } else { 1.0 };
        clamped.set(clamped.get() || inside != value);
        inside
    };
    let [red, green, blue, alpha] = pbr.base_color_factor.0.map(unit);
    let mut base_color = Vec3::new(red, green, blue);
    let mut opacity = alpha;
    let mut metallic = unit(pbr.metallic_factor.0);
    let mut roughness = unit(pbr.roughness_factor.0);
    let mut base_texture = pbr.base_color_texture.as_ref();
    let mut rough_texture = pbr.metallic_roughness_texture.as_ref();
    if let Some(old) = &extensions.pbr_specular_glossiness {
        let [r, g, b, a] = old.diffuse_factor.0.map(unit);
        let specular = Vec3::from(old.specular_factor.0.map(unit));
        let diffuse = Vec3::new(r, g, b);
        // A dielectric reflects about 4 %; what reflects far more than it scatters is a metal.
        let is_metal = old.diffuse_texture.is_none()
            && specular.max_element() > 0.25
            && specular.max_element() > diffuse.max_element();
        base_color = if is_metal { specular } else { diffuse };
        (opacity, metallic, roughness) =
            (a, f32::from(u8::from(is_metal)), 1.0 - unit(old.glossiness_factor.0));
        (base_texture, rough_texture) = (old.diffuse_texture.as_ref(), None);
        let what = "KHR_materials_pbrSpecularGlossiness by metal and roughness";
        sink.approximated(document.file, &format!("material `{name}`"), what);
    }
    let strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength.0);
    let emission = Vec3::from(material.emissive_factor.0) * strength;
    let emission_is_legal = emission.is_finite() && emission.min_element() >= 0.0;
    let transmission = extensions.transmission.as_ref().map_or(0.0, |t| unit(t.transmission_factor.0));
    let is_glass = transmission > GLASS_TRANSMISSION && roughness < GLASS_ROUGHNESS && metallic < 0.5;
    if transmission > 0.0 {
        let becomes = if is_glass { "clear glass" } else { "opaque" };
        let what = format!("transmission of {transmission} at roughness {roughness} shown as {becomes}");
        sink.approximated(document.file, &format!("material `{name}`"), what);
    }
    let ior = extensions.ior.as_ref().map_or(1.5, |ior| ior.ior.0);
    let glass = Glass { ior: if ior.is_finite() && ior >= 1.0 { ior } else { 1.5 }, tint: base_color };
    if clamped.get() || !emission_is_legal {
        sink.repaired(document.file, &format!("material `{name}`"), "factor out of range, clamped");
    }
    let unlit = extensions.unlit.is_some();
    Material {
        base_color: if is_glass { Vec3::ZERO } else { base_color },
        base_color_texture: base_texture
            .filter(|_| !is_glass)
            .and_then(|info| textures.get(info, Encoding::Srgb, sink)),
        glossy: if is_glass || unlit {
            Glossy::None
        } else {
            let texture = rough_texture.and_then(|info| textures.get(info, Encoding::Linear, sink));
            Glossy::Ggx { metallic, roughness, texture }
        },
        mirror: Vec3::ZERO,
        glass: is_glass.then_some(glass),
        emission: if emission_is_legal { emission } else { Vec3::ZERO },
        emission_texture: material
            .emissive_texture
            .as_ref()
            .filter(|_| emission != Vec3::ZERO)
            .and_then(|info| textures.get(info, Encoding::Srgb, sink)),
        alpha: match material.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => Alpha::Mask(unit(material.alpha_cutoff.unwrap_or_default().0)),
            Checked::Valid(AlphaMode::Blend) => Alpha::Blend,
            Checked::Valid(AlphaMode::Opaque) | Checked::Invalid => Alpha::Opaque,
        },
        opacity,
        double_sided: material.double_sided,
        unlit,
    }
}
