//! The card of the selected thing: its numbers, to be dragged or typed.

use super::super::edit::EditStatus;
use super::super::edit::property::{Property, Row};
use super::glyphs::legible;
use super::place::Places;
use super::style::{self, ACCENT, CAUTION, FAINT, MARGIN};
use egui::scroll_area::ScrollSource;
use egui::{Align2, Area, Context, DragValue, Grid, Id, Rect, RichText, ScrollArea, Ui, vec2};
use std::cell::Cell;

/// Of the card, points: it shall not move under the mouse.
pub const WIDTH: f32 = 214.0;
/// Of the names of numbers, and of the fields for these.
const NAMES: f32 = 74.0;
const FIELD: f32 = 96.0;
/// Where it is kept of which thing and number too much or too little was typed last.
const BEYOND: &str = "beyond its limits";
type Beyond = ([usize; 2], Property, f64);
/// Room for the names above the numbers, and for what is told below them.
const HEAD: f32 = 64.0;
const FOOT: f32 = 52.0;

/// How far from the top and the bottom of the window it has to stay.
fn ends(places: &Places) -> [f32; 2] {
    let right = places.room.right();
    let left = right - WIDTH - MARGIN;
    [true, false].map(|from_top| places.reach(left, right, from_top))
}

/// How high it can be, points.
#[must_use]
pub fn height(places: &Places) -> f32 {
    places.room.height() - ends(places).iter().sum::<f32>()
}

/// Shows the card at the right border, between the cards above and below; what the user changes on it goes to `changed`.
pub fn show(
    context: &Context,
    status: &EditStatus,
    places: &Places,
    changed: &mut Vec<(Property, f64)>,
) -> Rect {
    let [top, _] = ends(places);
    let height = height(places).max(3.0 * MARGIN);
    let area = Area::new(Id::new("edit")).anchor(Align2::RIGHT_TOP, vec2(-MARGIN, top)).fade_in(false);
    let shown = area.show(context, |ui| {
        style::frame().show(ui, |ui| {
            let frame = style::frame().total_margin().sum();
            ui.set_width((WIDTH - frame.x).min(places.room.width()));
            // Not as high as it was last: that may have been of something with fewer numbers.
            ui.set_max_height(height - frame.y);
            ui.label(RichText::new(legible(context, &status.name)).color(ACCENT));
            let [here, all] = status.place;
            ui.horizontal_wrapped(|ui| {
                if let Some(kind) = &status.kind {
                    ui.label(RichText::new(legible(context, kind)).small());
                }
                if here > 0 {
                    ui.label(RichText::new(format!("{here} of {all}")).color(FAINT).small());
                }
                if status.hidden {
                    ui.label(RichText::new("hidden").color(CAUTION).small());
                }
            });
            let source = ScrollSource { drag: false, ..ScrollSource::ALL };
            let numbers = ScrollArea::vertical()
                .min_scrolled_height(MARGIN)
                .max_height((height - HEAD - FOOT).max(MARGIN))
                .scroll_source(source);
            numbers.show(ui, |ui| show_numbers(ui, status, changed));
            if let Some(limits) = beyond(ui, status) {
                ui.label(RichText::new(limits).color(CAUTION).small());
            } else if !status.redone.is_empty() {
                ui.label(RichText::new(&status.redone).color(FAINT).small());
            }
        });
    });
    shown.response.rect
}

