//! Pictures that MTL libraries name → textures.

use super::lines::{before_comment, unquoted};
use super::map::{BESIDE, Map};
use super::relief;
use crate::load::error::ReadError;
use crate::load::picture::{self, Decoded, Picture};
use crate::load::report::Sink;
use crate::load::source::{Bytes, Folder, IMAGE_LIMIT};
use crate::scene::{Encoding, Filter, NormalMap, Texels, Texture, TextureUse};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

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
    /// Of those that a bump map names and that have 16 bits: see [`Decoded::brightness`].
    heights: BTreeMap<String, Vec<u16>>,
    /// Names of those that could not be had.
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
            for keyword in STATEMENTS {
                let Some(statement) = statement(material, keyword) else { continue };
                let name = Map::parse(statement).name;
                let picture = pictures.entry(name.to_owned()).or_insert_with(|| Picture {
                    label: format!("texture `{}`", name.replace(BESIDE, "/")),
                    bytes: read(folder, name),
                    strict: false,
                    instead: "the surface stays flat",
                    deep: false,
                });
                if !matches!(keyword, "map_Bump" | "norm") {
                    picture.instead = picture::CHECKER;
                }
                picture.deep |= keyword == "map_Bump";
            }
        }
        let (names, pictures): (Vec<String>, Vec<Picture<'_>>) = pictures.into_iter().unzip();
        let decoded = picture::decode_all(file, &pictures, sink);
        let mut missing = BTreeSet::new();
        let (mut images, mut heights) = (BTreeMap::new(), BTreeMap::new());
        for (name, decoded) in names.into_iter().zip(decoded) {
            let Some(Decoded { texels, brightness }) = decoded else {
                missing.insert(name.clone());
                images.insert(name, picture::stand_in());
                continue;
            };
            heights.extend(brightness.map(|brightness| (name.clone(), brightness)));
            images.insert(name, texels);
        }
        Self { file: file.to_owned(), images, heights, missing, spawned: BTreeMap::new() }
    }

    /// Whether the material has such a statement, and its picture is there.
    pub(super) fn has(&self, material: &tobj::Material, keyword: &str) -> bool {
        statement(material, keyword).is_some_and(|map| !self.missing.contains(Map::parse(map).name))
    }

    /// Whether the alpha channel of `map_Kd` says what is there: where nothing else does, and there is more than one value.
    pub(super) fn has_cut_outs(&self, material: &tobj::Material) -> bool {
        let is_said = material.dissolve.is_some_and(|d| d < 1.0) || statement(material, "map_d").is_some();
        let picture = statement(material, "map_Kd").map(Map::parse).filter(Map::is_plain);
        let picture = picture.and_then(|map| self.images.get(map.name)).filter(|_| !is_said);
        picture.is_some_and(|picture| {
            let is_through = |texel: &[u8; 4]| texel[3] < 128;
            picture.texels.iter().any(is_through) && !picture.texels.iter().all(is_through)
        })
    }

    /// `map_Kd` with the alpha of `map_d`.
    pub(super) fn color(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        self.pair("color", ["map_Kd", "map_d"], Encoding::Srgb, material, sink, with_alpha)
    }

    /// `map_Ks` with `map_Ns` as alpha.
    pub(super) fn gloss(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        self.pair("gloss", ["map_Ks", "map_Ns"], Encoding::Srgb, material, sink, with_alpha)
    }

    /// `map_Ks` as numbers.
    pub(super) fn strength(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        self.pair("strength", ["map_Ks", ""], Encoding::Linear, material, sink, with_alpha)
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
            if self.heights.contains_key(map.name) {
                let place = format!("texture `{}`", map.name.replace(BESIDE, "/"));
                sink.approximated(&self.file, &place, picture::IN_EIGHT_BITS);
            }
            texels
        } else {
            self.afford(&texels, &map, sink)?;
            let heights = match self.heights.get(map.name) {
                Some(deep) => map.of_brightness(deep),
                None => None,
            };
            let heights = heights.unwrap_or_else(|| relief::heights_of(&texels));
            let size = [texels.width, texels.height];
            Arc::new(relief::normals_of_heights(size, &heights, map.bump, map.clamp))
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
        if let [Some(first), Some(second)] = &maps
            && !first.lies_as(second)
        {
            let what = format!("options of {} count for {} too", keywords[0], keywords[1]);
            sink.approximated(&self.file, &format!("material `{}`", material.name), what);
        }
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
