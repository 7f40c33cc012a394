//! `.gltf` text or `.glb` container: which bytes are the JSON, which the binary data.

use crate::load::error::LoadError;
use crate::load::first_bytes::not_a_scene;

/// The two parts of a file.
pub(super) struct Container<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
}

/// Splits by the first bytes, not by the name. Every length is checked against the file's.
pub(super) fn split<'a>(file: &str, bytes: &'a [u8]) -> Result<Container<'a>, LoadError> {
    if bytes.is_empty() {
        return Err(LoadError::broken(file, "content", "the file is empty, not JSON"));
    }
    if let Some(what) = not_a_scene(bytes) {
        return Err(LoadError::broken(file, "content", format!("is {what}")));
    }
    // Some writers fill up with zeros, which are no blanks.
    let without_zeros = |json: &'a [u8]| {
        let end = json.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
        &json[..end]
    };
    if !bytes.starts_with(b"glTF") {
        return Ok(Container { json: without_zeros(bytes), binary: None });
    }
    let damaged = |problem: String| LoadError::broken(file, "GLB header", problem);
    let (Some(version), Some(total)) = (word(bytes, 4), word(bytes, 8)) else {
        return Err(damaged("truncated: shorter than a header of 12 bytes".to_owned()));
    };
    if version != 2 {
        return Err(damaged(format!("container version {version}; Penumbra reads version 2")));
    }
    if total as u64 > bytes.len() as u64 {
        let problem = format!("truncated: says a length of {total} bytes, the file has {}", bytes.len());
        return Err(damaged(problem));
    }
    let mut rest = &bytes[12..(total as usize).max(12)];
    let (mut json, mut binary) = (None, None);
    while !rest.is_empty() {
        let (Some(length), Some(kind)) = (word(rest, 0), word(rest, 4)) else {
            return Err(damaged("truncated: incomplete chunk header at the end".to_owned()));
        };
        let Some(data) = rest[8..].get(..length as usize) else {
            let left = rest.len() - 8;
            return Err(damaged(format!(
                "truncated: chunk says a length of {length} bytes, {left} are left"
            )));
        };
        match &kind.to_le_bytes() {
            b"JSON" if json.is_none() => json = Some(without_zeros(data)),
            b"BIN\0" if binary.is_none() => binary = Some(data),
            _ => {} // The specification asks to skip what is not known.
        }
        // Some writers forget to fill up to a multiple of four. An odd length at the very end would point past it.
        let end = 8 + length as usize;
        let is_next = word(rest, end + 4).is_some_and(|kind| &kind.to_le_bytes() == b"BIN\0");
        let next = if is_next { end } else { end.next_multiple_of(4) };
        rest = rest.get(next..).unwrap_or_default();
    }
    let json = json.ok_or_else(|| damaged("no JSON chunk: length too small or wrong type".to_owned()))?;
    Ok(Container { json, binary })
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4)?.try_into().ok().map(u32::from_le_bytes)
}
