//! Reads recorded trajectories of several formats into one: a world with z up, cameras that look along -z.

use std::path::Path as FilePath;

use super::error::{ImportError, Warning};
use super::trajectory::{Place, Sample, Trajectory};
use super::{hoppe, table};
use crate::experiment::path::format::Line;
use crate::experiment::path::text;
use crate::experiment::path::walkthrough::{Path, Pose};

/// Reads the text of a trajectory.
pub(super) fn read(
    file: &FilePath,
    text: &str,
    place: Place,
    warn: &mut dyn FnMut(Warning),
) -> Result<Trajectory, ImportError> {
    let is_comment = |line: &str| line.starts_with(['#', '%']) || line.starts_with("//");
    let lines = || text::lines(text).enumerate().map(|(index, content)| (index + 1, content));
    let bare = |comment: &str| -> usize {
        comment.len() - comment.trim_start_matches(['#', '%', '/', ' ', '\t']).len()
    };
    let comments: Vec<(usize, &str)> = lines()
        .filter(|(_, line)| is_comment(line))
        .map(|(line, text)| (line, &text[bare(text)..]))
        .collect();
    let has_header = |key| comments.iter().any(|(_, text)| text.split_whitespace().next() == Some(key));
    if has_header("fov") && has_header("aspect") {
        return of_path(Path::parse(file, text)?);
    }
    let mut rows = lines()
        .filter(|(_, line)| !line.is_empty() && !is_comment(line))
        .map(|(line, content)| (Line { file, line }, content))
        .peekable();
    match rows.peek() {
        None => Err(ImportError::TooShort { file: file.to_owned(), frames: 0 }),
        Some((_, first)) if first.starts_with("F ") => hoppe::read(file, rows, warn),
        Some(_) => table::read(file, &comments, rows, place, warn),
    }
}

fn of_path(path: Path) -> Result<Trajectory, ImportError> {
    let start = path.frames[0].time;
    let sample = |pose: &Pose| Sample {
        time: pose.time - start,
        position: pose.position,
        orientation: Some(pose.orientation),
    };
    let samples = path.frames.iter().map(sample).collect();
    let (units, fov_y, aspect) = (Some(path.units), Some(path.fov_y), Some(path.aspect));
    Ok(Trajectory { start, samples, units, fov_y, aspect })
}
