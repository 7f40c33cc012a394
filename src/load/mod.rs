//! Files → entities, and a report of what was found, mended, ignored and decided.
//!
//! [`load`] reads `.gltf`, `.glb`, `.obj` and `.toml` files and the built-in scenes. It adds to the
//! world: an entity with a name for the model, below it its nodes; meshes, materials, textures,
//! lights and cameras; and the resources [`ActiveCamera`](crate::scene::ActiveCamera) and
//! [`SceneBounds`](crate::scene::SceneBounds). Where a file is silent about camera or light the
//! program decides (`framing`) and says so. A file that cannot be shown leaves the world as it was.
//!
//! No file can make it panic, recurse without bound, open another machine's files, or allocate what
//! is not there: every count is checked against the bytes that must hold it.

mod budget;
mod builtin;
mod card;
mod error;
mod files;
mod first_bytes;
mod folder;
mod framing;
mod geometry;
mod gltf;
mod ktx2;
mod made;
mod obj;
mod picture;
mod report;
pub mod settings;
mod sky;
mod source;
mod studio;
mod tangents;

pub use builtin::{BuiltIn, built_in_scenes};
pub use card::{Card, Verdict};
pub(crate) use error::choices;
pub use error::{LoadError, ReadError};
pub use files::{SceneFiles, Stamp, stamp};
pub use folder::{edited_scene, scenes_in};
pub use framing::bounds_now;
pub(crate) use framing::{ADDED_LIGHT, light_for};
pub use made::Made;
pub use report::{Found, Kind, LoadReport, Phase, Remark, Watcher, harmless};
pub use settings::{SidecarFilter, SidecarIntegrator, SidecarRender};

use crate::scene::{ActiveCamera, Light, Playing, Transform, deform, play, propagate_transforms};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use bevy_ecs::system::RunSystemOnce;
use glam::Vec3;
use report::Sink;
use settings::{Edits, Materials, Model, Settings};
use source::{Bytes, Folder, SCENE_LIMIT, TEXT_LIMIT};
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::path::{Path, PathBuf};

/// Where a scene comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SceneSource {
    /// `.gltf`, `.glb`, `.obj` or `.toml` on disk.
    File(PathBuf),
    /// Name of a scene that is compiled into the program.
    BuiltIn(&'static str),
    /// What a function makes.
    Made(Made),
}

impl SceneSource {
    /// A file if there is one or the argument looks like a path, else a built-in scene, else the only scene of a folder.
    ///
    /// # Errors
    /// [`LoadError::UnknownScene`] if it is none of these, [`LoadError::Folder`] if the folder has no scene, or several.
    pub fn parse(argument: impl AsRef<OsStr>) -> Result<Self, LoadError> {
        let path = Path::new(&argument);
        if path.is_file() {
            return Ok(Self::File(path.to_path_buf()));
        }
        let argument = path.to_string_lossy();
        if let Some(found) = builtin::find(&argument) {
            return Ok(Self::BuiltIn(found.name));
        }
        if path.is_dir() {
            return folder::only_scene(path);
        }
        if path.extension().is_some() || argument.contains(['/', '\\']) {
            return Ok(Self::File(path.to_path_buf()));
        }
        Err(builtin::unknown(&argument))
    }

    /// Where its file lies, with a separator at its end; empty for what has no file or lies where the program runs.
    #[must_use]
    pub fn folder(&self) -> String {
        let Self::File(path) = self else { return String::new() };
        let folder = path.parent().map(|folder| folder.to_string_lossy()).unwrap_or_default();
        if folder.is_empty() { String::new() } else { format!("{folder}{}", std::path::MAIN_SEPARATOR) }
    }

    /// File stem, or name of the built-in scene: for titles.
    #[must_use]
    pub fn name(&self) -> String {
        self.stem().to_string_lossy().into_owned()
    }

    /// The same as it begins the names of files, whatever its bytes are.
    #[must_use]
    pub fn stem(&self) -> OsString {
        match self {
            Self::File(path) => path.file_stem().map_or_else(|| "scene".into(), OsStr::to_os_string),
            Self::BuiltIn(name) => (*name).into(),
            // Names of files have no colons on some machines.
            Self::Made(made) => made.name.replace(':', "-").into(),
        }
    }
}

impl fmt::Display for SceneSource {
    /// The path, or the name of the built-in scene.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::BuiltIn(name) => f.write_str(name),
            Self::Made(made) => f.write_str(made.name),
        }
    }
}

/// What the numbers of `KHR_lights_punctual` in a glTF file mean. The format says candela and lux; which of these stand
/// behind them in a balance with emissive surfaces is for programs to say, and Blender's exporter has a setting for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightUnits {
    /// Candela and lux, 683 of which make one W/sr or W/m²: Blender's "Standard".
    Candela,
    /// W/sr and W/m², or candela and lux beside surfaces in cd/m²: Blender's "Unitless".
    Watts,
    /// W of all directions together, and W/m² of directional lights: Blender's "Raw".
    Raw,
}

