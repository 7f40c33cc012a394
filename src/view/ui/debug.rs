//! Cards about the pinned pixel and the hierarchy.

use super::super::debug::boxes::{Boxes, Statistics};
use super::super::debug::{DebugStatus, Told, color_of};
use super::super::status::{counted, significant};
use super::place::Places;
use super::style::{ACCENT, FAINT, MARGIN};
use super::{SCROLLING, scrolling_card};
use crate::bvh::inspect::{Order, Visited, Visits};
use crate::trace::explain::{Kind, LightRow};
use egui::{Align2, Color32, Context, Frame, Grid, Margin, Rect, RichText, ScrollArea, Ui, vec2};
use glam::UVec2;

/// Nobody scrolls through more lines.
const MOST_ROWS: usize = 50;
/// How high the lines of the lights may be together, points, least and most; and how high about all the others are.
const LIGHTS: [f32; 2] = [45.0, 150.0];
const OTHERS: f32 = 110.0;
/// Around the pinned pixel, points, what shall be seen of it.
const PIN: f32 = 40.0;

/// Shows the card in the lower left corner, or where that is taken or the pinned pixel of a picture of `size` is, in another.
pub fn show(context: &Context, status: &DebugStatus, size: UVec2, places: &Places) -> Option<Rect> {
    if status.told.is_none() && status.statistics.is_none() {
        return None;
    }
    let own = places.size_of(context, SCROLLING).x + MARGIN;
    let (left, right) = (places.room.left(), places.room.right());
    let corners = [
        (Align2::LEFT_BOTTOM, vec2(MARGIN, -MARGIN)),
        (Align2::CENTER_BOTTOM, vec2(0.0, -MARGIN)),
        (Align2::RIGHT_BOTTOM, vec2(-MARGIN, -MARGIN)),
        (Align2::LEFT_TOP, vec2(MARGIN, places.reach(left, left + own, true))),
        (Align2::RIGHT_TOP, vec2(-MARGIN, places.reach(right - own, right, true))),
    ];
    let pinned = status.told.as_ref().map(|told| {
        let part = (told.explanation.pixel.as_vec2() + 0.5) / size.max(UVec2::ONE).as_vec2();
        let at = places.room.min + vec2(part.x, part.y) * places.room.size();
        Rect::from_center_size(at, vec2(2.0 * PIN, 2.0 * PIN))
    });
    let place = places.find_clear_of(pinned, context, SCROLLING, &corners);
    let lights = (0.5 * places.room.height() - OTHERS).clamp(LIGHTS[0], LIGHTS[1]);
    Some(scrolling_card(context, place, |ui| {
        if let Some(statistics) = &status.statistics {
            show_statistics(ui, status.boxes, statistics);
        }
        if let Some(told) = &status.told {
            show_pixel(ui, told, status, lights);
        }
    }))
}

fn faint(ui: &mut Ui, text: impl Into<String>) {
    ui.label(RichText::new(text).color(FAINT).small());
}

fn show_statistics(ui: &mut Ui, boxes: Boxes, statistics: &Statistics) {
    let title = match boxes {
        Boxes::Off => "hierarchy".to_owned(),
        Boxes::Level(level) => format!("hierarchy: level {level} of {}", statistics.levels),
        Boxes::Leaves => format!("hierarchy: leaves of {}", counted(statistics.levels as usize, "level")),
    };
    ui.label(RichText::new(title).color(ACCENT));
    let [shown, wanted] = statistics.shown;
    let boxes = match shown {
        shown if shown < wanted => format!("{shown} of {wanted} boxes"),
        1 => "1 box".to_owned(),
        shown => format!("{shown} boxes"),
    };
    let text = format!(
        "{boxes}; {}, {}, {} kB, SAH cost {}",
        counted(statistics.instances, "instance"),
        counted(statistics.nodes, "node"),
        statistics.bytes / 1000,
        significant(f64::from(statistics.cost), 3),
    );
    ui.label(RichText::new(text).small());
    let sizes = statistics.leaves.iter().zip(1..).filter(|(count, _)| **count > 0);
    let sizes: Vec<String> = sizes.map(|(count, size)| format!("{count} × {size}")).collect();
    faint(ui, format!("leaves × triangles: {}", sizes.join(", ")));
}

