//! The keyboard: which keys are down, and what a press does at once.

use super::input::{Command, Press};
use super::keymap::{Action, Entry, Hold, Keymap, Tap, is_modifier};
use super::reload::is_sky;
use super::replay::Event;
use super::ui::open::{Prompt, Typed};
use super::window::Viewer;
use std::collections::HashMap;
use std::time::{Duration, Instant};
use winit::event::{ElementState, KeyEvent};
use winit::event_loop::ActiveEventLoop;
use winit::keyboard::{Key, KeyCode, PhysicalKey};

/// So long the user has to say that edits may be lost.
const PATIENCE: Duration = Duration::from_secs(6);

/// The keys that are down and held for something. What one means is decided when it goes down, by the modifiers that are
/// down then, and stays until it goes up.
#[derive(Clone, Debug, Default)]
pub(super) struct Down(HashMap<KeyCode, Hold>);

impl Down {
    /// What is held, by [`Hold`].
    fn held(&self) -> [bool; Hold::COUNT] {
        let mut held = [false; Hold::COUNT];
        for &hold in self.0.values() {
            held[hold as usize] = true;
        }
        held
    }

    /// What `code` means when it goes down now; nothing if it is down and held already.
    fn meaning(&self, code: KeyCode, keys: &Keymap) -> Option<Entry> {
        if self.0.contains_key(&code) {
            return None;
        }
        let [control, shift] = [Hold::Control, Hold::Fast].map(|hold| self.held()[hold as usize]);
        keys.lookup(code, control, shift)
    }
}

impl Viewer {
    pub(super) fn key(&mut self, event_loop: &ActiveEventLoop, event: &KeyEvent, is_synthetic: bool) {
        let PhysicalKey::Code(code) = event.physical_key else {
            return;
        };
        let pressed = event.state == ElementState::Pressed;
        let types = pressed && (self.ui.prompt.is_some() || self.ui.takes_text());
        if types && !self.is_for_the_window(code) {
            // A key that was held when the line opened is not meant for it.
            if event.repeat && self.keys.0.contains_key(&code) {
                return;
            }
            self.type_key(code, event.text.as_deref());
            return self.redraw();
        }
        let modified = self.held[Hold::Control as usize] || self.held[Hold::Fast as usize];
        if let (Key::Character(text), false) = (&event.logical_key, modified) {
            self.letters.learn(code, text);
        }
        // What went down while something was typed is not held.
        if !event.repeat && (pressed || self.keys.0.contains_key(&code)) {
            self.record_cursor();
            self.record(&Event::Key(code, pressed));
        }
        self.key_moved(event_loop, code, pressed, event.repeat, is_synthetic);
    }

    /// Whether a key means the same while something is typed: those that modify others, and the end.
    fn is_for_the_window(&self, code: KeyCode) -> bool {
        let [control, shift] = [Hold::Control, Hold::Fast].map(|hold| self.held[hold as usize]);
        let entry = self.options.keys.lookup(code, control, shift);
        entry.is_some_and(|entry| {
            // A letter that is bound to it is typed all the same.
            is_modifier(entry.action) || control && entry.action == Action::Tap(Tap::Quit)
        })
    }

    /// A key for the line that asks for a file, or for a card.
    fn type_key(&mut self, code: KeyCode, text: Option<&str>) {
        let control = self.held[Hold::Control as usize];
        let pasted = if control && code == KeyCode::KeyV { self.pasted() } else { None };
        let Some(prompt) = &mut self.ui.prompt else {
            return match pasted {
                Some(text) => self.ui.paste(text),
                None => self.ui.key(code, text, control),
            };
        };
        let text = pasted.as_deref().or(text.filter(|_| !control));
        match prompt.key(code, text, control) {
            Typed::Nothing => self.ui.prompt = None,
            // Another sky takes nothing away.
            Typed::Open(path) if is_sky(&path) || self.may_lose_edits() => {
                self.tried = self.ui.prompt.take();
                self.record(&Event::Open(path.clone()));
                self.send(Command::Open(path));
            }
            Typed::On | Typed::Open(_) => {}
        }
    }

    /// Ends the program, if nothing is lost by that.
    pub(super) fn leave_program(&mut self, event_loop: &ActiveEventLoop) {
        if self.may_lose_edits() {
            event_loop.exit();
        }
    }

