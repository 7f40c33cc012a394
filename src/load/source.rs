//! Every byte that a scene is made of comes through here: from disk, or from the program itself.

use super::builtin;
use super::error::ReadError;
use super::files::SceneFiles;
use std::borrow::Cow;
use std::collections::HashMap;
use std::ffi::OsString;
use std::fs;
use std::io::Read;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use unicode_normalization::UnicodeNormalization;

/// Most bytes of a scene file or buffer.
pub(super) const SCENE_LIMIT: u64 = 8 << 30;
/// Most bytes of an image file.
pub(super) const IMAGE_LIMIT: u64 = 512 << 20;
/// Most bytes of a material library or settings file.
pub(super) const TEXT_LIMIT: u64 = 64 << 20;
/// Most folders of a foreign path that are looked for below one's own.
const MOST_FOLDERS: usize = 6;

/// File contents: read from disk, or part of the program.
pub(super) type Bytes = Cow<'static, [u8]>;

/// Where the files that a scene file names are looked for.
#[derive(Clone, Debug)]
pub(super) enum Folder {
    /// On disk; what is asked for is remembered.
    Disk(PathBuf, SceneFiles, Listings),
    /// Among the assets compiled into the program.
    BuiltIn,
}

impl Folder {
    /// The folder that `path` lies in.
    pub(super) fn of(path: &Path, files: &SceneFiles) -> Self {
        let parent = path.parent().filter(|parent| *parent != Path::new(""));
        Self::Disk(parent.unwrap_or(Path::new(".")).to_path_buf(), files.clone(), Listings::default())
    }

    /// Where a file that one's own settings name is; `None` in a built-in scene.
    pub(super) fn path(&self, reference: &str) -> Option<PathBuf> {
        match self {
            Self::Disk(folder, ..) => Some(folder.join(reference)),
            Self::BuiltIn => None,
        }
    }

    /// Reads what one's own settings name, wherever it is; also as messages call it, and the folder that it lies in.
    pub(super) fn read_own(&self, reference: &str, limit: u64) -> (String, Self, Result<Bytes, ReadError>) {
        match self {
            Self::Disk(folder, files, _) => {
                let path = folder.join(reference);
                let bytes = read_file(&path, limit, files);
                (path.to_string_lossy().into_owned(), Self::of(&path, files), bytes)
            }
            Self::BuiltIn => {
                let asset = builtin::asset(reference).map(Cow::Borrowed);
                (reference.to_owned(), Self::BuiltIn, asset.ok_or(ReadError::Missing))
            }
        }
    }

    /// Reads what a downloaded scene names: inside this folder only. `\` counts as `/`, and a name
    /// that differs only in case or in the form of its accents (Unicode NFC or NFD) is found too.
    pub(super) fn read(&self, reference: &str, limit: u64) -> Result<Bytes, ReadError> {
        if let Some(scheme) = uri_scheme(reference) {
            return Err(ReadError::Scheme(scheme.to_owned()));
        }
        let reference = reference.replace('\\', "/");
        let relative = inside(&reference).ok_or(ReadError::Outside)?;
        match self {
            Self::Disk(folder, files, listings) => {
                let exact = folder.join(&relative);
                files.note(&exact);
                if exact.exists() {
                    read_file(&exact, limit, files)
                } else {
                    read_file(&listings.any_case(folder, &relative)?, limit, files)
                }
            }
            Self::BuiltIn => {
                builtin::asset(&relative.to_string_lossy()).map(Cow::Borrowed).ok_or(ReadError::Missing)
            }
        }
    }

    /// Whether [`Folder::read`] would find a file.
    pub(super) fn has(&self, reference: &str) -> bool {
        let relative = inside(&reference.replace('\\', "/"));
        relative.is_some_and(|relative| match self {
            Self::Disk(folder, files, listings) => {
                files.note(&folder.join(&relative));
                listings.any_case(folder, &relative).is_ok_and(|path| path.is_file())
            }
            Self::BuiltIn => builtin::asset(&relative.to_string_lossy()).is_some(),
        })
    }

    /// As [`Folder::read`]; a path that is absolute, elsewhere or missing is tried again without its first folders, down to
    /// its bare file name, because exporters write the paths of the machine they ran on: here, then in a folder `textures`
    /// in or beside this one, as downloads often have it. All of that once more with `%20` read as a blank.
    pub(super) fn read_or_neighbour(&self, reference: &str, limit: u64) -> Result<Bytes, ReadError> {
        let first = match self.read_near(reference, limit) {
            Err(why @ (ReadError::Missing | ReadError::Outside | ReadError::Scheme(_))) => why,
            done => return done,
        };
        let decoded = percent_decoded(reference);
        match str::from_utf8(&decoded) {
            Ok(plain) if plain != reference => self.read_near(plain, limit).map_err(|_| first),
            _ => Err(first),
        }
    }

    fn read_near(&self, reference: &str, limit: u64) -> Result<Bytes, ReadError> {
        let first = match self.read(reference, limit) {
            Err(why @ (ReadError::Missing | ReadError::Outside | ReadError::Scheme(_))) => why,
            done => return done,
        };
        let folders: Vec<usize> = reference.match_indices(['/', '\\']).map(|(at, _)| at + 1).collect();
        let shorter = &folders[folders.len().saturating_sub(MOST_FOLDERS)..];
        if let Some(found) = shorter.iter().find_map(|&at| self.read(&reference[at..], limit).ok()) {
            return Ok(found);
        }
        let Self::Disk(folder, files, listings) = self else { return Err(first) };
        let bare = &reference[folders.last().copied().unwrap_or(0)..];
        let there = |folder: PathBuf| {
            let folder = Self::Disk(folder, files.clone(), listings.clone());
            folder.read(&format!("textures/{bare}"), limit).ok()
        };
        [folder.clone(), folder.join("..")].into_iter().find_map(there).ok_or(first)
    }
}

