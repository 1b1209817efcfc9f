//! A trajectory as it was recorded, whatever the format.

use container::DegreeMap;
use glam::{DQuat, DVec3};

/// A trajectory as recorded, its samples in order of time.
pub(super) struct Trajectory {
    /// What the clock says at the first sample, in seconds.
    pub start: f64,
    pub samples: Vec<Sample>,
    pub units: Option<String>,
    pub fov_y: Option<f64>,
    pub aspect: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    /// Seconds since the first.
    pub time: f64,
    /// z up, unless it is kept as it is.
    pub position: DVec3,
    /// From camera space (looking along -z, y up) to the world.
    pub orientation: Option<DQuat>,
}

/// What becomes of places.
#[derive(Clone, Copy)]
pub(super) enum Place {
    /// They are brought to a mesh, and get z up before.
    Fitted,
    /// They stay as they are; degrees come to lie where the mesh with this map of them does.
    Kept(Option<DegreeMap>),
}
