//! glTF materials.

use super::Document;
use super::head;
use super::layers::{self, Extensions};
use super::texture::{Textures, uses};
use crate::load::error::LoadError;
use crate::load::report::{Kind, Sink};
use crate::load::settings::Materials;
use crate::scene::{Alpha, Encoding, Glossy, Material, NormalMap};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::Vec3;
use gltf::json;
use gltf::json::material::AlphaMode;
use gltf::json::validation::Checked;
use std::cell::Cell;
use std::collections::HashMap;

/// Material entities of a file.
pub(super) struct Palette {
    /// By index in the file.
    pub(super) materials: Vec<Entity>,
    /// For primitives that name none: without colours of their own, and with.
    default: [Option<Entity>; 2],
    /// Which `TEXCOORD_n` each material wants as first and as second set.
    pub(super) uv_sets: Vec<[u32; 2]>,
    /// Which of them have textures.
    pub(super) textured: Vec<bool>,
}

impl Palette {
    /// The material for primitives without one, spawned when it is first needed: what has colours at its vertices has just these.
    pub(super) fn default_material(&mut self, file: &str, has_colors: bool, sink: &mut Sink<'_>) -> Entity {
        *self.default[usize::from(has_colors)].get_or_insert_with(|| {
            let grey = Material { culled: true, ..Material::default() };
            if has_colors {
                let white = Material { base_color: Vec3::ONE, ..grey };
                return sink.spawn((Name::new("default, coloured"), white));
            }
            sink.decide(file, "surfaces without a material are light grey");
            sink.spawn((Name::new("default"), grey))
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
        let (materials, uv_sets) = (vec![all; count], vec![[0; 2]; count]);
        return Ok(Palette { materials, default: [Some(all); 2], uv_sets, textured: vec![false; count] });
    }
    let mut textures = Textures::new(document, sink)?;
    let mut palette =
        Palette { materials: Vec::new(), default: [None; 2], uv_sets: Vec::new(), textured: Vec::new() };
    let mut named: HashMap<&str, usize> = HashMap::new();
    for name in document.root.materials.iter().filter_map(|material| material.name.as_deref()) {
        *named.entry(name).or_default() += 1;
    }
    for (i, material) in document.root.materials.iter().enumerate() {
        let name = material.name.clone().filter(|name| !name.is_empty());
        let is_shared =
            name.as_ref().is_some_and(|name| named.get(name.as_str()).is_some_and(|&count| count > 1));
        let name = name.unwrap_or_else(|| format!("material {i}"));
        // What several are called says of none which it is.
        let label = if is_shared { format!("{name}` ({i})") } else { format!("{name}`") };
        let sets = uv_sets(document, material, &label, sink);
        palette.uv_sets.push(sets);
        palette.textured.push(!uses(material).is_empty());
        head::tell_unsupported(document.file, material, sink);
        tell_unneeded(document.file, material, sink);
        let entity = match overrides.replacement(&name) {
            Some(entity) => entity,
            None => {
                let component = convert(document, material, &label, sets, &mut textures, sink);
                sink.spawn((Name::new(name), component))
            }
        };
        palette.materials.push(entity);
    }
    Ok(palette)
}

/// Tells of pictures that stand in for what light does here by itself.
fn tell_unneeded(file: &str, material: &json::Material, sink: &mut Sink<'_>) {
    if material.occlusion_texture.is_some() {
        sink.decide(file, "occlusion textures are not needed: light itself finds what is hidden from it");
    }
    let volume = material.extensions.as_ref().and_then(|extensions| extensions.volume.as_ref());
    if volume.is_some_and(|volume| volume.thickness_texture.is_some()) {
        sink.decide(file, "thickness textures are not needed: light goes as far as bodies are thick");
    }
}

/// A mesh has two sets of texture coordinates: the first two that the material's textures ask for.
fn uv_sets(document: &Document<'_>, material: &json::Material, label: &str, sink: &mut Sink<'_>) -> [u32; 2] {
    let uses = uses(material);
    let first = uses.first().map_or(0, |first| first.uv_set);
    let mut others = uses.iter().map(|other| other.uv_set).filter(|&set| set != first);
    let second = others.next().unwrap_or(first);
    if others.any(|set| set != second) {
        let file = document.file;
        let what = format!(
            "textures use more than two TEXCOORD sets; all but TEXCOORD_{first} get TEXCOORD_{second}"
        );
        sink.approximated(file, &format!("material `{label}"), what);
    }
    [first, second]
}

fn convert(
    document: &Document<'_>,
    material: &json::Material,
    label: &str,
    sets: [u32; 2],
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
    let unlit = extensions.unlit.is_some();
    let asked = Extensions::of(material);
    for extension in &asked.odd {
        let what = format!("{extension} is not as specified");
        sink.ignored(document.file, &format!("material `{label}"), what);
    }
    if let Some(ior) = asked.odd_ior() {
        let what = format!("index of refraction {ior}: 1.5 instead");
        sink.repaired(document.file, &format!("material `{label}"), what);
    }
    let mut layers = if unlit { None } else { asked.layers(sets, &unit, textures, sink) };
    let mut roughness_texture = None;
    if let Some(old) = &extensions.pbr_specular_glossiness {
        let [r, g, b, a] = old.diffuse_factor.0.map(unit);
        (base_color, opacity, metallic) = (Vec3::new(r, g, b), a, 0.0);
        (base_texture, rough_texture) = (old.diffuse_texture.as_ref(), None);
        let (reflecting, rough, texture) = layers::of_specular_glossiness(old, sets, &unit, textures, sink);
        layers = Some(reflecting);
        (roughness, roughness_texture) = (rough, texture);
    }
    let strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength.0);
    let is_dark = unlit || material.emissive_texture.as_ref().is_some_and(|info| textures.is_black(info));
    let emission = if is_dark { Vec3::ZERO } else { Vec3::from(material.emissive_factor.0) * strength };
    let passes_light = layers.as_ref().is_some_and(|layers| layers.transmission.is_some());
    if layers.as_ref().and_then(|layers| layers.transmission.as_ref()).is_some_and(|t| t.body.is_none()) {
        let what =
            "transmission without a thickness (KHR_materials_volume): a thin pane, which bends no light"
                .to_owned();
        sink.remark(Kind::Decided, document.file, &format!("material `{label}"), what, 1);
    }
    if material.alpha_mode == Checked::Invalid {
        sink.repaired(document.file, &format!("material `{label}"), "unknown alphaMode, opaque instead");
    }
    let emission_is_legal = emission.is_finite() && emission.min_element() >= 0.0;
    if clamped.get() || !emission_is_legal {
        sink.repaired(document.file, &format!("material `{label}"), "factor out of range, clamped");
    }
    Material {
        base_color,
        base_color_texture: base_texture.and_then(|info| textures.get(info, Encoding::Srgb, sets, sink)),
        glossy: if unlit {
            Glossy::None
        } else {
            let texture = rough_texture
                .and_then(|info| textures.get(info, Encoding::Linear, sets, sink))
                .or(roughness_texture);
            Glossy::Ggx { metallic, roughness, texture }
        },
        layers: layers.map(Box::new),
        normal_map: material.normal_texture.as_ref().filter(|_| !unlit).and_then(|normal| {
            let texture = textures.get(normal, Encoding::Linear, sets, sink)?;
            Some(NormalMap { texture, scale: if normal.scale.is_finite() { normal.scale } else { 1.0 } })
        }),
        mirror: Vec3::ZERO,
        glass: None,
        emission: if emission_is_legal { emission } else { Vec3::ZERO },
        emission_texture: material
            .emissive_texture
            .as_ref()
            .filter(|_| emission != Vec3::ZERO)
            .and_then(|info| textures.get(info, Encoding::Srgb, sets, sink)),
        alpha: match material.alpha_mode {
            // Above 1 nothing is there.
            Checked::Valid(AlphaMode::Mask) => {
                Alpha::Mask(material.alpha_cutoff.unwrap_or_default().0.max(0.0))
            }
            Checked::Valid(AlphaMode::Blend) => Alpha::Blend,
            Checked::Valid(AlphaMode::Opaque) | Checked::Invalid => Alpha::Opaque,
        },
        opacity,
        double_sided: material.double_sided,
        culled: !material.double_sided && !passes_light,
        unlit,
    }
}
