//! Tables of sections: what is written is read, and nothing else is.

use std::io::{Cursor, Write};

use crate::{
    BY_PAGE, Extra, Georeference, Kind, MOST, NECESSARY, Section, SectionError, SectionWriter, Sections,
    file_length,
};
use page_store::source::MemorySource;
use proptest::prelude::*;

const HEADER: &[u8] = b"a header of 44 bytes, which is checked alone";
const OWN: [(Kind, u32); 3] = [(Kind::POSITIONS, 0), (Kind::PAGES, BY_PAGE), (Kind::NODES, 0)];

/// A file with sections of these lengths for [`OWN`], after others.
fn file(extras: &[Extra], lengths: [usize; 3]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let nowhere = Georeference::default();
    let mut out = SectionWriter::new(&mut bytes, HEADER.len() as u64, &nowhere, extras, &OWN).unwrap();
    for ((kind, _), length) in OWN.into_iter().zip(lengths) {
        out.begin(kind).unwrap();
        (0..length).for_each(|i| out.write_all(&[i as u8 | 1]).unwrap());
    }
    let length = out.finish(HEADER).unwrap();
    let bytes = bytes.into_inner();
    assert_eq!(length, bytes.len() as u64);
    let lengths = lengths.map(|length| length as u64);
    assert_eq!(file_length(HEADER.len() as u64, &nowhere, extras, &lengths).unwrap(), length);
    bytes
}

/// Reads all that is not checked by page.
fn read(bytes: &[u8]) -> Result<Vec<(Section, Vec<u8>)>, SectionError> {
    let source = MemorySource::new("bytes", bytes);
    let sections = Sections::read(&source, HEADER.len() as u64, &OWN.map(|(kind, _)| kind))?;
    sections.georeference(&source)?;
    sections.verify_unknown(&source)?;
    let checked = sections.all().iter().filter(|section| section.flags & BY_PAGE == 0);
    checked.map(|section| Ok((*section, Sections::bytes(&source, section)?))).collect()
}

fn extra(kind: &[u8; 4], flags: u32, length: usize) -> Extra {
    Extra { kind: Kind(*kind), flags, bytes: vec![7; length] }
}

const TABLE: usize = 48;

