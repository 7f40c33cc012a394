//! The files that a render leaves: where they were to go, or where there is room.

use crate::farm::{Header, format, is_film};
use crate::image::compare::LinearImage;
use crate::image::files::{save_image, save_part};
use crate::image::{Display, ImageError, save};
use crate::trace::Film;
use glam::UVec2;
use std::fmt;
use std::path::{Path, PathBuf};

/// Files that could not be written where they were to go; an hour of tracing is not lost for that.
#[derive(Debug, thiserror::Error)]
pub struct NotWritten {
    /// Why each of them could not, and where it is instead.
    files: Vec<(ImageError, Option<PathBuf>)>,
}

impl fmt::Display for NotWritten {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (error, instead)) in self.files.iter().enumerate() {
            let comma = if i == 0 { "" } else { "; " };
            match instead {
                Some(path) => write!(f, "{comma}{error}; saved as {} instead", path.display())?,
                None => write!(f, "{comma}{error}; there was no other place to save it either")?,
            }
        }
        Ok(())
    }
}

/// Better now than after an hour of tracing.
///
/// # Errors
/// If the folder that `path` is to go to is not there.
pub fn folder_exists(path: &Path) -> Result<(), ImageError> {
    match path.parent() {
        Some(folder) if folder != Path::new("") && !folder.is_dir() => {
            let source = std::io::Error::new(std::io::ErrorKind::NotFound, "no such folder; make it first");
            Err(ImageError::Io { path: path.to_path_buf(), source })
        }
        _ => Ok(()),
    }
}

/// Writes all files, each by its ending; pictures are of the guess if there is one, or of a part if it was only that. One that cannot be written does not keep the
/// others from it, and goes to the current folder or that of temporary files, under a name that nobody has there.
///
/// # Errors
/// If one is not where it was to be: it says where.
pub fn save_all(
    paths: &[PathBuf],
    (film, guess): (&Film, Option<&LinearImage>),
    display: &Display,
    header: Option<&Header>,
    part: Option<[UVec2; 2]>,
) -> Result<(), NotWritten> {
    let save = |path: &Path| match (header, part, guess) {
        (Some(header), ..) if is_film(path) => format::write(path, header, film, &format::held_by(film)),
        (_, Some(part), _) => save_part(path, film, display, part),
        (.., Some(guess)) => save_image(path, guess, display),
        _ => save(path, film, display),
    };
    let failed = paths.iter().filter_map(|path| Some((path, save(path).err()?)));
    let files: Vec<_> = failed.map(|(path, error)| (error, save_elsewhere(path, save))).collect();
    if files.is_empty() { Ok(()) } else { Err(NotWritten { files }) }
}

fn save_elsewhere(path: &Path, save: impl Fn(&Path) -> Result<(), ImageError>) -> Option<PathBuf> {
    // The current folder may be gone, too.
    let folders = std::env::current_dir().into_iter().chain([std::env::temp_dir()]);
    folders.filter_map(|folder| free_name(&folder, path)).find(|there| save(there).is_ok())
}

/// `NAME.film`, `NAME-1.film` …: the first that is not taken.
fn free_name(folder: &Path, path: &Path) -> Option<PathBuf> {
    let (stem, ending) = (path.file_stem()?.to_string_lossy(), path.extension()?.to_string_lossy());
    let numbered = (1..1000).map(|i| format!("{stem}-{i}.{ending}"));
    let names = std::iter::once(format!("{stem}.{ending}")).chain(numbered);
    names.map(|name| folder.join(name)).find(|there| !there.exists())
}
