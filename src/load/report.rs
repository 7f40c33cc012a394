//! What loading found and did, and the one place that spawns.

use super::LoadOptions;
use super::budget::Budget;
use super::error::LoadError;
use super::settings::SidecarRender;
use crate::scene::{Camera, Instance, Light, Material, Mesh, Texture};
use bevy_ecs::prelude::*;
use glam::Vec3;
use serde::Serialize;
use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;
use std::time::Instant;

/// More remarks than this are only counted.
const MOST_REMARKS: usize = 200;
/// Places that a remark names.
const MOST_PLACES: usize = 4;
/// Bytes that a triangle that shines takes, with what building the choice among many does.
const LAMP_MEMORY: u64 = 380;

/// What [`super::load`] found and did.
#[derive(Clone, Debug, Default)]
pub struct LoadReport {
    /// What is in the scene.
    pub found: Found,
    /// What was mended, left out, approximated or decided, in the order it was met.
    pub remarks: Vec<Remark>,
    /// Cameras by name, in file order; the active one is the resource [`crate::scene::ActiveCamera`].
    pub cameras: Vec<(String, Entity)>,
    /// Animations by name, in file order.
    pub animations: Vec<(String, Entity)>,
    /// Triangles of all instances, without those that have a corner that is not finite, before
    /// those without area are dropped.
    pub triangles: usize,
    /// Seconds of each phase, in order: reading, parsing, decompressing, images, meshes, framing.
    pub seconds: Vec<(Phase, f64)>,
    /// What the settings file says about rendering.
    pub render: SidecarRender,
}

impl LoadReport {
    /// Adds a remark of this kind about the file as a whole.
    pub fn add(&mut self, kind: Kind, file: &str, what: impl Into<String>) {
        let (file, what) = (file.to_owned(), what.into());
        self.remarks.push(Remark { kind, file, what, count: 1, places: Vec::new() });
    }

    /// Remarks of one kind.
    pub fn of(&self, kind: Kind) -> impl Iterator<Item = &Remark> {
        self.remarks.iter().filter(move |remark| remark.kind == kind)
    }

    /// Lines for what is not as the file says: mended, left out or approximated.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        self.remarks.iter().filter(|remark| remark.kind != Kind::Decided).map(ToString::to_string).collect()
    }

    /// Lines for what the program decided because the file is silent.
    #[must_use]
    pub fn decisions(&self) -> Vec<String> {
        self.of(Kind::Decided).map(ToString::to_string).collect()
    }
}

/// A part of loading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Phase {
    /// The scene's file and buffers.
    Reading,
    /// Bytes → statements or JSON.
    Parsing,
    /// Decompressing geometry.
    Decompressing,
    /// Reading and decoding images.
    Images,
    /// Putting meshes together.
    Meshes,
    /// Poses, camera, light.
    Framing,
}

impl fmt::Display for Phase {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Reading => "reading",
            Self::Parsing => "parsing",
            Self::Decompressing => "decompressing",
            Self::Images => "images",
            Self::Meshes => "meshes",
            Self::Framing => "framing",
        })
    }
}

/// Who is told what loading is doing: the phase, and how much of it is done, in 0..=1. From any thread.
#[derive(Clone, Default)]
pub struct Watcher(pub Option<Arc<dyn Fn(Phase, f32) + Send + Sync>>);

impl Watcher {
    pub(super) fn tell(&self, phase: Phase, part: f32) {
        if let Some(tell) = &self.0 {
            tell(phase, part);
        }
    }
}

impl fmt::Debug for Watcher {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Watcher(..)" } else { "Watcher(nobody)" })
    }
}

/// What became of something in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Damaged or against the format, and mended.
    Repaired,
    /// Left out of the picture.
    Ignored,
    /// In the picture, though not exactly as the file says.
    Approximated,
    /// The file is silent (camera, light, exposure): the program decided.
    Decided,
}

/// One thing that loading has to say, however often and wherever it was met.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Remark {
    /// What became of it.
    #[serde(skip)]
    pub kind: Kind,
    /// The file.
    pub file: String,
    /// What it is.
    pub what: String,
    /// How many of it there are.
    pub count: usize,
    /// Where the first of them are: line, node, mesh ...; empty for the file as a whole.
    pub places: Vec<String>,
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, what, count, places, .. } = self;
        let more = if *count > places.len() && places.len() == MOST_PLACES { ", ..." } else { "" };
        let line = match (count, places.as_slice()) {
            (1, []) => format!("{file}: {what}"),
            (1, [place, ..]) => format!("{file}: {place}: {what}"),
            (count, []) => format!("{file}: {what}: {count}"),
            (count, places) => format!("{file}: {what}: {count} ({}{more})", places.join(", ")),
        };
        f.write_str(&harmless(&line))
    }
}

