//! glTF textures, samplers and images.

use super::layers::Extensions;
use super::{Document, buffer};
use crate::load::error::{LoadError, ReadError};
use crate::load::picture::{self, Picture};
use crate::load::report::Sink;
use crate::scene::{Encoding, Filter, Texels, Texture, TextureUse, Wrap};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{Affine2, Vec2};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::NormalTexture;
use gltf::json::texture::{Info, MagFilter, MinFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// One use of a texture by a material.
#[derive(Clone)]
pub(super) struct Use {
    pub(super) index: Index<json::Texture>,
    transform: Option<TextureTransform>,
    pub(super) uv_set: u32,
}

impl Use {
    fn new(index: Index<json::Texture>, transform: Option<TextureTransform>, uv_set: u32) -> Self {
        let uv_set = transform.as_ref().and_then(|t| t.tex_coord).unwrap_or(uv_set);
        Self { index, transform, uv_set }
    }
}

impl From<&Info> for Use {
    fn from(info: &Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
        Self::new(info.index, transform, info.tex_coord)
    }
}

impl From<&NormalTexture> for Use {
    fn from(texture: &NormalTexture) -> Self {
        let others = texture.extensions.as_ref().map(|extensions| &extensions.others);
        let transform = others
            .and_then(|others| others.get("KHR_texture_transform"))
            .and_then(|value| serde_json::from_value(value.clone()).ok());
        Self::new(texture.index, transform, texture.tex_coord)
    }
}

/// The texture uses of a material that end up in the picture.
pub(super) fn uses(material: &json::Material) -> Vec<Use> {
    let pbr = &material.pbr_metallic_roughness;
    let old = material.extensions.as_ref().and_then(|e| e.pbr_specular_glossiness.as_ref());
    let base = old.map_or(pbr.base_color_texture.as_ref(), |old| old.diffuse_texture.as_ref());
    let rough = if old.is_some() { None } else { pbr.metallic_roughness_texture.as_ref() };
    let plain = [base, rough, material.emissive_texture.as_ref()];
    let mut uses: Vec<Use> = plain.into_iter().flatten().map(Use::from).collect();
    uses.extend(material.normal_texture.as_ref().map(Use::from));
    uses.extend(old.and_then(|old| old.specular_glossiness_texture.as_ref()).map(Use::from));
    uses.extend(Extensions::of(material).uses());
    uses
}

/// Texture entities, spawned on first use; images are decoded before.
pub(super) struct Textures<'a> {
    document: &'a Document<'a>,
    images: BTreeMap<usize, Arc<Texels>>,
    spawned: BTreeMap<(usize, bool), Entity>,
    /// By texture and factor: what [`Textures::made`] made.
    made: BTreeMap<(usize, u32), Entity>,
    /// Images that have been asked whether they are black.
    black: BTreeMap<usize, bool>,
}

impl<'a> Textures<'a> {
    pub(super) fn new(document: &'a Document<'a>, sink: &mut Sink<'_>) -> Result<Self, LoadError> {
        let root = &document.root;
        let mut wanted: BTreeMap<usize, Picture<'_>> = BTreeMap::new();
        for (i, material) in root.materials.iter().enumerate() {
            for used in uses(material) {
                let user = format!("material {i}");
                let texture = document.at(&root.textures, &used.index, "texture", &user)?;
                let Some(source) = source_of(texture) else {
                    let place = format!("texture {}", used.index.value());
                    sink.repaired(document.file, &place, "texture has no image source: white");
                    continue;
                };
                let user = format!("texture {}", used.index.value());
                let image = document.at(&root.images, &Index::new(source as u32), "image", &user)?;
                wanted.entry(source).or_insert_with(|| picture_of(document, source, image, sink));
            }
        }
        let (indices, pictures): (Vec<usize>, Vec<Picture<'_>>) = wanted.into_iter().unzip();
        let decoded = picture::decode_all(document.file, &pictures, sink).into_iter();
        let texels: Vec<_> =
            decoded.map(|done| done.map_or_else(picture::stand_in, |done| done.texels)).collect();
        let images = indices.into_iter().zip(texels).collect();
        Ok(Self { document, images, spawned: BTreeMap::new(), made: BTreeMap::new(), black: BTreeMap::new() })
    }

    /// The texture of `used` by a mesh whose sets of texture coordinates are `sets`.
    pub(super) fn get(
        &mut self,
        used: impl Into<Use>,
        encoding: Encoding,
        sets: [u32; 2],
        sink: &mut Sink<'_>,
    ) -> Option<TextureUse> {
        let used = used.into();
        let index = used.index.value();
        let texture = self.document.root.textures.get(index)?;
        let texels = self.images.get(&source_of(texture)?)?;
        let entity = *self.spawned.entry((index, encoding == Encoding::Srgb)).or_insert_with(|| {
            let (wrap, filter) = sampling(self.document, texture, index, sink);
            let name = texture.name.clone().unwrap_or_else(|| format!("texture {index}"));
            sink.spawn((Name::new(name), Texture { texels: Arc::clone(texels), encoding, wrap, filter }))
        });
        Some(TextureUse {
            texture: entity,
            uv_transform: used.transform.as_ref().map_or(Affine2::IDENTITY, uv_transform),
            second_uvs: used.uv_set != sets[0],
        })
    }
}

impl Textures<'_> {
    /// Whether a texture has no colour anywhere.
    pub(super) fn is_black(&mut self, info: &Info) -> bool {
        let texture = self.document.root.textures.get(info.index.value());
        let Some(image) = texture.and_then(source_of) else { return false };
        let Some(texels) = self.images.get(&image) else { return false };
        let is_black = || texels.texels.iter().all(|texel| texel[..3] == [0; 3]);
        *self.black.entry(image).or_insert_with(is_black)
    }

