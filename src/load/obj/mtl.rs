//! MTL libraries → material entities. `tobj` parses what [`tidy()`] lets through.

use super::blender;
use super::lines::{self, before_comment, unquoted};
use super::textures::Textures;
use super::tidy::tidy;
use super::vtk;
use crate::load::report::{Kind, Sink};
use crate::load::settings::Materials;
use crate::load::source::{Folder, TEXT_LIMIT};
use crate::scene::{
    Alpha, Anisotropy, Body, Clearcoat, Glass, Glossy, Layers, Material, Sheen, Transmission,
};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::Vec3;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Reads all libraries and spawns their materials; the last of a name counts, as in most programs.
pub(super) fn spawn_all(
    file: &str,
    folder: &Folder,
    libraries: &[String],
    overrides: &mut Materials,
    sink: &mut Sink<'_>,
) -> BTreeMap<String, Entity> {
    let mut parsed: Vec<tobj::Material> = Vec::new();
    // Some programs repeat the statement for every object.
    let mut unread: BTreeSet<&String> = libraries.iter().collect();
    let in_order = libraries.iter().filter(|&statement| unread.remove(statement));
    let (mut known, mut lost) = (BTreeSet::new(), Vec::new());
    for (i, library) in in_order.flat_map(|statement| libraries_of(folder, statement)).enumerate() {
        if i == MOST_LIBRARIES {
            sink.ignored(file, "", format!("material libraries after the first {MOST_LIBRARIES}"));
            break;
        }
        if !known.insert(library.clone()) {
            continue;
        }
        match folder.read_or_neighbour(&library, TEXT_LIMIT) {
            Ok(bytes) => parsed.extend(parse(file, &library, &bytes, sink)),
            Err(why) => {
                let what = format!("material library `{library}`: {why}; its materials are light grey");
                lost.push(what);
            }
        }
    }
    // The scene was given another name, and its library with it.
    let own = format!("{}.mtl", file.strip_suffix(".obj").unwrap_or(file));
    let own = own.rsplit(['/', '\\']).next().unwrap_or(&own);
    if parsed.is_empty()
        && !known.contains(own)
        && folder.has(own)
        && let Ok(bytes) = folder.read_or_neighbour(own, TEXT_LIMIT)
    {
        parsed = parse(file, own, &bytes, sink);
        let what = format!("material library `{own}` beside it is taken: it names none that is there");
        sink.repaired(file, "", what);
        lost.clear();
    }
    for what in lost {
        sink.repaired(file, "", what);
    }
    let mut textures = Textures::new(file, folder, &parsed, sink);
    let mut entities = BTreeMap::new();
    let last: HashMap<&str, usize> = parsed.iter().enumerate().map(|(i, m)| (m.name.as_str(), i)).collect();
    for (i, material) in parsed.iter().enumerate() {
        if last.get(material.name.as_str()) != Some(&i) {
            let what = format!("material `{}` is defined twice; the last counts", material.name);
            sink.repaired(file, "", what);
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

/// More than any scene has: each costs a look into the folder.
const MOST_LIBRARIES: usize = 1024;
/// Most words of a name with spaces.
const MOST_WORDS: usize = 8;

/// The names in one `mtllib` statement: several, with spaces in them (`\ ` in some programs), or both. Where words could be
/// one name or several, the longest is meant that is there, else one up to its `.mtl`.
fn libraries_of<'a>(folder: &'a Folder, statement: &str) -> impl Iterator<Item = String> + use<'a> {
    let statement = if folder.has(statement) { statement } else { unquoted(before_comment(statement)) };
    let marked = statement.replace("\\ ", "\0");
    let words: Vec<String> = marked.split_ascii_whitespace().map(|word| word.replace('\0', " ")).collect();
    let mut whole = Some(statement.to_owned()).filter(|whole| words.len() > 1 && folder.has(whole));
    let mut first = if whole.is_some() { words.len() } else { 0 };
    std::iter::from_fn(move || {
        if whole.is_some() {
            return whole.take();
        }
        let rest = words.get(first..).filter(|rest| !rest.is_empty())?;
        let most = rest.len().min(MOST_WORDS);
        let there = (1..=most).rev().find(|&count| folder.has(&rest[..count].join(" ")));
        let is_end = |&count: &usize| rest[count - 1].to_ascii_lowercase().ends_with(".mtl");
        let count = there.or_else(|| (1..=most).find(is_end)).unwrap_or(1);
        first += count;
        Some(rest[..count].join(" "))
    })
}

fn parse(file: &str, library: &str, bytes: &[u8], sink: &mut Sink<'_>) -> Vec<tobj::Material> {
    let text = match lines::text_of(library, bytes) {
        Ok(text) => text,
        Err(why) => {
            sink.ignored(file, "", format!("material library {why}"));
            return Vec::new();
        }
    };
    let version = blender::version(&text);
    let tidied = tidy(library, &text, version.is_some(), sink);
    match tobj::load_mtl_buf(&mut tidied.as_bytes()) {
        Ok((mut materials, _)) => {
            let restated = |version| {
                materials.iter_mut().filter_map(|m| blender::restate(m, version).then_some(())).count()
            };
            if version.map_or(0, restated) > 0 {
                let what =
                    "written by Blender: Ns says roughness, Ks the strength of gloss, illum 3 and 6 metal";
                sink.decide(library, what);
            }
            if vtk::is_by_vtk(&text) {
                materials.iter_mut().for_each(vtk::restate);
                sink.decide(library, vtk::WHAT);
            }
            materials
        }
        Err(why) => {
            sink.ignored(file, "", format!("material library `{library}` cannot be read: {why}"));
            Vec::new()
        }
    }
}

/// Three numbers of a statement that `tobj` keeps as text.
fn color(material: &tobj::Material, keyword: &str) -> Option<Vec3> {
    let mut numbers =
        material.unknown_param.get(keyword)?.split_ascii_whitespace().map_while(|word| word.parse().ok());
    Some(Vec3::new(numbers.next()?, numbers.next()?, numbers.next()?))
}

fn scalar(material: &tobj::Material, keyword: &str) -> Option<f32> {
    material.unknown_param.get(keyword)?.parse().ok()
}

/// Index of refraction of glass that says none, or none that bends light into it.
const USUAL_INDEX: f32 = 1.5;
/// Below this exponent of Blinn-Phong there is no highlight to be seen.
const LEAST_EXPONENT: f32 = 2.0;

fn convert(file: &str, material: &tobj::Material, textures: &mut Textures, sink: &mut Sink<'_>) -> Material {
    let name = &material.name;
    let mut out_of_range = BTreeSet::new();
    let mut within = |keyword: &str, value: f32, low: f32, high: f32| {
        if !(low..=high).contains(&value) {
            out_of_range.insert(format!("{keyword} {value}"));
        }
        value.clamp(low, high)
    };
    let mut unit = |keyword: &str, color: Vec3| {
        Vec3::from(color.to_array().map(|value| within(keyword, value, 0.0, 1.0)))
    };
    let has_texture = material.diffuse_texture.is_some();
    let is_mapped = |keyword: &str| material.unknown_param.contains_key(keyword);
    let mut diffuse =
        unit("Kd", material.diffuse.map_or(Vec3::splat(if has_texture { 1.0 } else { 0.8 }), Vec3::from));
    let no_specular = material.specular.is_none_or(|specular| specular == [0.0; 3]);
    if no_specular && material.specular_texture.is_some() && !is_mapped(blender::GLOSS) {
        let what = "map_Ks without Ks, which says how much, or with a black one: left out";
        sink.ignored(file, &format!("material `{name}`"), what);
    }
    let mut specular = unit("Ks", material.specular.map_or(Vec3::ZERO, Vec3::from));
    let tint = unit("Tf", color(material, "Tf").unwrap_or(Vec3::ONE));
    // A map alone is the value itself; what stands in for one that is not there is no lamp.
    let unsaid = if textures.has(material, "map_Ke") { Vec3::ONE } else { Vec3::ZERO };
    let mut emission = material.emissive.map_or(unsaid, Vec3::from).max(Vec3::ZERO);
    if emission == Vec3::ZERO && unsaid != Vec3::ZERO {
        let what = "Ke is black, and map_Ke would not be seen: as if it were white";
        sink.repaired(file, &format!("material `{name}`"), what);
        emission = unsaid;
    }
    let exponent = within("Ns", material.shininess.unwrap_or(0.0), 0.0, 1e6);
    let opacity = material
        .dissolve
        // Some exporters write `Tr 1` for what is there; nobody makes a model that cannot be seen.
        .or_else(|| {
            scalar(material, "Tr")
                .filter(|&transparency| transparency < 1.0)
                .map(|transparency| 1.0 - transparency)
        });
    let mut opacity = within("d", opacity.unwrap_or(1.0), 0.0, 1.0);
    if opacity == 0.0 && textures.has(material, "map_d") {
        let what = "d is 0, and map_d would not be seen: as if it were 1";
        sink.repaired(file, &format!("material `{name}`"), what);
        opacity = 1.0;
    }
    let mut fraction =
        |keyword: &str| scalar(material, keyword).map(|value| within(keyword, value, 0.0, 1.0));
    let is_pbr = ["Pr", "Pm", "map_Pr", "map_Pm"].iter().any(|keyword| is_mapped(keyword))
        || ["Ps", "Pc", "aniso"].iter().any(|keyword| fraction(keyword).is_some_and(|factor| factor > 0.0));
    // A picture of what is 0 would not be seen.
    let mut factor = |keyword: &str, map: &str, unsaid: f32| match fraction(keyword) {
        Some(value) if value > 0.0 || !is_mapped(map) => value,
        _ if is_mapped(map) => 1.0,
        _ => unsaid,
    };
    let pbr = is_pbr.then(|| (factor("Pr", "map_Pr", 0.5), factor("Pm", "map_Pm", 0.0)));
    let mut layers = Layers {
        ior: material.optical_density.filter(|&ior| ior >= 1.0).unwrap_or(1.5),
        ..Layers::default()
    };
    layers.clearcoat = fraction("Pc").filter(|&factor| factor > 0.0).map(|factor| Clearcoat {
        factor,
        texture: None,
        roughness: fraction("Pcr").unwrap_or(0.0),
        roughness_texture: None,
        normal_map: None,
    });
    layers.sheen = fraction("Ps").filter(|&sheen| sheen > 0.0).map(|sheen| Sheen {
        color: Vec3::splat(sheen),
        color_texture: None,
        roughness: 0.5,
        roughness_texture: None,
    });
    layers.anisotropy = fraction("aniso").filter(|&strength| strength > 0.0).map(|strength| Anisotropy {
        strength,
        rotation: fraction("anisor").unwrap_or(0.0) * std::f32::consts::TAU,
        texture: None,
    });
    if let Some(gloss) = scalar(material, blender::GLOSS) {
        layers.specular_color = Vec3::splat(gloss);
        layers.specular_color_texture = textures.strength(material, sink);
    }
    layers.transmission = scalar(material, blender::THROUGH).map(|factor| Transmission {
        factor,
        texture: None,
        body: Some(Body { absorption: Vec3::ZERO }),
    });
    let ior = material.optical_density.filter(|&ior| ior > 1.0).unwrap_or(USUAL_INDEX);
    if !out_of_range.is_empty() {
        let which = out_of_range.into_iter().collect::<Vec<_>>().join(", ");
        sink.repaired(
            file,
            &format!("material `{name}`"),
            format!("a value is out of range, clamped: {which}"),
        );
    }
    let model = material.illumination_model.unwrap_or(2);
    let passes = matches!(model, 4 | 6 | 7 | 9);
    // Some exporters write these models for all materials, others for what is half-transparent.
    // Of what is not there at all the light that passes is to be seen.
    let is_whole = opacity == 1.0 || opacity == 0.0;
    let is_bent = material.optical_density.is_some_and(|ior| ior > 1.0) && is_whole;
    let is_tinted = tint != Vec3::ONE && tint != Vec3::ZERO;
    let is_black = diffuse == Vec3::ZERO && !has_texture;
    // A filter of 0 lets nothing pass. Some programs write so what lets all pass: where there is nothing else to be seen.
    let is_dark = tint == Vec3::ZERO && !is_black;
    let is_glass = passes && !is_dark && (is_bent || is_tinted || is_black) && !has_texture;
    let tint = if tint == Vec3::ZERO { Vec3::ONE } else { tint };
    if material.ambient_texture.is_some() && !has_texture {
        sink.ignored(file, &format!("material `{name}`"), "map_Ka without map_Kd: the picture is not seen");
    }
    let mut decide = |what: String| sink.remark(Kind::Decided, file, &format!("material `{name}`"), what, 1);
    if let Some(said) = material.optical_density.filter(|&said| is_glass && said <= 1.0) {
        decide(format!("glass with Ni {said}, which bends no light into it: {USUAL_INDEX} instead"));
    }
    if is_tinted && !passes {
        decide(format!("Tf is not seen: illum {model} lets no light through"));
    }
    if material.dissolve.is_none() && scalar(material, "Tr").is_some_and(|through| through >= 1.0) {
        decide("Tr 1 would be nothing at all: taken for opaque".to_owned());
    }
    if is_glass && material.diffuse.is_some() && !is_black && diffuse != Vec3::ONE {
        let what = format!("illum {model} is glass: its Kd is not seen");
        sink.remark(Kind::Decided, file, &format!("material `{name}`"), what, 1);
    }
    if passes && !is_glass {
        let what = match opacity < 1.0 {
            _ if has_texture => format!("illum {model} with map_Kd: no glass, but its picture"),
            true => format!("illum {model} with d {opacity}: half-transparent, no glass"),
            false if is_dark => format!("illum {model} with Tf 0, which lets no light through: no glass"),
            false => format!("illum {model} without Ni above 1, Tf or black Kd: no glass, but its Kd"),
        };
        sink.remark(Kind::Decided, file, &format!("material `{name}`"), what, 1);
    }
    if has_texture && !is_glass && diffuse == Vec3::ZERO {
        // So some exporters say that the picture alone counts; a product with it nobody means.
        let what = "Kd is black, and map_Kd would not be seen: as if it were white";
        sink.repaired(file, &format!("material `{name}`"), what);
        diffuse = Vec3::ONE;
    }
    let is_mirror = matches!(model, 3 | 5) && specular != Vec3::ZERO;
    // Many programs write a Ks for all materials, and an exponent of 0 or 1 or none where there is no highlight: the lobe would
    // be as wide as Kd's and wash it out.
    let has_highlight = exponent >= LEAST_EXPONENT || material.shininess_texture.is_some();
    if pbr.is_none() && !is_glass && !is_mirror && model >= 2 && specular != Vec3::ZERO && !has_highlight {
        let what = format!("Ks with Ns below {LEAST_EXPONENT}, or none: no highlight, its Kd alone");
        sink.remark(Kind::Decided, file, &format!("material `{name}`"), what, 1);
        specular = Vec3::ZERO;
    }
    let uses_specular = pbr.is_none() && !is_glass && (is_mirror || (model >= 2 && specular != Vec3::ZERO));
    let most = (diffuse + specular).max_element();
    if uses_specular && most > 1.0 {
        let what = "Kd + Ks is above 1 and would create light; both scaled down";
        sink.repaired(file, &format!("material `{name}`"), what);
        diffuse /= most;
        specular /= most;
    }
    let base_color_texture = if is_glass { None } else { textures.color(material, sink) };
    let is_cut_out = !is_glass && textures.has_cut_outs(material);
    if is_cut_out {
        let what = "map_Kd has an alpha channel: it says what is there";
        sink.remark(Kind::Decided, file, &format!("material `{name}`"), what.to_owned(), 1);
    }
    let transparent = opacity < 1.0 || material.dissolve_texture.is_some() || is_cut_out;
    Material {
        base_color: if is_glass { Vec3::ZERO } else { diffuse },
        base_color_texture,
        glossy: match pbr {
            _ if is_glass => Glossy::None,
            Some((roughness, metallic)) => {
                let texture = textures.metal_and_roughness(material, sink);
                Glossy::Ggx { metallic, roughness, texture }
            }
            None if uses_specular && !is_mirror => {
                Glossy::BlinnPhong { specular, exponent, texture: textures.gloss(material, sink) }
            }
            None => Glossy::None,
        },
        layers: (pbr.is_some() && !is_glass && layers != Layers::default()).then(|| Box::new(layers)),
        normal_map: textures.normals(material, sink),
        mirror: if uses_specular && is_mirror { specular } else { Vec3::ZERO },
        glass: is_glass.then_some(Glass { ior, tint }),
        emission,
        emission_texture: if emission == Vec3::ZERO { None } else { textures.emission(material, sink) },
        alpha: if transparent && !is_glass { Alpha::Blend } else { Alpha::Opaque },
        opacity: if is_glass { 1.0 } else { opacity },
        // The format knows no sides.
        double_sided: true,
        culled: false,
        unlit: false,
    }
}
