//! A key with its modifiers: as the keys file writes it, and as people call it.

use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error;
use std::collections::HashMap;
use winit::keyboard::KeyCode;

/// A physical key, by its place on a US keyboard, with or without Ctrl and Shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chord {
    /// The key.
    pub code: KeyCode,
    /// Together with a control key.
    pub control: bool,
    /// Together with a shift key.
    pub shift: bool,
}

/// The letters that are printed on the user's keys, as far as they have been seen.
#[derive(Clone, Debug, Default)]
pub struct Letters(HashMap<KeyCode, String>);

impl Letters {
    /// How many are known.
    #[must_use]
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// `code` has typed `text`.
    pub fn learn(&mut self, code: KeyCode, text: &str) {
        let mut letters = text.chars();
        if let (Some(letter), None) = (letters.next(), letters.next())
            && letter.is_alphabetic()
        {
            self.0.insert(code, letter.to_uppercase().collect());
        }
    }
}

impl Chord {
    /// Reads `W`, `F5`, `PageUp` or `Ctrl+Shift+1`: names of the W3C (`KeyW`, `Digit1` …), letters and
    /// digits also without `Key` and `Digit`.
    ///
    /// # Errors
    /// What cannot be understood.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (mut control, mut shift) = (false, false);
        let mut parts = text.split('+').map(str::trim);
        let key = parts.next_back().unwrap_or_default();
        for part in parts {
            match part.to_ascii_lowercase().as_str() {
                "ctrl" | "control" => control = true,
                "shift" => shift = true,
                _ => return Err(format!("\"{text}\": only Ctrl and Shift go before a key, not \"{part}\"")),
            }
        }
        let code = code_of(key).ok_or_else(|| {
            format!("\"{text}\": no key is called \"{key}\"; write W, 1, F5, Space, ArrowUp, BracketLeft ...")
        })?;
        Ok(Self { code, control, shift })
    }

    /// What people call it.
    #[must_use]
    pub fn label(&self, letters: &Letters) -> String {
        let control = if self.control { "Ctrl+" } else { "" };
        let shift = if self.shift { "Shift+" } else { "" };
        let key = letters.0.get(&self.code).cloned().unwrap_or_else(|| name_of(self.code));
        format!("{control}{shift}{key}")
    }
}

fn code_of(name: &str) -> Option<KeyCode> {
    let known = |name: &str| {
        let deserializer: serde::de::value::StrDeserializer<'_, Error> = name.into_deserializer();
        KeyCode::deserialize(deserializer).ok()
    };
    let mut letters = name.chars();
    match (letters.next(), letters.next()) {
        (Some(letter), None) if letter.is_ascii_alphabetic() => {
            known(&format!("Key{}", letter.to_ascii_uppercase()))
        }
        (Some(digit), None) if digit.is_ascii_digit() => known(&format!("Digit{digit}")),
        _ => known(if name == "Esc" { "Escape" } else { name }),
    }
}

/// Short, and as it is printed on a US keyboard.
fn name_of(code: KeyCode) -> String {
    let name = format!("{code:?}").replacen("Numpad", "Num", 1);
    let short = match code {
        KeyCode::Comma => ",",
        KeyCode::Period => ".",
        KeyCode::Slash => "?",
        KeyCode::Semicolon => ";",
        KeyCode::Quote => "'",
        KeyCode::BracketLeft => "[",
        KeyCode::BracketRight => "]",
        KeyCode::Equal => "+",
        KeyCode::Minus => "-",
        KeyCode::NumpadAdd => "Num+",
        KeyCode::NumpadSubtract => "Num-",
        KeyCode::Escape => "Esc",
        KeyCode::ArrowLeft => "Left",
        KeyCode::ArrowRight => "Right",
        KeyCode::ArrowUp => "Up",
        KeyCode::ArrowDown => "Down",
        KeyCode::ShiftLeft | KeyCode::ShiftRight => "Shift",
        KeyCode::AltLeft | KeyCode::AltRight => "Alt",
        KeyCode::ControlLeft | KeyCode::ControlRight => "Ctrl",
        _ => name.strip_prefix("Key").or(name.strip_prefix("Digit")).unwrap_or(&name),
    };
    short.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chords_are_read_as_people_write_them() {
        let chord = |code, control, shift| Ok(Chord { code, control, shift });
        assert_eq!(Chord::parse("w"), chord(KeyCode::KeyW, false, false));
        assert_eq!(Chord::parse("KeyW"), chord(KeyCode::KeyW, false, false));
        assert_eq!(Chord::parse("Ctrl + Shift+1"), chord(KeyCode::Digit1, true, true));
        assert_eq!(Chord::parse("Esc"), chord(KeyCode::Escape, false, false));
        for wrong in ["", "Ctrl+", "Alt+W", "Wibble", "Ctrl+Wibble", "ä"] {
            assert!(Chord::parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn labels_are_those_of_the_users_keyboard() {
        let mut letters = Letters::default();
        let chord = Chord::parse("Ctrl+Q").unwrap();
        assert_eq!(chord.label(&letters), "Ctrl+Q");
        letters.learn(KeyCode::KeyQ, "a");
        letters.learn(KeyCode::KeyW, "abc");
        letters.learn(KeyCode::Digit1, "&");
        assert_eq!(chord.label(&letters), "Ctrl+A");
        assert_eq!(Chord::parse("W").unwrap().label(&letters), "W");
        assert_eq!(Chord::parse("1").unwrap().label(&letters), "1");
        assert_eq!(Chord::parse("ArrowUp").unwrap().label(&letters), "Up");
    }
}
