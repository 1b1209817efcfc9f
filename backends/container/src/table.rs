//! The table of sections, read and laid out.

use std::io;

use page_store::source::PageSource;

use crate::error::SectionError;
use crate::layout::{self, ENTRY, MOST, START, aligned};
use crate::section::{BY_PAGE, Kind, NECESSARY, Section};

/// The sections of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sections {
    all: Vec<Section>,
    /// Of the table.
    offset: u64,
    /// Whether the reader knows it, for each.
    known: Vec<bool>,
}

/// Longer than any file, and short enough that no sum overflows.
const MOST_BYTES: u64 = 1 << 62;

impl Sections {
    /// Sections for a file with a header of so many bytes, whose lengths and checksums are not known yet.
    pub(crate) fn of_kinds(header: u64, kinds: impl Iterator<Item = (Kind, u32)>) -> io::Result<Self> {
        let mut sections = Self { offset: aligned(header), ..Self::default() };
        for (kind, flags) in kinds {
            if sections.all.len() == MOST || sections.get(kind).is_some() {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidInput,
                    format!("no room for section {kind}"),
                ));
            }
            sections.all.push(Section { kind, flags, offset: 0, length: 0, checksum: 0 });
            sections.known.push(true);
        }
        Ok(sections)
    }

    /// Reads and checks the table of a file with a header of so many bytes, which has been checked. `known` are the kinds
    /// that the reader knows beside the georeference.
    ///
    /// # Errors
    /// Whatever is wrong with the table; that a section's bytes have changed is found when they are read.
    pub fn read(source: &dyn PageSource, header: u64, known: &[Kind]) -> Result<Self, SectionError> {
        let offset = aligned(header);
        let actual = source.len();
        let least = offset + (START + ENTRY) as u64;
        if actual < least {
            return Err(SectionError::FileLength { expected: least, actual });
        }
        check_zeros(source, header, offset)?;
        let start = read(source, offset, START as u64)?;
        let count = word(&start, 0);
        if count == 0 || count as usize > MOST {
            return Err(SectionError::Count { offset, count });
        }
        let end = offset + START as u64 + u64::from(count) * ENTRY as u64;
        if actual < end {
            return Err(SectionError::FileLength { expected: end, actual });
        }
        let entries = read(source, offset + START as u64, end - offset - START as u64)?;
        let mut checksum = crc32fast::Hasher::new();
        checksum.update(&start[..4]);
        checksum.update(&entries);
        if checksum.finalize() != word(&start, 4) {
            return Err(SectionError::TableChecksum { offset });
        }
        let mut sections = Self { all: Vec::with_capacity(count as usize), offset, known: Vec::new() };
        let mut at = end;
        for entry in entries.chunks_exact(ENTRY) {
            let section = sections.entry(entry, at)?;
            let is_known = known.contains(&section.kind) || section.kind == Kind::GEOREFERENCE;
            if section.flags & NECESSARY != 0 && !is_known {
                return Err(SectionError::Unknown { offset: section.offset, kind: section.kind });
            }
            at = section.end();
            sections.all.push(section);
            sections.known.push(is_known);
        }
        if at != actual {
            return Err(SectionError::FileLength { expected: at, actual });
        }
        let mut at = end;
        for section in &sections.all {
            check_zeros(source, at, section.offset)?;
            at = section.end();
        }
        Ok(sections)
    }

    /// Decodes the next entry, of a section that comes after byte `at`.
    fn entry(&self, bytes: &[u8], at: u64) -> Result<Section, SectionError> {
        let long = |at: usize| u64::from(word(bytes, at)) | u64::from(word(bytes, at + 4)) << 32;
        let kind = Kind(word(bytes, 0).to_le_bytes());
        let section = Section {
            kind,
            flags: word(bytes, 4),
            offset: long(8),
            length: long(16),
            checksum: word(bytes, 24),
        };
        let offset = self.offset + (START + self.all.len() * ENTRY) as u64;
        let wrong = |field, value: u64, expected: u64| {
            Err(SectionError::Entry { offset, kind, field, value, expected })
        };
        let (flags, checksum) = (u64::from(section.flags), u64::from(section.checksum));
        if section.flags & !(NECESSARY | BY_PAGE) != 0 {
            return wrong("flags", flags, flags & u64::from(NECESSARY | BY_PAGE));
        }
        if section.flags & BY_PAGE != 0 && checksum != 0 {
            return wrong("the checksum", checksum, 0);
        }
        if word(bytes, 28) != 0 {
            return wrong("the last word", word(bytes, 28).into(), 0);
        }
        if section.offset != aligned(at) {
            return wrong("the offset", section.offset, aligned(at));
        }
        // The sum of two does not overflow, and more than one of this size is longer than any file.
        if section.length > MOST_BYTES || section.end() > MOST_BYTES {
            return wrong("the length", section.length, MOST_BYTES);
        }
        if self.get(kind).is_some() {
            return Err(SectionError::Twice { offset: section.offset, kind });
        }
        Ok(section)
    }

    /// Padding, table, and what comes up to the first section: nothing, as all of it is a multiple of 8.
    pub(crate) fn encode(&self, header: u64) -> Vec<u8> {
        let mut bytes = vec![0; (self.offset - header) as usize];
        let mut entries = (self.all.len() as u32).to_le_bytes().to_vec();
        for section in &self.all {
            entries.extend(section.kind.0);
            entries.extend(section.flags.to_le_bytes());
            entries.extend(section.offset.to_le_bytes());
            entries.extend(section.length.to_le_bytes());
            entries.extend(section.checksum.to_le_bytes());
            entries.extend([0; 4]);
        }
        bytes.extend(&entries[..4]);
        bytes.extend(crc32fast::hash(&entries).to_le_bytes());
        bytes.extend(&entries[4..]);
        bytes
    }

    /// Where the table ends and the first section starts.
    pub(crate) fn table_end(&self) -> u64 {
        layout::table_end(self.offset, self.all.len())
    }

    pub(crate) fn all_mut(&mut self) -> &mut [Section] {
        &mut self.all
    }

    /// All sections in the order of the file.
    #[must_use]
    pub fn all(&self) -> &[Section] {
        &self.all
    }

    /// The section of a kind.
    #[must_use]
    pub fn get(&self, kind: Kind) -> Option<Section> {
        self.all.iter().find(|section| section.kind == kind).copied()
    }

    /// The section of a kind, which is necessary and has to have these other flags and so many bytes.
    ///
    /// # Errors
    /// [`SectionError::Missing`], [`SectionError::Entry`].
    pub fn find(&self, kind: Kind, flags: u32, length: u64) -> Result<Section, SectionError> {
        let section = self.get(kind).ok_or(SectionError::Missing { kind })?;
        let offset = self.entry_offset(kind);
        let wrong = |field, value, expected| SectionError::Entry { offset, kind, field, value, expected };
        let flags = NECESSARY | flags;
        if section.flags != flags {
            return Err(wrong("flags", section.flags.into(), flags.into()));
        }
        if section.length != length {
            return Err(wrong("the length", section.length, length));
        }
        Ok(section)
    }

    fn entry_offset(&self, kind: Kind) -> u64 {
        let number = self.all.iter().position(|section| section.kind == kind).unwrap_or(0);
        self.offset + (START + number * ENTRY) as u64
    }

    /// The bytes of a section that is not checked by page, with its checksum compared.
    ///
    /// # Errors
    /// [`SectionError::Io`], [`SectionError::Checksum`].
    pub fn bytes(source: &dyn PageSource, section: &Section) -> Result<Vec<u8>, SectionError> {
        let bytes = read(source, section.offset, section.length)?;
        check_sum(section, crc32fast::hash(&bytes))?;
        Ok(bytes)
    }

    /// Reads the sections that the reader does not know, and compares their checksums.
    ///
    /// # Errors
    /// [`SectionError::Io`], [`SectionError::Checksum`].
    pub fn verify_unknown(&self, source: &dyn PageSource) -> Result<(), SectionError> {
        let unknown = self.all.iter().zip(&self.known).filter(|(section, known)| {
            // Nobody knows where the pages of what is not known are.
            !**known && section.flags & BY_PAGE == 0
        });
        let mut buffer = Vec::new();
        for (section, _) in unknown {
            let mut checksum = crc32fast::Hasher::new();
            let mut at = section.offset;
            while at < section.end() {
                let length = (section.end() - at).min(1 << 18);
                buffer.resize(length as usize, 0);
                read_into(source, at, &mut buffer)?;
                checksum.update(&buffer);
                at += length;
            }
            check_sum(section, checksum.finalize())?;
        }
        Ok(())
    }
}

