//! Arguments and a file → a world ready to make frames. The window and `render` both start here.

use crate::app::{App, FrameBudget};
use crate::bvh::Isa;
use crate::first_look;
use crate::image::{Display, ToneMap};
use crate::load::{
    Card, Kind, LoadError, LoadOptions, LoadReport, SceneSource, SidecarFilter, SidecarIntegrator, choices,
    edited_scene, harmless, load_unedited,
};
use crate::scene::{
    ActiveCamera, Aspect, Camera, Filter, GlobalTransform, Lens, Projection, SceneBounds, Transform,
};
use crate::sync::{Instructions, RenderOrigin};
use crate::trace::{Film, Integrator, RenderSettings, Sampling};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use glam::{DVec3, UVec2};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// What the user asks for; `None` leaves it to the scene's settings file, then to the default.
#[derive(Clone, Debug, Default)]
pub struct Wishes {
    /// Width and height in pixels.
    pub size: Option<UVec2>,
    /// The part of it that alone is wanted: from its first pixel to the one after its last.
    pub crop: Option<[UVec2; 2]>,
    /// Samples per pixel.
    pub samples: Option<u32>,
    /// Index of the first sample; 0 if not said.
    pub first_sample: Option<u32>,
    /// How light is gathered.
    pub integrator: Option<Integrator>,
    /// See [`RenderSettings::max_depth`].
    pub max_depth: Option<u32>,
    /// See [`RenderSettings::seed`].
    pub seed: Option<u32>,
    /// See [`RenderSettings::sampling`].
    pub sampling: Option<Sampling>,
    /// Overrides the textures' own filters.
    pub filter: Option<Filter>,
    /// Exposure in stops.
    pub exposure: Option<f32>,
    /// What happens above white.
    pub tone_map: Option<ToneMap>,
    /// Which camera of the file, by name or by number from 0.
    pub camera: Option<String>,
    /// Instructions to trace with.
    pub isa: Option<Isa>,
    /// Changes to that camera.
    pub pose: Pose,
}

/// Changes to a camera, in world space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Where it is.
    pub position: Option<DVec3>,
    /// Where it looks.
    pub focal_point: Option<DVec3>,
    /// What is up; +Y if not said.
    pub view_up: Option<DVec3>,
    /// Vertical field of view in degrees.
    pub view_angle: Option<f32>,
    /// Parallel rays: height of the picture in scene units.
    pub orthographic: Option<f32>,
    /// Radius of the lens in scene units; 0 for none.
    pub lens_radius: Option<f32>,
    /// Distance of what is sharp in scene units; that of the focal point, or of the scene, if not said.
    pub focus_distance: Option<f32>,
}

/// Why there is no world to make frames with.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The scene cannot be loaded.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// A part that is not all in the picture.
    #[error("--crop {},{},{},{} is not in the picture, which is {size}: X + W and Y + H may be no more than that",
             crop[0].x, crop[0].y, crop[1].x - crop[0].x, crop[1].y - crop[0].y)]
    Crop {
        /// What was asked for.
        crop: [UVec2; 2],
        /// Width and height of the picture, as `WxH`.
        size: String,
    },
    /// No such camera.
    #[error("{scene}: no camera \"{wanted}\"; it has {names}")]
    Camera {
        /// The scene.
        scene: String,
        /// What was asked for.
        wanted: String,
        /// What there is.
        names: String,
    },
}

/// A world ready to make frames.
pub struct Opened {
    /// The world, everything built, nothing traced.
    pub app: App,
    /// What loading found and did.
    pub report: LoadReport,
    /// Seconds that loading took.
    pub load_seconds: f64,
    /// Seconds of building the hierarchies and the other arrays, and of choosing the exposure.
    pub build_seconds: f64,
    /// Samples per pixel to make, if anybody said.
    pub samples: Option<u32>,
}