/// Reads a whole regular file of at most `limit` bytes.
pub(super) fn read_file(path: &Path, limit: u64, files: &SceneFiles) -> Result<Bytes, ReadError> {
    files.note(path);
    let metadata = fs::metadata(path).map_err(from_io)?;
    if !metadata.is_file() {
        return Err(ReadError::NotAFile);
    }
    let length = metadata.len();
    if length > limit {
        return Err(ReadError::TooLarge { length, limit });
    }
    let mut bytes = Vec::new();
    let capacity = usize::try_from(length).unwrap_or(usize::MAX);
    bytes.try_reserve_exact(capacity).map_err(|_| std::io::Error::from(std::io::ErrorKind::OutOfMemory))?;
    fs::File::open(path).map_err(from_io)?.take(limit).read_to_end(&mut bytes)?;
    Ok(Cow::Owned(bytes))
}

fn from_io(error: std::io::Error) -> ReadError {
    if error.kind() == std::io::ErrorKind::NotFound { ReadError::Missing } else { ReadError::Io(error) }
}

/// `http` of `http://...`; a single letter is a Windows drive, not a scheme.
pub(super) fn uri_scheme(reference: &str) -> Option<&str> {
    let (scheme, _) = reference.split_once(':')?;
    let legal = scheme.len() >= 2
        && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    legal.then_some(scheme)
}

/// The relative path without `.` and `..`, if it stays below its start.
fn inside(reference: &str) -> Option<PathBuf> {
    let drive = reference.as_bytes().get(1) == Some(&b':');
    if drive || reference.contains('\0') {
        return None;
    }
    let mut clean = PathBuf::new();
    for component in Path::new(reference).components() {
        match component {
            // There it would begin another drive, or a stream.
            Component::Normal(name) if cfg!(windows) && name.to_string_lossy().contains(':') => return None,
            Component::Normal(name) => clean.push(name),
            Component::CurDir => {}
            Component::ParentDir if clean.pop() => {}
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    (clean != Path::new("")).then_some(clean)
}

/// A name as it is compared: letters of any case, and with accents either as letters of their own or as marks on others, as
/// macOS and archives made there have them.
fn folded(name: &str) -> String {
    name.nfc().flat_map(char::to_lowercase).nfc().collect()
}

/// What is in folders, by [`folded`] names, as it was when first asked for: a scene may ask for thousands of files that are not
/// there, or are called otherwise. Clones are the same.
#[derive(Clone, Debug, Default)]
pub(super) struct Listings(Arc<Mutex<HashMap<PathBuf, HashMap<String, OsString>>>>);

impl Listings {
    /// Finds `relative` below `folder` whatever the case of its letters and the form of its accents.
    fn any_case(&self, folder: &Path, relative: &Path) -> Result<PathBuf, ReadError> {
        let mut found = folder.to_path_buf();
        for component in relative.components() {
            let exact = found.join(component);
            found = if exact.exists() { exact } else { self.find(found, component)? };
        }
        Ok(found)
    }

    fn find(&self, folder: PathBuf, name: Component<'_>) -> Result<PathBuf, ReadError> {
        let wanted = folded(&name.as_os_str().to_string_lossy());
        let mut listings = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(listing) = listings.get(&folder) {
            return listing.get(&wanted).map(|name| folder.join(name)).ok_or(ReadError::Missing);
        }
        let mut listing = HashMap::new();
        for name in fs::read_dir(&folder).map_err(from_io)?.flatten().map(|entry| entry.file_name()) {
            listing.entry(folded(&name.to_string_lossy())).or_insert(name);
        }
        let found = listing.get(&wanted).map(|name| folder.join(name)).ok_or(ReadError::Missing);
        listings.insert(folder, listing);
        found
    }
}

/// The bytes that a percent-encoded text stands for; a `%` without two digits is itself.
pub(super) fn percent_decoded(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let escape = (byte == b'%').then(|| text.get(at + 1..at + 3)).flatten();
        match escape.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(value) => {
                decoded.push(value);
                at += 3;
            }
            None => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    decoded
}

/// Text without a byte order mark.
pub(super) fn without_bom(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_must_stay_inside_the_folder() {
        assert_eq!(inside("a/../b.png"), Some(PathBuf::from("b.png")));
        assert_eq!(inside("./x y.bin"), Some(PathBuf::from("x y.bin")));
        for outside in ["../a", "/etc/passwd", "a/../../b", "C:/a", "", "."] {
            assert_eq!(inside(outside), None, "{outside}");
        }
    }

    #[test]
    fn accents_and_case_make_no_other_name() {
        assert_eq!(folded("Cafe\u{301}.PNG"), folded("caf\u{e9}.png"));
        assert_eq!(folded("STRASSE \u{c4}"), folded("strasse a\u{308}"));
        assert_ne!(folded("cafe.png"), folded("caf\u{e9}.png"));
    }

    #[test]
    fn a_drive_letter_is_not_a_scheme() {
        assert_eq!(uri_scheme("http://x/y"), Some("http"));
        assert_eq!(uri_scheme("C:\\x"), None);
        assert_eq!(uri_scheme("a b.png"), None);
    }

    #[test]
    fn percent_signs_are_decoded_only_where_hex_digits_follow() {
        assert_eq!(percent_decoded("a%20b%zz%C3%A9%"), "a b%zzé%".as_bytes());
    }
}
