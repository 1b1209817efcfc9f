//! Reading and writing path files.

use std::fmt::Write as _;
use std::path::Path as FilePath;

use glam::{DQuat, DVec3};

use super::error::PathError;
use super::shown::beginning;
use super::text;
use super::walkthrough::{Path, Pose};
use selection::view::{ViewError, check_aspect, check_eye, check_fov, check_orientation};

impl Path {
    /// Reads a path file. Comments may be in any encoding that has ASCII in it; what is not UTF-8 is taken for Latin-1.
    pub fn read(file: &FilePath) -> Result<Self, PathError> {
        Self::parse(file, &text::read(file)?)
    }

    /// Reads the text of a path file; `file` names it in errors.
    ///
    /// ```text
    /// # foldfront path
    /// # name city-calm
    /// # units m
    /// # fov 60
    /// # aspect 1.7777777777777777
    /// # t x y z qx qy qz qw
    /// 0 -521.3 -281.1 5.5 0.5 -0.5 -0.5 0.5
    /// ```
    ///
    /// The field of view is vertical, in degrees, or in radians where `rad` follows. Field of view and aspect must be
    /// given; the name is otherwise that of the file. Other comments are skipped. A quaternion whose length is within
    /// a millionth of 1 is kept to the bit, any other is normalised.
    pub fn parse(file: &FilePath, text: &str) -> Result<Self, PathError> {
        let stem = file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let mut path =
            Self { name: stem, units: "units".to_owned(), fov_y: 0.0, aspect: 0.0, frames: Vec::new() };
        for (index, content) in text::lines(text).enumerate() {
            let at = Line { file, line: index + 1 };
            if let Some(comment) = content.strip_prefix('#') {
                at.header(comment.trim(), &mut path)?;
            } else if !content.is_empty() {
                let pose = at.pose(content)?;
                if let Some(&Pose { time: previous, .. }) = path.frames.last() {
                    at.check_time(pose.time, previous)?;
                }
                path.frames.push(pose);
            }
        }
        let missing = |key| PathError::MissingHeader { file: file.to_owned(), key };
        if path.fov_y == 0.0 {
            return Err(missing("fov"));
        }
        if path.aspect == 0.0 {
            return Err(missing("aspect"));
        }
        if path.frames.is_empty() {
            return Err(PathError::NoFrames { file: file.to_owned() });
        }
        Ok(path)
    }

    /// The text of the path file. Reading it gives the same path, to the bit; line breaks in the name or the units
    /// become spaces.
    #[must_use]
    pub fn to_text(&self) -> String {
        let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let degrees = self.fov_y.to_degrees();
        let rounded = (degrees * 1e9).round() / 1e9;
        let fov = match [rounded, degrees].into_iter().find(|degrees| degrees.to_radians() == self.fov_y) {
            Some(degrees) => degrees.to_string(),
            None => format!("{} rad", self.fov_y),
        };
        let mut text = format!(
            "# foldfront path\n# name {}\n# units {}\n# fov {fov}\n# aspect {}\n# t x y z qx qy qz qw\n",
            one_line(&self.name),
            one_line(&self.units),
            self.aspect
        );
        for Pose { time, position: p, orientation: q } in &self.frames {
            // Writing to a string can not fail.
            let _ = writeln!(text, "{time} {} {} {} {} {} {} {}", p.x, p.y, p.z, q.x, q.y, q.z, q.w);
        }
        text
    }

    /// Writes a path file, under a temporary name first.
    ///
    /// # Errors
    /// What [`Path::read`] would refuse is not written; the line is the one that it would have in the file.
    pub fn write(&self, file: &FilePath) -> Result<(), PathError> {
        self.check(file)?;
        container::output::write(file, self.to_text().as_bytes())
            .map_err(|source| PathError::Write { file: file.to_owned(), source })
    }
}

/// Line of the field of view in what is written; the aspect is on the next, the first frame behind the names of columns.
const FOV_LINE: usize = 4;

