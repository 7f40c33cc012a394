//! All keys, from the table that dispatches them.

use super::super::chord::Letters;
use super::super::keymap::{Keymap, Section, TABLE};
use super::card;
use super::style::{ACCENT, BRIGHT, FAINT};
use egui::{Align2, Context, FontId, Grid, RichText, Ui, Vec2, vec2};

/// Lines that a section takes beside its rows.
const HEADING_LINES: usize = 2;
/// Points of letters that can still be read.
const LEGIBLE: f32 = 9.0;
/// Lines and letters of that size: a line is a letter and a half high, a letter half as wide.
const LINE: f32 = 1.62;
const LETTER: f32 = 1.0 / 1.9;
/// Letters of the widest column.
const COLUMN: f32 = 46.0;

/// What of the help is open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Help {
    page: Option<usize>,
    /// Pages when it was last drawn.
    pages: usize,
}

impl Help {
    /// Whether it is.
    #[must_use]
    pub fn is_open(self) -> bool {
        self.page.is_some()
    }

    /// Opens the first page, then each next one; closes the last.
    pub fn turn(&mut self) {
        self.page = self.page.map_or(Some(0), |page| Some(page + 1).filter(|&next| next < self.pages));
    }

    /// Closes it.
    pub fn close(&mut self) {
        self.page = None;
    }

    /// Shows what is open, in as many columns as fit, with letters as large as fit.
    pub fn show(&mut self, context: &Context, keys: &Keymap, letters: &Letters) {
        let Some(page) = self.page else { return };
        let room = context.content_rect().size() * 0.94;
        let columns = if room.x > 560.0 { 2 } else { 1 };
        let mut pages = vec![split(columns)];
        let mut size = fitting(&pages[0], room);
        if size < LEGIBLE {
            size = LEGIBLE.min(room.x / COLUMN / LETTER).max(6.0);
            let lines = (room.y / (size * LINE)) as usize;
            // One line tells which page it is.
            pages = parted(lines.saturating_sub(3)).chunks(columns).map(<[_]>::to_vec).collect();
        }
        self.pages = pages.len();
        let page = page.min(self.pages - 1);
        self.page = Some(page);
        card(context, "help", Align2::CENTER_CENTER, vec2(0.0, 0.0), |ui| {
            ui.horizontal_top(|ui| {
                ui.spacing_mut().item_spacing.x = size * 2.0;
                for column in &pages[page] {
                    ui.vertical(|ui| {
                        for section in column {
                            show_section(ui, section, keys, letters, size);
                        }
                    });
                }
            });
            let star = "* starts the picture again";
            let foot = match self.pages {
                1 => star.to_owned(),
                pages => format!("{star}   {} of {pages}: the same key turns the page", page + 1),
            };
            ui.label(text(&foot, size).color(FAINT));
        });
    }
}

/// The largest letters with which these columns fit.
fn fitting(columns: &[Vec<Section>], room: Vec2) -> f32 {
    let lines = columns.iter().map(|column| lines_of(column)).max().unwrap_or(1);
    let widest = COLUMN * columns.len() as f32;
    (room.y / (lines as f32 * LINE)).min(room.x / widest / LETTER).clamp(6.0, 13.0)
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

/// The sections in order in columns of at most `lines`, or of one row where that is more; what does not fit below
/// others goes on in the next, with its heading.
fn parted(lines: usize) -> Vec<Vec<Section>> {
    let mut columns: Vec<Vec<Section>> = vec![Vec::new()];
    for &(title, rows) in TABLE {
        let mut rows = rows;
        while !rows.is_empty() {
            let column = columns.len() - 1;
            let room = lines.saturating_sub(lines_of(&columns[column]) + HEADING_LINES);
            if room == 0 && !columns[column].is_empty() {
                columns.push(Vec::new());
                continue;
            }
            let (here, rest) = rows.split_at(room.max(1).min(rows.len()));
            columns[column].push((title, here));
            rows = rest;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_have_all_rows_once_and_no_more_lines_than_fit() {
        for lines in [0, 1, 3, 7, 20, 1000] {
            let columns = parted(lines);
            let rows = columns
                .iter()
                .flatten()
                .flat_map(|(title, rows)| rows.iter().map(move |row| (title, row.text)));
            let all = TABLE.iter().flat_map(|(title, rows)| rows.iter().map(move |row| (title, row.text)));
            assert!(rows.eq(all), "{lines}");
            assert!(columns.iter().all(|column| lines_of(column) <= lines.max(HEADING_LINES + 1)), "{lines}");
        }
    }

    #[test]
    fn a_key_turns_all_pages_and_then_closes() {
        let mut help = Help::default();
        help.turn();
        help.pages = 3;
        let seen: Vec<Option<usize>> = (0..4)
            .map(|_| {
                let page = help.page;
                help.turn();
                page
            })
            .collect();
        assert_eq!(seen, [Some(0), Some(1), Some(2), None]);
    }
}
