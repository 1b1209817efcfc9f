//! Reads recorded trajectories of several formats into one: a world with z up, cameras that look along -z.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path as FilePath;

use glam::{DMat3, DQuat, DVec3};

use super::ImportError;
use crate::path::Path;
use crate::path::format::Line;

/// Metres of the radius of a sphere with the earth's volume.
const EARTH_RADIUS: f64 = 6_371_008.8;
/// Hoppe's recordings have no time stamps.
const HOPPE_RATE: f64 = 30.0;

/// A trajectory as recorded, at least two samples in order of time.
pub(super) struct Trajectory {
    pub samples: Vec<Sample>,
    pub fov_y: Option<f64>,
    pub aspect: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    pub time: f64,
    /// z up.
    pub position: DVec3,
    /// From camera space (looking along -z, y up) to the world.
    pub orientation: Option<DQuat>,
}

pub(super) fn read(file: &FilePath, text: &str) -> Result<Trajectory, ImportError> {
    let comments = text.lines().filter_map(|line| line.trim().strip_prefix('#'));
    let comments = comments.collect::<Vec<_>>().join("\n").to_lowercase();
    let has_header = |key: &str| comments.lines().any(|line| line.split_whitespace().next() == Some(key));
    let trajectory = if has_header("fov") && has_header("aspect") {
        let path = Path::parse(file, text)?;
        let sample = |pose: &crate::path::Pose| Sample {
            time: pose.time,
            position: pose.position,
            orientation: Some(pose.orientation),
        };
        let samples = path.frames.iter().map(sample).collect();
        Trajectory { samples, fov_y: Some(path.fov_y), aspect: Some(path.aspect) }
    } else {
        read_frames(file, text, &comments)?
    };
    if trajectory.samples.len() < 2 {
        return Err(ImportError::TooShort { file: file.to_owned(), frames: trajectory.samples.len() });
    }
    Ok(trajectory)
}

#[derive(Clone, Copy, PartialEq)]
enum Columns {
    /// t x y z qx qy qz qw
    Pose,
    /// t x y z
    Position,
    /// t lat lon alt
    Geographic,
    /// t lat lon alt east north
    GeographicAndLocal,
    /// F 0, nine numbers of a rotation, three of a position, tan of half the field of view
    Hoppe,
}

impl Columns {
    fn of(first: &str, comments: &str) -> Option<Self> {
        let geographic = comments.lines().any(|line| {
            let has = |name| line.split_whitespace().any(|column| column == name);
            has("lat") && has("lon")
        });
        match first.split_whitespace().count() {
            _ if first.starts_with("F ") => Some(Self::Hoppe),
            8 => Some(Self::Pose),
            6 if geographic => Some(Self::GeographicAndLocal),
            4 if geographic => Some(Self::Geographic),
            4 => Some(Self::Position),
            _ => None,
        }
    }

    fn count(self) -> usize {
        match self {
            Self::Pose => 8,
            Self::Position | Self::Geographic => 4,
            Self::GeographicAndLocal => 6,
            Self::Hoppe => 15,
        }
    }
}

