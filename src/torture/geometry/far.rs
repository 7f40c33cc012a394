//! G7: the same picture far from the world's origin.

use super::stage::means;
use crate::app::{App, FrameBudget, FrameStats};
use crate::load::{LoadOptions, SceneSource};
use crate::scene::Transform;
use crate::sync::RenderOrigin;
use crate::torture::{Case, Check, Trial};
use crate::trace::{Film, RenderSettings};
use bevy_ecs::prelude::*;
use glam::{DQuat, DVec3, UVec2};

pub(super) const CASE: Case = Case {
    id: "G7",
    title: "the Cornell box under translations of 1 to 1e7, and of two that cancel",
    limit: "the picture is that at the origin: RMSE below 1e-6",
    run: |trial| run(trial, None),
};

/// The box, a 256th as large so that it is of about 2, under a root for each of the translations. `origin`: where render space has its own, if not where the scene is.
fn picture(translations: &[DVec3], origin: Option<DVec3>, samples: u32) -> Option<Film> {
    let settings = RenderSettings { size: UVec2::new(64, 64), ..RenderSettings::default() };
    let source = SceneSource::BuiltIn("cornell");
    let (mut app, _) = App::open(&source, &LoadOptions::default(), settings).ok()?;
    let world = &mut app.world;
    world.insert_resource(RenderOrigin(origin));
    let mut query = world.query_filtered::<Entity, (With<Transform>, Without<ChildOf>)>();
    let mut children: Vec<Entity> = query.iter(world).collect();
    let small = Transform::from_parts(DVec3::ZERO, DQuat::IDENTITY, DVec3::splat(1.0 / 256.0));
    let moved = translations.iter().map(|&translation| Transform::from_translation(translation));
    for transform in std::iter::once(small).chain(moved) {
        let parent = world.spawn(transform).id();
        for child in children {
            world.entity_mut(child).insert(ChildOf(parent));
        }
        children = vec![parent];
    }
    world.resource_mut::<FrameBudget>().sample_target = samples;
    loop {
        app.frame();
        if app.world.resource::<FrameStats>().done {
            return Some(app.world.resource::<Film>().clone());
        }
    }
}

/// The case; where render space keeps the world's `origin` it breaks.
#[must_use]
pub fn run(trial: &Trial<'_>, origin: Option<DVec3>) -> Vec<Check> {
    let samples = trial.pick(2, 16, 256) as u32;
    let along = DVec3::ONE;
    let mut places: Vec<(String, Vec<DVec3>)> =
        (0..=7).map(|k| (format!("at 1e{k}"), vec![along * 10f64.powi(k)])).collect();
    places.push(("at 1e7 - 1e7 + 0.25".to_owned(), vec![along * 1e7, along * (0.25 - 1e7)]));
    let Some(here) = picture(&[], origin, samples) else { return Vec::new() };
    let expected = means(&here);
    let mut checks = Vec::new();
    for (number, (what, translations)) in places.iter().enumerate() {
        if trial.interrupted() {
            break;
        }
        trial.tell(CASE.id, what.clone(), number as f64 / places.len() as f64);
        let rmse = picture(translations, origin, samples).map_or(f64::NAN, |film| {
            let squares =
                means(&film).iter().zip(&expected).map(|(a, b)| (a - b).length_squared()).sum::<f64>();
            (squares / (3 * expected.len()) as f64).sqrt()
        });
        checks.push(Check::new(format!("RMSE {what}"), expected.len() as u64, "pixels", rmse, 1e-6));
    }
    checks
}
