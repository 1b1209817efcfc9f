//! Walkthroughs: a camera recorded frame by frame.
//!
//! A path file is text in the order of the TUM RGB-D benchmark, one frame a line, `t x y z qx qy qz qw`: seconds,
//! eye position in world coordinates (object space, unless the mesh has a georeference), and the rotation from camera
//! space (looking along -z, y up) to object space. Lines that start with `#` before the frames are the header. See
//! [`Path::parse`].

mod around;
mod director;
mod error;
mod format;
mod generate;
pub mod import;
pub(super) mod shown;
mod summary;
mod text;
mod walkthrough;

#[cfg(feature = "cli")]
pub(crate) use around::FOV_Y;
pub use around::around;
pub use error::PathError;
pub use generate::{generate, recorded};
pub use summary::{Motion, Summary};
pub use walkthrough::{Path, Pose};
