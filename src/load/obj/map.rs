//! `map_` statements of MTL libraries: options, pictures, textures.

use crate::load::picture::{self, Picture};
use crate::load::report::Sink;
use crate::load::source::{Folder, IMAGE_LIMIT};
use crate::scene::{Encoding, Filter, Texels, Texture, TextureUse, Wrap};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{Affine2, Vec2};
use std::collections::BTreeMap;
use std::sync::Arc;
/// A texture statement: options, then a file name that may have spaces.
#[derive(Clone, Debug, PartialEq)]
struct Map<'a> {
    name: &'a str,
    scale: Vec2,
    offset: Vec2,
    clamp: bool,
}

impl<'a> Map<'a> {
    fn parse(statement: &'a str) -> Self {
        let mut map = Self { name: statement.trim(), scale: Vec2::ONE, offset: Vec2::ZERO, clamp: false };
        while let Some(option) = map.name.strip_prefix('-').and_then(|_| first_word(map.name)) {
            let arguments = match option {
                "-mm" => 2,
                "-s" | "-o" | "-t" => 3,
                "-blendu" | "-blendv" | "-boost" | "-bm" | "-cc" | "-clamp" | "-colorspace" | "-imfchan"
                | "-texres" | "-type" => 1,
                _ => break,
            };
            let mut rest = map.name[option.len()..].trim_start();
            let mut vector = match option {
                "-s" => Vec2::ONE,
                _ => Vec2::ZERO,
            };
            for i in 0..arguments {
                let Some(word) = first_word(rest) else { break };
                let value = word.parse::<f32>().ok().filter(|value| value.is_finite());
                if arguments == 3 && value.is_none() {
                    break;
                }
                if i < 2 {
                    vector[i] = value.unwrap_or(0.0);
                }
                map.clamp |= option == "-clamp" && word == "on";
                rest = rest[word.len()..].trim_start();
            }
            match option {
                "-s" => map.scale = vector,
                "-o" => map.offset = vector,
                _ => {}
            }
            map.name = rest;
        }
        map
    }

    /// In coordinates with v down: the mesh's are turned already.
    fn uv_transform(&self) -> Affine2 {
        let offset = Vec2::new(self.offset.x, 1.0 - self.scale.y - self.offset.y);
        Affine2::from_scale_angle_translation(self.scale, 0.0, offset)
    }

    fn wrap(&self) -> [Wrap; 2] {
        [if self.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2]
    }
}

fn first_word(text: &str) -> Option<&str> {
    text.split_ascii_whitespace().next()
}

/// Decoded images of a library by file name.
pub(super) struct Textures {
    images: BTreeMap<String, Arc<Texels>>,
    spawned: BTreeMap<(String, String, bool), Entity>,
}

impl Textures {
    pub(super) fn new(
        file: &str,
        folder: &Folder,
        materials: &[tobj::Material],
        sink: &mut Sink<'_>,
    ) -> Self {
        let mut pictures: BTreeMap<String, Picture<'_>> = BTreeMap::new();
        for material in materials {
            let emission = material.unknown_param.get("map_Ke");
            for statement in
                [&material.diffuse_texture, &material.dissolve_texture].into_iter().flatten().chain(emission)
            {
                let name = Map::parse(statement).name;
                pictures.entry(name.to_owned()).or_insert_with(|| Picture {
                    label: format!("texture `{name}`"),
                    bytes: folder.read_or_neighbour(name, IMAGE_LIMIT),
                    strict: false,
                });
            }
        }
        let (names, pictures): (Vec<String>, Vec<Picture<'_>>) = pictures.into_iter().unzip();
        let texels = picture::decode_all(file, &pictures, sink);
        Self { images: names.into_iter().zip(texels).collect(), spawned: BTreeMap::new() }
    }

    /// `map_Kd` with the alpha of `map_d`.
    pub(super) fn color(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        let color = material.diffuse_texture.as_deref().map(Map::parse);
        let cover = material.dissolve_texture.as_deref().map(Map::parse);
        let main = color.as_ref().or(cover.as_ref())?.clone();
        let key = |map: &Option<Map<'_>>| map.as_ref().map_or(String::new(), |map| map.name.to_owned());
        let key = (key(&color), key(&cover), main.clamp);
        let image =
            |map: &Option<Map<'_>>| map.as_ref().and_then(|map| self.images.get(map.name)).map(Arc::clone);
        let texels = match (image(&color), image(&cover)) {
            (Some(color), None) => color,
            (color, Some(cover)) => Arc::new(with_alpha(color.as_deref(), &cover)),
            (None, None) => return None,
        };
        Some(self.spawn(key, texels, &main, sink))
    }

    pub(super) fn emission(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        let map = Map::parse(material.unknown_param.get("map_Ke")?);
        let texels = Arc::clone(self.images.get(map.name)?);
        Some(self.spawn((map.name.to_owned(), String::new(), map.clamp), texels, &map, sink))
    }

    fn spawn(
        &mut self,
        key: (String, String, bool),
        texels: Arc<Texels>,
        map: &Map<'_>,
        sink: &mut Sink<'_>,
    ) -> TextureUse {
        let texture = *self.spawned.entry(key).or_insert_with(|| {
            let texture =
                Texture { texels, encoding: Encoding::Srgb, wrap: map.wrap(), filter: Filter::Bilinear };
            sink.spawn((Name::new(map.name.to_owned()), texture))
        });
        TextureUse { texture, uv_transform: map.uv_transform(), second_uvs: false }
    }
}

/// Colours of one picture (white if there is none) with the coverage of another: its alpha channel,
/// or its red one where alpha says nothing. The size is the colour's.
fn with_alpha(color: Option<&Texels>, cover: &Texels) -> Texels {
    let size = color.unwrap_or(cover);
    let (width, height) = (size.width, size.height);
    let has_alpha = cover.texels.iter().any(|texel| texel[3] != 255);
    let mut texels = Vec::with_capacity(size.texels.len());
    for y in 0..u64::from(height) {
        for x in 0..u64::from(width) {
            let (there_x, there_y) = (
                x * u64::from(cover.width) / u64::from(width),
                y * u64::from(cover.height) / u64::from(height),
            );
            let there = cover.texels[(there_y * u64::from(cover.width) + there_x) as usize];
            let [r, g, b, _] =
                color.map_or([255; 4], |color| color.texels[(y * u64::from(width) + x) as usize]);
            texels.push([r, g, b, if has_alpha { there[3] } else { there[0] }]);
        }
    }
    Texels { width, height, texels }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_options_come_before_a_name_with_spaces() {
        let map = Map::parse("-blendu on -s 2 3 1 -o 0.5 0 -mm 0 1 -clamp on my tex.png");
        assert_eq!(
            map,
            Map { name: "my tex.png", scale: Vec2::new(2., 3.), offset: Vec2::new(0.5, 0.), clamp: true }
        );
        assert_eq!(Map::parse("-odd name.png").name, "-odd name.png");
    }

    #[test]
    fn offset_and_scale_count_from_the_bottom_left() {
        let map = Map::parse("-s 2 2 -o 0.25 0.5 x.png");
        // v = 0.1 from the bottom is 0.9 from the top; 0.1 * 2 + 0.5 = 0.7 from the bottom is 0.3 from the top.
        let moved = map.uv_transform().transform_point2(Vec2::new(0.1, 0.9));
        assert!((moved - Vec2::new(0.45, 0.3)).length() < 1e-6);
    }
}
