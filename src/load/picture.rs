//! Image files → texels. A picture that cannot be had is a warning and a magenta checker, never an error.

use super::error::ReadError;
use super::ktx2;
use super::report::{Kind, Phase, Sink};
use crate::scene::Texels;
use image::error::ImageError;
use image::{ColorType, ImageDecoder, ImageFormat, ImageReader, Limits, Rgb};
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::Cursor;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

/// Most texels of one picture, however much memory there is: 32768 squared, 4 GiB decoded.
const MOST_TEXELS: u64 = 1 << 30;

/// A picture to decode.
pub(super) struct Picture<'a> {
    /// How messages name it, e.g. `image 3 (wood.png)`.
    pub(super) label: String,
    /// The bytes of the file.
    pub(super) bytes: Result<Cow<'a, [u8]>, ReadError>,
    /// Formats beyond PNG and JPEG deserve a warning (glTF allows no others).
    pub(super) strict: bool,
    /// What is where it cannot be had: the [`stand_in`], or nothing, as the caller decides.
    pub(super) instead: &'static str,
    /// Its brightness is wanted in 16 bits, if it has so many: slopes of heights in 8 bits are stairs.
    pub(super) deep: bool,
}

/// A decoded picture.
pub(super) struct Decoded {
    pub(super) texels: Arc<Texels>,
    /// [`Picture::deep`]: the mean of red, green and blue, from 0 to 65535; none if 8 bits say it all.
    pub(super) brightness: Option<Vec<u16>>,
}

/// [`Picture::instead`] for what shows the [`stand_in`].
pub(super) const CHECKER: &str = "a magenta checker stands in";

/// Said of a picture whose 16 bits a channel are cut.
pub(super) const IN_EIGHT_BITS: &str = "image of 16 bits a channel: kept in 8";

/// What happened to a picture.
struct Note(Kind, String);

/// Decodes all pictures side by side; `file` is the scene that names them.
///
/// None where a picture cannot be had, which is told.
pub(super) fn decode_all(file: &str, pictures: &[Picture<'_>], sink: &mut Sink<'_>) -> Vec<Option<Decoded>> {
    // What decoders make of it is there beside it for a while.
    let affordable: Vec<bool> = pictures
        .iter()
        .map(|picture| {
            let memory =
                picture.bytes.as_ref().ok().and_then(|bytes| memory(bytes, picture.deep)).unwrap_or(0);
            sink.budget.take(memory, file, &picture.label).is_ok()
        })
        .collect();
    let done = AtomicUsize::new(0);
    let watcher = &sink.options.watcher;
    let decoded: Vec<(Option<Decoded>, Vec<Note>)> = pictures
        .par_iter()
        .zip(affordable)
        .map(|(picture, affordable)| {
            let part = done.fetch_add(1, Ordering::Relaxed) as f32 / pictures.len() as f32;
            watcher.tell(Phase::Images, part);
            let mut remarks = Vec::new();
            let result = match &picture.bytes {
                Err(why) => Err(format!("image {why}")),
                Ok(_) if !affordable => {
                    Err("image left out: too large for the memory allowed (see --max-memory)".to_owned())
                }
                Ok(bytes) => decode(bytes, picture, &mut remarks),
            };
            let decoded = result.map_err(|why| {
                remarks.push(Note(Kind::Ignored, format!("{why}; {}", picture.instead)));
            });
            (decoded.ok(), remarks)
        })
        .collect();
    decoded
        .into_iter()
        .zip(pictures)
        .map(|((decoded, remarks), picture)| {
            for Note(kind, what) in remarks {
                sink.remark(kind, file, &picture.label, what, 1);
            }
            decoded
        })
        .collect()
}

/// Magenta and black: what is missing should be seen.
pub(super) fn stand_in() -> Arc<Texels> {
    let (magenta, black) = ([255, 0, 255, 255], [0, 0, 0, 255]);
    let texels = (0..64).map(|i| if (i % 8 + i / 8) % 2 == 0 { magenta } else { black }).collect();
    Arc::new(Texels { width: 8, height: 8, texels })
}

/// Bytes that decoding takes: the texels, and the picture as its decoder has it; if `deep`, its brightness too.
fn memory(bytes: &[u8], deep: bool) -> Option<u64> {
    if ktx2::size(bytes).is_some() {
        return ktx2::memory(bytes);
    }
    let decoder = reader_of(bytes).ok()?.into_decoder().ok()?;
    let (width, height) = decoder.dimensions();
    let each = if deep && is_deep(decoder.color_type()) { 12 } else { 4 };
    Some((each * u64::from(width) * u64::from(height)).saturating_add(decoder.total_bytes()))
}

/// By the first bytes and not by the name; TGA has none of its own, but a header in which little is possible.
fn reader_of(bytes: &[u8]) -> std::io::Result<ImageReader<Cursor<&[u8]>>> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    if reader.format().is_none() && is_targa(bytes) {
        reader.set_format(ImageFormat::Tga);
    }
    Ok(reader)
}

