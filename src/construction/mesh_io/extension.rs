//! Formats are told by the names of files.

use std::path::Path;

/// The extensions that are read, in lower case.
pub const EXTENSIONS: [&str; 9] = ["obj", "ply", "stl", "off", "hgt", "zip", "png", "tif", "tiff"];

/// The extension in lower case, empty if there is none.
pub(super) fn extension(file: &Path) -> String {
    file.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}
