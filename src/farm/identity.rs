//! What a film is a picture of: whoever differs in any of it has other samples.

use super::Fingerprint;
use crate::scene::Filter;
use crate::sync::{RenderOrigin, traceable};
use bevy_ecs::prelude::*;
use serde::{Deserialize, Serialize};

/// All that a film's samples depend on, besides their indices. In words where people may want to read it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Version of the program: another one may trace otherwise.
    pub program: String,
    /// Name of the scene, for people. Not compared: files may be renamed.
    pub scene: String,
    /// [`Fingerprint::of_scene`] in hexadecimal digits.
    pub scene_hash: String,
    /// [`Viewpoint::description`].
    pub camera: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `direct` or `path`.
    pub integrator: String,
    /// Bounces at most.
    pub max_depth: u32,
    /// `file`, `nearest` or `bilinear`.
    pub filter: String,
    /// How random numbers are spread: over the samples, and over the places in a pixel.
    pub sampling: String,
    /// Seed of the samples.
    pub seed: u32,
}

impl Identity {
    /// Of the picture that `world` makes. Call [`crate::app::App::build`] first.
    #[must_use]
    pub fn of(world: &World, scene: String) -> Self {
        let arrays = traceable(world);
        let settings = arrays.settings;
        let origin = world.resource::<RenderOrigin>().0.unwrap_or_default();
        Self {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            scene,
            scene_hash: format!("{:032x}", Fingerprint::of_scene(&arrays, origin)),
            camera: arrays.viewpoint.description(origin),
            width: settings.size.x,
            height: settings.size.y,
            integrator: settings.integrator.name().to_owned(),
            max_depth: settings.max_depth,
            filter: match settings.filter {
                None => "file".to_owned(),
                Some(Filter::Nearest) => "nearest".to_owned(),
                Some(Filter::Bilinear) => "bilinear".to_owned(),
            },
            sampling: format!(
                "{:?}, {:?}, {} light samples{}{}{}",
                settings.sampling,
                settings.pixel_sampling.unwrap_or(settings.sampling),
                settings.light_samples,
                if settings.shafts { "" } else { ", no shafts" },
                if settings.reuse { "" } else { ", no reuse" },
                if settings.cuts { "" } else { ", no cuts" }
            )
            .to_lowercase(),
            seed: settings.seed,
        }
    }

    /// A number that is another one when anything that is compared is.
    #[must_use]
    pub fn hash(&self) -> u64 {
        let mut print = Fingerprint::default();
        // Strings and numbers are always written.
        print.bytes(&serde_json::to_vec(self).unwrap_or_default());
        print.finish() as u64
    }

    /// What makes this another picture than `wanted`, each point in words; nothing if they are the same.
    #[must_use]
    pub fn differences(&self, wanted: &Self) -> Vec<String> {
        let rows = |id: &Self| {
            [
                ("program version", id.program.clone()),
                // The hash tells them apart; the name helps who reads it.
                ("scene", format!("\"{}\" ({})", id.scene, id.scene_hash.get(..8).unwrap_or(&id.scene_hash))),
                ("camera", id.camera.clone()),
                ("size", format!("{}x{}", id.width, id.height)),
                ("integrator", id.integrator.clone()),
                ("max depth", id.max_depth.to_string()),
                ("texture filter", id.filter.clone()),
                ("sampling", id.sampling.clone()),
                ("seed", id.seed.to_string()),
            ]
        };
        let same_scene = self.scene_hash == wanted.scene_hash;
        rows(self)
            .into_iter()
            .zip(rows(wanted))
            .filter(|((name, mine), (_, other))| if *name == "scene" { !same_scene } else { mine != other })
            .map(|((name, mine), (_, other))| format!("{name} {mine}, not {other}"))
            .collect()
    }
}
