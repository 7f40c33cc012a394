//! What the user does, from the window's thread to the frame's systems.

use super::edit::property::Property;
use super::keymap::{Hold, Tap};
use bevy_ecs::prelude::*;
use glam::{DVec2, UVec2};
use std::path::PathBuf;
use std::time::Instant;

/// From the window to the engine.
#[derive(Clone, Debug)]
pub enum Command {
    /// Exactly these keys are down from `at` on.
    Held {
        /// By [`Hold`].
        held: [bool; Hold::COUNT],
        /// When the event arrived.
        at: Instant,
    },
    /// The mouse was dragged.
    Drag {
        /// What it is meant to do.
        drag: Drag,
        /// To the right and down, in mouse pixels.
        pixels: DVec2,
        /// When the event arrived.
        at: Instant,
    },
    /// The wheel turned.
    Wheel {
        /// Away from the user is positive.
        notches: f64,
        /// Nearer to the pivot, not faster.
        dolly: bool,
        /// When the event arrived.
        at: Instant,
    },
    /// A key was pressed (or repeated).
    Tap {
        /// Which, and how.
        press: Press,
        /// When the event arrived.
        at: Instant,
    },
    /// A number of the selected thing is to be another.
    Edit {
        /// Which.
        property: Property,
        /// How much.
        value: f64,
        /// When the event arrived.
        at: Instant,
    },
    /// Refine only what is between these places, from the upper left corner at 0 to the lower right one at 1.
    Region([DVec2; 2]),
    /// Show this scene instead.
    Open(PathBuf),
    /// A file of the scene may have changed.
    FilesChanged,
    /// The window's inside has this many pixels, each side at least 1.
    Resize(UVec2),
    /// End the engine.
    Quit,
}

/// What a dragged mouse does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drag {
    /// Turn the camera.
    Look,
    /// Turn about the pivot.
    Orbit,
    /// Move sideways, so that the pivot stays under the cursor.
    Pan,
    /// Draw the rectangle that is to be refined.
    Region,
}

/// A key press.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Press {
    /// Its meaning.
    pub tap: Tap,
    /// Whether Shift was down.
    pub shift: bool,
    /// Where the cursor was, from the upper left corner at 0 to the lower right one at 1.
    pub cursor: DVec2,
}

impl From<Tap> for Press {
    /// Without Shift, in the middle.
    fn from(tap: Tap) -> Self {
        Self { tap, shift: false, cursor: DVec2::splat(0.5) }
    }
}

impl Tap {
    /// Whether it changes what the camera sees.
    #[must_use]
    pub fn moves_camera(self) -> bool {
        self.changes_free_camera()
            || matches!(self, Self::ResetCamera | Self::PreviousCamera | Self::NextCamera)
    }

    /// Whether it is for the editor.
    #[must_use]
    pub fn edits(self) -> bool {
        matches!(
            self,
            Self::Select
                | Self::SelectParent
                | Self::PreviousThing
                | Self::NextThing
                | Self::Escape
                | Self::PreviousRow
                | Self::NextRow
                | Self::Less
                | Self::More
                | Self::Hide
                | Self::Duplicate
                | Self::Undo
                | Self::Redo
                | Self::SaveEdits
        )
    }

    /// Whether it changes the camera that the user flies, so that there must be one.
    #[must_use]
    pub fn changes_free_camera(self) -> bool {
        matches!(
            self,
            Self::FrameAll
                | Self::View(_)
                | Self::Orthographic
                | Self::OpenLens
                | Self::CloseLens
                | Self::Recall(_)
        )
    }
}

/// Longest time that one frame may move the camera by, seconds: after a hitch one does not find
/// oneself on the other side of the scene.
const LONGEST_STEP: f64 = 0.1;

/// What the user did since the last frame. Systems of `FrameSystems::Input` read it.
#[derive(Resource, Clone, Debug)]
pub struct Input {
    held: [bool; Hold::COUNT],
    seconds: [f64; Hold::COUNT],
    since: Instant,
    /// Mouse motion to the right and down, pixels, by [`Drag`].
    pub dragged: [DVec2; 4],
    /// Wheel notches, for the speed.
    pub wheel: f64,
    /// Wheel notches, toward the pivot.
    pub dolly: f64,
    /// Key presses.
    pub taps: Vec<Press>,
    /// New values for the selected thing.
    pub edits: Vec<(Property, f64)>,
    /// Two corners of what alone is to be refined.
    pub region: Option<[DVec2; 2]>,
    /// New size of the picture.
    pub resize: Option<UVec2>,
}

