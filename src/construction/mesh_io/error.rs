//! What can be wrong with a mesh file.

use std::fmt;
use std::path::PathBuf;

use super::extension::EXTENSIONS;
use super::limits::{MAX_CORNERS, MAX_SPAN};

/// Where in a file. Lines are counted from 1, everything else from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// A line of a text file.
    Line(u64),
    /// A vertex, in the order of the file.
    Vertex(u64),
    /// A face, in the order of the file.
    Face(u64),
    /// How far reading had come, in bytes from the start of the file.
    Byte(u64),
    /// A sample of a height map, in rows from the top and columns from the left.
    Sample {
        /// Row.
        row: usize,
        /// Column.
        column: usize,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(n) => write!(f, "line {n}"),
            Self::Vertex(n) => write!(f, "vertex {n}"),
            Self::Face(n) => write!(f, "face {n}"),
            Self::Byte(n) => write!(f, "byte {n}"),
            Self::Sample { row, column } => write!(f, "row {row}, column {column}"),
        }
    }
}

/// A mesh could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshIoError {
    /// The list of inputs is empty.
    #[error("no input file")]
    NoInput,
    /// Nothing has this name.
    #[error("{}: no such file", file.display())]
    Missing {
        /// The name.
        file: PathBuf,
    },
    /// The operating system said no.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The format is told by the extension, and this one is none of them.
    #[error("{}: unknown extension {extension:?}: expected {}", file.display(), EXTENSIONS.join(", "))]
    UnknownExtension {
        /// The file.
        file: PathBuf,
        /// As found, empty where there is none.
        extension: String,
    },
    /// Several files were given, and not all of them are height tiles.
    #[error("{}: only height tiles (.hgt, .zip) can be read together with other files", file.display())]
    NotATile {
        /// The first that is something else.
        file: PathBuf,
    },
    /// The file is well-formed but shows nothing.
    #[error("{}: no triangles", file.display())]
    Empty {
        /// The file; the first one of a mosaic.
        file: PathBuf,
    },
    /// There are vertices, and nothing that joins them.
    #[error("{}: a point cloud: {points} points and no faces", file.display())]
    PointCloud {
        /// The file.
        file: PathBuf,
        /// How many vertices there are.
        points: u64,
    },
    /// Its contents are not what the extension says.
    #[error("{}: not a {format} file", file.display())]
    WrongFormat {
        /// The file.
        file: PathBuf,
        /// What the extension says.
        format: &'static str,
    },
    /// The file holds more than it announces.
    #[error("{}: {place}: more than is announced: {found}", file.display())]
    LeftOver {
        /// The file.
        file: PathBuf,
        /// Where that begins.
        place: Place,
        /// What it is, or its beginning.
        found: String,
    },
    /// The length of a binary STL file is that of another number of facets than it announces, and of no whole number.
    #[error("{}: {facets} facets are announced, but {bytes} bytes are no whole number of them", file.display())]
    FacetCount {
        /// The file.
        file: PathBuf,
        /// As announced.
        facets: u32,
        /// The length of the file.
        bytes: u64,
    },
    /// The file ends before everything it announces has been read.
    #[error("{}: {place}: the file ends too early", file.display())]
    Truncated {
        /// The file.
        file: PathBuf,
        /// What was being read.
        place: Place,
    },
    /// Something else stands where a number, a keyword, … should.
    #[error("{}: {place}: expected {expected}, found {found:?}", file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// Where.
        place: Place,
        /// What the format asks for.
        expected: &'static str,
        /// As found.
        found: String,
    },
    /// A coordinate is infinite or not a number, or too large for 32 bits.
    #[error("{}: {place}: coordinate {value:e} is not a finite 32-bit number", file.display())]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// Where.
        place: Place,
        /// The coordinate.
        value: f64,
    },
    /// A face names a vertex that the file does not have.
    #[error("{}: {place}: no vertex {index}, there are {vertices}", file.display())]
    IndexOutOfRange {
        /// The file.
        file: PathBuf,
        /// Where.
        place: Place,
        /// As written in the file: counted from 1 in OBJ, negative there if counted from the end.
        index: i64,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A face has more corners than anyone should triangulate.
    #[error("{}: {place}: {corners} corners, at most {} are read", file.display(), MAX_CORNERS)]
    TooManyCorners {
        /// The file.
        file: PathBuf,
        /// Where.
        place: Place,
        /// As found.
        corners: usize,
    },
    /// There are more vertices than 32-bit numbers for them.
    #[error("{}: more than 2^32 - 2 vertices", file.display())]
    TooManyVertices {
        /// The file.
        file: PathBuf,
    },
    /// The file uses a part of its format that is not read.
    #[error("{}: {feature}", file.display())]
    Unsupported {
        /// The file.
        file: PathBuf,
        /// What, and what would do instead.
        feature: String,
    },
    /// The library that decodes the format gave up.
    #[error("{}: {place}: {source}", file.display())]
    Decode {
        /// The file.
        file: PathBuf,
        /// Where it stood.
        place: Place,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A height tile's name does not give its south-west corner.
    #[error("{}: the name of a height tile is its south-west corner, like N36W118.hgt", file.display())]
    TileName {
        /// The file.
        file: PathBuf,
    },
    /// A height tile is neither 1201 nor 3601 samples a side.
    #[error("{}: {bytes} bytes, a height tile has 2884802 (1201 a side) or 25934402 (3601 a side)", file.display())]
    TileSize {
        /// The file.
        file: PathBuf,
        /// As found.
        bytes: u64,
    },
    /// The tiles of a mosaic do not all have one resolution.
    #[error("{}: {side} samples a side, but {} has {other_side}", file.display(), other.display())]
    TileResolution {
        /// A tile.
        file: PathBuf,
        /// Its samples a side.
        side: usize,
        /// Another tile.
        other: PathBuf,
        /// Its samples a side.
        other_side: usize,
    },
    /// A tile occurs twice in a mosaic.
    #[error("{}: the same tile as {}", file.display(), other.display())]
    DuplicateTile {
        /// The second.
        file: PathBuf,
        /// The first.
        other: PathBuf,
    },
    /// The tiles of a mosaic lie too far apart for a flat map.
    #[error("{}: more than {} degrees from {}", file.display(), MAX_SPAN, other.display())]
    TilesTooFarApart {
        /// A tile.
        file: PathBuf,
        /// Another tile.
        other: PathBuf,
    },
    /// An archive holds no height tile.
    #[error("{}: no .hgt file in the archive", file.display())]
    NoTiles {
        /// The archive.
        file: PathBuf,
    },
    /// Whoever takes the mesh piece by piece can not.
    #[error("the mesh can not be kept: {0}")]
    Receiver(#[source] std::io::Error),
    /// There is not one colour for each vertex.
    #[error("{}: {colours} colours for {vertices} vertices", file.display())]
    ColourCount {
        /// The file that was to be written.
        file: PathBuf,
        /// How many colours.
        colours: usize,
        /// How many vertices.
        vertices: usize,
    },
}
