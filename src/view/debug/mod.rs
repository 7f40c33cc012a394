//! What is drawn into the scene: rays of a pixel, boxes of the hierarchy, the steps of a ray through it.

pub mod boxes;
pub mod layer;

use super::controls::{Notice, Notices};
use super::edit::Editor;
use super::edit::marks::Marks;
use super::input::{Input, Press};
use super::keymap::Tap;
use super::pixel_view::{DepthWanted, FirstHits};
use crate::bvh::inspect::{Order, Step, Visited, Visits};
use crate::bvh::{Hit, Tlas};
use crate::scene::SceneBounds;
use crate::sync::{Redone, Traceable};
use crate::trace::explain::{Explanation, Kind, explain};
use crate::trace::{Film, RenderSettings, TraceScene, Viewpoint};
use bevy_ecs::prelude::*;
use boxes::{Boxes, Placed, Statistics};
use glam::{DVec2, UVec2};
use layer::{Layer, Line};
use std::sync::Arc;

/// Samples that a pixel is explained by.
const SAMPLES: u32 = 32;

/// What the user wants to see in the scene.
#[derive(Resource, Clone, Debug, Default)]
pub struct Debug {
    /// Whether clicks pin pixels.
    pinning: bool,
    /// The pixel that is explained.
    pinned: Option<Pinned>,
    boxes: Boxes,
    /// Level to return to.
    level: u32,
    order: Order,
    /// How many steps of the pinned pixel's camera ray are shown; 0 for none.
    step: usize,
    told: Option<Arc<Told>>,
    statistics: Option<Arc<Statistics>>,
}

/// A pixel of a picture, and from where that was seen.
#[derive(Clone, Copy, Debug)]
struct Pinned {
    pixel: UVec2,
    size: UVec2,
    viewpoint: Viewpoint,
}

impl Pinned {
    /// The pixel that shows the same in a picture of another size, if that reaches so far.
    fn at(&self, size: UVec2) -> Option<UVec2> {
        let (old, new) = (self.size.as_dvec2(), size.as_dvec2());
        // Pictures of all sizes show as much from top to bottom, around the same middle.
        let place = (self.pixel.as_dvec2() + 0.5 - old * 0.5) * (new.y / old.y) + new * 0.5;
        (place.cmpge(DVec2::ZERO).all() && place.cmplt(new).all()).then(|| place.as_uvec2())
    }
}

/// What is told about the pinned pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Told {
    /// Its samples.
    pub explanation: Explanation,
    /// Steps of the first camera ray, in both orders.
    pub steps: [Vec<Step>; 2],
    /// What both orders cost.
    pub visits: [Visits; 2],
    /// What the ray hits.
    pub hit: Option<Hit>,
}

/// What the cards show.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DebugStatus {
    /// The pinned pixel.
    pub told: Option<Arc<Told>>,
    /// Which order's steps are shown, and up to which one.
    pub order: Order,
    /// 0 if none.
    pub step: usize,
    /// Which boxes are shown.
    pub boxes: Boxes,
    /// Of the hierarchy, if boxes are shown.
    pub statistics: Option<Arc<Statistics>>,
}

impl DebugStatus {
    /// Whether rays or boxes are shown.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.told.is_some() || self.boxes != Boxes::Off
    }
}

/// What is drawn over the picture, if anything.
#[derive(Resource, Clone, Debug, Default)]
pub struct CurrentLayer(pub Option<Arc<Layer>>);

impl Debug {
    /// For the cards.
    #[must_use]
    pub fn status(&self) -> DebugStatus {
        DebugStatus {
            told: self.told.clone(),
            order: self.order,
            step: self.step,
            boxes: self.boxes,
            statistics: self.statistics.clone(),
        }
    }