    /// A texture whose texels are made from those of `info` and a factor, as data; materials that agree share it.
    pub(super) fn made(
        &mut self,
        info: &Info,
        factor: f32,
        sets: [u32; 2],
        sink: &mut Sink<'_>,
        texel: impl Fn([u8; 4]) -> [u8; 4],
    ) -> Option<TextureUse> {
        let given = self.get(info, Encoding::Linear, sets, sink)?;
        let key = (info.index.value(), factor.to_bits());
        if let Some(&texture) = self.made.get(&key) {
            return Some(TextureUse { texture, ..given });
        }
        let file = self.document.file;
        let Texture { texels, wrap, filter, .. } = sink.world.get::<Texture>(given.texture)?.clone();
        let place = format!("texture {}", info.index.value());
        if sink.budget.take(size_of_val(&*texels.texels) as u64, file, &place).is_err() {
            let what = "its roughness is left out: too large for the memory allowed (see --max-memory)";
            sink.ignored(file, &place, what);
            return None;
        }
        let made = texels.texels.iter().map(|&given| texel(given)).collect();
        let texels = Arc::new(Texels { width: texels.width, height: texels.height, texels: made });
        let name = format!("{file}: roughness");
        let texture =
            sink.spawn((Name::new(name), Texture { texels, encoding: Encoding::Linear, wrap, filter }));
        self.made.insert(key, texture);
        Some(TextureUse { texture, ..given })
    }
}

/// The image of a texture: that of an extension (the core one is for those who cannot read it), else the core one.
fn source_of(texture: &json::Texture) -> Option<usize> {
    let others = texture.extensions.as_ref().map(|extensions| &extensions.others);
    let extension = |name: &str| {
        let source = others?.get(name)?.get("source")?.as_u64()?;
        u32::try_from(source).ok().map(|source| source as usize)
    };
    let core = Some(texture.source.value()).filter(|&source| source != u32::MAX as usize);
    extension("EXT_texture_webp").or(core).or_else(|| extension("KHR_texture_basisu"))
}

fn picture_of<'d>(
    document: &'d Document<'_>,
    index: usize,
    image: &json::Image,
    sink: &mut Sink<'_>,
) -> Picture<'d> {
    let mut label = format!("image {index}");
    let bytes = match (&image.uri, &image.buffer_view) {
        (Some(uri), _) => {
            label = format!("image {index} ({})", buffer::shorten(uri));
            let (bytes, elsewhere) = buffer::read_image(document.folder, uri);
            if elsewhere {
                let what = "is not where the file says: the one of that name beside the scene instead";
                sink.repaired(document.file, &label, what);
            }
            bytes
        }
        (None, Some(view)) => document
            .view(view, &label)
            .map(|(bytes, _)| Cow::Borrowed(bytes))
            .map_err(|_| ReadError::Data("lies outside its buffer")),
        (None, None) => Err(ReadError::Data("has neither a URI nor a buffer view")),
    };
    Picture { label, bytes, strict: true, instead: picture::CHECKER, deep: false }
}

fn sampling(
    document: &Document<'_>,
    texture: &json::Texture,
    index: usize,
    sink: &mut Sink<'_>,
) -> ([Wrap; 2], Filter) {
    let Some(sampler) = texture.sampler.as_ref() else {
        return Default::default();
    };
    let Some(Sampler { wrap_s, wrap_t, mag_filter, min_filter, .. }) =
        document.root.samplers.get(sampler.value())
    else {
        let what = format!("names sampler {}, which does not exist", sampler.value());
        sink.repaired(document.file, &format!("texture {index}"), what);
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
        (Some(Checked::Valid(MagFilter::Nearest)), _)
        | (None, Some(Checked::Valid(MinFilter::Nearest | MinFilter::NearestMipmapNearest))) => {
            Filter::Nearest
        }
        (Some(Checked::Invalid), _) | (_, Some(Checked::Invalid)) => {
            unknown = true;
            Filter::Bilinear
        }
        _ => Filter::Bilinear,
    };
    if unknown {
        let place = format!("sampler {}", sampler.value());
        sink.repaired(document.file, &place, "unknown wrap or filter mode, the default instead");
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
