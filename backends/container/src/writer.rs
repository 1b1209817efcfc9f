//! Writes a file of sections from front to back.

use std::io::{self, Seek, SeekFrom, Write};

use vertex_tree::Georeference;

use crate::layout::{self, aligned};
use crate::placing::to_section;
use crate::section::{BY_PAGE, Extra, Kind, NECESSARY};
use crate::table::Sections;

/// Writes the sections of a file one after the other, and at last the header and the table of sections before them.
///
/// Which sections there will be is said at the beginning; what is written goes to the one that has been
/// [begun](Self::begin).
#[derive(Debug)]
pub struct SectionWriter<W> {
    out: W,
    header: u64,
    sections: Sections,
    /// How many have been begun.
    begun: usize,
    /// How many bytes have been given to `out`, from the start of the file.
    at: u64,
    checksum: crc32fast::Hasher,
    buffer: Vec<u8>,
}

/// Bytes that are hashed and written at a time.
const BUFFER: usize = 1 << 18;

impl<W: Write + Seek> SectionWriter<W> {
    /// Begins a file with a header of so many bytes. `kinds` are the sections to come, all of them necessary, with their
    /// other flags: 0 or [`BY_PAGE`]. The georeference, unless it is the default, and other small sections are written at
    /// once.
    ///
    /// # Errors
    /// What `out` says, and [`io::ErrorKind::InvalidInput`] if the georeference can not be stored, or if there are more than
    /// [`MOST`](crate::MOST) sections, or two of a kind.
    pub fn new(
        mut out: W,
        header: u64,
        georeference: &Georeference,
        extras: &[Extra],
        kinds: &[(Kind, u32)],
    ) -> io::Result<Self> {
        let first = to_section(georeference)?;
        let extras = || first.iter().chain(extras);
        let own = kinds.iter().map(|&(kind, flags)| (kind, NECESSARY | flags));
        let all = extras().map(|extra| (extra.kind, extra.flags)).chain(own);
        let sections = Sections::of_kinds(header, all)?;
        let at = sections.table_end();
        out.seek(SeekFrom::Start(at))?;
        let checksum = crc32fast::Hasher::new();
        let mut writer = Self { out, header, sections, begun: 0, at, checksum, buffer: Vec::new() };
        for Extra { kind, bytes, .. } in extras() {
            writer.begin(*kind)?;
            writer.write_all(bytes)?;
        }
        Ok(writer)
    }

    /// Ends the section that is being written and begins the next one. Says where it starts.
    ///
    /// # Errors
    /// What `out` says, and [`io::ErrorKind::InvalidInput`] if another section is to come.
    pub fn begin(&mut self, kind: Kind) -> io::Result<u64> {
        self.end()?;
        let padding = aligned(self.at) - self.at;
        self.out.write_all(&[0; 8][..padding as usize])?;
        self.at += padding;
        match self.sections.all_mut().get_mut(self.begun) {
            Some(next) if next.kind == kind => {
                next.offset = self.at;
                self.begun += 1;
                Ok(self.at)
            }
            _ => Err(io::Error::new(io::ErrorKind::InvalidInput, format!("section {kind} is not the next"))),
        }
    }

    fn end(&mut self) -> io::Result<()> {
        self.flush_buffer()?;
        let checksum = std::mem::take(&mut self.checksum).finalize();
        if let Some(section) = self.begun.checked_sub(1).map(|last| &mut self.sections.all_mut()[last]) {
            section.length = self.at - section.offset;
            section.checksum = if section.flags & BY_PAGE == 0 { checksum } else { 0 };
        }
        Ok(())
    }

    /// Ends the last section and writes the header, of the length that was announced, and the table. Says how long the file
    /// is.
    ///
    /// # Errors
    /// What `out` says, and [`io::ErrorKind::InvalidInput`] if sections are missing or the header has another length.
    pub fn finish(mut self, header: &[u8]) -> io::Result<u64> {
        self.end()?;
        if header.len() as u64 != self.header || self.begun != self.sections.all().len() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "a section is missing"));
        }
        self.out.seek(SeekFrom::Start(0))?;
        self.out.write_all(header)?;
        self.out.write_all(&self.sections.encode(self.header))?;
        self.out.flush()?;
        Ok(self.at)
    }

    fn flush_buffer(&mut self) -> io::Result<()> {
        let current = self.begun.checked_sub(1).and_then(|last| self.sections.all().get(last));
        match current {
            Some(section) if section.flags & BY_PAGE != 0 => {}
            Some(_) => self.checksum.update(&self.buffer),
            None if self.buffer.is_empty() => {}
            None => return Err(io::Error::new(io::ErrorKind::InvalidInput, "no section has begun")),
        }
        self.out.write_all(&self.buffer)?;
        self.at += self.buffer.len() as u64;
        self.buffer.clear();
        Ok(())
    }
}

impl<W: Write + Seek> Write for SectionWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.buffer.extend_from_slice(bytes);
        if self.buffer.len() >= BUFFER {
            self.flush_buffer()?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.flush_buffer()?;
        self.out.flush()
    }
}

/// How long a file will be that [`SectionWriter`] writes with the same header, georeference and other small sections, and
/// sections of these lengths.
///
/// # Errors
/// [`io::ErrorKind::InvalidInput`] if the georeference can not be stored.
pub fn file_length(
    header: u64,
    georeference: &Georeference,
    extras: &[Extra],
    lengths: &[u64],
) -> io::Result<u64> {
    let first = to_section(georeference)?;
    let extras = first.iter().chain(extras).map(|extra| extra.bytes.len() as u64);
    let all: Vec<u64> = extras.chain(lengths.iter().copied()).collect();
    let start = layout::table_end(header, all.len());
    Ok(all.into_iter().fold(start, |at, length| aligned(at) + length))
}