/// Loads `source` and applies `wishes`.
///
/// # Errors
/// If the scene cannot be loaded, has no such camera, or its picture no such part.
pub fn open(source: &SceneSource, options: &LoadOptions, wishes: &Wishes) -> Result<Opened, OpenError> {
    let start = Instant::now();
    let resolution = options.resolution.or(wishes.size.map(|size| size.to_array()));
    let mut options = LoadOptions { resolution, ..options.clone() };
    let edited = edited_scene(source).filter(|_| options.scene_settings.is_none());
    let (source, edits_file) = match &edited {
        Some((scene, edits)) => (scene, Some(edits)),
        None => (source, None),
    };
    options.scene_settings = options.scene_settings.or_else(|| edits_file.cloned());
    let mut app = App::new(RenderSettings::default());
    let (mut report, edits) = load_unedited(&mut app.world, source, &options)?;
    choose_camera(&mut app.world, &report, &source.name(), wishes)?;
    let file = &report.render;
    let default = RenderSettings::default();
    let settings = RenderSettings {
        size: wishes.size.or(file.resolution.map(UVec2::from_array)).unwrap_or_else(|| {
            let active = app.world.get_resource::<ActiveCamera>().map(|active| active.0);
            let aspect = active.and_then(|camera| app.world.get::<Aspect>(camera));
            aspect.map_or(default.size, |aspect| size_of_shape(aspect.0, default.size))
        }),
        integrator: wishes.integrator.unwrap_or(match file.integrator {
            Some(SidecarIntegrator::Path) => Integrator::Path,
            Some(SidecarIntegrator::Direct) | None => default.integrator,
        }),
        max_depth: wishes.max_depth.or(file.max_depth).unwrap_or(default.max_depth),
        seed: wishes.seed.or(file.seed.map(|seed| seed as u32)).unwrap_or(default.seed),
        filter: wishes.filter.or(match file.filter {
            Some(SidecarFilter::Nearest) => Some(Filter::Nearest),
            Some(SidecarFilter::Bilinear) => Some(Filter::Bilinear),
            _ => None,
        }),
        sampling: wishes.sampling.unwrap_or(default.sampling),
        pixel_sampling: default.pixel_sampling,
        shafts: default.shafts,
        light_samples: default.light_samples,
        reuse: default.reuse,
        cuts: default.cuts,
        shares_again: default.shares_again,
    };
    if let Some(crop) = wishes.crop.filter(|[_, max]| max.cmpgt(settings.size).any()) {
        return Err(OpenError::Crop { crop, size: format!("{}x{}", settings.size.x, settings.size.y) });
    }
    let samples = wishes.samples.or(file.spp);
    let exposure = wishes.exposure.or(file.exposure);
    // Loaded again in a window of another shape, a camera of our own stands where it stood.
    options.resolution = Some(settings.size.to_array());
    let (camera, pose) = (wishes.camera.clone(), wishes.pose);
    let origin = SceneOrigin { source: source.clone(), options: options.clone(), camera, pose };
    app.world.insert_resource(origin);
    if let Some(origin) = report.render.origin {
        app.world.insert_resource(RenderOrigin(Some(origin.into())));
    }
    if options.scene_settings.is_none()
        && options.edits.is_none()
        && let Some(told) = edits_beside(source)
    {
        report.add(Kind::Decided, &source.to_string(), told);
    }
    app.world.insert_resource(settings);
    app.world.insert_resource(Instructions(wishes.isa.unwrap_or_default()));
    app.world.insert_resource(Film::new(settings.size, wishes.first_sample.unwrap_or(0)));
    let tone_map = wishes.tone_map.unwrap_or_default();
    app.world.insert_resource(Display { exposure: exposure.unwrap_or_default(), tone_map });
    let mut budget = app.world.resource_mut::<FrameBudget>();
    budget.sample_target = samples.unwrap_or(budget.sample_target);
    budget.region = wishes.crop;
    let load_seconds = start.elapsed().as_secs_f64();

    let start = Instant::now();
    app.build();
    first_look::settle(&mut app, &mut report, &source.to_string(), exposure.is_none());
    if !edits.is_empty() {
        // Light and exposure are those that whoever edited it had before him, also where he has put out a lamp.
        edits.apply(&mut app.world, &options, &mut report)?;
        app.build();
    }
    let build_seconds = start.elapsed().as_secs_f64();
    let card = Card::of(&source.to_string(), &report).text();
    app.world.insert_resource(LoadCard {
        text: card.into(),
        warnings: report.warnings().len(),
        outdated: None,
    });
    Ok(Opened { app, report, load_seconds, build_seconds, samples })
}

/// What to say of edits that were saved beside the scene: they are applied only if somebody asks for them.
fn edits_beside(source: &SceneSource) -> Option<String> {
    let SceneSource::File(scene) = source else { return None };
    let stem = format!("{}.edits_", source.name());
    let number = |name: &str| name.strip_prefix(&stem)?.strip_suffix(".toml")?.parse::<u32>().ok();
    let folder = scene.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names =
        std::fs::read_dir(folder).ok()?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut numbers: Vec<u32> = names.filter_map(|name| number(&name)).collect();
    numbers.sort_unstable();
    let newest = folder.join(format!("{stem}{}.toml", numbers.last()?));
    let newest = newest.strip_prefix(".").unwrap_or(&newest).display();
    let which = if numbers.len() > 1 { format!(" (the last of {})", numbers.len()) } else { String::new() };
    Some(format!("edits saved beside it are not applied: open {newest} for that{which}"))
}