impl Input {
    /// Nothing is held at `now`.
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self {
            held: [false; Hold::COUNT],
            seconds: [0.0; Hold::COUNT],
            since: now,
            dragged: [DVec2::ZERO; 4],
            wheel: 0.0,
            dolly: 0.0,
            taps: Vec::new(),
            edits: Vec::new(),
            region: None,
            resize: None,
        }
    }

    /// Takes note of `command`. Returns when the user asked for another view, if that is what it does.
    pub fn apply(&mut self, command: &Command) -> Option<Instant> {
        match *command {
            Command::Held { held, at } => {
                let pressed = held.iter().zip(self.held).any(|(&now, before)| now && !before);
                self.hold_until(at);
                self.held = held;
                (pressed && self.is_moving()).then_some(at)
            }
            Command::Drag { drag, pixels, at } => {
                self.dragged[drag as usize] += pixels;
                Some(at)
            }
            Command::Wheel { notches, dolly, at } => {
                *(if dolly { &mut self.dolly } else { &mut self.wheel }) += notches;
                dolly.then_some(at)
            }
            Command::Tap { press, at } => {
                self.taps.push(press);
                press.tap.moves_camera().then_some(at)
            }
            Command::Edit { property, value, at } => {
                self.edits.push((property, value));
                Some(at)
            }
            Command::Resize(size) => {
                self.resize = Some(size);
                None
            }
            Command::Region(corners) => {
                self.region = Some(corners);
                None
            }
            Command::Open(_) | Command::FilesChanged | Command::Quit => None,
        }
    }

    /// Adds the time until `now` to the keys that are down.
    ///
    /// Time is counted from event to event, so a tap between two frames is not lost, and motion does
    /// not depend on when frames happen.
    pub fn hold_until(&mut self, now: Instant) {
        let step = now.saturating_duration_since(self.since).as_secs_f64();
        for (seconds, _) in self.seconds.iter_mut().zip(self.held).filter(|(_, held)| *held) {
            *seconds = (*seconds + step).min(LONGEST_STEP);
        }
        self.since = self.since.max(now);
    }

    /// Forgets what has been done with; what is held stays held.
    pub fn end_frame(&mut self) {
        self.seconds = [0.0; Hold::COUNT];
        self.dragged = [DVec2::ZERO; 4];
        self.wheel = 0.0;
        self.dolly = 0.0;
        self.taps.clear();
        self.edits.clear();
        self.region = None;
        self.resize = None;
    }

    /// How long `key` was down since the last frame, seconds in 0..=0.1.
    #[must_use]
    pub fn seconds(&self, key: Hold) -> f64 {
        self.seconds[key as usize]
    }

    /// Whether the camera was moved or turned since the last frame.
    #[must_use]
    pub fn has_motion(&self) -> bool {
        self.dolly != 0.0
            || self.dragged.iter().any(|&pixels| pixels != DVec2::ZERO)
            || self.seconds[..Hold::Fast as usize].iter().any(|&s| s > 0.0)
    }

    /// Mouse motion to the right and down, pixels.
    #[must_use]
    pub fn dragged(&self, drag: Drag) -> DVec2 {
        self.dragged[drag as usize]
    }

    /// Seconds of `plus` less seconds of `minus`.
    #[must_use]
    pub fn axis(&self, plus: Hold, minus: Hold) -> f64 {
        self.seconds(plus) - self.seconds(minus)
    }

    /// Whether `key` is down, or was for a moment since the last frame.
    #[must_use]
    pub fn is_held(&self, key: Hold) -> bool {
        self.held[key as usize] || self.seconds(key) > 0.0
    }

    /// Whether a key that moves or turns the camera is down.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        self.held[..Hold::Fast as usize].iter().any(|&held| held)
    }

    /// How often `tap` was pressed since the last frame.
    #[must_use]
    pub fn count(&self, tap: Tap) -> usize {
        self.taps.iter().filter(|press| press.tap == tap).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn only(key: Hold) -> [bool; Hold::COUNT] {
        let mut held = [false; Hold::COUNT];
        held[key as usize] = true;
        held
    }

    #[test]
    fn a_tap_between_two_frames_counts_for_as_long_as_it_lasted() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut input = Input::new(start);
        assert_eq!(input.apply(&Command::Held { held: only(Hold::Forward), at: at(500) }), Some(at(500)));
        assert_eq!(input.apply(&Command::Held { held: [false; Hold::COUNT], at: at(520) }), None);
        input.hold_until(at(700));
        assert!((input.seconds(Hold::Forward) - 0.020).abs() < 1e-9);
        assert!(!input.is_moving());
        input.end_frame();
        assert_eq!(input.seconds(Hold::Forward), 0.0);
    }

    #[test]
    fn a_hitch_moves_by_a_tenth_of_a_second_at_most() {
        let start = Instant::now();
        let mut input = Input::new(start);
        input.apply(&Command::Held { held: only(Hold::Back), at: start });
        input.hold_until(start + Duration::from_secs(5));
        assert_eq!(input.seconds(Hold::Back), LONGEST_STEP);
    }
}
