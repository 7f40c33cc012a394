//! What the keys do: the one table that dispatches them, that the help is printed from, and whose names the
//! keys file uses.

mod action;
mod table;

pub use action::{Action, Hold, Side, Tap};
pub use table::TABLE;

use super::chord::{Chord, Letters};
use std::fmt::Write;
use table::CONTROL;
use winit::keyboard::KeyCode;

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

    /// The first key of `tap`, as the user's keyboard names it, if it has one.
    #[must_use]
    pub fn label(&self, tap: Tap, letters: &Letters) -> Option<String> {
        let (_, chords) = self.0.iter().find(|(entry, _)| entry.action == Action::Tap(tap))?;
        chords.first().map(|chord| chord.label(letters))
    }

    /// `text` with the key of what is called so in place of each `{name}`: the first that it has.
    #[must_use]
    pub fn fill(&self, text: &str, letters: &Letters) -> String {
        let mut filled = String::with_capacity(text.len());
        let mut rest = text;
        while let Some((before, after)) = rest.split_once('{') {
            filled.push_str(before);
            let known = after.split_once('}').and_then(|(name, after)| {
                let (_, chords) = self.0.iter().find(|(entry, _)| entry.name == name)?;
                Some((chords.first().map_or("no key".to_owned(), |chord| chord.label(letters)), after))
            });
            if let Some((key, after)) = known {
                filled.push_str(&key);
                rest = after;
            } else {
                filled.push('{');
                rest = after;
            }
        }
        filled + rest
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

    /// Further keys of a row, behind the first of each.
    #[must_use]
    pub fn other_keys_of(&self, row: &Row, letters: &Letters) -> String {
        let mut names = Vec::new();
        for entry in row.entries {
            let found = self.0.iter().find(|(known, _)| known.name == entry.name);
            let labels = found.map_or(&[][..], |(_, chords)| chords).iter().map(|chord| chord.label(letters));
            let mut labels = labels.collect::<Vec<String>>().into_iter();
            let first = labels.next();
            // Both Shift keys are called the same.
            names.extend(labels.filter(|label| Some(label) != first.as_ref()));
        }
        names.join(" ")
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

    #[test]
    fn a_hint_names_the_key_that_the_user_has_given() {
        let keys = super::super::keys_file::parse("keep = 'F9'\nundo = []").unwrap();
        let filled = |text: &str| keys.fill(text, &Letters::default());
        assert_eq!(filled("kept: hold {compare}, {keep} keeps"), "kept: hold K, F9 keeps");
        assert_eq!(filled("{undo} and {what} of a{b"), "no key and {what} of a{b");
    }

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
    fn other_keys_are_told_once_and_by_other_names() {
        let row = |name: &str| {
            let rows = TABLE.iter().flat_map(|(_, rows)| *rows);
            rows.clone().find(|row| row.entries.iter().any(|entry| entry.name == name)).copied().unwrap()
        };
        let keys =
            super::super::keys_file::parse("undo = ['Z', 'F9']\nredo = ['Ctrl+Y']\nhud = []\nquit = []")
                .unwrap();
        let others = |name: &str| keys.other_keys_of(&row(name), &Letters::default());
        assert_eq!(others("up"), "PageUp PageDown");
        assert_eq!(others("front"), "Num1 Num3 Num7");
        assert_eq!(
            (others("undo"), others("fast"), others("quit")),
            ("F9".to_owned(), String::new(), String::new())
        );
    }

    #[test]
    fn the_help_names_all_keys_and_is_plain() {
        let text = Keymap::default().text(&Letters::default());
        assert!(text.contains("W A S D") && text.contains("Shift+1 ... 9"), "{text}");
        assert!(text.is_ascii());
        assert!(text.lines().count() > 30);
    }
}