/// A size of this width over height with as many pixels as `usual`, but no higher than a screen.
fn size_of_shape(aspect: f32, usual: UVec2) -> UVec2 {
    const HIGHEST: f64 = 720.0;
    // Beyond this the format means something else.
    let aspect = f64::from(aspect.clamp(0.1, 10.0));
    let usual = usual.as_dvec2();
    if (aspect - usual.x / usual.y).abs() < 0.01 {
        return usual.as_uvec2();
    }
    let height = (usual.element_product() / aspect).sqrt().min(HIGHEST).round();
    UVec2::new((height * aspect).round() as u32, height as u32)
}

/// What `check` says of the scene in a world.
#[derive(Resource, Clone, Debug)]
pub struct LoadCard {
    /// All of it.
    pub text: Arc<str>,
    /// Lines about what is not as the files say.
    pub warnings: usize,
    /// The same, with why the scene could not be loaded again since.
    pub outdated: Option<Arc<str>>,
}

impl LoadCard {
    /// The files are not any more what it speaks of, and could not be loaded.
    pub fn outdate(&mut self, why: &str) {
        let (title, rest) = self.text.split_once('\n').unwrap_or((&self.text, ""));
        let scene = title.rsplit_once(": ").map_or(title, |(scene, _)| scene);
        self.outdated =
            Some(format!("{scene}: still the old scene\n  error         {}\n{rest}", harmless(why)).into());
    }

    /// What holds now.
    #[must_use]
    pub fn now(&self) -> &Arc<str> {
        self.outdated.as_ref().unwrap_or(&self.text)
    }
}

/// Where the scene in a world comes from, to load or to speak of it again.
#[derive(Resource, Clone, Debug)]
pub struct SceneOrigin {
    /// The scene.
    pub source: SceneSource,
    /// How it was loaded.
    pub options: LoadOptions,
    /// Which of its cameras was asked for: see [`Wishes::camera`].
    pub camera: Option<String>,
    /// And how that was changed.
    pub pose: Pose,
}

fn choose_camera(
    world: &mut World,
    report: &LoadReport,
    scene: &str,
    wishes: &Wishes,
) -> Result<(), OpenError> {
    if let Some(wanted) = &wishes.camera {
        let by_name = report.cameras.iter().find(|(name, _)| name == wanted);
        let by_number = || report.cameras.get(wanted.parse::<usize>().ok()?);
        let Some((_, camera)) = by_name.or_else(by_number) else {
            let names = choices(report.cameras.iter().map(|(name, _)| name.as_str()), "none of its own");
            return Err(OpenError::Camera { scene: scene.to_owned(), wanted: wanted.clone(), names });
        };
        world.insert_resource(ActiveCamera(*camera));
    }
    let pose = &wishes.pose;
    if *pose == Pose::default() {
        return Ok(());
    }
    // The file's camera stays what it is; this is one more, standing where it stands.
    crate::app::propagate(world);
    let from = world.get_resource::<ActiveCamera>().map(|active| active.0);
    let global = from.and_then(|e| world.get::<GlobalTransform>(e)).copied().unwrap_or_default();
    let mut camera = from.and_then(|e| world.get::<Camera>(e)).copied().unwrap_or_default();
    if let Some(degrees) = pose.view_angle {
        camera.projection = Projection::Perspective { vertical_fov: degrees.to_radians() };
    }
    if let Some(height) = pose.orthographic {
        camera.projection = Projection::Orthographic { height };
    }
    let mut transform = Transform(global.0);
    if pose.position.is_some() || pose.focal_point.is_some() || pose.view_up.is_some() {
        let eye = pose.position.unwrap_or(global.0.translation);
        let ahead = global.0.transform_vector3(DVec3::NEG_Z);
        let up = pose.view_up.unwrap_or(DVec3::Y);
        transform = Transform::looking_at(eye, pose.focal_point.unwrap_or(eye + ahead), up);
    }
    let lens = from.and_then(|e| world.get::<Lens>(e)).copied();
    let default_focus = || {
        let target = pose.focal_point.or(world.get_resource::<SceneBounds>().map(|bounds| bounds.center));
        target.map_or(1.0, |target| (target - transform.0.translation).length() as f32)
    };
    let focus = pose.focus_distance.or(lens.map(|l| l.focus)).unwrap_or_else(default_focus);
    let radius = pose.lens_radius.or(lens.map(|l| l.radius)).unwrap_or(0.0);
    let aspect = from.and_then(|camera| world.get::<Aspect>(camera)).copied();
    let entity = world.spawn((camera, transform, Name::new("command line"))).id();
    if let Some(aspect) = aspect {
        world.entity_mut(entity).insert(aspect);
    }
    if radius > 0.0 {
        world.entity_mut(entity).insert(Lens { radius, focus });
    }
    world.insert_resource(ActiveCamera(entity));
    Ok(())
}
