//! A line to type the name of a file into, which completes it.

use super::card;
use super::glyphs::legible;
use super::style::{ACCENT, BRIGHT, CAUTION, FAINT};
use crate::load::built_in_scenes;
use egui::{Align2, Context, FontId, RichText, vec2};
use std::path::{Path, PathBuf};
use winit::keyboard::KeyCode;

/// Endings of what can be opened.
const ENDINGS: [&str; 6] = ["gltf", "glb", "obj", "toml", "hdr", "exr"];
/// Names that are shown below the line.
const MOST_NAMES: usize = 8;

/// What has been typed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Prompt {
    text: String,
    /// Where the next letter goes, in bytes.
    cursor: usize,
    /// What it could become.
    names: Vec<String>,
    /// Which of these the arrows went to.
    chosen: Option<usize>,
    /// All of it is selected: the next letter takes its place.
    selected: bool,
    /// Why the last key came to nothing.
    said: String,
}

/// What a key did to the line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Typed {
    /// It goes on.
    On,
    /// Open this.
    Open(PathBuf),
    /// Never mind.
    Nothing,
}

impl Prompt {
    /// A line that begins with `text`.
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut prompt = Self { text: text.to_owned(), cursor: text.len(), ..Self::default() };
        prompt.look();
        prompt
    }

    /// The same line, of which nothing came because of `why`.
    #[must_use]
    pub fn failed(mut self, why: &str) -> Self {
        why.clone_into(&mut self.said);
        // What is there may be another by now.
        self.look();
        self
    }

    /// A key was pressed, Ctrl being down or not.
    pub fn key(&mut self, code: KeyCode, text: Option<&str>, control: bool) -> Typed {
        self.said.clear();
        match code {
            KeyCode::ArrowDown => return self.choose(1),
            KeyCode::ArrowUp => return self.choose(-1),
            KeyCode::Escape if self.chosen.is_some() => {
                self.chosen = None;
                return Typed::On;
            }
            KeyCode::Enter | KeyCode::NumpadEnter | KeyCode::Tab | KeyCode::ArrowRight => self.take_chosen(),
            _ => {}
        }
        if std::mem::take(&mut self.selected) {
            let types = text.is_some_and(|text| !text.chars().all(char::is_control));
            if matches!(code, KeyCode::Backspace | KeyCode::Delete) || types {
                self.remove(0, self.text.len());
            }
        }
        match code {
            KeyCode::Escape => return Typed::Nothing,
            KeyCode::Enter | KeyCode::NumpadEnter if self.text.is_empty() => return Typed::Nothing,
            // Into a folder.
            KeyCode::Enter | KeyCode::NumpadEnter if Path::new(&at_home(&self.text)).is_dir() => {
                if !self.text.ends_with(std::path::is_separator) {
                    self.text.push('/');
                }
                self.cursor = self.text.len();
            }
            KeyCode::Enter | KeyCode::NumpadEnter => return Typed::Open(PathBuf::from(at_home(&self.text))),
            KeyCode::Tab => self.complete(),
            KeyCode::KeyU if control => self.remove(0, self.cursor),
            KeyCode::Backspace if control => self.remove(self.word_before(), self.cursor),
            KeyCode::Backspace => self.remove(self.before(), self.cursor),
            KeyCode::Delete => self.remove(self.cursor, self.after()),
            KeyCode::ArrowLeft if control => self.cursor = self.word_before(),
            KeyCode::ArrowLeft => self.cursor = self.before(),
            KeyCode::ArrowRight => self.cursor = self.after(),
            KeyCode::Home => self.cursor = 0,
            KeyCode::KeyA if control => (self.selected, self.cursor) = (true, self.text.len()),
            KeyCode::End => self.cursor = self.text.len(),
            KeyCode::KeyE if control => self.cursor = self.text.len(),
            _ => self.insert(text.unwrap_or("")),
        }
        self.look();
        Typed::On
    }

    /// Goes down the names, or up; above the first is the line itself.
    fn choose(&mut self, by: isize) -> Typed {
        let last = self.names.len().checked_sub(1);
        self.chosen = match (self.chosen, by) {
            (None, 1..) => last.and(Some(0)),
            (None, _) => last,
            (Some(here), _) => here.checked_add_signed(by).map(|next| next.min(last.unwrap_or(0))),
        };
        Typed::On
    }

    /// What the arrows went to stands in the line.
    fn take_chosen(&mut self) {
        if let Some(name) = self.chosen.and_then(|chosen| self.names.get(chosen)) {
            self.text = format!("{}{name}", self.parts().0);
            self.cursor = self.text.len();
        }
    }

    fn remove(&mut self, from: usize, to: usize) {
        self.text.replace_range(from..to, "");
        self.cursor = from;
    }

    /// Where the letter before the cursor begins.
    fn before(&self) -> usize {
        self.text[..self.cursor].char_indices().next_back().map_or(0, |(at, _)| at)
    }

    /// Where the letter after the cursor ends.
    fn after(&self) -> usize {
        self.text[self.cursor..].chars().next().map_or(self.cursor, |letter| self.cursor + letter.len_utf8())
    }

    /// Where the name of a file or folder before the cursor begins.
    fn word_before(&self) -> usize {
        let before = self.text[..self.cursor].trim_end_matches(std::path::is_separator);
        before.rfind(std::path::is_separator).map_or(0, |at| at + 1)
    }

    /// Types `text`. A path that begins anew in the middle of the line, with `//` or `/~`, takes the place of what stands
    /// before it: nobody has to delete a folder first.
    fn insert(&mut self, text: &str) {
        let typed: String = text.chars().filter(|c| !c.is_control()).collect();
        self.text.insert_str(self.cursor, &typed);
        self.cursor += typed.len();
        let anew = ["//", "/~"].into_iter().filter_map(|begin| self.text[..self.cursor].rfind(begin)).max();
        if let Some(at) = anew {
            self.text.replace_range(..=at, "");
            self.cursor -= at + 1;
        }
    }

    /// Adds what all names have in common.
    fn complete(&mut self) {
        let Some(first) = self.names.first() else {
            "nothing here begins like that".clone_into(&mut self.said);
            return;
        };
        let mut common = first.as_str();
        for name in &self.names {
            let same = common.char_indices().zip(name.chars()).take_while(|((_, a), b)| a == b);
            let end = same.last().map_or(0, |((at, a), _)| at + a.len_utf8());
            common = &common[..end];
        }
        let (folder, typed) = self.parts();
        if common.len() > typed.len() {
            self.text = format!("{folder}{common}");
        }
        self.cursor = self.text.len();
    }

    /// The folder, with its end, and the beginning of a name in it.
    fn parts(&self) -> (&str, &str) {
        let end = self.text.rfind(std::path::is_separator).map_or(0, |at| at + 1);
        self.text.split_at(end)
    }

    /// Finds the names that go on as it does.
    fn look(&mut self) {
        let (folder, typed) = self.parts();
        let folder = at_home(folder);
        let here = if folder.is_empty() { Path::new(".") } else { Path::new(&folder) };
        let entries = std::fs::read_dir(here).into_iter().flatten().flatten().take(10_000);
        let mut names: Vec<String> = entries
            .filter_map(|entry| {
                let name = entry.file_name().into_string().ok()?;
                let hidden = name.starts_with('.') && !typed.starts_with('.');
                if hidden || !name.starts_with(typed) {
                    return None;
                }
                if entry.path().is_dir() {
                    return Some(name + "/");
                }
                let ending = Path::new(&name).extension()?.to_str()?.to_lowercase();
                ENDINGS.contains(&ending.as_str()).then_some(name)
            })
            .collect();
        names.sort();
        if folder.is_empty() {
            // Those that need no file.
            names.extend(
                built_in_scenes()
                    .iter()
                    .map(|scene| scene.name)
                    .filter(|name| name.starts_with(typed))
                    .map(str::to_owned),
            );
        }
        self.names = names;
        self.chosen = None;
    }
}

