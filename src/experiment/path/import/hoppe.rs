//! Hoppe's recordings of flights, `.frames`.

use std::path::Path as FilePath;

use glam::DVec3;

use super::axes::look;
use super::error::{ImportError, Warning};
use super::trajectory::{Sample, Trajectory};
use crate::experiment::path::format::Line;

/// There are no time stamps.
const RATE: f64 = 30.0;
const COLUMNS: usize = 15;
/// Tan of half the narrowest and the widest field of view, 0.01 and 179 degrees.
const LENSES: [f64; 2] = [8.7e-5, 114.6];

pub(super) fn read<'a>(
    file: &'a FilePath,
    rows: impl Iterator<Item = (Line<'a>, &'a str)>,
    warn: &mut dyn FnMut(Warning),
) -> Result<Trajectory, ImportError> {
    let mut trajectory =
        Trajectory { start: 0.0, samples: Vec::new(), units: None, fov_y: None, aspect: None };
    let (mut first, mut warned) = (None, false);
    // There are also keys that were pressed, and a second, lower-case record a frame for another object.
    for (at, content) in rows.filter(|(_, content)| content.starts_with("F ")) {
        let columns = content.split_whitespace().count();
        if columns != COLUMNS {
            return Err(ImportError::Columns {
                file: file.to_owned(),
                line: at.line,
                expected: COLUMNS,
                columns,
            });
        }
        let (sample, lens) = sample(at, content, trajectory.samples.len())?;
        let wide = *first.get_or_insert(lens);
        if (lens / wide - 1.0).abs() > 1e-3 && !std::mem::replace(&mut warned, true) {
            warn(Warning::Lens { file: file.to_owned(), line: at.line, first: wide, value: lens });
        }
        trajectory.samples.push(sample);
    }
    trajectory.fov_y = first.map(|lens| 2.0 * libm::atan(lens));
    Ok(trajectory)
}

/// `F 0`, the rows of the object frame (x forward, y left, z up), position and tan of half the field of view.
fn sample(at: Line, content: &str, frame: usize) -> Result<(Sample, f64), ImportError> {
    let numbers = at.numbers(content.trim_start_matches('F'))?;
    let row = |i: usize| DVec3::from_slice(&numbers[i..i + 3]);
    let orientation = look(row(1), row(7));
    // Rows that are zero or parallel give no rotation, which the check refuses.
    let orientation = at.rotation(orientation.to_array())?;
    let value = numbers[13];
    if !(LENSES[0]..=LENSES[1]).contains(&value) {
        return Err(ImportError::Lens { file: at.file.to_owned(), line: at.line, value });
    }
    let time = frame as f64 / RATE;
    Ok((Sample { time, position: row(10), orientation: Some(orientation) }, value))
}
