//! glTF 2.0 → entities.
//!
//! The crate `gltf` gives the JSON schema (`gltf::json::Root`); everything that touches sizes and
//! indices is checked here, because its own import trusts them and its validation refuses files
//! before we could say why. The steps: container ([`container`]), JSON, buffers ([`buffer`]),
//! materials and images ([`material`], [`texture`]), hierarchy ([`node`]), meshes ([`mesh`]).
//!
//! Rules where the format leaves a choice: one [`crate::scene::Mesh`] per glTF mesh with all its
//! primitives; missing normals mean flat shading; skinned meshes stand in their rest pose, morph
//! targets at the default weights; 1 candela is 1/683 W/sr and 1 lux 1/683 W/m²,
//! unless the file shows that its lamps are in other units ([`units`]).

mod accessor;
mod animation;
mod buffer;
mod container;
mod deform;
mod draco;
mod head;
mod layers;
mod light;
mod material;
mod mesh;
mod meshopt;
mod node;
mod parse;
mod place;
mod texture;
mod units;
mod vertices;

use super::budget::Budget;
use super::error::{LoadError, choices};
use super::report::{Phase, Sink};
use super::settings::Materials;
use super::source::{Bytes, Folder, without_bom};
use animation::AnimationJson;
use bevy_ecs::prelude::*;
use gltf::json::mesh::Primitive;
use gltf::json::{Index, Root};
use parse::{Lenient, MeshMore, Placement};
use std::collections::HashMap;
use std::sync::Arc;

/// Reads `bytes` and spawns the default scene below `root`.
pub(super) fn load(
    file: &str,
    folder: &Folder,
    bytes: Bytes,
    root: Entity,
    overrides: &mut Materials,
    sink: &mut Sink<'_>,
) -> Result<(), LoadError> {
    sink.begin(Phase::Parsing);
    let container = container::split(file, &bytes)?;
    let json = parse::as_utf8(file, without_bom(container.json), sink)?;
    head::check(file, &json, sink)?;
    let (tree, more) = parse::parse_tree(file, &json, &sink.budget)?;
    sink.begin(Phase::Reading);
    let buffers = buffer::read_all(&tree, folder, container.binary, &sink.budget);
    let mut document = Document {
        file,
        folder,
        root: tree,
        placements: more.nodes,
        meshes: more.meshes,
        animations: more.animations,
        variant: None,
        unpacked: Vec::new(),
        decoded: HashMap::new(),
        budget: Arc::clone(&sink.budget),
        buffers,
    };
    document.choose_variant(sink)?;
    document.check_references()?;
    sink.begin(Phase::Decompressing);
    document.unpacked = meshopt::decode_all(&document)?;
    document.decoded = draco::decode_all(&document)?;
    sink.begin(Phase::Images);
    let materials = material::spawn_all(&document, overrides, sink)?;
    sink.begin(Phase::Meshes);
    node::spawn_scene(&document, root, materials, sink)
}

/// A parsed file with its binary data.
struct Document<'a> {
    file: &'a str,
    folder: &'a Folder,
    root: Root,
    placements: Vec<Placement>,
    meshes: Vec<MeshMore>,
    animations: Lenient<Vec<Lenient<AnimationJson>>>,
    /// Which of `KHR_materials_variants` is worn.
    variant: Option<u32>,
    buffers: Vec<buffer::Buffer<'a>>,
    /// Buffer views that were compressed, by index.
    unpacked: Vec<Option<Vec<u8>>>,
    /// Accessors of primitives that were compressed, by index.
    decoded: HashMap<usize, draco::Decoded>,
    budget: Arc<Budget>,
}

impl Document<'_> {
    fn broken(&self, place: impl std::fmt::Display, problem: impl std::fmt::Display) -> LoadError {
        LoadError::broken(self.file, place, problem)
    }

    /// Whether accessors and buffer views name what exists, used or not: a file where they do not is
    /// damaged.
    fn check_references(&self) -> Result<(), LoadError> {
        let root = &self.root;
        for (i, accessor) in root.accessors.iter().enumerate() {
            if let Some(view) = &accessor.buffer_view {
                self.at(&root.buffer_views, view, "buffer view", &format!("accessor {i}"))?;
            }
        }
        for (i, view) in root.buffer_views.iter().enumerate() {
            self.at(&root.buffers, &view.buffer, "buffer", &format!("buffer view {i}"))?;
        }
        Ok(())
    }

    /// Takes the material variant that the user wants.
    fn choose_variant(&mut self, sink: &mut Sink<'_>) -> Result<(), LoadError> {
        let extension = self.root.extensions.as_ref().and_then(|e| e.khr_materials_variants.as_ref());
        let variants = extension.map_or(&[][..], |extension| &extension.variants).iter().zip(0_u32..);
        let names: Vec<(String, u32)> = variants.map(|(variant, i)| (variant.name.clone(), i)).collect();
        self.variant = match &sink.options.variant {
            Some(wanted) => Some(self.chosen(wanted, "variant", &names)?),
            None => None,
        };
        if !names.is_empty() {
            let all: Vec<&str> = names.iter().map(|(name, _)| name.as_str()).collect();
            let worn = self.variant.map_or("its default materials", |i| all[i as usize]);
            sink.decide(self.file, format!("wears {worn} (--variant: {})", all.join(", ")));
        }
        Ok(())
    }

    /// The material of a primitive in the variant that is worn.
    fn material_of(&self, primitive: &Primitive) -> Option<u32> {
        let mappings = primitive.extensions.as_ref().and_then(|e| e.khr_materials_variants.as_ref());
        let mapped = self.variant.zip(mappings).and_then(|(variant, extension)| {
            extension.mappings.iter().find(|mapping| mapping.variants.contains(&variant))
        });
        mapped
            .map(|mapping| mapping.material)
            .or_else(|| primitive.material.as_ref().map(|index| index.value() as u32))
    }

    /// What the user chose by name or number.
    fn chosen<T: Copy>(
        &self,
        wanted: &str,
        kind: &'static str,
        list: &[(String, T)],
    ) -> Result<T, LoadError> {
        let by_name = list.iter().find(|(name, _)| name == wanted);
        let by_number = || list.get(wanted.parse::<usize>().ok()?);
        by_name.or_else(by_number).map(|&(_, value)| value).ok_or_else(|| {
            let names = choices(list.iter().map(|(name, _)| name.as_str()), "none");
            LoadError::NotThere { file: self.file.to_owned(), kind, wanted: wanted.to_owned(), names }
        })
    }

    /// The object that `index` names, or an error that says who names it.
    fn at<'l, T>(&self, list: &'l [T], index: &Index<T>, kind: &str, user: &str) -> Result<&'l T, LoadError> {
        list.get(index.value()).ok_or_else(|| {
            self.broken(user, format!("index out of range: names {kind} {} of {}", index.value(), list.len()))
        })
    }
}
