//! What loading found and did, and the one place that spawns.

use super::settings::SidecarRender;
use bevy_ecs::prelude::*;

/// More warnings than this are only counted, more decisions not told.
const MOST_LINES: usize = 100;

/// What [`super::load`] found and did.
#[derive(Clone, Debug, Default)]
pub struct LoadReport {
    /// Things in the file that were mended, ignored or approximated, one line each, with their place.
    pub warnings: Vec<String>,
    /// What the program decided because the file is silent (camera, light), one line each.
    pub decisions: Vec<String>,
    /// Cameras by name, in file order; the active one is the resource [`crate::scene::ActiveCamera`].
    pub cameras: Vec<(String, Entity)>,
    /// Triangles of all instances, without those that have a corner that is not finite, before
    /// those without area are dropped.
    pub triangles: usize,
    /// What the settings file says about rendering.
    pub render: SidecarRender,
}

/// Where the readers write to: the world, the report, and the list of what was spawned.
pub(super) struct Sink<'w> {
    pub(super) world: &'w mut World,
    pub(super) report: LoadReport,
    spawned: Vec<Entity>,
    unsaid: usize,
}

impl<'w> Sink<'w> {
    pub(super) fn new(world: &'w mut World) -> Self {
        Self { world, report: LoadReport::default(), spawned: Vec::new(), unsaid: 0 }
    }

    /// Spawns, so that [`Sink::undo`] can take it back.
    pub(super) fn spawn(&mut self, bundle: impl Bundle) -> Entity {
        let entity = self.world.spawn(bundle).id();
        self.spawned.push(entity);
        entity
    }

    /// Takes note of something that was spawned elsewhere.
    pub(super) fn note_spawned(&mut self, entity: Entity) {
        self.spawned.push(entity);
    }

    /// Adds a warning, once.
    pub(super) fn warn(&mut self, line: String) {
        if self.report.warnings.contains(&line) {
            return;
        }
        if self.report.warnings.len() < MOST_LINES {
            self.report.warnings.push(line);
        } else {
            self.unsaid += 1;
        }
    }

    /// Adds a decision, once.
    pub(super) fn decide(&mut self, line: String) {
        let has_room = self.report.decisions.len() < MOST_LINES;
        if has_room && !self.report.decisions.contains(&line) {
            self.report.decisions.push(line);
        }
    }

    /// Entities spawned so far.
    pub(super) fn spawned(&self) -> &[Entity] {
        &self.spawned
    }

    /// Despawns everything again: children before parents, so that a deep chain needs no deep stack.
    pub(super) fn undo(&mut self) {
        for entity in self.spawned.drain(..).rev() {
            // Gone already is as good as gone now.
            let _ = self.world.try_despawn(entity);
        }
    }

    /// The finished report.
    pub(super) fn finish(mut self) -> LoadReport {
        if self.unsaid > 0 {
            self.report.warnings.push(format!("... and {} more warnings", self.unsaid));
        }
        self.report
    }
}
