//! The `[material.NAME]` tables.

use super::{Check, Settings};
use crate::load::error::LoadError;
use crate::load::picture::{self, Picture};
use crate::load::report::Sink;
use crate::load::source::IMAGE_LIMIT;
use crate::scene::{Alpha, Encoding, Filter, Glass, Glossy, Material, Texels, Texture, TextureUse, Wrap};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{Affine2, Vec2, Vec3};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Materials of the settings file that replace those of models.
#[derive(Default)]
pub(in crate::load) struct Materials {
    /// By name, and whether a model had one of that name.
    named: BTreeMap<String, (Entity, bool)>,
    /// Replaces every material of the model that is being loaded.
    pub(in crate::load) all: Option<Entity>,
}

impl Materials {
    /// The entity to use instead of the file's material `name`.
    pub(in crate::load) fn replacement(&mut self, name: &str) -> Option<Entity> {
        let (entity, used) = self.named.get_mut(name)?;
        *used = true;
        Some(*entity)
    }

    /// Names that no model uses.
    pub(in crate::load) fn unused(&self) -> Vec<&str> {
        self.named.iter().filter(|(_, (_, used))| !used).map(|(name, _)| name.as_str()).collect()
    }

    /// Adds those of another settings file, which win.
    pub(in crate::load) fn extend(&mut self, others: Self) {
        self.named.extend(others.named);
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialTable {
    base_color: Option<[f32; 3]>,
    base_color_texture: Option<String>,
    filter: Option<FilterName>,
    uv_scale: Option<[f32; 2]>,
    metallic: Option<f32>,
    roughness: Option<f32>,
    specular: Option<[f32; 3]>,
    exponent: Option<f32>,
    mirror: Option<[f32; 3]>,
    glass: Option<GlassTable>,
    emission: Option<[f32; 3]>,
    opacity: Option<f32>,
    double_sided: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GlassTable {
    ior: Option<f32>,
    tint: Option<[f32; 3]>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum FilterName {
    Nearest,
    Bilinear,
}

pub(super) fn spawn_all(settings: &Settings, sink: &mut Sink<'_>) -> Result<Materials, LoadError> {
    let tables = &settings.tables.material;
    let names: Vec<&str> =
        tables.values().filter_map(|table| table.get_ref().base_color_texture.as_deref()).collect();
    let pictures: Vec<Picture<'_>> = names
        .iter()
        .map(|name| Picture {
            label: format!("texture `{name}`"),
            bytes: settings.folder.read_or_neighbour(name, IMAGE_LIMIT),
            strict: false,
            instead: picture::CHECKER,
            deep: false,
        })
        .collect();
    let decoded = picture::decode_all(&settings.file, &pictures, sink).into_iter();
    let texels = decoded.map(|texels| texels.map_or_else(picture::stand_in, |done| done.texels));
    let images: BTreeMap<&str, Arc<Texels>> = names.into_iter().zip(texels).collect();
    let mut materials = Materials::default();
    for (name, table) in tables {
        let mut check = Check::default();
        let mut material = convert(table.get_ref(), &mut check);
        if let Some(problem) = check.problem {
            return Err(settings.broken(table, &format!("[material.{name}]"), problem));
        }
        let texture = table.get_ref().base_color_texture.as_deref().and_then(|name| images.get(name));
        if let Some(texels) = texture {
            material.base_color_texture = Some(spawn_texture(table.get_ref(), name, texels, sink));
        }
        let entity = sink.spawn((Name::new(name.clone()), material));
        materials.named.insert(name.clone(), (entity, false));
    }
    Ok(materials)
}

fn spawn_texture(table: &MaterialTable, name: &str, texels: &Arc<Texels>, sink: &mut Sink<'_>) -> TextureUse {
    let filter = match table.filter {
        Some(FilterName::Nearest) => Filter::Nearest,
        Some(FilterName::Bilinear) | None => Filter::Bilinear,
    };
    let texture =
        Texture { texels: Arc::clone(texels), encoding: Encoding::Srgb, wrap: [Wrap::Repeat; 2], filter };
    let texture = sink.spawn((Name::new(format!("texture of {name}")), texture));
    let scale = table.uv_scale.map_or(Vec2::ONE, Vec2::from);
    TextureUse { texture, uv_transform: Affine2::from_scale(scale), second_uvs: false }
}

fn convert(table: &MaterialTable, check: &mut Check) -> Material {
    let special = table.mirror.is_some() || table.glass.is_some() || table.emission.is_some();
    let grey = if special { 0.0 } else { 0.8 };
    let default = if table.base_color_texture.is_some() { 1.0 } else { grey };
    let is_ggx = table.metallic.is_some() || table.roughness.is_some();
    let is_phong = table.specular.is_some() || table.exponent.is_some();
    check.that(!(is_ggx && is_phong), || {
        "has both metallic or roughness and specular or exponent: choose one pair".to_owned()
    });
    let mut color =
        |key: &str, value: Option<[f32; 3]>, default: f32| check.color(key, value.unwrap_or([default; 3]));
    let base_color = color("base_color", table.base_color, default);
    let specular = color("specular", table.specular, 0.2);
    let mirror = color("mirror", table.mirror, 0.0);
    let tint = color("tint", table.glass.as_ref().and_then(|glass| glass.tint), 1.0);
    let ior = table.glass.as_ref().and_then(|glass| glass.ior).unwrap_or(1.5);
    check.that(ior.is_finite() && ior >= 1.0, || format!("glass: ior must be at least 1, not {ior}"));
    let exponent = table.exponent.unwrap_or(100.0);
    check.that(exponent.is_finite() && exponent >= 0.0, || {
        format!("exponent must be 0 or more, not {exponent}")
    });
    let phong = if is_phong { specular } else { Vec3::ZERO };
    check.that((base_color + mirror + phong).max_element() <= 1.0 + 1e-4, || {
        "base_color, specular and mirror together exceed 1: the surface would create light".to_owned()
    });
    check.that(table.uv_scale.is_none_or(|scale| Vec2::from(scale).is_finite()), || {
        "uv_scale must be finite".to_owned()
    });
    let opacity = check.unit("opacity", table.opacity.unwrap_or(1.0));
    Material {
        base_color,
        base_color_texture: None,
        glossy: if is_phong {
            Glossy::BlinnPhong { specular, exponent, texture: None }
        } else if is_ggx {
            Glossy::Ggx {
                metallic: check.unit("metallic", table.metallic.unwrap_or(0.0)),
                roughness: check.unit("roughness", table.roughness.unwrap_or(0.5)),
                texture: None,
            }
        } else {
            Glossy::None
        },
        layers: None,
        normal_map: None,
        mirror,
        glass: table.glass.as_ref().map(|_| Glass { ior, tint }),
        emission: check.spectrum("emission", table.emission.unwrap_or([0.0; 3])),
        emission_texture: None,
        alpha: if opacity < 1.0 { Alpha::Blend } else { Alpha::Opaque },
        opacity,
        double_sided: table.double_sided.unwrap_or(false),
        culled: false,
        unlit: false,
    }
}