impl LightUnits {
    /// As `--light-units` takes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Candela => "candela",
            Self::Watts => "watts",
            Self::Raw => "raw",
        }
    }
}

/// What the caller wants from [`load`].
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Sidecar to use instead of the one beside the scene.
    pub scene_settings: Option<PathBuf>,
    /// Which scene of a glTF file, by name or by number from 0, instead of its default.
    pub scene: Option<String>,
    /// Which material variant of a glTF file (`KHR_materials_variants`), by name or by number from 0.
    pub variant: Option<String>,
    /// Pose at this many seconds of its animations, instead of the rest pose.
    pub time: Option<f64>,
    /// Bytes of memory that loading may take, instead of three quarters of what the machine has left.
    pub max_memory: Option<u64>,
    /// Who is told how far it is.
    pub watcher: Watcher,
    /// A picture of all directions that lights the scene in place of its own sky.
    pub sky: Option<PathBuf>,
    /// `[[edit]]` tables, as a settings file has them, that are applied last.
    pub edits: Option<String>,
    /// Which animation, by name or by number from 0, instead of the first and those of other things.
    pub animation: Option<String>,
    /// Width and height of the picture that a camera of our own is to fit, instead of those of the settings file.
    pub resolution: Option<[u32; 2]>,
    /// In which units the lamps of glTF files are, instead of what these let one see.
    pub light_units: Option<LightUnits>,
    /// Where the files are noted that the scene is made of, also if it cannot be loaded.
    pub files: SceneFiles,
}

/// Reads a scene into the world and derives its `GlobalTransform`s.
///
/// # Errors
/// A [`LoadError`] that names the file and the place in it; then nothing was added to the world.
pub fn load(world: &mut World, source: &SceneSource, options: &LoadOptions) -> Result<LoadReport, LoadError> {
    let mut sink = Sink::new(world, options);
    match load_into(source, options, &mut sink).and_then(|edits| edits.make(&mut sink)) {
        Ok(()) => Ok(sink.finish(&source.to_string())),
        Err(error) => {
            sink.undo();
            Err(error)
        }
    }
}

/// The same as its files have it, and what was edited in it: to be applied when all else is decided.
pub(crate) fn load_unedited(
    world: &mut World,
    source: &SceneSource,
    options: &LoadOptions,
) -> Result<(LoadReport, Edits), LoadError> {
    let mut sink = Sink::new(world, options);
    match load_into(source, options, &mut sink) {
        Ok(edits) => Ok((sink.finish(&source.to_string()), edits)),
        Err(error) => {
            sink.undo();
            Err(error)
        }
    }
}

fn load_into(source: &SceneSource, options: &LoadOptions, sink: &mut Sink<'_>) -> Result<Edits, LoadError> {
    if let SceneSource::Made(made) = source {
        make(made, sink);
        return Ok(Edits::default());
    }
    let (file, folder, bytes) = open(source, sink)?;
    let format = Format::of(&file, &bytes)?;
    let mut settings = Vec::new();
    if format == Format::Settings {
        let own = Settings::parse(&file, folder.clone(), &bytes)?;
        if own.is_of_a_scene() {
            let problem = "there is none, so this is no scene but what was edited in one: open that, and this with \
                           --scene-settings";
            return Err(LoadError::broken(&file, "[[model]]", problem));
        }
        settings.push(own);
    }
    settings.extend(sidecar(source, format, options, sink)?);
    if let Some(edits) = &options.edits {
        settings.push(Settings::parse("edits", folder.clone(), edits.as_bytes())?);
    }
    let mut materials = Materials::default();
    let mut active = None;
    for settings in &settings {
        materials.extend(settings.spawn_materials(sink)?);
        active = settings.spawn_camera(sink)?.or(active);
    }
    let models = match settings.first() {
        Some(own) if format == Format::Settings => own.models(&mut materials)?,
        _ => {
            vec![Model { file: file.clone(), folder, bytes, transform: Transform::default(), material: None }]
        }
    };
    for model in models {
        load_model(model, &mut materials, sink)?;
    }
    for settings in &settings {
        settings.spawn_lights(sink)?;
    }
    if let Some(path) = &options.sky {
        let light = Light::Sky { sky: sky::read(path, sink)?, scale: Vec3::ONE };
        sink.spawn((Name::new("sky"), Transform::default(), light));
        sink.decide(&file, format!("its sky is {}", path.display()));
    }
    check_animation(&file, sink)?;
    sink.begin(Phase::Framing);
    pose(sink.world);
    for name in materials.unused() {
        sink.ignored(
            &file,
            &format!("[material.{name}]"),
            "settings for a material that is not in the scene",
        );
    }
    sink.count();
    sink.take_lamps(&file)?;
    framing::complete(&file, active, sink);
    let edits = Edits(settings);
    sink.report.render.origin = edits.origin();
    Ok(edits)
}

