//! Reading header, tables and base mesh, of all versions.

use container::{BY_PAGE, FileError, Georeference, Kind, SectionError, Sections, read_at};
use page_store::source::PageSource;
use vertex_tree::NONE;

use super::error::MtError;
use crate::format::{CHECKSUM, HEADER, Header, MAGIC, VERSION};

/// Reads while there is no file yet, and makes errors.
pub(crate) struct Opener<'a> {
    pub source: &'a dyn PageSource,
}

impl Opener<'_> {
    pub fn file(&self) -> String {
        self.source.name().to_owned()
    }

    pub fn range(&self, offset: u64, what: &'static str, value: u64) -> MtError {
        MtError::Range { file: self.file(), offset, what, value }
    }

    pub fn record(&self, offset: u64, (what, value): (&'static str, u64)) -> MtError {
        if what == "checksum" {
            return FileError::Checksum { file: self.file(), offset, section: "node" }.into();
        }
        self.range(offset, what, value)
    }

    /// Reads bytes, of which there are so many.
    pub fn read(&self, offset: u64, length: u64) -> Result<Vec<u8>, MtError> {
        let room = usize::try_from(length).map_err(|_| {
            let source = std::io::ErrorKind::OutOfMemory.into();
            FileError::Read { file: self.file(), offset, length, source }
        })?;
        let mut bytes = vec![0; room];
        read_at(self.source, offset, &mut bytes)?;
        Ok(bytes)
    }

    pub fn header(&self) -> Result<Header, MtError> {
        let actual = self.source.len();
        let mut bytes = [0; HEADER];
        let known = actual.min(HEADER as u64) as usize;
        bytes[..known].copy_from_slice(&self.read(0, known as u64)?);
        if bytes[..8] != MAGIC {
            let what = "not a partitioned multi-triangulation";
            return Err(FileError::Foreign { file: self.file(), what, magic: "FFMTPART" }.into());
        }
        if known < HEADER {
            return Err(FileError::Length { file: self.file(), expected: HEADER as u64, actual }.into());
        }
        let [version, stride] = words(&bytes[8..16]);
        if !(1..=VERSION).contains(&version) {
            return Err(FileError::Version { file: self.file(), version, expected: "1 or 2" }.into());
        }
        if stride != 0 {
            return Err(FileError::Attributes { file: self.file(), stride }.into());
        }
        if words(&bytes[HEADER - 4..]) != [crc32fast::hash(&bytes[..HEADER - 4])] {
            return Err(FileError::Checksum { file: self.file(), offset: 0, section: "header" }.into());
        }
        let header = Header::decode(&bytes);
        let most = u64::from(NONE) - 1;
        let limits = [
            (16, "vertices", header.vertices, most),
            (24, "triangles", header.triangles, most),
            (32, "collapses", header.collapses, most),
            (40, "nodes", header.nodes, header.collapses),
            (48, "partitions", header.partitions, header.nodes),
            (56, "roots", header.roots, header.nodes),
            (112, "nodes of the largest change", header.change_nodes, header.nodes),
            (148, "order of the queue", header.decreasing.into(), 1),
        ];
        for (offset, what, value, limit) in limits {
            if value > limit {
                return Err(self.range(offset, what, value));
            }
        }
        if header.nodes > 0 && header.partitions == 0 {
            return Err(self.range(48, "partitions", 0));
        }
        Ok(header)
    }

    /// Reads the tables and the base mesh after a header that has been checked.
    pub fn tables(&self, header: &Header) -> Result<Tables, MtError> {
        if header.version == 1 {
            return self.tables_version_1(header);
        }
        let read = || -> Result<_, SectionError> {
            let known = [&KINDS.map(|(kind, _)| kind)[..], &[Kind::BASE, Kind::PAGES]].concat();
            let sections = Sections::read(self.source, HEADER as u64, &known)?;
            let mut all = [const { (0, Vec::new()) }; 4];
            let lengths = header.table_bytes().into_iter().chain([header.source_bytes]);
            for ((place, length), kind) in all.iter_mut().zip(lengths).zip(known) {
                let section = sections.find(kind, 0, length)?;
                *place = (section.offset, Sections::bytes(self.source, &section)?);
            }
            let records = sections.get(Kind::PAGES).ok_or(SectionError::Missing { kind: Kind::PAGES })?;
            let georeference = sections.georeference(self.source)?;
            let [roots, partitions, nodes, base] = all;
            let (records_at, sections) = (records.offset, Some(sections));
            Ok(Tables { roots, partitions, nodes, base, records_at, georeference, sections })
        };
        Ok(read().map_err(|error| FileError::of_sections(self.source.name(), error))?)
    }

    /// In the first version all follows each other, and each table has its checksum behind it.
    fn tables_version_1(&self, header: &Header) -> Result<Tables, MtError> {
        let lengths = header.table_bytes();
        let base_at = HEADER as u64 + lengths.iter().map(|length| length + CHECKSUM).sum::<u64>();
        let (least, actual) = (base_at.saturating_add(header.source_bytes), self.source.len());
        if actual < least {
            return Err(FileError::Length { file: self.file(), expected: least, actual }.into());
        }
        let mut at = HEADER as u64;
        let mut all = [const { (0, Vec::new()) }; 3];
        for ((place, length), (_, section)) in all.iter_mut().zip(lengths).zip(KINDS) {
            let mut bytes = self.read(at, length + CHECKSUM)?;
            let checksum = bytes.split_off(length as usize);
            if words(&checksum) != [crc32fast::hash(&bytes)] {
                return Err(FileError::Checksum { file: self.file(), offset: at, section }.into());
            }
            *place = (at, bytes);
            at += length + CHECKSUM;
        }
        let [roots, partitions, nodes] = all;
        let base = (at, self.read(at, header.source_bytes)?);
        let (georeference, sections) = (Georeference::default(), None);
        Ok(Tables { roots, partitions, nodes, base, records_at: least, georeference, sections })
    }

    /// Whether the records of the nodes have so many bytes together.
    pub fn check_records(&self, tables: &Tables, length: u64) -> Result<(), MtError> {
        let Some(sections) = &tables.sections else {
            let (expected, actual) = (tables.records_at + length, self.source.len());
            if expected != actual {
                return Err(FileError::Length { file: self.file(), expected, actual }.into());
            }
            return Ok(());
        };
        let found = sections.find(Kind::PAGES, BY_PAGE, length);
        found.map_err(|error| FileError::of_sections(self.source.name(), error))?;
        Ok(())
    }
}

/// The tables in their order, and what errors call them in files of version 1.
const KINDS: [(Kind, &str); 3] =
    [(Kind::ROOTS, "roots"), (Kind::PARTITIONS, "partitions"), (Kind::NODES, "nodes")];

/// What is read of a file when it is opened, with where each part starts; intact, but not yet checked otherwise.
pub(crate) struct Tables {
    pub roots: (u64, Vec<u8>),
    pub partitions: (u64, Vec<u8>),
    pub nodes: (u64, Vec<u8>),
    /// The record of the source.
    pub base: (u64, Vec<u8>),
    /// Where the records of the nodes start.
    pub records_at: u64,
    pub georeference: Georeference,
    /// None in version 1.
    pub sections: Option<Sections>,
}

/// The first numbers in some bytes, of which there are enough.
pub(crate) fn words<const N: usize>(bytes: &[u8]) -> [u32; N] {
    std::array::from_fn(|i| {
        let mut word = [0; 4];
        word.copy_from_slice(&bytes[4 * i..4 * i + 4]);
        u32::from_le_bytes(word)
    })
}
