//! Wavefront OBJ and MTL → entities.
//!
//! Geometry is read here: the crate `tobj` stops at a byte order mark or a continued line, wraps
//! indices around, fans concave polygons and gives no line numbers. Material libraries are read by
//! `tobj`, after [`mtl`] has checked and tidied their statements one by one (it panics on a colour
//! of two numbers, and one bad statement would lose the whole library).
//!
//! Rules where the format leaves a choice: the whole file is one [`Mesh`] and one [`Instance`];
//! `usemtl` may change with every face; polygons are cut into `n - 2` triangles in their own plane;
//! without normals a face is flat unless a smoothing group (`s`) says otherwise; texture
//! coordinates are turned from bottom-left to top-left; `g`, `o`, points, lines and free-form
//! statements are skipped.

mod assemble;
mod lines;
mod mtl;
mod polygon;

use super::error::LoadError;
use super::geometry;
use super::report::Sink;
use super::settings::Materials;
use super::source::{Bytes, Folder};
use crate::scene::{Instance, Material, Mesh};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{Vec2, Vec3};
use lines::Statement;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Stands for "no index given".
const NONE: u32 = u32::MAX;

/// Reads `bytes` and puts mesh and materials on `root`.
pub(super) fn load(
    file: &str,
    folder: &Folder,
    bytes: Bytes,
    root: Entity,
    overrides: &mut Materials,
    sink: &mut Sink<'_>,
) -> Result<(), LoadError> {
    let text = lines::text_of(file, &bytes)?;
    let mut raw = Raw::default();
    lines::for_each(&text, |statement| raw.read(file, &statement))?;
    drop(text);
    drop(bytes);
    raw.check(file)?;
    raw.warn(file, sink);
    let library = match overrides.all {
        Some(_) => BTreeMap::new(),
        None => mtl::spawn_all(file, folder, &raw.libraries, overrides, sink),
    };
    let materials: Vec<Entity> =
        raw.materials.iter().map(|name| material_entity(file, name.as_deref(), &library, overrides, sink)).collect();
    let done = geometry::finish(assemble::mesh(&raw));
    for line in done.mended.lines() {
        sink.warn(format!("{file}: {line}"));
    }
    sink.report.triangles += done.triangles;
    if !done.mesh.triangles.is_empty() {
        let mesh = sink.spawn((Name::new("mesh"), Mesh(Arc::new(done.mesh))));
        sink.world.entity_mut(root).insert(Instance { mesh, materials });
    }
    Ok(())
}

/// The entity for a `usemtl` name, or for faces before the first one.
fn material_entity(
    file: &str,
    name: Option<&str>,
    library: &BTreeMap<String, Entity>,
    overrides: &mut Materials,
    sink: &mut Sink<'_>,
) -> Entity {
    if let Some(all) = overrides.all {
        return all;
    }
    let Some(name) = name else {
        sink.decide(format!("{file}: surfaces without a material are light grey"));
        return sink.spawn((Name::new("default"), Material::default()));
    };
    if let Some(&known) = library.get(name) {
        return known;
    }
    if let Some(replacement) = overrides.replacement(name) {
        return replacement;
    }
    let short: String = name.chars().take(80).collect();
    let lower = name.to_lowercase();
    if let Some((other, &entity)) = library.iter().find(|(other, _)| other.to_lowercase() == lower) {
        sink.warn(format!("{file}: material `{short}` is defined as `{other}`"));
        return entity;
    }
    sink.warn(format!("{file}: material `{short}` is not defined; light grey"));
    sink.spawn((Name::new(short), Material::default()))
}

/// One corner of a face: indices of position, texture coordinates and normal, or [`NONE`].
#[derive(Clone, Copy)]
struct Corner {
    position: u32,
    uv: u32,
    normal: u32,
}

/// One face as it stands in the file.
struct Face {
    /// Its corners begin here in [`Raw::corners`] and end where the next face's begin.
    first_corner: u32,
    line: u32,
    material: u16,
    /// Smoothing group; 0 is off.
    group: u32,
}

