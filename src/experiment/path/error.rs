//! What can be wrong with a path file.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::shown::few;
use selection::view::ViewError;

/// Why a path could not be read or written. Lines count from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PathError {
    /// The file could not be read, or is UTF-16 text.
    #[error("{}: {source}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file could not be written.
    #[error("{}: {source}", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A frame has more or fewer than eight columns.
    #[error("{}:{line}: a frame has 8 columns, t x y z qx qy qz qw, not {columns}", file.display())]
    Columns {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
        /// How many columns there are.
        columns: usize,
    },
    /// A column is not a number, or not a finite one.
    #[error("{}:{line}: {value:?} is not a finite number", file.display())]
    Number {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
        /// The column as it stands in the file.
        value: String,
    },
    /// A frame is not later than the one before.
    #[error("{}:{line}: the time {} is not after {}", file.display(), few(*time), few(*previous))]
    Time {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
        /// Its time.
        time: f64,
        /// The time of the frame before.
        previous: f64,
    },
    /// A camera is nowhere that a camera can be.
    #[error("{}:{line}: {source}", file.display())]
    Camera {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
        /// What is wrong.
        source: ViewError,
    },
    /// A quaternion is zero, or too small or large to be made a rotation.
    #[error("{}:{line}: the quaternion {value:?} is no rotation", file.display())]
    Rotation {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
        /// x, y, z and w.
        value: [f64; 4],
    },
    /// The value of a header line is out of range.
    #[error("{}:{line}: {key} {value:?} is not {range}", file.display())]
    Header {
        /// The file.
        file: PathBuf,
        /// The line.
        line: usize,
        /// Which header it is.
        key: &'static str,
        /// Its value as it stands in the file.
        value: String,
        /// What it may be.
        range: &'static str,
    },
    /// A header line that every path needs is missing.
    #[error("{}: there is no header line `# {key} ...`", file.display())]
    MissingHeader {
        /// The file.
        file: PathBuf,
        /// Which header is missing.
        key: &'static str,
    },
    /// There are no frames.
    #[error("{}: there are no frames", file.display())]
    NoFrames {
        /// The file.
        file: PathBuf,
    },
}
