//! One still on many machines: films in files, and how they become one again.
//!
//! Machines trace disjoint ranges of sample indices of the same picture, each into a film file
//! ([`format`](mod@format)). Film sums are integers, so adding the films up ([`merge`](mod@merge)) gives the
//! film of a single run, bit for bit, in whatever order they come. A film file knows what it is a picture of
//! ([`Identity`]) and which samples each of its tiles holds ([`Ranges`]), so that nothing is merged that
//! doesn't belong together, counted twice, or missed without anybody noticing.

pub mod error;
pub mod fingerprint;
pub mod format;
pub mod identity;
pub mod merge;
pub mod numbers;
pub mod ranges;

pub use error::FilmError;
pub use fingerprint::Fingerprint;
pub use format::{FilmFile, Header};
pub use identity::Identity;
pub use merge::merge;
pub use ranges::Ranges;

use std::path::Path;

/// Whether a file name's ending says that it is a film.
#[must_use]
pub fn is_film(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("film"))
}