/// An OBJ file as it is written.
#[derive(Default)]
struct Raw {
    positions: Vec<Vec3>,
    /// Empty, or as long as `positions`.
    colors: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    corners: Vec<Corner>,
    faces: Vec<Face>,
    /// Names that faces use; None for faces before the first `usemtl`.
    materials: Vec<Option<String>>,
    libraries: Vec<String>,
    /// Of the faces to come.
    material: Option<String>,
    slot: Option<u16>,
    group: u32,
    short_faces: usize,
    first_short_face: u32,
    unknown: BTreeSet<String>,
}

impl Raw {
    fn read(&mut self, file: &str, statement: &Statement<'_>) -> Result<(), LoadError> {
        let broken = |problem: String| LoadError::broken(file, format!("line {}", statement.line), problem);
        match statement.keyword {
            "v" => self.read_position(statement.rest).map_err(broken)?,
            "vt" => {
                let ([u, v, _], count) = numbers::<3>(statement.rest).map_err(broken)?;
                if count == 0 {
                    return Err(broken("texture coordinate without numbers".to_owned()));
                }
                self.uvs.push(Vec2::new(u, 1.0 - v));
            }
            "vn" => match numbers::<3>(statement.rest).map_err(broken)? {
                (normal, 3) => self.normals.push(Vec3::from(normal)),
                (_, count) => return Err(broken(format!("normal of {count} numbers instead of 3"))),
            },
            "f" | "fo" => self.read_face(statement).map_err(broken)?,
            "usemtl" => {
                self.material = Some(statement.rest.to_owned());
                self.slot = None;
            }
            "mtllib" => self.libraries.push(statement.rest.to_owned()),
            "s" => self.group = statement.rest.parse().unwrap_or(0),
            "g" | "o" | "vp" | "p" | "l" => {}
            other => {
                if self.unknown.len() < 8 {
                    self.unknown.insert(other.chars().take(20).collect());
                }
            }
        }
        Ok(())
    }

    fn read_position(&mut self, text: &str) -> Result<(), String> {
        let (values, count) = numbers::<7>(text)?;
        if count < 3 {
            return Err(format!("vertex of {count} coordinates instead of 3"));
        }
        self.positions.push(Vec3::new(values[0], values[1], values[2]));
        // Six numbers end in a colour; seven have a weight before it.
        let color = if count >= 6 { Some(Vec3::from_slice(&values[count - 3..count])) } else { None };
        if color.is_some() && self.colors.is_empty() {
            self.colors.resize(self.positions.len() - 1, Vec3::ONE);
        }
        if color.is_some() || !self.colors.is_empty() {
            self.colors.push(color.unwrap_or(Vec3::ONE));
        }
        Ok(())
    }

    fn read_face(&mut self, statement: &Statement<'_>) -> Result<(), String> {
        let first = self.corners.len();
        for word in statement.rest.split_ascii_whitespace().take_while(|word| !word.starts_with('#')) {
            let mut parts = word.split('/');
            let mut index = |count: usize, what: &str| resolve(parts.next(), count, what);
            let position = index(self.positions.len(), "vertex")?;
            let uv = index(self.uvs.len(), "texture coordinate (vt)")?;
            let normal = index(self.normals.len(), "normal (vn)")?;
            if position == NONE {
                return Err(format!("face corner `{}` without a vertex index", shorten(word)));
            }
            self.corners.push(Corner { position, uv, normal });
        }
        if self.corners.len() - first < 3 {
            self.corners.truncate(first);
            self.first_short_face = if self.short_faces == 0 { statement.line } else { self.first_short_face };
            self.short_faces += 1;
            return Ok(());
        }
        let first_corner = u32::try_from(first).map_err(|_| "more than 2^32 face corners".to_owned())?;
        let material = match self.slot {
            Some(slot) => slot,
            None => self.current_slot()?,
        };
        self.faces.push(Face { first_corner, line: statement.line, material, group: self.group });
        Ok(())
    }

