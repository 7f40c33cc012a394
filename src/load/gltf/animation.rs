//! Animations → [`Animation`] entities. One that is damaged is left out; it never costs the scene.

use super::Document;
use super::parse::{Lenient, Placement, Whole};
use crate::load::error::LoadError;
use crate::load::report::Sink;
use crate::scene::{Animation, Channel, Curve, Interpolation, MorphWeights, Playing, Pose, Property};
use bevy_ecs::name::Name;
use bevy_ecs::prelude::*;
use gltf::json::Index;
use serde::Deserialize;
use std::collections::HashSet;

/// As it stands in the file; `gltf::json` refuses channels without a node, which extensions make.
#[derive(Default, Deserialize)]
pub(super) struct AnimationJson {
    #[serde(default)]
    name: Lenient<Option<String>>,
    #[serde(default)]
    channels: Vec<Lenient<ChannelJson>>,
    #[serde(default)]
    samplers: Vec<Lenient<SamplerJson>>,
}

#[derive(Deserialize)]
struct ChannelJson {
    sampler: Whole,
    target: TargetJson,
}

#[derive(Deserialize)]
struct TargetJson {
    node: Option<Whole>,
    path: String,
}

#[derive(Deserialize)]
struct SamplerJson {
    input: Whole,
    output: Whole,
    interpolation: Option<String>,
}

/// Spawns all animations, and plays what is asked for.
pub(super) fn spawn_all(
    document: &Document<'_>,
    entities: &[Option<Entity>],
    sink: &mut Sink<'_>,
) -> Result<(), LoadError> {
    let time = sink.options.time;
    let mut spawned = Vec::new();
    let mut moved: HashSet<(Entity, Property)> = HashSet::new();
    let mut together = Vec::new();
    let all = document.animations.good();
    if all.is_none() {
        sink.ignored(document.file, "animations", "not as the format says: left out");
    }
    let nothing = AnimationJson::default();
    for (i, json) in all.into_iter().flatten().enumerate() {
        let json = json.good().unwrap_or_else(|| {
            sink.ignored(document.file, &format!("animation {i}"), "not as the format says: left out");
            &nothing
        });
        let animation = convert(document, i, json, entities, sink);
        let name = json.name.good().cloned().flatten().unwrap_or_else(|| format!("animation {i}"));
        // Animations of different things play side by side; of the same thing, the first one does.
        let targets: Vec<_> = animation.channels.iter().map(|c| (c.target, c.property)).collect();
        let entity = sink.spawn((Name::new(name.clone()), animation));
        spawned.push((name, entity));
        if targets.iter().all(|target| !moved.contains(target)) {
            moved.extend(targets);
            together.push(entity);
        }
    }
    let animations = match &sink.options.animation {
        // Another file of the scene may have it.
        Some(wanted) => document.chosen(wanted, "animation", &spawned).ok().into_iter().collect(),
        None => together,
    };
    if let Some(time) = time {
        let names: Vec<&str> = spawned
            .iter()
            .filter(|(_, entity)| animations.contains(entity))
            .map(|(name, _)| name.as_str())
            .collect();
        let which = if names.is_empty() { "no animation".to_owned() } else { names.join(", ") };
        sink.decide(document.file, format!("stands as at {time} s of {which}"));
    } else if !spawned.is_empty() {
        sink.decide(
            document.file,
            "has animations; stands in its rest pose (--time S shows another, the window plays them)",
        );
    }
    // Another file of the scene may have brought some before.
    let mut playing = sink.world.get_resource_or_init::<Playing>();
    playing.time = time;
    playing.animations.extend(animations);
    sink.report.animations.extend(spawned);
    Ok(())
}

