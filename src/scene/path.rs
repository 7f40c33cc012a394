//! Entities by the names on the way to them, so that a file can speak of them.

use super::Camera;
use bevy_ecs::prelude::*;
use std::collections::HashMap;

/// The names from the root down to `entity`; of siblings with one name the second is `name#2`, and so on.
#[must_use]
pub fn path_of(world: &World, entity: Entity) -> Vec<String> {
    let mut path = Vec::new();
    let mut here = Some(entity);
    while let Some(entity) = here {
        let parent = world.get::<ChildOf>(entity).map(ChildOf::parent);
        let label = labels(world, parent).into_iter().find(|(other, _)| *other == entity);
        path.extend(label.map(|(_, label)| label));
        here = parent;
    }
    path.reverse();
    path
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
    let mut siblings: Vec<Entity> = match parent {
        Some(parent) => world.get::<Children>(parent).map_or(Vec::new(), |c| c.iter().collect()),
        // The window's own camera is not of the scene.
        None => world
            .iter_entities()
            .filter(|e| {
                e.contains::<super::Transform>() && !e.contains::<ChildOf>() && !e.contains::<Camera>()
            })
            .map(|e| e.id())
            .collect(),
    };
    siblings.sort_by_key(|entity| entity.index_u32());
    let mut seen: HashMap<&str, usize> = HashMap::new();
    let mut labelled = Vec::new();
    for entity in siblings {
        let name = world.get::<Name>(entity).map_or("", Name::as_str);
        let number = seen.entry(name).or_default();
        *number += 1;
        let label = if *number == 1 { name.to_owned() } else { format!("{name}#{number}") };
        labelled.push((entity, label));
    }
    labelled
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
        for entity in all {
            let path = path_of(&world, entity);
            assert_eq!(find(&world, &path), Some(entity), "{path:?}");
        }
        assert_eq!(path_of(&world, all[3]), ["room", "chair#2"]);
        assert_eq!(path_of(&world, all[6]), ["room#2", "a/b"]);
        assert_eq!(find(&world, &["room".to_owned(), "table".to_owned()]), None);
        assert_eq!(find(&world, &[]), None);
    }
}
