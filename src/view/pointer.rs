//! The mouse: buttons that drag, the wheel, and where the cursor is.

use super::input::{Command, Drag, Press};
use super::keymap::{Hold, Tap};
use super::replay::{Event, Replay};
use super::window::Viewer;
use glam::DVec2;
use std::time::Instant;
use winit::dpi::PhysicalPosition;
use winit::event::{MouseButton, MouseScrollDelta};
use winit::event_loop::ActiveEventLoop;
use winit::window::CursorGrabMode;

/// Pixels of a touchpad that count as a notch of a wheel.
const PIXELS_PER_NOTCH: f64 = 40.0;

/// A button let go within so many pixels was not dragged.
const CLICK: f64 = 4.0;

impl Viewer {
    /// A button went down or up.
    pub(super) fn button(&mut self, button: MouseButton, down: bool) {
        if down && !self.notice.is_empty() {
            // It has been read, or is in the way.
            self.notice.clear();
            self.redraw();
        }
        if self.ui.button(button, down) {
            self.redraw();
            // What began beside the cards ends wherever the button is let go.
            if down || self.drag.is_none() {
                return;
            }
        }
        let drag = match button {
            MouseButton::Right => Drag::Look,
            // While a rectangle is drawn, letting the key go first changes nothing.
            MouseButton::Left if self.held[Hold::Control as usize] || self.draws_region() => Drag::Region,
            MouseButton::Left => Drag::Orbit,
            MouseButton::Middle => Drag::Pan,
            _ => return,
        };
        if down {
            self.begin_drag(drag);
        } else if let Some((current, start)) = self.drag
            && current == drag
        {
            let drawn = self.drawn_region();
            self.end_drag();
            if let Some(corners) = drawn {
                self.record(&Event::Region(corners));
                self.send(Command::Region(corners));
                return self.redraw();
            }
            let way = DVec2::new(self.cursor.x - start.x, self.cursor.y - start.y);
            if drag == Drag::Orbit && !self.dragged && way.length() < CLICK {
                self.record_cursor();
                self.record(&Event::Click);
                self.click();
            }
        }
    }

    fn draws_region(&self) -> bool {
        matches!(self.drag, Some((Drag::Region, _)))
    }

    /// The corners of the rectangle that is being drawn, in parts of the picture.
    pub(super) fn drawn_region(&self) -> Option<[DVec2; 2]> {
        let (Some((Drag::Region, start)), Some(screen)) = (self.drag, &self.screen) else { return None };
        let part = |at: PhysicalPosition<f64>| DVec2::new(at.x, at.y) / screen.size().as_dvec2();
        Some([part(start), part(self.cursor)])
    }

    fn begin_drag(&mut self, drag: Drag) {
        let Some(screen) = &self.screen else { return };
        if self.drag.is_some() {
            return;
        }
        self.drag = Some((drag, self.cursor));
        self.dragged = false;
        if drag == Drag::Look {
            // X11 cannot lock the pointer: it is put back to the middle instead. Confining it as well
            // would deliver each of its motions twice.
            let _ = screen.window.set_cursor_grab(CursorGrabMode::Locked);
            screen.window.set_cursor_visible(false);
        }
    }

    pub(super) fn end_drag(&mut self) {
        let (Some(screen), Some((drag, start))) = (&self.screen, self.drag.take()) else { return };
        if drag == Drag::Look {
            let _ = screen.window.set_cursor_position(start);
            let _ = screen.window.set_cursor_grab(CursorGrabMode::None);
            screen.window.set_cursor_visible(true);
        }
    }

    pub(super) fn cursor_moved(&mut self, to: PhysicalPosition<f64>) {
        let from = std::mem::replace(&mut self.cursor, to);
        self.cursor_inside = true;
        let display =
            self.screen.as_ref().map_or((1.0, glam::UVec2::ONE), |s| (s.window.scale_factor(), s.size()));
        if self.ui.pointer(DVec2::new(to.x, to.y), display) {
            self.redraw();
        }
        if let (None, Some(screen)) = (self.drag, &self.screen) {
            self.split = (to.x / f64::from(screen.size().x)).clamp(0.0, 1.0);
            if self.compared.split {
                self.redraw();
            }
        }
        let (Some((drag, start)), Some(screen)) = (self.drag, &self.screen) else {
            return;
        };
        if drag != Drag::Look {
            // The pointer is free: what counts is how far it came in the window.
            let pixels = DVec2::new(to.x - from.x, to.y - from.y);
            if drag == Drag::Region {
                return self.redraw();
            }
            // A hand that clicks shakes.
            if drag == Drag::Orbit && !self.dragged {
                self.dragged = DVec2::new(to.x - start.x, to.y - start.y).length() >= CLICK;
                if !self.dragged {
                    return;
                }
            }
            return self.drag_by(drag, pixels);
        }
        let middle = screen.size().as_dvec2() / 2.0;
        let off = (DVec2::new(to.x, to.y) - middle).abs();
        if off.cmpgt(middle / 2.0).any() {
            // Where the pointer is locked there is nothing to put back.
            let _ = screen.window.set_cursor_position(PhysicalPosition::new(middle.x, middle.y));
        }
    }

