//! What can be wrong with a trajectory, and what is worth a word.

use std::path::PathBuf;

use glam::DVec3;
use thiserror::Error;

use super::options::MAX_RATE;
use crate::experiment::path::error::PathError;
use crate::experiment::path::shown::few;
use selection::view::ViewError;

/// Why a trajectory could not be imported. Lines count from 1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file can not be read, or a line of it can not.
    #[error(transparent)]
    Path(#[from] PathError),
    /// The first frame is of no known format.
    #[error("{}:{line}: no known format of trajectory has {columns} columns", file.display())]
    Format {
        /// The trajectory.
        file: PathBuf,
        /// The line.
        line: usize,
        /// How many columns it has.
        columns: usize,
    },
    /// A line has more or fewer columns than the format of the file.
    #[error("{}:{line}: {expected} columns were expected, not {columns}", file.display())]
    Columns {
        /// The trajectory.
        file: PathBuf,
        /// The line.
        line: usize,
        /// How many columns a frame of this format has.
        expected: usize,
        /// How many there are.
        columns: usize,
    },
    /// A column that is needed is empty.
    #[error("{}:{line}: column {column} is empty", file.display())]
    Empty {
        /// The trajectory.
        file: PathBuf,
        /// The line.
        line: usize,
        /// Which column, from 1.
        column: usize,
    },
    /// The header does not say what the columns are, or says it in two ways.
    #[error("{}:{line}: {reason}", file.display())]
    Header {
        /// The trajectory.
        file: PathBuf,
        /// The line.
        line: usize,
        /// What is unclear.
        reason: String,
    },
    /// The unit of the times can not be told.
    #[error("{}:{line}: the time {value} {reason}", file.display())]
    Clock {
        /// The trajectory.
        file: PathBuf,
        /// The line.
        line: usize,
        /// The time as it stands in the file.
        value: String,
        /// What is unclear.
        reason: String,
    },
    /// A latitude is beyond the poles, or a longitude beyond once around.
    #[error("{}:{line}: {value:?} is no {name} in degrees", file.display())]
    Degrees {
        /// The trajectory.
        file: PathBuf,
        /// The line.
        line: usize,
        /// `latitude` or `longitude`.
        name: &'static str,
        /// The value, in degrees.
        value: f64,
    },
    /// The lens of a `.frames` file gives no field of view.
    #[error("{}:{line}: {value:?} is no tan of half a field of view of 0.01 to 179 degrees", file.display())]
    Lens {
        /// The trajectory.
        file: PathBuf,
        /// The line.
        line: usize,
        /// Tan of half the field of view.
        value: f64,
    },
    /// At least two frames are needed.
    #[error("{}: {frames} frames are no trajectory", file.display())]
    TooShort {
        /// The trajectory.
        file: PathBuf,
        /// How many frames it has.
        frames: usize,
    },
    /// The rate is not above 0 and at most [`MAX_RATE`].
    #[error("{rate:?} frames a second are not above 0 and at most {MAX_RATE}")]
    Rate {
        /// The rate.
        rate: f64,
    },
    /// The resampled trajectory would have more frames than [`most_frames`](super::most_frames) of so many samples.
    #[error("{}: {seconds:?} s at {rate} frames a second are more than {most} frames", file.display())]
    TooLong {
        /// The trajectory.
        file: PathBuf,
        /// How long it lasts.
        seconds: f64,
        /// The rate.
        rate: f64,
        /// How many frames it may have.
        most: usize,
    },
    /// The times are too large for frames to differ in them.
    #[error("{}: {} s is no time of a frame", file.display(), few(*seconds))]
    Late {
        /// The trajectory.
        file: PathBuf,
        /// The first time.
        seconds: f64,
    },
    /// The mesh has no extent that a trajectory could be fitted to.
    #[error("a trajectory can not be fitted to a mesh of the extent {extent}")]
    Mesh {
        /// Diagonal of its bounding box.
        extent: f64,
    },
    /// A trajectory in degrees is to keep its place, but the mesh does not say where on the earth it is.
    #[error(
        "{}: a trajectory in degrees can keep its place only with a mesh made from degrees, and this one has no map of them",
        file.display()
    )]
    NoDegrees {
        /// The trajectory.
        file: PathBuf,
    },
    /// A frame of the path has no camera.
    #[error("{}: frame {frame}: {source}", file.display())]
    Camera {
        /// The trajectory.
        file: PathBuf,
        /// Number of the frame in the path, from 0.
        frame: usize,
        /// What is wrong with the camera.
        source: ViewError,
    },
    /// Coordinates are 1e30 or larger.
    #[error("{}: coordinates are out of range", file.display())]
    OutOfRange {
        /// The trajectory.
        file: PathBuf,
    },
}

/// What does not stop an import, but may not be what was meant.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// Nothing says the unit of the times, and they are far apart for seconds.
    #[error(
        "{}: nothing says the unit of the times, so they are seconds, {} between two samples",
        file.display(), few(*step)
    )]
    Seconds {
        /// The trajectory.
        file: PathBuf,
        /// The median.
        step: f64,
    },
    /// The recorded attitude is not in quaternions.
    #[error("{}:{line}: {names} are not read: the camera looks where it goes", file.display())]
    Attitude {
        /// The trajectory.
        file: PathBuf,
        /// The line of the header.
        line: usize,
        /// The names of the columns.
        names: String,
    },
    /// The lens of a `.frames` file changes, which that of a path can not.
    #[error("{}:{line}: the lens changes from {first} to {value}: all frames have the first", file.display())]
    Lens {
        /// The trajectory.
        file: PathBuf,
        /// The line.
        line: usize,
        /// Tan of half the first field of view.
        first: f64,
        /// Tan of half the one here.
        value: f64,
    },
    /// A path that was not fitted is nowhere near the mesh.
    #[error(
        "{}: no camera is near the mesh: the path is in {} to {}, the mesh in {} to {}",
        file.display(), corner(path[0]), corner(path[1]), corner(mesh[0]), corner(mesh[1])
    )]
    Elsewhere {
        /// The trajectory.
        file: PathBuf,
        /// Corners of the box of the path, in world coordinates.
        path: [DVec3; 2],
        /// Corners of the box of the mesh, in world coordinates.
        mesh: [DVec3; 2],
    },
}

fn corner(place: DVec3) -> String {
    let [x, y, z] = place.to_array().map(few);
    format!("[{x}, {y}, {z}]")
}
