//! Which column is what, as a header says it.

use std::path::Path as FilePath;

use super::error::{ImportError, Warning};
use super::fields::{Separator, filled};
use super::names::{Name, Role, words};
use crate::experiment::path::shown::beginning;

/// A column that is read, and what turns it into metres or degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Column {
    pub index: usize,
    pub factor: f64,
}

/// Where in a line the parts of a sample are. At least one of `local` and `geographic` is there.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    pub columns: usize,
    pub time: usize,
    /// Times are this many to a second, if that is said.
    pub per_second: Option<f64>,
    /// x, y and z.
    pub local: Option<[Column; 3]>,
    /// Latitude, longitude and height.
    pub geographic: Option<[Column; 3]>,
    /// x, y, z and w of a quaternion.
    pub rotation: Option<[usize; 4]>,
}

impl Layout {
    /// That of a file that does not name its columns.
    pub fn of_count(columns: usize) -> Option<Self> {
        let column = |index| Column { index, factor: 1.0 };
        let rotation = match columns {
            8 => Some([4, 5, 6, 7]),
            4 => None,
            _ => return None,
        };
        let local = Some([1, 2, 3].map(column));
        Some(Self { columns, time: 0, per_second: None, local, geographic: None, rotation })
    }
}

/// A header, and on which line.
pub(super) struct Header {
    pub line: usize,
    pub layout: Layout,
    names: Vec<Name>,
}

impl Header {
    /// A word about attitude that is recorded but not read.
    pub fn warning(&self, file: &FilePath) -> Option<Warning> {
        let attitude = |name: &&Name| name.role == Some(Role::Attitude);
        let names: Vec<&str> = self.names.iter().filter(attitude).map(|name| name.text.as_str()).collect();
        let (file, line) = (file.to_owned(), self.line);
        let unread = !names.is_empty() && self.layout.rotation.is_none();
        unread.then(|| Warning::Attitude { file, line, names: beginning(&names.join(", ")) })
    }
}

/// The header of a file: the comment, or the line `own` in front of the frames, that names the columns of a frame. That
/// has `columns`, of which the last that is not empty is number `filled`.
///
/// # Errors
/// Two headers that differ, one that does not fit the frames or leaves out or repeats what is needed, and, without one,
/// prose that lets expect another order than the usual one.
pub(super) fn of_file(
    file: &FilePath,
    comments: &[(usize, &str)],
    own: Option<(usize, &str)>,
    [filled, columns]: [usize; 2],
) -> Result<Option<Header>, ImportError> {
    let fault = |line, reason| ImportError::Header { file: file.to_owned(), line, reason };
    let mut found = None;
    if let Some((line, text)) = own {
        let names = in_line(text);
        let layout = layout(&names).map_err(|reason| fault(line, reason))?;
        found = Some(Header { line, layout, names });
    }
    for &(line, comment) in comments {
        let named = of_comment(comment, filled, columns).map_err(|reason| fault(line, reason))?;
        let Some((names, layout)) = named else { continue };
        match &found {
            Some(other) if other.layout != layout => {
                return Err(fault(line, format!("the columns have other names than on line {}", other.line)));
            }
            Some(_) => {}
            None => found = Some(Header { line, layout, names }),
        }
    }
    if found.is_none()
        && let Some((line, said)) = comments.iter().find_map(|&(line, comment)| Some((line, hint(comment)?)))
    {
        let reason = format!("{said} is said, but not which column is what, as in `# t x y z qw qx qy qz`");
        return Err(fault(line, reason));
    }
    Ok(found)
}

/// Whether a line consists of names, not of numbers.
pub(super) fn is_names(line: &str) -> bool {
    let names = in_line(line);
    names.iter().all(|name| name.text.parse::<f64>().is_err())
        && names.iter().filter(|name| name.role.is_some()).count() >= 2
}

/// The names in a line that has nothing else.
fn in_line(line: &str) -> Vec<Name> {
    let line = units_joined(line);
    let fields = Separator::of(&line).split(&line);
    fields[..filled(&fields)].iter().map(|field| Name::new(field)).collect()
}

/// The names in a comment, if it has names. `Err` says what is wrong with them.
fn of_comment(comment: &str, least: usize, most: usize) -> Result<Option<(Vec<Name>, Layout)>, String> {
    let comment = units_joined(comment);
    let fits = |names: &[Name]| (least..=most).contains(&names.len());
    let mut mismatch = None;
    for separator in [Separator::Semicolon, Separator::Comma, Separator::Any] {
        let fields = separator.split(&comment);
        let mut names: Vec<Name> = fields[..filled(&fields)].iter().map(|field| Name::new(field)).collect();
        // Words such as `columns:` before the names, and a remark behind them.
        let known = |name: &Name| name.role.is_some();
        if !fits(&names) {
            let first = names.iter().position(known).unwrap_or(0);
            let last = names.iter().rposition(known).map_or(first, |last| last + 1);
            if (least..=most).contains(&(last - first)) && names[first..last].iter().all(known) {
                names = names[first..last].to_vec();
            }
        }
        let count = names.iter().filter(|name| known(name)).count();
        // Anything less is prose.
        let meant = count >= 3 && 2 * count >= names.len();
        match (layout(&names), fits(&names)) {
            (Ok(layout), true) => return Ok(Some((names, layout))),
            (Ok(layout), false) if meant => {
                mismatch = Some(format!("{} columns are named, but frames have {least}", layout.columns));
            }
            (Err(reason), true) if meant => return Err(reason),
            _ => {}
        }
    }
    mismatch.map_or(Ok(None), Err)
}