/// What needs no file. Nothing can go wrong.
fn make(made: &Made, sink: &mut Sink<'_>) {
    for line in (made.make)(sink.world) {
        sink.decide(made.name, line);
    }
    sink.begin(Phase::Framing);
    pose(sink.world);
    sink.count();
    let active = sink.world.get_resource::<ActiveCamera>().map(|active| active.0);
    framing::complete(made.name, active, sink);
}

/// Whether one of the files has the animation that was asked for.
fn check_animation(file: &str, sink: &Sink<'_>) -> Result<(), LoadError> {
    let Some(wanted) = &sink.options.animation else { return Ok(()) };
    if sink.world.get_resource::<Playing>().is_some_and(|playing| !playing.animations.is_empty()) {
        return Ok(());
    }
    let names = choices(sink.report.animations.iter().map(|(name, _)| name.as_str()), "none");
    Err(LoadError::NotThere { file: file.to_owned(), kind: "animation", wanted: wanted.clone(), names })
}

/// Puts what is animated where it is at the time that is wanted.
fn set_in_motion(world: &mut World) {
    if world.contains_resource::<Playing>() {
        // It has no parameter that could be missing.
        let _ = world.run_system_once(play);
    }
}

/// Brings meshes into the shape that their weights and joints, animated or not, ask for.
fn pose(world: &mut World) {
    set_in_motion(world);
    // None of these systems has a parameter that could be missing.
    let _ = world.run_system_once(propagate_transforms);
    let _ = world.run_system_once(deform);
}

/// What a file holds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Gltf,
    Obj,
    Settings,
}

impl Format {
    fn of(file: &str, bytes: &[u8]) -> Result<Self, LoadError> {
        let ending = Path::new(file).extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("gltf" | "glb") => Ok(Self::Gltf),
            Some("obj") => Ok(Self::Obj),
            Some("toml") => Ok(Self::Settings),
            _ if bytes.starts_with(b"glTF") => Ok(Self::Gltf),
            _ => Err(LoadError::UnknownFormat { file: file.to_owned() }),
        }
    }
}

fn open(source: &SceneSource, sink: &Sink<'_>) -> Result<(String, Folder, Bytes), LoadError> {
    match source {
        SceneSource::File(path) => {
            let file = path.to_string_lossy().into_owned();
            let length = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
            sink.budget.take(length, &file, "the file itself")?;
            let files = &sink.options.files;
            match source::read_file(path, SCENE_LIMIT, files) {
                Ok(bytes) => Ok((file, Folder::of(path, files), bytes)),
                Err(source) => Err(LoadError::Read { file, source }),
            }
        }
        SceneSource::BuiltIn(name) => {
            let found = builtin::find(name).and_then(|scene| Some((scene.file, builtin::asset(scene.file)?)));
            let (file, bytes) = found.ok_or_else(|| builtin::unknown(name))?;
            Ok((file.to_owned(), Folder::BuiltIn, Bytes::Borrowed(bytes)))
        }
        SceneSource::Made(made) => Err(builtin::unknown(made.name)),
    }
}

/// The settings that the caller names, else those beside the scene.
fn sidecar(
    source: &SceneSource,
    format: Format,
    options: &LoadOptions,
    sink: &mut Sink<'_>,
) -> Result<Option<Settings>, LoadError> {
    let (path, asked_for) = match (&options.scene_settings, source) {
        (Some(path), _) => (path.clone(), true),
        (None, SceneSource::File(scene)) if format != Format::Settings => {
            (scene.with_extension("toml"), false)
        }
        (None, _) => return Ok(None),
    };
    options.files.note(&path);
    if !asked_for && !path.is_file() {
        return Ok(None);
    }
    let file = path.to_string_lossy().into_owned();
    let bytes = source::read_file(&path, TEXT_LIMIT, &options.files)
        .map_err(|source| LoadError::Read { file: file.clone(), source })?;
    let settings = Settings::parse(&file, Folder::of(&path, &options.files), &bytes)?;
    if settings.has_models() && !asked_for {
        sink.decide(&file, "has [[model]] and so is a scene of its own, not the settings of this one");
        return Ok(None);
    }
    if settings.has_models() {
        sink.ignored(&file, "", "its [[model]] tables; open the file itself to see them");
    } else {
        sink.decide(&file, "settings read");
    }
    Ok(Some(settings))
}

fn load_model(model: Model, materials: &mut Materials, sink: &mut Sink<'_>) -> Result<(), LoadError> {
    let format = Format::of(&model.file, &model.bytes)?;
    let stem = Path::new(&model.file)
        .file_stem()
        .map_or_else(|| model.file.clone(), |stem| stem.to_string_lossy().into_owned());
    let root = sink.spawn((Name::new(stem), model.transform));
    materials.all = model.material;
    match format {
        Format::Gltf => gltf::load(&model.file, &model.folder, model.bytes, root, materials, sink)?,
        Format::Obj => obj::load(&model.file, &model.folder, model.bytes, root, materials, sink)?,
        Format::Settings => return Err(LoadError::UnknownFormat { file: model.file }),
    }
    materials.all = None;
    Ok(())
}
