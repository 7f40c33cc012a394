//! Film files.
//!
//! All numbers are little endian.
//!
//! | at | bytes | what |
//! |---|---|---|
//! | 0 | 8 | 0x89 `PenFilm` |
//! | 8 | 4 | [`FORMAT`] |
//! | 12 | 4 | length of the header |
//! | 16 | 8 | length of the file |
//! | 24 | | the header: [`Header`] as JSON |
//! | | | the tiles, in rows from the top, 8 x 8 pixels each except at the right and lower border |
//! | end − 16 | 16 | [`Fingerprint`] of everything before |
//!
//! A tile: how many ranges of sample indices it holds, and first index and length of each; how many samples
//! were dropped because they were not finite; its pixels in rows from the top. A pixel: for each half (even
//! samples, odd samples) how many samples it has less than the tile; then the sums of the even half, red,
//! green and blue, and of the odd half, as multiples of 2⁻⁶⁰. Counts and sums are written as
//! [`numbers`](super::numbers) says, which for a usual picture comes to 25 to 45 bytes a pixel. There is no time in it
//! and no name of a machine: the same samples make the same bytes.

use super::numbers::{Reader, write_count, write_sum};
use super::{FilmError, Fingerprint, Identity, Ranges};
use crate::image::files::{ImageError, write_whole};
use crate::image::{Display, ToneMap};
use crate::trace::Film;
use crate::trace::film::{Pixel, TILE, Tile};
use glam::UVec2;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

/// What this program writes and reads.
pub const FORMAT: u32 = 1;
const MAGIC: [u8; 8] = *b"\x89PenFilm";
const HEAD: usize = 24;
const CHECKSUM: usize = 16;
/// Most bytes of a header: paths and names are short.
const MOST_HEADER: u64 = 1 << 20;
/// As on the command line.
const MOST_PIXELS: u64 = 1 << 28;
/// Fewest bytes that a pixel takes: two counts and six sums.
const LEAST_PIXEL: u64 = 8;

/// What a film file says about itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Which picture it is of.
    pub identity: Identity,
    /// The sample indices that it was to hold in the end, if that was said.
    pub planned: Option<Range<u32>>,
    /// How it is shown: exposure in stops.
    pub exposure: f32,
    /// How it is shown: `clip` or `neutral`.
    pub tone_map: String,
}

/// A film, and what is known about it.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmFile {
    /// What it says about itself.
    pub header: Header,
    /// The sums.
    pub film: Film,
    /// Which samples each tile holds.
    pub held: Vec<Ranges>,
}

impl Header {
    /// Of a picture shown like this.
    #[must_use]
    pub fn new(identity: Identity, planned: Option<Range<u32>>, display: &Display) -> Self {
        let tone_map = display.tone_map.name();
        Self { identity, planned, exposure: display.exposure, tone_map: tone_map.to_owned() }
    }

    /// How it is shown.
    #[must_use]
    pub fn display(&self) -> Display {
        let tone_map = ToneMap::named(&self.tone_map).unwrap_or_default();
        Display { exposure: self.exposure, tone_map }
    }
}

/// Which samples each tile of a film in the making holds: from the first on without a hole.
#[must_use]
pub fn held_by(film: &Film) -> Vec<Ranges> {
    film.tiles().iter().map(|tile| Ranges::from(film.first_sample()..tile.next_sample)).collect()
}

/// Writes a film. It appears whole or not at all.
///
/// # Errors
/// If the file system refuses.
pub fn write(path: &Path, header: &Header, film: &Film, held: &[Ranges]) -> Result<(), ImageError> {
    write_whole(path, &encode(header, film, held))
}

