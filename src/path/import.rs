//! Brings a trajectory that was recorded elsewhere to a mesh: scaled, placed, oriented and resampled.
//!
//! Formats are told by their content:
//!
//! | first frame | read as |
//! | --- | --- |
//! | a path file with `# fov` and `# aspect` | as it is; z up |
//! | 8 numbers | `t x y z qx qy qz qw`, the order of the TUM RGB-D benchmark |
//! | 4 numbers | `t x y z`, no orientation; `t lat lon alt` (degrees, metres) if a comment lists these columns |
//! | 6 numbers | `t lat lon alt east north`, where a comment lists these columns; no orientation |
//! | `F` | Hoppe's `.frames`: rows of the object frame x forward, y left, z up, then position and tan of half the field of view; 30 frames a second |
//!
//! What the axes of a recorded body mean is looked up in the comments, without regard to case: `euroc`: x up and z
//! forward; `x forward`: z up; `optical`, `kitti` or `z forward`: x right, y down, z forward; otherwise `body`: x
//! forward, z up; otherwise as in the TUM benchmark, optical. The recorded world has z up, unless they say `kitti`,
//! `y is down` (y down) or `y up`.

mod envelope;
mod placement;
mod resample;
mod trajectory;

use std::path::{Path as FilePath, PathBuf};

use thiserror::Error;
use vertex_tree::Mesh;

use super::{Path, PathError};

/// How a trajectory is placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Over the mesh and clear of it: over terrain at the trajectory's own height above the highest ground around;
    /// over an object across a dome that encloses its bounding sphere.
    Fly,
    /// At eye height, a thousandth of the mesh's diagonal, above the highest surface.
    Walk,
    /// Around the mesh: the longer side of the trajectory's box becomes the azimuth once around, its height the
    /// elevation and its shorter side the distance. The camera looks at the middle of the mesh, but for the recorded
    /// rotation's quick part, below about a second and at most 8 degrees.
    Orbit,
}

/// Which axis of the mesh points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// As in scanned objects.
    Y,
    /// As in terrain and cities.
    Z,
}

/// How to import.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// How the trajectory is placed.
    pub mode: Mode,
    /// Frames a second, above 0 and at most [`MAX_RATE`].
    pub rate: f64,
    /// Which axis of the mesh points up; `None` guesses z for a mesh that is flat in z, else y.
    pub up: Option<Up>,
}

impl Default for Options {
    fn default() -> Self {
        Self { mode: Mode::Fly, rate: 60.0, up: None }
    }
}

/// The largest [`Options::rate`].
pub const MAX_RATE: f64 = 1000.0;
/// The most frames that an imported path can have: about two days at 60 a second.
pub const MAX_FRAMES: usize = 10_000_000;

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
    /// At least two frames are needed.
    #[error("{}: {frames} frames are no trajectory", file.display())]
    TooShort {
        /// The trajectory.
        file: PathBuf,
        /// How many frames it has.
        frames: usize,
    },
    /// The rate is not above 0 and at most [`MAX_RATE`].
    #[error("{rate} frames a second are not above 0 and at most {MAX_RATE}")]
    Rate {
        /// The rate.
        rate: f64,
    },
    /// The resampled trajectory would have more than [`MAX_FRAMES`] frames.
    #[error("{}: {seconds} s at {rate} frames a second are more than {MAX_FRAMES} frames", file.display())]
    TooLong {
        /// The trajectory.
        file: PathBuf,
        /// How long it lasts.
        seconds: f64,
        /// The rate.
        rate: f64,
    },
    /// The mesh has no extent that a trajectory could be fitted to.
    #[error("a trajectory can not be fitted to a mesh of the extent {extent}")]
    Mesh {
        /// Diagonal of its bounding box.
        extent: f64,
    },
    /// Coordinates are 1e30 or larger.
    #[error("{}: coordinates are out of range", file.display())]
    OutOfRange {
        /// The trajectory.
        file: PathBuf,
    },
}

/// Reads a trajectory and fits it to a mesh. The path is named after the file.
///
/// Positions follow a Catmull-Rom spline and rotations are slerped. Where samples are further apart than half a second
/// and five times the median, the recording has a gap: the camera rests for the first half of it, then moves to where
/// the recording goes on, easing in and out, so that neither time nor place jumps.
pub fn import(trajectory: &FilePath, fit: &Mesh, options: &Options) -> Result<Path, ImportError> {
    let read = |source| PathError::Read { file: trajectory.to_owned(), source };
    let text = std::fs::read_to_string(trajectory).map_err(read)?;
    import_text(trajectory, &text, fit, options)
}

/// [`import`] of a trajectory's text; `file` names it in errors.
pub fn import_text(file: &FilePath, text: &str, fit: &Mesh, options: &Options) -> Result<Path, ImportError> {
    let &Options { mode, rate, up } = options;
    if !(rate > 0.0 && rate <= MAX_RATE) {
        return Err(ImportError::Rate { rate });
    }
    let extent = fit.extent();
    if !(extent > 0.0 && extent.is_finite()) {
        return Err(ImportError::Mesh { extent });
    }
    let recorded = trajectory::read(file, text)?;
    let samples = resample::at_rate(file, &recorded.samples, rate)?;
    // Far beyond any world, and far from where arithmetic overflows.
    if !samples.iter().all(|sample| sample.position.to_array().iter().all(|x| x.abs() < 1e30)) {
        return Err(ImportError::OutOfRange { file: file.to_owned() });
    }
    let ground = placement::Ground::new(fit, up);
    let frames = placement::place(&samples, &ground, mode, rate);
    Ok(Path {
        name: file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
        units: "units".to_owned(),
        fov_y: recorded.fov_y.unwrap_or(60f64.to_radians()),
        aspect: recorded.aspect.unwrap_or(16.0 / 9.0),
        frames,
    })
}
