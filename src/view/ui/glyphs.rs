//! Letters that egui's own fonts have not, as names of things and files may hold: from a font of the system, if it has one,
//! else by their numbers, `\u{4e2d}`, which unlike boxes tell one name from another.

use ab_glyph::{Font, FontVec};
use egui::epaint::text::{FontInsert, FontPriority, InsertFontFamily};
use egui::{Context, FontData, FontFamily, FontId, Id};
use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Letters before this, Latin, Greek and Cyrillic ones, egui's fonts have.
const FOREIGN: char = '\u{530}';
/// Parts of the names of files with fonts of many letters, on all systems; of hundreds of fonts only these are opened.
const WIDE: [&str; 17] = [
    "cjk",
    "fallback",
    "sourcehan",
    "wqy",
    "unifont",
    "notosans",
    "pingfang",
    "hiragino",
    "applesdgothic",
    "arial unicode",
    "msyh",
    "msgothic",
    "yugoth",
    "meiryo",
    "malgun",
    "simsun",
    "segoeui",
];
/// Of a file, bytes; of folders in each other; and of all that is looked at in folders.
const MOST_BYTES: u64 = 64 << 20;
const DEEPEST: usize = 5;
const MOST_ENTRIES: usize = 20_000;

/// `text` as it can be shown. What is missing is remembered, for [`Glyphs::fetch`].
pub fn legible<'t>(context: &Context, text: &'t str) -> Cow<'t, str> {
    let font = FontId::proportional(13.0);
    let is_missing = |c: char| c >= FOREIGN && !context.fonts_mut(|fonts| fonts.has_glyph(&font, c));
    let missing: Vec<char> = text.chars().filter(|&c| is_missing(c)).collect();
    if missing.is_empty() {
        return Cow::Borrowed(text);
    }
    let shown = |c: char| match missing.contains(&c) {
        true => c.escape_unicode().to_string(),
        false => c.to_string(),
    };
    let shown = text.chars().map(shown).collect();
    context.data_mut(|data| data.get_temp_mut_or_default::<HashSet<char>>(asked()).extend(missing));
    Cow::Owned(shown)
}

fn asked() -> Id {
    Id::new("missing letters")
}

/// Which letters were looked for.
#[derive(Default)]
pub struct Glyphs(HashSet<char>);

impl Glyphs {
    /// Looks for fonts with the letters that were missing, each letter once; whether one was found, so that all is to be shown
    /// again.
    pub fn fetch(&mut self, context: &Context) -> bool {
        let missing = context.data_mut(|data| data.remove_temp::<HashSet<char>>(asked())).unwrap_or_default();
        let new: Vec<char> = missing.into_iter().filter(|&c| self.0.insert(c)).collect();
        if new.is_empty() {
            return false;
        }
        let Some((path, font)) = find(&folders(), &new) else { return false };
        let family = |family| InsertFontFamily { family, priority: FontPriority::Lowest };
        let families = vec![family(FontFamily::Proportional), family(FontFamily::Monospace)];
        let name = path.display().to_string();
        context.add_font(FontInsert::new(&name, FontData::from_owned(font.as_slice().to_vec()), families));
        // The others may be in another.
        self.0.retain(|c| !new.contains(c) || font.glyph_id(*c).0 != 0);
        true
    }
}

/// Where systems have their fonts.
fn folders() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> =
        ["/usr/share/fonts", "/usr/local/share/fonts", "/System/Library/Fonts", "/Library/Fonts"]
            .map(PathBuf::from)
            .into();
    let own = |variable: &str, below: &str| Some(PathBuf::from(std::env::var_os(variable)?).join(below));
    let of_user =
        [("HOME", ".local/share/fonts"), ("HOME", ".fonts"), ("HOME", "Library/Fonts"), ("WINDIR", "Fonts")];
    folders.extend(of_user.into_iter().filter_map(|(variable, below)| own(variable, below)));
    folders
}

/// A font with one of these letters. A file that is none, or broken, is passed over.
fn find(folders: &[PathBuf], letters: &[char]) -> Option<(PathBuf, FontVec)> {
    let mut left = MOST_ENTRIES;
    let mut files = Vec::new();
    folders.iter().for_each(|folder| collect(folder, DEEPEST, &mut left, &mut files));
    // Plain letters before bold ones, and the same every time.
    files.sort_by_key(|path: &PathBuf| {
        let name = path.to_string_lossy().to_lowercase();
        (!(name.contains("regular") || name.contains("medium")), name.contains("mono"), name)
    });
    files.into_iter().find_map(|path| {
        let size = std::fs::metadata(&path).ok()?.len();
        let bytes = (size <= MOST_BYTES).then(|| std::fs::read(&path).ok()).flatten()?;
        // egui panics if it is none.
        let font = FontVec::try_from_vec_and_index(bytes, 0).ok()?;
        letters.iter().any(|&letter| font.glyph_id(letter).0 != 0).then_some((path, font))
    })
}

/// Files in `folder` and below whose names are those of wide fonts.
fn collect(folder: &Path, depth: usize, left: &mut usize, files: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        if *left == 0 {
            return;
        }
        *left -= 1;
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().to_lowercase();
        let is_font = [".ttf", ".ttc", ".otf", ".otc"].iter().any(|ending| name.ends_with(ending));
        if is_font && WIDE.iter().any(|part| name.contains(part)) {
            files.push(path);
        } else if depth > 0 && entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            collect(&path, depth - 1, left, files);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{FontDefinitions, RawInput};

    #[test]
    fn a_wide_font_is_found_where_it_has_the_letter_and_broken_ones_are_passed_over() {
        let folder = std::env::temp_dir().join(format!("penumbra-fonts-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("a/b")).unwrap();
        let fonts = FontDefinitions::default().font_data;
        let font = fonts["Ubuntu-Light"].font.to_vec();
        std::fs::write(folder.join("a/b/NotoSansCJK-Regular.ttf"), &font).unwrap();
        std::fs::write(folder.join("Another.ttf"), &font).unwrap();
        for (name, broken) in
            [("NotoSans-Regular.ttf", &font[..100]), ("wqy.ttc", b""), ("unifont.otf", b"x")]
        {
            std::fs::write(folder.join(name), broken).unwrap();
        }
        let here = std::slice::from_ref(&folder);
        // Whatever letter is asked for first.
        for letters in [&['é'][..], &['中', 'é'], &['é', '中']] {
            let (path, found) = find(here, letters).unwrap();
            assert_eq!((path, found.as_slice()), (folder.join("a/b/NotoSansCJK-Regular.ttf"), &font[..]));
        }
        assert!(find(here, &['中']).is_none());
        assert!(find(&[folder.join("none")], &['é']).is_none());
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn letters_that_no_font_has_are_shown_by_their_numbers_and_looked_for_once() {
        let context = Context::default();
        let mut shown = Vec::new();
        let _ = context.run(RawInput::default(), |context| {
            // A letter of no language.
            shown = ["Lampe à côté", "лампа", "a\u{10fffd}b"]
                .map(|text| legible(context, text).into_owned())
                .into();
        });
        assert_eq!(shown, ["Lampe à côté", "лампа", "a\\u{10fffd}b"]);
        let mut glyphs = Glyphs::default();
        assert!(!glyphs.fetch(&context));
        assert!(glyphs.0.contains(&'\u{10fffd}'));
    }
}
