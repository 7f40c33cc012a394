//! The error instrument: how the noise falls, when it will have fallen, and the true error where it is known.

use super::controls::{Notice, Notices};
use super::edit::Editor;
use crate::app::FrameStats;
use crate::image::compare::LinearImage;
use crate::open::SceneOrigin;
use crate::scene::{Filter, Playing};
use crate::sync::Redone;
use crate::trace::convergence::{Convergence, PowerLaw};
use crate::trace::noise::{part, relative_error};
use crate::trace::{Film, Integrator, RenderSettings, Viewpoint};
use bevy_ecs::prelude::*;
use glam::UVec2;
use std::path::PathBuf;
use std::sync::Arc;

/// One look at a growing picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Seconds of tracing since its start.
    pub seconds: f64,
    /// Samples per pixel.
    pub samples: f64,
    /// Estimated relative error.
    pub noise: f64,
    /// Half the width of its interval.
    pub doubt: f64,
    /// Relative error against the reference, if there is one of this view.
    pub error: Option<f64>,
}

/// When the noise will be down to a goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Relative noise.
    pub goal: f64,
    /// Seconds of tracing from now on.
    pub seconds: f64,
}

/// Error over time of this picture and of one before.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Graph {
    /// This picture, since it was last begun anew.
    pub current: Vec<Point>,
    /// The last picture that was worth keeping.
    pub previous: Vec<Point>,
    /// Noise over samples, once it holds.
    pub law: Option<PowerLaw>,
    /// The next round noise level, and when it will be reached.
    pub forecast: Option<Forecast>,
}

/// A picture to measure the true error by, and what it is of.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The picture.
    pub image: LinearImage,
    truth: Vec<f64>,
    viewpoint: Viewpoint,
    seen: Seen,
    /// Whether it was said that the picture is of another size.
    said: bool,
}

/// What beside the view makes the picture another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    edits: String,
    integrator: Integrator,
    max_depth: u32,
    filter: Option<Filter>,
    time: Option<f64>,
    sky: Option<PathBuf>,
}

impl Seen {
    /// As it is now.
    #[must_use]
    pub fn now(
        editor: Option<&Editor>,
        settings: &RenderSettings,
        playing: Option<&Playing>,
        origin: Option<&SceneOrigin>,
    ) -> Self {
        let &RenderSettings { integrator, max_depth, filter, .. } = settings;
        let edits = editor.map_or_else(String::new, |editor| editor.written().to_owned());
        let time = playing.and_then(|playing| playing.time);
        let sky = origin.and_then(|origin| origin.options.sky.clone());
        Self { edits, integrator, max_depth, filter, time, sky }
    }

    /// Of this world.
    #[must_use]
    pub fn of(world: &World) -> Self {
        Self::now(world.get_resource(), world.resource(), world.get_resource(), world.get_resource())
    }
}

impl Reference {
    /// Of what is seen from `viewpoint` of what is `seen`: where the window opens.
    #[must_use]
    pub fn new(image: LinearImage, viewpoint: Viewpoint, seen: Seen) -> Self {
        Self { truth: image.luminances(), image, viewpoint, seen, said: false }
    }

    /// Why it is not of this picture; `None` if it is.
    #[must_use]
    pub fn differs(&self, viewpoint: &Viewpoint, seen: &Seen, size: UVec2) -> Option<&'static str> {
        match () {
            () if self.image.size != size => Some("the reference has another size: the picture"),
            () if self.viewpoint != *viewpoint => Some("the reference is of another view: the picture"),
            () if self.seen != *seen => {
                Some("the reference is of other settings or other things: the picture")
            }
            () => None,
        }
    }

    /// Relative error of `film`, if it is of the same; within the film's region, if it has one.
    fn error(&self, film: &Film, viewpoint: &Viewpoint, seen: &Seen) -> Option<f64> {
        if self.differs(viewpoint, seen, film.size()).is_some() {
            return None;
        }
        let [min, max] = part(film);
        let (stride, width) = (film.size().x as usize, (max - min).x as usize);
        let within = |all: &[f64]| -> Vec<f64> {
            let rows = all.chunks_exact(stride).skip(min.y as usize).take((max - min).y as usize);
            rows.flat_map(|row| row.iter().skip(min.x as usize).take(width)).copied().collect()
        };
        relative_error(&within(&LinearImage::of(film).luminances()), &within(&self.truth), max - min)
    }

    /// Says once that a picture of this size cannot be measured.
    fn complain(&mut self, size: UVec2) -> Option<Notice> {
        if self.said || self.image.size == size {
            return None;
        }
        self.said = true;
        let own = self.image.size;
        Some(Notice::Text(format!(
            "the reference has {} × {} pixels, the picture {} × {}: no true error",
            own.x, own.y, size.x, size.y
        )))
    }
}

