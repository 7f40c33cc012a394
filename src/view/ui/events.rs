//! What the user does to cards, with mouse and keyboard.

use super::{SCROLLING, Ui, scale_of};
use egui::{Event, Id, Key, LayerId, Modifiers, MouseWheelUnit, Order, PointerButton, pos2, vec2};
use glam::{DVec2, UVec2};
use winit::event::MouseButton;
use winit::keyboard::KeyCode;

impl Ui {
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
        let acts = |layer: LayerId| layer.order != Order::Background && layer.id != Id::new(SCROLLING);
        let over = self.context.layer_id_at(pos).is_some_and(acts);
        if pressed && !over {
            self.let_go();
        }
        if button != MouseButton::Left {
            return pressed && over;
        }
        if !(over || self.context.is_using_pointer()) {
            return false;
        }
        let button = PointerButton::Primary;
        self.events.push(Event::PointerButton { pos, button, pressed, modifiers: Modifiers::NONE });
        true
    }

    /// The keyboard is the picture's again; a number that is being typed counts as it is.
    fn let_go(&mut self) {
        if self.takes_text() {
            return self.key(KeyCode::Enter, None, false);
        }
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

    /// Something is put into a card.
    pub fn paste(&mut self, text: String) {
        self.events.push(Event::Paste(text));
    }

    /// The wheel was turned. Whether it was meant for a card.
    pub fn wheel(&mut self, notches: f64) -> bool {
        let is_over = self.context.is_pointer_over_area();
        if is_over {
            let (unit, delta) = (MouseWheelUnit::Line, vec2(0.0, notches as f32));
            self.events.push(Event::MouseWheel { unit, delta, modifiers: Modifiers::NONE });
        }
        is_over
    }

    /// Something is typed into a card, Ctrl being down or not.
    pub fn key(&mut self, code: KeyCode, text: Option<&str>, control: bool) {
        let key = match code {
            KeyCode::Enter | KeyCode::NumpadEnter => Some(Key::Enter),
            KeyCode::Escape => Some(Key::Escape),
            KeyCode::Backspace => Some(Key::Backspace),
            KeyCode::Delete => Some(Key::Delete),
            KeyCode::ArrowLeft => Some(Key::ArrowLeft),
            KeyCode::ArrowRight => Some(Key::ArrowRight),
            KeyCode::Tab => Some(Key::Tab),
            KeyCode::Home => Some(Key::Home),
            KeyCode::End => Some(Key::End),
            KeyCode::KeyA if control => Some(Key::A),
            KeyCode::KeyZ if control => Some(Key::Z),
            _ => None,
        };
        match (key, text) {
            (Some(key), _) => self.events.push(Event::Key {
                key,
                physical_key: None,
                pressed: true,
                repeat: false,
                modifiers: if control { Modifiers::COMMAND } else { Modifiers::NONE },
            }),
            (None, Some(text)) if !control => self.events.push(Event::Text(text.to_owned())),
            (None, _) => {}
        }
    }
}
