//! All keys, from the table that dispatches them: laid out in columns and, where the window is small, in pages.

use super::super::chord::Letters;
use super::super::keymap::{Keymap, Row, TABLE};
use super::card;
use super::style::{self, ACCENT, BRIGHT, FAINT, MARGIN};
use egui::text::{LayoutJob, TextFormat};
use egui::{Align2, Context, FontId, Galley, Rect, Sense, Ui, Vec2, pos2, vec2};
use std::sync::Arc;

mod pack;

use pack::{Part, packed};

/// Points of the largest letters, and of the smallest that can still be read.
const LARGEST: f32 = 13.0;
const LEGIBLE: f32 = 9.5;
/// Widths of what keys do, over the size of letters, before it goes on in another line: the fewer pages the better, then the
/// larger letters, then the wider.
const WRAPS: [f32; 4] = [f32::INFINITY, 30.0, 24.0, 19.0];
/// Between keys and what they do, between rows, after a section, between columns: over the size of letters.
const KEYS_GAP: f32 = 1.0;
const ROW_GAP: f32 = 0.2;
const SECTION_GAP: f32 = 0.9;
const COLUMN_GAP: f32 = 2.2;

/// Letters on a keyboard.
const ALPHABET: usize = 26;

/// What of the help is open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Help {
    page: Option<usize>,
    /// Pages when it was last drawn.
    pages: usize,
    /// How it was laid out, for which window and letters: to find that out takes many tries.
    plan: Option<(Vec2, usize, Plan)>,
}

/// Size of letters, width of lines, and height of columns.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plan {
    size: f32,
    wrap: f32,
    height: f32,
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

    /// Shows what is open, in as few pages as it fits in, with letters as large as fit.
    pub fn show(&mut self, context: &Context, keys: &Keymap, letters: &Letters) {
        let Some(page) = self.page else { return };
        let room =
            context.content_rect().size() - style::frame().total_margin().sum() - Vec2::splat(2.0 * MARGIN);
        let room = room.max(Vec2::splat(1.0));
        let told = Told { context, keys, letters };
        let known = self.plan.filter(|(of, known, _)| (*of, *known) == (room, letters.count()));
        let plan = known.map_or_else(|| told.plan(room), |(_, _, plan)| plan);
        self.plan = Some((room, letters.count(), plan));
        let pages = told.pages(plan, room.x);
        self.pages = pages.len().max(1);
        let page = page.min(self.pages - 1);
        self.page = Some(page);
        let foot = told.foot(plan.size, room.x, page, self.pages);
        card(context, "help", (Align2::CENTER_CENTER, Vec2::ZERO), |ui| {
            if let Some(columns) = pages.get(page) {
                show_columns(ui, columns, plan.size);
            }
            ui.label(foot);
        });
    }
}

/// A part of a section, laid out.
struct Block {
    title: Arc<Galley>,
    /// Keys and what they do.
    rows: Vec<[Arc<Galley>; 2]>,
}

impl Block {
    /// Widths of keys and of what they do.
    fn widths(&self) -> [f32; 2] {
        [0, 1].map(|i| self.rows.iter().map(|row| row[i].size().x).fold(0.0, f32::max))
    }

    fn heights(&self, size: f32) -> Vec<f32> {
        let height = |[a, b]: &[Arc<Galley>; 2]| a.size().y.max(b.size().y) + ROW_GAP * size;
        self.rows.iter().map(height).collect()
    }
}

/// Blocks below each other, and how wide their keys and texts are.
struct Column {
    blocks: Vec<Block>,
    widths: [f32; 2],
}

impl Column {
    fn width(&self, size: f32) -> f32 {
        let titles = self.blocks.iter().map(|block| block.title.size().x).fold(0.0, f32::max);
        (self.widths[0] + KEYS_GAP * size + self.widths[1]).max(titles)
    }
}

/// What there is to tell, and what lays it out.
struct Told<'a> {
    context: &'a Context,
    keys: &'a Keymap,
    letters: &'a Letters,
}

