//! How to import.

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
    /// Whether the trajectory is scaled and moved to the mesh, after the mode. Otherwise it keeps its place, scale and
    /// time: metres are the mesh's world coordinates as they are, whatever axis is up, and degrees go through the map of
    /// the mesh's georeference. Only the camera's axes become those of a path.
    pub fit: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { mode: Mode::Fly, rate: 60.0, up: None, fit: true }
    }
}

/// The largest [`Options::rate`].
pub const MAX_RATE: f64 = 1000.0;
/// The most frames that an imported path can have: about two days at 60 a second.
pub const MAX_FRAMES: usize = 10_000_000;

/// The most frames of a trajectory of so many samples: an hour at 60 a second of any, and a quarter of a minute a sample. Two lines
/// that are days apart are not worth memory for days.
#[must_use]
pub fn most_frames(samples: usize) -> usize {
    (300_000 + 1000 * samples.min(MAX_FRAMES)).min(MAX_FRAMES)
}
