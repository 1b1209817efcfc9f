//! What is done with an input, for each format and reader: it is read in every way that there is, and what comes of it is held to what is
//! promised. Whatever is not as it should be panics.
//!
//! Tests replay the corpora through the same functions, so nothing in this folder uses anything but foldfront.

mod heights;
mod log;
mod mesh;
mod paging;
mod path;
mod scene;
pub mod walk;

use std::cell::OnceCell;
use std::path::{Path, PathBuf};

/// How much a target has to stand, by what it reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Text, meshes, height maps, paths, logs.
    Plain,
    /// Hierarchies that page.
    Paging,
    /// Archives.
    Archive,
}

/// A format and what reads it.
pub struct Target {
    /// The name on the command line, and of the folder with its corpus.
    pub name: &'static str,
    /// How much it has to stand.
    pub class: Class,
    /// Reads an input. Whether any reader has taken it.
    pub run: fn(&[u8], &Desk) -> bool,
}

/// All of them.
pub const ALL: [Target; 15] = [
    Target { name: "obj", class: Class::Plain, run: |bytes, desk| mesh::run(bytes, "input.obj", desk) },
    Target { name: "ply", class: Class::Plain, run: |bytes, desk| mesh::run(bytes, "input.ply", desk) },
    Target { name: "stl", class: Class::Plain, run: |bytes, desk| mesh::run(bytes, "input.stl", desk) },
    Target { name: "off", class: Class::Plain, run: |bytes, desk| mesh::run(bytes, "input.off", desk) },
    Target { name: "png", class: Class::Plain, run: |bytes, desk| heights::map(bytes, "input.png", desk) },
    Target { name: "tif", class: Class::Plain, run: |bytes, desk| heights::map(bytes, "input.tif", desk) },
    Target { name: "hgt", class: Class::Plain, run: heights::tile },
    Target { name: "zip", class: Class::Archive, run: heights::archive },
    Target { name: "path", class: Class::Plain, run: path::recorded },
    Target { name: "import", class: Class::Plain, run: path::imported },
    Target { name: "scene", class: Class::Plain, run: scene::run },
    Target { name: "fold", class: Class::Plain, run: log::run },
    Target { name: "meta", class: Class::Paging, run: paging::meta_node },
    Target { name: "xfm", class: Class::Paging, run: paging::detail_block },
    Target { name: "mt", class: Class::Paging, run: paging::mt_partition },
];

/// The folder in which inputs lie for readers that want a file.
pub struct Desk {
    folder: PathBuf,
    /// What trajectories are fitted to.
    ground: OnceCell<foldfront::Mesh>,
}

impl Desk {
    /// At a folder that nobody else uses.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), ground: OnceCell::new() }
    }

    /// Writes an input as a file.
    fn lay(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.folder.join(name);
        std::fs::write(&path, bytes).expect("a folder to write to");
        path
    }
}

/// The longest error text. Names of files are in it, which are as long as they are.
const LONGEST: usize = 400;

/// An error is one line that can be shown and read.
fn check_error(error: &dyn std::error::Error) {
    let text = error.to_string();
    assert!(!text.trim().is_empty(), "an error that says nothing: {error:?}");
    assert!(text.len() <= LONGEST, "an error of {} bytes: {text:.80}", text.len());
    let odd = text.chars().find(|c| c.is_control());
    assert_eq!(odd, None, "an error with a control character: {text:?}");
}

/// A number of an input by which choices are made: the same for the same input.
fn choice(bytes: &[u8]) -> u64 {
    // FNV-1a.
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
