//! Text files word by word, wherever lines end.

use std::io::{self, BufRead};

use super::error::{MeshIoError, Place};
use super::input::Input;
use super::text::{left_over, malformed, parse_coordinate};

/// Lends the words of a file one after the other.
pub(super) struct Words<'i, 'a> {
    pub input: &'i mut Input<'a>,
    word: Vec<u8>,
    text: String,
    /// The line of the last word.
    pub line: u64,
    /// The line that is being read.
    current: u64,
    after_return: bool,
    /// Whether the last word is to be lent again.
    again: bool,
}

impl<'i, 'a> Words<'i, 'a> {
    /// The words from line `line` on, at whose beginning the input stands.
    pub fn new(input: &'i mut Input<'a>, line: u64) -> Self {
        let (word, text) = (Vec::new(), String::new());
        Self { input, word, text, line, current: line, after_return: false, again: false }
    }

    /// The next word, or `None` at the end of the file, which `line` then tells.
    pub fn next(&mut self) -> io::Result<Option<&str>> {
        if !std::mem::take(&mut self.again) {
            self.read()?;
        }
        // All words with a meaning are ASCII.
        Ok(match std::str::from_utf8(&self.word) {
            Ok("") => None,
            Ok(word) => Some(word),
            Err(_) => {
                self.text = String::from_utf8_lossy(&self.word).into_owned();
                Some(&self.text)
            }
        })
    }

    /// The next word as a coordinate.
    pub fn coordinate(&mut self) -> Result<f64, MeshIoError> {
        let outcome = self.next().map(|_| ());
        outcome.map_err(|e| self.input.io(Place::Line(self.line), e))?;
        let word = std::str::from_utf8(&self.word).map_err(|_| self.malformed("a coordinate"))?;
        parse_coordinate(self.input.path, self.line, word)
    }

    /// Lends the last word once more.
    pub fn put_back(&mut self) {
        self.again = true;
    }

    /// Sets `word` to the next one, empty at the end of the file.
    fn read(&mut self) -> io::Result<()> {
        self.word.clear();
        loop {
            let buffer = self.input.fill_buf()?;
            if buffer.is_empty() {
                break;
            }
            let mut at = 0;
            if self.word.is_empty() {
                for &byte in buffer.iter().take_while(|b| b.is_ascii_whitespace()) {
                    let pair = self.after_return && byte == b'\n';
                    self.current += u64::from(matches!(byte, b'\n' | b'\r') && !pair);
                    self.after_return = byte == b'\r';
                    at += 1;
                }
            }
            let length = buffer[at..].iter().position(u8::is_ascii_whitespace);
            let end = length.map_or(buffer.len(), |length| at + length);
            self.word.extend_from_slice(&buffer[at..end]);
            self.after_return &= self.word.is_empty();
            self.input.consume(end);
            if length.is_some() {
                break;
            }
        }
        self.line = self.current;
        Ok(())
    }

    /// The error for the last word.
    pub fn malformed(&self, expected: &'static str) -> MeshIoError {
        let found = String::from_utf8_lossy(&self.word);
        malformed(self.input.path, Place::Line(self.line), expected, &found)
    }

    /// The error if there is another word.
    pub fn expect_end(&mut self) -> Result<(), MeshIoError> {
        let mut found = String::new();
        let mut line = None;
        while found.len() < 80 {
            let word = self.next().map(|word| word.map(str::to_owned));
            let word = word.map_err(|e| self.input.io(Place::Line(self.line), e))?;
            // No more than a line of it.
            let Some(word) = word.filter(|_| *line.get_or_insert(self.line) == self.line) else { break };
            found += if found.is_empty() { "" } else { " " };
            found += &word;
        }
        match line {
            Some(line) if !found.is_empty() => Err(left_over(self.input.path, line, &found)),
            _ => Ok(()),
        }
    }
}