    /// Whether another scene may take the place of this one: if there are edits that no file has, the user is told first, and does
    /// it again if that is meant.
    pub(super) fn may_lose_edits(&mut self) -> bool {
        let is_unsaved = self.status.as_ref().is_some_and(|status| status.unsaved);
        if !is_unsaved || self.warned.is_some_and(|at| at.elapsed() < PATIENCE) {
            return true;
        }
        self.warned = Some(Instant::now());
        self.say("your edits are not saved: {save_edits} saves them; once more to go without");
        false
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
            self.keys.0.remove(&code);
            return self.hold();
        }
        let Some(entry) = self.keys.meaning(code, &self.options.keys) else {
            return;
        };
        self.is_new_here = false;
        match entry.action {
            // Keys that are down when the window gets the focus were meant for somebody else.
            action if is_synthetic && !is_modifier(action) => {}
            Action::Hold(hold) => {
                self.keys.0.insert(code, hold);
                self.hold();
            }
            Action::Tap(_) if repeat && !entry.repeats => {}
            Action::Tap(tap) => self.tap(event_loop, tap),
        }
    }

    /// Tells the engine what is held, if that is something else than before.
    pub(super) fn hold(&mut self) {
        let held = self.keys.held();
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
            // One of both: each covers the picture.
            Tap::Help => {
                self.ui.report = false;
                self.ui.help.turn();
            }
            Tap::Report => {
                self.ui.help.close();
                self.ui.report = !self.ui.report;
            }
            Tap::Open => {
                self.tried = None;
                self.ui.prompt = Some(Prompt::new(&self.options.folder));
            }
            Tap::Escape => self.escape(),
            Tap::Split => {
                self.split = self.cursor_in_picture().x;
                return self.pass_on(tap);
            }
            Tap::Quit => self.leave_program(event_loop),
            Tap::Screenshot | Tap::ScreenshotWithHud if self.picture.rgba.is_empty() => {
                self.say("there is no picture yet");
            }
            // Another picture, or parts of two, cannot be made again from what makes this one.
            Tap::ScreenshotWithHud if self.other().is_some() => self.save_shown(),
            Tap::FullScreen => {
                if let Some(screen) = &self.screen {
                    screen.toggle_full_screen();
                }
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
        } else if self.ui.help.is_open() {
            self.ui.help.close();
        } else if self.ui.report {
            self.ui.report = false;
        } else if self.ui.graph && !edits {
            self.ui.graph = false;
        } else {
            // Also if nothing is known to be open: what a key before has opened, the engine alone may know.
            self.pass_on(Tap::Escape);
            let is_open = edits || explains || self.compared.split;
            let quit = self.options.keys.label(Tap::Quit, &self.letters).filter(|_| !is_open);
            if let Some(quit) = quit {
                self.say(&format!("{quit} quits"));
            }
        }
    }

    pub(super) fn leave(&mut self) {
        let held: Vec<KeyCode> = self.keys.0.drain().map(|(code, _)| code).collect();
        held.into_iter().for_each(|code| self.record(&Event::Key(code, false)));
        self.hold();
        self.end_drag();
    }
}

#[cfg(test)]
mod tests {
    use super::super::keys_file::parse;
    use super::*;
    use KeyCode::{ControlLeft, KeyQ, KeyS, KeyW, ShiftLeft};

    /// What is held for something after these keys went down (true) or up, beside Ctrl and Shift.
    fn held(keys: &Keymap, events: &[(KeyCode, bool)]) -> Vec<usize> {
        let mut down = Down::default();
        for &(code, pressed) in events {
            if !pressed {
                down.0.remove(&code);
            } else if let Some(Action::Hold(hold)) = down.meaning(code, keys).map(|entry| entry.action) {
                down.0.insert(code, hold);
            }
        }
        let held = down.held();
        (0..Hold::COUNT)
            .filter(|&i| held[i] && i != Hold::Control as usize && i != Hold::Fast as usize)
            .collect()
    }

    #[test]
    fn what_is_bound_with_a_modifier_is_held_with_it_and_until_its_key_goes_up() {
        let keys = parse("forward = 'Ctrl+W'\nback = 'Shift+S'").unwrap();
        let (forward, back) = (Hold::Forward as usize, Hold::Back as usize);
        assert!(held(&keys, &[(KeyW, true)]).is_empty());
        assert_eq!(held(&keys, &[(ControlLeft, true), (KeyW, true)]), [forward]);
        assert_eq!(held(&keys, &[(ControlLeft, true), (KeyW, true), (ControlLeft, false)]), [forward]);
        assert!(held(&keys, &[(ControlLeft, true), (KeyW, true), (KeyW, false)]).is_empty());
        assert_eq!(held(&keys, &[(ShiftLeft, true), (KeyS, true)]), [back]);
    }

    #[test]
    fn a_modifier_that_comes_later_changes_nothing() {
        let keys = Keymap::default();
        assert_eq!(held(&keys, &[(KeyW, true), (ControlLeft, true), (KeyW, true)]), [Hold::Forward as usize]);
        assert!(held(&keys, &[(ControlLeft, true), (KeyQ, true)]).is_empty(), "that is another thing");
    }
}
