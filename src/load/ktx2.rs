//! KTX2 pictures that hold Basis Universal (`KHR_texture_basisu`): ETC1S and UASTC → RGBA.

use crate::scene::Texels;
use basisu::{DecodeFlags, TargetFormat, Transcoder};

const MAGIC: &[u8] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Width and height that the header says, if this is KTX2 at all.
pub(super) fn size(bytes: &[u8]) -> Option<[u32; 2]> {
    if !bytes.starts_with(MAGIC) {
        return None;
    }
    Some([word(bytes, 20)?, word(bytes, 24)?])
}

/// Bytes that decoding takes as the header says, if this is KTX2: texels twice, and the largest level unpacked.
pub(super) fn memory(bytes: &[u8]) -> Option<u64> {
    let [width, height] = size(bytes)?;
    let levels = word(bytes, 40).unwrap_or(0).clamp(1, 32) as usize;
    let unpacked = (0..levels).filter_map(|level| {
        let at = 80 + 24 * level + 16;
        bytes.get(at..at + 8)?.try_into().ok().map(u64::from_le_bytes)
    });
    Some((8 * u64::from(width) * u64::from(height)).saturating_add(unpacked.max().unwrap_or(0)))
}

/// Decodes the largest level.
pub(super) fn decode(bytes: &[u8], most_texels: u64) -> Result<Texels, String> {
    let (Some([width, height]), Some(format)) = (size(bytes), word(bytes, 12)) else {
        return Err("KTX2 image is truncated".to_owned());
    };
    let texels = u64::from(width) * u64::from(height);
    if texels == 0 || texels > most_texels {
        return Err(format!("KTX2 image of {width} x {height} is empty or too large"));
    }
    if format != 0 {
        let what = "only Basis Universal is read";
        return Err(format!("KTX2 image of Vulkan format {format}: {what}; save it as PNG, JPEG or WebP"));
    }
    if !levels_are_there(bytes, texels) {
        return Err(
            "KTX2 image cannot be decoded (its levels lie outside of the file or are too large)".to_owned()
        );
    }
    let damaged = |why: &dyn std::fmt::Debug| format!("KTX2 image cannot be decoded ({why:?})");
    let rgba = Transcoder::new(bytes)
        .and_then(|image| image.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE))
        .map_err(|why| damaged(&why))?;
    let (texels, _) = rgba.as_chunks::<4>();
    if texels.len() as u64 == u64::from(width) * u64::from(height) {
        Ok(Texels { width, height, texels: texels.to_vec() })
    } else {
        Err(damaged(&"wrong number of texels"))
    }
}

/// Whether all levels are within the file and none unpacks to more than its texels can take: the decoder believes
/// these numbers.
fn levels_are_there(bytes: &[u8], texels: u64) -> bool {
    // A block of 4 x 4 texels has 16 bytes at most; one row and column of blocks may be partly outside.
    let most = 16 * (texels / 16 + texels + 16);
    let Some(count) = word(bytes, 40).filter(|&count| count <= 32) else { return false };
    (0..count.max(1) as usize).all(|level| {
        let number = |field: usize| {
            let at = 80 + 24 * level + 8 * field;
            bytes.get(at..at + 8).and_then(|b| b.try_into().ok()).map(u64::from_le_bytes)
        };
        let (Some(offset), Some(length), Some(unpacked)) = (number(0), number(1), number(2)) else {
            return false;
        };
        offset.checked_add(length).is_some_and(|end| end <= bytes.len() as u64) && unpacked <= most
    })
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4)?.try_into().ok().map(u32::from_le_bytes)
}