fn is_targa(bytes: &[u8]) -> bool {
    let Some(&[_, map, kind, _, _, _, _, map_depth, _, _, _, _, w0, w1, h0, h1, depth, _]) =
        bytes.first_chunk()
    else {
        return false;
    };
    let indexed = matches!(kind, 1 | 9);
    let depths: &[u8] = match kind {
        1 | 3 | 9 | 11 => &[8, 16],
        2 | 10 => &[15, 16, 24, 32],
        _ => &[],
    };
    let has_size = u16::from_le_bytes([w0, w1]) > 0 && u16::from_le_bytes([h0, h1]) > 0;
    let has_map = map == 1 && matches!(map_depth, 15 | 16 | 24 | 32);
    has_size && depths.contains(&depth) && (has_map || !indexed && map == 0)
}

/// Whether a channel has 16 bits; what has more is no picture of 8 bits by another name.
fn is_deep(color: ColorType) -> bool {
    matches!(color, ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16)
}

/// Decodes one picture.
fn decode(bytes: &[u8], picture: &Picture<'_>, remarks: &mut Vec<Note>) -> Result<Decoded, String> {
    if ktx2::size(bytes).is_some() {
        let texels = Arc::new(ktx2::decode(bytes, MOST_TEXELS)?);
        return Ok(Decoded { texels, brightness: None });
    }
    if let Some(format) = foreign_format(bytes) {
        return Err(format!("image format {format} is not supported"));
    }
    let reader = reader_of(bytes).map_err(|error| format!("image cannot be read: {error}"))?;
    let Some(format) = reader.format() else {
        return Err("image format not recognised".to_owned());
    };
    if picture.strict && !matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP) {
        let what = format!("image format {format:?} is not allowed in glTF; used all the same");
        remarks.push(Note(Kind::Repaired, what));
    }
    if format == ImageFormat::Jpeg && !has_jpeg_end(bytes) {
        remarks.push(Note(Kind::Repaired, "JPEG image is truncated; the missing part is grey".to_owned()));
    }
    let mut decoder = reader.into_decoder().map_err(|error| describe(&error))?;
    let (width, height) = decoder.dimensions();
    let texels = u64::from(width) * u64::from(height);
    if texels == 0 {
        return Err("image is empty (0 texels)".to_owned());
    }
    if texels > MOST_TEXELS {
        let most = "more than 32768 x 32768 texels: scale it down";
        return Err(format!("image of {width} x {height} is too large ({most})"));
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some(16 * texels + (64 << 20));
    decoder.set_limits(limits).map_err(|error| describe(&error))?;
    if format == ImageFormat::Jpeg && jpeg_components(bytes) == Some(4) {
        remarks.push(Note(Kind::Approximated, "CMYK JPEG image: its colours are approximate".to_owned()));
    }
    if matches!(format, ImageFormat::Hdr | ImageFormat::OpenExr) {
        let what = "image with high dynamic range: cut at 1 and kept in 8 bits";
        remarks.push(Note(Kind::Approximated, what.to_owned()));
    }
    let is_deep = is_deep(decoder.color_type());
    if is_deep && !picture.deep {
        remarks.push(Note(Kind::Approximated, IN_EIGHT_BITS.to_owned()));
    }
    let mut brightness = None;
    let rgba = match jpeg_rgba(bytes).filter(|_| format == ImageFormat::Jpeg) {
        Some(rgba) => rgba,
        None => {
            let decoded = image::DynamicImage::from_decoder(decoder).map_err(|error| describe(&error))?;
            if is_deep && picture.deep {
                let mean = |Rgb(rgb): &Rgb<u16>| (rgb.map(u32::from).iter().sum::<u32>() / 3) as u16;
                brightness = Some(decoded.to_rgb16().pixels().map(mean).collect());
            }
            decoded.into_rgba8().into_raw()
        }
    };
    // No copy: a texel needs no other place than its bytes.
    let texels = bytemuck::try_cast_vec(rgba).unwrap_or_else(|(_, rgba)| rgba.as_chunks::<4>().0.to_vec());
    if texels.len() as u64 == u64::from(width) * u64::from(height) {
        Ok(Decoded { texels: Arc::new(Texels { width, height, texels }), brightness })
    } else {
        Err("image has the wrong number of texels".to_owned())
    }
}

