//! Brings a trajectory that was recorded elsewhere to a mesh: scaled, placed, oriented and resampled.
//!
//! Formats are told by their content:
//!
//! | file | read as |
//! | --- | --- |
//! | a path file with `# fov` and `# aspect` | as it is; z up |
//! | names of columns in a comment, or in a line before the first numbers | the columns of these names, in any order |
//! | 8 numbers without names | `t x y z qx qy qz qw`, the order of the TUM RGB-D benchmark |
//! | 4 numbers without names | `t x y z`, no orientation |
//! | lines that begin with `F` | Hoppe's `.frames`: rows of the object frame x forward, y left, z up, then position and tan of half the field of view; 30 frames a second |
//!
//! Between columns are white space, commas or semicolons; separators may end a line. Comments begin with `#`, `%` or `//`
//! and come in any encoding, behind a byte order mark or not.
//!
//! | column | names, in capitals or not |
//! | --- | --- |
//! | time | `t`, `time`, `timestamp`, `stamp`, `header.stamp`, `time_ns`, `sec` and the like |
//! | place | `x y z`, `tx ty tz`, `px`, `pos_x`, `position.x`, `p_RS_R_x`, `east north up`, `easting northing`; for z also a height |
//! | place on earth | `lat` or `latitude`, `lon`, `lng`, `long` or `longitude`, and `alt`, `altitude`, `height`, `ele` or `elevation` |
//! | quaternion | `qx qy qz qw`, `q_w`, `q_RS_w`, `quat_w`, `rot_w`, `orientation.w`; all four or none |
//!
//! Time and place are needed; other columns are skipped, and need not be numbers. Behind a name may be a unit, as in
//! `t[ns]`, `time_ms`, `alt (ft)`. Where east and north stand beside latitude and longitude, the former are fitted, the
//! latter kept. What is named twice, or in two ways, is an error, and so is prose about w that comes first, or latitudes, in
//! a file that does not name its columns.
//!
//! Times without a unit are seconds up to 1e11, where that clock stands in the year 5138. Larger ones are milli-, micro- or
//! nanoseconds since 1970, after their size; what is none of these is an error. Longitudes go on across 180 degrees.
//!
//! What the axes of a recorded body mean is looked up in the comments, without regard to case: `euroc`: x up and z
//! forward; `x forward`: z up; `optical`, `kitti` or `z forward`: x right, y down, z forward; otherwise `body`: x
//! forward, z up; otherwise as in the TUM benchmark, optical. The recorded world has z up, unless they say `kitti`,
//! `y is down` (y down) or `y up`; a trajectory that is [not fitted](Options::fit) keeps its world.

mod axes;
mod clock;
mod earth;
mod envelope;
mod error;
mod fields;
mod header;
mod hoppe;
mod kept;
mod names;
mod options;
mod placement;
mod reading;
mod resample;
mod table;
mod trajectory;

use std::path::Path as FilePath;

use collapse_log::Mesh;

pub use error::{ImportError, Warning};
pub use options::{MAX_FRAMES, MAX_RATE, Mode, Options, Up, most_frames};

use super::{Path, text};
use trajectory::Place;

/// Reads a trajectory and brings it to a mesh. The path is named after the file; its positions are world coordinates.
///
/// Positions follow a Catmull-Rom spline and rotations are slerped. Where samples are further apart than half a second
/// and five times the median, the recording has a gap: the camera rests for the first half of it, then moves to where
/// the recording goes on, easing in and out, so that neither time nor place jumps.
pub fn import(trajectory: &FilePath, mesh: &Mesh, options: &Options) -> Result<Path, ImportError> {
    import_warning(trajectory, mesh, options, &mut |_| ())
}

/// [`import`] that says what may not be as it was meant.
pub fn import_warning(
    trajectory: &FilePath,
    mesh: &Mesh,
    options: &Options,
    warn: &mut dyn FnMut(Warning),
) -> Result<Path, ImportError> {
    of_text(trajectory, &text::read(trajectory)?, mesh, options, warn)
}

/// [`import`] of a trajectory's text; `file` names it in errors.
pub fn import_text(file: &FilePath, text: &str, mesh: &Mesh, options: &Options) -> Result<Path, ImportError> {
    of_text(file, text, mesh, options, &mut |_| ())
}

fn of_text(
    file: &FilePath,
    text: &str,
    mesh: &Mesh,
    options: &Options,
    warn: &mut dyn FnMut(Warning),
) -> Result<Path, ImportError> {
    let &Options { mode, rate, up, fit } = options;
    if !(rate > 0.0 && rate <= MAX_RATE) {
        return Err(ImportError::Rate { rate });
    }
    let extent = mesh.extent();
    if !(extent > 0.0 && extent.is_finite()) {
        return Err(ImportError::Mesh { extent });
    }
    let place = if fit { Place::Fitted } else { Place::Kept(mesh.georeference.degrees) };
    let recorded = reading::read(file, text, place, warn)?;
    if recorded.samples.len() < 2 {
        return Err(ImportError::TooShort { file: file.to_owned(), frames: recorded.samples.len() });
    }
    let samples = resample::at_rate(file, &recorded.samples, rate)?;
    // Far beyond any world, and far from where arithmetic overflows.
    if !samples.iter().all(|sample| sample.position.to_array().iter().all(|x| x.abs() < 1e30)) {
        return Err(ImportError::OutOfRange { file: file.to_owned() });
    }
    let (frames, units) = if fit {
        (placement::place(&samples, &placement::Ground::new(mesh, up), mode, rate), None)
    } else {
        let seconds = recorded.start;
        if seconds.abs() >= 1e11 {
            return Err(ImportError::Late { file: file.to_owned(), seconds });
        }
        let frames = kept::keep(&samples, seconds, placement::to_mesh(mesh, up), rate);
        if let Some([path, mesh]) = kept::elsewhere(&frames, mesh) {
            warn(Warning::Elsewhere { file: file.to_owned(), path, mesh });
        }
        (frames, recorded.units)
    };
    let path = Path {
        name: file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
        units: units.unwrap_or_else(|| "units".to_owned()),
        fov_y: recorded.fov_y.unwrap_or(60f64.to_radians()),
        aspect: recorded.aspect.unwrap_or(16.0 / 9.0),
        frames,
    };
    for frame in 0..path.frames.len() {
        path.camera(frame).map_err(|source| ImportError::Camera { file: file.to_owned(), frame, source })?;
    }
    Ok(path)
}
