//! Statements of OBJ and MTL files: line ends of all systems, joined by `\`, without comments.

use super::super::error::LoadError;
use super::super::source::without_bom;
use std::borrow::Cow;

/// How `ZBrush` begins a comment that holds the colours of vertices, in hexadecimal digits: mask, red, green, blue.
pub(super) const POLYPAINT: &str = "#MRGB";

/// The text of a file, without byte order mark, and without the mark of CP/M or the zeros behind its last line. What is neither UTF-8 nor
/// marked as UTF-16 is taken for Latin-1, as older exporters write it.
pub(super) fn text_of<'a>(file: &str, bytes: &'a [u8]) -> Result<Cow<'a, str>, LoadError> {
    let wide = |of: fn([u8; 2]) -> u16| -> Result<Cow<'a, str>, LoadError> {
        let units: Vec<u16> = bytes.as_chunks::<2>().0.iter().skip(1).map(|&pair| of(pair)).collect();
        let text = String::from_utf16(&units).ok().filter(|text| !text.contains('\0'));
        text.map(Cow::Owned)
            .ok_or_else(|| LoadError::broken(file, "encoding", "damaged UTF-16 text; save it as UTF-8"))
    };
    if bytes.starts_with(b"\xff\xfe") {
        return wide(u16::from_le_bytes);
    }
    if bytes.starts_with(b"\xfe\xff") {
        return wide(u16::from_be_bytes);
    }
    let length = bytes.iter().rposition(|&byte| byte != 0 && byte != 0x1a).map_or(0, |last| last + 1);
    let (text, filling) = bytes.split_at(length);
    // In the middle of a line something is lost.
    let is_whole = text.ends_with(b"\n") || text.ends_with(b"\r") || filling.starts_with(b"\x1a");
    let bytes = if is_whole { text } else { bytes };
    if bytes.contains(&0) {
        return Err(LoadError::broken(file, "content", "binary data, not text in UTF-8"));
    }
    let bytes = without_bom(bytes);
    Ok(match str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect()),
    })
}

/// One statement.
pub(super) struct Statement<'a> {
    /// Of its first line, from 1.
    pub(super) line: u32,
    pub(super) keyword: &'a str,
    /// Without surrounding white space.
    pub(super) rest: &'a str,
}

/// Calls `visit` for each statement of `text`.
pub(super) fn for_each<E>(
    text: &str,
    mut visit: impl FnMut(Statement<'_>) -> Result<(), E>,
) -> Result<(), E> {
    let mut line = 0_u32;
    let mut joined: Option<(u32, String)> = None;
    let mut rest = text;
    while !rest.is_empty() {
        let end = rest.bytes().position(|byte| byte == b'\n' || byte == b'\r').unwrap_or(rest.len());
        let here = &rest[..end];
        rest = &rest[end..];
        rest = rest.strip_prefix("\r\n").unwrap_or_else(|| rest.get(1..).unwrap_or_default());
        line = line.saturating_add(1);
        // A comment that ends in a path is no beginning of anything.
        let is_comment = joined.is_none() && here.trim_start().starts_with('#');
        if let Some(part) = here.trim_end().strip_suffix('\\')
            && !is_comment
        {
            let (_, whole) = joined.get_or_insert_with(|| (line, String::new()));
            whole.push_str(part);
            whole.push(' ');
        } else if let Some((first, mut whole)) = joined.take() {
            whole.push_str(here);
            one(first, &whole, &mut visit)?;
        } else {
            one(line, here, &mut visit)?;
        }
    }
    match joined {
        Some((first, whole)) => one(first, &whole, &mut visit),
        None => Ok(()),
    }
}

/// What stands before a comment.
pub(super) fn before_comment(text: &str) -> &str {
    let is_comment = |(at, _): &(usize, &str)| text[..*at].ends_with(|c: char| c.is_ascii_whitespace());
    text.match_indices('#').find(is_comment).map_or(text, |(at, _)| text[..at].trim_end())
}

/// A name without the quotes that some exporters put around it.
pub(super) fn unquoted(name: &str) -> &str {
    name.strip_prefix('"').and_then(|name| name.strip_suffix('"')).unwrap_or(name)
}

fn one<E>(line: u32, text: &str, visit: &mut impl FnMut(Statement<'_>) -> Result<(), E>) -> Result<(), E> {
    let text = text.trim();
    if text.is_empty() || text.starts_with('#') && !text.starts_with(POLYPAINT) {
        return Ok(());
    }
    let (keyword, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
    visit(Statement { line, keyword, rest: rest.trim_start() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_line_ends_and_continuations_are_understood() {
        let mut seen = Vec::new();
        let text = "# a \\\r\nv 1 2\\ \n 3\rf  1 2\n\n\tusemtl  red paint \nf 1 2\\";
        let done: Result<(), ()> = for_each(text, |s| {
            seen.push(format!("{}:{}={}", s.line, s.keyword, s.rest));
            Ok(())
        });
        assert_eq!(done, Ok(()));
        assert_eq!(seen, ["2:v=1 2  3", "4:f=1 2", "6:usemtl=red paint", "7:f=1 2"]);
    }
}