    fn current_slot(&mut self) -> Result<u16, String> {
        let known = self.materials.iter().position(|name| *name == self.material);
        let slot = known.unwrap_or_else(|| {
            self.materials.push(self.material.clone());
            self.materials.len() - 1
        });
        let slot = u16::try_from(slot).map_err(|_| "more than 65536 materials".to_owned())?;
        self.slot = Some(slot);
        Ok(slot)
    }

    /// Corners of face `i`.
    fn corners_of(&self, i: usize) -> &[Corner] {
        let start = self.faces[i].first_corner as usize;
        let end = self.faces.get(i + 1).map_or(self.corners.len(), |next| next.first_corner as usize);
        &self.corners[start..end]
    }

    /// Faces may stand before their vertices, so indices are checked at the end.
    fn check(&self, file: &str) -> Result<(), LoadError> {
        for (i, face) in self.faces.iter().enumerate() {
            for corner in self.corners_of(i) {
                let lists = [
                    (corner.position, self.positions.len(), "vertex"),
                    (corner.uv, self.uvs.len(), "texture coordinate (vt)"),
                    (corner.normal, self.normals.len(), "normal (vn)"),
                ];
                for (index, count, what) in lists {
                    if index != NONE && index as usize >= count {
                        let problem = format!("index out of range: {what} {} of {count}", u64::from(index) + 1);
                        return Err(LoadError::broken(file, format!("line {}", face.line), problem));
                    }
                }
            }
        }
        Ok(())
    }

    fn warn(&self, file: &str, sink: &mut Sink<'_>) {
        if self.short_faces > 0 {
            let (count, line) = (self.short_faces, self.first_short_face);
            sink.warn(format!("{file}: line {line}: {count} faces with fewer than three corners skipped"));
        }
        if !self.unknown.is_empty() {
            let names: Vec<&str> = self.unknown.iter().map(String::as_str).collect();
            sink.warn(format!("{file}: statements skipped: {}", names.join(", ")));
        }
        if self.faces.is_empty() {
            sink.warn(format!("{file}: no faces in it: nothing to see"));
        }
    }
}

/// Up to `N` numbers; how many there were. Values that are not finite are allowed, here.
fn numbers<const N: usize>(text: &str) -> Result<([f32; N], usize), String> {
    let mut values = [0.0; N];
    let mut count = 0;
    for word in text.split_ascii_whitespace().take_while(|word| !word.starts_with('#')).take(N) {
        values[count] = number(word).ok_or_else(|| format!("`{}` is not a number", shorten(word)))?;
        count += 1;
    }
    Ok((values, count))
}

/// A number; `1.#INF` and the like of old compilers are not finite.
fn number(word: &str) -> Option<f32> {
    let old = word.contains(".#IN") || word.contains(".#QNAN") || word.contains(".#SNAN");
    if old { Some(f32::NAN) } else { word.parse::<f64>().ok().map(|value| value as f32) }
}

/// Index from 0 of what a face names from 1, or from the end if negative.
fn resolve(word: Option<&str>, count: usize, what: &str) -> Result<u32, String> {
    let word = word.unwrap_or_default();
    if word.is_empty() {
        return Ok(NONE);
    }
    let out_of_range = || format!("index out of range: {what} {}, {count} so far", shorten(word));
    match word.parse::<i64>() {
        Ok(0) => Err(format!("index 0: {what} indices begin at 1")),
        Ok(index) if index > 0 => u32::try_from(index - 1).ok().filter(|&i| i != NONE).ok_or_else(out_of_range),
        Ok(index) => {
            let from_end = usize::try_from(index.unsigned_abs()).ok().and_then(|back| count.checked_sub(back));
            from_end.and_then(|i| u32::try_from(i).ok()).ok_or_else(out_of_range)
        }
        Err(error) => Err(format!("{what} index `{}` is not a number in range: {error}", shorten(word))),
    }
}

fn shorten(word: &str) -> String {
    word.chars().take(40).collect()
}
