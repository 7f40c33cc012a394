//! What the keys do: the one table that dispatches them and that the help is printed from.

use winit::keyboard::KeyCode;

/// Something that lasts as long as its key is down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// Move along the line of sight.
    Forward,
    /// Move against the line of sight.
    Back,
    /// Move to the left.
    Left,
    /// Move to the right.
    Right,
    /// Move along the world's +Y.
    Up,
    /// Move along the world's −Y.
    Down,
    /// Turn to the left.
    LookLeft,
    /// Turn to the right.
    LookRight,
    /// Turn upwards.
    LookUp,
    /// Turn downwards.
    LookDown,
    /// Move faster; coarser steps of other keys.
    Fast,
    /// Move slower.
    Slow,
    /// The other meaning of another key.
    Control,
}

impl Hold {
    /// How many there are.
    pub const COUNT: usize = Self::Control as usize + 1;
}

/// Something that happens once per key press.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tap {
    /// Multiply the base speed.
    Faster,
    /// Divide the base speed.
    Slower,
    /// Back to the camera that the window opened with.
    ResetCamera,
    /// The file's previous camera.
    PreviousCamera,
    /// The file's next camera.
    NextCamera,
    /// Print the camera as command line flags.
    PrintCamera,
    /// Stop refining, or go on.
    Pause,
    /// Throw away all samples.
    Restart,
    /// Exposure down.
    Darker,
    /// Exposure up.
    Brighter,
    /// Next tone map.
    ToneMap,
    /// Next texture filter.
    Filter,
    /// Next integrator.
    Integrator,
    /// Next level of detail of the status lines.
    HudLevel,
    /// Show or hide the help.
    Help,
    /// Full screen or window.
    FullScreen,
    /// Save what the window shows.
    ScreenshotWithHud,
    /// Save the picture alone.
    Screenshot,
    /// Close the help.
    Escape,
    /// End the program.
    Quit,
}

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// While it is down.
    Hold(Hold),
    /// Once per press.
    Tap(Tap),
}

/// One meaning of one or more keys.
#[derive(Clone, Copy, Debug)]
pub struct Binding {
    /// Physical keys, by their place on a US keyboard; each of them will do.
    pub codes: &'static [KeyCode],
    /// Whether a control key must be down (and if not, it must be up).
    pub control: bool,
    /// What happens.
    pub action: Action,
    /// Whether it happens again when the keyboard repeats.
    pub repeats: bool,
    /// The keys as the help names them. Empty: described by an earlier row.
    pub keys: &'static str,
    /// What happens, as the help says it.
    pub text: &'static str,
}

const fn hold(codes: &'static [KeyCode], hold: Hold, keys: &'static str, text: &'static str) -> Binding {
    Binding { codes, control: false, action: Action::Hold(hold), repeats: false, keys, text }
}

const fn tap(codes: &'static [KeyCode], tap: Tap, keys: &'static str, text: &'static str) -> Binding {
    Binding { codes, control: false, action: Action::Tap(tap), repeats: false, keys, text }
}

const fn again(binding: Binding) -> Binding {
    Binding { repeats: true, ..binding }
}

const fn with_control(binding: Binding) -> Binding {
    Binding { control: true, ..binding }
}

use KeyCode::{
    AltLeft, AltRight, ArrowDown, ArrowLeft, ArrowRight, ArrowUp, BracketLeft, BracketRight, Comma,
    ControlLeft, ControlRight, Enter, Equal, Escape, F11, F12, KeyA, KeyC, KeyD, KeyE, KeyH, KeyI, KeyN,
    KeyQ, KeyR, KeyS, KeyT, KeyW, KeyZ, Minus, NumpadAdd, NumpadEnter, NumpadSubtract, PageDown, PageUp,
    Period, ShiftLeft, ShiftRight, Slash, Space,
};

