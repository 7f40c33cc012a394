//! The status: a strip of values, and below it all the others.

use super::super::status::{Cell, Level, Measured, Status, caution, details, headline, machine};
use super::card;
use super::style::{BRIGHT, CAUTION, FAINT, MARGIN};
use egui::{Align2, Context, Grid, Rect, RichText, Ui, vec2};

/// Below this width, points, values stand closer together and without what is beside them.
const NARROW: f32 = 400.0;

/// What has to be told although nothing is to be shown.
pub fn show_altered(context: &Context, text: &str) -> Rect {
    card(context, "altered", (Align2::LEFT_TOP, vec2(MARGIN, MARGIN)), |ui| {
        ui.label(RichText::new(text).color(CAUTION).small());
    })
}

/// Shows the strip, as much of the rest as `level` wants, and a `hint` for who is new here.
pub fn show(
    context: &Context,
    status: &Status,
    measured: Measured,
    level: Level,
    hint: Option<&str>,
) -> Rect {
    card(context, "status", (Align2::LEFT_TOP, vec2(MARGIN, MARGIN)), |ui| {
        ui.horizontal(|ui| {
            // Of a small window it takes all of the width.
            ui.spacing_mut().item_spacing.x = if ui.available_width() > NARROW { 18.0 } else { 8.0 };
            let is_narrow = ui.available_width() <= NARROW;
            for mut cell in headline(status) {
                if is_narrow {
                    cell.note.clear();
                }
                show_cell(ui, &cell);
            }
        });
        if let Some(text) = caution(status) {
            ui.label(RichText::new(text).color(CAUTION).small());
        }
        if let Some(hint) = hint {
            ui.label(RichText::new(hint).color(FAINT).small());
        }
        let mut cells = Vec::new();
        if matches!(level, Level::Long | Level::All) {
            cells = details(status, measured);
        }
        if level == Level::All {
            cells.extend(machine(status));
        }
        if !cells.is_empty() {
            ui.add_space(2.0);
            Grid::new("details").num_columns(2).spacing([14.0, 3.0]).show(ui, |ui| {
                for cell in cells {
                    ui.label(RichText::new(cell.label).color(FAINT));
                    ui.label(cell.value);
                    ui.end_row();
                }
            });
        }
    })
}

fn show_cell(ui: &mut Ui, cell: &Cell) {
    ui.vertical(|ui| {
        ui.spacing_mut().item_spacing.y = 0.0;
        // A short value shall not break the name above it.
        ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Extend);
        ui.label(RichText::new(cell.label).color(FAINT).small());
        ui.horizontal(|ui| {
            ui.spacing_mut().item_spacing.x = 5.0;
            ui.label(RichText::new(&cell.value).color(BRIGHT).heading());
            if !cell.note.is_empty() {
                ui.label(RichText::new(&cell.note).color(FAINT));
            }
        });
    });
}
