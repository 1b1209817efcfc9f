//! The collapse log, from which every backend is built: a mesh, and the half-edge collapses that simplify it, in order.
//!
//! It may be in memory ([`CollapseLog`]) or in a file (`LogFile`); whoever reads it in sequence, as `LogSource`, need not
//! know. A log may be larger than memory: `external` has what it takes to sort and to look up its records then, and
//! [`z_order`] puts those that are near in space near to each other.
//!
//! All that touches a file is there with the feature `files`, which is on by default.

#![cfg_attr(docsrs, feature(doc_cfg))]

mod curve;
#[cfg(feature = "files")]
pub mod external;
mod log;
#[cfg(feature = "files")]
mod log_file;
#[cfg(feature = "files")]
mod log_source;
mod mesh;

#[cfg(test)]
mod tests;

pub use curve::z_order;
pub use log::{Collapse, CollapseLog, Forest, LogError};
#[cfg(feature = "files")]
pub use log_file::{LogCounts, LogFileError, log_file_version, read_log, write_log, write_log_from};
#[cfg(feature = "files")]
pub use log_source::{LogFile, LogSource, Records};
pub use mesh::Mesh;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