fn show_pixel(ui: &mut Ui, told: &Told, status: &DebugStatus, height: f32) {
    let explanation = &told.explanation;
    let pixel = explanation.pixel;
    ui.label(RichText::new(format!("pixel {}, {}", pixel.x, pixel.y)).color(ACCENT));
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 8.0;
        for (kind, name) in [
            (Kind::Lit, "brings light"),
            (Kind::Shadow, "in shadow"),
            (Kind::Blocked, "area light blocked"),
            (Kind::Specular, "mirror, glass"),
        ] {
            let [r, g, b] = color_of(kind);
            ui.label(RichText::new(name).color(Color32::from_rgb(r, g, b)).small());
        }
    });
    if explanation.lights.is_empty() {
        faint(ui, if told.hit.is_none() { "hits nothing" } else { "no light was sampled" });
    } else {
        let lights = ScrollArea::vertical().min_scrolled_height(LIGHTS[0]).max_height(height);
        // The bar that tells where one is stands to the right of the numbers.
        let margin = Frame::new().inner_margin(Margin { right: 8, ..Margin::ZERO });
        lights.show(ui, |ui| margin.show(ui, |ui| show_lights(ui, &explanation.lights)));
    }
    let [stack, queue] = told.visits;
    for (name, visits, order) in [("near first", stack, Order::NearFirst), ("queue", queue, Order::Queue)] {
        let color = if order == status.order { ACCENT } else { FAINT };
        ui.label(RichText::new(cost_line(name, &visits)).color(color).small());
    }
    let steps = &told.steps[status.order as usize];
    if let Some(step) = status.step.checked_sub(1).and_then(|i| steps.get(i)) {
        let what = match step.visited {
            Visited::Node => "node",
            Visited::Instance => "instance",
            Visited::Leaf => "leaf",
        };
        let found =
            if step.found.is_finite() { format!(", hit at {:.3}", step.found) } else { String::new() };
        let (at, of) = (status.step, steps.len());
        faint(ui, format!("step {at} of {of}: {what}, entered at {:.3}{found}", step.near));
    } else {
        faint(ui, format!("{}: ; and ' go through them, O changes the order", counted(steps.len(), "step")));
    }
}

fn cost_line(name: &str, visits: &Visits) -> String {
    let Visits { nodes, boxes, triangles, waiting } = visits;
    let (nodes, triangles) = (counted(*nodes as usize, "node"), counted(*triangles as usize, "triangle"));
    let boxes = if *boxes == 1 { "1 box".to_owned() } else { format!("{boxes} boxes") };
    format!("{name}: {nodes}, {boxes}, {triangles}, {waiting} waiting at most")
}

fn show_lights(ui: &mut Ui, rows: &[LightRow]) {
    let grid = Grid::new("lights").num_columns(7).spacing([10.0, 2.0]).min_row_height(0.0);
    grid.show(ui, |ui| {
        for title in ["light", "lit / sampled", "density, 1/sr", "unblocked", "brings", "nodes", "triangles"]
        {
            faint(ui, title);
        }
        ui.end_row();
        for row in rows.iter().take(MOST_ROWS) {
            show_light(ui, row);
        }
    });
    if rows.len() > MOST_ROWS {
        faint(ui, format!("and {} more", rows.len() - MOST_ROWS));
    }
}

fn show_light(ui: &mut Ui, row: &LightRow) {
    let bounce = if row.depth == 0 { String::new() } else { format!(", bounce {}", row.depth) };
    let pdf = match row.pdf {
        None => "—".to_owned(),
        Some([least, most]) => {
            let [least, most] = [least, most].map(|pdf| significant(f64::from(pdf), 2));
            if least == most { least } else { format!("{least} – {most}") }
        }
    };
    let number = |x: f32| significant(f64::from(x), 3);
    let dark = if row.dark > 0 { format!(" ({} dark)", row.dark) } else { String::new() };
    for text in [
        format!("{} {}{bounce}", row.light, row.name),
        format!("{} / {}{dark}", row.lit, row.samples),
        pdf,
        number(row.unblocked),
        number(row.contribution),
        format!("{:.1}", row.visits[0]),
        format!("{:.1}", row.visits[1]),
    ] {
        ui.label(RichText::new(text).small());
    }
    ui.end_row();
}