/// One line of text that does nothing to the terminal it is shown on, whatever a file calls its things.
#[must_use]
pub fn harmless(text: &str) -> Cow<'_, str> {
    if !text.contains(char::is_control) {
        return Cow::Borrowed(text);
    }
    let shown = |c: char| if c.is_control() { c.escape_debug().to_string() } else { c.to_string() };
    text.chars().map(shown).collect()
}

/// What is in a scene.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Found {
    /// Formats and the programs that wrote them, as far as the files say.
    pub formats: Vec<String>,
    /// Meshes; several instances may share one.
    pub meshes: usize,
    /// Triangles of the meshes, each counted once, without those that were dropped.
    pub distinct_triangles: usize,
    /// Vertices of the meshes.
    pub vertices: usize,
    /// Placed meshes.
    pub instances: usize,
    /// Materials.
    pub materials: usize,
    /// Images with what reads them.
    pub textures: usize,
    /// Lights that are not meshes, without what the program adds.
    pub lights: usize,
    /// Cameras, without what the program adds.
    pub cameras: usize,
    /// Scenes, animations, variants ... by name, where the format has such things.
    pub others: Vec<(&'static str, usize)>,
}

/// Where the readers write to: the world, the report, and the list of what was spawned.
pub(super) struct Sink<'w> {
    pub(super) world: &'w mut World,
    pub(super) options: &'w LoadOptions,
    pub(super) budget: Arc<Budget>,
    pub(super) report: LoadReport,
    spawned: Vec<Entity>,
    unsaid: usize,
    phase: (Phase, Instant),
}

impl<'w> Sink<'w> {
    pub(super) fn new(world: &'w mut World, options: &'w LoadOptions) -> Self {
        let budget = Arc::new(Budget::new(options.max_memory));
        Self {
            world,
            options,
            budget,
            report: LoadReport::default(),
            spawned: Vec::new(),
            unsaid: 0,
            phase: (Phase::Reading, Instant::now()),
        }
    }

    /// Begins the next phase; a phase may come several times.
    pub(super) fn begin(&mut self, phase: Phase) {
        let (last, since) = std::mem::replace(&mut self.phase, (phase, Instant::now()));
        let seconds = since.elapsed().as_secs_f64();
        match self.report.seconds.iter_mut().find(|(known, _)| *known == last) {
            Some((_, sum)) => *sum += seconds,
            None => self.report.seconds.push((last, seconds)),
        }
        self.options.watcher.tell(phase, 0.0);
    }

    /// Spawns, so that [`Sink::undo`] can take it back.
    pub(super) fn spawn(&mut self, bundle: impl Bundle) -> Entity {
        let entity = self.world.spawn(bundle).id();
        self.spawned.push(entity);
        entity
    }

    /// Something damaged was mended; `place` may be empty for the file as a whole.
    pub(super) fn repaired(&mut self, file: &str, place: &str, what: impl Into<String>) {
        self.remark(Kind::Repaired, file, place, what.into(), 1);
    }

    /// Something was left out.
    pub(super) fn ignored(&mut self, file: &str, place: &str, what: impl Into<String>) {
        self.remark(Kind::Ignored, file, place, what.into(), 1);
    }

    /// Something is only nearly as the file says.
    pub(super) fn approximated(&mut self, file: &str, place: &str, what: impl Into<String>) {
        self.remark(Kind::Approximated, file, place, what.into(), 1);
    }

    /// Adds `count` of something; the same at several places is one remark.
    pub(super) fn remark(&mut self, kind: Kind, file: &str, place: &str, what: String, count: usize) {
        let remarks = &mut self.report.remarks;
        let same = |other: &Remark| other.kind == kind && other.what == what && other.file == file;
        let Some(known) = remarks.iter().position(same).map(|i| &mut remarks[i]) else {
            if self.report.remarks.len() < MOST_REMARKS {
                let places = if place.is_empty() { Vec::new() } else { vec![place.to_owned()] };
                self.report.remarks.push(Remark { kind, file: file.to_owned(), what, count, places });
            } else {
                self.unsaid += 1;
            }
            return;
        };
        // What is about the file as a whole is said once.
        if !place.is_empty() {
            known.count += count;
            if known.places.len() < MOST_PLACES && known.places.iter().all(|other| other != place) {
                known.places.push(place.to_owned());
            }
        }
    }

