//! Pictures of the window as files.

use crate::image::recipe::{Recipe, write_png};
use glam::UVec2;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Writes `rgba`, whose alpha is left out, to the first of `{stem}_1.png`, `{stem}_2.png`, … in
/// `directory` that does not exist yet. Returns its path.
///
/// # Errors
/// What went wrong, with the path.
pub fn save(
    rgba: &[u8],
    size: UVec2,
    directory: &Path,
    stem: &str,
    recipe: &Recipe,
) -> Result<PathBuf, String> {
    // A stem is a name, not a way to another directory.
    let stem: String = stem.chars().map(|c| if std::path::is_separator(c) { '_' } else { c }).collect();
    for n in 1_u32.. {
        let path = directory.join(format!("{stem}_{n}.png"));
        // `create_new` looks and creates in one: two programs cannot get the same number.
        match File::create_new(&path) {
            Ok(file) => {
                return write(file, rgba, size, recipe)
                    .map(|()| path.clone())
                    .map_err(|e| format!("{}: {e}", path.display()));
            }
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(format!("{}: {error}", path.display())),
        }
    }
    Err(format!("{}: no number is left for {stem}", directory.display()))
}

fn write(file: File, rgba: &[u8], size: UVec2, recipe: &Recipe) -> Result<(), String> {
    let mut file = BufWriter::new(file);
    write_png(&mut file, rgba, size.to_array(), recipe).map_err(|error| error.to_string())?;
    file.flush().map_err(|error| error.to_string())
}

/// `picture` of `from` pixels, scaled to fill `target` of `to` pixels: nearest, since one shall see
/// what a preview is.
pub fn scale_into(picture: &[u8], from: UVec2, target: &mut [u8], to: UVec2) {
    if from == to {
        target.copy_from_slice(picture);
        return;
    }
    let nearest = |at: u32, to: u32, from: u32| {
        ((2 * u64::from(at) + 1) * u64::from(from) / (2 * u64::from(to))) as usize
    };
    let columns: Vec<usize> = (0..to.x).map(|x| nearest(x, to.x, from.x) * 4).collect();
    for (y, row) in (0..to.y).zip(target.chunks_exact_mut(to.x as usize * 4)) {
        let start = nearest(y, to.y, from.y) * from.x as usize * 4;
        let source = &picture[start..start + from.x as usize * 4];
        for (pixel, &x) in row.chunks_exact_mut(4).zip(&columns) {
            pixel.copy_from_slice(&source[x..x + 4]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_go_up_and_nothing_is_overwritten() {
        let directory = std::env::temp_dir().join(format!("penumbra-screenshot-{}", std::process::id()));
        std::fs::create_dir_all(&directory).unwrap();
        let rgba = [10, 20, 30, 255, 40, 50, 60, 255];
        let size = UVec2::new(2, 1);
        let first = save(&rgba, size, &directory, "a/b", &Recipe::default()).unwrap();
        let second = save(&rgba, size, &directory, "a/b", &Recipe::default()).unwrap();
        assert!(first.ends_with("a_b_1.png") && second.ends_with("a_b_2.png"));
        let read = image::open(&first).unwrap().to_rgb8();
        assert_eq!(read.into_raw(), [10, 20, 30, 40, 50, 60]);
        std::fs::remove_dir_all(&directory).unwrap();
        assert!(save(&rgba, size, &directory, "a", &Recipe::default()).unwrap_err().contains("a_1.png"));
    }

    #[test]
    fn scaling_up_by_two_repeats_and_back_is_the_same() {
        let small: Vec<u8> = (0..2 * 3 * 4).collect();
        let (from, to) = (UVec2::new(2, 3), UVec2::new(4, 6));
        let mut large = vec![0; 4 * 6 * 4];
        scale_into(&small, from, &mut large, to);
        assert_eq!(large[..4], large[4..8]);
        assert_eq!(large[..16], large[16..32]);
        let mut again = vec![0; small.len()];
        scale_into(&large, to, &mut again, from);
        assert_eq!(again, small);
    }

    #[test]
    fn any_size_goes_into_any_size() {
        for from in [UVec2::new(1, 1), UVec2::new(7, 3)] {
            for to in [UVec2::new(1, 1), UVec2::new(5, 11), UVec2::new(3, 1)] {
                let picture = vec![9; from.element_product() as usize * 4];
                let mut target = vec![0; to.element_product() as usize * 4];
                scale_into(&picture, from, &mut target, to);
                assert!(target.iter().all(|&c| c == 9));
            }
        }
    }
}
