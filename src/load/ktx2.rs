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

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4)?.try_into().ok().map(u32::from_le_bytes)
}