/// `~/` is the user's own folder.
fn at_home(text: &str) -> String {
    let rest = text.strip_prefix('~').filter(|rest| rest.starts_with(std::path::is_separator));
    let home = std::env::var("HOME").or_else(|_| std::env::var("USERPROFILE"));
    match (rest, home) {
        (Some(rest), Ok(home)) => format!("{home}{rest}"),
        _ => text.to_owned(),
    }
}

/// Shows the line and what it could become.
pub fn show(context: &Context, prompt: &Prompt) {
    let place = (Align2::CENTER_TOP, vec2(0.0, context.content_rect().height() * 0.2));
    card(context, "open", place, |ui| {
        ui.set_min_width(context.content_rect().width() * 0.5);
        ui.label(
            RichText::new("open a scene or a sky (Tab completes, arrows choose, Enter opens, Esc closes)")
                .color(FAINT)
                .small(),
        );
        let (before, after) = prompt.text.split_at(prompt.cursor);
        let line = if after.is_empty() { format!("{before}_") } else { format!("{before}|{after}") };
        let line = RichText::new(legible(context, &line)).font(FontId::monospace(14.0)).color(ACCENT);
        ui.label(if prompt.selected { line.background_color(FAINT.gamma_multiply(0.4)) } else { line });
        if !prompt.said.is_empty() {
            ui.label(RichText::new(legible(context, &prompt.said)).color(CAUTION));
        }
        // The chosen one is always among those that are shown.
        let above = prompt.chosen.map_or(0, |chosen| (chosen + 1).saturating_sub(MOST_NAMES));
        for (n, name) in prompt.names.iter().enumerate().skip(above).take(MOST_NAMES) {
            let color = if prompt.chosen == Some(n) { ACCENT } else { BRIGHT };
            ui.label(RichText::new(legible(context, name)).font(FontId::monospace(11.0)).color(color));
        }
        if prompt.names.len() > MOST_NAMES {
            let below = prompt.names.len() - MOST_NAMES - above;
            let more = match (above, below) {
                (0, below) => format!("and {below} more"),
                (above, 0) => format!("and {above} above"),
                (above, below) => format!("and {below} more, {above} above"),
            };
            ui.label(RichText::new(more).color(FAINT).small());
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tab_completes_what_is_common_and_enter_opens_it() {
        let folder = std::env::temp_dir().join(format!("penumbra-prompt-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("models")).unwrap();
        for name in ["room_a.glb", "room_b.obj", "notes.txt", "models/sky.hdr"] {
            std::fs::write(folder.join(name), "").unwrap();
        }
        let mut prompt = Prompt::new(&format!("{}/", folder.display()));
        assert_eq!(prompt.names, ["models/", "room_a.glb", "room_b.obj"], "a text is no scene");
        assert_eq!(prompt.key(KeyCode::KeyR, Some("r"), false), Typed::On);
        prompt.key(KeyCode::Tab, Some("\t"), false);
        assert!(prompt.text.ends_with("/room_"), "{prompt:?}");
        prompt.key(KeyCode::KeyB, Some("b"), false);
        prompt.key(KeyCode::Tab, None, false);
        assert_eq!(prompt.key(KeyCode::Enter, Some("\r"), false), Typed::Open(folder.join("room_b.obj")));
        for _ in 0.."room_b.obj".len() {
            prompt.key(KeyCode::Backspace, None, false);
        }
        prompt.key(KeyCode::KeyM, Some("m"), false);
        prompt.key(KeyCode::Tab, None, false);
        assert_eq!(prompt.names, ["sky.hdr"], "into the folder");
        assert_eq!(prompt.key(KeyCode::Escape, None, false), Typed::Nothing);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(Prompt::default().key(KeyCode::Enter, None, false), Typed::Nothing);
        // Where scenes are compiled in, and the user's own folder.
        assert!(Prompt::new("corn").names.iter().any(|name| name == "cornell"));
        if let Ok(home) = std::env::var("HOME") {
            let typed = Prompt::new("~/a.glb").key(KeyCode::Enter, None, false);
            assert_eq!(typed, Typed::Open(Path::new(&home).join("a.glb")));
        }
        assert_eq!(at_home("a~/b"), "a~/b");
    }

    /// By the arrows alone, without a letter.
    #[test]
    fn arrows_choose_among_the_names() {
        let folder = std::env::temp_dir().join(format!("penumbra-arrows-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("models")).unwrap();
        for name in ["a.glb", "b.obj", "models/c.glb"] {
            std::fs::write(folder.join(name), "").unwrap();
        }
        let mut prompt = Prompt::new(&format!("{}/", folder.display()));
        assert_eq!(prompt.names, ["a.glb", "b.obj", "models/"]);
        let mut press = |code| (prompt.key(code, None, false), prompt.chosen);
        assert_eq!(press(KeyCode::ArrowUp), (Typed::On, Some(2)), "the last");
        assert_eq!(press(KeyCode::ArrowDown).1, Some(2), "no further");
        assert_eq!(press(KeyCode::Escape), (Typed::On, None));
        assert_eq!(press(KeyCode::ArrowDown).1, Some(0));
        assert_eq!(press(KeyCode::ArrowUp).1, None, "back to the line");
        for _ in 0..3 {
            press(KeyCode::ArrowDown);
        }
        assert_eq!(press(KeyCode::Enter), (Typed::On, None), "into the folder");
        press(KeyCode::ArrowDown);
        assert_eq!(press(KeyCode::Enter).0, Typed::Open(folder.join("models/c.glb")));
        press(KeyCode::Backspace);
        assert_eq!(press(KeyCode::ArrowDown).1, Some(0), "what is typed chooses nothing");
        std::fs::remove_dir_all(&folder).unwrap();
        let mut empty = Prompt::new("no such folder/");
        assert_eq!((empty.key(KeyCode::ArrowDown, None, false), empty.chosen), (Typed::On, None));
        assert_eq!((empty.key(KeyCode::ArrowUp, None, false), empty.chosen), (Typed::On, None));
    }

    #[test]
    fn a_line_can_be_changed_anywhere_and_begun_anew() {
        let typed = |start: &str, keys: &[(KeyCode, Option<&str>, bool)]| {
            let mut prompt = Prompt::new(start);
            for &(code, text, control) in keys {
                assert_eq!(prompt.key(code, text, control), Typed::On);
            }
            prompt.text
        };
        let paste = |text| (KeyCode::KeyV, Some(text), true);
        assert_eq!(typed("legocar/", &[paste("/scenes/a.glb")]), "/scenes/a.glb", "an absolute path");
        assert_eq!(typed("legocar/", &[paste("~/a.glb\n")]), "~/a.glb");
        assert_eq!(typed("legocar/", &[paste("a.glb")]), "legocar/a.glb");
        assert_eq!(typed("", &[paste("//a")]), "/a");
        let (back, left) = (KeyCode::Backspace, KeyCode::ArrowLeft);
        assert_eq!(typed("a/b/c.glb", &[(KeyCode::KeyU, Some("\u{15}"), true)]), "");
        assert_eq!(typed("a/b/c.glb", &[(back, None, true)]), "a/b/");
        assert_eq!(typed("a/b/", &[(back, None, true)]), "a/");
        assert_eq!(typed("a/äb", &[(left, None, false), (back, None, false)]), "a/b");
        assert_eq!(typed("ab", &[(KeyCode::Home, None, false), (KeyCode::Delete, None, false)]), "b");
        assert_eq!(typed("ab", &[(left, None, false), paste("c"), paste("d")]), "acdb");
        let all = (KeyCode::KeyA, None, true);
        assert_eq!(typed("a/b.glb", &[all, paste("/c.glb")]), "/c.glb");
        assert_eq!(typed("a/b.glb", &[all, (back, None, false)]), "");
        assert_eq!(typed("ab", &[all, (left, None, false), paste("c")]), "acb", "no longer");
        assert_eq!(typed("", &[(back, None, true), (back, None, false), (KeyCode::Delete, None, false)]), "");
    }

    #[test]
    fn what_came_to_nothing_is_told_until_the_next_key() {
        let mut prompt = Prompt::new("no such folder/x");
        prompt.key(KeyCode::Tab, None, false);
        assert!(!prompt.said.is_empty() && prompt.text == "no such folder/x", "{prompt:?}");
        prompt.key(KeyCode::KeyY, Some("y"), false);
        assert_eq!(prompt.said, "");
        let failed = prompt.clone().failed("no such file");
        assert_eq!((failed.text.as_str(), failed.said.as_str()), ("no such folder/xy", "no such file"));
    }
}
