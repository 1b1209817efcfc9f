//! Reading the header.

use container::{FileError, read_at};
use page_store::source::PageSource;

use crate::error::XfmError;
use crate::format::{FLAG_NESTED, FLAG_QUANTISED, HEADER_BYTES, Header, MAGIC, VERSION};
use crate::numbering::{Levels, MOST_FACES, MOST_NODES};
use crate::quantize::Scale;

/// A number of up to eight bytes.
pub(crate) fn long(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte))
}

/// Reads the header and checks its numbers. Whether what they count has its place in the file is found with the tables.
pub(crate) fn read_header(source: &dyn PageSource) -> Result<Header, XfmError> {
    let file = || source.name().to_owned();
    let actual = source.len();
    let mut bytes = vec![0; HEADER_BYTES.min(actual) as usize];
    read_at(source, 0, &mut bytes)?;
    if !bytes.starts_with(&MAGIC) {
        return Err(FileError::Foreign { file: file(), what: "not an XFM file", magic: "FFXFMESH" }.into());
    }
    if actual < HEADER_BYTES {
        return Err(FileError::Length { file: file(), expected: HEADER_BYTES, actual }.into());
    }
    let word = |at: usize| long(&bytes[at..at + 4]) as u32;
    let count = |at: usize| long(&bytes[at..at + 8]);
    let field = |offset: u64, field, value, expected| {
        Err(XfmError::Field { file: file(), offset, field, value, expected })
    };
    if !(1..=VERSION).contains(&word(8)) {
        return field(8, "the version", word(8).into(), "expected 1 or 2");
    }
    if crc32fast::hash(&bytes[..144]) != word(144) {
        return Err(FileError::Checksum { file: file(), offset: 0, section: "header" }.into());
    }
    if word(12) != 0 {
        return field(12, "the attribute stride", word(12).into(), "expected 0");
    }
    let Some(levels) = Levels::new(word(16)) else {
        return field(16, "levels a block", word(16).into(), "expected 1 to 5");
    };
    if word(132) != 0 {
        return field(132, "a word without use", word(132).into(), "expected 0");
    }
    let flags = word(20);
    if flags & !(FLAG_QUANTISED | FLAG_NESTED) != 0 {
        return field(20, "flags", flags.into(), "with some that are not known");
    }
    let most_blocks = MOST_NODES >> levels.get();
    let vertices = u64::from(u32::MAX);
    for (offset, most) in [
        (24, 3 * MOST_FACES),
        (32, MOST_FACES - 1),
        (40, count(48)),
        (48, most_blocks),
        (56, count(48).saturating_mul(levels.full().into())),
        (64, vertices),
        (72, vertices),
    ] {
        if count(offset) > most {
            return field(offset as u64, "a count", count(offset), "more than there can be");
        }
    }
    let float = |at: usize| f32::from_bits(word(at));
    let scale = Scale { low: [float(112), float(116), float(120)], step: float(124), base: word(128) };
    let top = scale.base.saturating_add(0xffff << 12);
    let sane = scale.low.iter().chain([&scale.step]).all(|x| x.is_finite()) && scale.step >= 0.0;
    if !sane || !f32::from_bits(top).is_finite() || top >> 31 != 0 {
        return field(112, "the quantisation", scale.base.into(), "expected finite numbers");
    }
    let header = Header {
        version: word(8),
        levels,
        quantised: flags & FLAG_QUANTISED != 0,
        nested: flags & FLAG_NESTED != 0,
        initial_vertices: count(24),
        initial_faces: count(32),
        roots: count(40),
        blocks: count(48),
        nodes: count(56),
        triangles: count(64),
        input_vertices: count(72),
        added_vertices: count(80),
        cut_edges: count(88),
        left_out: count(96),
        degenerate: count(104),
        scale,
        length: count(136),
    };
    if header.length != actual {
        return Err(FileError::Length { file: file(), expected: header.length, actual }.into());
    }
    Ok(header)
}
