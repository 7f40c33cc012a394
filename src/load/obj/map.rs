//! `map_` statements of MTL libraries: options, pictures, textures.

use super::lines::{before_comment, unquoted};
use super::relief;
use crate::load::error::ReadError;
use crate::load::picture::{self, Picture};
use crate::load::report::Sink;
use crate::load::source::{Bytes, Folder, IMAGE_LIMIT};
use crate::scene::color::luminance;
use crate::scene::{Encoding, Filter, NormalMap, Texels, Texture, TextureUse, Wrap};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{Affine2, Vec2, Vec3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
/// A texture statement: options, then a file name that may have spaces.
#[derive(Clone, Debug, PartialEq)]
struct Map<'a> {
    name: &'a str,
    scale: Vec2,
    offset: Vec2,
    clamp: bool,
    /// `-bm`.
    bump: f32,
    /// `-imfchan`: the channel that counts, of those that are one number.
    channel: Option<char>,
    /// `-mm`: what is added to the picture's values, and what they are multiplied by before.
    range: Vec2,
}

impl<'a> Map<'a> {
    fn parse(statement: &'a str) -> Self {
        let mut map = Self {
            name: statement.trim(),
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            clamp: false,
            bump: 1.0,
            channel: None,
            range: Vec2::Y,
        };
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
            let mut all_numbers = true;
            for i in 0..arguments {
                let Some(word) = first_word(rest) else { break };
                let value = word.parse::<f32>().ok().filter(|value| value.is_finite());
                if arguments == 3 && value.is_none() {
                    break;
                }
                all_numbers &= value.is_some();
                if i < 2 {
                    vector[i] = value.unwrap_or(0.0);
                }
                if option == "-bm" {
                    map.bump = value.unwrap_or(1.0);
                }
                if option == "-imfchan" {
                    map.channel = word.chars().next();
                }
                map.clamp |= option == "-clamp" && word == "on";
                rest = rest[word.len()..].trim_start();
            }
            match option {
                "-s" => map.scale = vector,
                "-o" => map.offset = vector,
                "-mm" if all_numbers => map.range = vector,
                _ => {}
            }
            map.name = rest;
        }
        map
    }

    /// What it takes of its picture.
    fn source(&self) -> String {
        if self.is_plain() {
            return self.name.to_owned();
        }
        format!("{:?} {} {}", self.channel, self.range, self.name)
    }

    fn is_plain(&self) -> bool {
        self.channel.is_none() && self.range == Vec2::Y
    }

    /// What the options make of a picture.
    fn of(&self, picture: &Arc<Texels>) -> Arc<Texels> {
        if self.is_plain() {
            return Arc::clone(picture);
        }
        let moved = |byte: u8| (f32::from(byte) * self.range.y + self.range.x * 255.0).round() as u8;
        let texel = |&[r, g, b, a]: &[u8; 4]| {
            let [r, g, b] = [r, g, b].map(moved);
            match self.channel {
                Some('r') => [r, r, r, 255],
                Some('g') => [g, g, g, 255],
                Some('b') => [b, b, b, 255],
                Some('m') => [moved(a), moved(a), moved(a), 255],
                Some('l') => {
                    let grey = luminance(Vec3::new(r.into(), g.into(), b.into())).round() as u8;
                    [grey, grey, grey, 255]
                }
                _ => [r, g, b, a],
            }
        };
        Arc::new(Texels { texels: picture.texels.iter().map(texel).collect(), ..**picture })
    }

    /// In coordinates with v down: the mesh's are turned already.
    fn uv_transform(&self) -> Affine2 {
        let offset = Vec2::new(self.offset.x, 1.0 - self.scale.y - self.offset.y);
        Affine2::from_scale_angle_translation(self.scale, 0.0, offset)
    }

    fn used(&self, texture: Entity) -> TextureUse {
        TextureUse { texture, uv_transform: self.uv_transform(), second_uvs: false }
    }

    fn wrap(&self) -> [Wrap; 2] {
        [if self.clamp { Wrap::Clamp } else { Wrap::Repeat }; 2]
    }
}

