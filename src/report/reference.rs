//! What errors are measured against: a long run of our own, kept on disk, or a picture that is given.

use super::ReportError;
use super::curve::Measure;
use super::measure::{Tracing, traceable};
use crate::app::App;
use crate::farm::Identity;
use crate::image::compare::LinearImage;
use crate::image::files::write_whole;
use crate::image::{Display, save};
use crate::trace::{Film, RenderSettings};
use glam::{DVec3, UVec2};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A reference that somebody has already.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenReference {
    /// Of which scene; `None`: of the only one.
    pub scene: Option<String>,
    /// The file.
    pub path: PathBuf,
}

impl GivenReference {
    /// From `FILE` or `SCENE=FILE`.
    #[must_use]
    pub fn parse(text: &str) -> Self {
        match text.split_once('=') {
            Some((scene, path)) if !Path::new(text).exists() => {
                Self { scene: Some(scene.to_owned()), path: PathBuf::from(path) }
            }
            _ => Self { scene: None, path: PathBuf::from(text) },
        }
    }
}

/// Where a reference comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Origin {
    /// Rendered for this report.
    Made,
    /// Rendered for an earlier one.
    Cached,
    /// From the command line.
    Given,
}

/// What is known of a reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReferenceFacts {
    /// Where it comes from.
    pub origin: Origin,
    /// Its file.
    pub file: String,
    /// How it was made, if by us.
    pub made: Option<Making>,
}

/// How a reference was made: kept beside it. Fields of older files that are missing make it be made anew.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Making {
    /// Samples per pixel.
    pub samples: u32,
    /// Seconds of tracing.
    pub seconds: f64,
    /// Its own standard error, from its two halves, in the measure of the RMSE.
    pub standard_error: f64,
    /// The same without the pixels that see a light, if there are such.
    #[serde(deserialize_with = "Option::deserialize")]
    pub standard_error_surfaces: Option<f64>,
}

impl ReferenceFacts {
    /// Its own standard error by one measure, if it is known.
    #[must_use]
    pub fn standard_error(&self, measure: Measure) -> Option<f64> {
        self.made.and_then(|making| match measure {
            Measure::All => Some(making.standard_error),
            Measure::Surfaces => making.standard_error_surfaces,
        })
    }
}

/// A reference and what is known of it.
#[derive(Clone, Debug)]
pub struct Reference {
    /// The picture.
    pub picture: LinearImage,
    /// Its origin and error.
    pub facts: ReferenceFacts,
}

/// No run that is measured has this seed: it must not share its samples with the reference.
const SEED: u32 = 0x5eed_0fff;
/// All of theirs are below this.
pub const OWN_SEEDS: u32 = 10_000;
/// One made in a little less time is as good.
const AS_GOOD: f64 = 0.8;

/// Reads a given one, a picture or a film, and checks that it fits.
///
/// # Errors
/// If it cannot be read, has another size than `wanted`, holds values that are not finite, or is a film of samples that may be
/// those of a run.
pub fn given(path: &Path, scene: &str, wanted: UVec2) -> Result<Reference, ReportError> {
    let given = crate::reference::Reference::open(path)?;
    if let Some(seed) = given.seed().filter(|&seed| seed < OWN_SEEDS) {
        return Err(ReportError::ReferenceSeed { path: path.into(), seed });
    }
    let picture = given.picture;
    if picture.size != wanted {
        let scene = scene.to_owned();
        return Err(ReportError::ReferenceSize { path: path.into(), scene, found: picture.size, wanted });
    }
    let count = picture.pixels.iter().filter(|p| !p.is_finite()).count();
    if count > 0 {
        return Err(ReportError::ReferenceBroken { path: path.into(), count });
    }
    let file = path.display().to_string();
    Ok(Reference { picture, facts: ReferenceFacts { origin: Origin::Given, file, made: None } })
}

