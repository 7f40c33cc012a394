//! What loading has found: the card that `check` prints.

use super::card;
use super::style::{ACCENT, BRIGHT, CAUTION, FAINT};
use egui::{Align2, Context, FontId, RichText, vec2};

/// More lines than this are told by their number.
const MOST_LINES: usize = 24;

/// Shows the card in the middle.
pub fn show(context: &Context, text: &str) {
    let room = context.content_rect().size();
    let lines: Vec<&str> = text.lines().collect();
    let shown = lines.len().min(MOST_LINES);
    let size = (room.y * 0.9 / (shown as f32 * 1.7 + 2.0)).clamp(6.0, 13.0);
    card(context, "report", (Align2::CENTER_CENTER, vec2(0.0, 0.0)), |ui| {
        ui.set_max_width(room.x * 0.86);
        for (i, line) in lines[..shown].iter().enumerate() {
            let color = match line.trim_start().split(' ').next() {
                _ if i == 0 => ACCENT,
                Some("repaired" | "ignored" | "error") => CAUTION,
                Some("approximated" | "decided") => BRIGHT,
                _ => FAINT,
            };
            ui.label(RichText::new(*line).font(FontId::monospace(size)).color(color));
        }
        if lines.len() > shown {
            let more = format!("and {} lines more: penumbra check FILE", lines.len() - shown);
            ui.label(RichText::new(more).font(FontId::monospace(size)).color(FAINT));
        }
    });
}
