//! One run of one method: samples in growing steps, and after each how wrong the picture is.

use super::curve::Measure;
use super::methods::Method;
use super::statistics::{first_below, value_at};
use crate::app::App;
use crate::image::compare::{Difference, LinearImage};
use crate::sync;
use crate::trace::noise::relative_noise;
use crate::trace::{
    FeatureCounts, Film, LightSampling, RayCounts, RenderSettings, TraceScene, trace_adaptive, trace_pass,
};
use glam::Vec3;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How wrong a picture was.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Samples per pixel.
    pub samples: u32,
    /// Seconds of tracing up to here; measuring is not counted.
    pub seconds: f64,
    /// Root of the mean over pixels and channels of the squared linear difference to the reference.
    pub rmse: f64,
    /// The same without the pixels that see a light, if there are such.
    pub rmse_surfaces: Option<f64>,
    /// What the program says of itself, from two samples on.
    pub noise: Option<f64>,
}

impl Point {
    /// By one measure.
    #[must_use]
    pub fn error(&self, measure: Measure) -> Option<f64> {
        match measure {
            Measure::All => Some(self.rmse),
            Measure::Surfaces => self.rmse_surfaces,
        }
    }
}

/// One run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Run {
    /// Seed of its noise.
    pub seed: u32,
    /// Measurements, in order.
    pub points: Vec<Point>,
    /// Rays by kind.
    pub rays: RayCounts,
}

/// Speed and error of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Performance {
    /// Samples per pixel and second.
    pub samples_per_second: f64,
    /// Rays per second, by kind.
    pub camera_rays_per_second: f64,
    /// Toward lights.
    pub shadow_rays_per_second: f64,
    /// From surface to surface.
    pub bounce_rays_per_second: f64,
    /// What else had to be done, in all.
    pub features: FeatureCounts,
    /// The same for each camera ray: mirror rays, texture lookups, alpha tests, choices among many lights.
    pub features_per_camera_ray: [f64; 4],
    /// Seconds of tracing until the noise number is below 5, 2 and 1 %.
    pub seconds_to_noise: [Option<f64>; 3],
    /// RMSE after 1, 5 and 30 seconds of tracing.
    pub rmse_after: [Option<f64>; 3],
    /// The same without the pixels that see a light.
    pub rmse_surfaces_after: [Option<f64>; 3],
}

/// Noise numbers that a picture is waited for.
pub const NOISE_LEVELS: [f64; 3] = [0.05, 0.02, 0.01];
/// Seconds after which the error is asked for.
pub const MOMENTS: [f64; 3] = [1.0, 5.0, 30.0];
/// Samples at which a picture is kept, to look at.
pub const PICTURE_SAMPLES: u32 = 16;
/// A pass is made to last about this long, so that an interruption is soon seen.
const PASS: Duration = Duration::from_millis(200);
/// More samples at once would not be faster.
const MOST_AT_ONCE: u32 = 32;

/// A built world, as rays need it, with settings of its own.
#[must_use]
pub fn traceable<'a>(app: &'a App, settings: &'a RenderSettings) -> TraceScene<'a> {
    TraceScene { settings, ..sync::traceable(&app.world) }
}

/// A film that grows by whole passes, with the time that it took.
pub struct Tracing<'a> {
    scene: TraceScene<'a>,
    /// The picture so far.
    pub film: Film,
    /// Seconds of tracing.
    pub seconds: f64,
    /// Rays traced.
    pub rays: RayCounts,
    interrupt: &'a AtomicBool,
    adaptive: bool,
    step: u32,
}

impl<'a> Tracing<'a> {
    /// Nothing traced yet.
    #[must_use]
    pub fn new(scene: TraceScene<'a>, interrupt: &'a AtomicBool) -> Self {
        let film = Film::new(scene.settings.size, 0);
        Self { scene, film, seconds: 0.0, rays: RayCounts::default(), interrupt, adaptive: false, step: 1 }
    }

    /// The same with more samples where there is more noise, if so.
    #[must_use]
    pub fn adaptive(self, adaptive: bool) -> Self {
        Self { adaptive, ..self }
    }

