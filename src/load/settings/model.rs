//! The `[[model]]` tables.

use super::{Check, Materials, Settings};
use crate::load::error::LoadError;
use crate::load::source::{Bytes, Folder, SCENE_LIMIT};
use crate::scene::Transform;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DMat4, DQuat, DVec3, DVec4, EulerRot};
use serde::Deserialize;
use std::path::Path;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ModelTable {
    file: String,
    material: Option<String>,
    matrix: Option<[[f64; 4]; 4]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 3]>,
    scale: Option<Scale>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "scale must be a number or three of them")]
enum Scale {
    Same(f64),
    Each([f64; 3]),
}

/// A model to load.
pub(in crate::load) struct Model {
    /// As messages name it.
    pub(in crate::load) file: String,
    /// Where the files it names are.
    pub(in crate::load) folder: Folder,
    pub(in crate::load) bytes: Bytes,
    pub(in crate::load) transform: Transform,
    /// Replaces all its materials.
    pub(in crate::load) material: Option<Entity>,
}

pub(super) fn resolve(
    settings: &Settings,
    table: &Spanned<ModelTable>,
    materials: &mut Materials,
) -> Result<Model, LoadError> {
    let model = table.get_ref();
    let wrong = |problem: String| settings.broken(table, "[[model]]", problem);
    let mut check = Check::default();
    let transform = placement(model, &mut check);
    if let Some(problem) = check.problem {
        return Err(wrong(problem));
    }
    let material = match &model.material {
        None => None,
        Some(name) => Some(
            materials.replacement(name).ok_or_else(|| wrong(format!("no [material.{name}] in this file")))?,
        ),
    };
    // Whoever writes a scene file may point anywhere, unlike what a downloaded model names.
    let (file, folder, read) = settings.folder.read_own(&model.file, SCENE_LIMIT);
    let bytes = read.map_err(|why| wrong(format!("`{}`: {why}", model.file)))?;
    if Path::new(&model.file).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml")) {
        return Err(wrong(format!(
            "`{}`: a settings file cannot be a model; name .gltf, .glb or .obj",
            model.file
        )));
    }
    Ok(Model { file, folder, bytes, transform, material })
}

fn placement(model: &ModelTable, check: &mut Check) -> Transform {
    if let Some(rows) = model.matrix {
        let parts = model.translation.is_some() || model.rotation.is_some() || model.scale.is_some();
        check
            .that(!parts, || "has both matrix and translation, rotation or scale: choose one way".to_owned());
        let matrix = DMat4::from_cols_array_2d(&rows).transpose();
        check.that(matrix.is_finite() && matrix.row(3) == DVec4::W, || {
            "matrix must be finite with the last row [0, 0, 0, 1]".to_owned()
        });
        return Transform(DAffine3::from_mat4(matrix));
    }
    let translation = check.point("translation", model.translation.unwrap_or([0.0; 3]));
    let [x, y, z] =
        check.point("rotation", model.rotation.unwrap_or([0.0; 3])).to_array().map(f64::to_radians);
    let scale = match model.scale {
        None => DVec3::ONE,
        Some(Scale::Same(all)) => check.point("scale", [all; 3]),
        Some(Scale::Each(each)) => check.point("scale", each),
    };
    Transform::from_parts(translation, DQuat::from_euler(EulerRot::ZYX, z, y, x), scale)
}
