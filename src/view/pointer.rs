//! The mouse.

use super::window::Viewer;
use glam::DVec2;
use winit::dpi::PhysicalPosition;
use winit::window::CursorGrabMode;

impl Viewer {
    /// Begins or ends looking around with the mouse.
    pub(super) fn set_drag(&mut self, on: bool) {
        let Some(screen) = &self.screen else { return };
        if on && self.drag.is_none() {
            self.drag = Some(self.cursor);
            // X11 cannot lock the pointer: it is put back to the middle instead. Confining it as well
            // would deliver each of its motions twice.
            let _ = screen.window.set_cursor_grab(CursorGrabMode::Locked);
            screen.window.set_cursor_visible(false);
        } else if !on && let Some(start) = self.drag.take() {
            let _ = screen.window.set_cursor_position(start);
            let _ = screen.window.set_cursor_grab(CursorGrabMode::None);
            screen.window.set_cursor_visible(true);
        }
    }

    pub(super) fn cursor_moved(&mut self, to: PhysicalPosition<f64>) {
        self.cursor = to;
        let (Some(_), Some(screen)) = (self.drag, &self.screen) else {
            return;
        };
        let middle = screen.size().as_dvec2() / 2.0;
        let off = (DVec2::new(to.x, to.y) - middle).abs();
        if off.cmpgt(middle / 2.0).any() {
            // Where the pointer is locked there is nothing to put back.
            let _ = screen.window.set_cursor_position(PhysicalPosition::new(middle.x, middle.y));
        }
    }
}