/// All keys, in the order of the help. `*` in a text marks what restarts the accumulation.
pub const KEYMAP: &[Binding] = &[
    hold(&[KeyW], Hold::Forward, "W A S D", "move forward, left, back, right *"),
    hold(&[KeyA], Hold::Left, "", ""),
    hold(&[KeyS], Hold::Back, "", ""),
    hold(&[KeyD], Hold::Right, "", ""),
    hold(&[KeyE, PageUp], Hold::Up, "E / Q", "move up / down (also PageUp / PageDown) *"),
    hold(&[KeyQ, PageDown], Hold::Down, "", ""),
    hold(&[ShiftLeft, ShiftRight], Hold::Fast, "Shift / Alt", "hold: 4 times faster / slower"),
    hold(&[AltLeft, AltRight], Hold::Slow, "", ""),
    hold(&[ControlLeft, ControlRight], Hold::Control, "", ""),
    again(tap(&[Equal, NumpadAdd], Tap::Faster, "+ / - / wheel", "base speed")),
    again(tap(&[Minus, NumpadSubtract], Tap::Slower, "", "")),
    hold(&[ArrowLeft], Hold::LookLeft, "arrows", "look (or drag with the right mouse button) *"),
    hold(&[ArrowRight], Hold::LookRight, "", ""),
    hold(&[ArrowUp], Hold::LookUp, "", ""),
    hold(&[ArrowDown], Hold::LookDown, "", ""),
    tap(&[Enter, NumpadEnter], Tap::ResetCamera, "Enter", "back to the first camera *"),
    tap(&[BracketLeft], Tap::PreviousCamera, "[ / ]", "previous / next camera of the file *"),
    tap(&[BracketRight], Tap::NextCamera, "", ""),
    tap(&[KeyC], Tap::PrintCamera, "C", "print the camera as command line flags"),
    tap(&[Space], Tap::Pause, "Space", "pause / resume"),
    tap(&[KeyR], Tap::Restart, "R", "restart the accumulation *"),
    again(tap(&[Comma], Tap::Darker, ", / .", "exposure -/+ 1/3 EV (with Shift 1 EV)")),
    again(tap(&[Period], Tap::Brighter, "", "")),
    tap(&[KeyT], Tap::ToneMap, "T", "tone map: clip, neutral"),
    tap(&[KeyN], Tap::Filter, "N", "texture filter: file's, nearest, bilinear *"),
    tap(&[KeyI], Tap::Integrator, "I", "integrator: direct, path *"),
    tap(&[KeyZ], Tap::HudLevel, "Z", "status lines: none, short, long"),
    tap(&[KeyH, Slash], Tap::Help, "H or ?", "this help"),
    tap(&[F11], Tap::FullScreen, "F11", "full screen"),
    tap(&[F12], Tap::ScreenshotWithHud, "F12", "save a screenshot (with Ctrl: without text)"),
    with_control(tap(&[F12], Tap::Screenshot, "", "")),
    tap(&[Escape], Tap::Escape, "Esc", "close the help"),
    with_control(tap(&[KeyQ], Tap::Quit, "Ctrl+Q", "quit")),
];

/// The row of `code`, given whether a control key is down.
///
/// Shift, Alt and Control themselves mean the same with and without Control.
#[must_use]
pub fn lookup(code: KeyCode, control: bool) -> Option<&'static Binding> {
    KEYMAP.iter().find(|b| b.codes.contains(&code) && (b.control == control || is_modifier(b.action)))
}

/// Whether `action` only modifies others.
#[must_use]
pub fn is_modifier(action: Action) -> bool {
    matches!(action, Action::Hold(Hold::Fast | Hold::Slow | Hold::Control))
}

/// The rows of the help: keys and what they do.
pub fn help() -> impl Iterator<Item = (&'static str, &'static str)> {
    KEYMAP.iter().filter(|b| !b.keys.is_empty()).map(|b| (b.keys, b.text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_means_two_things() {
        let mut seen: Vec<(KeyCode, bool)> = Vec::new();
        for binding in KEYMAP {
            for &code in binding.codes {
                assert!(!seen.contains(&(code, binding.control)), "{code:?} is bound twice");
                seen.push((code, binding.control));
            }
        }
    }

    #[test]
    fn every_row_is_described_by_itself_or_by_a_row_above() {
        assert!(!KEYMAP[0].keys.is_empty());
        for binding in KEYMAP {
            assert_eq!(binding.keys.is_empty(), binding.text.is_empty(), "{:?}", binding.action);
        }
        assert!(help().count() > 15);
    }

    #[test]
    fn control_changes_the_meaning_of_a_letter_but_not_of_shift() {
        assert_eq!(lookup(KeyQ, false).unwrap().action, Action::Hold(Hold::Down));
        assert_eq!(lookup(KeyQ, true).unwrap().action, Action::Tap(Tap::Quit));
        assert!(lookup(KeyW, true).is_none(), "Ctrl+W must not fly");
        assert_eq!(lookup(ShiftLeft, true).unwrap().action, Action::Hold(Hold::Fast));
    }

    #[test]
    fn the_help_fits_the_fonts() {
        for (keys, text) in help() {
            assert!(keys.is_ascii() && text.is_ascii(), "{keys}: {text}");
        }
    }
}