    /// One pass more, to at most `samples` per pixel. False if it was interrupted: then the film is not
    /// whole, and nothing should be measured of it.
    pub fn pass(&mut self, samples: u32) -> bool {
        let going = || !self.interrupt.load(Ordering::Relaxed);
        let start = Instant::now();
        let (scene, film) = (&self.scene, &mut self.film);
        let rays = if self.adaptive {
            trace_adaptive(scene, film, samples, self.step, going)
        } else {
            trace_pass(scene, film, samples, self.step, going)
        };
        let taken = start.elapsed();
        self.seconds += taken.as_secs_f64();
        self.rays = self.rays + rays;
        if taken < PASS / 2 {
            self.step = (self.step * 2).min(MOST_AT_ONCE);
        }
        going()
    }

    /// Samples of every pixel.
    #[must_use]
    pub fn samples(&self) -> u32 {
        self.film.complete_samples()
    }
}

/// 1, 2, 3, 4, 6, 8, 12 …: powers of two alone would flatter sequences that are at their best there.
pub fn checkpoints() -> impl Iterator<Item = u32> {
    (0..31).flat_map(|i| [Some(1 << i), (i > 0).then(|| (1 << i) + (1 << (i - 1)))]).flatten()
}

/// Which pixels see no light, and have no neighbour that does; rows from the top. `None` if all do, or none.
#[must_use]
pub fn surfaces(app: &App, settings: &RenderSettings) -> Option<Vec<bool>> {
    // Without any bounce only what shines is seen.
    let settings = RenderSettings { max_depth: 0, ..*settings };
    let mut film = Film::new(settings.size, 0);
    trace_pass(&traceable(app, &settings), &mut film, MASK_SAMPLES, MASK_SAMPLES, || true);
    let lit: Vec<bool> = LinearImage::of(&film).pixels.into_iter().map(|p| p != Vec3::ZERO).collect();
    // A sliver of a lamp may slip between the samples of its pixel, not of the next.
    let (width, height) = (film.size().x as usize, film.size().y as usize);
    let near_light = |i: usize| {
        let (x, y) = (i % width, i / width);
        let columns = x.saturating_sub(1)..=(x + 1).min(width - 1);
        (y.saturating_sub(1)..=(y + 1).min(height - 1)).any(|y| columns.clone().any(|x| lit[y * width + x]))
    };
    let dark: Vec<bool> = (0..lit.len()).map(|i| !near_light(i)).collect();
    (dark.contains(&true) && dark.contains(&false)).then_some(dark)
}

/// Samples that look for lights.
const MASK_SAMPLES: u32 = 64;

/// Root of the mean over pixels and channels of the squared difference; also over the pixels of a mask.
#[must_use]
pub fn rmse(picture: &LinearImage, reference: &LinearImage, mask: Option<&[bool]>) -> (f64, Option<f64>) {
    let masked = mask.map(|mask| {
        let only = |image: &LinearImage| {
            let pixels = image.pixels.iter().zip(mask).filter(|(_, inside)| **inside);
            LinearImage { size: image.size, pixels: pixels.map(|(pixel, _)| *pixel).collect() }
        };
        Difference::between(&only(picture), &only(reference)).rmse
    });
    (Difference::between(picture, reference).rmse, masked)
}

/// What a run is of.
pub struct Subject<'a> {
    /// A built world.
    pub app: &'a App,
    /// Its settings, before a method changes them.
    pub settings: RenderSettings,
    /// What it should look like.
    pub reference: &'a LinearImage,
    /// See [`surfaces`].
    pub surfaces: Option<&'a [bool]>,
    /// Raised from outside to stop.
    pub interrupt: &'a AtomicBool,
}

