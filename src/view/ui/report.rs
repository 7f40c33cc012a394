//! What loading has found: the card that `check` prints, in two columns.

use super::card;
use super::glyphs::legible;
use super::style::{ACCENT, BRIGHT, CAUTION, FAINT};
use egui::{Align2, Context, FontId, Grid, RichText, Vec2, vec2};

/// More lines than this are told by their number.
const MOST_LINES: usize = 24;
/// Letters of a head, and of the space after it.
const HEAD: f32 = 15.0;
/// Width of a letter over its size.
const LETTER: f32 = 0.6;

/// Shows the card in the middle.
pub fn show(context: &Context, text: &str) {
    let room = context.content_rect().size() * vec2(0.86, 0.9);
    let text = legible(context, text);
    let (title, rows) = rows(&text);
    let shown = rows.len().min(MOST_LINES);
    let size = fitting(&rows[..shown], room);
    let font = FontId::monospace(size);
    card(context, "report", (Align2::CENTER_CENTER, vec2(0.0, 0.0)), |ui| {
        ui.set_max_width(room.x);
        ui.label(RichText::new(title).font(font.clone()).color(ACCENT));
        Grid::new("report rows").num_columns(2).spacing([size, 0.3 * size]).min_row_height(0.0).show(
            ui,
            |ui| {
                for (head, said) in &rows[..shown] {
                    let color = match *head {
                        "repaired" | "ignored" | "error" => CAUTION,
                        "approximated" | "decided" => BRIGHT,
                        _ => FAINT,
                    };
                    ui.label(RichText::new(*head).font(font.clone()).color(color));
                    // What is longer than the card goes on below itself, not below the head.
                    ui.vertical(|ui| {
                        ui.set_max_width(room.x - HEAD * LETTER * size);
                        ui.label(RichText::new(said).font(font.clone()).color(color));
                    });
                    ui.end_row();
                }
            },
        );
        if rows.len() > shown {
            let more = format!("and {} more: penumbra check FILE", rows.len() - shown);
            ui.label(RichText::new(more).font(font.clone()).color(FAINT));
        }
    });
}

/// The first line, and of the others what each is and what it says. Phases of loading that took no time are left out.
fn rows(text: &str) -> (&str, Vec<(&str, String)>) {
    let mut lines = text.lines();
    let title = lines.next().unwrap_or_default();
    let row = |line| {
        let line: &str = line;
        let (head, said) = line.trim_start().split_once(' ').unwrap_or((line.trim_start(), ""));
        let said = said.trim_start();
        if head != "time" {
            return (head, said.to_owned());
        }
        let phases: Vec<&str> = said.split(", ").filter(|phase| !phase.ends_with(" 0.000 s")).collect();
        (head, if phases.is_empty() { "less than a millisecond".to_owned() } else { phases.join(", ") })
    };
    (title, lines.map(row).collect())
}

/// The size of letters with which all lines are likely to fit.
fn fitting(rows: &[(&str, String)], room: Vec2) -> f32 {
    let sizes = (12..=26).rev().map(|half| 0.5 * half as f32);
    let fits = |size: &f32| {
        let across = (room.x / (size * LETTER) - HEAD).max(1.0);
        let lines = |said: &String| (said.chars().count() as f32 / across).ceil().max(1.0);
        let lines: f32 = rows.iter().map(|(_, said)| lines(said)).sum();
        (lines + 3.0) * size * 1.6 < room.y
    };
    sizes.into_iter().find(fits).unwrap_or(6.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_what_it_is_about_and_what_it_says() {
        let text = "a.glb: valid\n  format        glTF 2.0\n  time          reading 0.000 s, building 0.120 s\n  \
                    decided       a sky, as there is no light";
        let (title, rows) = rows(text);
        let rows: Vec<(&str, &str)> = rows.iter().map(|(head, said)| (*head, said.as_str())).collect();
        assert_eq!(title, "a.glb: valid");
        let wanted = [
            ("format", "glTF 2.0"),
            ("time", "building 0.120 s"),
            ("decided", "a sky, as there is no light"),
        ];
        assert_eq!(rows, wanted);
        assert_eq!(super::rows("a\n  time   reading 0.000 s").1[0].1, "less than a millisecond");
    }

    #[test]
    fn letters_are_as_small_as_the_lines_are_many() {
        let rows = |count| vec![("decided", "word ".repeat(30)); count];
        let size = |count| fitting(&rows(count), vec2(800.0, 500.0));
        assert!(size(3) == 13.0 && size(24) < size(12) && size(24) >= 6.0);
    }
}
