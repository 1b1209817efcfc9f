//! Trajectories of one sample a line, in columns.

use std::iter::Peekable;
use std::path::Path as FilePath;

use super::axes::{camera_in_body, upright};
use super::clock::Clock;
use super::earth::Plane;
use super::error::{ImportError, Warning};
use super::fields::{Separator, filled};
use super::header::{self, Layout};
use super::trajectory::{Place, Sample, Trajectory};
use crate::experiment::path::format::Line;

/// Reads `rows`, of which there is one at least: numbers, and maybe their names in front.
pub(super) fn read<'a>(
    file: &'a FilePath,
    comments: &[(usize, &str)],
    mut rows: Peekable<impl Iterator<Item = (Line<'a>, &'a str)>>,
    place: Place,
    warn: &mut dyn FnMut(Warning),
) -> Result<Trajectory, ImportError> {
    let own = rows.next_if(|(_, content)| header::is_names(content)).map(|(at, content)| (at.line, content));
    let Some(&(at, first)) = rows.peek() else {
        return Err(ImportError::TooShort { file: file.to_owned(), frames: 0 });
    };
    let separator = Separator::of(first);
    let fields = separator.split(first);
    let columns = filled(&fields);
    let header = header::of_file(file, comments, own, [columns, fields.len()])?;
    if let Some(warning) = header.as_ref().and_then(|header| header.warning(file)) {
        warn(warning);
    }
    let layout = header.map(|header| header.layout).or_else(|| Layout::of_count(columns));
    let layout =
        layout.ok_or_else(|| ImportError::Format { file: file.to_owned(), line: at.line, columns })?;
    let mut clock = None;
    let mut samples = Vec::new();
    let mut reader = Reader::new(file, &layout, comments, place)?;
    for (at, content) in rows {
        let row = Row::new(at, separator.split(content), layout.columns)?;
        let time = row.text(layout.time)?;
        match &mut clock {
            None => clock = Some(Clock::new(at, time)?),
            Some(clock) => clock.read(at, time)?,
        }
        samples.push(reader.sample(&row)?);
    }
    let frames = samples.len();
    let Some(clock) = clock.filter(|_| frames > 1) else {
        return Err(ImportError::TooShort { file: file.to_owned(), frames });
    };
    let (start, times) = clock.seconds(file, layout.per_second, layout.geographic.is_some(), warn)?;
    for (sample, time) in samples.iter_mut().zip(times) {
        sample.time = time;
    }
    let units = reader.in_metres().then(|| "m".to_owned());
    Ok(Trajectory { start, samples, units, fov_y: None, aspect: None })
}

/// The columns of a line.
struct Row<'a> {
    at: Line<'a>,
    fields: Vec<&'a str>,
}

impl<'a> Row<'a> {
    /// A line may end with separators that nothing follows.
    fn new(at: Line<'a>, fields: Vec<&'a str>, expected: usize) -> Result<Self, ImportError> {
        if (filled(&fields)..=fields.len()).contains(&expected) {
            return Ok(Self { at, fields });
        }
        let columns = if fields.len() < expected { fields.len() } else { filled(&fields) };
        Err(ImportError::Columns { file: at.file.to_owned(), line: at.line, expected, columns })
    }

    fn text(&self, index: usize) -> Result<&'a str, ImportError> {
        let text = self.fields.get(index).copied().filter(|text| !text.is_empty());
        let (file, line, column) = (self.at.file, self.at.line, index + 1);
        text.ok_or_else(|| ImportError::Empty { file: file.to_owned(), line, column })
    }

    fn number(&self, index: usize) -> Result<f64, ImportError> {
        Ok(self.at.number(self.text(index)?)?)
    }
}

/// What makes a sample of a row.
struct Reader<'a> {
    layout: &'a Layout,
    /// Where places are read in degrees.
    plane: Option<Plane>,
    camera: glam::DQuat,
    upright: glam::DQuat,
}

impl<'a> Reader<'a> {
    fn new(
        file: &FilePath,
        layout: &'a Layout,
        comments: &[(usize, &str)],
        place: Place,
    ) -> Result<Self, ImportError> {
        let plane = match (place, layout.geographic, layout.local) {
            (Place::Fitted, _, Some(_)) | (_, None, _) => None,
            (Place::Fitted, Some(_), None) => Some(Plane::AtFirst(None)),
            (Place::Kept(Some(degrees)), Some(_), _) => Some(Plane::OfMesh(degrees)),
            (Place::Kept(None), Some(_), _) => return Err(ImportError::NoDegrees { file: file.to_owned() }),
        };
        let comments: Vec<String> = comments.iter().map(|(_, text)| text.to_lowercase()).collect();
        let comments = comments.join("\n");
        let upright = match place {
            Place::Fitted => upright(&comments),
            Place::Kept(_) => glam::DQuat::IDENTITY,
        };
        Ok(Self { layout, plane, camera: camera_in_body(&comments), upright })
    }

    fn in_metres(&self) -> bool {
        self.plane.is_some()
    }

    /// The sample, but for its time.
    fn sample(&mut self, row: &Row) -> Result<Sample, ImportError> {
        let on_earth = self.layout.geographic.filter(|_| self.plane.is_some());
        let mut place = [0.0; 3];
        // One of both is there.
        for (value, column) in place.iter_mut().zip(on_earth.or(self.layout.local).into_iter().flatten()) {
            *value = row.number(column.index)? * column.factor;
        }
        let position = match &mut self.plane {
            Some(plane) => plane.position(row.at, place)?,
            None => place.into(),
        };
        let mut orientation = None;
        if let Some(columns) = self.layout.rotation {
            let mut quaternion = [0.0; 4];
            for (value, column) in quaternion.iter_mut().zip(columns) {
                *value = row.number(column)?;
            }
            orientation = Some(self.upright * (row.at.rotation(quaternion)? * self.camera));
        }
        Ok(Sample { time: 0.0, position: self.upright * position, orientation })
    }
}
