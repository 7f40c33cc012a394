//! All that keys do, in the order of the help.

use super::{Action, Entry, Hold, Row, Section, Side, Tap};

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
            row(
                "pivot and sharpness to the point under the cursor (with a lens *)",
                &[tap("focus", Tap::Focus, &["F"])],
            ),
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
            row("play the animations, or stop *", &[tap("play", Tap::Play, &["Ctrl+Space"])]),
            row(
                "their picture before, after *",
                &[
                    again("step_back", Tap::StepBack, &["Ctrl+Comma"]),
                    again("step_on", Tap::StepOn, &["Ctrl+Period"]),
                ],
            ),
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
            row("that one left of the cursor, this one right", &[tap("split", Tap::Split, &["Shift+K"])]),
            row("keep this picture to compare with", &[tap("keep", Tap::Keep, &["Ctrl+K"])]),
            row(
                "compare with the reference / the kept picture",
                &[tap("other_side", Tap::OtherSide, &["Ctrl+Shift+K"])],
            ),
            row("keep old samples while moving, or not", &[tap("keep_samples", Tap::KeepSamples, &["Y"])]),
            row("smooth the first second, or not", &[tap("smooth", Tap::Smooth, &["U"])]),
            row(
                "refine only here (Ctrl+drag; Shift: another size), or all again",
                &[tap("crop", Tap::Crop, &["J"])],
            ),
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
            row("what it moves with", &[tap("select_parent", Tap::SelectParent, &["Shift+M"])]),
            row(
                "thing before, after; lights first (Shift: ten)",
                &[
                    again("previous_thing", Tap::PreviousThing, &["Ctrl+PageUp"]),
                    again("next_thing", Tap::NextThing, &["Ctrl+PageDown", "Ctrl+M"]),
                ],
            ),
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
            row("hide, show, with all below *", &[tap("hide", Tap::Hide, &["Delete"])]),
            row("duplicate *", &[tap("duplicate", Tap::Duplicate, &["Ctrl+D"])]),
            row(
                "undo, do again *",
                &[
                    again("undo", Tap::Undo, &["Backspace", "Ctrl+Z"]),
                    again("redo", Tap::Redo, &["Ctrl+Y", "Ctrl+Shift+Z"]),
                ],
            ),
            row("save the edits as a settings file", &[tap("save_edits", Tap::SaveEdits, &["Ctrl+E"])]),
        ],
    ),
    (
        "Window",
        &[
            row("noise over time", &[tap("graph", Tap::Graph, &["G"])]),
            row("what loading has found", &[tap("report", Tap::Report, &["L"])]),
            row("status: none, short, long, all", &[tap("hud", Tap::HudLevel, &["Z"])]),
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
            row("open another scene (or drop it here)", &[tap("open", Tap::Open, &["Ctrl+O"])]),
            row("load the scene again (it is when a file changes) *", &[tap("reload", Tap::Reload, &["F5"])]),
            row("let the mouse go, close what is open", &[tap("escape", Tap::Escape, &["Escape"])]),
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
pub(super) const CONTROL: Entry = hold("control", Hold::Control, &["ControlLeft", "ControlRight"]);
