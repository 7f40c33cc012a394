//! glTF materials, textures and images.

use super::{Document, buffer};
use crate::load::error::{LoadError, ReadError};
use crate::load::picture::{self, Picture};
use crate::load::report::Sink;
use crate::load::settings::Materials;
use crate::load::source::IMAGE_LIMIT;
use crate::scene::{Alpha, Encoding, Filter, Glass, Glossy, Material, Texels, Texture, TextureUse, Wrap};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{Affine2, Vec2, Vec3};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::AlphaMode;
use gltf::json::texture::{Info, MagFilter, MinFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};
use std::borrow::Cow;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::Arc;

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
            sink.decide(format!("{file}: surfaces without a material are light grey"));
            sink.spawn((Name::new("default"), Material::default()))
        })
    }
}

/// One use of a texture by a material.
struct Use<'a> {
    index: &'a Index<json::Texture>,
    transform: Option<&'a TextureTransform>,
    uv_set: u32,
}

impl<'a> From<&'a Info> for Use<'a> {
    fn from(info: &'a Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        let uv_set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
        Self { index: &info.index, transform, uv_set }
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
        sink.warn(format!("{}: normal maps are not supported and ignored ({with_normal_map} materials)", document.file));
    }
    Ok(palette)
}

/// The texture uses of a material that end up in the picture.
fn uses(material: &json::Material) -> Vec<Use<'_>> {
    let pbr = &material.pbr_metallic_roughness;
    let old = material.extensions.as_ref().and_then(|e| e.pbr_specular_glossiness.as_ref());
    let base = old.map_or(pbr.base_color_texture.as_ref(), |old| old.diffuse_texture.as_ref());
    let rough = if old.is_some() { None } else { pbr.metallic_roughness_texture.as_ref() };
    [base, rough, material.emissive_texture.as_ref()].into_iter().flatten().map(Use::from).collect()
}

/// A mesh has one set of texture coordinates: the one that the first texture asks for.
fn uv_set(document: &Document<'_>, material: &json::Material, name: &str, sink: &mut Sink<'_>) -> u32 {
    let uses = uses(material);
    let set = uses.first().map_or(0, |first| first.uv_set);
    if uses.iter().any(|other| other.uv_set != set) {
        let file = document.file;
        sink.warn(format!("{file}: material `{name}`: its textures use several TEXCOORD sets; all get TEXCOORD_{set}"));
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
        let is_metal = old.diffuse_texture.is_none() && specular.max_element() > 0.25 && specular.max_element() > diffuse.max_element();
        base_color = if is_metal { specular } else { diffuse };
        (opacity, metallic, roughness) = (a, f32::from(u8::from(is_metal)), 1.0 - unit(old.glossiness_factor.0));
        (base_texture, rough_texture) = (old.diffuse_texture.as_ref(), None);
        sink.warn(format!("{}: KHR_materials_pbrSpecularGlossiness is approximated by metal and roughness", document.file));
    }
    let strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength.0);
    let emission = Vec3::from(material.emissive_factor.0) * strength;
    let emission_is_legal = emission.is_finite() && emission.min_element() >= 0.0;
    let transmission = extensions.transmission.as_ref().map_or(0.0, |t| unit(t.transmission_factor.0));
    let is_glass = transmission > GLASS_TRANSMISSION && roughness < GLASS_ROUGHNESS && metallic < 0.5;
    if transmission > 0.0 {
        let becomes = if is_glass { "clear glass" } else { "opaque" };
        sink.decide(format!("{}: material `{name}` transmits {transmission} at roughness {roughness}: shown as {becomes}", document.file));
    }
    let ior = extensions.ior.as_ref().map_or(1.5, |ior| ior.ior.0);
    let glass = Glass { ior: if ior.is_finite() && ior >= 1.0 { ior } else { 1.5 }, tint: base_color };
    if clamped.get() || !emission_is_legal {
        sink.warn(format!("{}: material `{name}`: factor out of range, clamped", document.file));
    }
    let unlit = extensions.unlit.is_some();
    Material {
        base_color: if is_glass { Vec3::ZERO } else { base_color },
        base_color_texture: base_texture.filter(|_| !is_glass).and_then(|info| textures.get(info, Encoding::Srgb, sink)),
        glossy: if is_glass || unlit {
            Glossy::None
        } else {
            let texture = rough_texture.and_then(|info| textures.get(info, Encoding::Linear, sink));
            Glossy::Ggx { metallic, roughness, texture }
        },
        mirror: Vec3::ZERO,
        glass: is_glass.then_some(glass),
        emission: if emission_is_legal { emission } else { Vec3::ZERO },
        emission_texture: material.emissive_texture.as_ref().filter(|_| emission != Vec3::ZERO).and_then(|info| textures.get(info, Encoding::Srgb, sink)),
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

/// Texture entities, spawned on first use; images are decoded before.
struct Textures<'a> {
    document: &'a Document<'a>,
    images: BTreeMap<usize, Arc<Texels>>,
    spawned: BTreeMap<(usize, bool), Entity>,
}