    /// Remembers what was spawned elsewhere for [`Sink::undo`].
    pub(super) fn note_spawned(&mut self, entity: Entity) {
        self.spawned.push(entity);
    }

    /// The program decides what the file does not say.
    pub(super) fn decide(&mut self, file: &str, what: impl Into<String>) {
        self.remark(Kind::Decided, file, "", what.into(), 1);
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

    /// Counts what was spawned so far.
    pub(super) fn count(&mut self) {
        let found = &mut self.report.found;
        for &entity in &self.spawned {
            let Ok(entity) = self.world.get_entity(entity) else { continue };
            if let Some(Mesh(mesh)) = entity.get() {
                found.meshes += 1;
                found.distinct_triangles += mesh.triangles.len();
                found.vertices += mesh.positions.len();
            }
            found.instances += usize::from(entity.contains::<Instance>());
            found.materials += usize::from(entity.contains::<Material>());
            found.textures += usize::from(entity.contains::<Texture>());
            found.lights += usize::from(entity.contains::<Light>());
            found.cameras += usize::from(entity.contains::<Camera>());
        }
    }

    /// Whether a surface shines of what was spawned after the first `before` entities: a material that nothing wears does not.
    pub(super) fn shines(&self, before: usize) -> bool {
        let instances =
            self.spawned[before..].iter().filter_map(|&entity| self.world.get::<Instance>(entity));
        let mut lamps = instances.map(|instance| self.lamps(instance));
        lamps.any(|lamps| lamps > 0)
    }

    /// Asks for the memory of all that shines: each triangle of each instance is a lamp to choose.
    ///
    /// # Errors
    /// If that is more than is left.
    pub(super) fn take_lamps(&self, file: &str) -> Result<(), LoadError> {
        let instances = self.spawned.iter().filter_map(|&entity| self.world.get::<Instance>(entity));
        let lamps = instances.map(|instance| self.lamps(instance)).sum::<u64>();
        self.budget.take(lamps * LAMP_MEMORY, file, &format!("its {lamps} triangles that shine"))
    }

    /// Triangles of an instance that shine.
    fn lamps(&self, Instance { mesh, materials }: &Instance) -> u64 {
        let shines = |&entity: &Entity| {
            self.world.get::<Material>(entity).is_some_and(|material| material.emission != Vec3::ZERO)
        };
        let shine: Vec<bool> = materials.iter().map(shines).collect();
        let Some(Mesh(mesh)) = self.world.get(*mesh).filter(|_| shine.contains(&true)) else { return 0 };
        let is_lamp = |&triangle: &usize| shine.get(mesh.slot(triangle)).copied().unwrap_or(false);
        (0..mesh.triangles.len()).filter(is_lamp).count() as u64
    }

    /// The finished report.
    pub(super) fn finish(mut self, file: &str) -> LoadReport {
        self.begin(Phase::Framing);
        if self.unsaid > 0 {
            self.report.add(Kind::Ignored, file, format!("... and {} more remarks", self.unsaid));
        }
        self.report
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_at_several_places_is_one_remark_with_its_count() {
        let mut world = World::new();
        let options = LoadOptions::default();
        let mut sink = Sink::new(&mut world, &options);
        for mesh in 0..6 {
            sink.remark(Kind::Repaired, "a.glb", &format!("mesh {mesh}"), "triangles dropped".into(), 3);
        }
        sink.ignored("a.glb", "light 1", "unknown type");
        sink.decide("a.glb", "light grey");
        sink.decide("a.glb", "light grey");
        let report = sink.finish("a.glb");
        assert_eq!(
            report.warnings(),
            [
                "a.glb: triangles dropped: 18 (mesh 0, mesh 1, mesh 2, mesh 3, ...)",
                "a.glb: light 1: unknown type"
            ]
        );
        assert_eq!(report.decisions(), ["a.glb: light grey"]);
    }

    #[test]
    fn a_flood_of_remarks_is_counted() {
        let mut world = World::new();
        let options = LoadOptions::default();
        let mut sink = Sink::new(&mut world, &options);
        for i in 0..1000 {
            sink.ignored("a.glb", "", format!("thing {i}"));
        }
        assert_eq!(sink.finish("a.glb").warnings().last().unwrap(), "a.glb: ... and 800 more remarks");
    }
}