fn convert(
    document: &Document<'_>,
    index: usize,
    json: &AnimationJson,
    entities: &[Option<Entity>],
    sink: &mut Sink<'_>,
) -> Animation {
    let mut animation = Animation::default();
    let mut moved: HashSet<(Entity, Property)> = HashSet::new();
    let place = format!("animation {index}");
    for channel in &json.channels {
        let Lenient::Good(channel) = channel else {
            sink.ignored(document.file, &place, "channel that is not as the format says");
            continue;
        };
        let property = match channel.target.path.as_str() {
            "translation" => Property::Translation,
            "rotation" => Property::Rotation,
            "scale" => Property::Scale,
            "weights" => Property::Weights,
            _ => {
                let what = format!("channels that move `{}` are not supported", channel.target.path);
                sink.ignored(document.file, &place, what);
                continue;
            }
        };
        // A node that is not in the scene shown moves nothing there.
        let Some(Whole(node)) = channel.target.node else { continue };
        let Some(target) = entities.get(node as usize).copied().flatten() else { continue };
        let sampler = match json.samplers.get(channel.sampler.0 as usize) {
            Some(Lenient::Good(sampler)) => sampler,
            Some(Lenient::Bad(_)) => {
                sink.ignored(document.file, &place, "channel whose sampler is not as the format says");
                continue;
            }
            None => {
                sink.ignored(document.file, &place, "channel whose sampler does not exist");
                continue;
            }
        };
        // The format forbids it; what it would show is anyone's guess.
        if !moved.insert((target, property)) {
            sink.ignored(document.file, &place, "channel that moves what another one of its animation moves");
            continue;
        }
        let curve = match curve(document, sampler, property, &place) {
            Ok(curve) => curve,
            Err(why) => {
                sink.ignored(document.file, &place, format!("damaged channel: {why}"));
                continue;
            }
        };
        if property == Property::Weights && sink.world.get::<MorphWeights>(target).is_none() {
            continue;
        }
        if property != Property::Weights && sink.world.get::<Pose>(target).is_none() {
            let nothing = Placement::default();
            let placement = document.placements.get(node as usize).unwrap_or(&nothing);
            sink.world.entity_mut(target).insert(placement.pose());
        }
        animation.duration = animation.duration.max(curve.times.last().copied().unwrap_or(0.0).into());
        animation.channels.push(Channel { target, property, curve });
    }
    animation
}

fn curve(
    document: &Document<'_>,
    sampler: &SamplerJson,
    property: Property,
    place: &str,
) -> Result<Curve, String> {
    let open = |Whole(index)| document.elements(&Index::new(index), place).map_err(|error| error.to_string());
    let (input, output) = (open(sampler.input)?, open(sampler.output)?);
    let interpolation = match sampler.interpolation.as_deref() {
        None | Some("LINEAR") => Interpolation::Linear,
        Some("STEP") => Interpolation::Step,
        Some("CUBICSPLINE") => Interpolation::Cubic,
        Some(other) => return Err(format!("unknown interpolation `{other}`")),
    };
    let parts = if interpolation == Interpolation::Cubic { 3 } else { 1 };
    let keys = input.count;
    let width = match property {
        Property::Translation | Property::Scale => 3,
        Property::Rotation => 4,
        Property::Weights => output.count.checked_div(keys * parts).unwrap_or(0),
    };
    let element = if property == Property::Weights { 1 } else { width };
    let values = keys * parts * if property == Property::Weights { width } else { 1 };
    if input.width != 1 || keys == 0 || width == 0 || output.width != element || output.count != values {
        return Err("keyframes and values do not match".to_owned());
    }
    let memory = 4 * (keys as u64 + (output.count * element) as u64);
    let too_large = |_| "too large for the memory allowed (see --max-memory)".to_owned();
    document.budget.take(memory, document.file, place).map_err(too_large)?;
    let times: Vec<f32> = (0..keys).map(|i| input.get_f32::<1>(i)[0]).collect();
    if !times.iter().all(|time| time.is_finite()) || times.windows(2).any(|pair| pair[0] > pair[1]) {
        return Err("times of keyframes do not ascend".to_owned());
    }
    let values: Vec<f32> = if element == 1 {
        (0..output.count).map(|i| output.get_f32::<1>(i)[0]).collect()
    } else {
        (0..output.count).flat_map(|i| output.get_f32::<4>(i).into_iter().take(element)).collect()
    };
    if values.iter().all(|value| value.is_finite()) {
        Ok(Curve { times, values, width, interpolation })
    } else {
        Err("a value is not finite".to_owned())
    }
}
