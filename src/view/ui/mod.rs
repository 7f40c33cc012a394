//! Everything that is drawn over the picture: cards of text, the graph, the help.

pub mod debug;
pub mod edit;
pub mod graph;
pub mod help;
pub mod legend;
pub mod open;
pub mod paint;
pub mod report;
pub mod strip;
pub mod style;

use super::chord::Letters;
use super::debug::DebugStatus;
use super::edit::property::Property;
use super::keymap::Keymap;
use super::status::{Level, Measured, Status, altered};
use egui::{
    Align2, Area, Context, Event, Id, Key, Modifiers, PointerButton, Pos2, RawInput, Rect, RichText,
    ViewportId, pos2, vec2,
};
use glam::{DVec2, UVec2};
use paint::Painter;
use std::time::Instant;
use winit::event::MouseButton;
use winit::keyboard::KeyCode;

/// What there is to show.
pub struct Content<'a> {
    /// Of the engine; `None` until the scene is open.
    pub status: Option<&'a Status>,
    /// Of the window.
    pub measured: Measured,
    /// What is loading, while it is.
    pub loading: Option<&'a str>,
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
        let mut output = context.run(input, |context| self.show(context, content));
        self.painter.update(&output.textures_delta);
        // A new card is measured first, and drawn the next time: which is now, for a picture at rest has no next.
        for _ in 0..2 {
            if !context.has_requested_repaint() {
                break;
            }
            output = context.run(again.clone(), |context| self.show(context, content));
            self.painter.update(&output.textures_delta);
        }
        let primitives = context.tessellate(output.shapes, output.pixels_per_point);
        self.painter.paint(rgba, size, &primitives, output.pixels_per_point);
    }

    /// The cursor is at this pixel now. Whether a card wants to show that.
    pub fn pointer(&mut self, at: DVec2, (display, size): (f64, UVec2)) -> bool {
        let at = at.as_vec2() / scale_of(display, size);
        self.events.push(Event::PointerMoved(pos2(at.x, at.y)));
        self.context.is_pointer_over_area() && self.context.wants_pointer_input()
    }

    /// A mouse button. Whether it was meant for a card.
    pub fn button(&mut self, button: MouseButton, pressed: bool) -> bool {
        let pos = self.events.iter().rev().find_map(|event| match event {
            Event::PointerMoved(pos) => Some(*pos),
            _ => None,
        });
        let Some(pos) = pos.or(self.context.pointer_latest_pos()) else { return false };
        let over = self.context.layer_id_at(pos).is_some_and(|layer| layer.order != egui::Order::Background);
        if pressed && !over {
            self.let_go();
        }
        if button != MouseButton::Left || !(over || self.context.is_using_pointer()) {
            return false;
        }
        let button = PointerButton::Primary;
        self.events.push(Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE });
        true
    }

    /// The keyboard is the picture's again; a number that is being typed counts as it is.
    fn let_go(&self) {
        self.context.memory_mut(|memory| {
            if let Some(id) = memory.focused() {
                memory.surrender_focus(id);
            }
        });
    }

    /// Whether what is typed goes into a card.
    #[must_use]
    pub fn takes_text(&self) -> bool {
        self.context.wants_keyboard_input()
    }

    /// Something is typed into a card.
    pub fn key(&mut self, code: KeyCode, text: Option<&str>) {
        let key = match code {
            KeyCode::Enter | KeyCode::NumpadEnter => Some(Key::Enter),
            KeyCode::Escape => Some(Key::Escape),
            KeyCode::Backspace => Some(Key::Backspace),
            KeyCode::Delete => Some(Key::Delete),
            KeyCode::ArrowLeft => Some(Key::ArrowLeft),
            KeyCode::ArrowRight => Some(Key::ArrowRight),
            KeyCode::Tab => Some(Key::Tab),
            _ => None,
        };
        match (key, text) {
            (Some(key), _) => self.events.push(Event::Key {
                key,
                physical_key: None,
                pressed: true,
                repeat: false,
                modifiers: Modifiers::NONE,
            }),
            (None, Some(text)) => self.events.push(Event::Text(text.to_owned())),
            (None, None) => {}
        }
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
        if let Some(status) = content.status {
            if self.level != Level::None {
                strip::show(context, status, content.measured, self.level);
            } else if let Some(text) = altered(status) {
                strip::show_altered(context, &text);
            }
            if let Some(legend) = status.legend.as_ref().filter(|_| self.level != Level::None) {
                legend::show(context, legend);
            }
            debug::show(context, &status.debug);
            if let Some(edited) = &status.edit {
                edit::show(context, edited, &mut self.edits);
            }
            if self.graph {
                graph::show(context, &status.graph);
            }
        }
        if let Some(status) = content.status.filter(|_| self.report) {
            report::show(context, &status.card);
        }
        if let Some(prompt) = &self.prompt {
            open::show(context, prompt);
        }
        if let Some((name, part)) = content.compared {
            // Below the status, also where that is as wide as the window.
            card(context, "compared", Align2::CENTER_TOP, vec2(0.0, 7.0 * style::MARGIN), |ui| {
                ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Extend);
                let text = if part < 1.0 { format!("{name}  |  now") } else { name.to_owned() };
                ui.label(RichText::new(text).color(style::ACCENT));
            });
        }
        if let Some(text) = content.loading {
            card(context, "loading", Align2::CENTER_CENTER, vec2(0.0, 0.0), |ui| {
                ui.label(RichText::new(text).size(16.0));
            });
        }
        self.help.show(context, content.keys, content.letters);
        if !content.notice.is_empty() {
            card(context, "notice", Align2::CENTER_BOTTOM, vec2(0.0, -style::MARGIN), |ui| {
                ui.set_max_width(context.content_rect().width() - 6.0 * style::MARGIN);
                ui.label(content.notice);
            });
        }
    }
}

