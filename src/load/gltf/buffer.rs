//! Buffers, buffer views, and the URIs they come from.

use super::Document;
use crate::load::budget::Budget;
use crate::load::error::{LoadError, ReadError};
use crate::load::source::{Bytes, Folder, IMAGE_LIMIT, SCENE_LIMIT, percent_decoded};
use gltf::json::{Index, Root, buffer::View};
use std::borrow::Cow;

/// Data of one buffer, or why it is not there (an error only for those who want to read it).
pub(super) struct Buffer<'a> {
    data: Result<Cow<'a, [u8]>, String>,
}

/// Gets all buffers.
pub(super) fn read_all<'a>(
    root: &Root,
    folder: &Folder,
    binary: Option<&'a [u8]>,
    budget: &Budget,
) -> Vec<Buffer<'a>> {
    let one = |(i, buffer): (usize, &gltf::json::Buffer)| {
        let data = match (&buffer.uri, binary) {
            (Some(uri), _) => read_uri(folder, uri, SCENE_LIMIT.min(budget.left()))
                .map_err(|why| format!("{}: {why}", shorten(uri))),
            (None, Some(binary)) if i == 0 => Ok(Cow::Borrowed(binary)),
            (None, _) => Err("neither a URI nor a binary chunk holds its data".to_owned()),
        };
        if let Ok(Cow::Owned(bytes)) = &data {
            // It is there already, and was checked before.
            let _ = budget.take(bytes.len() as u64, "", "");
        }
        let wanted = buffer.byte_length.0;
        let checked = data.and_then(|data| {
            if data.len() as u64 >= wanted {
                Ok(data)
            } else {
                Err(format!("too short: byteLength is {wanted}, the data has {} bytes", data.len()))
            }
        });
        Buffer { data: checked }
    };
    root.buffers.iter().enumerate().map(one).collect()
}

/// Reads a `data:` URI or a percent-encoded reference to a file of the scene's folder.
pub(super) fn read_uri(folder: &Folder, uri: &str, limit: u64) -> Result<Bytes, ReadError> {
    if let Some(data) = data_of(uri) {
        return decode_data(data).map(Cow::Owned);
    }
    if uri.trim().is_empty() {
        return Err(ReadError::Data("has an empty URI: nothing says which file it is"));
    }
    let decoded = percent_decoded(uri);
    let plain = String::from_utf8_lossy(&decoded);
    match folder.read(&plain, limit) {
        Err(ReadError::Missing) if plain != uri => folder.read(uri, limit),
        done => done,
    }
}

/// As [`read_uri`], and whether what it names was found only by its bare name beside the scene: exporters write the
/// paths of the machine they ran on, or what a web server wants to know behind a question mark.
pub(super) fn read_image(folder: &Folder, uri: &str) -> (Result<Bytes, ReadError>, bool) {
    let why = match read_uri(folder, uri, IMAGE_LIMIT) {
        Err(why @ (ReadError::Missing | ReadError::Outside | ReadError::Scheme(_))) => why,
        done => return (done, false),
    };
    let decoded = percent_decoded(uri);
    let plain = String::from_utf8_lossy(&decoded);
    let path = plain.split(['?', '#']).next().unwrap_or_default();
    let names = [Some(plain.as_ref()), Some(path).filter(|path| *path != plain && !path.is_empty())];
    let found = names.into_iter().flatten().find_map(|name| folder.read_or_neighbour(name, IMAGE_LIMIT).ok());
    let is_found = found.is_some();
    (found.ok_or(why), is_found)
}

/// A URI short enough for a message.
pub(super) fn shorten(uri: &str) -> String {
    if data_of(uri).is_some() {
        return "data URI".to_owned();
    }
    let decoded = percent_decoded(uri);
    let text = String::from_utf8_lossy(&decoded);
    if text.chars().count() > 120 {
        text.chars().take(120).chain("...".chars()).collect()
    } else {
        text.into_owned()
    }
}