/// The bytes of a film file. `held` says which samples each tile holds.
#[must_use]
pub fn encode(header: &Header, film: &Film, held: &[Ranges]) -> Vec<u8> {
    let json = serde_json::to_vec(header).unwrap_or_default();
    let mut out = Vec::with_capacity(HEAD + json.len() + film.size().element_product() as usize * 48);
    out.extend_from_slice(&MAGIC);
    out.extend_from_slice(&FORMAT.to_le_bytes());
    out.extend_from_slice(&(json.len() as u32).to_le_bytes());
    out.extend_from_slice(&[0; 8]);
    out.extend_from_slice(&json);
    for (tile, ranges) in film.tiles().iter().zip(held) {
        write_tile(&mut out, tile, ranges);
    }
    let length = (out.len() + CHECKSUM) as u64;
    out[16..HEAD].copy_from_slice(&length.to_le_bytes());
    let print = checksum(&out);
    out.extend_from_slice(&print);
    out
}

fn write_tile(out: &mut Vec<u8>, tile: &Tile, ranges: &Ranges) {
    write_count(out, ranges.as_slice().len() as u64);
    for range in ranges.as_slice() {
        write_count(out, u64::from(range.start));
        write_count(out, u64::from(range.end - range.start));
    }
    write_count(out, tile.dropped);
    let all = ranges.halves();
    for pixel in tile.pixels() {
        for (all, count) in all.into_iter().zip(pixel.counts()) {
            write_count(out, u64::from(all.saturating_sub(count)));
        }
        for sum in pixel.sums().into_iter().flatten() {
            write_sum(out, sum);
        }
    }
}

fn checksum(bytes: &[u8]) -> [u8; CHECKSUM] {
    let mut print = Fingerprint::default();
    print.bytes(bytes);
    print.finish().to_le_bytes()
}

impl FilmFile {
    /// Writes the film. It appears whole or not at all.
    ///
    /// # Errors
    /// If the file system refuses.
    pub fn write(&self, path: &Path) -> Result<(), ImageError> {
        write(path, &self.header, &self.film, &self.held)
    }

    /// Reads a film. Nothing is allocated that the file's own length doesn't warrant.
    ///
    /// # Errors
    /// If it cannot be read, is no film, or a damaged one.
    pub fn read(path: &Path) -> Result<Self, FilmError> {
        let io = |source| FilmError::Io { path: path.to_path_buf(), source };
        let metadata = std::fs::metadata(path).map_err(io)?;
        if !metadata.is_file() {
            return Err(FilmError::NotAFilm { path: path.to_path_buf() });
        }
        let mut file = File::open(path).map_err(io)?;
        // The head decides whether the rest is worth reading.
        let mut bytes = Vec::new();
        file.by_ref().take(HEAD as u64).read_to_end(&mut bytes).map_err(io)?;
        check_head(path, &bytes, metadata.len())?;
        let rest = usize::try_from(metadata.len()).unwrap_or(usize::MAX) - HEAD;
        bytes.try_reserve_exact(rest).map_err(|_| io(std::io::ErrorKind::OutOfMemory.into()))?;
        file.take(rest as u64).read_to_end(&mut bytes).map_err(io)?;
        Self::decode(path, &bytes)
    }

