//! Lines of text that others have written.

use std::io;
use std::path::Path as FilePath;

use super::error::PathError;

/// The text of a file. What is not UTF-8 is taken for Latin-1: all that matters to us is ASCII, and comments come in any
/// encoding that has it.
pub(super) fn read(file: &FilePath) -> Result<String, PathError> {
    let failure = |source| PathError::Read { file: file.to_owned(), source };
    let bytes = std::fs::read(file).map_err(failure)?;
    if matches!(bytes.as_slice(), [0xff, 0xfe, ..] | [0xfe, 0xff, ..]) {
        return Err(failure(io::Error::new(io::ErrorKind::InvalidData, "this is UTF-16 text, not UTF-8")));
    }
    let mark = '\u{feff}'.to_string();
    let bytes = bytes.strip_prefix(mark.as_bytes()).unwrap_or(&bytes);
    Ok(std::str::from_utf8(bytes)
        .map_or_else(|_| bytes.iter().map(|&byte| char::from(byte)).collect(), str::to_owned))
}

/// The lines of a text, ended by a line feed, a carriage return or both, without white space around them. Some editors
/// begin text with a byte order mark, which is no part of it.
pub(super) fn lines(text: &str) -> impl Iterator<Item = &str> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut rest = Some(text).filter(|text| !text.is_empty());
    std::iter::from_fn(move || {
        let text = rest?;
        let Some(end) = text.find(['\n', '\r']) else {
            return rest.take().map(str::trim);
        };
        let behind = &text[end..];
        let behind = behind.strip_prefix("\r\n").unwrap_or(&behind[1..]);
        rest = Some(behind).filter(|behind| !behind.is_empty());
        Some(text[..end].trim())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_in_three_ways() {
        let found: Vec<&str> = lines("\u{feff}a\r\n\r\nb \rc\n\n d").collect();
        assert_eq!(found, ["a", "", "b", "c", "", "d"]);
        assert_eq!(lines("").count(), 0);
        assert_eq!(lines("a\n").count(), 1);
    }
}
