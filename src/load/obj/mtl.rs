//! MTL libraries → material entities. `tobj` parses what [`tidy`] lets through.

use super::lines::{self, Statement};
use crate::load::picture::{self, Picture};
use crate::load::report::Sink;
use crate::load::settings::Materials;
use crate::load::source::{Bytes, Folder, IMAGE_LIMIT, TEXT_LIMIT};
use crate::load::error::ReadError;
use crate::scene::{Alpha, Encoding, Filter, Glass, Glossy, Material, Texels, Texture, TextureUse, Wrap};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{Affine2, Vec2, Vec3};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;

/// Reads all libraries and spawns their materials; the first of a name counts.
pub(super) fn spawn_all(
    file: &str,
    folder: &Folder,
    libraries: &[String],
    overrides: &mut Materials,
    sink: &mut Sink<'_>,
) -> BTreeMap<String, Entity> {
    let mut parsed: Vec<tobj::Material> = Vec::new();
    for library in libraries {
        for (name, bytes) in open(file, folder, library, sink) {
            parsed.extend(parse(file, &name, &bytes, sink));
        }
    }
    let mut textures = Textures::new(file, folder, &parsed, sink);
    let mut entities = BTreeMap::new();
    for material in &parsed {
        if entities.contains_key(&material.name) {
            continue;
        }
        let entity = overrides.replacement(&material.name).unwrap_or_else(|| {
            let component = convert(file, material, &mut textures, sink);
            sink.spawn((Name::new(material.name.clone()), component))
        });
        entities.insert(material.name.clone(), entity);
    }
    entities
}

/// The files of one `mtllib` statement: one name with spaces, or several names.
fn open(file: &str, folder: &Folder, library: &str, sink: &mut Sink<'_>) -> Vec<(String, Bytes)> {
    let mut found = Vec::new();
    let whole = folder.read_or_neighbour(library, TEXT_LIMIT);
    let several = library.split_ascii_whitespace().count() > 1 && matches!(whole, Err(ReadError::Missing));
    let names: Vec<&str> = if several { library.split_ascii_whitespace().collect() } else { vec![library] };
    for name in names {
        match folder.read_or_neighbour(name, TEXT_LIMIT) {
            Ok(bytes) => found.push((name.to_owned(), bytes)),
            Err(why) => sink.warn(format!("{file}: material library `{name}`: {why}; its materials are light grey")),
        }
    }
    found
}

fn parse(file: &str, library: &str, bytes: &[u8], sink: &mut Sink<'_>) -> Vec<tobj::Material> {
    let text = match lines::text_of(library, bytes) {
        Ok(text) => text,
        Err(why) => {
            sink.warn(format!("{file}: material library {why}"));
            return Vec::new();
        }
    };
    let tidied = tidy(file, library, &text, sink);
    match tobj::load_mtl_buf(&mut tidied.as_bytes()) {
        Ok((materials, _)) => materials,
        Err(why) => {
            sink.warn(format!("{file}: material library `{library}` cannot be read: {why}"));
            Vec::new()
        }
    }
}

