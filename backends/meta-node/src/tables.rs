//! Where the parts of a file are, and what is read of them at once: all but the pages.

use container::{BY_PAGE, FileError, Georeference, Kind, SectionError, Sections, read_at};
use page_store::source::PageSource;

use crate::error::MetaNodeError;
use crate::format::{HEADER_BYTES, Header};

/// The tables in their order: roots, vertices and triangles of the base mesh, lengths of pages.
const KINDS: [Kind; 4] = [Kind::ROOTS, Kind::BASE_VERTICES, Kind::BASE_TRIANGLES, Kind::PAGE_TABLE];

/// The tables of a file, intact, but not yet checked otherwise.
pub(crate) struct Tables {
    /// Where each starts, in bytes.
    pub at: [u64; 4],
    pub words: [Vec<u32>; 4],
    /// Where the pages start.
    pub pages_at: u64,
    pub georeference: Georeference,
    /// None in version 1.
    pub sections: Sections,
}

impl Tables {
    /// Reads the tables after a header that has been checked.
    pub fn read(source: &dyn PageSource, header: &Header) -> Result<Self, MetaNodeError> {
        if header.version == 1 {
            return Self::read_version_1(source, header);
        }
        let read = || -> Result<_, SectionError> {
            let known = [&KINDS[..], &[Kind::PAGES]].concat();
            let sections = Sections::read(source, HEADER_BYTES, &known)?;
            let pages_at = sections.find(Kind::PAGES, BY_PAGE, header.page_bytes)?.offset;
            let (mut at, mut words) = ([0; 4], [const { Vec::new() }; 4]);
            for (i, (kind, count)) in KINDS.into_iter().zip(header.tables_words()).enumerate() {
                let section = sections.find(kind, 0, 4 * count)?;
                at[i] = section.offset;
                words[i] = words_of(&Sections::bytes(source, &section)?);
            }
            let georeference = sections.georeference(source)?;
            Ok(Self { at, words, pages_at, georeference, sections })
        };
        Ok(read().map_err(|error| FileError::of_sections(source.name(), error))?)
    }

    /// In the first version the tables follow each other and have one checksum, in the header.
    fn read_version_1(source: &dyn PageSource, header: &Header) -> Result<Self, MetaNodeError> {
        let file = || source.name().to_owned();
        let counts = header.tables_words();
        // No sum overflows: each table has fewer than 2^32 entries of at most 28 bytes, and a page at most 2^34 bytes.
        let length = 4 * counts.iter().sum::<u64>();
        let (pages_at, actual) = (HEADER_BYTES + length, source.len());
        let expected = u128::from(pages_at) + u128::from(header.page_bytes);
        if expected != u128::from(actual) {
            let expected = u64::try_from(expected).unwrap_or(u64::MAX);
            return Err(FileError::Length { file: file(), expected, actual }.into());
        }
        let mut bytes = vec![0; length as usize];
        let offset = HEADER_BYTES;
        read_at(source, offset, &mut bytes)?;
        if crc32fast::hash(&bytes) != header.tables_checksum {
            return Err(FileError::Checksum { file: file(), offset, section: "tables" }.into());
        }
        let mut next = HEADER_BYTES;
        let at = counts.map(|count| {
            let start = next;
            next += 4 * count;
            start
        });
        let words = std::array::from_fn(|i| {
            let start = (at[i] - HEADER_BYTES) as usize;
            words_of(&bytes[start..start + 4 * counts[i] as usize])
        });
        let (georeference, sections) = (Georeference::default(), Sections::default());
        Ok(Self { at, words, pages_at, georeference, sections })
    }
}

fn words_of(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect()
}