/// A translucent card with rounded corners.
pub fn card(
    context: &Context,
    name: &str,
    anchor: Align2,
    offset: egui::Vec2,
    content: impl FnOnce(&mut egui::Ui),
) {
    Area::new(Id::new(name)).anchor(anchor, offset).fade_in(false).interactable(false).show(context, |ui| {
        style::frame().show(ui, content);
    });
}

#[cfg(test)]
mod tests {
    use super::super::edit::EditStatus;
    use super::super::edit::property::Row;
    use super::super::status::tests::status;
    use super::*;
    use std::sync::Arc;

    fn drawn(size: UVec2, display: f64, change: impl FnOnce(&mut Ui), background: u8) -> Vec<u8> {
        let (status, keys, letters) = (status(), Keymap::default(), Letters::default());
        let content = Content {
            status: Some(&status),
            measured: Measured::default(),
            loading: None,
            notice: "saved cornell_1.png",
            compared: None,
            keys: &keys,
            letters: &letters,
        };
        let mut ui = Ui::default();
        change(&mut ui);
        let mut rgba = vec![background; size.element_product() as usize * 4];
        ui.draw(&mut rgba, size, display, &content);
        rgba
    }

    #[test]
    fn text_is_light_on_dark_over_any_background() {
        let size = UVec2::new(640, 360);
        for background in [0, 128, 255] {
            let rgba = drawn(size, 1.0, |_| {}, background);
            let changed = rgba.chunks_exact(4).filter(|p| p[0] != background);
            let (dark, light) = changed.fold((0, 0), |(dark, light), p| {
                (dark + usize::from(p[1] < 90), light + usize::from(p[1] > 200))
            });
            assert!(dark > 4000 && light > 200, "on {background}: {dark} dark, {light} light");
        }
    }

    #[test]
    fn everything_goes_into_a_window_of_any_size_on_any_display() {
        for (width, height) in [(1, 1), (3, 200), (200, 3), (40, 30), (321, 241), (1920, 1080)] {
            for display in [0.0, 1.0, 1.25, 2.0, 3.5] {
                let open = |ui: &mut Ui| {
                    ui.help.turn();
                    (ui.graph, ui.level) = (true, Level::All);
                    (ui.report, ui.prompt) = (true, Some(open::Prompt::new("")));
                };
                drawn(UVec2::new(width, height), display, open, 90);
            }
        }
    }

