//! The card of the selected thing: its numbers, to be dragged or typed.

use super::super::edit::EditStatus;
use super::super::edit::property::Property;
use super::style::{self, ACCENT, CAUTION, FAINT, MARGIN};
use egui::{Align2, Area, Context, DragValue, Grid, Id, RichText, vec2};

/// Shows the card at the right border; what the user changes on it goes to `changed`.
pub fn show(context: &Context, status: &EditStatus, changed: &mut Vec<(Property, f64)>) {
    Area::new(Id::new("edit")).anchor(Align2::RIGHT_CENTER, vec2(-MARGIN, 0.0)).fade_in(false).show(
        context,
        |ui| {
            style::frame().show(ui, |ui| {
                ui.label(RichText::new(&status.name).color(ACCENT));
                if let Some(material) = &status.material {
                    ui.label(material);
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
                        let speed =
                            if row.grows { row.step * row.value.abs().max(1e-3) } else { row.step } * 0.1;
                        let drag = DragValue::new(&mut value).speed(speed).range(low..=high).max_decimals(4);
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
