//! What is not to be seen.

use bevy_ecs::prelude::*;

/// On an instance or a light that is not in the picture, as if it were not there.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hidden;