/// Renders by `method` for `limit` seconds of tracing. Also the picture at [`PICTURE_SAMPLES`], if it came
/// to that. An interrupted run ends with its last measurement.
pub fn run(
    subject: &Subject,
    method: &Method,
    seed: u32,
    limit: f64,
    mut progress: impl FnMut(f64),
) -> (Run, Option<LinearImage>) {
    let mut settings = RenderSettings { seed, ..subject.settings };
    (method.apply)(&mut settings);
    let scene = traceable(subject.app, &settings);
    let lights = (method.lights != LightSampling::BEST).then(|| scene.lights.sampled(method.lights));
    let scene = TraceScene { lights: lights.as_ref().unwrap_or(scene.lights), ..scene };
    let mut tracing = Tracing::new(scene, subject.interrupt).adaptive(method.adaptive);
    let mut run = Run { seed, ..Run::default() };
    let mut kept = None;
    'run: for checkpoint in checkpoints() {
        while tracing.samples() < checkpoint && (tracing.seconds < limit || checkpoint == 1) {
            if !tracing.pass(checkpoint) {
                break 'run;
            }
            progress(tracing.seconds);
        }
        let samples = tracing.samples();
        if run.points.last().is_none_or(|last| last.samples < samples) {
            let picture = LinearImage::of(&tracing.film);
            let (rmse, rmse_surfaces) = rmse(&picture, subject.reference, subject.surfaces);
            run.points.push(Point {
                samples,
                seconds: tracing.seconds,
                rmse,
                rmse_surfaces,
                noise: relative_noise(&tracing.film),
            });
            run.rays = tracing.rays;
        }
        if samples == PICTURE_SAMPLES {
            kept = Some(LinearImage::of(&tracing.film));
        }
        if tracing.seconds >= limit {
            break;
        }
    }
    (run, kept)
}

impl Performance {
    /// Of one run.
    #[must_use]
    pub fn of(run: &Run) -> Self {
        let Some(last) = run.points.last() else { return Self::default() };
        let noise: Vec<(f64, f64)> = run.points.iter().filter_map(|p| Some((p.seconds, p.noise?))).collect();
        let after = |measure: Measure| {
            let errors = run.points.iter().filter_map(|p| Some((p.seconds, p.error(measure)?)));
            let errors: Vec<(f64, f64)> = errors.collect();
            MOMENTS.map(|seconds| value_at(&errors, seconds))
        };
        let per_second = |rays: u64| rays as f64 / last.seconds;
        let features = run.rays.features;
        let counts =
            [features.mirror_rays, features.texture_lookups, features.alpha_tests, features.light_choices];
        Self {
            samples_per_second: f64::from(last.samples) / last.seconds,
            camera_rays_per_second: per_second(run.rays.camera),
            shadow_rays_per_second: per_second(run.rays.shadow),
            bounce_rays_per_second: per_second(run.rays.bounce),
            features,
            features_per_camera_ray: counts.map(|count| count as f64 / run.rays.camera.max(1) as f64),
            seconds_to_noise: NOISE_LEVELS.map(|level| first_below(&noise, level)),
            rmse_after: after(Measure::All),
            rmse_surfaces_after: after(Measure::Surfaces),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_grow_by_half_or_a_third() {
        let first: Vec<u32> = checkpoints().take(9).collect();
        assert_eq!(first, [1, 2, 3, 4, 6, 8, 12, 16, 24]);
        let all: Vec<u32> = checkpoints().collect();
        assert!(all.windows(2).all(|w| w[0] < w[1]) && all.contains(&PICTURE_SAMPLES));
    }

    #[test]
    fn performance_is_read_between_the_points_of_a_run() {
        let point = |samples: u32, seconds: f64, rmse: f64| Point {
            samples,
            seconds,
            rmse,
            rmse_surfaces: None,
            noise: Some(rmse),
        };
        let rays = RayCounts { camera: 64, shadow: 128, ..RayCounts::default() };
        let run = Run { seed: 0, points: vec![point(1, 0.25, 0.08), point(16, 4.0, 0.02)], rays };
        let performance = Performance::of(&run);
        assert_eq!(performance.samples_per_second, 4.0);
        assert_eq!(performance.shadow_rays_per_second, 32.0);
        let [one, five, thirty] = performance.rmse_after;
        assert!((one.unwrap() - 0.04).abs() < 1e-12 && five.is_none() && thirty.is_none());
        let [five, two, one] = performance.seconds_to_noise;
        assert!((five.unwrap() - 0.64).abs() < 1e-9 && two == Some(4.0) && one.is_none());
    }

    #[test]
    fn a_mask_leaves_pixels_out() {
        let image = |values: [f32; 4]| LinearImage {
            size: glam::UVec2::new(4, 1),
            pixels: values.map(Vec3::splat).to_vec(),
        };
        let (a, b) = (image([1.0, 2.0, 3.0, 9.0]), image([1.0, 2.0, 3.5, 5.0]));
        let (all, masked) = rmse(&a, &b, Some(&[true, true, true, false]));
        assert!((all - (16.25f64 / 4.0).sqrt()).abs() < 1e-6);
        assert!((masked.unwrap() - (0.25f64 / 3.0).sqrt()).abs() < 1e-6);
    }
}
