//! All keys, from the table that dispatches them.

use super::super::chord::Letters;
use super::super::keymap::{Keymap, Section, TABLE};
use super::card;
use super::style::{ACCENT, BRIGHT, FAINT};
use egui::{Align2, Context, FontId, Grid, RichText, Ui, Vec2, vec2};

/// Lines that a section takes beside its rows.
const HEADING_LINES: usize = 2;
/// Points of letters that can still be read.
const LEGIBLE: f32 = 9.5;
/// Height of a line and width of the widest column, over the size of letters.
const LINE: f32 = 1.62;
const COLUMN: f32 = 42.0;

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
        // Of equally good ways the last is taken: with the fewest columns.
        let ways = (1..=3).rev().map(split).map(|columns| (fitting(&columns, room), columns));
        let Some((mut size, columns)) = ways.max_by(|(a, _), (b, _)| a.total_cmp(b)) else { return };
        let mut pages = vec![columns];
        if size < LEGIBLE {
            size = LEGIBLE.min(room.x / COLUMN);
            let lines = (room.y / (size * LINE)) as usize;
            let columns = ((room.x / (COLUMN * size)) as usize).max(1);
            // Two lines below, and the borders.
            pages = parted(lines.saturating_sub(4)).chunks(columns).map(<[_]>::to_vec).collect();
        }
        self.pages = pages.len();
        let page = page.min(self.pages - 1);
        self.page = Some(page);
        card(context, "help", (Align2::CENTER_CENTER, vec2(0.0, 0.0)), |ui| {
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
            ui.label(text("* starts the picture again", size).color(FAINT));
            if self.pages > 1 {
                let foot = format!("page {} of {}; the same key turns it", page + 1, self.pages);
                ui.label(text(&foot, size).color(ACCENT));
            }
        });
    }
}

/// The largest letters with which these columns fit.
fn fitting(columns: &[Vec<Section>], room: Vec2) -> f32 {
    let lines = columns.iter().map(|column| lines_of(column)).max().unwrap_or(1);
    let widest = COLUMN * columns.len() as f32;
    (room.y / (lines as f32 * LINE)).min(room.x / widest).min(13.0)
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
