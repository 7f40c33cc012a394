//! A line to type the name of a file into, which completes it.

use super::card;
use super::style::{ACCENT, BRIGHT, FAINT};
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
    /// What it could become.
    names: Vec<String>,
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
        let mut prompt = Self { text: text.to_owned(), names: Vec::new() };
        prompt.look();
        prompt
    }

    /// A key was pressed.
    pub fn key(&mut self, code: KeyCode, text: Option<&str>) -> Typed {
        match code {
            KeyCode::Escape => return Typed::Nothing,
            KeyCode::Enter | KeyCode::NumpadEnter if self.text.is_empty() => return Typed::Nothing,
            // Into a folder.
            KeyCode::Enter | KeyCode::NumpadEnter if Path::new(&at_home(&self.text)).is_dir() => {
                if !self.text.ends_with(std::path::is_separator) {
                    self.text.push('/');
                }
            }
            KeyCode::Enter | KeyCode::NumpadEnter => return Typed::Open(PathBuf::from(at_home(&self.text))),
            KeyCode::Backspace => drop(self.text.pop()),
            KeyCode::Tab => self.complete(),
            _ => self.text.extend(text.unwrap_or("").chars().filter(|c| !c.is_control())),
        }
        self.look();
        Typed::On
    }

    /// Adds what all names have in common.
    fn complete(&mut self) {
        let Some(first) = self.names.first() else { return };
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
            RichText::new("open a scene or a sky (Tab completes, Enter opens, Esc closes)")
                .color(FAINT)
                .small(),
        );
        ui.label(RichText::new(format!("{}_", prompt.text)).font(FontId::monospace(14.0)).color(ACCENT));
        for name in prompt.names.iter().take(MOST_NAMES) {
            ui.label(RichText::new(name).font(FontId::monospace(11.0)).color(BRIGHT));
        }
        if prompt.names.len() > MOST_NAMES {
            let more = format!("and {} more", prompt.names.len() - MOST_NAMES);
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
        assert_eq!(prompt.key(KeyCode::KeyR, Some("r")), Typed::On);
        prompt.key(KeyCode::Tab, Some("\t"));
        assert!(prompt.text.ends_with("/room_"), "{prompt:?}");
        prompt.key(KeyCode::KeyB, Some("b"));
        prompt.key(KeyCode::Tab, None);
        assert_eq!(prompt.key(KeyCode::Enter, Some("\r")), Typed::Open(folder.join("room_b.obj")));
        for _ in 0.."room_b.obj".len() {
            prompt.key(KeyCode::Backspace, None);
        }
        prompt.key(KeyCode::KeyM, Some("m"));
        prompt.key(KeyCode::Tab, None);
        assert_eq!(prompt.names, ["sky.hdr"], "into the folder");
        assert_eq!(prompt.key(KeyCode::Escape, None), Typed::Nothing);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(Prompt::default().key(KeyCode::Enter, None), Typed::Nothing);
        // Where scenes are compiled in, and the user's own folder.
        assert!(Prompt::new("corn").names.iter().any(|name| name == "cornell"));
        if let Ok(home) = std::env::var("HOME") {
            let typed = Prompt::new("~/a.glb").key(KeyCode::Enter, None);
            assert_eq!(typed, Typed::Open(Path::new(&home).join("a.glb")));
        }
        assert_eq!(at_home("a~/b"), "a~/b");
    }
}
