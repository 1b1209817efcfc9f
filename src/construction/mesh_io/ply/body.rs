//! The numbers of a PLY file, behind its header.

use std::io::{self, BufRead, Read};

use serde_ply::{PlyFormat, ScalarType};

use crate::mesh_io::error::{MeshIoError, Place};
use crate::mesh_io::input::Input;
use crate::mesh_io::text::malformed;
use crate::mesh_io::words::Words;

/// Reads scalars one after the other. In text each is a word, on whatever line.
pub(super) enum Body<'i, 'a> {
    Text(Words<'i, 'a>),
    Binary { input: &'i mut Input<'a>, big: bool },
}

impl<'i, 'a> Body<'i, 'a> {
    /// The input stands behind the header, which has `lines` lines.
    pub fn new(input: &'i mut Input<'a>, format: PlyFormat, lines: u64) -> Self {
        match format {
            PlyFormat::Ascii => Self::Text(Words::new(input, lines + 1)),
            PlyFormat::BinaryLittleEndian => Self::Binary { input, big: false },
            PlyFormat::BinaryBigEndian => Self::Binary { input, big: true },
        }
    }

    fn input(&self) -> &Input<'a> {
        match self {
            Self::Text(words) => words.input,
            Self::Binary { input, .. } => input,
        }
    }

    /// Goes past so many scalars. What is skipped need not be a number.
    pub fn skip(&mut self, count: u64, kind: ScalarType, place: Place) -> Result<(), MeshIoError> {
        match self {
            Self::Text(words) => {
                for _ in 0..count {
                    word(words, place)?;
                }
            }
            Self::Binary { input, .. } => {
                let mut left = count * bytes(kind) as u64;
                while left > 0 {
                    let there = input.fill_buf().map(<[u8]>::len).map_err(|e| input.io(place, e))?;
                    if there == 0 {
                        return Err(input.io(place, io::ErrorKind::UnexpectedEof.into()));
                    }
                    let skipped = left.min(there as u64);
                    input.consume(skipped as usize);
                    left -= skipped;
                }
            }
        }
        Ok(())
    }

    /// A number as it is declared: a `float` in text is rounded to 32 bits.
    pub fn number(&mut self, kind: ScalarType, place: Place) -> Result<f64, MeshIoError> {
        match self {
            Self::Text(words) => {
                let file = words.input.path;
                let word = word(words, place)?;
                let number = match kind {
                    ScalarType::F32 => {
                        // Beyond the range of 32 bits, the error shall say what is there.
                        word.parse()
                            .ok()
                            .map(|x: f32| if x.is_infinite() { word.parse() } else { Ok(x.into()) })
                    }
                    _ => Some(word.parse()),
                };
                number.and_then(Result::ok).ok_or_else(|| malformed(file, place, "a number", word))
            }
            Self::Binary { input, big } => {
                let mut scalar = [0; 8];
                let size = bytes(kind);
                input.read_exact(&mut scalar[..size]).map_err(|e| input.io(place, e))?;
                if *big {
                    scalar[..size].reverse();
                }
                Ok(match kind {
                    ScalarType::F32 => f64::from(f32::from_le_bytes(low(scalar))),
                    ScalarType::F64 => f64::from_le_bytes(scalar),
                    _ => whole(scalar, kind) as f64,
                })
            }
        }
    }

    /// A whole number. `kind` is one of those.
    pub fn whole(&mut self, kind: ScalarType, place: Place) -> Result<i64, MeshIoError> {
        match self {
            Self::Text(words) => {
                let file = words.input.path;
                let word = word(words, place)?;
                word.parse().map_err(|_| malformed(file, place, "a whole number", word))
            }
            Self::Binary { input, big } => {
                let mut scalar = [0; 8];
                let size = bytes(kind);
                input.read_exact(&mut scalar[..size]).map_err(|e| input.io(place, e))?;
                if *big {
                    scalar[..size].reverse();
                }
                Ok(whole(scalar, kind))
            }
        }
    }

    /// The number of items of a list.
    pub fn count(&mut self, kind: ScalarType, place: Place) -> Result<u64, MeshIoError> {
        if is_float(kind) {
            return Err(self.refuse(place, "List count cannot be a float"));
        }
        let count = self.whole(kind, place)?;
        u64::try_from(count).map_err(|_| self.refuse(place, "Negative list count"))
    }

    pub fn refuse(&self, place: Place, why: &str) -> MeshIoError {
        MeshIoError::Decode { file: self.input().path.to_owned(), place, source: why.into() }
    }

    /// The error if there is more in the file. White space does not count, nor zeros that fill up a binary file.
    pub fn expect_end(&mut self) -> Result<(), MeshIoError> {
        let input = match self {
            Self::Text(words) => return words.expect_end(),
            Self::Binary { input, .. } => input,
        };
        let place = Place::Byte(input.position);
        let left = input.length.saturating_sub(input.position);
        loop {
            let buffer = match input.fill_buf() {
                Ok(buffer) => buffer,
                Err(error) => return Err(input.io(place, error)),
            };
            if buffer.is_empty() {
                return Ok(());
            }
            if !buffer.iter().all(|b| *b == 0 || b.is_ascii_whitespace()) {
                let (file, found) = (input.path.to_owned(), format!("{left} bytes"));
                return Err(MeshIoError::LeftOver { file, place, found });
            }
            let read = buffer.len();
            input.consume(read);
        }
    }
}

fn word<'w>(words: &'w mut Words<'_, '_>, place: Place) -> Result<&'w str, MeshIoError> {
    let file = words.input.path;
    match words.next() {
        Ok(Some(word)) => Ok(word),
        Ok(None) => Err(MeshIoError::Truncated { file: file.to_owned(), place }),
        Err(error) => Err(crate::mesh_io::input::read_error(file, place, error)),
    }
}

pub(super) fn is_float(kind: ScalarType) -> bool {
    matches!(kind, ScalarType::F32 | ScalarType::F64)
}

fn bytes(kind: ScalarType) -> usize {
    match kind {
        ScalarType::I8 | ScalarType::U8 => 1,
        ScalarType::I16 | ScalarType::U16 => 2,
        ScalarType::I32 | ScalarType::U32 | ScalarType::F32 => 4,
        ScalarType::F64 => 8,
    }
}

/// The first bytes of a scalar, the lowest of which comes first.
fn low<const N: usize>(scalar: [u8; 8]) -> [u8; N] {
    std::array::from_fn(|i| scalar[i])
}

fn whole(scalar: [u8; 8], kind: ScalarType) -> i64 {
    match kind {
        ScalarType::I8 => i64::from(i8::from_le_bytes(low(scalar))),
        ScalarType::U8 => i64::from(scalar[0]),
        ScalarType::I16 => i64::from(i16::from_le_bytes(low(scalar))),
        ScalarType::U16 => i64::from(u16::from_le_bytes(low(scalar))),
        ScalarType::I32 => i64::from(i32::from_le_bytes(low(scalar))),
        _ => i64::from(u32::from_le_bytes(low(scalar))),
    }
}