    /// Whether rays or boxes are wanted.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.pinned.is_some() || self.boxes != Boxes::Off
    }

    fn press(
        &mut self,
        press: &Press,
        viewpoint: &Viewpoint,
        size: UVec2,
        levels: u32,
    ) -> Option<&'static str> {
        match press.tap {
            Tap::Pin => {
                self.pinning = !self.pinning;
                (self.pinned, self.step) = (None, 0);
                if self.pinning {
                    self.pin(press.cursor, viewpoint, size);
                    return Some("click a pixel to see its rays");
                }
                // In place of that, which stands for a while and is no longer so.
                return Some("no rays any more");
            }
            Tap::Escape => (self.pinning, self.pinned, self.step, self.boxes) = (false, None, 0, Boxes::Off),
            Tap::Click if self.pinning => self.pin(press.cursor, viewpoint, size),
            Tap::Boxes => {
                self.boxes = match self.boxes {
                    Boxes::Off => Boxes::Level(self.level),
                    Boxes::Level(_) => Boxes::Leaves,
                    Boxes::Leaves => Boxes::Off,
                };
            }
            Tap::LevelUp | Tap::LevelDown => {
                let down = press.tap == Tap::LevelDown;
                let next = if down { self.level + 1 } else { self.level.saturating_sub(1) };
                self.level = next.min(levels.saturating_sub(1));
                self.boxes = Boxes::Level(self.level);
            }
            Tap::NextStep | Tap::PreviousStep if self.pinned.is_none() => {
                return Some("no pixel whose ray could go step by step: {pin} pins the one under the cursor");
            }
            Tap::NextStep => self.step += 1,
            Tap::PreviousStep => self.step = self.step.saturating_sub(1),
            Tap::Order => {
                self.order = match self.order {
                    Order::NearFirst => Order::Queue,
                    Order::Queue => Order::NearFirst,
                };
                return Some(match self.order {
                    Order::NearFirst => "order: near first, with a stack",
                    Order::Queue => "order: priority queue",
                });
            }
            _ => {}
        }
        None
    }

    fn pin(&mut self, cursor: DVec2, viewpoint: &Viewpoint, size: UVec2) {
        let size = size.max(UVec2::ONE);
        let pixel = (cursor * size.as_dvec2()).as_uvec2().min(size - 1);
        self.pinned = Some(Pinned { pixel, size, viewpoint: *viewpoint });
        self.step = 0;
    }
}

/// Keys and clicks.
pub fn change_debug(
    input: Res<Input>,
    viewpoint: Res<Viewpoint>,
    settings: Res<RenderSettings>,
    editor: Res<Editor>,
    mut debug: ResMut<Debug>,
    mut depth_wanted: ResMut<DepthWanted>,
    mut notices: ResMut<Notices>,
) {
    let ours = |press: &&Press| {
        let stepping = matches!(press.tap, Tap::NextStep | Tap::PreviousStep | Tap::Order);
        stepping || matches!(press.tap, Tap::Pin | Tap::Click | Tap::Boxes | Tap::LevelUp | Tap::LevelDown)
    };
    // One thing at a time is closed.
    let closes = debug.is_open() && !editor.has_selection();
    for press in input.taps.iter().filter(|press| ours(press) || press.tap == Tap::Escape && closes) {
        let levels = debug.statistics.as_ref().map_or(u32::MAX, |statistics| statistics.levels);
        if let Some(text) = debug.press(press, &viewpoint, settings.size, levels) {
            notices.0.push(Notice::Text(text.to_owned()));
        }
    }
    if debug.is_changed() {
        depth_wanted.set_if_neq(DepthWanted(debug.pinned.is_some() || debug.boxes != Boxes::Off));
    }
}

/// Explains the pinned pixel, and counts the hierarchy, whenever they may have changed.
pub fn explain_pinned(
    inputs: Traceable,
    film: Res<Film>,
    bounds: Option<Res<SceneBounds>>,
    mut debug: ResMut<Debug>,
    mut lines: ResMut<DebugLines>,
) {
    if !(debug.is_changed() || inputs.scene_is_changed()) {
        return;
    }
    let seen = inputs.scene();
    let debug = debug.bypass_change_detection();
    let mut drawn = Vec::new();
    debug.statistics = None;
    if debug.boxes != Boxes::Off {
        let (boxes, statistics) = boxes::show(&seen.geometry.tlas, debug.boxes);
        drawn.extend(boxes);
        debug.statistics = Some(Arc::new(statistics));
    }
    let pinned = debug.pinned.and_then(|pinned| Some((pinned.at(seen.settings.size)?, pinned.viewpoint)));
    debug.told = pinned.map(|(pixel, viewpoint)| {
        let scene = TraceScene { viewpoint: &viewpoint, ..seen };
        let far = bounds.map_or(10.0, |bounds| 2.0 * bounds.radius as f32);
        let first = film.first_sample();
        let explanation = explain(&scene, pixel, first..first.saturating_add(SAMPLES), far);
        Arc::new(tell(&seen.geometry.tlas, explanation))
    });
    if let Some(told) = &debug.told {
        drawn.extend(ray_lines(&told.explanation));
        let steps = &told.steps[debug.order as usize];
        debug.step = debug.step.min(steps.len());
        drawn.extend(step_lines(&seen.geometry.tlas, &steps[..debug.step]));
    }
    lines.0 = drawn;
}

fn tell(tlas: &Tlas, explanation: Explanation) -> Told {
    let mut told = Told { explanation, ..Told::default() };
    if let Some(ray) = told.explanation.ray {
        for order in [Order::NearFirst, Order::Queue] {
            let (hit, visits) =
                tlas.inspect(&ray, order, false, |step| told.steps[order as usize].push(*step));
            (told.hit, told.visits[order as usize]) = (hit, visits);
        }
    }
    told
}