/// Changes the table and makes its checksum right again.
fn lie(bytes: &[u8], change: impl FnOnce(&mut [u8])) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let count = u32::from_le_bytes(bytes[TABLE..TABLE + 4].try_into().unwrap()) as usize;
    let end = TABLE + 8 + 32 * count;
    change(&mut bytes[TABLE..end]);
    let table = [&bytes[TABLE..TABLE + 4], &bytes[TABLE + 8..end]].concat();
    bytes[TABLE + 4..TABLE + 8].copy_from_slice(&crc32fast::hash(&table).to_le_bytes());
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// What is not known and not necessary is skipped; a byte changed anywhere but in the header and in pages, which have
    /// checksums of their own, is found; and so is every other length.
    #[test]
    fn a_changed_byte_is_found(
        lengths in prop::array::uniform3(0_usize..40),
        others in prop::collection::vec(0_usize..20, 0..4),
        (place, change, cut) in (any::<prop::sample::Index>(), 1_u8.., any::<prop::sample::Index>()),
    ) {
        let others: Vec<Extra> =
            (b'A'..).zip(others).map(|(c, length)| extra(&[b'X', b'Y', b'Z', c], 0, length)).collect();
        let bytes = file(&others, lengths);
        let all = read(&bytes).unwrap();
        prop_assert_eq!(all.len(), others.len() + 2);
        for (extra, (section, bytes)) in others.iter().zip(&all) {
            prop_assert_eq!((extra.kind, &extra.bytes), (section.kind, bytes));
        }
        let source = MemorySource::new("bytes", &bytes[..]);
        let sections = Sections::read(&source, 44, &OWN.map(|(kind, _)| kind)).unwrap();
        let pages = sections.find(Kind::PAGES, BY_PAGE, lengths[1] as u64).unwrap();
        let at = HEADER.len() + place.index(bytes.len() - HEADER.len());
        let mut damaged = bytes.clone();
        damaged[at] ^= change;
        let in_pages = (pages.offset..pages.end()).contains(&(at as u64));
        prop_assert_eq!(read(&damaged).is_ok(), in_pages, "byte {}", at);
        let is_length = |bytes: &[u8]| {
            matches!(read(bytes), Err(SectionError::FileLength { actual, .. }) if actual == bytes.len() as u64)
        };
        prop_assert!(is_length(&bytes[..cut.index(bytes.len())]));
        prop_assert!(is_length(&[&bytes[..], &[0]].concat()));
    }

    /// Whatever a table says, with a checksum that is right: an error, or sections that do not overlap and lie in the file.
    #[test]
    fn a_table_that_lies_is_no_harm(
        lengths in prop::array::uniform3(0_usize..40),
        lies in prop::collection::vec((any::<prop::sample::Index>(), any::<u32>(), 0..5), 1..4),
    ) {
        let bytes = lie(&file(&[extra(b"XYZA", 0, 9)], lengths), |table| {
            for (place, value, how) in lies {
                let at = 8 + 4 * place.index(table.len() / 4 - 2);
                let value = match how {
                    0 => value,
                    1 => 0,
                    2 => u32::MAX,
                    3 => value % 300,
                    _ => u32::from_le_bytes(table[at..at + 4].try_into().unwrap()) ^ 1 << (value % 32),
                };
                table[at..at + 4].copy_from_slice(&value.to_le_bytes());
            }
        });
        let source = MemorySource::new("bytes", &bytes[..]);
        if let Ok(sections) = Sections::read(&source, 44, &OWN.map(|(kind, _)| kind)) {
            let mut at = (TABLE + 8 + 4 * 32) as u64;
            for section in sections.all() {
                prop_assert!(section.offset >= at && section.offset < at + 8);
                at = section.end();
            }
            prop_assert_eq!(at, bytes.len() as u64);
        }
    }
}

fn put(table: &mut [u8], at: usize, value: u64) {
    table[at..at + 8].copy_from_slice(&value.to_le_bytes());
}

/// Where the parts of an entry stand in the table.
fn entry(number: usize, at: usize) -> usize {
    8 + 32 * number + at
}

#[test]
fn sections_that_overlap_or_lie_outside_are_named() {
    let bytes = file(&[], [10, 20, 30]);
    let first = (TABLE + 8 + 3 * 32) as u64;
    assert_eq!(read(&bytes).unwrap()[0].0.offset, first);
    let offset = |offset: u64| lie(&bytes, |table| put(table, entry(1, 8), offset));
    for wrong in [0, first, first + 8, first + 10, first + 24, 1 << 40, u64::MAX, u64::MAX - 7] {
        match read(&offset(wrong)) {
            Err(SectionError::Entry { offset, kind: Kind::PAGES, field: "the offset", value, expected }) => {
                assert_eq!((offset, value, expected), ((TABLE + 8 + 32) as u64, wrong, first + 16));
            }
            other => panic!("{wrong}: {other:?}"),
        }
    }
    // The last section is the only one whose length nothing else follows from but that of the file.
    let length = |length: u64| lie(&bytes, |table| put(table, entry(2, 16), length));
    for wrong in [0, 29, 31, 1 << 40, 1 << 61] {
        let Err(SectionError::FileLength { expected, actual }) = read(&length(wrong)) else {
            panic!("{wrong}")
        };
        assert_eq!((expected, actual), (bytes.len() as u64 - 30 + wrong, bytes.len() as u64));
    }
    for wrong in [1 << 62, 1 << 63, u64::MAX] {
        let error = read(&length(wrong)).unwrap_err();
        assert!(matches!(error, SectionError::Entry { field: "the length", .. }), "{error}");
    }
}

