//! MTL libraries → material entities. `tobj` parses what [`tidy`] lets through.

use super::lines::{self, Statement};
use super::map::Textures;
use crate::load::error::ReadError;
use crate::load::report::Sink;
use crate::load::settings::Materials;
use crate::load::source::{Bytes, Folder, TEXT_LIMIT};
use crate::scene::{Alpha, Glass, Glossy, Material};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::Vec3;
use std::collections::BTreeMap;
use std::fmt::Write;

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
            let what = format!("material `{}` is defined twice; the first counts", material.name);
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

/// The files of one `mtllib` statement: one name with spaces, or several names.
fn open(file: &str, folder: &Folder, library: &str, sink: &mut Sink<'_>) -> Vec<(String, Bytes)> {
    let mut found = Vec::new();
    let whole = folder.read_or_neighbour(library, TEXT_LIMIT);
    let several = library.split_ascii_whitespace().count() > 1 && matches!(whole, Err(ReadError::Missing));
    let names: Vec<&str> = if several { library.split_ascii_whitespace().collect() } else { vec![library] };
    for name in names {
        match folder.read_or_neighbour(name, TEXT_LIMIT) {
            Ok(bytes) => found.push((name.to_owned(), bytes)),
            Err(why) => {
                let what = format!("material library `{name}`: {why}; its materials are light grey");
                sink.repaired(file, "", what);
            }
        }
    }
    found
}

fn parse(file: &str, library: &str, bytes: &[u8], sink: &mut Sink<'_>) -> Vec<tobj::Material> {
    let text = match lines::text_of(library, bytes) {
        Ok(text) => text,
        Err(why) => {
            sink.ignored(file, "", format!("material library {why}"));
            return Vec::new();
        }
    };
    let tidied = tidy(library, &text, sink);
    match tobj::load_mtl_buf(&mut tidied.as_bytes()) {
        Ok((materials, _)) => materials,
        Err(why) => {
            sink.ignored(file, "", format!("material library `{library}` cannot be read: {why}"));
            Vec::new()
        }
    }
}

/// Only statements that `tobj` parses, in its spelling; warns of the others.
fn tidy(library: &str, text: &str, sink: &mut Sink<'_>) -> String {
    let mut tidied = String::with_capacity(text.len());
    let mut inside = false;
    let done: Result<(), std::fmt::Error> = lines::for_each(text, |Statement { line, keyword, rest }| {
        let mut ignore = |what: &str| {
            sink.ignored(library, &format!("line {line}"), format!("`{keyword}` {what}"));
            Ok(())
        };
        if keyword == "newmtl" {
            inside = !rest.is_empty();
            return if inside { writeln!(tidied, "newmtl {rest}") } else { ignore("without a name") };
        }
        if !inside {
            return ignore("before the first newmtl, ignored");
        }
        let values: Option<Vec<f32>> = rest
            .split_ascii_whitespace()
            .map(|word| word.parse().ok().filter(|v: &f32| v.is_finite()))
            .collect();
        match (keyword, values.as_deref()) {
            ("Ka" | "Kd" | "Ks" | "Ke" | "Tf", Some([r, g, b, ..])) => {
                writeln!(tidied, "{keyword} {r} {g} {b}")
            }
            ("Ka" | "Kd" | "Ks" | "Ke" | "Tf", Some([grey])) => {
                writeln!(tidied, "{keyword} {grey} {grey} {grey}")
            }
            ("Ka" | "Kd" | "Ks" | "Ke" | "Tf", _) => ignore("without three numbers, ignored"),
            ("d", _) if rest.starts_with("-halo") => ignore("-halo is not supported, ignored"),
            ("Ns" | "Ni" | "d" | "Tr" | "Pr" | "Pm", Some([value, ..])) => {
                writeln!(tidied, "{keyword} {value}")
            }
            ("Ns" | "Ni" | "d" | "Tr" | "Pr" | "Pm", _) => ignore("without a number, ignored"),
            ("illum", Some([model, ..])) if (0.0..=10.0).contains(model) => {
                writeln!(tidied, "illum {}", *model as u8)
            }
            ("illum", _) => ignore("with an unknown model, ignored"),
            ("map_Kd" | "map_d" | "map_Ke", _) if rest.is_empty() => ignore("without a file name, ignored"),
            ("map_Kd" | "map_d" | "map_Ke", _) => writeln!(tidied, "{keyword} {rest}"),
            (
                "map_Ks" | "map_Ns" | "map_Bump" | "map_bump" | "bump" | "disp" | "decal" | "refl" | "norm",
                _,
            ) => {
                sink.ignored(
                    library,
                    &format!("line {line}"),
                    format!("`{keyword}` textures are not supported"),
                );
                Ok(())
            }
            // The ambient colour of a lighting model without other light.
            ("map_Ka", _) => Ok(()),
            _ => ignore("is not supported"),
        }
    });
    // Writing to a String cannot fail.
    debug_assert!(done.is_ok());
    tidied
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

fn convert(file: &str, material: &tobj::Material, textures: &mut Textures, sink: &mut Sink<'_>) -> Material {
    let name = &material.name;
    let mut out_of_range = false;
    let mut within = |value: f32, low: f32, high: f32| {
        out_of_range |= !(low..=high).contains(&value);
        value.clamp(low, high)
    };
    let mut unit = |color: Vec3| Vec3::from(color.to_array().map(|value| within(value, 0.0, 1.0)));
    let has_texture = material.diffuse_texture.is_some();
    let mut diffuse =
        unit(material.diffuse.map_or(Vec3::splat(if has_texture { 1.0 } else { 0.8 }), Vec3::from));
    let mut specular = unit(material.specular.map_or(Vec3::ZERO, Vec3::from));
    let tint = unit(color(material, "Tf").unwrap_or(Vec3::ONE));
    let emission = material.emissive.map_or(Vec3::ZERO, Vec3::from).max(Vec3::ZERO);
    let exponent = within(material.shininess.unwrap_or(0.0), 0.0, 1e6);
    let opacity = material
        .dissolve
        // Some exporters write `Tr 1` for what is there; nobody makes a model that cannot be seen.
        .or_else(|| {
            scalar(material, "Tr")
                .filter(|&transparency| transparency < 1.0)
                .map(|transparency| 1.0 - transparency)
        });
    let opacity = within(opacity.unwrap_or(1.0), 0.0, 1.0);
    let pbr = match (scalar(material, "Pr"), scalar(material, "Pm")) {
        (None, None) => None,
        (rough, metal) => {
            Some((within(rough.unwrap_or(0.5), 0.0, 1.0), within(metal.unwrap_or(0.0), 0.0, 1.0)))
        }
    };
    let ior = material.optical_density.filter(|&ior| ior > 1.0).unwrap_or(1.5);
    if out_of_range {
        sink.repaired(file, &format!("material `{name}`"), "a value is out of range, clamped");
    }
    let model = material.illumination_model.unwrap_or(2);
    let is_glass = matches!(model, 4 | 6 | 7 | 9);
    let is_mirror = matches!(model, 3 | 5) && specular != Vec3::ZERO;
    let uses_specular = pbr.is_none() && !is_glass && (is_mirror || (model >= 2 && specular != Vec3::ZERO));
    let most = (diffuse + specular).max_element();
    if uses_specular && most > 1.0 {
        let what = "Kd + Ks is above 1 and would create light; both scaled down";
        sink.repaired(file, &format!("material `{name}`"), what);
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
