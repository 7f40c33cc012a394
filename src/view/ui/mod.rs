//! Everything that is drawn over the picture: cards of text, the graph, the help.

pub mod debug;
pub mod edit;
mod events;
mod glyphs;
pub mod graph;
pub mod help;
pub mod legend;
pub mod open;
pub mod paint;
mod place;
pub mod report;
pub mod strip;
pub mod style;

use super::chord::Letters;
use super::debug::DebugStatus;
use super::edit::property::Property;
use super::keymap::Keymap;
use super::status::{Level, Measured, Status, altered};
use egui::{Align2, Area, Context, Event, Id, Pos2, RawInput, Rect, RichText, ViewportId, vec2};
use glam::UVec2;
use glyphs::{Glyphs, legible};
use paint::Painter;
use place::{Place, Places};
use std::time::Instant;
use style::{ACCENT, MARGIN};

/// What there is to show.
pub struct Content<'a> {
    /// Of the engine; `None` until the scene is open.
    pub status: Option<&'a Status>,
    /// Of the window.
    pub measured: Measured,
    /// What is loading, while it is.
    pub loading: Option<&'a str>,
    /// Somebody may not know where to find the keys.
    pub hint: bool,
    /// A line that passes.
    pub notice: &'a str,
    /// Which other picture is shown, and up to which part of the width.
    pub compared: Option<(&'static str, f64)>,
    /// For the help.
    pub keys: &'a Keymap,
    /// For the help.
    pub letters: &'a Letters,
}

/// What the user has opened, and what draws it.
pub struct Ui {
    /// How much the status tells.
    pub level: Level,
    /// The help, if it is open.
    pub help: help::Help,
    /// Whether the report of loading is open.
    pub report: bool,
    /// The line that asks for a file, if it is open.
    pub prompt: Option<open::Prompt>,
    /// Whether the graph is open.
    pub graph: bool,
    context: Context,
    painter: Painter,
    glyphs: Glyphs,
    events: Vec<Event>,
    /// What the user has changed on a card.
    pub edits: Vec<(Property, f64)>,
    start: Instant,
}

impl Default for Ui {
    fn default() -> Self {
        let context = Context::default();
        style::apply(&context);
        let painter = Painter::default();
        Self {
            level: Level::default(),
            help: help::Help::default(),
            report: false,
            prompt: None,
            graph: false,
            context,
            painter,
            glyphs: Glyphs::default(),
            events: Vec::new(),
            edits: Vec::new(),
            start: Instant::now(),
        }
    }
}

/// Pixels to a point: the display's own scale, and less where the window is small.
#[must_use]
pub fn scale_of(display: f64, size: UVec2) -> f32 {
    let fits = (size.x as f32 / 480.0).min(size.y as f32 / 300.0);
    let display = if display.is_finite() && display > 0.0 { display as f32 } else { 1.0 };
    // Letters of less than half the size say nothing any more.
    display * (fits / display).clamp(0.6, 1.0)
}