impl Path {
    /// Whether [`Path::to_text`] is what [`Path::parse`] takes.
    fn check(&self, file: &FilePath) -> Result<(), PathError> {
        let at = |line| Line { file, line };
        at(FOV_LINE).check_fov(self.fov_y, &format!("{} rad", self.fov_y))?;
        at(FOV_LINE + 1).check_aspect(self.aspect, &self.aspect.to_string())?;
        let mut previous = None;
        for (index, &Pose { time, position: p, orientation }) in self.frames.iter().enumerate() {
            let at = at(FOV_LINE + 3 + index);
            let quaternion = orientation.to_array();
            for number in [time].into_iter().chain(p.to_array()).chain(quaternion) {
                if !number.is_finite() {
                    return Err(at.not_a_number(&number.to_string()));
                }
            }
            at.camera(check_eye(p))?;
            at.rotation(quaternion)?;
            if let Some(previous) = previous.replace(time) {
                at.check_time(time, previous)?;
            }
        }
        if self.frames.is_empty() {
            return Err(PathError::NoFrames { file: file.to_owned() });
        }
        Ok(())
    }
}

/// A line of a file, for errors.
#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    pub file: &'a FilePath,
    pub line: usize,
}

impl Line<'_> {
    fn header(self, comment: &str, path: &mut Path) -> Result<(), PathError> {
        let (key, value) = comment.split_once(char::is_whitespace).unwrap_or((comment, ""));
        let value = value.trim();
        match key {
            "name" if !value.is_empty() => value.clone_into(&mut path.name),
            "units" if !value.is_empty() => value.clone_into(&mut path.units),
            "fov" => {
                let (number, unit) = value.split_once(char::is_whitespace).unwrap_or((value, ""));
                let number: f64 = number.parse().unwrap_or(f64::NAN);
                path.fov_y = if unit.trim() == "rad" { number } else { number.to_radians() };
                self.check_fov(path.fov_y, value)?;
            }
            "aspect" => {
                path.aspect = value.parse().unwrap_or(f64::NAN);
                self.check_aspect(path.aspect, value)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Radians; `value` is what stands in the file.
    fn check_fov(self, fov_y: f64, value: &str) -> Result<(), PathError> {
        let wrong = |_| self.header_out_of_range("fov", value, "above 0 and below 180 degrees");
        check_fov(fov_y).map(drop).map_err(wrong)
    }

    fn check_aspect(self, aspect: f64, value: &str) -> Result<(), PathError> {
        let wrong = |_| self.header_out_of_range("aspect", value, "a finite number above 0");
        check_aspect(aspect).map(drop).map_err(wrong)
    }

    fn camera<T>(self, checked: Result<T, ViewError>) -> Result<T, PathError> {
        checked.map_err(|source| PathError::Camera { file: self.file.to_owned(), line: self.line, source })
    }

    fn header_out_of_range(self, key: &'static str, value: &str, range: &'static str) -> PathError {
        let (file, line) = (self.file.to_owned(), self.line);
        PathError::Header { file, line, key, value: beginning(value), range }
    }

    fn not_a_number(self, value: &str) -> PathError {
        PathError::Number { file: self.file.to_owned(), line: self.line, value: beginning(value) }
    }

    /// A finite number.
    pub fn number(self, value: &str) -> Result<f64, PathError> {
        value.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| self.not_a_number(value))
    }

    /// The numbers of a line.
    pub fn numbers(self, content: &str) -> Result<Vec<f64>, PathError> {
        content.split_whitespace().map(|value| self.number(value)).collect()
    }

    /// `t x y z qx qy qz qw`.
    pub fn pose(self, content: &str) -> Result<Pose, PathError> {
        let numbers = self.numbers(content)?;
        let &[time, x, y, z, qx, qy, qz, qw] = numbers.as_slice() else {
            let columns = numbers.len();
            return Err(PathError::Columns { file: self.file.to_owned(), line: self.line, columns });
        };
        let position = self.camera(check_eye(DVec3::new(x, y, z)))?;
        Ok(Pose { time, position, orientation: self.rotation([qx, qy, qz, qw])? })
    }

    pub fn rotation(self, value: [f64; 4]) -> Result<DQuat, PathError> {
        let quaternion = DQuat::from_array(value);
        let squared = quaternion.length_squared();
        if !(1e-24..1e24).contains(&squared) {
            return Err(PathError::Rotation { file: self.file.to_owned(), line: self.line, value });
        }
        Ok(check_orientation(quaternion).unwrap_or_else(|_| quaternion.normalize()))
    }

    pub fn check_time(self, time: f64, previous: f64) -> Result<(), PathError> {
        if time > previous {
            return Ok(());
        }
        Err(PathError::Time { file: self.file.to_owned(), line: self.line, time, previous })
    }
}
