//! How a picture was made, inside the picture: text chunks of a PNG, from which `render --from` makes it again.

use super::files::ImageError;
use std::io::{BufReader, Write};
use std::path::Path;

/// What it takes to make a picture again, and what one wants to know about it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recipe {
    /// Arguments of `render`: the scene, and how it looks.
    pub arguments: Vec<String>,
    /// For people: samples, noise.
    pub description: String,
}

const ARGUMENTS: &str = "penumbra:arguments";

/// Writes `rgba`, whose alpha is left out, as a PNG of `size` that knows its recipe.
///
/// # Errors
/// If it cannot be written.
pub fn write_png(
    to: impl Write,
    rgba: &[u8],
    [width, height]: [u32; 2],
    recipe: &Recipe,
) -> Result<(), png::EncodingError> {
    let rgb: Vec<u8> = rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let mut encoder = png::Encoder::new(to, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.add_text_chunk("Software".to_owned(), format!("penumbra {}", env!("CARGO_PKG_VERSION")))?;
    if !recipe.arguments.is_empty() {
        // Strings are always written.
        let arguments = serde_json::to_string(&recipe.arguments).unwrap_or_default();
        encoder.add_itxt_chunk(ARGUMENTS.to_owned(), arguments)?;
        encoder.add_itxt_chunk("Description".to_owned(), recipe.description.clone())?;
    }
    encoder.write_header()?.write_image_data(&rgb)
}

/// The arguments of the picture in `path`.
///
/// # Errors
/// If it is no PNG or none of ours.
pub fn read_arguments(path: &Path) -> Result<Vec<String>, ImageError> {
    let io = |source| ImageError::Io { path: path.to_path_buf(), source };
    let file = std::fs::File::open(path).map_err(io)?;
    let invalid = |why: String| io(std::io::Error::new(std::io::ErrorKind::InvalidData, why));
    // Text behind the picture counts too; a picture is no reason to fill the memory.
    let limits = png::Limits { bytes: 64 << 20 };
    let mut reader = png::Decoder::new_with_limits(BufReader::new(file), limits)
        .read_info()
        .map_err(|error| invalid(format!("{error} Give a screenshot of the window, a PNG")))?;
    let mut found = None;
    for finished in [false, true] {
        if finished {
            // What stands before the picture is what we write: no need to decode all.
            if found.is_some() || reader.finish().is_err() {
                break;
            }
        }
        let chunks = &reader.info().utf8_text;
        found =
            chunks.iter().find(|chunk| chunk.keyword == ARGUMENTS).and_then(|chunk| chunk.get_text().ok());
    }
    let text = found.ok_or_else(|| {
        invalid("doesn't say how it was made: only pictures that the window saves (F12, Ctrl+S) do".into())
    })?;
    serde_json::from_str(&text).map_err(|error| invalid(format!("its recipe is damaged: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_is_read_as_it_was_written_and_others_are_told() {
        let folder = std::env::temp_dir().join(format!("penumbra-recipe-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("a.png");
        let arguments: Vec<String> = ["scène \"x\".glb", "--spp", "4"].map(str::to_owned).into();
        let recipe = Recipe { arguments: arguments.clone(), description: "noise 1 %".to_owned() };
        write_png(std::fs::File::create(&path).unwrap(), &[1, 2, 3, 255, 4, 5, 6, 255], [2, 1], &recipe)
            .unwrap();
        assert_eq!(read_arguments(&path).unwrap(), arguments);
        assert_eq!(image::open(&path).unwrap().to_rgb8().into_raw(), [1, 2, 3, 4, 5, 6]);
        write_png(std::fs::File::create(&path).unwrap(), &[0; 4], [1, 1], &Recipe::default()).unwrap();
        let said = read_arguments(&path).unwrap_err().to_string();
        assert!(said.contains("a.png") && said.contains("how it was made"), "{said}");
        for broken in [&b""[..], b"no picture", b"\x89PNG\r\n\x1a\n\0\0"] {
            std::fs::write(&path, broken).unwrap();
            assert!(read_arguments(&path).is_err());
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
