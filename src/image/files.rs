//! Pictures on disk.

use super::compare::LinearImage;
use super::develop::Display;
use super::develop::{develop, develop_image};
use super::recipe::Recipe;
use crate::trace::Film;
use crate::trace::guess::{guessed_blindly, means};
use glam::{UVec2, Vec3};
use image::{ImageFormat, Rgb32FImage, RgbaImage};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Why a picture could not be written or read. The message names the file.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The name's ending is neither `.png` nor `.exr`.
    #[error("{}: written are pictures, .png (developed, 8 bit) or .exr (linear, 32 bit float), and .film (to go on \
             with or to merge); give it one of these endings", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("{}: {}", path.display(), plainly(source))]
    Io {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// Something else.
    #[error("{}: is no picture; give a .png, an .exr or another common format, or a film that ends in .film",
            path.display())]
    NotAPicture {
        /// The file.
        path: PathBuf,
    },
    /// A picture that cannot be read, or a broken one.
    #[error("{}: {source}", path.display())]
    Codec {
        /// The file.
        path: PathBuf,
        /// The codec's reason.
        source: image::ImageError,
    },
}

/// The system's reason in words for people, who mostly have mistyped a name.
pub(crate) fn plainly(error: &std::io::Error) -> String {
    match (error.kind(), error.get_ref()) {
        (std::io::ErrorKind::NotFound, None) => "no such file or folder; check the name".to_owned(),
        _ => error.to_string(),
    }
}

/// What a file name asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// Developed, sRGB, 8 bit.
    Png,
    /// Linear Rec. 709 radiance, 32 bit float.
    Exr,
}

impl PictureFormat {
    /// By the ending of `path`.
    ///
    /// # Errors
    /// If it is neither `.png` nor `.exr`.
    pub fn of(path: &Path) -> Result<Self, ImageError> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            _ => Err(ImageError::UnknownFormat { path: path.to_path_buf() }),
        }
    }
}

/// Writes the film to `path`, developed or linear by its ending. The file appears whole or not at all.
///
/// # Errors
/// If the ending is unknown or the file cannot be written.
pub fn save(path: &Path, film: &Film, display: &Display) -> Result<(), ImageError> {
    if film.has_gaps() {
        return save_image(path, &LinearImage::of(film), display);
    }
    let pixels = match PictureFormat::of(path)? {
        PictureFormat::Png => return write_png(path, film.size(), develop(film, None, display)),
        PictureFormat::Exr => linear_pixels(film),
    };
    write_exr(path, film.size(), &pixels)
}

/// The same of a picture.
///
/// # Errors
/// If the ending is unknown or the file cannot be written.
pub fn save_image(path: &Path, image: &LinearImage, display: &Display) -> Result<(), ImageError> {
    match PictureFormat::of(path)? {
        PictureFormat::Png => write_png(path, image.size, develop_image(image, display)),
        PictureFormat::Exr => write_exr(path, image.size, &image.pixels),
    }
}

/// The same of the part of it from its first pixel to the one after its last: the very pixels of the whole picture.
///
/// # Errors
/// If the ending is unknown or the file cannot be written.
pub fn save_part(path: &Path, film: &Film, display: &Display, part: [UVec2; 2]) -> Result<(), ImageError> {
    let size = film.size();
    let [min, max] = part.map(|corner| corner.min(size));
    match PictureFormat::of(path)? {
        PictureFormat::Png => {
            let bytes = develop(film, None, display);
            let pixels: Vec<[u8; 4]> = bytes.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
            write_png(path, max - min, cut(&pixels, size.x, [min, max]).into_flattened())
        }
        PictureFormat::Exr => write_exr(path, max - min, &cut(&linear_pixels(film), size.x, [min, max])),
    }
}

/// Of rows of `width` pixels, those between two corners.
fn cut<T: Copy>(pixels: &[T], width: u32, [min, max]: [UVec2; 2]) -> Vec<T> {
    let rows = pixels.chunks_exact(width as usize).take(max.y as usize).skip(min.y as usize);
    rows.flat_map(|row| &row[min.x as usize..max.x as usize]).copied().collect()
}

/// The film as it is shown, as a PNG that knows its `recipe`.
///
/// # Errors
/// If the file cannot be written.
pub fn save_with_recipe(
    path: &Path,
    film: &Film,
    display: &Display,
    recipe: &Recipe,
) -> Result<(), ImageError> {
    let image = LinearImage::of(film);
    let mut bytes = Vec::new();
    let rgba = develop_image(&image, display);
    let broken = |error: png::EncodingError| std::io::Error::other(error.to_string());
    let io = |source| ImageError::Io { path: path.to_path_buf(), source };
    super::recipe::write_png(&mut bytes, &rgba, image.size.to_array(), recipe).map_err(|e| io(broken(e)))?;
    write_whole(path, &bytes)
}

fn write_png(path: &Path, size: UVec2, rgba: Vec<u8>) -> Result<(), ImageError> {
    let image = RgbaImage::from_raw(size.x, size.y, rgba).unwrap_or_default();
    encode(path, &image::DynamicImage::from(image).into_rgb8().into(), ImageFormat::Png)
}

fn write_exr(path: &Path, size: UVec2, pixels: &[Vec3]) -> Result<(), ImageError> {
    let linear = pixels.iter().flat_map(Vec3::to_array).collect();
    let image = Rgb32FImage::from_raw(size.x, size.y, linear).unwrap_or_default();
    encode(path, &image.into(), ImageFormat::OpenExr)
}

fn encode(path: &Path, image: &image::DynamicImage, format: ImageFormat) -> Result<(), ImageError> {
    let mut bytes = Cursor::new(Vec::new());
    let codec = |source| ImageError::Codec { path: path.to_path_buf(), source };
    image.write_to(&mut bytes, format).map_err(codec)?;
    write_whole(path, bytes.get_ref())
}

/// Mean radiances, rows from the top. Where there was not even time for a sample of each pixel, the others are guessed.
#[must_use]
pub fn linear_pixels(film: &Film) -> Vec<Vec3> {
    if film.has_gaps() { guessed_blindly(film) } else { means(film) }
}

/// Writes beside `path` and renames, so that nobody ever sees half a file.
///
/// # Errors
/// If the file system refuses.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let io = |source| ImageError::Io { path: path.to_path_buf(), source };
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, path)).map_err(|source| {
        // The reason for the failure matters more than what is left over.
        let _ = std::fs::remove_file(&part);
        io(source)
    })
}