/// Finds one in `folder`, or traces for `seconds` and leaves it there. `None` if it was interrupted.
///
/// # Errors
/// If it cannot be written.
pub fn made(
    app: &App,
    (settings, surfaces): (&RenderSettings, Option<&[bool]>),
    (folder, name): (&Path, &str),
    seconds: f64,
    interrupt: &AtomicBool,
    mut progress: impl FnMut(f64),
) -> Result<Option<Reference>, ReportError> {
    let path = folder.join(format!("{name}-{:016x}.exr", Identity::of(&app.world, String::new()).hash()));
    let beside = path.with_extension("json");
    let facts = |origin, making| ReferenceFacts {
        origin,
        file: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        made: Some(making),
    };
    if let Some((picture, making)) = cached(&path, &beside, settings.size)
        && making.seconds >= AS_GOOD * seconds
    {
        return Ok(Some(Reference { picture, facts: facts(Origin::Cached, making) }));
    }
    let settings = RenderSettings { seed: SEED, ..*settings };
    let mut tracing = Tracing::new(traceable(app, &settings), interrupt);
    while tracing.seconds < seconds || tracing.samples() < 2 {
        if !tracing.pass(u32::MAX) {
            return Ok(None);
        }
        progress(tracing.seconds);
    }
    let making = Making {
        samples: tracing.samples(),
        seconds: tracing.seconds,
        standard_error: standard_error(&tracing.film, None),
        standard_error_surfaces: surfaces.map(|mask| standard_error(&tracing.film, Some(mask))),
    };
    save(&path, &tracing.film, &Display::default())?;
    write_whole(&beside, &serde_json::to_vec_pretty(&making)?)?;
    Ok(Some(Reference { picture: LinearImage::of(&tracing.film), facts: facts(Origin::Made, making) }))
}

/// What is not there, or not whole, is made anew.
fn cached(path: &Path, beside: &Path, size: UVec2) -> Option<(LinearImage, Making)> {
    let making = serde_json::from_slice(&std::fs::read(beside).ok()?).ok()?;
    let picture = LinearImage::open(path).ok()?;
    let whole = picture.size == size && picture.pixels.iter().all(|p| p.is_finite());
    whole.then_some((picture, making))
}

/// Root of the mean over pixels (those of a mask) and channels of ((A − B) / 2)², A and B being the film's
/// halves.
#[must_use]
pub fn standard_error(film: &Film, mask: Option<&[bool]>) -> f64 {
    let pixels = (0..film.size().y).flat_map(|y| film.row(y)).enumerate();
    let (mut sum, mut count) = (0.0, 0);
    for (_, pixel) in pixels.filter(|(i, _)| mask.is_none_or(|mask| mask[*i])) {
        let halves = pixel.half_mean(0).zip(pixel.half_mean(1));
        sum += halves.map_or(DVec3::ZERO, |(a, b)| 0.5 * (a - b)).length_squared();
        count += 1;
    }
    (sum / (3.0 * f64::from(count.max(1)))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn the_standard_error_is_half_the_difference_of_the_halves() {
        let mut film = Film::new(UVec2::new(2, 1), 0);
        for pixel in film.tiles_mut()[0].pixels_mut() {
            pixel.add(0, Vec3::new(1.0, 2.0, 3.0));
            pixel.add(1, Vec3::new(3.0, 2.0, 3.0));
        }
        assert!((standard_error(&film, None) - (1.0f64 / 3.0).sqrt()).abs() < 1e-12);
        film.tiles_mut()[0].pixels_mut()[0].add(2, Vec3::splat(100.0));
        assert!((standard_error(&film, Some(&[false, true])) - (1.0f64 / 3.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_given_reference_may_name_its_scene() {
        let given = GivenReference::parse("bust=a/b.exr");
        assert_eq!((given.scene.as_deref(), given.path), (Some("bust"), PathBuf::from("a/b.exr")));
        assert_eq!(GivenReference::parse("b.exr").scene, None);
    }
}
