//! The card of the selected thing: its numbers, to be dragged or typed.

use super::super::edit::EditStatus;
use super::super::edit::property::{Property, Row};
use super::style::{self, ACCENT, CAUTION, FAINT, MARGIN};
use egui::{Align2, Area, Context, DragValue, Grid, Id, RichText, vec2};

/// Shows the card at the right border; what the user changes on it goes to `changed`.
pub fn show(context: &Context, status: &EditStatus, changed: &mut Vec<(Property, f64)>) {
    Area::new(Id::new("edit")).anchor(Align2::RIGHT_CENTER, vec2(-MARGIN, 0.0)).fade_in(false).show(
        context,
        |ui| {
            style::frame().show(ui, |ui| {
                ui.label(RichText::new(&status.name).color(ACCENT));
                if let Some(kind) = &status.kind {
                    ui.label(kind);
                }
                let [here, all] = status.place;
                ui.label(RichText::new(format!("{here} of {all}")).color(FAINT).small());
                if status.hidden {
                    ui.label(RichText::new("hidden").color(CAUTION).small());
                }
                Grid::new("properties").num_columns(2).spacing([12.0, 3.0]).show(ui, |ui| {
                    for (i, row) in status.rows.iter().enumerate() {
                        let color = if i == status.row { ACCENT } else { FAINT };
                        ui.label(RichText::new(row.label).color(color));
                        let mut value = row.value;
                        let [low, high] = row.range;
                        let speed = speed(row);
                        let drag = DragValue::new(&mut value).speed(speed).range(low..=high);
                        let drag = drag.max_decimals(decimals(speed));
                        if ui.add(drag).changed() {
                            changed.push((row.property, value));
                        }
                        ui.end_row();
                    }
                });
                if !status.redone.is_empty() {
                    ui.label(RichText::new(&status.redone).color(FAINT).small());
                }
            });
        },
    );
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
}
