//! All keys, from the table that dispatches them.

use super::super::chord::Letters;
use super::super::keymap::{Keymap, Section, TABLE};
use super::card;
use super::style::{ACCENT, BRIGHT, FAINT};
use egui::{Align2, Context, FontId, Grid, RichText, Ui, vec2};

/// Lines that a section takes beside its rows.
const HEADING_LINES: usize = 2;

/// Shows the help in as many columns as fit, with letters as large as fit.
pub fn show(context: &Context, keys: &Keymap, letters: &Letters) {
    let room = context.content_rect().size() * 0.94;
    let columns = if room.x > 560.0 { split(2) } else { split(1) };
    let lines = columns.iter().map(|column| lines_of(column)).max().unwrap_or(1);
    let widest = 46.0 * columns.len() as f32;
    // A line is a letter and a half high, a letter half as wide.
    let size = (room.y / (lines as f32 * 1.62)).min(room.x / widest * 1.9).clamp(6.0, 13.0);
    card(context, "help", Align2::CENTER_CENTER, vec2(0.0, 0.0), |ui| {
        ui.horizontal_top(|ui| {
            ui.spacing_mut().item_spacing.x = size * 2.0;
            for column in &columns {
                ui.vertical(|ui| {
                    for section in column {
                        show_section(ui, section, keys, letters, size);
                    }
                });
            }
        });
        ui.label(text("* starts the picture again", size).color(FAINT));
    });
}

fn lines_of(sections: &[Section]) -> usize {
    sections.iter().map(|(_, rows)| rows.len() + HEADING_LINES).sum()
}

/// The sections in order over `count` columns, about as long as each other.
fn split(count: usize) -> Vec<Vec<Section>> {
    let goal = lines_of(TABLE).div_ceil(count);
    let mut columns = vec![Vec::new()];
    for section in TABLE {
        let last = columns.len() - 1;
        let half = (section.1.len() + HEADING_LINES) / 2;
        if last + 1 < count && lines_of(&columns[last]) + half > goal {
            columns.push(vec![*section]);
        } else {
            columns[last].push(*section);
        }
    }
    columns
}

fn text(text: &str, size: f32) -> RichText {
    RichText::new(text).font(FontId::proportional(size))
}

fn show_section(ui: &mut Ui, (title, rows): &Section, keys: &Keymap, letters: &Letters, size: f32) {
    ui.label(text(title, size * 1.1).color(ACCENT));
    Grid::new(title).num_columns(2).spacing([size, size * 0.2]).min_row_height(0.0).show(ui, |ui| {
        for row in *rows {
            ui.label(text(&keys.keys_of(row, letters), size).color(BRIGHT));
            ui.label(text(row.text, size).color(FAINT));
            ui.end_row();
        }
    });
    ui.add_space(size * 0.5);
}