    /// Reads the bytes of a film file; `path` is for the messages.
    ///
    /// # Errors
    /// If it is no film, or a damaged one.
    pub fn decode(path: &Path, bytes: &[u8]) -> Result<Self, FilmError> {
        let json = check_head(path, bytes, bytes.len() as u64)?;
        let broken = |place: &str, problem: String| FilmError::Broken {
            path: path.to_path_buf(),
            place: place.to_owned(),
            problem,
        };
        let (content, print) = bytes.split_at(bytes.len() - CHECKSUM);
        if checksum(content) != print {
            return Err(broken("checksum", "does not fit to the content, which is damaged".to_owned()));
        }
        let mut reader = Reader(&content[HEAD..]);
        let text = reader.take(json).ok_or_else(|| broken("head", "the header is cut off".to_owned()))?;
        let header: Header = serde_json::from_slice(text).map_err(|e| broken("header", e.to_string()))?;
        let Identity { width, height, .. } = header.identity;
        let size = UVec2::new(width, height);
        let pixels = u64::from(width) * u64::from(height);
        if !(1..=MOST_PIXELS).contains(&pixels) || pixels > reader.0.len() as u64 / LEAST_PIXEL {
            let problem = format!("{width} x {height} pixels cannot be in {} bytes", reader.0.len());
            return Err(broken("header", problem));
        }
        if Vec::<Pixel>::new().try_reserve_exact(pixels as usize).is_err() {
            return Err(FilmError::Memory { path: path.to_path_buf(), size });
        }
        // Where the film begins is known when all tiles are.
        let mut film = Film::new(size, 0);
        let mut held = Vec::with_capacity(film.tiles().len());
        for tile in film.tiles_mut() {
            let ranges = read_tile(&mut reader, tile).map_err(|problem| {
                let place = format!("tile at pixel {},{}", tile.origin.x, tile.origin.y);
                broken(&place, problem.to_owned())
            })?;
            held.push(ranges);
        }
        if !reader.0.is_empty() {
            return Err(broken("end", format!("{} bytes too many", reader.0.len())));
        }
        let starts = held.iter().filter_map(Ranges::hull).map(|hull| hull.start);
        let first = starts.chain(header.planned.as_ref().map(|p| p.start)).min().unwrap_or(0);
        film.begin_at(first);
        Ok(Self { header, film, held })
    }
}

/// Checks the first bytes of a file of `length` bytes, and returns how long the header is.
fn check_head(path: &Path, bytes: &[u8], length: u64) -> Result<usize, FilmError> {
    let path = || path.to_path_buf();
    let too_short = FilmError::Length { path: path(), has: length, wanted: (HEAD + CHECKSUM) as u64 };
    if bytes.is_empty() || bytes[..bytes.len().min(8)] != MAGIC[..bytes.len().min(8)] {
        return Err(FilmError::NotAFilm { path: path() });
    }
    let Some(head) = bytes.first_chunk::<HEAD>() else { return Err(too_short) };
    let number =
        |at: usize| u64::from(u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]));
    let (format, header) = (number(8) as u32, number(12));
    if format != FORMAT {
        return Err(FilmError::OtherFormat { path: path(), format });
    }
    let wanted = number(16) | number(20) << 32;
    if wanted != length {
        return Err(FilmError::Length { path: path(), has: length, wanted });
    }
    if length < (HEAD + CHECKSUM) as u64 {
        return Err(too_short);
    }
    if header > MOST_HEADER {
        let problem = format!("a header of {header} bytes");
        return Err(FilmError::Broken { path: path(), place: "head".to_owned(), problem });
    }
    Ok(header as usize)
}

/// Fills `tile`, whose count is that of the ranges returned, from sample 0 on.
fn read_tile(reader: &mut Reader, tile: &mut Tile) -> Result<Ranges, &'static str> {
    const ENDS: &str = "the file ends here";
    let mut number = || reader.count().ok_or(ENDS);
    let count = number()?;
    let mut ranges = Vec::new();
    for _ in 0..count {
        let (start, length) = (number()?, number()?);
        let index = |n: u64| u32::try_from(n).map_err(|_| "a sample index too large");
        ranges.push(index(start)?..index(start.saturating_add(length))?);
    }
    tile.dropped = number()?;
    let ranges = Ranges::checked(ranges).ok_or("sample ranges out of order")?;
    let all = ranges.halves();
    for pixel in tile.pixels_mut() {
        let mut counts = [0; 2];
        for (count, all) in counts.iter_mut().zip(all) {
            let lacking = reader.count().ok_or(ENDS)?;
            *count =
                u32::try_from(lacking).ok().and_then(|n| all.checked_sub(n)).ok_or("a negative count")?;
        }
        let mut sums = [[0; 3]; 2];
        for sum in sums.iter_mut().flatten() {
            *sum = reader.sum().ok_or("a number that is none")?;
        }
        *pixel = Pixel::from_sums(sums, counts).ok_or("a sum too large for its samples")?;
    }
    tile.next_sample = ranges.count();
    Ok(ranges)
}

/// The format is made of tiles of this size.
const _: () = assert!(TILE == 8, "film files of another tile size are another format");
