//! The keyboard: which keys are down, and what a press does at once.

use super::input::{Command, Press};
use super::keymap::{Action, Hold, Tap, is_modifier};
use super::replay::Event;
use super::ui::open::{Prompt, Typed};
use super::window::Viewer;
use std::time::Instant;
use winit::event::{ElementState, KeyEvent};
use winit::event_loop::ActiveEventLoop;
use winit::keyboard::{Key, KeyCode, PhysicalKey};

impl Viewer {
    pub(super) fn key(&mut self, event_loop: &ActiveEventLoop, event: &KeyEvent, is_synthetic: bool) {
        let PhysicalKey::Code(code) = event.physical_key else {
            return;
        };
        let pressed = event.state == ElementState::Pressed;
        if pressed && let Some(prompt) = &mut self.ui.prompt {
            match prompt.key(code, event.text.as_deref()) {
                Typed::On => {}
                Typed::Nothing => self.ui.prompt = None,
                Typed::Open(path) => {
                    self.ui.prompt = None;
                    self.send(Command::Open(path));
                }
            }
            return self.redraw();
        }
        if pressed && self.ui.takes_text() {
            self.ui.key(code, event.text.as_deref());
            return self.redraw();
        }
        let modified = self.held[Hold::Control as usize] || self.held[Hold::Fast as usize];
        if let (Key::Character(text), false) = (&event.logical_key, modified) {
            self.letters.learn(code, text);
        }
        if !event.repeat {
            self.record(Event::Key(code, pressed));
        }
        self.key_moved(event_loop, code, pressed, event.repeat, is_synthetic);
    }

    /// A key went down or up, or is down for long.
    pub(super) fn key_moved(
        &mut self,
        event_loop: &ActiveEventLoop,
        code: KeyCode,
        pressed: bool,
        repeat: bool,
        is_synthetic: bool,
    ) {
        if !pressed {
            self.keys.remove(&code);
            return self.hold();
        }
        let [control, shift] = [Hold::Control, Hold::Fast].map(|hold| self.held[hold as usize]);
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
            Action::Tap(_) if repeat && !entry.repeats => {}
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
            self.redraw();
        }
    }

    pub(super) fn tap(&mut self, event_loop: &ActiveEventLoop, tap: Tap) {
        match tap {
            Tap::HudLevel => self.ui.level = self.ui.level.next(),
            Tap::Graph => self.ui.graph = !self.ui.graph,
            Tap::Help => self.ui.help = !self.ui.help,
            Tap::Report => self.ui.report = !self.ui.report,
            Tap::Open => self.ui.prompt = Some(Prompt::new("")),
            Tap::Escape => self.escape(),
            Tap::Split => {
                self.split = self.cursor_in_picture().x;
                return self.pass_on(tap);
            }
            Tap::Quit => event_loop.exit(),
            // What is looked at closely is the film alone: the engine is asked for it.
            Tap::Screenshot | Tap::ScreenshotWithHud
                if self.is_altered() && (tap == Tap::Screenshot || self.other().is_none()) =>
            {
                return self.pass_on(tap);
            }
            Tap::FullScreen => {
                if let Some(screen) = &self.screen {
                    screen.toggle_full_screen();
                }
            }
            Tap::Screenshot | Tap::ScreenshotWithHud => {
                self.save_screenshot(tap == Tap::ScreenshotWithHud, None);
            }
            tap => return self.pass_on(tap),
        }
        self.redraw();
    }

    /// Tells the engine.
    fn pass_on(&self, tap: Tap) {
        let shift = self.held[Hold::Fast as usize];
        let press = Press { tap, shift, cursor: self.cursor_in_picture() };
        self.send(Command::Tap { press, at: Instant::now() });
    }

    /// Lets the mouse go, or closes what lies on top; with nothing open it says what ends the program.
    fn escape(&mut self) {
        let edits = self.status.as_ref().is_some_and(|status| status.edit.is_some());
        let explains = self.status.as_ref().is_some_and(|status| status.debug.is_open());
        if self.drag.is_some() {
            self.end_drag();
        } else if self.ui.help {
            self.ui.help = false;
        } else if self.ui.report {
            self.ui.report = false;
        } else if self.ui.graph && !edits {
            self.ui.graph = false;
        } else if edits || explains || self.compared.split {
            self.pass_on(Tap::Escape);
        } else if let Some(quit) = self.options.keys.label(Tap::Quit, &self.letters) {
            self.say(format!("{quit} quits"));
        }
    }

    pub(super) fn leave(&mut self) {
        self.keys.clear();
        self.hold();
        self.end_drag();
    }
}