/// What the instrument remembers.
#[derive(Resource, Clone, Debug, Default)]
pub struct Instrument {
    /// What it shows.
    pub graph: Arc<Graph>,
    /// The truth, if somebody knows it.
    pub reference: Option<Reference>,
    convergence: Convergence,
    resets: u64,
    region: Option<[UVec2; 2]>,
    start_seconds: f64,
    noted: f64,
}

impl Instrument {
    /// The same for another world, whose counts begin anew.
    #[must_use]
    pub fn moved(self) -> Self {
        Self { resets: u64::MAX, ..self }
    }

    /// One that measures the true error, if there is a reference.
    #[must_use]
    pub fn against(reference: Option<Reference>) -> Self {
        Self { reference, ..Self::default() }
    }
}

/// Fewer looks than this are no curve to compare with: flying would leave nothing else.
const WORTH_KEEPING: usize = 4;
/// Round noise levels that one wants to reach.
const GOALS: [f64; 15] =
    [0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5];

/// Notes the noise whenever it has been estimated anew.
pub fn note_noise(
    mut instrument: ResMut<Instrument>,
    stats: Res<FrameStats>,
    redone: Res<Redone>,
    film: Res<Film>,
    viewpoint: Res<Viewpoint>,
    settings: Res<RenderSettings>,
    (editor, playing, origin): (Option<Res<Editor>>, Option<Res<Playing>>, Option<Res<SceneOrigin>>),
    mut notices: ResMut<Notices>,
) {
    let instrument = instrument.bypass_change_detection();
    if (instrument.resets, instrument.region) != (redone.resets, film.region()) {
        if instrument.resets != redone.resets {
            // This frame has traced some of it already. (Another region keeps the samples, and so the time they took.)
            instrument.start_seconds = stats.trace_seconds - stats.frame_seconds;
        }
        (instrument.resets, instrument.region) = (redone.resets, film.region());
        instrument.noted = 0.0;
        instrument.convergence = Convergence::default();
        let graph = Arc::make_mut(&mut instrument.graph);
        if graph.current.len() >= WORTH_KEEPING {
            graph.previous = std::mem::take(&mut graph.current);
        }
        *graph = Graph { previous: std::mem::take(&mut graph.previous), ..Graph::default() };
    }
    let Some(noise) = stats.noise.filter(|_| stats.noise_samples != instrument.noted) else { return };
    // A picture of the old size is about to go.
    if film.size() != settings.size {
        return;
    }
    instrument.noted = stats.noise_samples;
    let seconds = stats.trace_seconds - instrument.start_seconds;
    let samples = stats.samples_per_pixel;
    let seen = || Seen::now(editor.as_deref(), &settings, playing.as_deref(), origin.as_deref());
    let reference = instrument.reference.as_ref();
    let error = reference.and_then(|reference| reference.error(&film, &viewpoint, &seen()));
    notices.0.extend(instrument.reference.as_mut().and_then(|reference| reference.complain(film.size())));
    instrument.convergence.note(stats.noise_samples, noise);
    let law = instrument.convergence.law();
    let goal = GOALS.into_iter().find(|&goal| goal < noise * 0.95);
    let forecast = goal.and_then(|goal| {
        let more = instrument.convergence.samples_to(goal)? - stats.noise_samples;
        Some(Forecast { goal, seconds: more.max(0.0) * seconds / samples })
    });
    let graph = Arc::make_mut(&mut instrument.graph);
    graph.current.push(Point { seconds, samples, noise, doubt: stats.noise_doubt, error });
    (graph.law, graph.forecast) = (law, forecast);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::convergence::next_look;

    fn world() -> World {
        let mut world = World::new();
        world.init_resource::<Instrument>();
        world.init_resource::<FrameStats>();
        world.init_resource::<Redone>();
        world.init_resource::<Viewpoint>();
        world.init_resource::<Notices>();
        let settings = RenderSettings { size: UVec2::ONE, ..RenderSettings::default() };
        world.insert_resource(settings);
        world.insert_resource(Film::new(UVec2::ONE, 0));
        world
    }

    /// A picture at 10 samples a second whose noise falls as 0.4 / √n.
    fn refine(world: &mut World, samples: u32) {
        let before = world.resource::<FrameStats>().trace_seconds;
        let mut n = 2;
        while n <= samples {
            let mut stats = world.resource_mut::<FrameStats>();
            stats.noise = Some(0.4 / f64::from(n).sqrt());
            stats.noise_samples = f64::from(n);
            stats.samples_per_pixel = f64::from(n);
            let seconds = before + 0.1 * f64::from(n);
            stats.frame_seconds = seconds - stats.trace_seconds;
            stats.trace_seconds = seconds;
            world.run_system_cached(note_noise).unwrap();
            n = next_look(n);
        }
    }

    #[test]
    fn it_foretells_the_seconds_to_the_next_round_level() {
        let mut world = world();
        refine(&mut world, 64);
        let graph = &world.resource::<Instrument>().graph;
        let forecast = graph.forecast.unwrap();
        assert_eq!(forecast.goal, 0.02);
        let last = graph.current.last().unwrap();
        // The first frame's time counts, too.
        assert!(
            (graph.current[0].seconds - 0.2).abs() < 1e-9 && (last.seconds - 0.1 * last.samples).abs() < 1e-9
        );
        // 0.4 / √n = 0.02 at n = 400.
        let wanted = (400.0 - last.samples) * 0.1;
        assert!((forecast.seconds / wanted - 1.0).abs() < 1e-6, "{forecast:?} {wanted}");
        assert!((graph.law.unwrap().b - 0.5).abs() < 1e-9);
    }

    #[test]
    fn the_previous_curve_is_the_last_one_worth_keeping() {
        let mut world = world();
        refine(&mut world, 64);
        let first = world.resource::<Instrument>().graph.current.clone();
        // Some steps of flying.
        for _ in 0..3 {
            world.resource_mut::<Redone>().resets += 1;
            refine(&mut world, 2);
        }
        assert_eq!(world.resource::<Instrument>().graph.previous, first);
        refine(&mut world, 32);
        let second = world.resource::<Instrument>().graph.current.clone();
        assert!(second[0].seconds < 1.0, "time begins anew: {}", second[0].seconds);
        world.resource_mut::<Redone>().resets += 1;
        refine(&mut world, 2);
        assert_eq!(world.resource::<Instrument>().graph.previous, second);
    }

    #[test]
    fn the_true_error_is_told_only_of_the_view_it_is_of() {
        let mut world = world();
        let image = LinearImage { size: UVec2::ONE, pixels: vec![glam::Vec3::splat(2.0)] };
        let seen = Seen::of(&world);
        world.resource_mut::<Instrument>().reference =
            Some(Reference::new(image, Viewpoint::default(), seen));
        let mut film = Film::new(UVec2::ONE, 0);
        film.tiles_mut()[0].pixels_mut()[0].add(0, glam::Vec3::splat(2.2));
        world.insert_resource(film);
        let error = |world: &World| world.resource::<Instrument>().graph.current.last().unwrap().error;
        // Whoever has flown away before the first estimate does not make that the view of the reference.
        let moved = glam::DAffine3::from_translation(glam::DVec3::Y);
        let projection = crate::scene::Camera::default().projection;
        world.insert_resource(Viewpoint::new(&moved, projection));
        refine(&mut world, 2);
        assert_eq!(error(&world), None);
        world.insert_resource(Viewpoint::default());
        world.resource_mut::<Redone>().resets += 1;
        refine(&mut world, 2);
        assert!((error(&world).unwrap() - 0.1 / 1.01f64.sqrt()).abs() < 1e-6);
        let moved = glam::DAffine3::from_translation(glam::DVec3::X);
        world.insert_resource(Viewpoint::new(&moved, projection));
        world.resource_mut::<Redone>().resets += 1;
        refine(&mut world, 2);
        assert_eq!(error(&world), None);
        // The same view of something else.
        world.insert_resource(Viewpoint::default());
        world.resource_mut::<RenderSettings>().max_depth = 1;
        world.resource_mut::<Redone>().resets += 1;
        refine(&mut world, 2);
        assert_eq!(error(&world), None);
    }

    #[test]
    fn a_reference_of_another_size_is_told_once() {
        let mut world = world();
        let image = LinearImage { size: UVec2::new(2, 1), pixels: vec![glam::Vec3::ONE; 2] };
        let seen = Seen::of(&world);
        world.resource_mut::<Instrument>().reference =
            Some(Reference::new(image, Viewpoint::default(), seen));
        refine(&mut world, 16);
        let said = &world.resource::<Notices>().0;
        assert_eq!(said.len(), 1, "{said:?}");
        let Notice::Text(text) = &said[0] else { panic!("{said:?}") };
        assert!(text.contains("2 × 1") && text.contains("1 × 1"), "{text}");
    }
}