/// Lines in the scene, in render space.
#[derive(Resource, Clone, Debug, Default)]
pub struct DebugLines(pub Vec<Line>);

/// What colour a ray has.
#[must_use]
pub fn color_of(kind: Kind) -> [u8; 3] {
    match kind {
        Kind::Camera => [255, 255, 255],
        Kind::Specular => [104, 208, 232],
        Kind::Bounce => [150, 160, 180],
        Kind::Lit => [90, 235, 100],
        Kind::Shadow => [190, 100, 255],
        Kind::Blocked => [255, 70, 60],
    }
}

fn ray_lines(explanation: &Explanation) -> impl Iterator<Item = Line> {
    explanation.segments.iter().map(|segment| {
        let alpha = if segment.kind == Kind::Camera { 0.25 } else { 0.7 };
        Line { ends: [segment.from, segment.to], color: color_of(segment.kind), alpha }
    })
}

/// Boxes visited, the last one brightest.
fn step_lines(tlas: &Tlas, steps: &[Step]) -> Vec<Line> {
    let count = steps.len();
    let line = |(i, step): (usize, &Step)| {
        let placement = step.instance.and_then(|i| tlas.placements().get(i as usize));
        let is_last = i + 1 == count;
        let color = match step.visited {
            _ if is_last => [255, 255, 120],
            Visited::Node => [110, 150, 255],
            Visited::Instance => [255, 150, 230],
            Visited::Leaf => [140, 230, 120],
        };
        let placed = Placed { bounds: step.bounds, placement };
        placed.lines(color, if is_last { 1.0 } else { 0.3 }).collect::<Vec<_>>()
    };
    steps.iter().enumerate().flat_map(line).collect()
}

/// Draws the lines as the camera sees them now.
pub fn draw_layer(
    (lines, marks): (Res<DebugLines>, Res<Marks>),
    viewpoint: Res<Viewpoint>,
    settings: Res<RenderSettings>,
    first: Res<FirstHits>,
    redone: Res<Redone>,
    mut drawn: Local<u64>,
    mut layer: ResMut<CurrentLayer>,
) {
    let is_new = lines.is_changed() || marks.is_changed() || first.is_changed() || *drawn != redone.resets;
    let is_empty = lines.0.is_empty() && marks.is_empty();
    if !is_new || is_empty && layer.0.is_none() {
        return;
    }
    *drawn = redone.resets;
    if is_empty {
        layer.0 = None;
        return;
    }
    let size = settings.size.max(UVec2::ONE);
    let surfaces = first.surfaces.as_ref().filter(|grid| grid.size() == size && grid.is_covered());
    let mut made = Layer::new(size);
    made.draw(&lines.0, &viewpoint, surfaces.map(crate::trace::first::Grid::cells));
    made.draw(&marks.lines(&viewpoint, size), &viewpoint, None);
    made.shade_around();
    layer.0 = Some(Arc::new(made));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_p_says_is_so() {
        let mut debug = Debug::default();
        let mut press = || debug.press(&Tap::Pin.into(), &Viewpoint::default(), UVec2::splat(9), 1);
        assert_eq!(press(), Some("click a pixel to see its rays"));
        assert_eq!(press(), Some("no rays any more"));
        for step in [Tap::NextStep, Tap::PreviousStep] {
            let said = debug.press(&step.into(), &Viewpoint::default(), UVec2::splat(9), 1);
            assert!(said.is_some_and(|said| said.contains("{pin}")), "{said:?}");
        }
    }

    #[test]
    fn a_pinned_pixel_is_the_same_place_after_a_resize() {
        let viewpoint = Viewpoint::default();
        let sizes = [UVec2::new(320, 240), UVec2::new(640, 480), UVec2::new(300, 480), UVec2::new(777, 131)];
        for pixel in [UVec2::new(160, 120), UVec2::new(130, 31), UVec2::new(201, 239)] {
            let pinned = Pinned { pixel, size: sizes[0], viewpoint };
            let direction = |pixel: UVec2, size: UVec2| viewpoint.ray(pixel.as_vec2() + 0.5, size).direction;
            let wanted = direction(pixel, sizes[0]);
            assert_eq!(pinned.at(sizes[0]), Some(pixel));
            for size in sizes {
                let off = direction(pinned.at(size).unwrap(), size).distance(wanted);
                // Within a pixel.
                assert!(off < 1.2 / size.y as f32, "{pixel} {size} {off}");
            }
        }
        let corner = Pinned { pixel: UVec2::ZERO, size: sizes[0], viewpoint };
        assert_eq!(corner.at(UVec2::new(100, 240)), None, "beside the picture");
    }
}