    #[test]
    fn every_page_of_the_help_is_inside_the_window() {
        let (keys, letters) = (Keymap::default(), Letters::default());
        let content = Content {
            status: None,
            measured: Measured::default(),
            loading: None,
            notice: "",
            compared: None,
            keys: &keys,
            letters: &letters,
        };
        for (width, height, most) in
            [(1920, 1080, 1), (960, 540, 1), (640, 400, 4), (320, 240, 8), (200, 600, 8)]
        {
            let mut ui = Ui { level: Level::None, ..Ui::default() };
            let mut pages = 0;
            ui.help.turn();
            while ui.help.is_open() {
                let mut rgba = Vec::new();
                for _ in 0..2 {
                    rgba = vec![90; (4 * width * height) as usize];
                    ui.draw(&mut rgba, UVec2::new(width, height), 1.0, &content);
                }
                let drawn = |x: u32, y: u32| rgba[(4 * (y * width + x)) as usize] != 90;
                let rim = (0..width).any(|x| drawn(x, 0) || drawn(x, height - 1))
                    || (0..height).any(|y| drawn(0, y) || drawn(width - 1, y));
                assert!(!rim, "page {pages} in {width}x{height} is cut");
                assert!(drawn(width / 2, height / 2));
                pages += 1;
                ui.help.turn();
            }
            assert!((1..=most).contains(&pages), "{pages} pages in {width}x{height}");
        }
    }

    #[test]
    fn nothing_is_drawn_if_nothing_is_wanted() {
        let (keys, letters) = (Keymap::default(), Letters::default());
        let content = Content {
            status: Some(&status()),
            measured: Measured::default(),
            loading: None,
            notice: "",
            compared: None,
            keys: &keys,
            letters: &letters,
        };
        let mut ui = Ui { level: Level::None, ..Ui::default() };
        assert!(ui.is_bare(&content));
        let mut rgba = vec![77; 100 * 100 * 4];
        ui.draw(&mut rgba, UVec2::splat(100), 1.0, &content);
        assert!(rgba.iter().all(|&c| c == 77));
        // But never a picture that is more than the film, as if it were not.
        let smoothed = Status { smoothed: true, ..status() };
        let content = Content { status: Some(&smoothed), ..content };
        assert!(!ui.is_bare(&content));
        ui.draw(&mut rgba, UVec2::splat(100), 1.0, &content);
        let changed = rgba.iter().filter(|&&c| c != 77).count() / 4;
        assert!((100..5000).contains(&changed), "{changed} pixels");
    }

    #[test]
    fn the_same_twice_is_the_same_to_the_bit() {
        let size = UVec2::new(960, 540);
        let open = |ui: &mut Ui| ui.help.turn();
        assert_eq!(drawn(size, 1.0, open, 50), drawn(size, 1.0, open, 50));
    }
    #[test]
    fn a_click_into_the_picture_takes_the_keyboard_from_the_card() {
        let mut status = status();
        let row = |i| Row {
            property: Property::Position(i),
            label: "x",
            value: 1.0,
            step: 0.1,
            grows: false,
            range: [-1e3, 1e3],
        };
        let edited = EditStatus { rows: (0..3).map(row).collect(), ..EditStatus::default() };
        status.edit = Some(Arc::new(edited));
        let (keys, letters) = (Keymap::default(), Letters::default());
        let content = Content {
            status: Some(&status),
            measured: Measured::default(),
            loading: None,
            notice: "",
            compared: None,
            keys: &keys,
            letters: &letters,
        };
        let size = UVec2::new(640, 400);
        let mut ui = Ui::default();
        let mut frame = |ui: &mut Ui| ui.draw(&mut vec![0; 640 * 400 * 4], size, 1.0, &content);
        let click = |ui: &mut Ui, frame: &mut dyn FnMut(&mut Ui), at: DVec2| {
            let mut taken = false;
            for pressed in [true, false] {
                ui.pointer(at, (1.0, size));
                taken |= ui.button(MouseButton::Left, pressed);
                frame(ui);
            }
            taken
        };
        frame(&mut ui);
        // Wherever on the card the numbers are.
        let mut down = (0..40).map(|i| DVec2::new(600.0, 100.0 + 5.0 * f64::from(i)));
        assert!(down.any(|at| click(&mut ui, &mut frame, at) && ui.takes_text()), "no number takes text");
        ui.key(KeyCode::Digit7, Some("7"));
        frame(&mut ui);
        assert!(!click(&mut ui, &mut frame, DVec2::new(50.0, 300.0)), "the picture gets it as well");
        assert!(!ui.takes_text());
        assert_eq!(ui.edits.last().map(|(_, value)| *value), Some(7.0), "what was typed counts");
    }
}