    /// The mouse itself moved, wherever the cursor is.
    pub(super) fn mouse_moved(&mut self, pixels: DVec2) {
        if let Some((Drag::Look, _)) = self.drag {
            self.drag_by(Drag::Look, pixels);
        }
    }

    fn drag_by(&mut self, drag: Drag, pixels: DVec2) {
        self.record(&Event::Drag(drag, pixels.x, pixels.y));
        self.send(Command::Drag { drag, pixels, at: Instant::now() });
    }

    /// Does again what was recorded, as far as its time has come.
    pub(super) fn replay(&mut self, event_loop: &ActiveEventLoop, now: Instant) {
        // Not before there is something to see.
        let Some(replay) = self.options.replay.as_mut().filter(|_| !self.picture.rgba.is_empty()) else {
            return;
        };
        for event in replay.due(now) {
            match event {
                Event::Key(code, pressed) => {
                    self.key_moved(event_loop, code, pressed, false, false);
                    // What was typed into it is told by what it came to.
                    self.ui.prompt = None;
                }
                Event::Drag(drag, x, y) => {
                    self.send(Command::Drag { drag, pixels: DVec2::new(x, y), at: Instant::now() });
                }
                Event::Wheel(notches) => self.turn_wheel(notches),
                Event::At(place) => self.put_cursor(place),
                Event::Click => self.click(),
                Event::Region(corners) => self.send(Command::Region(corners)),
                Event::Open(path) => self.send(Command::Open(path)),
                Event::Quit => event_loop.exit(),
            }
        }
        self.due.replay = self.options.replay.as_ref().and_then(Replay::next);
    }

    pub(super) fn record(&mut self, event: &Event) {
        if let Some(recorder) = &mut self.options.record {
            recorder.note(event);
        }
    }

    /// Before something that asks where the cursor is.
    pub(super) fn record_cursor(&mut self) {
        let at = self.cursor_in_picture();
        if self.options.record.is_some() && self.recorded_cursor != Some(at) {
            self.recorded_cursor = Some(at);
            self.record(&Event::At(at));
        }
    }

    /// As if the user had moved it.
    fn put_cursor(&mut self, place: DVec2) {
        let Some(screen) = &self.screen else { return };
        let at = place * screen.size().as_dvec2();
        self.cursor_moved(PhysicalPosition::new(at.x, at.y));
    }

    fn click(&self) {
        let shift = self.held[Hold::Fast as usize];
        let press = Press { tap: Tap::Click, shift, cursor: self.cursor_in_picture() };
        self.send(Command::Tap { press, at: Instant::now() });
    }

    pub(super) fn wheel(&mut self, delta: MouseScrollDelta) {
        let notches = match delta {
            MouseScrollDelta::LineDelta(_, y) => f64::from(y),
            MouseScrollDelta::PixelDelta(p) => p.y / PIXELS_PER_NOTCH,
        };
        if self.ui.wheel(notches) {
            return self.redraw();
        }
        self.record(&Event::Wheel(notches));
        self.turn_wheel(notches);
    }

    fn turn_wheel(&mut self, notches: f64) {
        let dolly = self.held[Hold::Control as usize];
        self.send(Command::Wheel { notches, dolly, at: Instant::now() });
    }

    /// From 0 at the upper left to 1 at the lower right; the middle without a cursor.
    pub(super) fn cursor_in_picture(&self) -> DVec2 {
        let size = self.screen.as_ref().filter(|_| self.cursor_inside).map(|screen| screen.size().as_dvec2());
        let place = size.map(|size| DVec2::new(self.cursor.x, self.cursor.y) / size);
        place.filter(|p| p.cmpge(DVec2::ZERO).all() && p.cmplt(DVec2::ONE).all()).unwrap_or(DVec2::splat(0.5))
    }
}
