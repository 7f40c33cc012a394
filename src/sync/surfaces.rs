//! Materials and textures → numbered surfaces.

use super::Redone;
use crate::scene::{Alpha, Encoding, Filter, Glossy, Layers, Material, Texels, Texture, TextureUse, Wrap};
use crate::trace::bsdf::Passed;
use crate::trace::scene::{Coverage, Surface, TextureIndex};
use crate::trace::{Geometry, Lights, Surfaces};
use bevy_ecs::prelude::*;
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

/// Stable numbers of material entities in [`Surfaces`]; a freed number is used again. Number 0 is the
/// default material. It counts as changed only when an entity came or went.
#[derive(Resource, Clone, Debug, Default, PartialEq)]
pub struct MaterialNumbers(HashMap<Entity, u32>);

impl MaterialNumbers {
    /// The number of a material; 0 if there is no such entity.
    pub(super) fn of(&self, entity: Entity) -> u32 {
        self.0.get(&entity).copied().unwrap_or(0)
    }
}

/// Makes the surface list anew when a material or texture changed.
pub fn sync_surfaces(
    mut surfaces: ResMut<Surfaces>,
    mut material_numbers: ResMut<MaterialNumbers>,
    mut texture_numbers: Local<HashMap<Entity, u32>>,
    mut redone: ResMut<Redone>,
    materials: Query<(Entity, &Material)>,
    textures: Query<(Entity, &Texture)>,
    changed: Query<(), Or<(Changed<Material>, Changed<Texture>)>>,
    mut removed: (RemovedComponents<Material>, RemovedComponents<Texture>),
) {
    let removed = removed.0.read().count() + removed.1.read().count();
    if changed.is_empty() && removed == 0 {
        return;
    }
    let mut numbers = material_numbers.0.clone();
    renumber(&mut numbers, materials.iter().map(|(e, _)| e).collect(), 1);
    renumber(&mut texture_numbers, textures.iter().map(|(e, _)| e).collect(), 0);
    let resolve = |texture: Option<TextureUse>| {
        let TextureUse { texture, uv_transform, second_uvs } = texture?;
        texture_numbers.get(&texture).map(|&index| TextureIndex { index, uv_transform, second_uvs })
    };
    // One table for all bodies of the same index.
    let mut passed: HashMap<u32, Arc<Passed>> = HashMap::new();
    let room = |numbers: &HashMap<Entity, u32>| numbers.values().max().map_or(0, |&n| n as usize + 1);
    let mut list = vec![Surface::from(Material::default()); room(&numbers).max(1)];
    for (entity, material) in &materials {
        let layers = material.layers.as_ref().map(|layers| layers.renamed(|texture| resolve(Some(texture))));
        let is_body = |layers: &&Layers<TextureIndex>| {
            layers.transmission.as_ref().is_some_and(|transmission| transmission.body.is_some())
        };
        let passed = layers.as_ref().filter(is_body).map(|layers| {
            let table =
                passed.entry(layers.ior.to_bits()).or_insert_with(|| Arc::new(Passed::new(layers.ior)));
            Arc::clone(table)
        });
        list[numbers[&entity] as usize] = Surface {
            material: Material { layers: None, ..material.clone() },
            base_color_texture: resolve(material.base_color_texture),
            glossy_texture: resolve(match material.glossy {
                Glossy::Ggx { texture, .. } | Glossy::BlinnPhong { texture, .. } => texture,
                Glossy::None => None,
            }),
            emission_texture: resolve(material.emission_texture),
            normal_map: material.normal_map.and_then(|map| map.renamed(|texture| resolve(Some(texture)))),
            layers: layers.map(Box::new),
            passed,
        };
    }
    // Numbers that are free for the moment show nothing.
    let mut images: Vec<Option<Texture>> = vec![None; room(&texture_numbers)];
    for (entity, texture) in &textures {
        images[texture_numbers[&entity] as usize] = Some(texture.clone());
    }
    *surfaces =
        Surfaces { materials: list, textures: images.into_iter().map(|t| t.unwrap_or_else(white)).collect() };
    material_numbers.set_if_neq(MaterialNumbers(numbers));
    redone.surfaces += 1;
}

/// Says of which instances rays have to ask whether a hit counts.
pub fn sync_coverage(
    mut coverage: ResMut<Coverage>,
    geometry: Res<Geometry>,
    surfaces: Res<Surfaces>,
    lights: Res<Lights>,
) {
    if !(geometry.is_changed() || surfaces.is_changed() || lights.is_changed()) {
        return;
    }
    let is_opaque =
        |&m: &u32| surfaces.materials.get(m as usize).is_none_or(|s| s.material.alpha == Alpha::Opaque);
    let alpha = geometry.instances.iter().map(|data| !data.materials.iter().all(is_opaque)).collect();
    let is_culled =
        |&m: &u32| surfaces.materials.get(m as usize).is_some_and(|surface| surface.material.culled);
    let culled = geometry.instances.iter().map(|data| data.materials.iter().any(is_culled)).collect();
    let mut lit = vec![false; geometry.instances.len()];
    for instance in lights.instances() {
        lit[instance as usize] = true;
    }
    coverage.set_if_neq(Coverage { alpha, culled, lights: lit });
}

fn white() -> Texture {
    Texture {
        texels: Arc::new(Texels { width: 1, height: 1, texels: vec![[255; 4]] }),
        encoding: Encoding::Linear,
        wrap: [Wrap::Clamp; 2],
        filter: Filter::Nearest,
    }
}

/// Keeps the numbers of those that stay, gives the lowest free ones from `first` on to those that are new.
fn renumber(numbers: &mut HashMap<Entity, u32>, mut present: Vec<Entity>, first: u32) {
    present.sort_unstable();
    numbers.retain(|entity, _| present.binary_search(entity).is_ok());
    let mut taken: Vec<u32> = numbers.values().copied().collect();
    taken.sort_unstable();
    let mut free = (first..).filter(|n| taken.binary_search(n).is_err());
    for entity in present {
        if let Entry::Vacant(vacant) = numbers.entry(entity) {
            vacant.insert(free.next().unwrap_or(first));
        }
    }
}
