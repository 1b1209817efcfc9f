//! STL in text.
//!
//! ```text
//! solid NAME
//!   facet normal 0 0 1
//!     outer loop
//!       vertex 0 0 0
//!       vertex 1 0 0
//!       vertex 0 1 0
//!     endloop
//!   endfacet
//! endsolid NAME
//! ```
//!
//! A name ends with its line, or before `facet normal`.

use std::hash::Hash;

use super::error::{MeshIoError, Place};
use super::input::Input;
use super::weld::Weld;
use super::words::Words;

pub(super) fn read_text<K: Hash + Eq>(
    mut input: Input<'_>,
    weld: &mut Weld<'_, K>,
) -> Result<(), MeshIoError> {
    let file = input.path;
    let mut words = Words::new(&mut input, 1);
    let mut corners = Vec::new();
    let mut open = false;
    // The line on which numbers may follow that nobody reads: a normal, or what some write behind a corner.
    let mut numbers = 0;
    while let Some(keyword) = next(&mut words)? {
        match keyword.as_str() {
            "solid" => {
                open = true;
                skip_name(&mut words)?;
            }
            "facet" => open = true,
            "normal" => {
                for _ in 0..3 {
                    let Some(word) = next(&mut words)? else { break };
                    if KEYWORDS.contains(&&*word) {
                        words.put_back();
                        break;
                    }
                }
                numbers = words.line;
            }
            "vertex" if corners.len() < 3 => {
                let mut corner = [0.0; 3];
                for coordinate in &mut corner {
                    *coordinate = words.coordinate()?;
                }
                corners.push(corner);
                numbers = words.line;
            }
            "endfacet" => end_facet(&mut corners, weld, &words)?,
            "endsolid" => {
                open = false;
                skip_name(&mut words)?;
            }
            "end" => match next(&mut words)?.as_deref() {
                Some("facet") => end_facet(&mut corners, weld, &words)?,
                Some("loop") => {}
                Some("solid") => {
                    open = false;
                    skip_name(&mut words)?;
                }
                _ => return Err(words.malformed("loop, facet or solid behind \"end\"")),
            },
            "outer" | "loop" | "endloop" => {}
            word if words.line == numbers && word.parse::<f64>().is_ok() => {}
            _ => return Err(words.malformed("an STL keyword")),
        }
    }
    if !open && corners.is_empty() {
        return Ok(());
    }
    Err(MeshIoError::Truncated { file: file.to_owned(), place: Place::Line(words.line) })
}

/// What can follow a normal.
const KEYWORDS: [&str; 7] = ["outer", "loop", "vertex", "endloop", "endfacet", "end", "endsolid"];

/// The next word in lower case.
fn next(words: &mut Words<'_, '_>) -> Result<Option<String>, MeshIoError> {
    let word = words.next().map(|word| word.map(str::to_ascii_lowercase));
    word.map_err(|e| words.input.io(Place::Line(words.line), e))
}

fn end_facet<K: Hash + Eq>(
    corners: &mut Vec<[f64; 3]>,
    weld: &mut Weld<'_, K>,
    words: &Words<'_, '_>,
) -> Result<(), MeshIoError> {
    let Ok(facet) = <[_; 3]>::try_from(&**corners) else {
        let (place, found) = (Place::Line(words.line), corners.len().to_string());
        let file = words.input.path.to_owned();
        return Err(MeshIoError::Malformed { file, place, expected: "three vertices", found });
    };
    corners.clear();
    weld.push(facet, words.input.path)
}

/// Goes past the rest of the line, or up to a facet that follows on it.
fn skip_name(words: &mut Words<'_, '_>) -> Result<(), MeshIoError> {
    let line = words.line;
    let mut facet = false;
    while let Some(word) = next(words)? {
        if words.line != line || facet && word == "normal" {
            words.put_back();
            break;
        }
        facet = word == "facet";
    }
    Ok(())
}