fn check_sum(section: &Section, found: u32) -> Result<(), SectionError> {
    if found == section.checksum {
        Ok(())
    } else {
        Err(SectionError::Checksum { offset: section.offset, kind: section.kind })
    }
}

/// Whether there are zeros from one offset to another, less than 8 bytes on.
fn check_zeros(source: &dyn PageSource, from: u64, to: u64) -> Result<(), SectionError> {
    let bytes = read(source, from, to - from)?;
    match (from..).zip(bytes).find(|&(_, value)| value != 0) {
        Some((offset, value)) => Err(SectionError::Padding { offset, value }),
        None => Ok(()),
    }
}

/// Reads so many bytes, which there are.
fn read(source: &dyn PageSource, offset: u64, length: u64) -> Result<Vec<u8>, SectionError> {
    let room = usize::try_from(length).map_err(|_| SectionError::Io {
        offset,
        length,
        source: io::ErrorKind::OutOfMemory.into(),
    })?;
    let mut bytes = vec![0; room];
    if length > 0 {
        read_into(source, offset, &mut bytes)?;
    }
    Ok(bytes)
}

fn read_into(source: &dyn PageSource, offset: u64, bytes: &mut [u8]) -> Result<(), SectionError> {
    let length = bytes.len() as u64;
    source.read_at(offset, bytes).map_err(|source| SectionError::Io { offset, length, source })
}

pub(crate) fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}
