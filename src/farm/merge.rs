//! Films of one picture → one film.

use super::{FilmError, FilmFile, Ranges};
use crate::trace::Film;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What has been added up so far, and from what.
struct Part {
    path: PathBuf,
    planned: Option<Range<u32>>,
    held: Vec<Ranges>,
}

/// Adds up the films in `paths`, in any order: the result is that of a single run. It is shown as the first.
///
/// `wanted` are the samples that must be there, no more and no less; without it, those from the very first, number 0, to the
/// last that a film holds or was to hold. `allow_gaps` lets some be missing.
///
/// # Errors
/// If a film cannot be read, is of another picture than the first, shares samples with another, or if samples
/// are missing.
pub fn merge(
    paths: &[PathBuf],
    wanted: Option<Range<u32>>,
    allow_gaps: bool,
) -> Result<Option<FilmFile>, FilmError> {
    let mut sum: Option<FilmFile> = None;
    let mut parts: Vec<Part> = Vec::new();
    for path in paths {
        let file = FilmFile::read(path)?;
        if let Some(range) = &wanted {
            within(path, &file.held, range)?;
        }
        let planned = file.header.planned.clone();
        let held = file.held.clone();
        match &mut sum {
            None => sum = Some(file),
            Some(sum) => {
                let differences = file.header.identity.differences(&sum.header.identity);
                if !differences.is_empty() {
                    let other = parts[0].path.display().to_string();
                    return Err(FilmError::Foreign { path: path.clone(), other, differences });
                }
                for part in &parts {
                    apart(part, path, &held, &file.film)?;
                }
                sum.film.merge(&file.film);
                for (ours, more) in sum.held.iter_mut().zip(&held) {
                    ours.unite(more);
                }
            }
        }
        parts.push(Part { path: path.clone(), planned, held });
    }
    let Some(mut sum) = sum else { return Ok(None) };
    let hull = wanted.clone().or_else(|| hull(&parts));
    // Without a word about the range it begins with sample 0: else nobody would see that the first part is missing.
    let range = wanted.or_else(|| hull.as_ref().map(|hull| 0..hull.end));
    if !allow_gaps && let Some(range) = &range {
        complete(&sum, &parts, range)?;
    }
    // As a single run would have planned it, if all parts had a plan.
    let all_planned = parts.iter().all(|part| part.planned.is_some());
    sum.header.planned = hull.filter(|_| all_planned);
    Ok(Some(sum))
}

/// That `held` is inside of `range`.
fn within(path: &Path, held: &[Ranges], range: &Range<u32>) -> Result<(), FilmError> {
    let hulls = held.iter().filter_map(|tile| Some((tile, tile.hull()?)));
    let outside = |hull: &Range<u32>| hull.start < range.start || hull.end > range.end;
    match hulls.into_iter().find(|(_, hull)| outside(hull)) {
        None => Ok(()),
        Some((held, _)) => {
            let held = held.clone();
            Err(FilmError::Outside { path: path.to_path_buf(), held, range: range.clone() })
        }
    }
}

/// That no tile of two films has a sample in common.
fn apart(part: &Part, path: &Path, held: &[Ranges], film: &Film) -> Result<(), FilmError> {
    let pairs = part.held.iter().zip(held).enumerate();
    let Some((index, range)) = pairs.filter_map(|(i, (a, b))| Some((i, a.overlap(b)?))).next() else {
        return Ok(());
    };
    let tile = (!everywhere(&part.held) || !everywhere(held)).then(|| film.tiles()[index].origin);
    Err(FilmError::Overlap { a: part.path.clone(), b: path.to_path_buf(), range, tile })
}

/// From the first to the last sample that the films were to hold. A film without a plan was to hold what all
/// its tiles have: a render that was stopped by the clock ends unevenly, and that is no gap.
fn hull(parts: &[Part]) -> Option<Range<u32>> {
    let of_part = |part: &Part| {
        part.planned.clone().or_else(|| {
            let start = part.held.iter().filter_map(Ranges::hull).map(|hull| hull.start).min()?;
            let end = part.held.iter().map(|tile| tile.hull().map_or(start, |hull| hull.end)).min()?;
            Some(start..end)
        })
    };
    parts.iter().filter_map(of_part).reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))
}

/// That all tiles have all samples of `range`.
fn complete(sum: &FilmFile, parts: &[Part], range: &Range<u32>) -> Result<(), FilmError> {
    let gaps = sum.held.iter().map(|held| held.missing(range.clone())).enumerate();
    let Some((index, missing)) = gaps.into_iter().find(|(_, missing)| missing.hull().is_some()) else {
        return Ok(());
    };
    let tile = (!everywhere(&sum.held)).then(|| sum.film.tiles()[index].origin);
    // Somebody may have promised them.
    let promised = |part: &&Part| {
        part.planned.as_ref().is_some_and(|planned| missing.overlap(&Ranges::from(planned.clone())).is_some())
    };
    let (whose, way_out) = match parts.iter().find(promised) {
        Some(Part { path, planned: Some(planned), held }) => (
            format!(" ({} holds {} of its {}..{})", path.display(), held[index], planned.start, planned.end),
            "go on with it (`render … --resume`), or merge with --allow-gaps",
        ),
        _ => (String::new(), "render them (`render … --sample-range`), or merge with --allow-gaps"),
    };
    // All that nobody has is the beginning: perhaps it is to be so.
    let held_from =
        parts.iter().flat_map(|part| &part.held).filter_map(Ranges::hull).map(|hull| hull.start).min();
    let is_part = held_from.filter(|&from| from > 0 && missing == Ranges::from(0..from));
    let only = is_part.map_or_else(String::new, |from| {
        format!("; if {from}..{} is all that you want, say --sample-range {from}..{}", range.end, range.end)
    });
    Err(FilmError::Gap { missing, tile, whose, way_out, only })
}

fn everywhere(held: &[Ranges]) -> bool {
    held.windows(2).all(|pair| pair[0] == pair[1])
}

impl FilmFile {
    /// The film, to go on with: it must hold the same picture as `wanted`, from `first` (if said) on without
    /// a hole.
    ///
    /// # Errors
    /// If it doesn't.
    pub fn resume(
        self,
        path: &Path,
        wanted: &super::Identity,
        first: Option<u32>,
    ) -> Result<Film, FilmError> {
        let path = path.to_path_buf();
        let differences = self.header.identity.differences(wanted);
        if !differences.is_empty() {
            let other = "the one asked for".to_owned();
            return Err(FilmError::Foreign { path, other, differences });
        }
        let has = self.film.first_sample();
        let from_there = |held: &&Ranges| match held.as_slice() {
            [] => true,
            [one] => one.start == has,
            _ => false,
        };
        if let Some(held) = self.held.iter().find(|held| !from_there(held)) {
            return Err(FilmError::Holes { path, held: held.clone() });
        }
        match first {
            Some(wanted) if wanted != has => Err(FilmError::Start { path, has, wanted }),
            _ => Ok(self.film),
        }
    }

    /// Fewest and most samples that a pixel was given.
    #[must_use]
    pub fn samples(&self) -> (u32, u32) {
        let counts = || self.held.iter().map(Ranges::count);
        (counts().min().unwrap_or(0), counts().max().unwrap_or(0))
    }
}
