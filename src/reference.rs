//! Pictures and films that errors are measured by.

use crate::farm::{FilmError, FilmFile, Identity, Ranges, is_film};
use crate::image::ImageError;
use crate::image::compare::{CompareError, Difference, LinearImage};
use glam::UVec2;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A picture that errors are measured by.
#[derive(Clone, Debug)]
pub struct Reference {
    /// In linear light.
    pub picture: LinearImage,
    path: PathBuf,
    /// If it is a film: what of, and which samples.
    film: Option<(Identity, Ranges)>,
}

/// Why errors cannot be measured by it.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// It cannot be read.
    #[error(transparent)]
    Picture(#[from] ImageError),
    /// It is no film, or a broken one.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// It is of another size.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// It would be compared with a part of itself.
    #[error("{}: holds samples {}..{} of this scene with seed {seed}, and the render would be made of the same: the error \
             would come out too small; {way_out}", path.display(), range.start, range.end)]
    SameSamples {
        /// The film.
        path: PathBuf,
        /// What both have.
        range: Range<u32>,
        /// Their seed.
        seed: u32,
        /// What to do.
        way_out: String,
    },
}

impl Reference {
    /// A picture file or, by its ending, a film.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn open(path: &Path) -> Result<Self, ReferenceError> {
        let path = path.to_path_buf();
        if !is_film(&path) {
            return Ok(Self { picture: LinearImage::open(&path)?, path, film: None });
        }
        let file = FilmFile::read(&path)?;
        let mut held = Ranges::default();
        file.held.iter().for_each(|tile| held.unite(tile));
        Ok(Self { picture: LinearImage::of(&file.film), path, film: Some((file.header.identity, held)) })
    }

    /// The seed of its samples, if it is a film.
    #[must_use]
    pub fn seed(&self) -> Option<u32> {
        self.film.as_ref().map(|(identity, _)| identity.seed)
    }

    /// That it has the size of the render.
    ///
    /// # Errors
    /// If it has another.
    pub fn has_size(&self, size: UVec2) -> Result<(), ReferenceError> {
        let (b, size_b) = (self.path.display().to_string(), self.picture.size);
        let error = CompareError::Size { a: "the render".to_owned(), size_a: size, b, size_b };
        if size_b == size { Ok(()) } else { Err(error.into()) }
    }

    /// That none of its samples is among these of the picture `of`. Those of one scene and seed are the same, also with other
    /// settings in part.
    ///
    /// # Errors
    /// If some are.
    pub fn is_independent(&self, of: &Identity, samples: Range<u32>) -> Result<(), ReferenceError> {
        let Some(range) = self.shared(of, &samples.into()) else { return Ok(()) };
        let (path, seed) = (self.path.clone(), of.seed);
        let way_out = format!("give it another seed, such as --seed {}", seed.wrapping_add(1));
        Err(ReferenceError::SameSamples { path, range, seed, way_out })
    }

    fn shared(&self, of: &Identity, samples: &Ranges) -> Option<Range<u32>> {
        let (identity, held) = self.film.as_ref()?;
        let same = identity.scene_hash == of.scene_hash && identity.seed == of.seed;
        same.then(|| held.overlap(samples)).flatten()
    }
}

/// Reads and compares two pictures or films of equal size. Also what both have in common, in words, if they are films of the same
/// samples.
///
/// # Errors
/// If one cannot be read, or they differ in size.
pub fn compare(a: &Path, b: &Path) -> Result<(Difference, Option<String>), ReferenceError> {
    let (a, b) = (Reference::open(a)?, Reference::open(b)?);
    if a.picture.size != b.picture.size {
        let [(a, size_a), (b, size_b)] = [a, b].map(|of| (of.path.display().to_string(), of.picture.size));
        return Err(CompareError::Size { a, size_a, b, size_b }.into());
    }
    let shared =
        b.film.as_ref().and_then(|(identity, held)| Some((a.shared(identity, held)?, identity.seed)));
    let said = shared.map(|(range, seed)| {
        format!(
            "both hold samples {}..{} of one scene with seed {seed}: what they share does not differ",
            range.start, range.end
        )
    });
    Ok((Difference::between(&a.picture, &b.picture), said))
}