impl Ui {
    /// Draws over `rgba`, a picture of `size` pixels, on a display of this scale.
    pub fn draw(&mut self, rgba: &mut [u8], size: UVec2, display: f64, content: &Content) {
        let scale = scale_of(display, size);
        let mut input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(size.x as f32, size.y as f32) / scale)),
            time: Some(self.start.elapsed().as_secs_f64()),
            events: std::mem::take(&mut self.events),
            ..RawInput::default()
        };
        input.viewports.entry(ViewportId::ROOT).or_default().native_pixels_per_point = Some(scale);
        let context = self.context.clone();
        let again = RawInput { events: Vec::new(), ..input.clone() };
        let mut before = rects(&context);
        let mut output = context.run(input, |context| self.show(context, content));
        self.painter.update(&output.textures_delta);
        // A new card is measured first, and drawn the next time: which is now, for a picture at rest has no next. So is what
        // has to make room for one that has become larger.
        for _ in 0..3 {
            let now = rects(&context);
            let has_letters = self.glyphs.fetch(&context);
            if now == before && !has_letters && !context.has_requested_repaint() {
                break;
            }
            before = now;
            output = context.run(again.clone(), |context| self.show(context, content));
            self.painter.update(&output.textures_delta);
        }
        let primitives = context.tessellate(output.shapes, output.pixels_per_point);
        self.painter.paint(rgba, size, &primitives, output.pixels_per_point);
    }

    /// Whether there is nothing to draw, so that the picture needs no second look.
    #[must_use]
    pub fn is_bare(&self, content: &Content) -> bool {
        let silent = content.notice.is_empty()
            && content.status.and_then(altered).is_none()
            && content.loading.is_none()
            && content.compared.is_none()
            && content
                .status
                .is_none_or(|status| status.debug == DebugStatus::default() && status.edit.is_none());
        self.level == Level::None
            && !self.help.is_open()
            && !self.report
            && self.prompt.is_none()
            && !self.graph
            && silent
    }

    fn show(&mut self, context: &Context, content: &Content) {
        let mut places = Places::new(context);
        // What is read covers the rest, and is alone then.
        let reads = self.help.is_open() || self.report;
        if let Some(status) = content.status.filter(|_| !reads) {
            self.show_cards(context, status, content, &mut places);
        }
        if let Some(status) = content.status.filter(|_| self.report) {
            report::show(context, &status.card);
        }
        if let Some(prompt) = &self.prompt {
            open::show(context, prompt);
        }
        if let Some(text) = content.loading {
            card(context, "loading", (Align2::CENTER_CENTER, vec2(0.0, 0.0)), |ui| {
                ui.label(RichText::new(legible(context, text)).size(16.0));
            });
        }
        self.help.show(context, content.keys, content.letters);
        // What is read is not to be covered; the notice is still there when it is closed.
        if !content.notice.is_empty() && !reads {
            let at = |anchor, y| (anchor, vec2(0.0, y));
            let width = places.size_of(context, "notice").x;
            let (left, right) = (places.room.center().x - 0.5 * width, places.room.center().x + 0.5 * width);
            let above = at(Align2::CENTER_BOTTOM, -places.reach(left, right, false));
            let below = at(Align2::CENTER_TOP, places.reach(left, right, true));
            let bottom = at(Align2::CENTER_BOTTOM, -MARGIN);
            let place = places.find(context, "notice", &[bottom, above, below]);
            let area = Area::new(Id::new("notice")).interactable(false).order(egui::Order::Foreground);
            show_card(context, area, place, |ui| {
                ui.set_max_width(places.room.width() - 6.0 * MARGIN);
                ui.label(legible(context, content.notice));
            });
        }
    }

    /// Whatever is open about the picture, what matters most first.
    fn show_cards(&mut self, context: &Context, status: &Status, content: &Content, places: &mut Places) {
        let is_asked = status.edit.is_some() || status.debug.is_open() || self.graph;
        let has_room = places.is_roomy() || !is_asked;
        if self.level != Level::None && has_room {
            let hint = content.hint.then(|| content.keys.fill("{help}: all keys", content.letters));
            places.take(strip::show(context, status, content.measured, self.level, hint.as_deref()));
        } else if let Some(text) = altered(status) {
            places.take(strip::show_altered(context, &text));
        }
        if let Some(legend) = status.legend.as_ref().filter(|_| self.level != Level::None && has_room) {
            // Beside the status, or below it.
            let place = if places.is_roomy() {
                (Align2::RIGHT_TOP, vec2(-MARGIN, MARGIN))
            } else {
                (Align2::LEFT_BOTTOM, vec2(MARGIN, -MARGIN))
            };
            places.take(legend::show(context, legend, place));
        }
        if let Some((name, part)) = content.compared {
            let middle = places.room.center().x;
            let half = 0.5 * places.size_of(context, "compared").x;
            let most = (0.5 * places.room.width() - half - MARGIN).max(0.0);
            // Where both meet.
            let beside = if part < 1.0 { (part as f32 - 0.5) * places.room.width() } else { 0.0 };
            let beside = beside.clamp(-most, most);
            // Below the status, also where that is as wide as the window.
            let down = places.reach(middle + beside - half, middle + beside + half, true);
            let place = (Align2::CENTER_TOP, vec2(beside, down));
            places.take(card(context, "compared", place, |ui| {
                ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Extend);
                let text = if part < 1.0 { format!("{name}  |  now") } else { name.to_owned() };
                ui.label(RichText::new(text).color(ACCENT));
            }));
        }
        if let Some(card) = debug::show(context, &status.debug, status.size, places) {
            places.take(card);
        }
        let has_room = places.is_roomy() && edit::height(places) >= FEWEST_NUMBERS;
        let is_edited = status.edit.is_some() && (has_room || !status.debug.is_open());
        // With both others open, it must leave room for the numbers.
        let room = places.room.height() - graph::height(places.room) - LEAST_NUMBERS;
        let fits = if is_edited && status.debug.is_open() { room > 0.0 } else { true };
        if self.graph && fits && (places.is_roomy() || !(is_edited || status.debug.is_open())) {
            places.take(graph::show(context, &status.graph, is_edited, places));
        }
        if let Some(edited) = status.edit.as_ref().filter(|_| is_edited) {
            places.take(edit::show(context, edited, places, &mut self.edits));
        }
    }
}

/// Height, points, below which a card of numbers is of no use.
const LEAST_NUMBERS: f32 = 190.0;
/// The same, if what is in its way is what was asked about a pixel.
const FEWEST_NUMBERS: f32 = 150.0;

/// Where all cards are.
fn rects(context: &Context) -> [Option<Rect>; 12] {
    let names = [
        "status", "altered", "legend", "compared", "debug", "graph", "edit", "notice", "loading", "open",
        "report", "help",
    ];
    context.memory(|memory| names.map(|name| memory.area_rect(Id::new(name))))
}

/// A translucent card with rounded corners, through which the mouse acts on the picture; returns where it is.
pub fn card(context: &Context, name: &str, place: Place, content: impl FnOnce(&mut egui::Ui)) -> Rect {
    show_card(context, Area::new(Id::new(name)).interactable(false), place, content)
}

/// The card that the wheel turns while clicks go through it, to the next pixel.
const SCROLLING: &str = "debug";

/// The same, but the wheel acts on the card.
pub fn scrolling_card(context: &Context, place: Place, content: impl FnOnce(&mut egui::Ui)) -> Rect {
    show_card(context, Area::new(Id::new(SCROLLING)), place, content)
}

fn show_card(
    context: &Context,
    area: Area,
    (anchor, offset): Place,
    content: impl FnOnce(&mut egui::Ui),
) -> Rect {
    let area = area.anchor(anchor, offset).fade_in(false);
    let frame = style::frame();
    let room = context.content_rect().width() - 2.0 * MARGIN - frame.total_margin().sum().x;
    let content = |ui: &mut egui::Ui| {
        // Or it would be no wider than it was last, whatever it has to say now.
        ui.set_max_width(room.max(MARGIN));
        content(ui);
    };
    area.show(context, |ui| frame.show(ui, content)).response.rect
}

#[cfg(test)]
mod tests;
