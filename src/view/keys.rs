//! The keyboard: which keys are down, and what a press does at once.

use super::input::{Command, Press};
use super::keymap::{Action, Hold, Tap, is_modifier};
use super::window::Viewer;
use std::time::Instant;
use winit::event::{ElementState, KeyEvent};
use winit::event_loop::ActiveEventLoop;
use winit::keyboard::{Key, PhysicalKey};

impl Viewer {
    pub(super) fn key(&mut self, event_loop: &ActiveEventLoop, event: &KeyEvent, is_synthetic: bool) {
        let PhysicalKey::Code(code) = event.physical_key else {
            return;
        };
        let [control, shift] = [Hold::Control, Hold::Fast].map(|hold| self.held[hold as usize]);
        if let (Key::Character(text), false, false) = (&event.logical_key, control, shift) {
            self.letters.learn(code, text);
        }
        let pressed = event.state == ElementState::Pressed;
        if pressed && self.ui.takes_text() {
            self.ui.key(code, event.text.as_deref());
            return self.redraw();
        }
        if event.state == ElementState::Released {
            self.keys.remove(&code);
            return self.hold();
        }
        let Some(entry) = self.options.keys.lookup(code, control, shift) else {
            return;
        };
        match entry.action {
            // Keys that are down when the window gets the focus were meant for somebody else.
            action if is_synthetic && !is_modifier(action) => {}
            Action::Hold(_) => {
                self.keys.insert(code);
                self.hold();
            }
            Action::Tap(_) if event.repeat && !entry.repeats => {}
            Action::Tap(tap) => self.tap(event_loop, tap),
        }
    }

    /// Tells the engine what is held, if that is something else than before.
    pub(super) fn hold(&mut self) {
        let mut held = [false; Hold::COUNT];
        for code in &self.keys {
            if let Some(Action::Hold(hold)) =
                self.options.keys.lookup(*code, false, false).map(|entry| entry.action)
            {
                held[hold as usize] = true;
            }
        }
        if held != self.held {
            self.held = held;
            self.send(Command::Held { held, at: Instant::now() });
        }
    }

    pub(super) fn tap(&mut self, event_loop: &ActiveEventLoop, tap: Tap) {
        match tap {
            Tap::HudLevel => self.ui.level = self.ui.level.next(),
            Tap::Graph => self.ui.graph = !self.ui.graph,
            Tap::Help => self.ui.help = !self.ui.help,
            Tap::Escape if self.ui.help => self.ui.help = false,
            Tap::Quit => event_loop.exit(),
            Tap::FullScreen => {
                if let Some(screen) = &self.screen {
                    screen.toggle_full_screen();
                }
            }
            Tap::Screenshot | Tap::ScreenshotWithHud => {
                self.save_screenshot(tap == Tap::ScreenshotWithHud);
            }
            tap => {
                let shift = self.held[Hold::Fast as usize];
                let press = Press { tap, shift, cursor: self.cursor_in_picture() };
                return self.send(Command::Tap { press, at: Instant::now() });
            }
        }
        self.redraw();
    }

    pub(super) fn leave(&mut self) {
        self.keys.clear();
        self.hold();
        self.end_drag();
    }
}
