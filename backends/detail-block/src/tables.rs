//! Reading all that comes with the header: everything but the blocks.

use container::{BY_PAGE, FileError, Georeference, Kind, SectionError, Sections, read_at};
use page_store::source::PageSource;

use crate::error::XfmError;
use crate::format::{HEADER_BYTES, Header, SUM_BYTES};
use crate::header::long;

/// The tables in their order, and what errors call them in files of version 1.
const KINDS: [(Kind, &str); 4] = [
    (Kind::BASE_VERTICES, "initial vertices"),
    (Kind::BASE_TRIANGLES, "initial faces"),
    (Kind::ROOTS, "root list"),
    (Kind::PAGE_TABLE, "block index"),
];

/// The tables of a file, intact, but not yet checked otherwise.
pub(crate) struct Tables {
    /// Where initial vertices, initial faces, root list and block index start.
    pub at: [u64; 4],
    pub bytes: [Vec<u8>; 4],
    /// Where the blocks start and end.
    pub blocks: (u64, u64),
    pub georeference: Georeference,
    /// None in version 1.
    pub sections: Sections,
}

impl Tables {
    /// Reads the tables after a header that has been checked.
    pub fn read(source: &dyn PageSource, header: &Header) -> Result<Self, XfmError> {
        if header.version == 1 {
            return Self::read_version_1(source, header);
        }
        let read = || -> Result<_, SectionError> {
            let known = [&KINDS.map(|(kind, _)| kind)[..], &[Kind::PAGES]].concat();
            let sections = Sections::read(source, HEADER_BYTES, &known)?;
            let (mut at, mut bytes) = ([0; 4], [const { Vec::new() }; 4]);
            for (i, (kind, length)) in known.into_iter().zip(header.table_bytes()).enumerate() {
                let section = sections.find(kind, 0, length)?;
                at[i] = section.offset;
                bytes[i] = Sections::bytes(source, &section)?;
            }
            let blocks = sections.get(Kind::PAGES).ok_or(SectionError::Missing { kind: Kind::PAGES })?;
            let blocks = sections.find(Kind::PAGES, BY_PAGE, blocks.length)?;
            let georeference = sections.georeference(source)?;
            Ok(Self { at, bytes, blocks: (blocks.offset, blocks.end()), georeference, sections })
        };
        Ok(read().map_err(|error| FileError::of_sections(source.name(), error))?)
    }

    /// In the first version the tables follow each other, each with its checksum behind it.
    fn read_version_1(source: &dyn PageSource, header: &Header) -> Result<Self, XfmError> {
        let lengths = header.table_bytes();
        let mut next = HEADER_BYTES;
        let at = lengths.map(|length| {
            let start = next;
            next += length + SUM_BYTES;
            start
        });
        // Every block has one node at least, so what is allocated next is no more than the file's own size.
        let (expected, actual) = (next + header.blocks * header.block_bytes(1, true), source.len());
        if actual < expected {
            return Err(FileError::Length { file: source.name().to_owned(), expected, actual }.into());
        }
        let mut bytes = [const { Vec::new() }; 4];
        for (i, (_, section)) in KINDS.into_iter().enumerate() {
            bytes[i] = vec![0; (lengths[i] + SUM_BYTES) as usize];
            read_at(source, at[i], &mut bytes[i])?;
            let sum = bytes[i].split_off(lengths[i] as usize);
            if u64::from(crc32fast::hash(&bytes[i])) != long(&sum) {
                let file = source.name().to_owned();
                return Err(FileError::Checksum { file, offset: at[i], section }.into());
            }
        }
        let (georeference, sections) = (Georeference::default(), Sections::default());
        Ok(Self { at, bytes, blocks: (next, actual), georeference, sections })
    }
}