impl<'a> Document<'a> {
    /// The bytes of a buffer view and its stride.
    pub(super) fn view(&self, index: &Index<View>, user: &str) -> Result<(&[u8], Option<usize>), LoadError> {
        let view = self.at(&self.root.buffer_views, index, "buffer view", user)?;
        let stride = view.byte_stride.map(|stride| stride.0);
        if let Some(Some(decoded)) = self.unpacked.get(index.value()) {
            return Ok((decoded, stride));
        }
        let offset = view.byte_offset.map_or(0, |offset| offset.0);
        let place = format!("buffer view {}", index.value());
        Ok((self.bytes(&Index::new(view.buffer.value() as u32), offset, view.byte_length.0, &place)?, stride))
    }

    /// Bytes of a buffer.
    pub(super) fn bytes(
        &self,
        index: &Index<gltf::json::Buffer>,
        offset: u64,
        length: u64,
        place: &str,
    ) -> Result<&[u8], LoadError> {
        self.at(&self.root.buffers, index, "buffer", place)?;
        let buffer = &self.buffers[index.value()];
        let data =
            buffer.data.as_ref().map_err(|why| self.broken(format!("buffer {}", index.value()), why))?;
        let range = offset.checked_add(length).and_then(|end| {
            let (start, end) = (usize::try_from(offset).ok()?, usize::try_from(end).ok()?);
            data.get(start..end)
        });
        range.ok_or_else(|| {
            let size = data.len();
            let what = format!("offset {offset} + length {length} in a buffer of {size} bytes");
            self.broken(place, format!("out of bounds: {what}"))
        })
    }
}

/// What follows `data:`, in letters of any case (RFC 3986, 3.1).
fn data_of(uri: &str) -> Option<&str> {
    uri.split_at_checked(5).filter(|(scheme, _)| scheme.eq_ignore_ascii_case("data:")).map(|(_, data)| data)
}

fn decode_data(data: &str) -> Result<Vec<u8>, ReadError> {
    let (head, body) = data.split_once(',').ok_or(ReadError::Data("data URI without a comma"))?;
    if head.split(';').any(|word| word.eq_ignore_ascii_case("base64")) {
        // Where escaped, it is escaped text like any other (RFC 2397).
        let plain =
            if body.contains('%') { Cow::Owned(percent_decoded(body)) } else { body.as_bytes().into() };
        decode_base64(&plain).ok_or(ReadError::Data("data URI is not valid base64"))
    } else {
        Ok(percent_decoded(body))
    }
}

/// RFC 4648, either alphabet, with or without padding and line breaks.
fn decode_base64(text: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let (mut pending, mut bits) = (0_u32, 0_u32);
    let digits = text.iter().copied().filter(|byte| !byte.is_ascii_whitespace());
    let padding = text.trim_ascii_end().iter().rev().take_while(|&&byte| byte == b'=').count();
    let count = digits.clone().count().checked_sub(padding)?;
    if padding > 2 || count % 4 == 1 {
        return None;
    }
    for digit in digits.take(count) {
        let value = match digit {
            b'A'..=b'Z' => digit - b'A',
            b'a'..=b'z' => digit - b'a' + 26,
            b'0'..=b'9' => digit - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return None,
        };
        pending = pending << 6 | u32::from(value);
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            bytes.push((pending >> bits & 0xff) as u8);
        }
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_read_with_and_without_padding() {
        for text in ["aGFsbG8=", "aGFs\nbG8", "aGFs\nbG8=\n"] {
            assert_eq!(decode_base64(text.as_bytes()).as_deref(), Some(b"hallo".as_slice()));
        }
        for text in ["aGFsbG8*", "a", "a="] {
            assert_eq!(decode_base64(text.as_bytes()), None);
        }
        for uri in ["data:;base64,aGFs%62G8%3D", "DATA:text/plain;BASE64,aGFsbG8=", "Data:,hal%6Co"] {
            assert_eq!(decode_data(data_of(uri).unwrap()).unwrap(), b"hallo", "{uri}");
        }
        assert_eq!([data_of("dat"), data_of("database.bin"), data_of("da\u{fc}a:")], [None; 3]);
    }
}