/// The bytes of a JPEG picture of one or three components, as `image` finds them by the same decoder, but without a picture in
/// three bytes before that in four. `None` if it is another, or not whole.
fn jpeg_rgba(bytes: &[u8]) -> Option<Vec<u8>> {
    if !matches!(jpeg_components(bytes), Some(1 | 3)) {
        return None;
    }
    let options = DecoderOptions::default()
        .set_strict_mode(false)
        .set_max_width(usize::MAX)
        .set_max_height(usize::MAX)
        .jpeg_set_out_colorspace(ColorSpace::RGBA);
    JpegDecoder::new_with_options(ZCursor::new(bytes), options).decode().ok()
}

fn describe(error: &ImageError) -> String {
    let reason = error.to_string().replace('\n', " ");
    format!("image cannot be decoded ({reason})")
}

/// Formats that scenes refer to and that are not decoded.
fn foreign_format(bytes: &[u8]) -> Option<&'static str> {
    const MAGIC: [(&[u8], &str); 3] =
        [(b"\xabKTX 11\xbb", "KTX"), (b"DDS ", "DDS"), (b"sB", "Basis Universal")];
    MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|&(_, name)| name)
}

/// Whether the end-of-image marker is there.
fn has_jpeg_end(bytes: &[u8]) -> bool {
    bytes.windows(2).rev().take(1 << 16).any(|pair| pair == [0xff, 0xd9])
}

/// Colour components according to the frame header.
fn jpeg_components(bytes: &[u8]) -> Option<u8> {
    let mut at = 2;
    loop {
        let header = bytes.get(at..at + 4)?;
        let [0xff, marker, high, low] = *header else {
            return None;
        };
        let is_frame = (0xc0..=0xcf).contains(&marker) && ![0xc4, 0xc8, 0xcc].contains(&marker);
        if is_frame {
            return bytes.get(at + 9).copied();
        }
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::jpeg::JpegEncoder;
    use image::{DynamicImage, ExtendedColorType};

    #[test]
    fn jpeg_pictures_are_those_that_image_decodes() -> Result<(), String> {
        let bytes: Vec<u8> = (0..33 * 17 * 3).map(|i: u32| (i * i / 7) as u8).collect();
        for (color, channels) in [(ExtendedColorType::Rgb8, 3), (ExtendedColorType::L8, 1)] {
            let mut jpeg = Vec::new();
            JpegEncoder::new(&mut jpeg)
                .encode(&bytes[..33 * 17 * channels], 33, 17, color)
                .map_err(|error| error.to_string())?;
            assert!(jpeg_rgba(&jpeg).is_some());
            let bytes = Err(ReadError::Missing);
            let picture =
                Picture { label: String::new(), bytes, strict: true, instead: CHECKER, deep: false };
            let ours = decode(&jpeg, &picture, &mut Vec::new())?.texels;
            let theirs = image::load_from_memory(&jpeg).map(DynamicImage::into_rgba8);
            let theirs = theirs.map_err(|error| error.to_string())?;
            assert_eq!((ours.width, ours.height), theirs.dimensions());
            assert_eq!(ours.texels.as_flattened(), theirs.as_raw().as_slice());
        }
        Ok(())
    }
}
