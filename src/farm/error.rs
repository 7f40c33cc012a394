//! Why a film cannot be used: one line, naming the file, the place in it and the way out.

use super::Ranges;
use crate::image::files::plainly;
use glam::UVec2;
use std::ops::Range;
use std::path::PathBuf;
use thiserror::Error;

/// What is wrong with a film file, or with several of them together.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FilmError {
    /// The file system refused.
    #[error("{}: {}", path.display(), plainly(source))]
    Io {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// Something else.
    #[error("{}: is not a film of Penumbra; films are made by `penumbra render … -o NAME.film`", path.display())]
    NotAFilm {
        /// The file.
        path: PathBuf,
    },
    /// From another time.
    #[error("{}: is a film of format {format}, and this is Penumbra {}, which reads format {}; \
             use the version that wrote it", path.display(), env!("CARGO_PKG_VERSION"), super::format::FORMAT)]
    OtherFormat {
        /// The file.
        path: PathBuf,
        /// Its format.
        format: u32,
    },
    /// It ends too early, or goes on after its end.
    #[error("{}: has {has} bytes where its head says {wanted}: copy it again, or render it again",
            path.display())]
    Length {
        /// The file.
        path: PathBuf,
        /// Bytes there are.
        has: u64,
        /// Bytes there should be.
        wanted: u64,
    },
    /// Damaged.
    #[error("{}: {place}: {problem}; copy it again, or render it again", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// Where.
        place: String,
        /// What is wrong there.
        problem: String,
    },
    /// Not enough memory for it.
    #[error("{}: {} x {} pixels do not fit into memory; use a machine with more", path.display(), size.x, size.y)]
    Memory {
        /// The file.
        path: PathBuf,
        /// Its size.
        size: UVec2,
    },
    /// Two films of different pictures.
    #[error("{}: is not of the same picture as {other}: {}", path.display(), differences.join("; "))]
    Foreign {
        /// The film.
        path: PathBuf,
        /// What it should fit to.
        other: String,
        /// In what they differ.
        differences: Vec<String>,
    },
    /// A sample that is in two films would count twice.
    #[error("{} and {}: both hold samples {}..{}{}; leave one out",
            a.display(), b.display(), range.start, range.end, at(*tile))]
    Overlap {
        /// One film.
        a: PathBuf,
        /// The other.
        b: PathBuf,
        /// What both hold.
        range: Range<u32>,
        /// Top left pixel of the tile where; `None` if everywhere.
        tile: Option<UVec2>,
    },
    /// Samples that nobody has.
    #[error("samples {missing} are missing{}{whose}; {way_out}{only}", at(*tile))]
    Gap {
        /// Which.
        missing: Ranges,
        /// Top left pixel of the tile where; `None` if everywhere.
        tile: Option<UVec2>,
        /// ` (PART holds just A..B of its C..D)`, or nothing.
        whose: String,
        /// What to do.
        way_out: &'static str,
        /// `; if C..D is all that you want, say so`, or nothing.
        only: String,
    },
    /// Samples outside of what was asked for.
    #[error("{}: holds samples {held}, which are not within {}..{}; leave it out", path.display(), range.start, range.end)]
    Outside {
        /// The film.
        path: PathBuf,
        /// What it holds.
        held: Ranges,
        /// What was asked for.
        range: Range<u32>,
    },
    /// A film with holes cannot be gone on with.
    #[error("{}: holds samples {held}, which is not one range to go on from; render what is missing with \
             --sample-range and merge it", path.display())]
    Holes {
        /// The film.
        path: PathBuf,
        /// What it holds.
        held: Ranges,
    },
    /// A film that begins elsewhere than asked for.
    #[error("{}: begins at sample {has}, not {wanted}; say --sample-range {has}..B or nothing", path.display())]
    Start {
        /// The film.
        path: PathBuf,
        /// Its first sample.
        has: u32,
        /// What was asked for.
        wanted: u32,
    },
}

fn at(tile: Option<UVec2>) -> String {
    tile.map_or_else(String::new, |at| format!(" in the tile at pixel {},{}", at.x, at.y))
}