/// Only statements that `tobj` parses, in its spelling; warns of the others.
fn tidy(file: &str, library: &str, text: &str, sink: &mut Sink<'_>) -> String {
    let mut tidied = String::with_capacity(text.len());
    let mut inside = false;
    let done: Result<(), std::fmt::Error> = lines::for_each(text, |Statement { line, keyword, rest }| {
        let mut warn = |what: &str| sink.warn(format!("{file}: material library `{library}`, line {line}: `{keyword}` {what}"));
        if keyword == "newmtl" {
            inside = !rest.is_empty();
            return if inside { writeln!(tidied, "newmtl {rest}") } else { Ok(warn("without a name")) };
        }
        if !inside {
            return Ok(warn("before the first newmtl, ignored"));
        }
        let values: Option<Vec<f32>> =
            rest.split_ascii_whitespace().map(|word| word.parse().ok().filter(|v: &f32| v.is_finite())).collect();
        match (keyword, values.as_deref()) {
            ("Ka" | "Kd" | "Ks" | "Ke" | "Tf", Some([r, g, b, ..])) => writeln!(tidied, "{keyword} {r} {g} {b}"),
            ("Ka" | "Kd" | "Ks" | "Ke" | "Tf", Some([grey])) => writeln!(tidied, "{keyword} {grey} {grey} {grey}"),
            ("Ka" | "Kd" | "Ks" | "Ke" | "Tf", _) => Ok(warn("without three numbers, ignored")),
            ("d", _) if rest.starts_with("-halo") => Ok(warn("-halo is not supported, ignored")),
            ("Ns" | "Ni" | "d" | "Tr" | "Pr" | "Pm", Some([value, ..])) => writeln!(tidied, "{keyword} {value}"),
            ("Ns" | "Ni" | "d" | "Tr" | "Pr" | "Pm", _) => Ok(warn("without a number, ignored")),
            ("illum", Some([model, ..])) if (0.0..=10.0).contains(model) => writeln!(tidied, "illum {}", *model as u8),
            ("illum", _) => Ok(warn("with an unknown model, ignored")),
            ("map_Kd" | "map_d" | "map_Ke", _) if rest.is_empty() => Ok(warn("without a file name, ignored")),
            ("map_Kd" | "map_d" | "map_Ke", _) => writeln!(tidied, "{keyword} {rest}"),
            ("map_Ka" | "map_Ks" | "map_Ns" | "map_Bump" | "map_bump" | "bump" | "disp" | "decal" | "refl" | "norm", _) => {
                sink.warn(format!("{file}: material library `{library}`: `{keyword}` textures are not supported, ignored"));
                Ok(())
            }
            _ => Ok(()),
        }
    });
    // Writing to a String cannot fail.
    debug_assert!(done.is_ok());
    tidied
}

/// Three numbers of a statement that `tobj` keeps as text.
fn color(material: &tobj::Material, keyword: &str) -> Option<Vec3> {
    let mut numbers = material.unknown_param.get(keyword)?.split_ascii_whitespace().map_while(|word| word.parse().ok());
    Some(Vec3::new(numbers.next()?, numbers.next()?, numbers.next()?))
}

fn scalar(material: &tobj::Material, keyword: &str) -> Option<f32> {
    material.unknown_param.get(keyword)?.parse().ok()
}

fn convert(file: &str, material: &tobj::Material, textures: &mut Textures, sink: &mut Sink<'_>) -> Material {
    let name = &material.name;
    let mut out_of_range = false;
    let mut within = |value: f32, low: f32, high: f32| {
        out_of_range |= !(low..=high).contains(&value);
        value.clamp(low, high)
    };
    let mut unit = |color: Vec3| Vec3::from(color.to_array().map(|value| within(value, 0.0, 1.0)));
    let has_texture = material.diffuse_texture.is_some();
    let mut diffuse = unit(material.diffuse.map_or(Vec3::splat(if has_texture { 1.0 } else { 0.8 }), Vec3::from));
    let mut specular = unit(material.specular.map_or(Vec3::ZERO, Vec3::from));
    let tint = unit(color(material, "Tf").unwrap_or(Vec3::ONE));
    let emission = material.emissive.map_or(Vec3::ZERO, Vec3::from).max(Vec3::ZERO);
    let exponent = within(material.shininess.unwrap_or(0.0), 0.0, 1e6);
    let opacity = material.dissolve.or_else(|| scalar(material, "Tr").map(|transparency| 1.0 - transparency));
    let opacity = within(opacity.unwrap_or(1.0), 0.0, 1.0);
    let pbr = match (scalar(material, "Pr"), scalar(material, "Pm")) {
        (None, None) => None,
        (rough, metal) => Some((within(rough.unwrap_or(0.5), 0.0, 1.0), within(metal.unwrap_or(0.0), 0.0, 1.0))),
    };
    let ior = material.optical_density.filter(|&ior| ior > 1.0).unwrap_or(1.5);
    if out_of_range {
        sink.warn(format!("{file}: material `{name}`: a value is out of range, clamped"));
    }
    let model = material.illumination_model.unwrap_or(2);
    let is_glass = matches!(model, 4 | 6 | 7 | 9);
    let is_mirror = matches!(model, 3 | 5) && specular != Vec3::ZERO;
    let uses_specular = pbr.is_none() && !is_glass && (is_mirror || (model >= 2 && specular != Vec3::ZERO));
    let most = (diffuse + specular).max_element();
    if uses_specular && most > 1.0 {
        sink.warn(format!("{file}: material `{name}`: Kd + Ks is {most} and would create light; both scaled down"));
        diffuse /= most;
        specular /= most;
    }
    let base_color_texture = if is_glass { None } else { textures.color(material, sink) };
    let transparent = opacity < 1.0 || material.dissolve_texture.is_some();
    Material {
        base_color: if is_glass { Vec3::ZERO } else { diffuse },
        base_color_texture,
        glossy: match pbr {
            _ if is_glass => Glossy::None,
            Some((roughness, metallic)) => Glossy::Ggx { metallic, roughness, texture: None },
            None if uses_specular && !is_mirror => Glossy::BlinnPhong { specular, exponent },
            None => Glossy::None,
        },
        mirror: if uses_specular && is_mirror { specular } else { Vec3::ZERO },
        glass: is_glass.then_some(Glass { ior, tint }),
        emission,
        emission_texture: if emission == Vec3::ZERO { None } else { textures.emission(material, sink) },
        alpha: if transparent && !is_glass { Alpha::Blend } else { Alpha::Opaque },
        opacity: if is_glass { 1.0 } else { opacity },
        double_sided: false,
        unlit: false,
    }
}

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
                "-blendu" | "-blendv" | "-boost" | "-bm" | "-cc" | "-clamp" | "-colorspace" | "-imfchan" | "-texres" | "-type" => 1,
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
struct Textures {
    images: BTreeMap<String, Arc<Texels>>,
    spawned: BTreeMap<(String, String, bool), Entity>,
}

