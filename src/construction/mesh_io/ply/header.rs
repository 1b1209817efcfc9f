//! The header of a PLY file, which is text whatever follows it.

use std::io::{self, BufRead, Read};

use serde_ply::{PlyHeader, PlyReader};

use crate::mesh_io::error::{MeshIoError, Place};
use crate::mesh_io::input::{Input, read_error};

/// Reads the header, and says how many lines it has. The library that takes it apart wants UTF-8, though comments come in any
/// encoding, and lines that end with a line feed.
pub(super) fn read(input: &mut Input<'_>) -> Result<(PlyHeader, u64), MeshIoError> {
    input.skip_mark()?;
    let file = input.path;
    let start = input.fill_buf().map_err(|e| read_error(file, Place::Byte(0), e))?;
    if !start.starts_with(b"ply") || !start.get(3).is_none_or(u8::is_ascii_whitespace) {
        return Err(MeshIoError::WrongFormat { file: file.to_owned(), format: "PLY" });
    }
    // The end of the first line tells how the others end.
    let rest = start[3..].trim_ascii_start();
    let first_end = &start[3..start.len() - rest.len()];
    let end = if first_end.contains(&b'\n') || !first_end.contains(&b'\r') { b'\n' } else { b'\r' };
    let mut lines = HeaderLines { input: &mut *input, end, line: Vec::new(), at: 0, count: 0 };
    let outcome = PlyReader::from_reader(&mut lines).and_then(|reader| {
        let header = reader.header().clone();
        check_elements(&header)?;
        Ok(header)
    });
    let count = lines.count;
    match outcome {
        Ok(header) => Ok((header, count)),
        Err(error) => Err(input.io(Place::Byte(input.position), error.0)),
    }
}

/// Refuses elements without properties: their rows would take no bytes, and reading them all could take forever.
fn check_elements(header: &PlyHeader) -> io::Result<()> {
    match header.elem_defs.iter().find(|e| e.properties.is_empty() && e.count > 0) {
        None => Ok(()),
        Some(element) => {
            let message = format!("element {} has no properties", element.name);
            Err(io::Error::new(io::ErrorKind::InvalidData, message))
        }
    }
}

/// The lines of a header, read as they are asked for, so that nothing behind it is touched.
struct HeaderLines<'i, 'a> {
    input: &'i mut Input<'a>,
    end: u8,
    line: Vec<u8>,
    at: usize,
    count: u64,
}

impl HeaderLines<'_, '_> {
    fn fill(&mut self) -> io::Result<()> {
        (self.at, self.count) = (0, self.count + 1);
        self.line.clear();
        self.input.read_until(self.end, &mut self.line)?;
        if let Some(last) = self.line.last_mut().filter(|last| **last == self.end) {
            *last = b'\n';
        }
        for skipped in ["comment", "obj_info"] {
            let rest = self.line.trim_ascii_start().strip_prefix(skipped.as_bytes());
            if rest.is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace)) {
                self.line = format!("{skipped}\n").into_bytes();
            }
        }
        if std::str::from_utf8(&self.line).is_err() {
            self.line = String::from_utf8_lossy(&self.line).into_owned().into_bytes();
        }
        Ok(())
    }
}

impl BufRead for HeaderLines<'_, '_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.at == self.line.len() {
            self.fill()?;
        }
        Ok(&self.line[self.at..])
    }

    fn consume(&mut self, bytes: usize) {
        self.at += bytes;
    }
}

impl Read for HeaderLines<'_, '_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.fill_buf()?.read(buffer)?;
        self.consume(bytes);
        Ok(bytes)
    }
}
