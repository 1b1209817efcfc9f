//! The section that says where a mesh lies in the world.
//!
//! ```text
//! offset  bytes  field
//!      0     24  origin, 3 f64
//!     24      8  largest move by rounding, f64
//!     32      8  median length of edges, f64
//!     40      4  flags: 1 heights over degrees have been laid on a plane; others 0
//!     44      4  n, bytes of the name of the coordinate system, at most 4096
//!     48     32  longitude and latitude of world coordinates 0, metres a degree of longitude and of latitude, 4 f64;
//!                zeros without the flag
//!     80      n  name of the coordinate system, UTF-8
//! ```
//!
//! It is left out where there is nothing to say, and necessary where the origin is not 0: without it the mesh would be
//! somewhere else.

use std::io;

use vertex_tree::{DegreeMap, Georeference, Rounding};

use page_store::source::PageSource;

use crate::error::SectionError;
use crate::section::{Extra, Kind, NECESSARY};
use crate::table::{Sections, word};

const FIXED: usize = 80;
/// Bytes of the name of a coordinate system.
const MOST_NAME: usize = 4096;
const FLAG_DEGREES: u32 = 1;

/// The numbers in their order, and what errors call them.
const FIELDS: [&str; 9] = [
    "x of the origin",
    "y of the origin",
    "z of the origin",
    "the largest move",
    "the median edge",
    "the longitude",
    "the latitude",
    "metres a degree of longitude",
    "metres a degree of latitude",
];

fn numbers(georeference: &Georeference) -> [f64; 9] {
    let ([x, y, z], Rounding { largest_move, median_edge }) = (georeference.origin, georeference.rounding);
    let DegreeMap { longitude, latitude, metres_per_degree: [a, b] } =
        georeference.degrees.unwrap_or_default();
    [x, y, z, largest_move, median_edge, longitude, latitude, a, b]
}

/// The first number that is none, by its place in [`FIELDS`]. Lengths are not negative, and an origin is where a camera can be.
fn wrong(numbers: &[f64; 9]) -> Option<usize> {
    (0..9).find(|&i| {
        let is_far = i < 3 && numbers[i].abs() > Georeference::FARTHEST;
        !numbers[i].is_finite() || is_far || (3..5).contains(&i) && numbers[i] < 0.0
    })
}

/// Where a number stands.
fn place(field: usize) -> usize {
    if field < 5 { 8 * field } else { 8 + 8 * field }
}

/// The section that holds where a mesh lies; none if there is nothing to say.
pub(crate) fn to_section(georeference: &Georeference) -> io::Result<Option<Extra>> {
    if *georeference == Georeference::default() {
        return Ok(None);
    }
    let (numbers, name) = (numbers(georeference), georeference.coordinate_system.as_bytes());
    let refuse = |why: String| Err(io::Error::new(io::ErrorKind::InvalidInput, why));
    if let Some(field) = wrong(&numbers) {
        return refuse(format!("{} of the georeference is {:?}", FIELDS[field], numbers[field]));
    }
    if name.len() > MOST_NAME {
        return refuse(format!(
            "the name of the coordinate system has {} bytes, more than {MOST_NAME}",
            name.len()
        ));
    }
    let mut bytes = vec![0; FIXED];
    for (field, number) in numbers.iter().enumerate() {
        bytes[place(field)..][..8].copy_from_slice(&number.to_bits().to_le_bytes());
    }
    let flags = if georeference.degrees.is_some() { FLAG_DEGREES } else { 0 };
    bytes[40..44].copy_from_slice(&flags.to_le_bytes());
    bytes[44..48].copy_from_slice(&(name.len() as u32).to_le_bytes());
    bytes.extend_from_slice(name);
    let flags = if georeference.origin == [0.0; 3] { 0 } else { NECESSARY };
    Ok(Some(Extra { kind: Kind::GEOREFERENCE, flags, bytes }))
}

impl Sections {
    /// Where the mesh lies in the world, as the file says.
    ///
    /// # Errors
    /// Whatever is wrong with the section. That it is not there is no error: then the mesh lies where its positions are.
    pub fn georeference(&self, source: &dyn PageSource) -> Result<Georeference, SectionError> {
        let Some(section) = self.get(Kind::GEOREFERENCE) else { return Ok(Georeference::default()) };
        let error = |at: usize, field, value| {
            Err(SectionError::Georeference { offset: section.offset + at as u64, field, value })
        };
        if !(FIXED as u64..=(FIXED + MOST_NAME) as u64).contains(&section.length) {
            return error(0, "the length", section.length.to_string());
        }
        let bytes = Self::bytes(source, &section)?;
        let (flags, length) = (word(&bytes, 40), word(&bytes, 44));
        if length as usize != bytes.len() - FIXED {
            return error(44, "the length of the name", length.to_string());
        }
        if flags & !FLAG_DEGREES != 0 {
            return error(40, "flags", flags.to_string());
        }
        let numbers: [f64; 9] = std::array::from_fn(|field| {
            let at = place(field);
            f64::from_bits(u64::from(word(&bytes, at)) | u64::from(word(&bytes, at + 4)) << 32)
        });
        let has_degrees = flags & FLAG_DEGREES != 0;
        let stray = (5..9).find(|&field| !has_degrees && numbers[field].to_bits() != 0);
        if let Some(field) = wrong(&numbers).or(stray) {
            return error(place(field), FIELDS[field], format!("{:?}", numbers[field]));
        }
        let [x, y, z, largest_move, median_edge, longitude, latitude, a, b] = numbers;
        let coordinate_system = match std::str::from_utf8(&bytes[FIXED..]) {
            Ok(name) => name.to_owned(),
            Err(_) => {
                return error(
                    FIXED,
                    "the name",
                    bytes[FIXED..].escape_ascii().take(40).map(char::from).collect(),
                );
            }
        };
        Ok(Georeference {
            origin: [x, y, z],
            coordinate_system,
            degrees: has_degrees.then_some(DegreeMap { longitude, latitude, metres_per_degree: [a, b] }),
            rounding: Rounding { largest_move, median_edge },
        })
    }
}
