//! Scenes that a function makes.

use bevy_ecs::prelude::*;
use std::fmt;

/// A scene that a function makes: no file and nothing to parse.
#[derive(Clone, Copy)]
pub struct Made {
    /// What to call it by.
    pub name: &'static str,
    /// Spawns all that is in it, its active camera too, and says what there is to know about it.
    pub make: fn(&mut World) -> Vec<String>,
}

impl fmt::Debug for Made {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Made({})", self.name)
    }
}

impl PartialEq for Made {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Made {}