impl<'a> Textures<'a> {
    fn new(document: &'a Document<'a>, sink: &mut Sink<'_>) -> Result<Self, LoadError> {
        let root = &document.root;
        let mut wanted: BTreeMap<usize, Picture<'_>> = BTreeMap::new();
        for (i, material) in root.materials.iter().enumerate() {
            for used in uses(material) {
                let user = format!("material {i}");
                let texture = document.at(&root.textures, used.index, "texture", &user)?;
                let Some(source) = source_of(texture) else {
                    sink.warn(format!("{}: texture {} has no image source: white", document.file, used.index.value()));
                    continue;
                };
                let user = format!("texture {}", used.index.value());
                let image = document.at(&root.images, &Index::new(source as u32), "image", &user)?;
                wanted.entry(source).or_insert_with(|| picture_of(document, source, image));
            }
        }
        let (indices, pictures): (Vec<usize>, Vec<Picture<'_>>) = wanted.into_iter().unzip();
        let texels = picture::decode_all(document.file, &pictures, sink);
        Ok(Self { document, images: indices.into_iter().zip(texels).collect(), spawned: BTreeMap::new() })
    }

    fn get(&mut self, info: &Info, encoding: Encoding, sink: &mut Sink<'_>) -> Option<TextureUse> {
        let used = Use::from(info);
        let index = used.index.value();
        let texture = self.document.root.textures.get(index)?;
        let texels = self.images.get(&source_of(texture)?)?;
        let entity = *self.spawned.entry((index, encoding == Encoding::Srgb)).or_insert_with(|| {
            let (wrap, filter) = sampling(self.document, texture, index, sink);
            let name = texture.name.clone().unwrap_or_else(|| format!("texture {index}"));
            sink.spawn((Name::new(name), Texture { texels: Arc::clone(texels), encoding, wrap, filter }))
        });
        Some(TextureUse { texture: entity, uv_transform: used.transform.map_or(Affine2::IDENTITY, uv_transform) })
    }
}

/// The image of a texture: the core one, else that of an extension.
fn source_of(texture: &json::Texture) -> Option<usize> {
    let others = texture.extensions.as_ref().map(|extensions| &extensions.others);
    let extension = |name: &str| {
        let source = others?.get(name)?.get("source")?.as_u64()?;
        u32::try_from(source).ok().map(|source| source as usize)
    };
    let core = Some(texture.source.value()).filter(|&source| source != u32::MAX as usize);
    core.or_else(|| extension("EXT_texture_webp")).or_else(|| extension("KHR_texture_basisu"))
}

fn picture_of<'d>(document: &'d Document<'_>, index: usize, image: &json::Image) -> Picture<'d> {
    let mut label = format!("image {index}");
    let bytes = match (&image.uri, &image.buffer_view) {
        (Some(uri), _) => {
            label = format!("image {index} ({})", buffer::shorten(uri));
            buffer::read_uri(document.folder, uri, IMAGE_LIMIT)
        }
        (None, Some(view)) => {
            document.view(view, &label).map(|(bytes, _)| Cow::Borrowed(bytes)).map_err(|_| ReadError::Data("lies outside its buffer"))
        }
        (None, None) => Err(ReadError::Data("has neither a URI nor a buffer view")),
    };
    Picture { label, bytes, strict: true }
}

fn sampling(document: &Document<'_>, texture: &json::Texture, index: usize, sink: &mut Sink<'_>) -> ([Wrap; 2], Filter) {
    let Some(sampler) = texture.sampler.as_ref() else {
        return Default::default();
    };
    let Some(Sampler { wrap_s, wrap_t, mag_filter, min_filter, .. }) = document.root.samplers.get(sampler.value()) else {
        sink.warn(format!("{}: texture {index} names sampler {}, which does not exist", document.file, sampler.value()));
        return Default::default();
    };
    let mut unknown = false;
    let wrap = [wrap_s, wrap_t].map(|wrap| match wrap {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) => Wrap::Repeat,
        Checked::Invalid => {
            unknown = true;
            Wrap::Repeat
        }
    });
    let filter = match (mag_filter, min_filter) {
        (Some(Checked::Valid(MagFilter::Nearest)), _) => Filter::Nearest,
        (None, Some(Checked::Valid(MinFilter::Nearest | MinFilter::NearestMipmapNearest))) => Filter::Nearest,
        (Some(Checked::Invalid), _) | (_, Some(Checked::Invalid)) => {
            unknown = true;
            Filter::Bilinear
        }
        _ => Filter::Bilinear,
    };
    if unknown {
        sink.warn(format!("{}: sampler {}: unknown wrap or filter mode", document.file, sampler.value()));
    }
    (wrap, filter)
}

/// `KHR_texture_transform`: scale, then rotate counter-clockwise as seen with v down, then move.
fn uv_transform(transform: &TextureTransform) -> Affine2 {
    let affine = Affine2::from_scale_angle_translation(
        Vec2::from(transform.scale.0),
        -transform.rotation.0,
        Vec2::from(transform.offset.0),
    );
    if affine.is_finite() { affine } else { Affine2::IDENTITY }
}
