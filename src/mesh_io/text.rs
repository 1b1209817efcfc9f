//! Text files line by line, with errors that name the line.

use std::io::BufRead;
use std::path::Path;
use std::str::FromStr;

use super::input::Input;
use super::{MeshIoError, Place};

/// Lends the lines of a file that hold anything, one after the other.
pub(super) struct Lines<'i, 'a> {
    input: &'i mut Input<'a>,
    comment: Option<char>,
    /// Whether a backslash at the end joins a line to the next.
    continued: bool,
    bytes: Vec<u8>,
    text: String,
    pub number: u64,
}

impl<'i, 'a> Lines<'i, 'a> {
    pub fn new(input: &'i mut Input<'a>) -> Self {
        Self { input, comment: None, continued: false, bytes: Vec::new(), text: String::new(), number: 0 }
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
            self.bytes.clear();
            self.number += 1;
            let place = Place::Line(self.number);
            let read = self.input.read_until(b'\n', &mut self.bytes).map_err(|e| self.input.io(place, e))?;
            // Names of groups and materials come in any encoding; all that matters here is ASCII.
            let text = String::from_utf8_lossy(&self.bytes);
            let text =
                self.comment.map_or(&*text, |mark| text.split(mark).next().unwrap_or("")).trim_ascii_end();
            let joined = text.strip_suffix('\\').filter(|_| self.continued);
            if let Some(start) = joined {
                self.text.push_str(start);
                self.text.push(' ');
                continue;
            }
            self.text.push_str(text);
            if read == 0 || !self.text.trim_ascii().is_empty() {
                break;
            }
            self.text.clear();
        }
        let line = Line { file: self.input.path, number: self.number, rest: self.text.trim_ascii() };
        Ok(if line.is_empty() { None } else { Some(line) })
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
    pub fn position(&mut self) -> Result<[f32; 3], MeshIoError> {
        let mut position = [0_f32; 3];
        for coordinate in &mut position {
            let word = self.word().unwrap_or("");
            *coordinate = word.parse().map_err(|_| self.malformed("a coordinate", word))?;
            if !coordinate.is_finite() {
                let value = word.parse().unwrap_or(f64::NAN);
                return Err(MeshIoError::NotFinite {
                    file: self.file.to_owned(),
                    place: self.place(),
                    value,
                });
            }
        }
        Ok(position)
    }

    pub fn malformed(&self, expected: &'static str, found: &str) -> MeshIoError {
        // A line of a damaged file can be the whole file.
        let found = found.chars().take(40).collect();
        MeshIoError::Malformed { file: self.file.to_owned(), place: self.place(), expected, found }
    }

    pub fn index_out_of_range(&self, index: i64, vertices: usize) -> MeshIoError {
        MeshIoError::IndexOutOfRange { file: self.file.to_owned(), place: self.place(), index, vertices }
    }

    fn place(&self) -> Place {
        Place::Line(self.number)
    }
}
