//! What has to be known of the directories of a TIFF before the library that decodes it sees them.
//!
//! The library turns samples over where zero is white, in floating point even by `1 - h`, and does not read images that are
//! masks. So it gets to see the file as if zero were black everywhere.

use std::io::{self, Read, Seek, SeekFrom};

const NEW_SUBFILE_TYPE: u16 = 254;
const PHOTOMETRIC_INTERPRETATION: u16 = 262;
const WHITE_IS_ZERO: u64 = 0;
const BLACK_IS_ZERO: u64 = 1;
const TRANSPARENCY_MASK: u64 = 4;

/// No file has as many directories; a chain of them may be a ring.
const MOST_DIRECTORIES: usize = 1000;

/// Bytes of a value.
fn size(kind: u64) -> u64 {
    match kind {
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16..=18 => 8,
        _ => 1,
    }
}

/// A TIFF in which zero is black.
pub(super) struct Blackened<R> {
    reader: R,
    position: u64,
    /// Where bytes are other than in the file.
    changes: Vec<(u64, u8)>,
}

impl<R: Read + Seek> Blackened<R> {
    /// Also returns the number of the first image that masks another of full size, if there is one. A file that is no TIFF stays
    /// as it is: the library says what is wrong with it.
    pub fn new(reader: R) -> io::Result<(Self, Option<usize>)> {
        let mut blackened = Self { reader, position: 0, changes: Vec::new() };
        let mut mask = None;
        match blackened.read_directories(&mut mask) {
            Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => return Err(error),
            _ => {}
        }
        blackened.seek(SeekFrom::Start(0))?;
        Ok((blackened, mask))
    }

    fn read_directories(&mut self, mask: &mut Option<usize>) -> io::Result<()> {
        let big_endian = match &self.bytes::<4>()? {
            b"II*\0" | b"II+\0" => false,
            b"MM\0*" | b"MM\0+" => true,
            _ => return Ok(()),
        };
        let length = self.seek(SeekFrom::End(0))?;
        self.seek(SeekFrom::Start(2))?;
        let big_file = self.number::<2>(big_endian)? == 43;
        if big_file {
            self.number::<4>(big_endian)?;
        }
        let offset = |file: &mut Self| {
            if big_file { file.number::<8>(big_endian) } else { file.number::<4>(big_endian) }
        };
        for number in 0..MOST_DIRECTORIES {
            let at = offset(self)?;
            if at == 0 {
                break;
            }
            self.seek(SeekFrom::Start(at))?;
            let entries = if big_file { offset(self)? } else { self.number::<2>(big_endian)? };
            for _ in 0..entries.min(u64::from(u16::MAX)) {
                let tag = self.number::<2>(big_endian)? as u16;
                let kind = self.number::<2>(big_endian)?;
                let values = offset(self)?;
                // The library makes room for all of them before it looks whether they are there.
                if values.saturating_mul(size(kind)) > length {
                    return Err(io::Error::new(
                        io::ErrorKind::InvalidData,
                        format!("tag {tag} has {values} values, more than the file"),
                    ));
                }
                let at = self.position;
                // Shorts are in the first bytes of the field.
                let value =
                    if kind == 3 { self.number::<2>(big_endian)? } else { self.number::<4>(big_endian)? };
                match (tag, value) {
                    // A mask (4) of an image of full size (not 1).
                    (NEW_SUBFILE_TYPE, value) if value & 5 == 4 => drop(mask.get_or_insert(number)),
                    (PHOTOMETRIC_INTERPRETATION, WHITE_IS_ZERO | TRANSPARENCY_MASK) => {
                        let size = if kind == 3 { 2 } else { 4 };
                        let low = if big_endian { at + size - 1 } else { at };
                        self.changes.push((low, BLACK_IS_ZERO as u8));
                    }
                    _ => {}
                }
                self.seek(SeekFrom::Start(at + if big_file { 8 } else { 4 }))?;
            }
        }
        Ok(())
    }

    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    fn number<const N: usize>(&mut self, big_endian: bool) -> io::Result<u64> {
        let mut bytes = self.bytes::<N>()?;
        if !big_endian {
            bytes.reverse();
        }
        Ok(bytes.iter().fold(0, |number, &byte| number << 8 | u64::from(byte)))
    }
}

impl<R: Read> Read for Blackened<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.reader.read(buffer)?;
        for &(at, value) in &self.changes {
            if let Some(byte) =
                at.checked_sub(self.position).and_then(|i| buffer[..bytes].get_mut(i as usize))
            {
                *byte = value;
            }
        }
        self.position += bytes as u64;
        Ok(bytes)
    }
}

impl<R: Seek> Seek for Blackened<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = self.reader.seek(to)?;
        Ok(self.position)
    }
}
