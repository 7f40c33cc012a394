//! Wavefront OBJ and MTL → entities.
//!
//! Geometry is read here: the crate `tobj` stops at a byte order mark or a continued line, wraps
//! indices around, fans concave polygons and gives no line numbers. Material libraries are read by
//! `tobj`, after [`tidy`] has checked and tidied their statements one by one (it panics on a colour
//! of two numbers, and one bad statement would lose the whole library).
//!
//! Rules where the format leaves a choice: each object (`o`) or, where no two have faces, each group (`g`) is a [`Mesh`] and
//! an [`Instance`] of its own, unless they are very many or lie through one another ([`parts`]); `usemtl` may change with every
//! face; polygons are cut into `n - 2` triangles in their own plane;
//! without normals a face is flat unless a smoothing group (`s`) says otherwise; texture
//! coordinates are turned from bottom-left to top-left; a face with a vertex spelled `nan` or `inf`
//! is refused with its line, one with a number too large is dropped with a warning; points, lines and free-form
//! statements are skipped.

mod assemble;
mod blender;
mod lines;
mod map;
mod mtl;
mod numbers;
mod parts;
mod polygon;
mod raw;
mod relief;
mod textures;
mod tidy;
mod vtk;

use super::error::LoadError;
use super::first_bytes::not_a_scene;
use super::geometry;
use super::report::{Kind, Phase, Sink};
use super::settings::Materials;
use super::source::{Bytes, Folder};
use super::tangents;
use crate::scene::{Instance, Material, Mesh, Transform};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{DAffine3, DVec3, Vec3};
use parts::Kinds;
use raw::Raw;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Reads `bytes` and puts mesh and materials on `root`.
pub(super) fn load(
    file: &str,
    folder: &Folder,
    bytes: Bytes,
    root: Entity,
    overrides: &mut Materials,
    sink: &mut Sink<'_>,
) -> Result<(), LoadError> {
    sink.begin(Phase::Parsing);
    // Text in UTF-16 has an answer of its own.
    let is_wide = bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff");
    if let Some(what) = not_a_scene(&bytes).filter(|_| !is_wide) {
        return Err(LoadError::broken(file, "content", format!("is {what}")));
    }
    let text = lines::text_of(file, &bytes)?;
    let mut raw = Raw::default();
    lines::for_each(&text, |statement| raw.read(file, &statement))?;
    drop(text);
    drop(bytes);
    sink.budget.take(raw.memory(), file, "its lists and faces")?;
    raw.settle(file, sink);
    raw.take_paint(file, sink);
    raw.scale_colors(file, sink);
    raw.check(file, sink)?;
    raw.warn(file, sink);
    sink.begin(Phase::Images);
    let library = match overrides.all {
        Some(_) => BTreeMap::new(),
        None => mtl::spawn_all(file, folder, &raw.libraries, overrides, sink),
    };
    let library = Library::new(&library);
    // Colours at the vertices are all of it.
    let has_colors = !raw.colors.is_empty();
    let base_color = if has_colors { Vec3::ONE } else { Material::default().base_color };
    let plain = Material { base_color, ..Material::default() };
    let materials: Vec<Entity> = raw
        .materials
        .iter()
        .map(|name| material_entity(file, name.as_deref(), &library, &plain, overrides, sink))
        .collect();
    sink.begin(Phase::Meshes);
    // What one moves by hand is the model, wherever its file has it.
    let holder = if raw.origin == DVec3::ZERO {
        root
    } else {
        let place = Transform(DAffine3::from_translation(raw.origin));
        sink.spawn((Name::new("place"), place, ChildOf(root)))
    };
    spawn_things(file, &raw, &materials, holder, sink);
    Ok(())
}

