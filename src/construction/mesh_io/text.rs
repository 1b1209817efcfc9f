//! Text files line by line, with errors that name the line.

use std::io::{self, BufRead};
use std::path::Path;
use std::str::FromStr;

use super::error::{MeshIoError, Place};
use super::input::{BYTE_ORDER_MARK, Input};

/// Lends the lines of a file that hold anything, one after the other.
pub(super) struct Lines<'i, 'a> {
    input: &'i mut Input<'a>,
    comment: Option<char>,
    /// Whether a backslash at the end joins a line to the next.
    continued: bool,
    bytes: Vec<u8>,
    /// Whether the last line was ended by a carriage return, to which a line feed behind it belongs.
    after_return: bool,
    text: String,
    pub number: u64,
}

impl<'i, 'a> Lines<'i, 'a> {
    pub fn new(input: &'i mut Input<'a>) -> Self {
        let (bytes, text) = (Vec::new(), String::new());
        Self { input, comment: None, continued: false, bytes, after_return: false, text, number: 0 }
    }

    /// The rest of a line behind `mark` is skipped.
    pub fn with_comments(self, mark: char) -> Self {
        Self { comment: Some(mark), ..self }
    }

    pub fn with_continuation(self) -> Self {
        Self { continued: true, ..self }
    }

    /// The next line that is not blank, or `None` at the end of the file.
    pub fn next(&mut self) -> Result<Option<Line<'_>>, MeshIoError> {
        self.text.clear();
        loop {
            self.number += 1;
            let place = Place::Line(self.number);
            let read = self.read_line().map_err(|e| self.input.io(place, e))?;
            // Files that have been joined have byte order marks inside.
            let bytes = self.bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&self.bytes);
            // Names of groups and materials come in any encoding; all that matters here is ASCII.
            let text = String::from_utf8_lossy(bytes);
            let text =
                self.comment.map_or(&*text, |mark| text.split(mark).next().unwrap_or("")).trim_ascii_end();
            let joined = text.strip_suffix('\\').filter(|_| self.continued);
            if let Some(start) = joined {
                self.text.push_str(start);
                self.text.push(' ');
                continue;
            }
            self.text.push_str(text);
            if !read || !self.text.trim_ascii().is_empty() {
                break;
            }
            self.text.clear();
        }
        let line = Line { file: self.input.path, number: self.number, rest: self.text.trim_ascii() };
        Ok(if line.is_empty() { None } else { Some(line) })
    }

    /// Sets `bytes` to the next line, which ends with a line feed, a carriage return, or both; false at the end of the file.
    fn read_line(&mut self) -> io::Result<bool> {
        self.bytes.clear();
        loop {
            let buffer = self.input.fill_buf()?;
            let Some(&first) = buffer.first() else { return Ok(!self.bytes.is_empty()) };
            if std::mem::take(&mut self.after_return) && first == b'\n' {
                self.input.consume(1);
                continue;
            }
            let end = buffer.iter().position(|b| matches!(b, b'\n' | b'\r'));
            self.bytes.extend_from_slice(&buffer[..end.unwrap_or(buffer.len())]);
            let read = end.map_or(buffer.len(), |end| end + 1);
            self.after_return = end.is_some_and(|end| buffer[end] == b'\r');
            self.input.consume(read);
            if end.is_some() {
                return Ok(true);
            }
        }
    }

    /// The error if there is more in the file, which announces no more than has been read.
    pub fn expect_end(&mut self) -> Result<(), MeshIoError> {
        let file = self.input.path;
        let Some(line) = self.next()? else { return Ok(()) };
        Err(left_over(file, line.number, line.rest))
    }

    /// The next line, where the file may not end yet.
    pub fn expect_next(&mut self) -> Result<Line<'_>, MeshIoError> {
        let truncated = self.truncated(self.number + 1);
        self.next()?.ok_or(truncated)
    }

    /// The error for a file that ends where there should be a line `number`.
    pub fn truncated(&self, number: u64) -> MeshIoError {
        MeshIoError::Truncated { file: self.input.path.to_owned(), place: Place::Line(number) }
    }
}

/// A line, read word by word.
pub(super) struct Line<'l> {
    file: &'l Path,
    pub number: u64,
    rest: &'l str,
}

impl<'l> Line<'l> {
    pub fn word(&mut self) -> Option<&'l str> {
        if self.is_empty() {
            return None;
        }
        let end = self.rest.find(|c: char| c.is_ascii_whitespace()).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest.trim_ascii_start();
        Some(word)
    }

    /// Whether all words have been read.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// Goes past `prefix` if it comes next, not necessarily as a word of its own.
    pub fn skip(&mut self, prefix: &str) -> bool {
        let rest = self.rest.strip_prefix(prefix);
        self.rest = rest.unwrap_or(self.rest).trim_ascii_start();
        rest.is_some()
    }

    /// The next word as a number or whatever else `expected` says.
    pub fn parse<T: FromStr>(&mut self, expected: &'static str) -> Result<T, MeshIoError> {
        let word = self.word().unwrap_or("");
        word.parse().map_err(|_| self.malformed(expected, word))
    }

    /// The next three words as a point.
    pub fn position(&mut self) -> Result<[f64; 3], MeshIoError> {
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            let word = self.word().unwrap_or("");
            *coordinate = parse_coordinate(self.file, self.number, word)?;
        }
        Ok(position)
    }

    pub fn malformed(&self, expected: &'static str, found: &str) -> MeshIoError {
        malformed(self.file, self.place(), expected, found)
    }

    pub fn index_out_of_range(&self, index: i64, vertices: usize) -> MeshIoError {
        MeshIoError::IndexOutOfRange { file: self.file.to_owned(), place: self.place(), index, vertices }
    }

    fn place(&self) -> Place {
        Place::Line(self.number)
    }
}

/// A coordinate in the range of 32 bits.
pub(super) fn parse_coordinate(file: &Path, line: u64, word: &str) -> Result<f64, MeshIoError> {
    let place = Place::Line(line);
    let value = word.parse().map_err(|_| malformed(file, place, "a coordinate", word))?;
    check_coordinate(file, place, value)
}

/// Refuses what is not a number or beyond the range of 32 bits.
pub(super) fn check_coordinate(file: &Path, place: Place, value: f64) -> Result<f64, MeshIoError> {
    if (value as f32).is_finite() {
        return Ok(value);
    }
    Err(MeshIoError::NotFinite { file: file.to_owned(), place, value })
}

pub(super) fn malformed(file: &Path, place: Place, expected: &'static str, found: &str) -> MeshIoError {
    MeshIoError::Malformed { file: file.to_owned(), place, expected, found: beginning(found) }
}

/// The error for text behind the end of what the file announces.
pub(super) fn left_over(file: &Path, line: u64, found: &str) -> MeshIoError {
    let found = format!("{:?}", beginning(found));
    MeshIoError::LeftOver { file: file.to_owned(), place: Place::Line(line), found }
}

/// A line of a damaged file can be the whole file.
fn beginning(text: &str) -> String {
    text.chars().take(40).collect()
}