fn first_word(text: &str) -> Option<&str> {
    text.split_ascii_whitespace().next()
}

/// The statements that name pictures, in the spelling of `tidy`.
const STATEMENTS: [&str; 9] =
    ["map_Kd", "map_d", "map_Ke", "map_Ks", "map_Ns", "map_Pr", "map_Pm", "map_Bump", "norm"];

/// What follows the keyword in this material.
fn statement<'m>(material: &'m tobj::Material, keyword: &str) -> Option<&'m str> {
    let known = match keyword {
        "map_Kd" => &material.diffuse_texture,
        "map_d" => &material.dissolve_texture,
        "map_Ks" => &material.specular_texture,
        "map_Ns" => &material.shininess_texture,
        "map_Bump" => &material.normal_texture,
        _ => return material.unknown_param.get(keyword).map(String::as_str),
    };
    known.as_deref()
}

/// What stands between the folder of a library and the name that it gives: no file has it in its text.
const BESIDE: &str = "\0";

/// The same statement as the scene's folder sees it: names in a library count from the library's folder.
pub(super) fn beside(library: &str, statement: &str) -> String {
    let Some((folder, _)) = library.rsplit_once(['/', '\\']) else { return statement.to_owned() };
    let name = Map::parse(statement).name;
    let options = statement.trim_end().strip_suffix(name).unwrap_or_default();
    format!("{options}{folder}{BESIDE}{name}")
}

/// Looks for a picture; where there is none of that name, `#` may begin a comment.
fn read(folder: &Folder, name: &str) -> Result<Bytes, ReadError> {
    let (library, own) = name.split_once(BESIDE).map_or((None, name), |(library, own)| (Some(library), own));
    let bare = unquoted(before_comment(own));
    let named = read_named(folder, library, own);
    named.or_else(|why| if bare == own { Err(why) } else { read_named(folder, library, bare) })
}

/// In the folder of its library, then in the scene's.
fn read_named(folder: &Folder, library: Option<&str>, own: &str) -> Result<Bytes, ReadError> {
    let Some(library) = library else {
        return folder.read_or_neighbour(own, IMAGE_LIMIT);
    };
    let bare = own.rsplit(['/', '\\']).next().unwrap_or(own);
    let there = [own, bare].map(|name| format!("{library}/{name}"));
    match there.iter().find(|name| folder.has(name)) {
        Some(name) => folder.read(name, IMAGE_LIMIT),
        None => folder.read_or_neighbour(own, IMAGE_LIMIT),
    }
}

/// Decoded images of a library by file name.
pub(super) struct Textures {
    file: String,
    images: BTreeMap<String, Arc<Texels>>,
    /// Names of those that could not be read.
    missing: BTreeSet<String>,
    spawned: BTreeMap<Key, Entity>,
}