/// Puts the mesh on `holder`, or its parts below it.
fn spawn_things(file: &str, raw: &Raw, materials: &[Entity], holder: Entity, sink: &mut Sink<'_>) {
    let (of_faces, names) = parts::of_faces(&raw.objects, &raw.groups, raw.faces.len());
    let kinds = Kinds::new(&raw.faces, &of_faces);
    let cut = assemble::mesh(raw, &kinds);
    if cut.given_up > 0 {
        let what = "faces of so many corners that they were not cut up rightly: part them".to_owned();
        sink.remark(Kind::Approximated, file, "", what, cut.given_up);
    }
    // As a whole, so that normals and directions go on from part to part.
    let mut done = geometry::finish(cut.mesh, false, |_| true);
    let worn: Vec<Entity> =
        kinds.kinds.iter().map(|&(_, material)| materials[usize::from(material)]).collect();
    tangents::complete_for(&mut done.mesh, &worn, file, "", sink);
    done.mended.tell(file, "", sink);
    sink.report.triangles += done.triangles;
    let is_parted = kinds.parts() > 1 && kinds.overlap(&done.mesh) <= parts::MOST_OVERLAP;
    if let Some(what) = parts::told(&raw.objects, &raw.groups, names.len(), is_parted) {
        sink.decide(file, what);
    }
    let things = if is_parted {
        parts::split(&done.mesh, &kinds.kinds, names.len())
            .into_iter()
            .zip(names.into_iter().map(Some))
            .collect()
    } else {
        vec![(kinds.as_materials(done.mesh), None)]
    };
    for ((mesh, slots), name) in things.into_iter().filter(|((mesh, _), _)| !mesh.triangles.is_empty()) {
        let materials = slots.iter().map(|&slot| materials[usize::from(slot)]).collect();
        let mesh = sink.spawn((Name::new("mesh"), Mesh(Arc::new(mesh))));
        let thing = match name {
            Some(name) => sink.spawn((Name::new(name), Transform::default(), ChildOf(holder))),
            None => holder,
        };
        sink.world.entity_mut(thing).insert(Instance { mesh, materials });
    }
}

/// Materials by their names, and by what is left of these where people are less exact; the first of each counts.
struct Library<'a> {
    exact: &'a BTreeMap<String, Entity>,
    bare: HashMap<&'a str, Entity>,
    lower: HashMap<String, (&'a str, Entity)>,
    /// The last one that has no name, for `usemtl` without one.
    nameless: Option<Entity>,
}

impl<'a> Library<'a> {
    fn new(exact: &'a BTreeMap<String, Entity>) -> Self {
        let (mut bare, mut lower) = (HashMap::new(), HashMap::new());
        for (name, &entity) in exact {
            bare.entry(bare_name(name)).or_insert(entity);
            lower.entry(name.to_lowercase()).or_insert((name.as_str(), entity));
        }
        let nameless = exact.iter().filter(|(name, _)| name.starts_with(tidy::NAMELESS));
        // Of numbers, the longer is the larger.
        let last = nameless.max_by_key(|(name, _)| (name.len(), name.as_str()));
        let nameless = last.map(|(_, &entity)| entity);
        Self { exact, bare, lower, nameless }
    }
}

/// Names may have `#` in them; where none is defined so, it begins a comment.
fn bare_name(name: &str) -> &str {
    lines::unquoted(lines::before_comment(name))
}

/// The entity for a `usemtl` name, or for faces before the first one; `plain` is what there is without any.
fn material_entity(
    file: &str,
    name: Option<&str>,
    library: &Library<'_>,
    plain: &Material,
    overrides: &mut Materials,
    sink: &mut Sink<'_>,
) -> Entity {
    if let Some(all) = overrides.all {
        return all;
    }
    if let (Some(""), Some(nameless)) = (name, library.nameless) {
        return nameless;
    }
    let Some(name) = name.filter(|name| !name.is_empty()) else {
        if plain.base_color != Vec3::ONE {
            sink.decide(file, "surfaces without a material are light grey");
        }
        return sink.spawn((Name::new("default"), plain.clone()));
    };
    if let Some(&known) = library.exact.get(name).or_else(|| library.bare.get(bare_name(name))) {
        return known;
    }
    if let Some(replacement) = overrides.replacement(name) {
        return replacement;
    }
    let short: String = name.chars().take(80).collect();
    if let Some(&(other, entity)) = library.lower.get(&name.to_lowercase()) {
        sink.repaired(file, "", format!("material `{short}` is defined as `{other}`"));
        return entity;
    }
    sink.repaired(file, "", format!("material `{short}` is not defined; light grey"));
    sink.spawn((Name::new(short), plain.clone()))
}