fn read_frames(file: &FilePath, text: &str, comments: &str) -> Result<Trajectory, ImportError> {
    let frames = text
        .lines()
        .enumerate()
        .map(|(index, content)| (Line { file, line: index + 1 }, content.trim()))
        .filter(|(_, content)| !content.is_empty() && !content.starts_with('#'));
    let camera = camera_in_body(comments);
    let upright = upright(comments);
    let mut trajectory = Trajectory { samples: Vec::new(), fov_y: None, aspect: None };
    let mut columns = None;
    let mut origin = None;
    for (at, content) in frames {
        let found = content.split_whitespace().count();
        let (owned, line) = (file.to_owned(), at.line);
        let columns = match columns {
            Some(columns) => columns,
            None => *columns.insert(Columns::of(content, comments).ok_or_else(|| ImportError::Format {
                file: owned.clone(),
                line,
                columns: found,
            })?),
        };
        // Hoppe's recordings also have keys that were pressed, and a second, lower-case record a frame for another object.
        if columns == Columns::Hoppe && !content.starts_with("F ") {
            continue;
        }
        if found != columns.count() {
            return Err(ImportError::Columns {
                file: owned,
                line,
                expected: columns.count(),
                columns: found,
            });
        }
        let sample = if columns == Columns::Hoppe {
            let (sample, fov_y) = hoppe(at, content, trajectory.samples.len())?;
            trajectory.fov_y.get_or_insert(fov_y);
            sample
        } else {
            let n = at.numbers(content)?;
            let (position, orientation) = match columns {
                Columns::Pose => {
                    let pose = at.pose(content)?;
                    (pose.position, Some(pose.orientation * camera))
                }
                Columns::Geographic => {
                    let &mut (lat, lon) = origin.get_or_insert((n[1], n[2]));
                    let metres = EARTH_RADIUS * PI / 180.0;
                    let east = (n[2] - lon) * metres * lat.to_radians().cos();
                    (DVec3::new(east, (n[1] - lat) * metres, n[3]), None)
                }
                Columns::GeographicAndLocal => (DVec3::new(n[4], n[5], n[3]), None),
                Columns::Position | Columns::Hoppe => (DVec3::new(n[1], n[2], n[3]), None),
            };
            let orientation = orientation.map(|orientation| upright * orientation);
            Sample { time: n[0], position: upright * position, orientation }
        };
        if let Some(last) = trajectory.samples.last() {
            at.check_time(sample.time, last.time)?;
        }
        trajectory.samples.push(sample);
    }
    Ok(trajectory)
}

/// `F 0`, the rows of the object frame (x forward, y left, z up), position and tan of half the field of view.
fn hoppe(at: Line, content: &str, frame: usize) -> Result<(Sample, f64), ImportError> {
    let numbers = at.numbers(content.trim_start_matches('F'))?;
    let row = |i: usize| DVec3::from_slice(&numbers[i..i + 3]);
    let orientation = look(row(1), row(7));
    // Rows that are zero or parallel give no rotation, which the check refuses.
    let orientation = at.rotation(orientation.to_array())?;
    let time = frame as f64 / HOPPE_RATE;
    Ok((
        Sample { time, position: row(10), orientation: Some(orientation) },
        2.0 * numbers[13].abs().atan().max(0.01),
    ))
}

/// The rotation of a camera that looks along `forward`, with `up` as near to the top as can be. Not a rotation if the
/// two are parallel.
pub(super) fn look(forward: DVec3, up: DVec3) -> DQuat {
    let forward = forward.normalize_or_zero();
    let right = forward.cross(up).normalize_or_zero();
    if right == DVec3::ZERO {
        return DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    }
    DQuat::from_mat3(&DMat3::from_cols(right, right.cross(forward), -forward)).normalize()
}

/// From camera space to the recorded body's frame.
fn camera_in_body(comments: &str) -> DQuat {
    let says = |text: &str| comments.contains(text);
    let (forward, up) = if says("euroc") {
        (DVec3::Z, DVec3::X)
    } else if says("x forward") {
        (DVec3::X, DVec3::Z)
    } else if says("optical") || says("kitti") || says("z forward") || !says("body") {
        (DVec3::Z, DVec3::NEG_Y)
    } else {
        (DVec3::X, DVec3::Z)
    };
    look(forward, up)
}

/// From the recorded world to one with z up.
fn upright(comments: &str) -> DQuat {
    let says = |text: &str| comments.contains(text);
    if says("kitti") || says("y is down") {
        DQuat::from_rotation_x(-FRAC_PI_2)
    } else if says("y up") {
        DQuat::from_rotation_x(FRAC_PI_2)
    } else {
        DQuat::IDENTITY
    }
}
