//! The user's own keys: a TOML file of names and keys.
//!
//! ```toml
//! forward = "ArrowUp"              # by place on a US keyboard
//! tone_map = ["M", "Ctrl+T"]       # several; [] for none
//! ```

use super::chord::Chord;
use super::keymap::{Keymap, entries};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use toml::Spanned;

#[derive(Deserialize)]
#[serde(untagged, expecting = "write a key such as \"W\", or several: [\"W\", \"Ctrl+1\"]")]
enum Keys {
    One(String),
    Several(Vec<String>),
}

/// Where the keys file is, unless somebody says another: `penumbra/keys.toml` in the user's folder of settings.
#[must_use]
pub fn default_path() -> Option<PathBuf> {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let home = || set("HOME").map(|home| home.join(".config"));
    let folder = set("XDG_CONFIG_HOME").or_else(|| set("APPDATA")).or_else(home)?;
    Some(folder.join("penumbra").join("keys.toml"))
}

/// The keys that `path` says, or without one those of the user's file, if there is one, on top of the usual ones.
///
/// # Errors
/// One line with the file and the place in it.
pub fn read(path: Option<&Path>) -> Result<Keymap, String> {
    let file = path.map(Path::to_path_buf).or_else(default_path);
    let Some(file) = file else { return Ok(Keymap::default()) };
    match std::fs::read_to_string(&file) {
        Ok(text) => parse(&text).map_err(|why| format!("{}: {why}", file.display())),
        Err(error) if path.is_none() && error.kind() == ErrorKind::NotFound => Ok(Keymap::default()),
        Err(error) => Err(format!("{}: {error}", file.display())),
    }
}

pub(super) fn parse(text: &str) -> Result<Keymap, String> {
    let line = |offset: usize| text.bytes().take(offset).filter(|&byte| byte == b'\n').count() + 1;
    let table: BTreeMap<Spanned<String>, Spanned<Keys>> = toml::from_str(text).map_err(|error| {
        let at = error.span().map_or(1, |span| line(span.start));
        format!("line {at}: {}", error.message().replace('\n', ", "))
    })?;
    let mut keymap = Keymap::default();
    for (name, keys) in &table {
        let at = format!("line {}", line(name.span().start));
        let texts = match keys.get_ref() {
            Keys::One(one) => std::slice::from_ref(one),
            Keys::Several(several) => several.as_slice(),
        };
        let chords: Result<Vec<Chord>, String> = texts.iter().map(|text| Chord::parse(text)).collect();
        let chords = chords.map_err(|why| format!("{at}: {why}"))?;
        if !keymap.bind(name.get_ref(), chords) {
            return Err(format!("{at}: nothing is called \"{}\"{}", name.get_ref(), nearest(name.get_ref())));
        }
    }
    match keymap.conflict() {
        None => Ok(keymap),
        Some((a, b, chord)) => Err(format!(
            "{} would be both {a} and {b}: give one of them another key, or [] for none",
            chord.label(&super::chord::Letters::default())
        )),
    }
}

/// A hint at what may have been meant.
fn nearest(name: &str) -> String {
    let distance = |other: &str| {
        let (a, b): (Vec<char>, Vec<char>) = (name.chars().collect(), other.chars().collect());
        let mut row: Vec<usize> = (0..=b.len()).collect();
        for (i, x) in a.iter().enumerate() {
            let mut corner = std::mem::replace(&mut row[0], i + 1);
            for (j, y) in b.iter().enumerate() {
                let next = (corner + usize::from(x != y)).min(row[j] + 1).min(row[j + 1] + 1);
                corner = std::mem::replace(&mut row[j + 1], next);
            }
        }
        row[b.len()]
    };
    let best = entries().map(|entry| (distance(entry.name), entry.name)).min();
    best.filter(|(distance, _)| *distance <= 3)
        .map_or(String::new(), |(_, name)| format!("; did you mean \"{name}\"?"))
}

#[cfg(test)]
mod tests {
    use super::super::keymap::{Action, Hold, Tap};
    use super::*;
    use winit::keyboard::KeyCode;

    #[test]
    fn keys_move_and_what_was_on_them_must_move_too() {
        let keymap = parse("forward = [\"ArrowUp\", \"Z\"]\nlook_up = []\nhud = 'W'\n").unwrap();
        let action = |code| keymap.lookup(code, false, false).map(|entry| entry.action);
        assert_eq!(action(KeyCode::ArrowUp), Some(Action::Hold(Hold::Forward)));
        assert_eq!(action(KeyCode::KeyW), Some(Action::Tap(Tap::HudLevel)));
        let clash = parse("forward = 'Q'").unwrap_err();
        assert!(clash.contains("Q would be both forward and down"), "{clash}");
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let said = |text: &str| parse(text).unwrap_err();
        assert_eq!(said("\nforwrd = 'W'"), "line 2: nothing is called \"forwrd\"; did you mean \"forward\"?");
        assert!(said("forward = 'Wibble'").starts_with("line 1: \"Wibble\": no key is called"));
        assert!(
            said("a = 'A'\nforward = 3").starts_with("line 2: write a key such as"),
            "{}",
            said("forward = 3")
        );
        assert!(said("forward = ").starts_with("line 1"));
        assert!(said("quit = 'Q'\nquit = 'W'").starts_with("line 2"));
    }
}