fn show_numbers(ui: &mut Ui, status: &EditStatus, changed: &mut Vec<(Property, f64)>) {
    let id = Id::new("edited row");
    let before = ui.data(|data| data.get_temp::<(usize, [usize; 2])>(id));
    let now = (status.row, status.place);
    ui.data_mut(|data| data.insert_temp(id, now));
    Grid::new("properties").num_columns(2).min_col_width(NAMES).spacing([12.0, 3.0]).show(ui, |ui| {
        for (i, row) in status.rows.iter().enumerate() {
            let color = if i == status.row { ACCENT } else { FAINT };
            let label = ui.label(RichText::new(row.label).color(color));
            if i == status.row && before != Some(now) {
                label.scroll_to_me(None);
            }
            // No number is "-0".
            let mut value = row.value + 0.0;
            let [low, high] = row.range;
            let speed = speed(row);
            let typed = Cell::new(None);
            let parse = |text: &str| {
                let value = number(text);
                typed.set(value);
                value
            };
            let drag = DragValue::new(&mut value).speed(speed).range(low..=high);
            // Not while it is typed: 0.5 begins with 0, and 5000 is in the way of nobody who wants 50.
            let drag = drag.max_decimals(decimals(speed)).custom_parser(parse).update_while_editing(false);
            let is_changed = ui.add_sized([FIELD, ui.spacing().interact_size.y], drag).changed();
            if is_changed {
                changed.push((row.property, value));
            }
            ui.end_row();
            if let Some(typed) = typed.get() {
                let is_beyond = !(low..=high).contains(&typed);
                let taken = is_beyond.then_some((status.place, row.property, typed.clamp(low, high)));
                ui.data_mut(|data| data.insert_temp(Id::new(BEYOND), taken));
            }
        }
    });
}

/// What a number may be beyond whose limits one was typed, as long as it is the nearest that it can be.
fn beyond(ui: &Ui, status: &EditStatus) -> Option<String> {
    let taken = ui.data(|data| data.get_temp::<Option<Beyond>>(Id::new(BEYOND)))?;
    let (_, property, value) = taken.filter(|(place, ..)| *place == status.place)?;
    let row = status.rows.iter().find(|row| row.property == property)?;
    let is_there = (row.value - value).abs() <= 1e-3 * value.abs().max(1e-3);
    is_there.then(|| format!("{}: {} to {}", row.label, short(row.range[0]), short(row.range[1])))
}

/// As people type them: with a decimal comma, any minus, blanks.
fn number(text: &str) -> Option<f64> {
    let plain: String = text.chars().filter(|c| !c.is_whitespace()).collect();
    plain.replace('−', "-").replace(',', ".").parse().ok().filter(|number: &f64| !number.is_nan())
}

/// A limit in few letters.
fn short(limit: f64) -> String {
    if limit == 0.0 || (1e-3..1e5).contains(&limit.abs()) { format!("{limit}") } else { format!("{limit:e}") }
}

/// What a point of the mouse adds.
fn speed(row: &Row) -> f64 {
    let step = match row.grows {
        true if row.value == 0.0 => row.step * 0.1,
        true => row.step * row.value.abs(),
        false => row.step,
    };
    0.1 * step
}

/// Digits behind the point that tell such a change, at least four.
fn decimals(speed: f64) -> usize {
    (1.0 - speed.log10()).ceil().clamp(4.0, 15.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_of_the_mouse_changes_what_is_shown_in_scenes_of_any_size() {
        for radius in [1e-9, 1e-3, 1.0, 1e6] {
            for (grows, value, step) in
                [(false, 0.3 * radius, radius / 50.0), (true, radius, 0.1), (true, 0.0, 0.1)]
            {
                let row =
                    Row { property: Property::Scale, label: "", value, step, grows, range: [0.0, 1e12] };
                let shown = |value: f64| format!("{value:.*}", decimals(speed(&row)));
                assert_ne!(shown(value), shown(value + speed(&row)), "{row:?}");
            }
        }
        assert_eq!(decimals(0.002), 4, "no longer than it has to be");
    }

    #[test]
    fn numbers_are_read_as_people_type_them() {
        for (text, value) in
            [(" 1 000.5", Some(1000.5)), ("−2,5", Some(-2.5)), ("1e3", Some(1e3)), ("nan", None), ("a", None)]
        {
            assert_eq!(number(text), value, "{text}");
        }
        assert_eq!([0.0, 1.0, -90.0, 1e-9, 1e12].map(short), ["0", "1", "-90", "1e-9", "1e12"]);
    }
}
