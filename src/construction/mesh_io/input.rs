//! An open file that knows its name, its length and how far it has been read.

use std::error::Error;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::error::{MeshIoError, Place};
use crate::progress::Progress;

/// Progress is reported each time so many bytes have been read.
const REPORT_BYTES: u64 = 1 << 20;

/// U+FEFF in UTF-8.
pub(super) const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

pub(super) struct Input<'a> {
    pub path: &'a Path,
    /// Length of the file when it was opened, in bytes.
    pub length: u64,
    /// Bytes from the start of the file to the next one to be read.
    pub position: u64,
    reader: BufReader<File>,
    progress: Progress<'a>,
    next_report: u64,
}

impl<'a> Input<'a> {
    pub fn open(path: &'a Path, progress: Progress<'a>) -> Result<Self, MeshIoError> {
        let file = open_file(path)?;
        let length = file.metadata().map_err(|e| open_error(path, e))?.len();
        let reader = BufReader::with_capacity(1 << 16, file);
        Ok(Self { path, length, position: 0, reader, progress, next_report: 0 })
    }

    /// The error for an I/O failure while reading the thing at `place`.
    pub fn io(&self, place: Place, source: io::Error) -> MeshIoError {
        read_error(self.path, place, source)
    }

    /// The error for a decoding library's failure; libraries do not say where, so the place is how far they read.
    pub fn decode(&self, source: impl Into<Box<dyn Error + Send + Sync>>) -> MeshIoError {
        let place = Place::Byte(self.position);
        MeshIoError::Decode { file: self.path.to_owned(), place, source: readable(source.into()) }
    }

    pub fn unsupported(&self, feature: impl Into<String>) -> MeshIoError {
        MeshIoError::Unsupported { file: self.path.to_owned(), feature: feature.into() }
    }

    /// Goes past a byte order mark, with which some editors begin text in UTF-8. To be called at the start.
    pub fn skip_mark(&mut self) -> Result<(), MeshIoError> {
        let file = self.path;
        let start = self.fill_buf().map_err(|e| read_error(file, Place::Byte(0), e))?;
        if start.starts_with(BYTE_ORDER_MARK) {
            self.consume(BYTE_ORDER_MARK.len());
        } else if start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff") {
            return Err(self.unsupported("text in UTF-16: it has to be UTF-8 or ASCII"));
        }
        Ok(())
    }

    fn advance(&mut self, bytes: usize) {
        self.position += bytes as u64;
        if self.position >= self.next_report {
            (self.progress)(self.position.min(self.length), self.length);
            self.next_report = self.position + REPORT_BYTES;
        }
    }
}

/// Opens a file. What is not one, as a pipe, could not be read twice, and to open it could take for ever.
pub(super) fn open_file(path: &Path) -> Result<File, MeshIoError> {
    let kind = fs::metadata(path).map_err(|e| open_error(path, e))?;
    if !kind.is_file() {
        return Err(open_error(path, io::Error::new(io::ErrorKind::InvalidInput, "is not a file")));
    }
    File::open(path).map_err(|e| open_error(path, e))
}

pub(super) fn open_error(path: &Path, source: io::Error) -> MeshIoError {
    let file = path.to_owned();
    match source.kind() {
        io::ErrorKind::NotFound => MeshIoError::Missing { file },
        _ => MeshIoError::Io { file, source },
    }
}

/// An error of a decoding library, in one line: what libraries say may quote the file, which can hold anything.
pub(super) fn readable(error: Box<dyn Error + Send + Sync>) -> Box<dyn Error + Send + Sync> {
    let text = error.to_string();
    if text.len() <= LONGEST && !text.contains(char::is_control) { error } else { shown(&text).into() }
}

/// The longest text of a library that is passed on whole.
const LONGEST: usize = 200;

/// The beginning of a text from a file, with marks in the place of what can not be shown.
pub(super) fn shown(text: &str) -> String {
    text.chars().take(80).map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

/// The error for an I/O failure while reading the thing at `place`.
pub(super) fn read_error(path: &Path, place: Place, source: io::Error) -> MeshIoError {
    let file = path.to_owned();
    match source.kind() {
        io::ErrorKind::UnexpectedEof => MeshIoError::Truncated { file, place },
        // Decoders that work as a reader say so in this way.
        io::ErrorKind::InvalidData => MeshIoError::Decode { file, place, source: readable(source.into()) },
        _ => MeshIoError::Io { file, source },
    }
}

impl Read for Input<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.reader.read(buffer)?;
        self.advance(bytes);
        Ok(bytes)
    }
}

impl BufRead for Input<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.reader.fill_buf()
    }

    fn consume(&mut self, bytes: usize) {
        self.reader.consume(bytes);
        self.advance(bytes);
    }
}

impl Seek for Input<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = self.reader.seek(to)?;
        Ok(self.position)
    }
}