/// What a texture is made of: for what, of what of which pictures, and whether it is clamped.
type Key = (&'static str, String, String, bool);

impl Textures {
    pub(super) fn new(
        file: &str,
        folder: &Folder,
        materials: &[tobj::Material],
        sink: &mut Sink<'_>,
    ) -> Self {
        let mut pictures: BTreeMap<String, Picture<'_>> = BTreeMap::new();
        for material in materials {
            for statement in STATEMENTS.iter().filter_map(|keyword| statement(material, keyword)) {
                let name = Map::parse(statement).name;
                pictures.entry(name.to_owned()).or_insert_with(|| Picture {
                    label: format!("texture `{}`", name.replace(BESIDE, "/")),
                    bytes: read(folder, name),
                    strict: false,
                });
            }
        }
        let unread = pictures.iter().filter(|(_, picture)| picture.bytes.is_err());
        let missing = unread.map(|(name, _)| name.clone()).collect();
        let (names, pictures): (Vec<String>, Vec<Picture<'_>>) = pictures.into_iter().unzip();
        let texels = picture::decode_all(file, &pictures, sink);
        let file = file.to_owned();
        Self { file, images: names.into_iter().zip(texels).collect(), missing, spawned: BTreeMap::new() }
    }

    /// Whether the material has such a statement, and its picture is there.
    pub(super) fn has(&self, material: &tobj::Material, keyword: &str) -> bool {
        statement(material, keyword).is_some_and(|map| !self.missing.contains(Map::parse(map).name))
    }

    /// `map_Kd` with the alpha of `map_d`.
    pub(super) fn color(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        self.pair("color", ["map_Kd", "map_d"], Encoding::Srgb, material, sink, with_alpha)
    }

    /// `map_Ks` with `map_Ns` as alpha.
    pub(super) fn gloss(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        self.pair("gloss", ["map_Ks", "map_Ns"], Encoding::Srgb, material, sink, with_alpha)
    }

    /// `map_Pr` in green and `map_Pm` in blue.
    pub(super) fn metal_and_roughness(
        &mut self,
        material: &tobj::Material,
        sink: &mut Sink<'_>,
    ) -> Option<TextureUse> {
        self.pair("rough", ["map_Pr", "map_Pm"], Encoding::Linear, material, sink, |rough, metal| {
            together(rough, metal, |[rough, ..], [metal, ..]| [255, rough, metal, 255])
        })
    }

    pub(super) fn emission(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        self.pair("emission", ["map_Ke", ""], Encoding::Srgb, material, sink, with_alpha)
    }

    /// `norm`, or `map_Bump`: heights, or what many programs write there, a normal map.
    pub(super) fn normals(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<NormalMap> {
        let (statement, is_normal_map) = match statement(material, "norm") {
            Some(norm) => (norm, true),
            None => (statement(material, "map_Bump")?, false),
        };
        let map = Map::parse(statement);
        // What stands in for a picture that is not there has no slopes.
        if self.missing.contains(map.name) {
            return None;
        }
        let given = self.images.get(map.name)?;
        if !map.is_plain() {
            self.afford(given, &map, sink)?;
        }
        let texels = map.of(given);
        let is_normal_map = is_normal_map || relief::is_normal_map(&texels);
        let kind = if is_normal_map { "normals" } else { "heights" };
        let key = (kind, map.source(), map.bump.to_string(), map.clamp);
        if let Some(&known) = self.spawned.get(&key) {
            return Some(NormalMap {
                texture: map.used(known),
                scale: if is_normal_map { map.bump } else { 1.0 },
            });
        }
        let texels = if is_normal_map {
            texels
        } else {
            self.afford(&texels, &map, sink)?;
            Arc::new(relief::normals_of_heights(&texels, map.bump, map.clamp))
        };
        let texture = self.spawn(key, texels, Encoding::Linear, &map, sink);
        Some(NormalMap { texture, scale: if is_normal_map { map.bump } else { 1.0 } })
    }

    /// One texture of the pictures of two statements, either of which may be missing.
    fn pair(
        &mut self,
        kind: &'static str,
        keywords: [&str; 2],
        encoding: Encoding,
        material: &tobj::Material,
        sink: &mut Sink<'_>,
        join: impl Fn(Option<&Texels>, Option<&Texels>) -> Texels,
    ) -> Option<TextureUse> {
        let statements = keywords.map(|keyword| statement(material, keyword));
        let maps = statements.map(|statement| statement.map(Map::parse));
        let main = maps[0].as_ref().or(maps[1].as_ref())?.clone();
        let [a, b] = maps.each_ref().map(|map| map.as_ref().map_or(String::new(), Map::source));
        let key = (kind, a, b, main.clamp);
        if let Some(&known) = self.spawned.get(&key) {
            return Some(main.used(known));
        }
        if maps.iter().flatten().count() > 1 || !main.is_plain() || encoding != Encoding::Srgb {
            self.afford(self.images.get(main.name)?, &main, sink)?;
        }
        let picture = |map: &Option<Map<'_>>| {
            let map = map.as_ref()?;
            self.images.get(map.name).map(|picture| map.of(picture))
        };
        let [first, second] = maps.each_ref().map(picture);
        let texels = match (first, second) {
            (None, None) => return None,
            (Some(only), None) if encoding == Encoding::Srgb => only,
            (first, second) => Arc::new(join(first.as_deref(), second.as_deref())),
        };
        Some(self.spawn(key, texels, encoding, &main, sink))
    }

    /// Asks for the memory of copies that the options of a statement make of a picture; without it the statement is left out.
    fn afford(&self, picture: &Texels, map: &Map<'_>, sink: &mut Sink<'_>) -> Option<()> {
        // One for a channel of its own, one for two pictures together.
        let bytes = 8 * picture.texels.len() as u64;
        let place = format!("texture `{}`", map.name.replace(BESIDE, "/"));
        let taken = sink.budget.take(bytes, &self.file, &place);
        if taken.is_err() {
            sink.ignored(&self.file, &place, "left out: too large for the memory allowed (see --max-memory)");
        }
        taken.ok()
    }

    fn spawn(
        &mut self,
        key: Key,
        texels: Arc<Texels>,
        encoding: Encoding,
        map: &Map<'_>,
        sink: &mut Sink<'_>,
    ) -> TextureUse {
        let texture = *self.spawned.entry(key).or_insert_with(|| {
            let texture = Texture { texels, encoding, wrap: map.wrap(), filter: Filter::Bilinear };
            sink.spawn((Name::new(map.name.replace(BESIDE, "/")), texture))
        });
        map.used(texture)
    }
}

/// Colours of one picture (white if there is none) with the coverage of another: its alpha channel,
/// or its red one where alpha says nothing.
fn with_alpha(color: Option<&Texels>, cover: Option<&Texels>) -> Texels {
    let has_alpha = cover.is_some_and(|cover| cover.texels.iter().any(|texel| texel[3] != 255));
    together(color, cover, |[r, g, b, _], there| [r, g, b, if has_alpha { there[3] } else { there[0] }])
}

/// Two pictures (white where there is none) texel by texel, in the size of the first.
fn together(
    first: Option<&Texels>,
    second: Option<&Texels>,
    join: impl Fn([u8; 4], [u8; 4]) -> [u8; 4],
) -> Texels {
    let (width, height) = first.or(second).map_or((1, 1), |size| (size.width, size.height));
    let at = |picture: Option<&Texels>, x: u32, y: u32| {
        picture.map_or([255; 4], |picture| {
            let scaled = |i: u32, of: u32, to: u32| u64::from(i) * u64::from(of) / u64::from(to);
            let (x, y) = (scaled(x, picture.width, width), scaled(y, picture.height, height));
            picture.texels[(y * u64::from(picture.width) + x) as usize]
        })
    };
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let texels = places.map(|(x, y)| join(at(first, x, y), at(second, x, y))).collect();
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
            Map {
                name: "my tex.png",
                scale: Vec2::new(2., 3.),
                offset: Vec2::new(0.5, 0.),
                clamp: true,
                bump: 1.0,
                channel: None,
                range: Vec2::Y,
            }
        );
        assert_eq!(Map::parse("-odd name.png").name, "-odd name.png");
        let map = Map::parse("-imfchan g -mm 0.5 0.25 \"a.png\"");
        assert_eq!((map.name, map.channel, map.range), ("\"a.png\"", Some('g'), Vec2::new(0.5, 0.25)));
        let picture = Arc::new(Texels { width: 1, height: 1, texels: vec![[0, 100, 200, 9]] });
        assert_eq!(map.of(&picture).texels, [[153, 153, 153, 255]]);
        assert_eq!(Map::parse("a.png").of(&picture).texels, picture.texels);
        assert_eq!(Map::parse("-mm a b a.png").of(&picture).texels, picture.texels);
    }

    #[test]
    fn offset_and_scale_count_from_the_bottom_left() {
        let map = Map::parse("-s 2 2 -o 0.25 0.5 x.png");
        // v = 0.1 from the bottom is 0.9 from the top; 0.1 * 2 + 0.5 = 0.7 from the bottom is 0.3 from the top.
        let moved = map.uv_transform().transform_point2(Vec2::new(0.1, 0.9));
        assert!((moved - Vec2::new(0.45, 0.3)).length() < 1e-6);
    }
}
