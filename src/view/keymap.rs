//! What the keys do: the one table that dispatches them, that the help is printed from, and whose names the
//! keys file uses.

use super::chord::{Chord, Letters};
use std::fmt::Write;
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
    /// Show the kept picture.
    Compare,
    /// The other meaning of another key.
    Control,
}

impl Hold {
    /// How many there are.
    pub const COUNT: usize = Self::Control as usize + 1;
}

/// A direction to look along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is the side of the scene that is seen")]
pub enum Side {
    Front,
    Back,
    Right,
    Left,
    Top,
    Bottom,
}

/// Something that happens once per key press.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tap {
    /// Multiply the base speed.
    Faster,
    /// Divide the base speed.
    Slower,
    /// Fly, or turn about the pivot.
    Navigation,
    /// Pivot and focal plane to the point under the cursor.
    Focus,
    /// The whole scene in view.
    FrameAll,
    /// Back to the camera that the window opened with.
    ResetCamera,
    /// The file's previous camera.
    PreviousCamera,
    /// The file's next camera.
    NextCamera,
    /// From one side of the scene.
    View(Side),
    /// Perspective or parallel.
    Orthographic,
    /// A larger lens.
    OpenLens,
    /// A smaller lens, at last none.
    CloseLens,
    /// To a place remembered, 1 to 9.
    Recall(u8),
    /// Remember this place, 1 to 9.
    Remember(u8),
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
    /// Exposure by what is seen.
    AutoExposure,
    /// Next tone map.
    ToneMap,
    /// What the colours stand for.
    PixelView,
    /// Explain the pixel under the cursor, or no pixel any more.
    Pin,
    /// The left mouse button, without a drag.
    Click,
    /// No boxes of the hierarchy, those of a level, those of the leaves.
    Boxes,
    /// Boxes of a higher level.
    LevelUp,
    /// Boxes of a lower level.
    LevelDown,
    /// One box more on the way of the pinned pixel's ray.
    NextStep,
    /// One box fewer.
    PreviousStep,
    /// Near first or priority queue.
    Order,
    /// Edit what is under the cursor.
    Select,
    /// The number above.
    PreviousRow,
    /// The number below.
    NextRow,
    /// Less of it.
    Less,
    /// More of it.
    More,
    /// Leave it out of the picture, or not.
    Hide,
    /// Another one beside it.
    Duplicate,
    /// Take the last edit back.
    Undo,
    /// Keep the edits in a file.
    SaveEdits,
    /// Next texture filter.
    Filter,
    /// Next integrator.
    Integrator,
    /// Show or hide the curve of the noise.
    Graph,
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
    /// Save all that is known of the picture, linear and developed.
    SavePicture,
    /// Load the scene again.
    Reload,
    /// Keep the picture to compare with.
    Keep,
    /// Close what is open.
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

/// One thing that a key can do.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// What the keys file calls it.
    pub name: &'static str,
    /// What happens.
    pub action: Action,
    /// Whether it happens again when the keyboard repeats.
    pub repeats: bool,
    keys: &'static [&'static str],
}

/// A line of the help: things that belong together.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// What they do. `*`: restarts the accumulation.
    pub text: &'static str,
    /// In the order in which the text tells them.
    pub entries: &'static [Entry],
}

/// A heading of the help, and what stands below it.
pub type Section = (&'static str, &'static [Row]);

