//! STL, binary and text.
//!
//! The format repeats the corners for every facet. Corners with the same coordinates become one vertex (-0 is 0;
//! nothing is merged that differs in the last bit), in the order of first use. Facets that name a vertex twice then
//! are left out; normals, colours and names are skipped.
//!
//! The count of a binary file is not always right: who writes piece by piece leaves a 0. The length of the file tells, too. In
//! text, white space separates words, be it lines or not.

use std::io::{self, BufRead, Read};
use std::path::Path;

use super::error::{MeshIoError, Place};
use super::input::{BYTE_ORDER_MARK, Input, read_error};
use super::receiver::{Contents, Receiver};
use super::stl_text::read_text;
use super::text::check_coordinate;
use super::weld::Weld;
use crate::progress::Progress;

const HEADER_BYTES: usize = 84;
const FACET_BYTES: usize = 50;

pub(super) fn send(
    file: &Path,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<Contents, MeshIoError> {
    let mut input = Input::open(file, &mut *progress)?;
    let start = input.fill_buf().map_err(|e| read_error(file, Place::Byte(0), e))?;
    let start = &start[..start.len().min(HEADER_BYTES)];
    // Binary files, too, may begin with "solid", but no text has the zero bytes of a short name and a small count.
    let text = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start).trim_ascii_start();
    if text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !start.contains(&0) {
        input.skip_mark()?;
        read_text(input, &mut Weld::new(receiver, |p| p.map(f64::to_bits)))?;
    } else {
        drop(input);
        read_binary(file, &mut Weld::new(receiver, |p| p.map(|x| (x as f32).to_bits())), progress)?;
    }
    Ok(Contents { faces: true })
}

/// 80 bytes of anything, the number of facets, and for each its normal, its corners and two bytes of anything.
fn read_binary(
    file: &Path,
    weld: &mut Weld<'_, [u32; 3]>,
    progress: Progress<'_>,
) -> Result<(), MeshIoError> {
    let mut input = Input::open(file, &mut *progress)?;
    let count = read_count(&mut input)?;
    let (facets, attributes) = facets(count, &mut input)?;
    drop(input);
    let mut input = Input::open(file, progress)?;
    read_count(&mut input)?;
    for number in 0..facets {
        let place = Place::Face(number);
        let mut record = [0; FACET_BYTES];
        input.read_exact(&mut record).map_err(|e| input.io(place, e))?;
        let float = |i: usize| {
            let at = 12 + 4 * i;
            f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
        };
        let mut facet = [[0.0; 3]; 3];
        for (i, coordinate) in facet.as_flattened_mut().iter_mut().enumerate() {
            *coordinate = check_coordinate(file, place, f64::from(float(i)))?;
        }
        weld.push(facet, file)?;
        if attributes {
            skip(&mut input, u16::from_le_bytes([record[48], record[49]])).map_err(|e| input.io(place, e))?;
        }
    }
    Ok(())
}

fn read_count(input: &mut Input<'_>) -> Result<u32, MeshIoError> {
    let mut header = [0; HEADER_BYTES];
    input.read_exact(&mut header).map_err(|e| input.io(Place::Byte(0), e))?;
    Ok(u32::from_le_bytes([header[80], header[81], header[82], header[83]]))
}

/// How many facets there are, and whether bytes follow each, as many as its last two bytes say. Otherwise these are
/// colours. The file has been read up to the first facet.
fn facets(count: u32, input: &mut Input<'_>) -> Result<(u64, bool), MeshIoError> {
    let rest = input.length.saturating_sub(HEADER_BYTES as u64);
    let (announced, record) = (u64::from(count), FACET_BYTES as u64);
    if rest <= announced * record {
        // Where it is less, reading comes to the facet at which the file ends.
        return Ok((announced, false));
    }
    let with_attributes = facets_with_attributes(input).map_err(|e| input.io(Place::Byte(0), e))?;
    match with_attributes {
        Some(facets) if facets == announced || !rest.is_multiple_of(record) => Ok((facets, true)),
        _ if rest.is_multiple_of(record) => Ok((rest / record, false)),
        _ => {
            let file = input.path.to_owned();
            Err(MeshIoError::FacetCount { file, facets: count, bytes: input.length })
        }
    }
}

/// The number of facets, if attribute bytes follow each and the last ends where the file does.
fn facets_with_attributes(input: &mut Input<'_>) -> io::Result<Option<u64>> {
    let mut facets = 0;
    while input.position < input.length {
        let mut record = [0; FACET_BYTES];
        let outcome = input
            .read_exact(&mut record)
            .and_then(|()| skip(input, u16::from_le_bytes([record[48], record[49]])));
        match outcome {
            Ok(()) => facets += 1,
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
            Err(error) => return Err(error),
        }
    }
    Ok(Some(facets))
}

fn skip(input: &mut Input<'_>, bytes: u16) -> io::Result<()> {
    let skipped = io::copy(&mut input.take(u64::from(bytes)), &mut io::sink())?;
    if skipped < u64::from(bytes) { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
}
