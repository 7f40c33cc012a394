//! Entities by the names on the way to them, so that a file can speak of them.

use super::Camera;
use bevy_ecs::prelude::*;
use std::collections::{HashMap, HashSet};

/// Paths of many entities: siblings are looked at once.
pub struct Paths<'w> {
    world: &'w World,
    /// Of whom the labels of all children, or of all that have no parent, are known.
    labelled: HashSet<Option<Entity>>,
    labels: HashMap<Entity, String>,
}

impl<'w> Paths<'w> {
    /// Of entities of this world.
    #[must_use]
    pub fn new(world: &'w World) -> Self {
        Self { world, labelled: HashSet::new(), labels: HashMap::new() }
    }

    /// The names from the root down to `entity`; of siblings with one name the second is `name#2`, and so on.
    pub fn of(&mut self, entity: Entity) -> Vec<String> {
        let mut path = Vec::new();
        let mut here = Some(entity);
        while let Some(entity) = here {
            let parent = self.world.get::<ChildOf>(entity).map(ChildOf::parent);
            if self.labelled.insert(parent) {
                self.labels.extend(labels(self.world, parent));
            }
            path.extend(self.labels.get(&entity).cloned());
            here = parent;
        }
        path.reverse();
        path
    }
}

/// The path of one entity: see [`Paths::of`].
#[must_use]
pub fn path_of(world: &World, entity: Entity) -> Vec<String> {
    Paths::new(world).of(entity)
}

/// What it and those beside it are called in paths.
#[must_use]
pub fn siblings(world: &World, entity: Entity) -> Vec<String> {
    let parent = world.get::<ChildOf>(entity).map(ChildOf::parent);
    labels(world, parent).into_iter().map(|(_, label)| label).collect()
}

/// The entity at the end of `path`, if there is one.
#[must_use]
pub fn find(world: &World, path: &[String]) -> Option<Entity> {
    path.iter().try_fold(None, |here: Option<Entity>, name| {
        let found = labels(world, here).into_iter().find(|(_, label)| label == name);
        found.map(|(entity, _)| Some(entity))
    })?
}

/// The children of `parent`, or all that have none, in the order in which they were made, by their labels.
fn labels(world: &World, parent: Option<Entity>) -> Vec<(Entity, String)> {
    let siblings = match parent {
        Some(parent) => children(world, parent),
        None => roots(world),
    };
    let mut seen: HashMap<&str, usize> = HashMap::new();
    let label = |entity| {
        let name = world.get::<Name>(entity).map_or("", Name::as_str);
        let number = seen.entry(name).or_default();
        *number += 1;
        (entity, if *number == 1 { name.to_owned() } else { format!("{name}#{number}") })
    };
    siblings.into_iter().map(label).collect()
}

/// In the order in which they came to it, whichever numbers they have: those of what is gone are given again.
#[must_use]
pub fn children(world: &World, parent: Entity) -> Vec<Entity> {
    world.get::<Children>(parent).map_or(Vec::new(), |children| children.iter().collect())
}

/// All of the scene that have no parent.
fn roots(world: &World) -> Vec<Entity> {
    // The window's own camera is not of the scene.
    let is_root = |e: &EntityRef<'_>| {
        e.contains::<super::Transform>() && !e.contains::<ChildOf>() && !e.contains::<Camera>()
    };
    let mut roots: Vec<Entity> = world.iter_entities().filter(is_root).map(|e| e.id()).collect();
    roots.sort_by_key(|entity| entity.index_u32());
    roots
}

#[cfg(test)]
mod tests {
    use super::super::Transform;
    use super::*;

    #[test]
    fn every_path_leads_back() {
        let mut world = World::new();
        let mut spawn = |name: Option<&'static str>, parent: Option<Entity>| {
            let mut entity = world.spawn(Transform::default());
            if let Some(name) = name {
                entity.insert(Name::new(name));
            }
            if let Some(parent) = parent {
                entity.insert(ChildOf(parent));
            }
            entity.id()
        };
        let room = spawn(Some("room"), None);
        let other = spawn(Some("room"), None);
        let all = [
            room,
            other,
            spawn(Some("chair"), Some(room)),
            spawn(Some("chair"), Some(room)),
            spawn(None, Some(room)),
            spawn(None, Some(room)),
            spawn(Some("a/b"), Some(other)),
        ];
        let mut paths = Paths::new(&world);
        for entity in all {
            let path = path_of(&world, entity);
            assert_eq!(paths.of(entity), path);
            assert_eq!(find(&world, &path), Some(entity), "{path:?}");
        }
        assert_eq!(path_of(&world, all[3]), ["room", "chair#2"]);
        assert_eq!(path_of(&world, all[6]), ["room#2", "a/b"]);
        assert_eq!(find(&world, &["room".to_owned(), "table".to_owned()]), None);
        assert_eq!(find(&world, &[]), None);
    }
}
