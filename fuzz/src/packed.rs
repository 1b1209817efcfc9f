//! Pictures and archives: changed outside, as they lie, and inside, with checksums that are right.

use std::io::{Cursor, Read, Write};

use rand::{Rng, RngExt};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use crate::mutate;
use crate::values;

const PNG_SIGNATURE: usize = 8;

/// Damages a picture; the checksums of its pieces are mostly made right.
pub fn png(input: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
    for _ in 0..random.random_range(1..5) {
        match random.random_range(0..4) {
            0 => pieces(input, other, random),
            1 => header(input, random),
            _ => mutate::bytes(input, other, random),
        }
    }
    if random.random_ratio(15, 16) {
        seal_png(input);
    }
}

/// Where the pieces of a picture are, as far as their lengths lead.
fn png_pieces(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let (mut at, mut pieces) = (PNG_SIGNATURE, Vec::new());
    while let Some(&[a, b, c, d]) = bytes.get(at..at + 4) {
        let end = (at + 12).saturating_add(u32::from_be_bytes([a, b, c, d]) as usize);
        if end > bytes.len() {
            break;
        }
        pieces.push(at..end);
        at = end;
    }
    pieces
}

fn seal_png(bytes: &mut [u8]) {
    for piece in png_pieces(bytes) {
        let sum = crc32fast::hash(&bytes[piece.start + 4..piece.end - 4]);
        bytes[piece.end - 4..piece.end].copy_from_slice(&sum.to_be_bytes());
    }
}

/// Pieces that are missing, there twice, or come from elsewhere.
fn pieces(input: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
    let (own, others) = (png_pieces(input), png_pieces(other));
    let Some(piece) = own.get(random.random_range(0..own.len().max(1))).cloned() else { return };
    match random.random_range(0..3) {
        0 => drop(input.drain(piece)),
        1 => {
            let copy = input[piece.clone()].to_vec();
            input.splice(piece.end..piece.end, copy);
        }
        _ => {
            if let Some(foreign) = others.get(random.random_range(0..others.len().max(1))) {
                input.splice(piece.start..piece.start, other[foreign.clone()].to_vec());
            }
        }
    }
}

/// Width, height, depth, colour, compression, filter, interlacing.
fn header(input: &mut [u8], random: &mut impl Rng) {
    let Some(header) = input.get_mut(16..29) else { return };
    let at = random.random_range(0..7);
    if at < 2 {
        let place = &mut header[4 * at..4 * at + 4];
        let old = u32::from_be_bytes([place[0], place[1], place[2], place[3]]);
        let small = random.random_range(0..200);
        place.copy_from_slice(&values::word(random, old, small).to_be_bytes());
    } else {
        header[6 + at] = [0, 1, 2, 3, 4, 6, 8, 16, 255][random.random_range(0..9)];
    }
}

const NAMES: [&str; 14] = [
    "N36W119.hgt",
    "N36W118.hgt",
    "S90E180.hgt",
    "N90W180.hgt",
    "N00E000.HGT",
    "folder/N37W119.hgt",
    "../N38W119.hgt",
    "._N36W119.hgt",
    "N91E000.hgt",
    "N1.hgt",
    "N36W119.hgt/",
    "N36\u{e9}119.hgt",
    "readme.txt",
    "",
];

/// Damages an archive as it lies, or what is in it.
pub fn zip(input: &mut Vec<u8>, other: &[u8], random: &mut impl Rng) {
    if random.random_ratio(1, 3)
        && let Some(changed) = repack(input, random)
    {
        *input = changed;
        return;
    }
    for _ in 0..random.random_range(1..6) {
        // What lies at the end says what lies where.
        if random.random_ratio(1, 2) && input.len() > 120 {
            let mut end = input.split_off(input.len() - 120);
            mutate::bytes(&mut end, other, random);
            input.append(&mut end);
        } else {
            mutate::bytes(input, other, random);
        }
    }
}

/// The entries of an archive with other names and contents, packed anew.
fn repack(input: &[u8], random: &mut impl Rng) -> Option<Vec<u8>> {
    let mut archive = ZipArchive::new(Cursor::new(input)).ok()?;
    let mut entries = Vec::new();
    for number in 0..archive.len().min(4) {
        let entry = archive.by_index(number).ok()?;
        let name = entry.name().ok()?.to_string();
        let mut bytes = Vec::new();
        entry.take(1 << 22).read_to_end(&mut bytes).ok()?;
        entries.push((name, bytes));
    }
    for _ in 0..random.random_range(1..4) {
        let count = entries.len();
        if count == 0 {
            break;
        }
        let number = random.random_range(0..count);
        match random.random_range(0..6) {
            0 => NAMES[random.random_range(0..NAMES.len())].clone_into(&mut entries[number].0),
            1 => {
                entries[number].1.pop();
            }
            2 => entries[number].1.push(0),
            3 if count < 4 => {
                let mut copy = entries[number].clone();
                NAMES[random.random_range(0..NAMES.len())].clone_into(&mut copy.0);
                entries.push(copy);
            }
            _ => {
                let bytes = &mut entries[number].1;
                for _ in 0..random.random_range(1..100) {
                    if !bytes.is_empty() {
                        // Mostly in the first rows, which are read in any case.
                        let most =
                            if random.random_ratio(3, 4) { bytes.len().min(1 << 14) } else { bytes.len() };
                        let at = random.random_range(0..most);
                        bytes[at] = [0x80, 0, 0x7f, 0xff, 1][random.random_range(0..5)];
                    }
                }
            }
        }
    }
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .compression_level(Some(1));
    for (name, bytes) in entries {
        writer.start_file(name, options).ok()?;
        writer.write_all(&bytes).ok()?;
    }
    Some(writer.finish().ok()?.into_inner())
}