impl Told<'_> {
    fn text(&self, words: &[(&str, egui::Color32)], size: f32, wrap: f32) -> Arc<Galley> {
        let mut job = LayoutJob::default();
        job.wrap.max_width = wrap;
        for (word, color) in words {
            job.append(word, 0.0, TextFormat::simple(FontId::proportional(size), *color));
        }
        self.context.fonts_mut(|fonts| fonts.layout_job(job))
    }

    fn row(&self, row: &Row, plan: Plan) -> [Arc<Galley>; 2] {
        let keys = self.keys.keys_of(row, self.letters);
        let mut others = self.keys.other_keys_of(row, self.letters);
        if !others.is_empty() {
            others.insert_str(0, "  or ");
        }
        let words = [(row.text, FAINT), (others.as_str(), FAINT.gamma_multiply(0.65))];
        [
            self.text(&[(&keys, BRIGHT)], plan.size, f32::INFINITY),
            self.text(&words, plan.size, plan.wrap * plan.size),
        ]
    }

    /// All sections.
    fn blocks(&self, plan: Plan) -> Vec<Block> {
        let block = |(title, rows): &(&str, &[Row])| Block {
            title: self.text(&[(title, ACCENT)], plan.size * 1.1, f32::INFINITY),
            rows: rows.iter().map(|row| self.row(row, plan)).collect(),
        };
        TABLE.iter().map(block).collect()
    }

    fn parts(&self, blocks: &[Block], plan: Plan) -> Vec<Vec<Part>> {
        let sections: Vec<Vec<f32>> = blocks.iter().map(|block| block.heights(plan.size)).collect();
        let heading = blocks.first().map_or(0.0, |block| block.title.size().y) + SECTION_GAP * plan.size;
        packed(&sections, heading, plan.height)
    }

    /// The columns of each page of this width.
    fn pages(&self, plan: Plan, width: f32) -> Vec<Vec<Column>> {
        let blocks = self.blocks(plan);
        let column = |parts: Vec<Part>| {
            let block = |(section, rows): Part| Block {
                title: Arc::clone(&blocks[section].title),
                rows: blocks[section].rows[rows].to_vec(),
            };
            let blocks: Vec<Block> = parts.into_iter().map(block).collect();
            let widths =
                blocks.iter().map(Block::widths).fold([0.0_f32; 2], |[a, b], [c, d]| [a.max(c), b.max(d)]);
            Column { blocks, widths }
        };
        let mut pages: Vec<Vec<Column>> = Vec::new();
        let mut used = 0.0;
        for column in self.parts(&blocks, plan).into_iter().map(column) {
            let own = column.width(plan.size) + COLUMN_GAP * plan.size;
            match pages.last_mut().filter(|_| used + own <= width + COLUMN_GAP * plan.size) {
                Some(page) => page.push(column),
                None => {
                    pages.push(vec![column]);
                    used = 0.0;
                }
            }
            used += own;
        }
        pages
    }

    /// The best way to fill pages of this size.
    fn plan(&self, room: Vec2) -> Plan {
        let smallest = LEGIBLE.min(room.x / 30.0).max(1.0);
        let sizes = (0..).map(|i| LARGEST - 0.5 * i as f32).take_while(|&size| size > smallest);
        let mut best: Option<(usize, Plan)> = None;
        for size in sizes.chain([smallest]) {
            let foot = self.foot(size, room.x, 0, 2).size().y + MARGIN;
            let height = (room.y - foot).max(size);
            // One column at least is as wide as the window.
            let keys = self
                .blocks(Plan { size, wrap: 1e3, height })
                .iter()
                .map(|b| b.widths()[0])
                .fold(0.0, f32::max);
            let widest = ((room.x - keys) / size - KEYS_GAP).max(6.0);
            for wrap in WRAPS {
                let plan = Plan { size, wrap: wrap.min(widest), height };
                let count = self.pages(plan, room.x).len();
                if best.is_none_or(|(fewest, _)| count < fewest) {
                    best = Some((count, plan));
                }
            }
            if best.is_some_and(|(count, _)| count <= 1) {
                break;
            }
        }
        let (count, plan) = best.unwrap_or((1, Plan { size: smallest, wrap: WRAPS[0], height: room.y }));
        self.evened(plan, room.x, count)
    }

    /// With columns as long as each other, without more pages or broken sections.
    fn evened(&self, plan: Plan, width: f32, count: usize) -> Plan {
        let parts = |plan| self.parts(&self.blocks(plan), plan).iter().map(Vec::len).sum::<usize>();
        let most = parts(plan);
        let shorter = (8..20).map(|i| Plan { height: plan.height * 0.05 * i as f32, ..plan });
        let mut fitting =
            shorter.filter(|&plan| self.pages(plan, width).len() == count && parts(plan) <= most);
        fitting.next().unwrap_or(plan)
    }

    /// What stands below.
    fn foot(&self, size: f32, width: f32, page: usize, pages: usize) -> Arc<Galley> {
        let mut said = "* starts the picture again".to_owned();
        if self.letters.count() < ALPHABET {
            // What is printed on a key is known when it has been pressed.
            said += "     letters: by their place on a US keyboard, until pressed";
        }
        let turned = format!("     page {} of {pages}; the same key turns it", page + 1);
        let words = [(said.as_str(), FAINT), (if pages > 1 { &turned } else { "" }, ACCENT)];
        self.text(&words, size, width)
    }
}

fn show_columns(ui: &mut Ui, columns: &[Column], size: f32) {
    let height = |column: &Column| -> f32 {
        let of = |block: &Block| {
            block.title.size().y + SECTION_GAP * size + block.heights(size).iter().sum::<f32>()
        };
        column.blocks.iter().map(of).sum()
    };
    let width = columns.iter().map(|column| column.width(size)).sum::<f32>()
        + COLUMN_GAP * size * columns.len().saturating_sub(1) as f32;
    let highest = columns.iter().map(height).fold(0.0, f32::max);
    let (response, painter) = ui.allocate_painter(vec2(width, highest), Sense::hover());
    let Rect { min, .. } = response.rect;
    let mut x = min.x;
    for column in columns {
        let mut y = min.y;
        for block in &column.blocks {
            painter.galley(pos2(x, y), Arc::clone(&block.title), ACCENT);
            y += block.title.size().y;
            for ([keys, text], height) in block.rows.iter().zip(block.heights(size)) {
                painter.galley(pos2(x, y), Arc::clone(keys), BRIGHT);
                painter.galley(pos2(x + column.widths[0] + KEYS_GAP * size, y), Arc::clone(text), FAINT);
                y += height;
            }
            y += SECTION_GAP * size;
        }
        x += column.width(size) + COLUMN_GAP * size;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
