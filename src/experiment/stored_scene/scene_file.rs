//! `.scene` files: text, one object a line, a file name and a 3 by 4 matrix row by row.
//!
//! ```text
//! # a dragon, and a bunny twice as large, a quarter turned about y, and 3 units to the right
//! dragon.mt   1 0 0 0  0 1 0 0   0 0 1 0
//! bunny.meta  0 0 2 3  0 2 0 0  -2 0 0 0
//! ```
//!
//! Lines that are empty or start with `#` count for nothing. The last twelve words of a line are the matrix; what stands
//! before them is the name, which may have spaces in it. Names are relative to the folder of the scene file. A file is anything that
//! `build` wrote, of any backend, or a mesh.

use std::io;
use std::path::{Path, PathBuf};

use crate::experiment::path::shown::beginning;
use selection::objects::{Placement, PlacementError};

/// A scene file can not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneFileError {
    /// The operating system said no.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A line does not have a name and twelve numbers.
    #[error("{}: line {line}: {words} words, expected a file and twelve numbers", file.display())]
    Words {
        /// The file.
        file: PathBuf,
        /// Counted from 1.
        line: usize,
        /// How many words there are.
        words: usize,
    },
    /// A word is not a number.
    #[error("{}: line {line}: {word:?} is not a number", file.display())]
    Number {
        /// The file.
        file: PathBuf,
        /// Counted from 1.
        line: usize,
        /// As found.
        word: String,
    },
    /// A matrix does not place an object.
    #[error("{}: line {line}: {source}", file.display())]
    Placement {
        /// The file.
        file: PathBuf,
        /// Counted from 1.
        line: usize,
        /// Why.
        source: PlacementError,
    },
    /// There is no object in it.
    #[error("{}: no object", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
}

/// Reads a scene: the file of each object and where it is placed.
///
/// # Errors
/// The first line that is wrong.
pub fn read_scene(path: &Path) -> Result<Vec<(PathBuf, Placement)>, SceneFileError> {
    Ok(read_lines(path)?.into_iter().map(|(_, file, placement)| (file, placement)).collect())
}

/// The same with the line of each object.
pub(super) fn read_lines(path: &Path) -> Result<Vec<(usize, PathBuf, Placement)>, SceneFileError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| SceneFileError::Io { file: path.to_owned(), source })?;
    let file = || path.to_owned();
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut objects = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        // A byte order mark, with which some editors begin text, would be part of the name; files that have been joined have it
        // inside.
        let text = text.trim_start_matches('\u{feff}').trim();
        if text.is_empty() || text.starts_with('#') {
            continue;
        }
        // The matrix is taken from the end, the name is what is left.
        let mut name = text;
        let mut rows = [0.0; 12];
        for (found, number) in rows.iter_mut().rev().enumerate() {
            let Some((rest, word)) = name.trim_end().rsplit_once(char::is_whitespace) else {
                return Err(SceneFileError::Words { file: file(), line, words: found + 1 });
            };
            *number = word.parse().map_err(|_| SceneFileError::Number {
                file: file(),
                line,
                word: beginning(word),
            })?;
            name = rest;
        }
        let placement = Placement::from_rows(rows).map_err(|source| SceneFileError::Placement {
            file: file(),
            line,
            source,
        })?;
        objects.push((line, folder.join(name.trim_end()), placement));
    }
    if objects.is_empty() {
        return Err(SceneFileError::Empty { file: file() });
    }
    Ok(objects)
}