#[test]
fn flags_and_kinds_are_checked() {
    let known = file(&[], [10, 20, 30]);
    let flags = |flags: u8| read(&lie(&known, |table| table[entry(0, 4)] = flags));
    for wrong in [4, 5, 128] {
        let error = flags(wrong).unwrap_err();
        assert!(matches!(error, SectionError::Entry { field: "flags", .. }), "{error}");
    }
    let error = flags(3).unwrap_err();
    assert!(matches!(error, SectionError::Entry { field: "the checksum", expected: 0, .. }), "{error}");
    let error = read(&lie(&known, |table| table[entry(2, 28)] = 1)).unwrap_err();
    assert!(matches!(error, SectionError::Entry { field: "the last word", value: 1, .. }), "{error}");
    let twice = lie(&known, |table| table[entry(1, 0)..entry(1, 4)].copy_from_slice(b"POSI"));
    assert!(matches!(read(&twice), Err(SectionError::Twice { kind: Kind::POSITIONS, .. })));
    let unknown = read(&file(&[extra(b"XYZA", NECESSARY, 5)], [1, 2, 3])).unwrap_err();
    assert_eq!(unknown.to_string(), "offset 184: section \"XYZA\" is necessary, and not known");
    let source = MemorySource::new("bytes", known);
    let sections = Sections::read(&source, 44, &OWN.map(|(kind, _)| kind)).unwrap();
    let missing = sections.find(Kind::ROOTS, 0, 0).unwrap_err();
    assert_eq!(missing.to_string(), "no section \"ROOT\"");
    let other = sections.find(Kind::POSITIONS, BY_PAGE, 10).unwrap_err();
    assert_eq!(other.to_string(), "offset 56: flags of section \"POSI\" is 1, expected 3");
    let longer = sections.find(Kind::POSITIONS, 0, 11).unwrap_err();
    assert_eq!(longer.to_string(), "offset 56: the length of section \"POSI\" is 10, expected 11");
}

#[test]
fn there_are_64_sections_at_most() {
    let extras = |count: usize| {
        let kind = |i: usize| [b'X', b'Y', b'0' + (i / 10) as u8, b'0' + (i % 10) as u8];
        (0..count).map(|i| extra(&kind(i), 0, i)).collect::<Vec<_>>()
    };
    assert_eq!(read(&file(&extras(MOST - 3), [1, 2, 3])).unwrap().len(), MOST - 1);
    // A count that lies is found before anything is read by it.
    let bytes = file(&extras(1), [1, 2, 3]);
    for count in [0, MOST as u32 + 1, 1 << 20, u32::MAX] {
        let mut lying = bytes.clone();
        lying[TABLE..TABLE + 4].copy_from_slice(&count.to_le_bytes());
        let error = read(&lying).unwrap_err();
        assert!(matches!(error, SectionError::Count { offset: 48, count: c } if c == count), "{error}");
    }
}

/// Whoever writes says what comes, and keeps to it.
#[test]
fn sections_are_written_in_the_order_announced() {
    let nowhere = Georeference::default();
    let bytes = || Cursor::new(Vec::new());
    let writer = || SectionWriter::new(bytes(), 44, &nowhere, &[], &OWN).unwrap();
    assert!(writer().begin(Kind::PAGES).is_err());
    let mut early = writer();
    early.write_all(b"nowhere").unwrap();
    assert!(early.begin(Kind::POSITIONS).is_err());
    let mut short = writer();
    short.begin(Kind::POSITIONS).unwrap();
    assert!(short.finish(HEADER).is_err());
    let too_many = vec![(Kind::POSITIONS, 0); MOST + 1];
    assert!(SectionWriter::new(bytes(), 44, &nowhere, &[], &too_many).is_err());
    assert!(SectionWriter::new(bytes(), 44, &nowhere, &[extra(b"POSI", 0, 1)], &OWN).is_err());
}