impl Textures {
    fn new(file: &str, folder: &Folder, materials: &[tobj::Material], sink: &mut Sink<'_>) -> Self {
        let mut pictures: BTreeMap<String, Picture<'_>> = BTreeMap::new();
        for material in materials {
            let emission = material.unknown_param.get("map_Ke");
            for statement in [&material.diffuse_texture, &material.dissolve_texture].into_iter().flatten().chain(emission) {
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
    fn color(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        let color = material.diffuse_texture.as_deref().map(Map::parse);
        let cover = material.dissolve_texture.as_deref().map(Map::parse);
        let main = color.as_ref().or(cover.as_ref())?.clone();
        let key = |map: &Option<Map<'_>>| map.as_ref().map_or(String::new(), |map| map.name.to_owned());
        let key = (key(&color), key(&cover), main.clamp);
        let image = |map: &Option<Map<'_>>| map.as_ref().and_then(|map| self.images.get(map.name)).map(Arc::clone);
        let texels = match (image(&color), image(&cover)) {
            (Some(color), None) => color,
            (color, Some(cover)) => Arc::new(with_alpha(color.as_deref(), &cover)),
            (None, None) => return None,
        };
        Some(self.spawn(key, texels, &main, sink))
    }

    fn emission(&mut self, material: &tobj::Material, sink: &mut Sink<'_>) -> Option<TextureUse> {
        let map = Map::parse(material.unknown_param.get("map_Ke")?);
        let texels = Arc::clone(self.images.get(map.name)?);
        Some(self.spawn((map.name.to_owned(), String::new(), map.clamp), texels, &map, sink))
    }

    fn spawn(&mut self, key: (String, String, bool), texels: Arc<Texels>, map: &Map<'_>, sink: &mut Sink<'_>) -> TextureUse {
        let texture = *self.spawned.entry(key).or_insert_with(|| {
            let texture = Texture { texels, encoding: Encoding::Srgb, wrap: map.wrap(), filter: Filter::Bilinear };
            sink.spawn((Name::new(map.name.to_owned()), texture))
        });
        TextureUse { texture, uv_transform: map.uv_transform() }
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
            let (there_x, there_y) = (x * u64::from(cover.width) / u64::from(width), y * u64::from(cover.height) / u64::from(height));
            let there = cover.texels[(there_y * u64::from(cover.width) + there_x) as usize];
            let [r, g, b, _] = color.map_or([255; 4], |color| color.texels[(y * u64::from(width) + x) as usize]);
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
        assert_eq!(map, Map { name: "my tex.png", scale: Vec2::new(2., 3.), offset: Vec2::new(0.5, 0.), clamp: true });
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