const fn hold(name: &'static str, hold: Hold, keys: &'static [&'static str]) -> Entry {
    Entry { name, action: Action::Hold(hold), repeats: false, keys }
}

const fn tap(name: &'static str, tap: Tap, keys: &'static [&'static str]) -> Entry {
    Entry { name, action: Action::Tap(tap), repeats: false, keys }
}

const fn again(name: &'static str, tap: Tap, keys: &'static [&'static str]) -> Entry {
    Entry { repeats: true, ..self::tap(name, tap, keys) }
}

const fn row(text: &'static str, entries: &'static [Entry]) -> Row {
    Row { text, entries }
}

/// All there is, in the order of the help, with the keys that it is on unless the keys file says otherwise.
pub const TABLE: &[Section] = &[
    (
        "Moving",
        &[
            row(
                "forward, left, back, right *",
                &[
                    hold("forward", Hold::Forward, &["W"]),
                    hold("left", Hold::Left, &["A"]),
                    hold("back", Hold::Back, &["S"]),
                    hold("right", Hold::Right, &["D"]),
                ],
            ),
            row(
                "up, down *",
                &[hold("up", Hold::Up, &["E", "PageUp"]), hold("down", Hold::Down, &["Q", "PageDown"])],
            ),
            row(
                "look (or right mouse button) *",
                &[
                    hold("look_left", Hold::LookLeft, &["ArrowLeft"]),
                    hold("look_right", Hold::LookRight, &["ArrowRight"]),
                    hold("look_up", Hold::LookUp, &["ArrowUp"]),
                    hold("look_down", Hold::LookDown, &["ArrowDown"]),
                ],
            ),
            row(
                "hold: 4 times faster, slower",
                &[
                    hold("fast", Hold::Fast, &["ShiftLeft", "ShiftRight"]),
                    hold("slow", Hold::Slow, &["AltLeft", "AltRight"]),
                ],
            ),
            row(
                "base speed (or wheel)",
                &[
                    again("faster", Tap::Faster, &["Equal", "NumpadAdd"]),
                    again("slower", Tap::Slower, &["Minus", "NumpadSubtract"]),
                ],
            ),
            row(
                "fly / orbit (left button orbits, middle pans, Ctrl+wheel nears)",
                &[tap("navigation", Tap::Navigation, &["Tab"])],
            ),
        ],
    ),
    (
        "Views",
        &[
            row("pivot and sharpness to the point under the cursor", &[tap("focus", Tap::Focus, &["F"])]),
            row("whole scene *", &[tap("frame_all", Tap::FrameAll, &["Home"])]),
            row("first camera *", &[tap("reset_camera", Tap::ResetCamera, &["Enter", "NumpadEnter"])]),
            row(
                "previous, next camera of the file *",
                &[
                    tap("previous_camera", Tap::PreviousCamera, &["BracketLeft"]),
                    tap("next_camera", Tap::NextCamera, &["BracketRight"]),
                ],
            ),
            row(
                "front, right, top *",
                &[
                    tap("front", Tap::View(Side::Front), &["1", "Numpad1"]),
                    tap("right_side", Tap::View(Side::Right), &["3", "Numpad3"]),
                    tap("top", Tap::View(Side::Top), &["7", "Numpad7"]),
                ],
            ),
            row(
                "back, left, bottom *",
                &[
                    tap("back_side", Tap::View(Side::Back), &["Ctrl+1", "Ctrl+Numpad1"]),
                    tap("left_side", Tap::View(Side::Left), &["Ctrl+3", "Ctrl+Numpad3"]),
                    tap("bottom", Tap::View(Side::Bottom), &["Ctrl+7", "Ctrl+Numpad7"]),
                ],
            ),
            row("perspective / orthographic *", &[tap("orthographic", Tap::Orthographic, &["5", "Numpad5"])]),
            row(
                "lens smaller, larger (depth of field) *",
                &[again("close_lens", Tap::CloseLens, &["9"]), again("open_lens", Tap::OpenLens, &["0"])],
            ),
            row("to bookmark 1 ... 9 *", &RECALL),
            row("set bookmark 1 ... 9", &REMEMBER),
            row("copy the camera as command line flags", &[tap("copy_camera", Tap::PrintCamera, &["C"])]),
        ],
    ),
    (
        "Picture",
        &[
            row("pause / resume", &[tap("pause", Tap::Pause, &["Space"])]),
            row("start again *", &[tap("restart", Tap::Restart, &["R"])]),
            row(
                "exposure -, + 1/3 EV (Shift: 1 EV)",
                &[again("darker", Tap::Darker, &["Comma"]), again("brighter", Tap::Brighter, &["Period"])],
            ),
            row("exposure by what is seen", &[tap("auto_exposure", Tap::AutoExposure, &["X"])]),
            row("tone map (Shift: back)", &[tap("tone_map", Tap::ToneMap, &["T"])]),
            row(
                "show noise, samples, boxes, triangles, normals ... (Shift: back)",
                &[tap("pixel_view", Tap::PixelView, &["V"])],
            ),
            row("hold: the kept picture, or the reference", &[hold("compare", Hold::Compare, &["K"])]),
            row("keep this picture to compare with", &[tap("keep", Tap::Keep, &["Ctrl+K"])]),
            row("texture filter: file's, nearest, bilinear *", &[tap("filter", Tap::Filter, &["N"])]),
            row("direct light / global illumination *", &[tap("integrator", Tap::Integrator, &["I"])]),
        ],
    ),
    (
        "Understanding",
        &[
            row("rays of the pixel under the cursor (then click others)", &[tap("pin", Tap::Pin, &["P"])]),
            row("boxes of the hierarchy: none, a level, leaves", &[tap("boxes", Tap::Boxes, &["B"])]),
            row(
                "a level up, down",
                &[
                    again("level_up", Tap::LevelUp, &["Ctrl+BracketLeft"]),
                    again("level_down", Tap::LevelDown, &["Ctrl+BracketRight"]),
                ],
            ),
            row(
                "the pixel's ray through the boxes: step back, on",
                &[
                    again("previous_step", Tap::PreviousStep, &["Semicolon"]),
                    again("next_step", Tap::NextStep, &["Quote"]),
                ],
            ),
            row("order: near first, priority queue", &[tap("order", Tap::Order, &["O"])]),
        ],
    ),
    (
        "Editing",
        &[
            row("select what is under the cursor", &[tap("select", Tap::Select, &["M"])]),
            row(
                "number above, below",
                &[
                    again("previous_row", Tap::PreviousRow, &["Ctrl+ArrowUp"]),
                    again("next_row", Tap::NextRow, &["Ctrl+ArrowDown"]),
                ],
            ),
            row(
                "less, more of it (Shift: ten times) *",
                &[
                    again("less", Tap::Less, &["Ctrl+ArrowLeft"]),
                    again("more", Tap::More, &["Ctrl+ArrowRight"]),
                ],
            ),
            row("hide, show *", &[tap("hide", Tap::Hide, &["Delete"])]),
            row("duplicate *", &[tap("duplicate", Tap::Duplicate, &["Ctrl+D"])]),
            row("undo *", &[again("undo", Tap::Undo, &["Backspace", "Ctrl+Z"])]),
            row("save the edits as a settings file", &[tap("save_edits", Tap::SaveEdits, &["Ctrl+E"])]),
        ],
    ),
    (
        "Window",
        &[
            row("noise over time", &[tap("graph", Tap::Graph, &["G"])]),
            row("status: none, short, long", &[tap("hud", Tap::HudLevel, &["Z"])]),
            row("this help", &[tap("help", Tap::Help, &["H", "Slash"])]),
            row("full screen", &[tap("full_screen", Tap::FullScreen, &["F11"])]),
            row(
                "screenshot with, without text",
                &[
                    tap("screenshot", Tap::ScreenshotWithHud, &["F12"]),
                    tap("screenshot_picture", Tap::Screenshot, &["Ctrl+F12"]),
                ],
            ),
            row("save the picture as .exr and .png", &[tap("save", Tap::SavePicture, &["Ctrl+S"])]),
            row("load the scene again (it is when a file changes)", &[tap("reload", Tap::Reload, &["F5"])]),
            row("close what is open", &[tap("escape", Tap::Escape, &["Escape"])]),
            row("quit", &[tap("quit", Tap::Quit, &["Ctrl+Q"])]),
        ],
    ),
];

macro_rules! numbered {
    ($tap:ident, $name:literal, $keys:literal, [$($n:literal),*]) => {
        [$(tap(concat!($name, $n), Tap::$tap($n), &[concat!($keys, $n)])),*]
    };
}
const RECALL: [Entry; 9] = numbered!(Recall, "bookmark_", "Shift+", [1, 2, 3, 4, 5, 6, 7, 8, 9]);
const REMEMBER: [Entry; 9] = numbered!(Remember, "set_bookmark_", "Ctrl+Shift+", [1, 2, 3, 4, 5, 6, 7, 8, 9]);

/// The modifier keys, which are no use on other places.
const CONTROL: Entry = hold("control", Hold::Control, &["ControlLeft", "ControlRight"]);

/// Which keys do what.
#[derive(Clone, Debug)]
pub struct Keymap(Vec<(Entry, Vec<Chord>)>);

impl Default for Keymap {
    fn default() -> Self {
        let bound = entries().chain([CONTROL]).map(|entry| {
            // A test holds that they all can be read.
            let chords = entry.keys.iter().filter_map(|keys| Chord::parse(keys).ok()).collect();
            (entry, chords)
        });
        Self(bound.collect())
    }
}

/// Everything in the table.
pub fn entries() -> impl Iterator<Item = Entry> {
    TABLE.iter().flat_map(|(_, rows)| *rows).flat_map(|row| row.entries).copied()
}

impl Keymap {
    /// Puts what is called `name` on `chords` instead of its keys; false if there is no such thing.
    pub(super) fn bind(&mut self, name: &str, chords: Vec<Chord>) -> bool {
        let found = self.0.iter_mut().find(|(entry, _)| entry.name == name);
        found.map(|(_, old)| *old = chords).is_some()
    }

    /// Two things on one key, and the key.
    pub(super) fn conflict(&self) -> Option<(&'static str, &'static str, Chord)> {
        let mut seen: Vec<(Chord, &'static str)> = Vec::new();
        for (entry, chords) in &self.0 {
            for &chord in chords {
                if let Some((_, other)) = seen.iter().find(|(known, _)| *known == chord) {
                    return Some((other, entry.name, chord));
                }
                seen.push((chord, entry.name));
            }
        }
        None
    }

    /// What `code` does, given whether control and shift are down.
    ///
    /// The modifiers themselves mean the same with and without others. A key that is bound together with
    /// Shift means something else then; others do the same, in larger steps or backwards.
    #[must_use]
    pub fn lookup(&self, code: KeyCode, control: bool, shift: bool) -> Option<Entry> {
        let found = |shift: bool| {
            self.0.iter().find(|(entry, chords)| {
                chords.iter().any(|chord| {
                    chord.code == code
                        && (is_modifier(entry.action) || chord.control == control && chord.shift == shift)
                })
            })
        };
        found(shift).or_else(|| found(false)).map(|(entry, _)| *entry)
    }

    /// The keys of a row of the help, as the user's keyboard names them.
    #[must_use]
    pub fn keys_of(&self, row: &Row, letters: &Letters) -> String {
        let of = |entry: &Entry| {
            let (_, chords) = self.0.iter().find(|(known, _)| known.name == entry.name)?;
            chords.first().map(|chord| chord.label(letters))
        };
        let names: Vec<String> = row.entries.iter().filter_map(of).collect();
        // Nine alike are told by the first and the last.
        match names.as_slice() {
            [first, .., last] if names.len() > 4 => {
                let digit = last.rsplit('+').next().unwrap_or(last);
                format!("{first} ... {digit}")
            }
            _ => names.join(" "),
        }
    }

    /// The whole help as plain text.
    #[must_use]
    pub fn text(&self, letters: &Letters) -> String {
        let mut text = String::new();
        for (title, rows) in TABLE {
            let _ = writeln!(text, "{title}");
            for row in *rows {
                let _ = writeln!(text, "  {:<28} {}", self.keys_of(row, letters), row.text);
            }
        }
        text
    }
}

/// Whether `action` only modifies others.
#[must_use]
pub fn is_modifier(action: Action) -> bool {
    matches!(action, Action::Hold(Hold::Fast | Hold::Slow | Hold::Control))
}

#[cfg(test)]
mod tests {
    use super::*;
    use KeyCode::{Digit1, KeyQ, KeyT, KeyW, ShiftLeft};

    fn action(code: KeyCode, control: bool, shift: bool) -> Option<Action> {
        Keymap::default().lookup(code, control, shift).map(|entry| entry.action)
    }

    #[test]
    fn no_key_means_two_things_and_all_can_be_read() {
        assert_eq!(Keymap::default().conflict(), None);
        for entry in entries() {
            assert!(!entry.keys.is_empty(), "{}", entry.name);
            for keys in entry.keys {
                Chord::parse(keys).unwrap();
            }
        }
    }

    #[test]
    fn names_are_unique() {
        let mut names: Vec<&str> = entries().map(|entry| entry.name).collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }

    #[test]
    fn control_changes_the_meaning_of_a_letter_but_not_of_shift() {
        assert_eq!(action(KeyQ, false, false), Some(Action::Hold(Hold::Down)));
        assert_eq!(action(KeyQ, true, false), Some(Action::Tap(Tap::Quit)));
        assert_eq!(action(KeyW, true, false), None, "Ctrl+W must not fly");
        assert_eq!(action(ShiftLeft, true, false), Some(Action::Hold(Hold::Fast)));
    }

    #[test]
    fn shift_changes_the_meaning_only_where_it_is_bound() {
        assert_eq!(action(Digit1, false, false), Some(Action::Tap(Tap::View(Side::Front))));
        assert_eq!(action(Digit1, false, true), Some(Action::Tap(Tap::Recall(1))));
        assert_eq!(action(Digit1, true, true), Some(Action::Tap(Tap::Remember(1))));
        assert_eq!(action(KeyT, false, true), Some(Action::Tap(Tap::ToneMap)));
        assert_eq!(action(KeyW, false, true), Some(Action::Hold(Hold::Forward)), "Shift flies faster");
    }

    #[test]
    fn the_help_names_all_keys_and_is_plain() {
        let text = Keymap::default().text(&Letters::default());
        assert!(text.contains("W A S D") && text.contains("Shift+1 ... 9"), "{text}");
        assert!(text.is_ascii());
        assert!(text.lines().count() > 30);
    }
}