/// A header without the space before and in the brackets of units, so that only separators are left. Brackets around
/// names, as in `(x y z)`, are taken away.
fn units_joined(comment: &str) -> String {
    let mut joined = String::new();
    let mut rest = comment;
    while let Some(start) = rest.find(['[', '(']) {
        let Some(length) = rest[start..].find([']', ')']) else { break };
        let inside = &rest[start + 1..start + length];
        let names = Separator::Any.split(inside);
        if names.len() > 1 && names.iter().all(|name| Name::new(name).role.is_some() || *name == "w") {
            joined += &rest[..start];
            joined += " ";
            joined += inside;
            joined += " ";
        } else {
            joined += rest[..start].trim_end();
            joined += &rest[start..=start];
            joined += &inside
                .split(|c: char| c.is_whitespace() || matches!(c, ',' | ';'))
                .collect::<Vec<_>>()
                .join("_");
            joined += &rest[start + length..=start + length];
        }
        rest = &rest[start + length + 1..];
    }
    joined + rest
}

/// Where the names put everything that is needed.
fn layout(names: &[Name]) -> Result<Layout, String> {
    let column = |role: Role, name: &str| -> Result<Option<Column>, String> {
        let having = || names.iter().enumerate().filter(|(_, name)| name.role == Some(role));
        let Some(rank) = having().map(|(_, name)| name.rank).min() else { return Ok(None) };
        let mut best = having().filter(|(_, name)| name.rank == rank);
        match (best.next(), best.next()) {
            (Some((i, a)), Some((j, b))) => {
                let (i, j, [a, b]) = (i + 1, j + 1, [a, b].map(|name| beginning(&name.text)));
                Err(format!("columns {i} and {j}, {a:?} and {b:?}, could both be the {name}"))
            }
            (Some((index, found)), None) => match role.factor(&found.unit) {
                Some(factor) => Ok(Some(Column { index, factor })),
                None => {
                    let [text, unit] = [&found.text, &found.unit].map(|text| beginning(text));
                    Err(format!("{text:?}: no unit {unit:?} of a {name} is known"))
                }
            },
            _ => Ok(None),
        }
    };
    let lacking = |name: &str| format!("no column is named for the {name}");
    let time = column(Role::Time, "time")?.ok_or_else(|| lacking("time"))?;
    let said = !names[time.index].unit.is_empty();
    let [x, y, z] = [column(Role::X, "x")?, column(Role::Y, "y")?, column(Role::Z, "z")?];
    let [latitude, longitude] = [column(Role::Latitude, "latitude")?, column(Role::Longitude, "longitude")?];
    let height = column(Role::Height, "height")?;
    let all = |[a, b, c]: [Option<Column>; 3]| Some([a?, b?, c?]);
    let local = all([x, y, z.or(height)]);
    let geographic = all([latitude, longitude, height.or(z)]);
    if local.is_none() && geographic.is_none() {
        let on_earth = latitude.is_some() || longitude.is_some();
        let needed = if on_earth {
            [("latitude", latitude), ("longitude", longitude), ("height", height.or(z))]
        } else {
            [("x", x), ("y", y), ("z", z.or(height))]
        };
        let missing = needed.iter().find(|(_, column)| column.is_none());
        return Err(lacking(missing.map_or("place", |(name, _)| name)));
    }
    let parts = [(Role::Qx, "qx"), (Role::Qy, "qy"), (Role::Qz, "qz"), (Role::Qw, "qw")];
    let mut rotation = [None; 4];
    for (place, (role, name)) in rotation.iter_mut().zip(parts) {
        *place = column(role, name)?.map(|column| column.index);
    }
    let rotation = match rotation {
        [None, None, None, None] => None,
        [Some(x), Some(y), Some(z), Some(w)] => Some([x, y, z, w]),
        _ => {
            let missing = rotation.iter().zip(parts).find(|(column, _)| column.is_none());
            return Err(lacking(missing.map_or("rotation", |(_, (_, name))| name)));
        }
    };
    let per_second = said.then_some(time.factor);
    Ok(Layout { columns: names.len(), time: time.index, per_second, local, geographic, rotation })
}

/// What prose says of the columns that a file without a header must not be read against.
fn hint(comment: &str) -> Option<&'static str> {
    let words = words(comment);
    let run = |run: &[&str]| words.windows(run.len()).any(|window| window == run);
    if run(&["w", "x", "y", "z"])
        || run(&["qw", "qx", "qy", "qz"])
        || run(&["q", "w", "q", "x"])
        || run(&["wxyz"])
        || run(&["w", "first"])
        || run(&["scalar", "first"])
    {
        return Some("that w comes first");
    }
    let named = |names: [&str; 2]| words.iter().any(|word| names.contains(&word.as_str()));
    (named(["lat", "latitude"]) && named(["lon", "longitude"]))
        .then_some("something of latitude and longitude")
}
